"""Made by scripts/config_stub.py from the schema in the core; do not edit."""

from typing import Literal

from pydantic import BaseModel

class ConfigFields(BaseModel, frozen=True, extra="forbid"):
    """Entries of a configuration, all of them optional keyword arguments of `voodoo.Config`."""

    solver: Literal["limbwise", "chain", "tree"] = "chain"
    """How the pose is found from the correspondences."""
    max_steps: int = 5
    """Greatest number of ICP steps in a frame (K07 section 7: of the published ones 6 are a good compromise).
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
    """At most about this many pixels of a depth image are used; a finer image is sampled on a grid. (range: 100
    to 1e+07)
    """
    background: bool = True
    """Learn the still scene behind the body from depth images, as long as their camera does not move, and leave
    it out.
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
    """Share of a surface point's information that holds it along the surface as well, for the whole-body
    solvers: 0 is point-to-plane, 1 point-to-point; a little stops limbs from sliding along themselves.
    (range: 0 to 1)
    """
    gate_start: float = 0.3
    """Greatest distance of a matched point in the first step of a frame, for the whole-body solvers; it narrows.
    (unit: m; range: 0.001 to 10)
    """
    gate_end: float = 0.12
    """Greatest distance of a matched point once narrowed, for the whole-body solvers. (unit: m; range: 0.001 to
    10)
    """
    kernel_start: float = 0.1
    """Scale of the robust kernel in the first step of a frame; it narrows from step to step. (unit: m; range:
    0.001 to 10)
    """
    kernel_end: float = 0.03
    """Scale at which the robust kernel stops narrowing, for the whole-body solvers. (unit: m; range: 0.001 to
    10)
    """
    depth_contour_sigma: float = 0.01
    """Standard deviation of an edge of the outline, for the whole-body solvers. (unit: m; range: 0.0001 to 1)"""
    prediction: float = 0.6
    """Share of the last motion that is expected to go on (0: the body is expected to stand still; whole-body
    solvers). (range: 0 to 1)
    """
    root_turn_sigma: float = 0.12
    """Standard deviation of the root's unexpected turn in 1/30 s. (unit: rad; range: 0.0001 to 10)"""
    root_shift_sigma: float = 0.04
    """Standard deviation of the root's unexpected shift in 1/30 s. (unit: m; range: 0.0001 to 10)"""
    motion_scale: float = 0.25
    """Multiplies the standard deviations of all unexpected motion: the one strength of the jitter penalty (R07
    eq. 18, 26). Smaller is smoother; measured lag on steady motion: none at 0.25, 0.02 frames at 0.125.
    (range: 0.01 to 100)
    """
    still_prior_gain: float = 30.0
    """A motion that hardly differs from the expected one is held tighter by this factor of information, as
    noise; 0: as any other. Greater is calmer at rest and later in slow turns (whole-body solvers). (range: 0
    to 10000)
    """
    hypotheses: bool = True
    """Try other configurations of arms and legs where the frame speaks against the current ones (whole-body
    solvers).
    """
    relocalization: bool = True
    """Look for a body that is lost, or elsewhere than it is tracked, where a detector sees a person; for a lost
    one that no detector knows or sees in everything of its size that is no background (whole-body solvers).
    """
    depth_contour: bool = True
    """Draw the limbs' rims to the body's outline in depth images, in the later steps of a frame (whole-body
    solvers).
    """
    regions: bool = True
    """Draw the limbs' contours to the edges of their colors in color pictures (whole-body solvers)."""
    facing: bool = True
    """Match depth pixels inside a limb to the side that faces their camera (whole-body solvers)."""
    limits: bool = True
    """Keep joints within their limits, softly (whole-body solvers)."""
    penetration: bool = True
    """Axes of limbs are pushed out of other limbs that they are not joined to, and their ends up to the floor
    where it is known (whole-body solvers).
    """
    fit_girths: bool = True
    """After a reset that fits sizes, the first frame's points also fit the girths."""
    fit_lengths: bool = True
    """After a reset that fits sizes, the first frame decides between arms or legs of unlike lengths, and with
    the whole-body solvers the frames that follow refine the limbs' lengths.
    """
    ground_clearance: float = 0.04
    """Free points lower than this above the ground plane are background, where the frame has a ground plane.
    (unit: m; range: 0 to 1)
    """
    threads: int = 1
    """Threads for one step. The result is the same, bit by bit, for any number. (range: 1 to 256)"""
