"""Turns the poses of a live session upright whose root frame is a camera's, as those of recordings."""

from __future__ import annotations

from contextlib import suppress

import numpy as np

from voodoo._core import Estimate
from voodoo.errors import VoodooError
from voodoo.export.track import Track
from voodoo.export.upright import Turn, by_axes, by_floor, lying_words
from voodoo.live.follow import Step
from voodoo.live.stream import Live
from voodoo.measurements import ColorImage, DepthImage
from voodoo.model.standing import is_optical
from voodoo.pipeline.floor import EVERY, FloorSight
from voodoo.sensors.settings import LEVEL_FRAMES

_SIGHTS, _LOOKS = 5, 50
"""After seeing the floor so often, or searching so many frames for it, the search ends."""


class Upright:
    """Finds out how poses are turned: by the floor that is seen in the first frames with a person, until then by the axes.

    Args:
        live: the sources; told what was found, and what speaks against it.
    """

    def __init__(self, live: Live) -> None:
        """Nothing is known yet."""
        self._live = live
        self._turn: Turn | None = None
        self._sight: FloorSight | None = None
        self._seen: list[Estimate] = []
        self._steps = 0

    def of(self, step: Step) -> Turn:
        """How the root frame of a step is turned."""
        root = self._live.root_frame
        if self._turn is None:
            cameras = [item for item in step.frame.measurements if isinstance(item, DepthImage | ColorImage)]
            own = any(np.array_equal(item.root_from_sensor, np.eye(4)) for item in cameras)
            optical = is_optical(root) or (own and root not in LEVEL_FRAMES)
            self._turn = by_axes(root, optical=optical)
            self._sight = FloorSight() if optical else None
        there = [one for one in step.estimates.values() if one.joints]
        self._steps += bool(there)
        if not there or self._steps % EVERY or self._steps > _LOOKS * EVERY:
            return self._turn
        self._seen.append(there[0])
        if self._sight is not None:
            with suppress(VoodooError):  # tracking reports damage
                self._sight.look(step.frame)
            if len(self._sight.planes) >= _SIGHTS and (floor := self._sight.floor) is not None:
                self._turn, self._sight = by_floor(floor, optical=True), None
                self._live.faults.log(f"outputs are turned upright {self._turn.words}")
        if len(self._seen) == 2 * _SIGHTS and (words := lying_words(Track.of(self._seen), root, self._turn)):
            self._live.faults.log(words)
        return self._turn
