//! How well a pose explains a frame: one score for comparing hypotheses. In units of surface patches (weight one).
//!
//! Points that no limb explains cost, and so does visible surface of the model where the camera sees past it. Either alone
//! would be fooled: a limb hidden inside the torso contradicts nothing, a limb in empty space leaves few points unexplained.

use crate::background::{Background, Backgrounds};
use crate::body::Limb;
use crate::candidates::{REFERENCE_PATCH, shifted};
use crate::correspondence::Correspondences;
use crate::frame::{DepthImage, Frame};
use crate::geometry::{Pose, Vec3};

/// A point this far from the model is not explained, metres.
pub const EXPLAINED: f64 = 0.06;
/// The camera sees past the model's surface when the return lies this much behind it, metres.
const PAST: f64 = 0.08;
/// Cost of a patch that hides behind what is seen.
const HIDDEN: f64 = 0.3;
/// Places along a limb and across it that are looked at.
const ALONG: [f64; 5] = [0.1, 0.3, 0.5, 0.7, 0.9];
const ACROSS: [f64; 3] = [-0.6, 0.0, 0.6];
/// An image with more pixels without return than this share was cut out: no return means that nothing is there.
const CUT_OUT: f64 = 0.5;

/// What a camera says about a place on the model's surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sight {
    /// Behind what is seen.
    Hidden,
    /// The camera says nothing.
    Unknown,
    /// Seen where it is.
    Seen,
    /// The camera sees past it.
    Contradicted,
}

/// Depth images as witnesses against poses.
#[derive(Debug)]
pub struct Witness<'a> {
    frame: &'a Frame<'a>,
    backgrounds: &'a Backgrounds,
    origin: Vec3,
    cut_out: bool,
}

/// Patches of a limb: seen, contradicted, and all that face a camera.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Visibility {
    /// Patches seen where they are.
    pub seen: f64,
    /// Patches that a camera sees past.
    pub contradicted: f64,
    /// Patches behind what the camera sees.
    pub hidden: f64,
    /// Patches facing a camera inside its image.
    pub facing: f64,
}

impl std::ops::AddAssign for Visibility {
    fn add_assign(&mut self, other: Self) {
        self.seen += other.seen;
        self.contradicted += other.contradicted;
        self.hidden += other.hidden;
        self.facing += other.facing;
    }
}

impl Visibility {
    /// Cost in unexplained patches: to be seen past is as bad as to leave a patch unexplained, to hide is suspicious.
    pub fn cost(&self) -> f64 {
        self.contradicted + HIDDEN * self.hidden
    }
}

impl<'a> Witness<'a> {
    /// Looks at the images of a frame; `origin` is the working frame's.
    pub fn new(frame: &'a Frame<'a>, backgrounds: &'a Backgrounds, origin: Vec3) -> Self {
        let empty = |image: &DepthImage| {
            let (mut none, mut all) = (0, 0);
            for index in (0..image.pixels.len()).step_by(97) {
                all += 1;
                none += usize::from(image.pixels.get(index) <= 0.0);
            }
            f64::from(none as u32) > CUT_OUT * f64::from(all as u32)
        };
        let cut_out = frame.images.iter().all(empty);
        Self { frame, backgrounds, origin, cut_out }
    }

    /// How much of a limb's surface is seen and how much contradicted, in patches.
    pub fn look(&self, limb: &Limb, working_from_limb: &Pose) -> Visibility {
        let shape = &limb.shape;
        let mut found = Visibility::default();
        for (index, image) in self.frame.images.iter().enumerate() {
            let camera = shifted(&image.world_from_sensor, self.origin);
            let camera_from_limb = camera.inverse() * *working_from_limb;
            let background = self.backgrounds.of(index, image);
            for t in ALONG {
                let z = t * shape.length();
                let (a, b) = (shape.a0() + t * (shape.a1() - shape.a0()), shape.b0() + t * (shape.b1() - shape.b0()));
                let centre = camera_from_limb * Vec3::new(0.0, 0.0, z);
                // Direction to the camera, across the limb, in the limb frame.
                let view = camera_from_limb.inverse_transform_vector(-centre).with_z(0.0);
                if view.length() < 1e-6 {
                    continue;
                }
                let view = view.normalize();
                let side = Vec3::new(-view.y, view.x, 0.0);
                for s in ACROSS {
                    let forward = (1.0 - s * s).sqrt();
                    let place = view * forward + side * s;
                    let point = camera_from_limb * Vec3::new(a * place.x, b * place.y, z);
                    let patches = 2.0 * a.min(b).max(0.5 * a.max(b)) * shape.length()
                        / (REFERENCE_PATCH * (ALONG.len() * ACROSS.len()) as f64);
                    match self.sight(image, background, point) {
                        None => continue,
                        Some(Sight::Contradicted) => found.contradicted += patches,
                        Some(Sight::Seen) => found.seen += patches,
                        Some(Sight::Hidden) => found.hidden += patches,
                        Some(Sight::Unknown) => {}
                    }
                    found.facing += patches;
                }
            }
        }
        found
    }

    fn sight(&self, image: &DepthImage, background: Option<&Background>, point: Vec3) -> Option<Sight> {
        let [fx, fy, cx, cy] = image.intrinsics;
        if point.z < 0.05 || image.rays.is_some() {
            return None;
        }
        let column = (fx * point.x / point.z + cx).round();
        let row = (fy * point.y / point.z + cy).round();
        if !(column >= 0.0 && row >= 0.0 && column < image.width as f64 && row < image.height as f64) {
            return None;
        }
        let index = row as usize * image.width + column as usize;
        let z = f64::from(image.pixels.get(index)) * image.metres_per_unit;
        if z.is_nan() || z <= 0.0 {
            return Some(if self.cut_out { Sight::Contradicted } else { Sight::Unknown });
        }
        let scene = background
            .and_then(|background| background.depth().get(index))
            .is_some_and(|depth| Background::holds(*depth, z as f32));
        Some(if z > point.z + PAST || (scene && z > point.z + 0.5 * PAST) {
            Sight::Contradicted
        } else if z > point.z - PAST {
            Sight::Seen
        } else {
            Sight::Hidden
        })
    }
}

/// Cost of the points that the pose leaves unexplained: `w min(d^2 / c^2, 1)` of every candidate.
pub fn unexplained(correspondences: &Correspondences, total_weight: f64) -> f64 {
    let mut cost = total_weight;
    for matches in &correspondences.limbs {
        for (weight, distance) in matches.weight.iter().zip(&matches.surface.signed_distance) {
            let ratio = f64::from(*distance) / EXPLAINED;
            cost -= f64::from(*weight) * (1.0 - ratio * ratio).max(0.0);
        }
    }
    cost
}
