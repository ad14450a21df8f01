//! The joints and lengths that the network reports, in its order.

/// Joints that the network reports, in its order (H-Anim names; `l_` and `r_` are the person's own sides).
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
/// Lengths that the network reports, in its order: distances between joints, and the stature.
pub const LENGTHS: [&str; 9] =
    ["upper_arm", "forearm", "thigh", "shank", "shoulder_width", "hip_width", "trunk", "neck", "stature"];
