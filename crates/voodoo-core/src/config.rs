//! Every parameter of the tracker, defined once: name, type, default, range, unit and meaning.
//!
//! The Python package builds its validated `Config` class and the commented TOML from [`Config::fields`].

use crate::error::Unexpected;

/// A value of a configuration entry.
///
/// ```
/// use voodoo_core::{Config, Value};
///
/// let mut config = Config::default();
/// config.set("solver", &Value::Word("tree".into()))?;
/// let refused = config.set("threads", &Value::Whole(0)).unwrap_err();
/// assert_eq!(refused.to_string(), "threads: expected a whole number from 1 to 256, found Whole(0)");
/// assert_eq!(config.threads, 1);
/// # Ok::<(), voodoo_core::Unexpected>(())
/// ```
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(untagged)]
pub enum Value {
    /// A Boolean.
    Switch(bool),
    /// A whole number.
    Whole(usize),
    /// A real number.
    Real(f64),
    /// One of several keywords.
    Word(String),
}

impl Value {
    fn number(&self) -> Option<f64> {
        match self {
            Self::Whole(number) => Some(*number as f64),
            Self::Real(number) => Some(*number),
            _ => None,
        }
    }
}

/// Description of a configuration entry.
///
/// ```
/// use voodoo_core::{Config, Value};
///
/// for field in Config::default().fields() {
///     let text = match field.default {
///         Value::Real(number) => format!("{number} {}", field.unit),
///         Value::Whole(number) => number.to_string(),
///         Value::Switch(switch) => switch.to_string(),
///         Value::Word(word) => format!("{word}, of {:?}", field.words),
///     };
///     println!("{}: {text}", field.name);
/// }
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Field {
    /// Its key.
    pub name: &'static str,
    /// Its meaning, in one or a few sentences.
    pub doc: String,
    /// Its unit; empty when it has none.
    pub unit: &'static str,
    /// Its default.
    pub default: Value,
    /// Minimum and maximum of a number.
    pub range: Option<(f64, f64)>,
    /// The allowed keywords.
    pub words: &'static [&'static str],
}

/// A type that a configuration entry can have.
trait Entry: Sized {
    /// Description of the type, to which the range and the keywords are added.
    const EXPECTED: &'static str;
    const WORDS: &'static [&'static str] = &[];
    fn value(&self) -> Value;
    fn parse(value: &Value) -> Option<Self>;
}

/// A value from outside as an entry, checked for type and range.
fn parsed<T: Entry>(key: &'static str, value: &Value, range: Option<(f64, f64)>) -> Result<T, Unexpected> {
    let within = match (value.number(), range) {
        (Some(number), Some((low, high))) => (low..=high).contains(&number),
        _ => true,
    };
    T::parse(value).filter(|_| within).ok_or_else(|| {
        let expected = match range {
            Some((low, high)) => format!("{} from {low} to {high}", T::EXPECTED),
            None => format!("{}{}", T::EXPECTED, T::WORDS.join(", ")),
        };
        Unexpected::new(key, expected, format_args!("{value:?}"))
    })
}

impl Entry for f64 {
    const EXPECTED: &'static str = "a number";
    fn value(&self) -> Value {
        Value::Real(*self)
    }
    fn parse(value: &Value) -> Option<Self> {
        value.number().filter(|number| number.is_finite())
    }
}

impl Entry for usize {
    const EXPECTED: &'static str = "a whole number";
    fn value(&self) -> Value {
        Value::Whole(*self)
    }
    fn parse(value: &Value) -> Option<Self> {
        let whole = value.number().filter(|number| *number >= 0.0 && number.fract() == 0.0 && *number < 1e9);
        whole.map(|number| number as usize)
    }
}

impl Entry for bool {
    const EXPECTED: &'static str = "true or false";
    fn value(&self) -> Value {
        Value::Switch(*self)
    }
    fn parse(value: &Value) -> Option<Self> {
        match value {
            Value::Switch(switch) => Some(*switch),
            _ => None,
        }
    }
}

