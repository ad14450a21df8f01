//! Converts sensor data to measurements for [`voodoo_core`]: keypoints of 2-D networks and their gates, depth registered to another
//! camera's image, skin color, masks.

pub mod body_view;
pub mod carried;
pub mod chroma;
pub mod eye;
mod far_edges;
pub mod keypoints;
mod mask_regions;
mod masks;
pub mod registration;
pub mod sites;
pub mod skin;
mod still;
mod window;
