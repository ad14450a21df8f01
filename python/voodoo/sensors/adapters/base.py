"""What a sensor is to the rest of the package: one adapter, from its measurement to the tracker's frame and to pictures."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate, Frame
from voodoo.measurements import DepthImage
from voodoo.people import Followed
from voodoo.sensors.adapters.drawing import Canvas, Log
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.model import RangeNoise
from voodoo.sensors.pixels import FloatArray
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

M = TypeVar("M")
T = TypeVar("T")


_TYPICAL_RANGE_M = 3.0


class Memory:
    """What the adapters of one front end keep from frame to frame, by name and sensor."""

    def __init__(self) -> None:
        """Nothing kept yet."""
        self._kept: dict[tuple[str, str], Any] = {}

    def __copy__(self) -> Memory:
        """The same, each thing copied: what a refused frame changed is put back."""
        twin = Memory()
        twin._kept = {key: copy(value) for key, value in self._kept.items()}
        return twin

    def all(self, name: str) -> dict[str, Any]:
        """Sensor -> what is kept of it under a name."""
        return {sensor: value for (kept, sensor), value in self._kept.items() if kept == name}

    def get(self, name: str, sensor: str, make: Callable[[], T]) -> T:
        """What is kept of a sensor; made when there is nothing yet."""
        key = (name, sensor)
        if key not in self._kept:
            self._kept[key] = make()
        value: T = self._kept[key]
        return value

    def drop(self, name: str) -> None:
        """Forget what is kept under a name, of all sensors."""
        self._kept = {key: value for key, value in self._kept.items() if key[0] != name}

    def put(self, name: str, sensor: str, value: object) -> None:
        """Keep something of a sensor in place of what was kept."""
        self._kept[name, sensor] = value


@dataclass(frozen=True, eq=False)
class Context:
    """What an adapter may read while one frame is made.

    Attributes:
        stamp: of the frame [s].
        measurements: all of the frame, without those of frozen sensors.
        predicted: site name -> (3,) expected at the frame's time [m], root frame; empty while nobody is tracked.
        settings: what is used, and how much it is believed.
        tracker: not yet stepped; its estimate is the last one.
        gate: around the predicted sites.
        memory: of this front end.
        others: those who are followed beside the one whose frame is made.
        rays: to put rays of named sites into; they are weighed against each other before they join the frame.
    """

    stamp: float
    measurements: Sequence[Any]
    predicted: Mapping[str, FloatArray]
    settings: FrontEndSettings
    tracker: Tracker | Followed
    gate: SiteGate
    memory: Memory
    others: Sequence[Followed] = ()
    rays: list[SiteRay] = field(default_factory=list)

    @cached_property
    def estimate(self) -> Estimate:
        """The tracker's last one; with the tracker it is made anew at every look."""
        return self.tracker.estimate

    @cached_property
    def depth_images(self) -> list[DepthImage]:
        """Those of the frame, if depth is used."""
        if "depth" not in self.settings.use:
            return []
        return [item for item in self.measurements if isinstance(item, DepthImage)]

    def range_weight(self, noise: RangeNoise | None, sharing: float, root_from_sensor: FloatArray) -> float:
        """Weight of a range at the body's distance from a sensor, 3 m while nobody is tracked; 1 without a noise."""
        if noise is None:
            return 1.0
        if not self.predicted:
            return self.settings.model.weight(noise.sigma(_TYPICAL_RANGE_M), sharing=sharing)
        # Numbers by themselves: a few of them are faster without arrays.
        sums = map(sum, zip(*(place.tolist() for place in self.predicted.values()), strict=True))
        body = [value / len(self.predicted) for value in sums]
        away = max(math.dist(body, root_from_sensor[:3, 3].tolist()), 0.1)
        return self.settings.model.weight(noise.sigma(away), sharing=sharing)

    def motion_compensated(
        self, points: npt.NDArray[Any], root_from_sensor: FloatArray, stamp: float
    ) -> npt.NDArray[Any]:
        """Points of a sensor (N, 3) [m] measured at `stamp`, those on the body where they are at the frame's time."""
        moved = _core.carried(
            points, self.tracker._core, elapsed=self.stamp - stamp, world_from_sensor=root_from_sensor
        )
        return points if moved is None else moved


class Adapter(ABC, Generic[M]):
    """Everything the package knows about one kind of measurement; `voodoo.sensors.adapters.register` makes it known.

    Attributes:
        kind: the input it serves, as in `voodoo track --use`.
        measurement: class of the measurements; each has `sensor` and `stamp`.
        recorded_as: what recordings call such a sensor (`SensorInfo.kind`); "": as `kind`.
        panel: place of its pictures in an overlay, the least first; None: it has none.
        panel_of_its_own: False: no panel where another camera's picture shows the same.
        while_searching: whether `add` is called when nobody is tracked; then nothing is predicted.
    """

    kind: ClassVar[str]
    measurement: type[M]
    recorded_as: ClassVar[str] = ""
    panel: ClassVar[int | None] = None
    panel_of_its_own: ClassVar[bool] = True
    while_searching: ClassVar[bool] = False

    def content(self, item: M) -> npt.NDArray[Any] | None:
        """What was measured, to tell a frozen sensor from one that has noise; None: it may repeat itself."""
        return None

    @abstractmethod
    def add(self, frame: Frame, item: M, context: Context) -> None:
        """Add a measurement to the tracker's frame, or to `context.rays`.

        Raises:
            MeasurementError: it cannot be used.
        """

    def learn(self, item: M, estimate: Estimate, memory: Memory, *, trusted_start: bool) -> None:
        """Learn from the estimate of a frame; `trusted_start`: somebody set the pose it started from."""

    def forget(self, memory: Memory) -> None:
        """The person is gone: forget what belongs to them alone."""

    def picture(self, item: M) -> npt.NDArray[Any] | None:
        """What a camera saw: colors (H, W, 3) BGR uint8, or depths (H, W) float32 [m]; None: no picture is known."""
        return None

    def draw(self, item: M, canvas: Canvas, memory: Memory) -> None:
        """Draw a measurement into an overlay; depth pixels need nothing, they are the picture."""

    def log(self, item: M, log: Log, memory: Memory) -> None:
        """Show a measurement in Rerun."""
