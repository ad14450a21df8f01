//! Converts sensor data to measurements for [`voodoo_core`]: keypoints of 2-D networks and their gates, depth registered to another
//! camera's image, skin color, masks.

pub mod carried;
pub mod eye;
pub mod keypoints;
pub mod registration;
pub mod sites;
pub mod skin;
