//! Every parameter of the tracker, defined once: name, type, default, range, unit and meaning.
//!
//! The Python package builds its validated `Config` class and the commented TOML from [`Config::FIELDS`].

use serde::{Deserialize, Serialize};
use toml::{Table, Value};

use crate::error::Unexpected;

/// Description of a configuration entry.
///
/// ```
/// use voodoo_core::Config;
///
/// for field in Config::FIELDS {
///     println!("{} [{}]: {} {:?} {:?}", field.name, field.unit, field.doc, field.range, field.words);
/// }
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Field {
    /// Its key.
    pub name: &'static str,
    /// Its meaning, in one or a few sentences.
    pub doc: &'static str,
    /// Its unit; empty when it has none.
    pub unit: &'static str,
    /// Minimum and maximum of a number.
    pub range: Option<(f64, f64)>,
    /// The allowed keywords.
    pub words: &'static [&'static str],
}

impl Field {
    /// Refuses a number outside the range.
    fn check(&self, value: &Value) -> Result<(), Unexpected> {
        let number = value.as_float().or_else(|| value.as_integer().map(|number| number as f64));
        let within = number.zip(self.range).is_none_or(|(number, (low, high))| (low..=high).contains(&number));
        if within { Ok(()) } else { Err(self.refusal(value)) }
    }

    fn refusal(&self, value: &Value) -> Unexpected {
        let expected = match self.range {
            Some((low, high)) => format!("a number from {low} to {high}"),
            None if self.words.is_empty() => "true or false".to_owned(),
            None => format!("one of {}", self.words.join(", ")),
        };
        Unexpected::new(self.name, expected, format_args!("{value:?}"))
    }
}

macro_rules! config {
    ($(
        $(#[doc = $doc:literal])+
        $name:ident: $kind:ty = $default:expr, $unit:literal
        $(, $low:literal ..= $high:literal)? $(, [$($word:literal),+])?;
    )+) => {
        /// The parameters of the tracker. Defaults are the measured ones.
        ///
        /// ```
        /// use voodoo_core::{Body, Config, HumanModel, Overlap, SolverKind, Tracker};
        ///
        /// let mut config = Config::default();
        /// config.solver = SolverKind::Limbwise; // as published, with the ten limbs of the papers
        /// config.overlap = Overlap::Shared;
        /// let tracker = Tracker::new(Body::human(1.75, HumanModel::Papers)?, config)?;
        /// assert_eq!(tracker.config().solver, SolverKind::Limbwise);
        /// # Ok::<(), Box<dyn std::error::Error>>(())
        /// ```
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        #[non_exhaustive]
        pub struct Config { $($(#[doc = $doc])+ pub $name: $kind),+ }

        impl Default for Config {
            fn default() -> Self {
                Self { $($name: $default),+ }
            }
        }

        impl Config {
            /// All entries in the order of their definition.
            pub const FIELDS: &'static [Field] = &[$(Field {
                name: stringify!($name),
                doc: concat!($($doc),+).trim_ascii(),
                unit: $unit,
                range: config!(@range $($low $high)?),
                words: &[$($($word),+)?],
            }),+];
        }
    };
    (@range $low:literal $high:literal) => { Some(($low as f64, $high as f64)) };
    (@range) => { None };
}

impl Config {
    /// Sets one entry, checked for type and range.
    ///
    /// ```
    /// use voodoo_core::Config;
    ///
    /// let mut config = Config::default();
    /// config.set("solver", "tree")?;
    /// let refused = config.set("threads", 0).unwrap_err();
    /// assert_eq!(refused.to_string(), "threads: expected a number from 1 to 256, found Integer(0)");
    /// assert_eq!(config.threads, 1);
    /// # Ok::<(), voodoo_core::Unexpected>(())
    /// ```
    pub fn set(&mut self, key: &str, value: impl Into<Value>) -> Result<(), Unexpected> {
        let value = value.into();
        let unknown = || Unexpected::new("key", "one of the configuration", format_args!("{key:?}"));
        let field = Self::FIELDS.iter().find(|field| field.name == key).ok_or_else(unknown)?;
        field.check(&value)?;
        let mut entries = self.entries()?;
        entries.insert(key.to_owned(), value.clone());
        *self = entries.try_into().map_err(|_| field.refusal(&value))?;
        Ok(())
    }

    /// Refuses a number outside its range.
    pub(crate) fn check(&self) -> Result<(), Unexpected> {
        let entries = self.entries()?;
        Self::FIELDS.iter().try_for_each(|field| entries.get(field.name).map_or(Ok(()), |value| field.check(value)))
    }

    fn entries(&self) -> Result<Table, Unexpected> {
        Table::try_from(self).map_err(|error| Unexpected::new("configuration", "entries", error))
    }

    /// Information of a surface point of weight one, 1/m².
    pub(crate) fn point_information(&self) -> f64 {
        1.0 / (self.point_sigma * self.point_sigma)
    }
}

/// Assignment of a free point inside the boxes of several limbs (K06 IV-B.2).
///
/// [`Config`] has an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Overlap {
    /// To all of them.
    Shared,
    /// To the closest one (K07 3.2).
    Exclusive,
    /// To the closest one, and to those of the others that are joined to it.
    Adjacent,
}

