//! The errors of bodies and of tracking, which state what was expected and what was found.

use std::fmt::Display;

/// What is not as expected: an entry of a body, a number of a camera, a parameter, or a measurement.
///
/// ```
/// use voodoo_core::Camera;
///
/// let error = Camera::pinhole(640, 480, [-525.0, 525.0, 319.5, 239.5]).unwrap_err();
/// assert_eq!(error.to_string(), "camera fx, fy: expected finite focal lengths above zero, found -525, 525");
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{what}: expected {expected}, found {found}")]
pub struct Unexpected {
    /// Name of the entry or the argument.
    pub what: String,
    /// What was expected.
    pub expected: String,
    /// What was found.
    pub found: String,
}

impl Unexpected {
    /// The name of an entry or argument, what was expected and what was found.
    pub fn new(what: impl Display, expected: impl Display, found: impl Display) -> Self {
        Self { what: what.to_string(), expected: expected.to_string(), found: found.to_string() }
    }

    /// Rejects what is not valid; the texts are made only then.
    pub fn unless(valid: bool, what: impl Display, expected: impl Display, found: impl Display) -> Result<(), Self> {
        if valid { Ok(()) } else { Err(Self::new(what, expected, found)) }
    }
}

/// A body description that cannot be tracked. `key` is the path of the offending entry.
///
/// ```
/// use voodoo_core::{Body, BodyError, HumanModel};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// match body.site_index("left_wrist") {
///     Err(BodyError::Unknown { name, known, .. }) => {
///         assert!(name == "left_wrist" && known.contains(&"l_wrist".to_owned()));
///     }
///     other => unreachable!("{other:?}"),
/// }
/// # Ok::<(), BodyError>(())
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// A name that is not in the body.
    #[error("{what}: unknown {what} {name:?}; known are: {}", known.join(", "))]
    Unknown {
        /// `limb` or `site`.
        what: &'static str,
        /// The requested name.
        name: String,
        /// The known names.
        known: Vec<String>,
    },
    /// A value outside its domain, or a human name that contradicts the others.
    #[error(transparent)]
    Value(#[from] Unexpected),
}

/// Why the tracker rejected a call. The tracker is unchanged afterwards.
///
/// ```
/// use voodoo_core::math::Pose;
/// use voodoo_core::{Body, Config, Frame, HumanModel, TrackError, Tracker};
///
/// let body = Body::human(1.75, HumanModel::Measured)?;
/// let mut tracker = Tracker::new(body.clone(), Config::default())?;
/// tracker.reset_pose(&body.rest_pose(Pose::IDENTITY))?;
/// tracker.step(&Frame::empty(1.0))?;
/// let refused = tracker.step(&Frame::empty(0.5)).unwrap_err();
/// assert_eq!(refused, TrackError::TimeBackwards { previous: 1.0, found: 0.5 });
/// assert_eq!(tracker.estimate().stamp, 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// `step` before `reset`.
    #[error("the tracker has no pose yet: call reset first")]
    NotInitialized,
    /// A stamp that is not after the last one.
    #[error("stamp: expected a time after {previous} s, found {found} s")]
    TimeBackwards {
        /// The last accepted stamp.
        previous: f64,
        /// The rejected one.
        found: f64,
    },
    /// A measurement with a value that cannot be used.
    #[error(transparent)]
    Measurement(#[from] Unexpected),
    /// A problem with the body.
    #[error(transparent)]
    Body(#[from] BodyError),
}
