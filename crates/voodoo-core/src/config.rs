//! Every parameter of the tracker, defined once: name, type, default, range, unit and meaning.
//!
//! The Python package builds its validated `Config` class and the commented TOML from [`Config::fields`].

/// A configuration entry that is unknown or outside its range.
///
/// ```
/// use voodoo_core::{Config, ConfigError, RawValue};
///
/// let mut config = Config::default();
/// config.set("solver", &RawValue::Word("tree".into()))?;
/// let refused = config.set("threads", &RawValue::Number(0.0));
/// assert!(matches!(refused, Err(ConfigError::Value { key: "threads", .. })));
/// assert_eq!(config.threads, 1);
/// # Ok::<(), ConfigError>(())
/// ```
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ConfigError {
    /// No such key.
    #[error("unknown configuration key {0:?}")]
    UnknownKey(String),
    /// An invalid value.
    #[error("{key}: expected {expected}, found {found:?}")]
    Value {
        /// The key.
        key: &'static str,
        /// The expected value.
        expected: String,
        /// The value found.
        found: RawValue,
    },
}

/// A value of a configuration entry.
///
/// [`Field`] has an example.
#[derive(Clone, Debug, PartialEq)]
pub enum Value {
    /// A real number.
    Real(f64),
    /// A whole number.
    Whole(usize),
    /// A Boolean.
    Switch(bool),
    /// One of several keywords.
    Word(&'static str),
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
trait Entry: Sized + Clone {
    const WORDS: &'static [&'static str] = &[];
    fn value(&self) -> Value;
    fn parse(value: &RawValue) -> Option<Self>;
    fn number(&self) -> Option<f64> {
        None
    }
    fn expected(range: Option<(f64, f64)>) -> String;
}

/// A value from outside, not yet validated.
///
/// [`ConfigError`] has an example.
#[derive(Clone, Debug, PartialEq)]
pub enum RawValue {
    /// A number.
    Number(f64),
    /// A Boolean.
    Switch(bool),
    /// A keyword.
    Word(String),
}

impl Entry for f64 {
    fn value(&self) -> Value {
        Value::Real(*self)
    }
    fn parse(value: &RawValue) -> Option<Self> {
        match value {
            RawValue::Number(number) => Some(*number),
            _ => None,
        }
    }
    fn number(&self) -> Option<f64> {
        Some(*self)
    }
    fn expected(range: Option<(f64, f64)>) -> String {
        range.map_or("a number".into(), |(low, high)| format!("a number from {low} to {high}"))
    }
}

impl Entry for usize {
    fn value(&self) -> Value {
        Value::Whole(*self)
    }
    fn parse(value: &RawValue) -> Option<Self> {
        match value {
            RawValue::Number(number) if *number >= 0.0 && number.fract() == 0.0 && *number < 1e9 => {
                Some(*number as usize)
            }
            _ => None,
        }
    }
    fn number(&self) -> Option<f64> {
        Some(*self as f64)
    }
    fn expected(range: Option<(f64, f64)>) -> String {
        range.map_or("a whole number".into(), |(low, high)| format!("a whole number from {low} to {high}"))
    }
}

impl Entry for bool {
    fn value(&self) -> Value {
        Value::Switch(*self)
    }
    fn parse(value: &RawValue) -> Option<Self> {
        match value {
            RawValue::Switch(switch) => Some(*switch),
            _ => None,
        }
    }
    fn expected(_: Option<(f64, f64)>) -> String {
        "true or false".into()
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
            const WORDS: &'static [&'static str] = &[$($word),+];
            fn value(&self) -> Value {
                Value::Word(match self { $(Self::$variant => $word),+ })
            }
            fn parse(value: &RawValue) -> Option<Self> {
                match value {
                    $(RawValue::Word(word) if word == $word => Some(Self::$variant),)+
                    _ => None,
                }
            }
            fn expected(_: Option<(f64, f64)>) -> String {
                format!("one of {}", Self::WORDS.join(", "))
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
            pub fn set(&mut self, key: &str, value: &RawValue) -> Result<(), ConfigError> {
                match key {
                    $(stringify!($name) => {
                        let range: Option<(f64, f64)> = config!(@range $($low $high)?);
                        let parsed = <$kind as Entry>::parse(value).filter(|entry| {
                            match (entry.number(), range) {
                                (Some(number), Some((low, high))) => (low..=high).contains(&number),
                                (Some(number), None) => number.is_finite(),
                                _ => true,
                            }
                        });
                        self.$name = parsed.ok_or_else(|| ConfigError::Value {
                            key: stringify!($name),
                            expected: <$kind as Entry>::expected(range),
                            found: value.clone(),
                        })?;
                        Ok(())
                    })+
                    _ => Err(ConfigError::UnknownKey(key.to_owned())),
                }
            }
        }
    };
    (@range $low:literal $high:literal) => { Some(($low as f64, $high as f64)) };
    (@range) => { None };
}

