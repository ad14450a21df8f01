"""From recorded measurements to the tracker's Frame, the one way there is: prediction, gates, agreement of rays, weights
from standard deviations. What is special about a sensor is in its adapter, see `voodoo.sensors.adapters`."""

from __future__ import annotations

from copy import copy
from typing import Any

from voodoo._core import Estimate, Frame
from voodoo.measurements import RecordedFrame
from voodoo.names import INPUTS
from voodoo.pipeline.frozen import FrozenSensors
from voodoo.pipeline.pairing import paired
from voodoo.sensors.adapters import Context, Memory, adapter_of
from voodoo.sensors.gating import SiteGate, SitePredictor
from voodoo.sensors.keypoints.sensor import KeypointReport
from voodoo.sensors.motion import LimbMotion
from voodoo.sensors.rays import SiteRay, add_rays, agreed
from voodoo.sensors.settings import LEVEL_FRAMES, FrontEndSettings
from voodoo.sensors.skin.tracker import SkinTracker
from voodoo.tracker import Tracker

__all__ = ["INPUTS", "LEVEL_FRAMES", "FrontEnd", "FrontEndSettings", "paired"]


class FrontEnd:
    """Feeds one tracker from recorded measurements of any kind.

    Args:
        tracker: already reset to the first pose.
        settings: see FrontEndSettings.

    Attributes:
        memory: what the adapters keep of their sensors.
        rays: of the last frame, with their trust.
    """

    def __init__(self, tracker: Tracker, *, settings: FrontEndSettings | None = None) -> None:
        """Take up the tracker's current estimate as the first prediction."""
        self.tracker = tracker
        self.settings = settings or FrontEndSettings()
        self.memory = Memory()
        self.rays: list[SiteRay] = []
        self._frozen = FrozenSensors()
        self._steps = 0
        self._predictor = SitePredictor()
        self._motion = LimbMotion()
        chosen = self.settings
        self._gate = SiteGate(chosen.gate_radius, chosen.gate_growth, chosen.gate_widest)
        self._predictor.update(float("nan"), tracker.estimate.joints)

    @property
    def frozen(self) -> tuple[str, ...]:
        """Sensors that repeated themselves in the last frame, and were left out."""
        return self._frozen.names

    @property
    def reports(self) -> dict[str, KeypointReport]:
        """What became of the keypoints of each sensor's last image."""
        return self.memory.all("keypoints")

    @property
    def skin(self) -> dict[str, SkinTracker]:
        """The skin cue of each colour camera."""
        return self.memory.all("skin")

    def step(self, recorded: RecordedFrame) -> Estimate:
        """Make the frame, step the tracker, and learn from the estimate.

        Raises:
            MeasurementError: a measurement that cannot be used.
            RecordingError: a picture that cannot be decoded.

        After either, tracker and front end are as they were.
        """
        before = self._state()
        try:
            estimate = self.tracker.step(self.frame(recorded))
        except BaseException:
            vars(self).update(before)
            raise
        self._predictor.update(recorded.stamp, estimate.joints)
        self._motion.update(recorded.stamp, estimate.world_from_limb)
        for item in recorded.measurements:
            adapter_of(item).learn(item, estimate, self.memory, vouched=self._steps == 0)
        self._steps += 1
        return estimate

    def _state(self) -> dict[str, Any]:
        """All that `frame` changes, as it is."""
        return {
            "rays": self.rays,
            "memory": copy(self.memory),
            "_frozen": copy(self._frozen),
            "_gate": copy(self._gate),
        }

    def frame(self, recorded: RecordedFrame) -> Frame:
        """The tracker's frame, without stepping."""
        use = self.settings.use
        alive = self._frozen.without(recorded.measurements, use=use)
        frame = Frame(stamp=recorded.stamp)
        if self.settings.ground_z is not None:
            frame.set_ground(normal=(0.0, 0.0, 1.0), offset=self.settings.ground_z)
        predicted = self._predictor.predict(recorded.stamp)
        context = Context(
            stamp=recorded.stamp,
            measurements=alive,
            predicted=predicted,
            settings=self.settings,
            tracker=self.tracker,
            predictor=self._predictor,
            motion=self._motion,
            gate=self._gate,
            memory=self.memory,
        )
        for item in alive:
            adapter = adapter_of(item)
            if adapter.kind in use:
                adapter.add(frame, item, context)
        self.rays = context.rays
        if self.settings.agreement > 0.0:
            self.rays = agreed(self.rays, predicted=predicted, scale=self.settings.agreement)
        add_rays(frame, self.rays, model=self.settings.model)
        return frame
