"""Made by scripts/config_stub.py from the schema in the core; do not edit."""

from typing import Literal

from pydantic import BaseModel

class ConfigFields(BaseModel, frozen=True, extra="forbid"):
    """Entries of a configuration, all of them optional keyword arguments of `voodoo.Config`."""

    solver: Literal["limbwise", "chain", "tree"] = "chain"
    """Solver of the pose for given correspondences."""
    max_steps: int = 5
    """Maximum number of ICP steps per frame (K07 section 7 recommends 6 of the published ones). (range: 1 to
    100)
    """
    min_change: float = 1e-07
    """Convergence threshold: the steps end when the mean squared distance changes by less (K06 III-B step 6;
    limbwise solver). (unit: m^2; range: 0 to 1)
    """
    body_box_margin: float = 0.2
    """Enlargement of the box around the whole body; free points outside are background (K06 IV-B.1). (unit: m;
    range: 0 to 10)
    """
    limb_box_margin: float = 0.1
    """Enlargement of the box of each limb: the largest motion of a limb between two frames (K06 IV-B.2; limbwise
    solver). (unit: m; range: 0 to 10)
    """
    overlap: Literal["shared", "exclusive", "adjacent"] = "exclusive"
    """Assignment of a free point inside the boxes of several limbs (K06 IV-B.2)."""
    max_points: int = 3000
    """Approximate maximum number of pixels of a depth image; larger images are sampled on a grid. (range: 100 to
    1e+07)
    """
    background: bool = True
    """Learn the static background from the depth images of cameras that do not move, and exclude it."""
    sampling_factor: int = 1
    """Use every n-th point of a limb (K06 IV-B.3). (range: 1 to 1000)"""
    min_limb_points: int = 50
    """Minimum number of points of a limb after sampling (K06 IV-B.3). (range: 0 to 1e+06)"""
    max_limb_points: int = 1000
    """Maximum number of points of a limb (K06 IV-B.3). (range: 1 to 1e+06)"""
    max_distance: float = 0.15
    """Maximum distance of a matched point from the surface of its limb (K06 IV-B.4; limbwise solver). (unit: m;
    range: 0.001 to 10)
    """
    band_ratio: float = 0.5
    """Weight of the elastic bands of a limb relative to its measurements (K07 4.3: 0.4 to 0.7; limbwise solver).
    (range: 0 to 100)
    """
    band_sigma: float = 0.003
    """Standard deviation of the length of an elastic band (tree solver). (unit: m; range: 1e-05 to 1)"""
    point_sigma: float = 0.03
    """Standard deviation of a surface point of weight one, for the whole-body solvers. (unit: m; range: 0.0001
    to 1)
    """
    tangential_weight: float = 0.035
    """Fraction of the information of a surface point that is tangential, for the whole-body solvers: 0 is point-
    to-plane, 1 is point-to-point; a small value prevents limbs from sliding along their axes. (range: 0 to 1)
    """
    gate_start: float = 0.3
    """Maximum distance of a matched point in the first step of a frame, for the whole-body solvers; it
    decreases. (unit: m; range: 0.001 to 10)
    """
    gate_end: float = 0.12
    """Final maximum distance of a matched point, for the whole-body solvers. (unit: m; range: 0.001 to 10)"""
    kernel_start: float = 0.1
    """Scale of the robust kernel in the first step of a frame; it decreases with every step. (unit: m; range:
    0.001 to 10)
    """
    kernel_end: float = 0.015
    """Final scale of the robust kernel, for the whole-body solvers. (unit: m; range: 0.001 to 10)"""
    depth_contour_sigma: float = 0.01
    """Standard deviation of an edge of the depth contour. (unit: m; range: 0.0001 to 1)"""
    prediction: float = 0.6
    """Fraction of the last motion that is extrapolated (0: the body is expected to stand still; whole-body
    solvers). (range: 0 to 1)
    """
    root_turn_sigma: float = 0.12
    """Standard deviation of the root's unexpected rotation in 1/30 s. (unit: rad; range: 0.0001 to 10)"""
    root_shift_sigma: float = 0.04
    """Standard deviation of the root's unexpected translation in 1/30 s. (unit: m; range: 0.0001 to 10)"""
    motion_scale: float = 0.25
    """Factor of the standard deviations of all unexpected motion, the strength of the jitter penalty (R07 eq.
    18, 26). Smaller values are smoother; measured lag on steady motion: none at 0.25, 0.02 frames at 0.125.
    (range: 0.01 to 100)
    """
    still_prior_gain: float = 30.0
    """Gain of the information of the motion prior for small deviations from the expected motion, which are
    mostly noise; 0 disables it. Larger values reduce jitter at rest and add lag in slow rotations (whole-body
    solvers). (range: 0 to 10000)
    """
    hypotheses: bool = True
    """Try other configurations of arms and legs if the frame contradicts the current ones (whole-body solvers)."""
    relocalization: bool = True
    """Search for a lost or wrongly tracked body at detections of persons; without a detection, search for a lost
    body in all foreground objects of its size (whole-body solvers).
    """
    depth_contour: bool = True
    """Match the rims of limbs to the depth contour, in the later steps of a frame (whole-body solvers)."""
    regions: bool = True
    """Find the contours of limbs in color images; whole-body solvers match them."""
    facing: bool = True
    """Match depth pixels inside a limb to the side that faces their camera (whole-body solvers)."""
    limits: bool = True
    """Penalize joint angles outside their limits (whole-body solvers)."""
    penetration: bool = True
    """Push the axes of limbs out of other limbs that they are not joined to, and, if the ground plane is known,
    their ends above it; hidden legs stand or sit on it (whole-body solvers).
    """
    fit_girths: bool = True
    """After a reset with fitted sizes, also fit the girths to the points of the first frame."""
    fit_lengths: bool = True
    """After a reset with fitted sizes, refine the lengths of limbs in the following frames; whole-body solvers
    only.
    """
    ground_clearance: float = 0.04
    """Free points below this height above the ground plane are background, if the frame has a ground plane.
    (unit: m; range: 0 to 1)
    """
    threads: int = 1
    """Number of threads of a step. Results are bit-identical for any number. (range: 1 to 256)"""
