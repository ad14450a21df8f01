"""Checks the known sites that silhouettes are computed from."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import FloatArray


def known_place(site: str, position: npt.ArrayLike) -> FloatArray:
    """The position (3,) [m] of a known site, checked.

    Raises:
        MeasurementError: it is not three finite numbers.
    """
    place = np.asarray(position, dtype=np.float64).reshape(-1)
    if place.shape != (3,) or not np.isfinite(place).all():
        raise MeasurementError(f"known[{site}]: expected three finite numbers, found {position!r}")
    return place
