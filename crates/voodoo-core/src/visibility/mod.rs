//! What cameras should see of a posed body, and what they do see of it.

pub mod evidence;
pub mod limb_support;
pub mod render;
pub mod roundness;
