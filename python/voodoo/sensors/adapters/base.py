"""The base class of adapters, which convert a sensor's measurements for the tracker's frame and for display."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any, ClassVar, Generic, TypeVar

import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate, Frame
from voodoo.drawing.surfaces import Canvas, Log
from voodoo.measurements import DepthImage, FloatArray
from voodoo.people import Followed
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.model import TYPICAL_RANGE_M, RangeNoise
from voodoo.sensors.rays import SiteRay, add_rays, agreed
from voodoo.sensors.settings import FrontEndSettings
from voodoo.tracker import Tracker

M = TypeVar("M")
T = TypeVar("T")


NOBODY = 0
"""Key of the part of a measurement that belongs to none of the tracked persons, see `Adapter.shares`."""
_WRONG_M = 0.5
"""Greatest mean distance of a measurement from the predicted sites of the person whom it belongs to."""


class Memory:
    """State that the adapters of one front end keep from frame to frame, by name and sensor."""

    def __init__(self) -> None:
        """Start empty."""
        self._kept: dict[tuple[str, str], Any] = {}

    def __copy__(self) -> Memory:
        """Copy every entry, to restore the state after a rejected frame."""
        twin = Memory()
        twin._kept = {key: copy(value) for key, value in self._kept.items()}
        return twin

    def all(self, name: str) -> dict[str, Any]:
        """Sensor -> its entry under a name."""
        return {sensor: value for (kept, sensor), value in self._kept.items() if kept == name}

    def get(self, name: str, sensor: str, make: Callable[[], T]) -> T:
        """Returns the entry of a sensor; creates it if there is none."""
        key = (name, sensor)
        if key not in self._kept:
            self._kept[key] = make()
        value: T = self._kept[key]
        return value

    def drop(self, name: str) -> None:
        """Remove the entries of all sensors under a name."""
        self._kept = {key: value for key, value in self._kept.items() if key[0] != name}

    def put(self, name: str, sensor: str, value: object) -> None:
        """Set or replace the entry of a sensor."""
        self._kept[name, sensor] = value


@dataclass(frozen=True, eq=False)
class Context:
    """The context that an adapter may read while a frame is built.

    Attributes:
        stamp: of the frame [s].
        measurements: all measurements of the frame, without those of frozen sensors; depth images without the pixels that the
            settings remove.
        predicted: site name -> predicted position (3,) at the frame's time [m], root frame; empty while no person is tracked.
        settings: settings of the front end.
        tracker: the tracker before the step; its estimate is the last one.
        gate: gate around the predicted sites.
        memory: state of this front end's adapters.
        others: the other tracked persons.
        rays: collects rays of named sites; their mutual agreement is evaluated before they are added to the frame.
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

    def add_scene(self, frame: Frame) -> None:
        """Add what is known of the scene: boxes without a person, and the floor."""
        for low, high in self.settings.exclude:
            frame.exclude(low, high)
        if self.settings.ground_z is not None:
            frame.set_ground(normal=(0.0, 0.0, 1.0), offset=self.settings.ground_z)

    def add_rays(self, frame: Frame) -> list[SiteRay]:
        """Add the collected rays to a frame; returns them with the trust by which they agree."""
        rays = agreed(self.rays, predicted=self.predicted)
        add_rays(frame, rays, model=self.settings.model)
        return rays

    def apart(self) -> Context:
        """A copy; what an adapter changes in it has no effect on this one."""
        return replace(self, gate=copy(self.gate), memory=copy(self.memory), rays=[])

    @cached_property
    def estimate(self) -> Estimate:
        """The tracker's last estimate, cached because the tracker creates a new object at every access."""
        return self.tracker.estimate

    @cached_property
    def depth_images(self) -> list[DepthImage]:
        """The depth images of the frame, if depth is used."""
        if "depth" not in self.settings.use:
            return []
        return [item for item in self.measurements if isinstance(item, DepthImage)]

    def range_weight(self, noise: RangeNoise | None, sharing: float, root_from_sensor: FloatArray) -> float:
        """Weight of a range at the body's distance from a sensor, 3 m while no person is tracked; 1 if `noise` is None."""
        if noise is None:
            return 1.0
        if not self.predicted:
            return self.settings.model.weight(noise.sigma(TYPICAL_RANGE_M), sharing=sharing)
        # For a few numbers plain Python is faster than arrays.
        sums = map(sum, zip(*(place.tolist() for place in self.predicted.values()), strict=True))
        body = [value / len(self.predicted) for value in sums]
        away = max(math.dist(body, root_from_sensor[:3, 3].tolist()), 0.1)
        return self.settings.model.weight(noise.sigma(away), sharing=sharing)

    def motion_compensated(
        self, points: npt.NDArray[Any], root_from_sensor: FloatArray, stamp: float
    ) -> npt.NDArray[Any]:
        """Extrapolates the points (N, 3) [m] of a sensor on the body from `stamp` to the frame's time."""
        moved = _core.carried(
            points, self.tracker._core, elapsed=self.stamp - stamp, world_from_sensor=root_from_sensor
        )
        return points if moved is None else moved


