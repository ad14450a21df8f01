//! The errors of bodies and of tracking: each says what was expected and what was found.

use crate::shape::ShapeError;

/// A body description that cannot be tracked. `key` is the path of the offending entry.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BodyError {
    /// No limb at all.
    #[error("body: expected at least one limb, found none")]
    Empty,
    /// Two limbs or two sites share a name.
    #[error("{key}: the name {name:?} is already taken")]
    Duplicate {
        /// Where the second one stands.
        key: String,
        /// The name.
        name: String,
    },
    /// A name that is not in the body.
    #[error("{key}: unknown {what} {name:?}; known are: {}", known.join(", "))]
    Unknown {
        /// Where the name was used.
        key: String,
        /// `limb` or `site`.
        what: &'static str,
        /// The name that was asked for.
        name: String,
        /// The names there are.
        known: Vec<String>,
    },
    /// A value outside its domain.
    #[error("{key}: expected {expected}, found {found}")]
    Value {
        /// Where it stands.
        key: String,
        /// What would be right.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// A limb, joint or site with a name of the human's that contradicts the others ([`crate::body::Roles`]).
    #[error("{key}: expected {expected}, found {found}")]
    Role {
        /// Where it stands.
        key: String,
        /// What its name demands.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// A shape that is no solid.
    #[error("{key}: {source}")]
    Shape {
        /// Where it stands.
        key: String,
        /// What is wrong with it.
        source: ShapeError,
    },
}

/// A calibration that no camera can have.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[error("camera {what}: expected {expected}, found {found}")]
pub struct CameraError {
    /// Which of its numbers.
    pub what: &'static str,
    /// What would be right.
    pub expected: &'static str,
    /// What was there.
    pub found: String,
}

impl CameraError {
    pub(crate) fn new(what: &'static str, expected: &'static str, found: impl Into<String>) -> Self {
        Self { what, expected, found: found.into() }
    }
}

/// Why the tracker refused a call. The tracker is unchanged afterwards.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TrackError {
    /// `step` before `reset`.
    #[error("the tracker has no pose yet: call reset first")]
    NotInitialized,
    /// A stamp that is not finite.
    #[error("stamp: expected a finite time in seconds, found {0}")]
    Stamp(f64),
    /// A stamp that is not after the last one.
    #[error("stamp: expected a time after {previous} s, found {found} s")]
    TimeBackwards {
        /// The last accepted stamp.
        previous: f64,
        /// The refused one.
        found: f64,
    },
    /// A measurement with a value that cannot be used.
    #[error("{what}: expected {expected}, found {found}")]
    Measurement {
        /// Which argument.
        what: String,
        /// What would be right.
        expected: &'static str,
        /// What was there.
        found: String,
    },
    /// The given joint positions do not fix the pose.
    #[error("joints: expected at least three positions that do not lie on a line, found {found} position(s)")]
    Underdetermined {
        /// How many positions were given.
        found: usize,
    },
    /// A problem with the body.
    #[error(transparent)]
    Body(#[from] BodyError),
}

impl TrackError {
    /// A measurement that cannot be used: which argument, what would be right, what was there.
    pub fn measurement(what: impl Into<String>, expected: &'static str, found: impl Into<String>) -> Self {
        Self::Measurement { what: what.into(), expected, found: found.into() }
    }
}