/// Solver of the pose for given correspondences.
///
/// [`Config`] has an example.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum SolverKind {
    /// Each limb alone, by weighted absolute orientation (K06, K07).
    Limbwise,
    /// All limbs at once with exact joints, by damped Gauss-Newton with robust terms (R07, method section 4.3).
    Chain,
    /// All limbs at once, each with a separate twist, joined by stiff elastic bands (K07 section 4).
    Tree,
}

config! {
    /// Solver of the pose for given correspondences.
    solver: SolverKind = SolverKind::Chain, "", ["limbwise", "chain", "tree"];
    /// Maximum number of ICP steps per frame (K07 section 7 recommends 6 of the published ones).
    max_steps: usize = 5, "", 1 ..= 100;
    /// Convergence threshold: the steps end when the mean squared distance changes by less (K06 III-B step 6;
    /// limbwise solver).
    min_change: f64 = 1e-7, "m^2", 0.0 ..= 1.0;
    /// Enlargement of the box around the whole body; free points outside are background (K06 IV-B.1).
    body_box_margin: f64 = 0.20, "m", 0.0 ..= 10.0;
    /// Enlargement of the box of each limb: the largest motion of a limb between two frames (K06 IV-B.2; limbwise solver).
    limb_box_margin: f64 = 0.10, "m", 0.0 ..= 10.0;
    /// Assignment of a free point inside the boxes of several limbs (K06 IV-B.2).
    overlap: Overlap = Overlap::Exclusive, "", ["shared", "exclusive", "adjacent"];
    /// Approximate maximum number of pixels of a depth image; larger images are sampled on a grid.
    max_points: usize = 3000, "", 100 ..= 10000000;
    /// Learn the static background from the depth images of cameras that do not move, and exclude it.
    background: bool = true, "";
    /// Use every n-th point of a limb (K06 IV-B.3).
    sampling_factor: usize = 1, "", 1 ..= 1000;
    /// Minimum number of points of a limb after sampling (K06 IV-B.3).
    min_limb_points: usize = 50, "", 0 ..= 1000000;
    /// Maximum number of points of a limb (K06 IV-B.3).
    max_limb_points: usize = 1000, "", 1 ..= 1000000;
    /// Maximum distance of a matched point from the surface of its limb (K06 IV-B.4; limbwise solver).
    max_distance: f64 = 0.15, "m", 0.001 ..= 10.0;
    /// Weight of the elastic bands of a limb relative to its measurements (K07 4.3: 0.4 to 0.7; limbwise solver).
    band_ratio: f64 = 0.5, "", 0.0 ..= 100.0;
    /// Standard deviation of the length of an elastic band (tree solver).
    band_sigma: f64 = 0.003, "m", 0.00001 ..= 1.0;
    /// Standard deviation of a surface point of weight one, for the whole-body solvers.
    point_sigma: f64 = 0.03, "m", 0.0001 ..= 1.0;
    /// Fraction of the information of a surface point that is tangential, for the whole-body solvers: 0 is point-to-plane,
    /// 1 is point-to-point; a small value prevents limbs from sliding along their axes.
    tangential_weight: f64 = 0.035, "", 0.0 ..= 1.0;
    /// Maximum distance of a matched point in the first step of a frame, for the whole-body solvers; it decreases.
    gate_start: f64 = 0.30, "m", 0.001 ..= 10.0;
    /// Final maximum distance of a matched point, for the whole-body solvers.
    gate_end: f64 = 0.12, "m", 0.001 ..= 10.0;
    /// Scale of the robust kernel in the first step of a frame; it decreases with every step.
    kernel_start: f64 = 0.10, "m", 0.001 ..= 10.0;
    /// Final scale of the robust kernel, for the whole-body solvers.
    kernel_end: f64 = 0.015, "m", 0.001 ..= 10.0;
    /// Standard deviation of an edge of the depth contour.
    depth_contour_sigma: f64 = 0.01, "m", 0.0001 ..= 1.0;
    /// Fraction of the last motion that is extrapolated (0: the body is expected to stand still; whole-body solvers).
    prediction: f64 = 0.6, "", 0.0 ..= 1.0;
    /// Standard deviation of the root's unexpected rotation in 1/30 s.
    root_turn_sigma: f64 = 0.12, "rad", 0.0001 ..= 10.0;
    /// Standard deviation of the root's unexpected translation in 1/30 s.
    root_shift_sigma: f64 = 0.04, "m", 0.0001 ..= 10.0;
    /// Factor of the standard deviations of all unexpected motion, the strength of the jitter penalty (R07 eq. 18, 26).
    /// Smaller values are smoother; measured lag on steady motion: none at 0.25, 0.02 frames at 0.125.
    motion_scale: f64 = 0.25, "", 0.01 ..= 100.0;
    /// Gain of the information of the motion prior for small deviations from the expected motion, which are mostly noise; 0
    /// disables it. Larger values reduce jitter at rest and add lag in slow rotations (whole-body solvers).
    still_prior_gain: f64 = 30.0, "", 0.0 ..= 10000.0;
    /// Try other configurations of arms and legs if the frame contradicts the current ones (whole-body solvers).
    hypotheses: bool = true, "";
    /// Search for a lost or wrongly tracked body at detections of persons; without a detection, search for a lost body in all
    /// foreground objects of its size (whole-body solvers).
    relocalization: bool = true, "";
    /// Match the rims of limbs to the depth contour, in the later steps of a frame (whole-body solvers).
    depth_contour: bool = true, "";
    /// Find the contours of limbs in color images; whole-body solvers match them.
    regions: bool = true, "";
    /// Match depth pixels inside a limb to the side that faces their camera (whole-body solvers).
    facing: bool = true, "";
    /// Penalize joint angles outside their limits (whole-body solvers).
    limits: bool = true, "";
    /// Push the axes of limbs out of other limbs that they are not joined to, and, if the ground plane is known, their ends above
    /// it; hidden legs stand or sit on it (whole-body solvers).
    penetration: bool = true, "";
    /// After a reset with fitted sizes, also fit the girths to the points of the first frame.
    fit_girths: bool = true, "";
    /// After a reset with fitted sizes, refine the lengths of limbs in the following frames; whole-body solvers only.
    fit_lengths: bool = true, "";
    /// Free points below this height above the ground plane are background, if the frame has a ground plane.
    ground_clearance: f64 = 0.04, "m", 0.0 ..= 1.0;
    /// Number of threads of a step. Results are bit-identical for any number.
    threads: usize = 1, "", 1 ..= 256;
}
