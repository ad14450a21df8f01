//! Tracks articulated bodies in 3-D: people, or any other body, from depth images, points, positions and rays of named
//! sites, and color images.
//!
//! Every measurement becomes a weighted correspondence between a point of the body and a target, and each step moves the
//! body to fit all of them (VooDoo, K06, K07). The crate reads no files, knows no Python and draws nothing. It brings no
//! detector: one is handed in behind the trait [`Detect`], for example that of the crate `voodoo-detect`.
//!
//! # A first track
//!
//! A [`Body`] is what is tracked, a [`Frame`] what was measured at one instant, an [`Estimate`] what [`Tracker::step`]
//! returns. Units are meters, seconds and radians. A transform `a_from_b` maps coordinates in `b` to coordinates in `a`.
//!
//! ```
//! use voodoo_core::math::{Pose, Vec3};
//! use voodoo_core::{Body, Cloud, Config, Frame, HumanModel, PointSlice, Scope, Status, Tracker};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let body = Body::human(1.78, HumanModel::Measured)?;
//!
//! // Where named sites are in the first frame: index of the site, position in the world.
//! // Here the body stands at the origin.
//! let standing = body.rest_pose(Pose::IDENTITY);
//! let start: Vec<(usize, Vec3)> =
//!     (0..body.sites().len()).map(|site| (site, body.site_position(&standing, site))).collect();
//!
//! // What a sensor measured: here points all over the limbs.
//! let mut points = Vec::new();
//! for (limb, world_from_limb) in body.limbs().iter().zip(&standing) {
//!     let shape = &limb.shape;
//!     for step in 0..60 {
//!         let (along, angle) = (f64::from(step) / 60.0, f64::from(step) * 2.4);
//!         let a = shape.a0() + along * (shape.a1() - shape.a0());
//!         let b = shape.b0() + along * (shape.b1() - shape.b0());
//!         let on_limb = Vec3::new(a * angle.cos(), b * angle.sin(), along * shape.length());
//!         points.push(world_from_limb.transform_point(on_limb).to_array());
//!     }
//! }
//! let cloud = Cloud {
//!     points: PointSlice::F64(&points),
//!     world_from_sensor: Pose::IDENTITY,
//!     weight: 1.0,
//!     scope: Scope::Free,
//!     source: 0,
//! };
//!
//! let mut tracker = Tracker::new(body, Config::default())?;
//! tracker.reset(&start, true)?;
//! let estimate = tracker.step(&Frame { clouds: &[cloud], ..Frame::empty(0.0) })?;
//! assert_eq!(estimate.status, Status::Tracking);
//! assert!(estimate.mean_squared_distance.sqrt() < 0.01);
//! # Ok(())
//! # }
//! ```
//!
//! # Bodies
//!
//! [`Body::human`] makes a human of a given stature, [`Body::new`] any other tree of [`Limb`]s. A limb is a
//! [`TaperedEllipticCylinder`]; a [`Joint`] connects it to its parent; a [`Site`] is a named point on it. Two semi-axes of
//! a joint make it universal, a hinge, or elliptic ([`JointKind`]):
//!
//! ```
//! use voodoo_core::math::{Pose, Vec3};
//! use voodoo_core::{Body, Joint, JointKind, Limb, Site, TaperedEllipticCylinder};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let pole = TaperedEllipticCylinder::new(0.5, 0.03, 0.03, 0.02, 0.02)?;
//! let hinge = Joint {
//!     name: "elbow".into(),
//!     parent_from_joint: Pose::from_translation(Vec3::new(0.0, 0.0, 0.5)),
//!     limb_from_joint: Pose::IDENTITY,
//!     semi_axes: [0.05, 0.0],
//!     weight: 1.0,
//!     limits: None,
//!     motion: 0.02,
//! };
//! assert_eq!(hinge.kind(), JointKind::Hinge);
//! let limbs = vec![
//!     Limb { name: "lower".into(), shape: pole.clone(), parent: None, match_caps: [false; 2] },
//!     Limb { name: "upper".into(), shape: pole, parent: Some((0, hinge)), match_caps: [false, true] },
//! ];
//! let tip = Site { name: "tip".into(), limb: 1, position: Vec3::new(0.0, 0.0, 0.5) };
//! let lamp = Body::new("lamp", limbs, vec![tip])?;
//! assert!((lamp.site_position(&lamp.rest_pose(Pose::IDENTITY), 0).z - 1.0).abs() < 1e-12);
//! # Ok(())
//! # }
//! ```
//!
//! # Measurements
//!
//! A [`Frame`] borrows what was measured: [`DepthImage`]s and [`ColorImage`]s, each with its [`Camera`] and lens
//! ([`Lens`]); [`Cloud`]s of points; a [`PositionRelation`] or [`RayRelation`] of a site; the [`Ground`]. Every weight is
//! the precision of a position, 1 for a good depth pixel.
//!
//! ```
//! use voodoo_core::math::{Pose, Vec3};
//! use voodoo_core::{Camera, DepthImage, DepthPixels, Frame, Ground, Lens, PositionRelation};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let camera = Camera::new(320, 240, [260.0, 260.0, 159.5, 119.5], Lens::PlumbBob([-0.1, 0.02, 0.0, 0.0, 0.0]))?;
//! let pixels = vec![2000_u16; 320 * 240]; // a wall at 2 m
//! let image = DepthImage {
//!     pixels: DepthPixels::U16(&pixels),
//!     camera: &camera,
//!     meters_per_unit: 0.001,
//!     world_from_sensor: Pose::IDENTITY,
//!     weight: 1.0,
//!     source: 0,
//! };
//! let wrist = PositionRelation { site: 0, position: Vec3::new(0.1, 0.2, 1.5), weight: 20.0, bias: 0.0, source: 1 };
//! let ground = Some(Ground { normal: -Vec3::Y, offset: -1.2 });
//! let frame = Frame { images: &[image], positions: &[wrist], ground, ..Frame::empty(0.0) };
//! assert_eq!(frame.images.len(), 1);
//! # Ok(())
//! # }
//! ```
//!
//! A frame that cannot be used is refused with a [`TrackError`] before anything changes.
//!
//! # Results
//!
//! An [`Estimate`] holds the pose of every limb, the position of every site, the [`Status`] of the body and the
//! [`LimbStatus`] of every limb, what each source contributed ([`SourceReport`]), and [`Covariances`].
//! [`Rendering`] predicts the depth image of a pose.
//!
//! # Several persons
//!
//! [`People`] tracks everybody, each with a [`BodyTracker`]; it finds persons with a detector. A [`Tracker`] is the same for one
//! person who is followed: with a detector, everybody else who moves in view is tracked as well, so that nobody else is taken for
//! that person.
//!
//! ```
//! use voodoo_core::{Body, Config, HumanModel, People, PeopleOptions};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let people = People::new(Body::human(1.75, HumanModel::Measured)?, Config::default(), PeopleOptions::default())?;
//! assert_eq!(people.present().count(), 0);
//! # Ok(())
//! # }
//! ```
//!
//! # References
//!
//! * K06: S. Knoop, S. Vacek, R. Dillmann, "Sensor Fusion for 3D Human Body Tracking with an Articulated 3D Body Model",
//!   ICRA 2006. [`Tracker::step`] follows its section IV-B.
//! * K07: the same authors, "A Human Body Model for Articulated 3D Pose Tracking", in "Humanoid Robots, New
//!   Developments", 2007.
//! * R07: B. Rosenhahn, T. Brox, D. Cremers, H.-P. Seidel, "Online Smoothing for Markerless Motion Capture", DAGM 2007.
//!
//! Runnable programs are in the crate's folder `examples`.

