"""Settings of the skin cue."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

from voodoo.errors import MeasurementError
from voodoo.sensors.model import PixelNoise


@dataclass(frozen=True)
class SkinSettings:
    """How skin regions become rays.

    Args:
        sites: site -> greatest systematic error [m] of a region's center, see `SiteRay.bias`. A face is the front of the
            head.
        visible_bias: such errors that apply while a depth camera measures the site's limb. A face is always on the same side
            of the head's center and would pull constantly at a head that is estimated correctly from depth.
        gate: gate of a new region around the predicted site [m]; a region that is assigned already is kept outside it.
        lost_gate: largest gate without depth [m], see `gate_growth`.
        gate_growth: growth of the gate while its site is not detected [m/s], up to `lost_gate`, or to `widest_gate` for a
            hand that a depth camera measures.
        widest_gate: largest gate with depth [m].
        unexplained: a region far from the predicted site is accepted only if it is at least this far outside the body [m].
        ambiguity: if the second-best candidate is less than this many times as far as the best one, neither is accepted.
        noise: of a region's center in the image, and how much it changes from image to image.
        static_seconds: pixels that have the color of skin for this time, away from head and hands, are background [s].
        settled_frames: images to learn from before the cue is used.
        learn_every: after those images, every n-th one is learned from.
        each: use the cue for each of several persons; the cost for all of them is approximately that for one.

    Raises:
        MeasurementError: a number that is not above zero.
    """

    sites: Mapping[str, float] = field(
        default_factory=lambda: {"head_center": 0.06, "l_hand": 0.06, "r_hand": 0.06},
    )
    visible_bias: Mapping[str, float] = field(default_factory=lambda: {"head_center": 0.12})
    gate: float = 0.12
    lost_gate: float = 0.35
    gate_growth: float = 1.0
    widest_gate: float = 0.80
    unexplained: float = 0.06
    ambiguity: float = 1.5
    noise: PixelNoise = field(default_factory=lambda: PixelNoise(pixels=1.5, spread=0.03))
    static_seconds: float = 1.0
    settled_frames: int = 1
    learn_every: int = 3
    each: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        numbers = {"gate": self.gate, "lost_gate": self.lost_gate, "static_seconds": self.static_seconds, **self.sites}
        numbers |= {f"visible_bias {site}": bias for site, bias in self.visible_bias.items()}
        numbers |= {"gate_growth": self.gate_growth, "widest_gate": self.widest_gate, "unexplained": self.unexplained}
        numbers["learn_every"] = float(self.learn_every)
        for name, value in numbers.items():
            if not (math.isfinite(value) and value > 0.0):
                raise MeasurementError(f"skin {name}: expected a number > 0, found {value!r}")