class Adapter(ABC, Generic[M]):
    """Everything the package knows about one kind of measurement; `voodoo.sensors.adapters.register` makes it known.

    Attributes:
        kind: the input it serves, as in `voodoo track --use`.
        measurement: class of the measurements; each has `sensor` and `stamp`.
        measured: their attribute with the measured array, by which a frozen sensor is told; "": they may repeat themselves.
        recorded_as: what recordings call such a sensor (`SensorInfo.kind`); "": as `kind`.
        panel: sort key of its images in an overlay; None: it has no image.
        panel_of_its_own: False: no panel if another camera's image shows the same view.
        colored: whether it is of color images, whose clothes tell several persons apart.
        while_searching: whether `add` is called while no person is tracked; then there is no prediction.
    """

    kind: ClassVar[str]
    measurement: type[M]
    measured: ClassVar[str] = ""
    recorded_as: ClassVar[str] = ""
    panel: ClassVar[int | None] = None
    panel_of_its_own: ClassVar[bool] = True
    colored: ClassVar[bool] = False
    while_searching: ClassVar[bool] = False

    def content(self, item: M) -> npt.NDArray[Any] | None:
        """Returns the measured data, to detect a frozen sensor by missing noise; None: it may legitimately repeat itself."""
        return getattr(item, self.measured) if self.measured else None

    @abstractmethod
    def add(self, frame: Frame, item: M, context: Context) -> None:
        """Add a measurement to the tracker's frame, or to `context.rays`.

        Raises:
            MeasurementError: it cannot be used.
        """

    def ready(self, item: M, settings: FrontEndSettings) -> M:
        """The measurement as it is used, once a frame: by default unchanged."""
        return item

    def shares(self, item: M, persons: Mapping[int, Context]) -> Mapping[int, M]:
        """The part of a measurement that belongs to each of several persons.

        By default all of it belongs to the person whose predicted sites its positions and rays are nearest to.

        Args:
            item: the measurement.
            persons: number -> context of every person who is tracked; at least one.

        Returns:
            Number of a person, or NOBODY -> the part.
        """
        away = {}
        for number, context in persons.items():
            trial, frame = context.apart(), Frame(stamp=context.stamp)
            self.add(frame, item, trial)
            trial.add_rays(frame)
            away[number] = frame._distance(context.predicted)
        nearest = min(away, key=lambda number: away[number])
        return {nearest if away[nearest] < _WRONG_M else NOBODY: item}

    def learn(self, item: M, estimate: Estimate, memory: Memory, *, trusted_start: bool) -> None:
        """Learn from the estimate of a frame; `trusted_start`: the user set the initial pose."""

    def forget(self, memory: Memory) -> None:
        """Discard what was learned of a person who has left."""

    def picture(self, item: M) -> npt.NDArray[Any] | None:
        """Returns the camera's image: colors (H, W, 3) BGR uint8, or depths (H, W) float32 [m]; None: no image."""
        return None

    def draw(self, item: M, canvas: Canvas, memory: Memory) -> None:
        """Draw a measurement into an overlay; for depth images nothing is drawn, because they are the background image."""

    def log(self, item: M, log: Log, memory: Memory) -> None:
        """Show a measurement in Rerun."""
