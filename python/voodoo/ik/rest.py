"""The posture that angles are drawn to where neither targets nor images object."""

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
"""Angles (n,) or a posture of the chain, all joint angles of which count, or name of an angle -> value, those alone [rad, m]."""


def rest_parts(chain: Chain, rest: Rest | None) -> list[tuple[int, float]]:
    """Index and value of every angle that is drawn somewhere; of whole postures all but the pose of a free root.

    Raises:
        BodyError: a name that is no angle of the chain.
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
    # Where someone stands is no question of comfort.
    joints = 6 if names[:1] == ("root_x",) else 0
    return list(enumerate(values))[joints:]


def named_rest(chain: Chain, rest: Rest | None) -> dict[str, float]:
    """`rest_parts` by name."""
    return {chain.angle_names[index]: value for index, value in rest_parts(chain, rest)}


def _finite(values: npt.ArrayLike, count: int) -> list[float]:
    """So many numbers.

    Raises:
        MeasurementError: another number of them, or not finite.
    """
    found = numbers("rest", values)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise MeasurementError(f"rest: expected {count} finite numbers, found {values!r}")
    return [float(value) for value in found]
