//! Articulated body tracking: every measurement becomes a weighted correspondence, one step fits the body to all of them.
//!
//! The method is VooDoo (K06: Knoop, Vacek, Dillmann, "Sensor Fusion for 3D Human Body Tracking with an Articulated 3D
//! Body Model", ICRA 2006; K07: the same authors, "A Human Body Model for Articulated 3D Pose Tracking", in "Humanoid
//! Robots, New Developments", 2007). [`tracker::Tracker::step`] reads like the list in K06 IV-B.
//!
//! Modules depend downwards only: `tracker` > `solver`, `associate`, `relate` > `correspondence`, `candidates` > `frame` >
//! `body` > `shape`, `rigid` > `geometry`.

pub mod associate;
pub mod background;
pub mod beside;
mod blobs;
pub mod body;
mod calibrate;
pub mod candidates;
pub mod chain;
mod clusters;
pub mod config;
pub mod correspondence;
pub mod error;
pub mod estimate;
pub mod evidence;
mod facing;
pub mod frame;
pub mod geometry;
pub mod ik;
mod nearest;
pub mod normal;
pub mod outline;
pub mod predict;
pub mod proof;
pub mod recover;
mod relate;
pub mod render;
pub mod rigid;
pub mod roundness;
pub mod shape;
mod simd;
pub mod solver;
pub mod terms;
pub mod tracker;
pub mod view;

pub use body::Body;
pub use config::Config;
pub use error::{BodyError, ConfigError, TrackError};
pub use estimate::{Estimate, Status};
pub use frame::Frame;
pub use shape::TaperedEllipticCylinder;
pub use tracker::Tracker;