macro_rules! words {
    ($(#[$meta:meta])* $name:ident { $($(#[doc = $doc:literal])* $variant:ident = $word:literal),+ $(,)? }) => {
        $(#[$meta])*
        ///
        /// [`Config`] has an example.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[non_exhaustive]
        pub enum $name { $($(#[doc = $doc])* $variant),+ }
        impl Entry for $name {
            const EXPECTED: &'static str = "one of ";
            const WORDS: &'static [&'static str] = &[$($word),+];
            fn value(&self) -> Value {
                Value::Word(match self { $(Self::$variant => $word),+ }.to_owned())
            }
            fn parse(value: &Value) -> Option<Self> {
                match value {
                    $(Value::Word(word) if word == $word => Some(Self::$variant),)+
                    _ => None,
                }
            }
        }
    };
}

macro_rules! config {
    ($($(#[doc = $doc:literal])+ $name:ident: $kind:ty = $default:expr, $unit:literal $(, $low:literal ..= $high:literal)?;)+) => {
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
        #[derive(Clone, Debug, PartialEq)]
        #[non_exhaustive]
        pub struct Config { $($(#[doc = $doc])+ pub $name: $kind),+ }

        impl Default for Config {
            fn default() -> Self {
                Self { $($name: $default),+ }
            }
        }

        impl Config {
            /// All entries in the order of their definition, with the values of `self` as defaults.
            pub fn fields(&self) -> Vec<Field> {
                vec![$(Field {
                    name: stringify!($name),
                    doc: [$($doc),+].concat().trim().to_owned(),
                    unit: $unit,
                    default: self.$name.value(),
                    range: config!(@range $($low $high)?),
                    words: <$kind as Entry>::WORDS,
                }),+]
            }

            /// Sets one entry, checked for type and range.
            pub fn set(&mut self, key: &str, value: &Value) -> Result<(), Unexpected> {
                match key {
                    $(stringify!($name) => {
                        self.$name = parsed(stringify!($name), value, config!(@range $($low $high)?))?;
                    })+
                    _ => return Err(Unexpected::new("key", "one of the configuration", format_args!("{key:?}"))),
                }
                Ok(())
            }
        }
    };
    (@range $low:literal $high:literal) => { Some(($low as f64, $high as f64)) };
    (@range) => { None };
}

words! {
    /// Assignment of a free point inside the boxes of several limbs (K06 IV-B.2).
    Overlap {
        /// To all of them.
        Shared = "shared",
        /// To the closest one (K07 3.2).
        Exclusive = "exclusive",
        /// To the closest one, and to those of the others that are joined to it.
        Adjacent = "adjacent",
    }
}

words! {
    /// Solver of the pose for given correspondences.
    SolverKind {
        /// Each limb alone, by weighted absolute orientation (K06, K07).
        Limbwise = "limbwise",
        /// All limbs at once with exact joints, by damped Gauss-Newton with robust terms (R07, method section 4.3).
        Chain = "chain",
        /// All limbs at once, each with a separate twist, joined by stiff elastic bands (K07 section 4).
        Tree = "tree",
    }
}

config! {
    /// Solver of the pose for given correspondences.
    solver: SolverKind = SolverKind::Chain, "";
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
    overlap: Overlap = Overlap::Exclusive, "";
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
    tangential_weight: f64 = 0.07, "", 0.0 ..= 1.0;
    /// Maximum distance of a matched point in the first step of a frame, for the whole-body solvers; it decreases.
    gate_start: f64 = 0.30, "m", 0.001 ..= 10.0;
    /// Final maximum distance of a matched point, for the whole-body solvers.
    gate_end: f64 = 0.12, "m", 0.001 ..= 10.0;
    /// Scale of the robust kernel in the first step of a frame; it decreases with every step.
    kernel_start: f64 = 0.10, "m", 0.001 ..= 10.0;
    /// Final scale of the robust kernel, for the whole-body solvers.
    kernel_end: f64 = 0.03, "m", 0.001 ..= 10.0;
    /// Standard deviation of an edge of the depth contour, for the whole-body solvers.
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
    /// Match the contours of limbs to the color contours in color images (whole-body solvers).
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
