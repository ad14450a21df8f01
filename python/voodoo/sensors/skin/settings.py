"""Settings of the skin cue."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from voodoo.sensors.model import PixelNoise, check_number


@dataclass(frozen=True)
class SkinSettings:
    """How skin regions become rays.

    Args:
        sites: site -> greatest systematic error [m] of a region's center, see `SiteRay.bias`. A face is the front of the
            head.
        visible_bias: such errors that apply while a depth camera measures the site's limb. A face is always on the same side
            of the head's center and would pull constantly at a head that is estimated correctly from depth.
        gate: gate of a region around the predicted site [m].
        gate_growth: growth of the gate while its site is not detected [m/s].
        lost_gate: largest gate [m].
        widest_gate: largest gate of a hand beside a depth camera [m].
        noise: of a region's center in the image, and how much it changes from image to image.
        learn_every: after the first image, colors are learned from every n-th one.
        each: use the cue for each of several persons.

    Raises:
        MeasurementError: a number that is not above zero.
    """

    sites: Mapping[str, float] = field(
        default_factory=lambda: {"head_center": 0.06, "l_hand": 0.06, "r_hand": 0.06},
    )
    visible_bias: Mapping[str, float] = field(default_factory=lambda: {"head_center": 0.12})
    gate: float = 0.12
    gate_growth: float = 1.0
    lost_gate: float = 0.20
    widest_gate: float = 0.80
    noise: PixelNoise = field(default_factory=lambda: PixelNoise(pixels=1.5, spread=0.03))
    learn_every: int = 3
    each: bool = False

    def __post_init__(self) -> None:
        """Check the numbers."""
        names = ("gate", "gate_growth", "lost_gate", "widest_gate", "learn_every")
        numbers = {name: getattr(self, name) for name in names} | dict(self.sites)
        numbers |= {f"visible_bias {site}": bias for site, bias in self.visible_bias.items()}
        for name, value in numbers.items():
            check_number(f"skin {name}", value, zero=False)
