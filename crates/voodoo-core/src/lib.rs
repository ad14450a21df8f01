//! Articulated body tracking: every measurement becomes a weighted correspondence, one step fits the body to all of them.
//!
//! The method is VooDoo (K06: Knoop, Vacek, Dillmann, "Sensor Fusion for 3D Human Body Tracking with an Articulated 3D
//! Body Model", 2006; K07: the same authors, "A Human Body Model for Articulated 3D Pose Tracking", 2007).
//! Modules depend downwards only: `tracker` → `associate`, `solver` → `correspondence` → `frame`, `body` → `shape` → `geometry`.

pub mod geometry;
pub mod shape;