mod association;
mod body;
mod camera;
mod config;
mod detect;
mod error;
mod fit;
mod hypotheses;
pub mod math;
mod observation;
mod people;
mod regions;
mod relocalize;
mod shape;
mod sizes;
mod solver;
mod terms;
#[cfg(test)]
mod testing;
mod threads;
mod tracker;
mod uncertainty;
mod visibility;

// The unit tests name the crate as any other program does.
#[cfg(test)]
extern crate self as voodoo_core;

#[cfg(test)]
#[path = "../tests/internal/mod.rs"]
mod internal;

/// Motions of rigid bodies and joints.
pub mod kinematics {
    pub use crate::body::kinematics::{exp, hinge_axis, joint_turn, place};
}

pub use body::{Body, HumanModel, Joint, JointKind, Limb, LimbRole, Roles, Side, Site};
pub use camera::{Camera, Lens};
pub use config::{Config, Field, Overlap, SolverKind};
pub use detect::{Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Surroundings};
pub use error::{BodyError, TrackError, Unexpected};
pub use observation::background::SURFACE_STEP;
pub use observation::frame::{
    Cloud, DepthImage, DepthPixels, DetectedPerson, Frame, Ground, PointSlice, PositionRelation, RayRelation, Scope,
};
pub use observation::picture::{ColorImage, ColorPixels};
pub use people::one::Tracker;
pub use people::{People, PeopleOptions, Refusal};
pub use regions::RegionLine;
pub use shape::{Region, SurfaceBatch, SurfacePoint, TaperedEllipticCylinder};
pub use toml::Value;
pub use tracker::BodyTracker;
pub use tracker::estimate::{Estimate, LimbStatus, SourceReport, Status};
pub use tracker::expected::LimbMotion;
pub use uncertainty::Covariances;
pub use visibility::render::{NO_LIMB, Rendering, Viewpoint};
