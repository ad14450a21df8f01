//! Articulated body tracking: every measurement becomes a weighted correspondence, one step fits the body to all of them.
//!
//! The method is VooDoo (K06: Knoop, Vacek, Dillmann, "Sensor Fusion for 3D Human Body Tracking with an Articulated 3D
//! Body Model", ICRA 2006; K07: the same authors, "A Human Body Model for Articulated 3D Pose Tracking", in "Humanoid
//! Robots, New Developments", 2007). [`tracker::Tracker::step`] reads like the list in K06 IV-B.
//!
//! Modules depend downwards only: `tracker` > `solver`, `associate`, `relate` > `correspondence`, `candidates` > `frame` >
//! `body` > `shape`, `rigid` > `geometry`.

pub mod association;
pub mod body;
pub mod config;
pub mod error;
pub mod fit;
pub mod hypotheses;
pub mod ik;
pub mod math;
pub mod observation;
pub mod relocalize;
pub mod shape;
pub mod sizes;
pub mod solver;
pub mod terms;
#[cfg(test)]
mod testing;
pub mod tracker;
pub mod visibility;

pub use body::Body;
pub use config::Config;
pub use error::{BodyError, ConfigError, TrackError};
pub use observation::frame::Frame;
pub use shape::TaperedEllipticCylinder;
pub use tracker::Tracker;
pub use tracker::estimate::{Estimate, Status};
