"""Converts recorded measurements to the tracker's `Frame`: prediction, gates, agreement of rays, weights from standard
deviations. All commands use this front end. Sensor-specific code is in the adapters, see `voodoo.sensors.adapters`."""

from __future__ import annotations

from copy import copy
from typing import Any

from voodoo._core import Estimate, Frame
from voodoo.measurements import RecordedFrame
from voodoo.names import INPUTS
from voodoo.pipeline.frozen import FrozenSensors
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.search import Search, nobody
from voodoo.pipeline.starts.chosen import Starts
from voodoo.sensors.adapters import Context, Memory, adapters_of, all_adapters
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.keypoints.sensor import KeypointReport
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.settings import LEVEL_FRAMES, FrontEndSettings
from voodoo.sensors.skin.tracker import SkinTracker
from voodoo.tracker import Tracker

__all__ = ["INPUTS", "LEVEL_FRAMES", "FrontEnd", "FrontEndSettings", "paired"]


class FrontEnd:
    """Feeds one tracker from recorded measurements of any kind.

    Args:
        tracker: with a first pose (`reset`), or without one; then the first pose is searched for in the measurements.
        settings: see FrontEndSettings.
        starts: sources of the first pose; None: every kind of measurement that can give one.

    Attributes:
        search: whether a person is tracked, and how the first pose was found.
        memory: state that the adapters keep between frames.
        rays: rays of the last frame, with their trust.
    """

    def __init__(
        self, tracker: Tracker, *, settings: FrontEndSettings | None = None, starts: Starts | None = None
    ) -> None:
        """Start from the current state of the tracker."""
        self.tracker = tracker
        self.settings = settings or FrontEndSettings()
        self.memory = Memory()
        self.rays: list[SiteRay] = []
        self.search = Search(tracker, starts)
        self._frozen = FrozenSensors()
        self._begin()

    def _begin(self) -> None:
        """Clear all state for a new person."""
        chosen = self.settings
        # The pose was set by the user, or by a source other than the tracker.
        self._trusted_start = self.search.posed
        self._gate = SiteGate(chosen.gate_radius, chosen.gate_growth, chosen.gate_widest)

    @property
    def frozen(self) -> tuple[str, ...]:
        """Sensors that repeated their measurement in the last frame and were left out."""
        return self._frozen.names

    @property
    def reports(self) -> dict[str, KeypointReport]:
        """Outcome of the keypoints in each sensor's last image."""
        return self.memory.all("keypoints")

    @property
    def skin(self) -> dict[str, SkinTracker]:
        """The skin cue of each color camera."""
        return self.memory.all("skin")

    def step(self, recorded: RecordedFrame) -> Estimate:
        """Make the frame, step the tracker, and learn from the estimate.

        Returns:
            The estimate. Its status is "searching" and it has no joints if no person was found yet, or the person has left.

        Raises:
            MeasurementError: a measurement is invalid.
            BodyError: a given first pose names a site that the body does not have.
            RecordingError: an image cannot be decoded.

        After an error, tracker and front end are unchanged.
        """
        before = self._state()
        try:
            frame = self.frame(recorded)
            steps = self.search.posed or self.search.by_tracker
            estimate = self.tracker.step(frame) if steps else nobody(recorded.stamp)
        except BaseException:
            if self.search.posed and not before["search"].posed:
                self.tracker.search()
            vars(self).update(before)
            raise
        was_posed = self.search.posed
        if steps:
            estimate = self.search.learn(estimate)
        if self.search.posed:
            self._learn(recorded, estimate)
        elif was_posed:
            self._forget()
        else:
            self.rays = []
        return estimate

    def _learn(self, recorded: RecordedFrame, estimate: Estimate) -> None:
        for item in recorded.measurements:
            for adapter in adapters_of(item):
                adapter.learn(item, estimate, self.memory, trusted_start=self._trusted_start)
        self._trusted_start = False

    def _forget(self) -> None:
        """Clear what was learned about a person who left: the next one moves and looks different."""
        self.rays = []
        for adapter in all_adapters():
            adapter.forget(self.memory)
        self._begin()

    def _state(self) -> dict[str, Any]:
        """Snapshot of all state that `frame` changes."""
        return {
            "rays": self.rays,
            "memory": copy(self.memory),
            "_frozen": copy(self._frozen),
            "_gate": copy(self._gate),
            "search": copy(self.search),
            "_trusted_start": self._trusted_start,
        }

    def frame(self, recorded: RecordedFrame) -> Frame:
        """Make the tracker's frame without stepping. A tracker without a pose is reset to a first pose if a source finds one."""
        use = self.settings.use
        alive = self._frozen.without(recorded.measurements, use=use)
        if self.search.is_due(recorded.stamp):
            used = [item for item in alive if any(adapter.kind in use for adapter in adapters_of(item))]
            if self.search.search(recorded.stamp, used, self.settings):
                self._begin()
        context = Context(
            stamp=recorded.stamp,
            measurements=alive,
            predicted=self.tracker.predict(recorded.stamp) if self.search.posed else {},
            settings=self.settings,
            tracker=self.tracker,
            gate=self._gate,
            memory=self.memory,
        )
        frame = Frame(stamp=recorded.stamp)
        context.add_scene(frame)
        for item in alive:
            for adapter in adapters_of(item):
                if adapter.kind in use and (self.search.posed or adapter.while_searching):
                    adapter.add(frame, item, context)
        self.rays = context.add_rays(frame)
        return frame
