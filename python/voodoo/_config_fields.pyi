"""Made by scripts/config_stub.py from the schema in the core; do not edit."""

from typing import Literal

from pydantic import BaseModel

class ConfigFields(BaseModel, frozen=True, extra="forbid"):
    """Entries of a configuration, all of them optional keyword arguments of `voodoo.Config`."""

    solver: Literal["limbwise", "chain", "tree"] = "chain"
    """How the pose is computed from the correspondences."""
    max_steps: int = 5
    """Maximum number of ICP steps in a frame (K07 section 7: 6 are a good compromise for the published solver).
    (range: 1 to 100)
    """
    min_change: float = 1e-07
    """The steps end when the mean squared distance changes by less than this (K06 III-B step 6). (unit: m^2;
    range: 0 to 1)
    """
    body_box_margin: float = 0.2
    """Enlargement of the box around the whole body; free points outside are background (K06 IV-B.1). (unit: m;
    range: 0 to 10)
    """
    limb_box_margin: float = 0.1
    """Enlargement of the box of each limb: how far a limb may move between two frames (K06 IV-B.2; limbwise
    solver). (unit: m; range: 0 to 10)
    """
    overlap: Literal["shared", "exclusive", "adjacent"] = "exclusive"
    """What happens to a free point inside the boxes of several limbs (K06 IV-B.2)."""
    max_points: int = 3000
    """At most approximately this many pixels of a depth image are used; a finer image is sampled on a grid.
    (range: 100 to 1e+07)
    """
    background: bool = True
    """Learn the still scene behind the body from depth images, as long as their camera does not move, and
    exclude it.
    """
    sampling_factor: int = 1
    """Every n-th point of a limb is used (K06 IV-B.3). (range: 1 to 1000)"""
    min_limb_points: int = 50
    """A limb keeps at least this many of its points when sampled (K06 IV-B.3). (range: 0 to 1e+06)"""
    max_limb_points: int = 1000
    """A limb keeps at most this many points (K06 IV-B.3). (range: 1 to 1e+06)"""
    max_distance: float = 0.15
    """A point farther than this from its limb's surface is not matched (K06 IV-B.4; limbwise solver). (unit: m;
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
    tangential_weight: float = 0.07
    """Fraction of a surface point's information that also acts along the surface, for the whole-body solvers: 0
    is point-to- plane, 1 point-to-point. A small value keeps limbs from sliding along their axis. (range: 0
    to 1)
    """
    gate_start: float = 0.3
    """Maximum distance of a matched point in the first step of a frame, for the whole-body solvers; it decreases
    from step to step. (unit: m; range: 0.001 to 10)
    """
    gate_end: float = 0.12
    """Maximum distance of a matched point in the last steps of a frame, for the whole-body solvers. (unit: m;
    range: 0.001 to 10)
    """
    kernel_start: float = 0.1
    """Scale of the robust kernel in the first step of a frame; it decreases from step to step. (unit: m; range:
    0.001 to 10)
    """
    kernel_end: float = 0.03
    """Least scale of the robust kernel, for the whole-body solvers. (unit: m; range: 0.001 to 10)"""
    depth_contour_sigma: float = 0.01
    """Standard deviation of a point of the depth contour, for the whole-body solvers. (unit: m; range: 0.0001 to
    1)
    """
    prediction: float = 0.6
    """Fraction of the last motion that is expected to continue (0: the body is expected to stand still; whole-
    body solvers). (range: 0 to 1)
    """
    root_turn_sigma: float = 0.12
    """Standard deviation of the root's unexpected rotation in 1/30 s. (unit: rad; range: 0.0001 to 10)"""
    root_shift_sigma: float = 0.04
    """Standard deviation of the root's unexpected translation in 1/30 s. (unit: m; range: 0.0001 to 10)"""
    motion_scale: float = 0.25
    """Multiplies the standard deviations of all unexpected motion: the one strength of the jitter penalty (R07
    eq. 18, 26). Smaller is smoother; measured lag on steady motion: none at 0.25, 0.02 frames at 0.125.
    (range: 0.01 to 100)
    """
    still_prior_gain: float = 30.0
    """A motion that hardly differs from the expected one counts as noise, and its prior gets this factor of
    additional information; 0: none. Greater values reduce jitter at rest and add lag to slow rotations
    (whole-body solvers). (range: 0 to 10000)
    """
    hypotheses: bool = True
    """Try other configurations of arms and legs where the frame contradicts the current ones (whole-body
    solvers).
    """
    relocalization: bool = True
    """Move a body that is lost, or tracked at a wrong position, to a detected person. A lost body that the
    detector does not find is searched in all segments of its size that are not background (whole-body
    solvers).
    """
    depth_contour: bool = True
    """Fit the contours of limbs to the depth contour of the body, in the later steps of a frame (whole-body
    solvers).
    """
    regions: bool = True
    """Fit the contours of limbs to the edges of their colors in color images (whole-body solvers)."""
    facing: bool = True
    """Match depth pixels inside a limb to the side that faces their camera (whole-body solvers)."""
    limits: bool = True
    """Keep joints within their limits, as a soft constraint (whole-body solvers)."""
    penetration: bool = True
    """Keep axes of limbs outside of limbs that they are not joined to, and their ends above the floor where it
    is known, as soft constraints (whole-body solvers).
    """
    fit_girths: bool = True
    """After a reset that fits sizes, the first frame's points also fit the girths."""
    fit_lengths: bool = True
    """After a reset that fits sizes, the first frame resolves unequal lengths of arms or legs, and with the
    whole-body solvers later frames refine the lengths of limbs.
    """
    ground_clearance: float = 0.04
    """Free points lower than this above the ground plane are background, where the frame has a ground plane.
    (unit: m; range: 0 to 1)
    """
    threads: int = 1
    """Threads for one step. The result is bit-identical for any number. (range: 1 to 256)"""