words! {
    /// What happens to a free point inside the boxes of several limbs (K06 IV-B.2).
    Overlap {
        /// It goes to every one of them.
        Shared = "shared",
        /// It goes to the closest one (K07 3.2).
        Exclusive = "exclusive",
        /// It goes to the closest one and to those of the others that are joined to it.
        Adjacent = "adjacent",
    }
}

words! {
    /// How the pose follows from the correspondences.
    SolverKind {
        /// Each limb alone, by weighted absolute orientation (K06, K07).
        Limbwise = "limbwise",
        /// All limbs at once with exact joints, by damped Gauss-Newton on robust terms (R07, method section 4.3).
        Chain = "chain",
        /// All limbs at once, each with a twist of its own, joined by strong elastic bands (K07 section 4).
        Tree = "tree",
    }
}

config! {
    /// How the pose is found from the correspondences.
    solver: SolverKind = SolverKind::Chain, "";
    /// Greatest number of ICP steps in a frame (K07 section 7: of the published ones 6 are a good compromise).
    max_steps: usize = 5, "", 1 ..= 100;
    /// The steps end when the mean squared distance changes by less than this (K06 III-B step 6).
    min_change: f64 = 1e-7, "m^2", 0.0 ..= 1.0;
    /// Enlargement of the box around the whole body; free points outside are background (K06 IV-B.1).
    body_box_margin: f64 = 0.20, "m", 0.0 ..= 10.0;
    /// Enlargement of the box of each limb: how far a limb may move between two frames (K06 IV-B.2;
    /// limbwise solver).
    limb_box_margin: f64 = 0.10, "m", 0.0 ..= 10.0;
    /// What happens to a free point inside the boxes of several limbs (K06 IV-B.2).
    overlap: Overlap = Overlap::Exclusive, "";
    /// At most about this many pixels of a depth image are used; a finer image is sampled on a grid.
    max_points: usize = 3000, "", 100 ..= 10000000;
    /// Learn the still scene behind the body from depth images, as long as their camera does not move, and leave it out.
    background: bool = true, "";
    /// Every n-th point of a limb is used (K06 IV-B.3).
    sampling_factor: usize = 1, "", 1 ..= 1000;
    /// A limb keeps at least this many of its points when sampled (K06 IV-B.3).
    min_limb_points: usize = 50, "", 0 ..= 1000000;
    /// A limb keeps at most this many points (K06 IV-B.3).
    max_limb_points: usize = 1000, "", 1 ..= 1000000;
    /// A point farther than this from its limb's surface is not matched (K06 IV-B.4; limbwise solver).
    max_distance: f64 = 0.15, "m", 0.001 ..= 10.0;
    /// Weight of the elastic bands of a limb relative to its measurements (K07 4.3: 0.4 to 0.7; limbwise solver).
    band_ratio: f64 = 0.5, "", 0.0 ..= 100.0;
    /// Standard deviation of the length of an elastic band (tree solver).
    band_sigma: f64 = 0.003, "m", 0.00001 ..= 1.0;
    /// Standard deviation of a surface point of weight one, for the whole-body solvers.
    point_sigma: f64 = 0.03, "m", 0.0001 ..= 1.0;
    /// Share of a surface point's information that holds it along the surface as well, for the whole-body solvers: 0 is
    /// point-to-plane, 1 point-to-point; a little stops limbs from sliding along themselves.
    tangential_weight: f64 = 0.07, "", 0.0 ..= 1.0;
    /// Greatest distance of a matched point in the first step of a frame, for the whole-body solvers; it narrows.
    gate_start: f64 = 0.30, "m", 0.001 ..= 10.0;
    /// Greatest distance of a matched point once narrowed, for the whole-body solvers.
    gate_end: f64 = 0.12, "m", 0.001 ..= 10.0;
    /// Scale of the robust kernel in the first step of a frame; it narrows from step to step.
    kernel_start: f64 = 0.10, "m", 0.001 ..= 10.0;
    /// Scale at which the robust kernel stops narrowing, for the whole-body solvers.
    kernel_end: f64 = 0.03, "m", 0.001 ..= 10.0;
    /// Standard deviation of an edge of the outline, for the whole-body solvers.
    depth_contour_sigma: f64 = 0.01, "m", 0.0001 ..= 1.0;
    /// Share of the last motion that is expected to go on (0: the body is expected to stand still; whole-body solvers).
    prediction: f64 = 0.6, "", 0.0 ..= 1.0;
    /// Standard deviation of the root's unexpected turn in 1/30 s.
    root_turn_sigma: f64 = 0.12, "rad", 0.0001 ..= 10.0;
    /// Standard deviation of the root's unexpected shift in 1/30 s.
    root_shift_sigma: f64 = 0.04, "m", 0.0001 ..= 10.0;
    /// Multiplies the standard deviations of all unexpected motion: the one strength of the jitter penalty (R07 eq. 18, 26).
    /// Smaller is smoother; measured lag on steady motion: none at 0.25, 0.02 frames at 0.125.
    motion_scale: f64 = 0.25, "", 0.01 ..= 100.0;
    /// A motion that hardly differs from the expected one is held tighter by this factor of information, as noise; 0: as any
    /// other. Greater is calmer at rest and later in slow turns (whole-body solvers).
    still_prior_gain: f64 = 30.0, "", 0.0 ..= 10000.0;
    /// Try other configurations of arms and legs where the frame speaks against the current ones (whole-body solvers).
    hypotheses: bool = true, "";
    /// Look for a body that is lost, or elsewhere than it is tracked, where a detector sees a person; for a lost one that no detector
    /// knows or sees in everything of its size that is no background (whole-body solvers).
    relocalization: bool = true, "";
    /// Draw the limbs' rims to the body's outline in depth images, in the later steps of a frame (whole-body solvers).
    depth_contour: bool = true, "";
    /// Draw the limbs' contours to the edges of their colors in color pictures (whole-body solvers).
    regions: bool = true, "";
    /// Match depth pixels inside a limb to the side that faces their camera (whole-body solvers).
    facing: bool = true, "";
    /// Keep joints within their limits, softly (whole-body solvers).
    limits: bool = true, "";
    /// Axes of limbs are pushed out of other limbs that they are not joined to, and their ends up to the floor where it is known
    /// (whole-body solvers).
    penetration: bool = true, "";
    /// After a reset that fits sizes, the first frame's points also fit the girths.
    fit_girths: bool = true, "";
    /// After a reset that fits sizes, the first frame decides between arms or legs of unlike lengths, and with the
    /// whole-body solvers the frames that follow refine the limbs' lengths.
    fit_lengths: bool = true, "";
    /// Free points lower than this above the ground plane are background, where the frame has a ground plane.
    ground_clearance: f64 = 0.04, "m", 0.0 ..= 1.0;
    /// Threads for one step. The result is the same, bit by bit, for any number.
    threads: usize = 1, "", 1 ..= 256;
}
