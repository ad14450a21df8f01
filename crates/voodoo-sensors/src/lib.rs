//! Converts sensor data to measurements for [`voodoo_core`]: keypoints of 2-D networks and their gates, surfaces among registered
//! depth points, skin color.

pub mod carried;
pub mod eye;
pub mod keypoints;
pub mod registration;
pub mod sites;
pub mod skin;
