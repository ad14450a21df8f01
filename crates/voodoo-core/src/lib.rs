//! Articulated body tracking: every measurement becomes a weighted pair of a body point and a target, and one step
//! moves the body to fit all of them. No files, no Python, no drawing.
//!
//! A [`Body`] is what is tracked, a [`Frame`] what was measured at one instant, an [`Estimate`] what
//! [`Tracker::step`] found:
//!
//! ```
//! use voodoo_core::body::HumanModel;
//! use voodoo_core::math::{Pose, Vec3};
//! use voodoo_core::observation::frame::{Cloud, PointSlice, Scope};
//! use voodoo_core::{Body, Config, Frame, Status, Tracker};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let body = Body::human(1.78, HumanModel::Full)?;
//!
//! // Where named sites are in the first frame: index of the site, position in the world.
//! // Here the body stands at the origin.
//! let standing = body.rest_pose(Pose::IDENTITY);
//! let start: Vec<(usize, Vec3)> =
//!     (0..body.sites().len()).map(|site| (site, body.site_position(&standing, site))).collect();
//!
//! // What a sensor measured, in meters: here points all over the limbs.
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
//! let estimate = tracker.step(&Frame::empty(0.0).with_clouds(&[cloud]))?;
//! assert_eq!(estimate.status, Status::Tracking);
//! assert!(estimate.mean_squared_distance.sqrt() < 0.01);
//! # Ok(())
//! # }
//! ```
//!
//! The method is VooDoo (K06: Knoop, Vacek, Dillmann, "Sensor Fusion for 3D Human Body Tracking with an Articulated 3D
//! Body Model", ICRA 2006; K07: the same authors, "A Human Body Model for Articulated 3D Pose Tracking", in "Humanoid
//! Robots, New Developments", 2007). [`Tracker::step`] reads like the list in K06 IV-B. The modules are its stages;
//! the order in which they may use each other is in ARCHITECTURE.md.

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

pub use body::{Body, HumanModel, Joint, JointKind, Limb, Site};
pub use camera::{Camera, Lens};
pub use config::{Config, ConfigError, Overlap, RawValue, SolverKind, Value};
pub use detect::{Detect, DetectError, DetectedJoint, Detection, DetectionQuery, Surroundings};
pub use error::{BodyError, CameraError, TrackError};
pub use observation::frame::{
    Cloud, DepthImage, DepthPixels, Frame, Ground, PointSlice, PositionRelation, RayRelation, Scope,
};
pub use observation::picture::{ColorImage, ColorPixels};
pub use observation::sites::{SiteGate, SiteRay};
pub use people::{People, PeopleOptions};
pub use regions::RegionLine;
pub use shape::ray::RayHit;
pub use shape::{Region, ShapeError, SurfaceBatch, TaperedEllipticCylinder};
pub use tracker::Tracker;
pub use tracker::estimate::{Estimate, LimbStatus, SourceReport, Status};
pub use tracker::expected::LimbMotion;
pub use uncertainty::Covariances;
pub use visibility::render::{NO_LIMB, Rendering, Viewpoint};
