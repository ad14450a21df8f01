//! What the network tells, in its order.

/// Joints that the network tells, in its order (H-Anim names; `l_` and `r_` are the person's own).
pub const JOINTS: [&str; 17] = [
    "head_center",
    "vc7",
    "humanoid_root",
    "l_shoulder",
    "r_shoulder",
    "l_elbow",
    "r_elbow",
    "l_wrist",
    "r_wrist",
    "l_hand",
    "r_hand",
    "l_hip",
    "r_hip",
    "l_knee",
    "r_knee",
    "l_ankle",
    "r_ankle",
];
/// Lengths that it tells, in its order: distances of joints, and the stature.
pub const LENGTHS: [&str; 9] =
    ["upper_arm", "forearm", "thigh", "shank", "shoulder_width", "hip_width", "trunk", "neck", "stature"];
