//! Inverse kinematics with image constraints (J10: Jaume-i-Capo, Varona, Gonzalez-Hidalgo, Perales, "Adding Image Constraints
//! to Inverse Kinematics for Human Motion Capture", EURASIP JASP 2010) on the kinematic chain of R07 (Rosenhahn, Brox, Cremers,
//! Seidel, "Online Smoothing for Markerless Motion Capture", DAGM 2007).
//!
//! Files depend downwards only: `solver` > `image`, `goal`, `linear` > `view`, `trunk` > `model`.

mod bones;
mod goal;
mod image;
mod linear;
mod model;
mod project;
mod solver;
mod trunk;
mod view;

pub use bones::{bones, trunk};
pub use goal::{Aim, Goal, level_cost, level_rows};
pub use image::{Bone, Criterion};
pub use model::{ChainModel, Column, Kinematics, Link, Turn};
pub use project::{project, read};
pub use solver::{IkProblem, IkSolver, Report, SolverOptions};
pub use trunk::Trunk;
pub use view::SilhouetteView;
