"""The rest posture towards which angles are pulled in directions that targets and images leave free."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import BodyError, MeasurementError
from voodoo.ik.chain import Chain
from voodoo.ik.posture import Posture
from voodoo.ik.values import numbers

Rest: TypeAlias = Mapping[str, float] | npt.ArrayLike | Posture
"""Angles (n,) or a posture of the chain, for all joint angles; or name of an angle -> value [rad, m], for these alone."""


def rest_parts(chain: Chain, rest: Rest | None) -> list[tuple[int, float]]:
    """Index and value of every angle with a rest value; for whole postures all but the pose of a free root.

    Raises:
        BodyError: a name that is not an angle of the chain.
        MeasurementError: not finite, another number of angles than the chain has, or of another chain.
    """
    names = chain.angle_names
    if rest is None:
        return []
    if isinstance(rest, Mapping):
        unknown = [name for name in rest if name not in names]
        if unknown:
            raise BodyError(f"rest: expected some of {', '.join(names)}, found {', '.join(map(repr, unknown))}")
        values = _finite(list(rest.values()), len(rest))
        return [(names.index(name), value) for name, value in zip(rest, values, strict=True)]
    if isinstance(rest, Posture) and rest.angle_names != names:
        raise MeasurementError(f"rest: expected a posture of {chain!r}, found one of {', '.join(rest.angle_names)}")
    values = _finite(rest.angles if isinstance(rest, Posture) else rest, len(names))
    # The position of the root has no rest value.
    joints = 6 if names[:1] == ("root_x",) else 0
    return list(enumerate(values))[joints:]


def named_rest(chain: Chain, rest: Rest | None) -> dict[str, float]:
    """`rest_parts` by name."""
    return {chain.angle_names[index]: value for index, value in rest_parts(chain, rest)}


def _finite(values: npt.ArrayLike, count: int) -> list[float]:
    """An array of this many numbers.

    Raises:
        MeasurementError: another number of them, or not finite.
    """
    found = numbers("rest", values)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise MeasurementError(f"rest: expected {count} finite numbers, found {values!r}")
    return [float(value) for value in found]
