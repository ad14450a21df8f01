//! Finding people in a depth image: what may be one, what a network says of it, and where its joints are.

mod components;
pub mod crop;
mod floor;
pub mod segmentation;
mod view;

pub use components::Candidate;
pub use view::Surroundings;
