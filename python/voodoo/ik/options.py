"""How to solve."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from voodoo.errors import MeasurementError
from voodoo.ik.values import Bone, listed_bones


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to solve.

    Args:
        steps: maximum number of steps of each priority level, and of the image (J10: 15).
        tolerance: a residual below this counts as zero [m].
        still: the search ends when a step changes no angle by more than this [rad].
        gain: fraction of the step h / |P grad h|^2 of the image criterion, above 0 to 1: alpha of J10 eq. 4.
        caution: damping of the image step if few samples lie outside, or the motion is along the optical axes: the
            smallest significant change of h per radian, as a fraction of the bones' length in the images; 0 trusts every
            pixel.
        largest_turn: largest change of an angle in one step [rad].
        margin: required depth of bones inside the silhouettes, in radii of their limbs, less the silhouette's border; 0 is
            J10's criterion.
        thin: a silhouette up to this many times that depth counts as the limb itself, and the bone is centered in it; 0: no
            bone is centered.
        bones: the segments that are projected; None: joint to joint.
    """

    steps: int = 15
    tolerance: float = 1e-6
    still: float = 1e-6
    gain: float = 1.0
    caution: float = 0.3
    largest_turn: float = 0.5
    margin: float = 1.1
    thin: float = 1.7
    bones: tuple[Bone, ...] | None = None

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            MeasurementError: it names the entry.
        """
        if isinstance(self.steps, bool) or not isinstance(self.steps, int) or not 0 <= self.steps <= 100_000:
            raise MeasurementError(f"steps: expected 0 to 100000, found {self.steps!r}")
        for name, low, high in (
            ("tolerance", 0.0, 1.0),
            ("still", 0.0, 1.0),
            ("gain", 1e-6, 1.0),
            ("caution", 0.0, 10.0),
            ("largest_turn", 1e-6, math.pi),
            ("margin", 0.0, 2.0),
            ("thin", 0.0, 3.0),
        ):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and low <= value <= high):
                raise MeasurementError(f"{name}: expected {low:g} to {high:g}, found {value!r}")
        listed_bones(self.bones)

    def parts(self) -> tuple[int, float, float, float, float, float]:
        """The options as the core takes them."""
        return (self.steps, self.tolerance, self.still, self.gain, self.caution, self.largest_turn)


def chosen_options(options: Options | None, changes: Mapping[str, Any]) -> Options:
    """Options, or the defaults with changes.

    Raises:
        MeasurementError: both, or a field that does not exist.
    """
    if options is not None and changes:
        raise MeasurementError(f"options: expected options or single fields, found both: {', '.join(changes)}")
    if options is not None and not isinstance(options, Options):
        raise MeasurementError(f"options: expected ik.Options, found {options!r}")
    if options is not None:
        return options
    try:
        return Options(**changes)
    except TypeError:
        known = Options.__dataclass_fields__
        unknown = [name for name in changes if name not in known]
        raise MeasurementError(f"options: expected some of {', '.join(known)}, found {', '.join(unknown)}") from None
