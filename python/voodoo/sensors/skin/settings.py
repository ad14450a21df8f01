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
        sites: site -> how far [m] a region's middle may always be from it, see `SiteRay.bias`. A face is the front of the
            head.
        visible_bias: the same while a depth camera shows the site's limb: a face is always to the same side of the head's
            middle, and would pull for ever at a head that is where it was seen.
        gate: a new region farther than this from the predicted site is not it [m]; one that has its name keeps it.
        lost_gate: see gate_growth [m].
        gate_growth: a gate grows by this while its site is not seen [m/s], up to `lost_gate`, or to `widest_gate` for a
            hand that a depth camera sees.
        widest_gate: see above [m].
        unexplained: a region is taken far from where its site is expected only if it is this far outside the body [m].
        ambiguity: a second candidate that is not this many times as far as the first makes both useless.
        noise: of a region's center in the image; and how much it changes from picture to picture.
        static_seconds: what has skin's color for so long away from head and hands is background [s].
        settled_frames: pictures to learn from before the cue is used.
        learn_every: of the pictures after those, every n-th is learned from.
        each: with several persons, of each of them; it costs about as much for everybody as for one.

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
