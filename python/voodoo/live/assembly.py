"""Assembles recorded frames from arrivals: checks stamps, joins sensors, reports and leaves out damaged measurements.

Measurements are ordered by stamp, not by arrival: repeated stamps, wrong order, and clocks that were set are found.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from voodoo._core import implausible_depth
from voodoo.errors import RecordingError, VoodooError
from voodoo.live.source import Arrival, Faults
from voodoo.measurements import ColorImage, DepthImage, Measurement, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.pipeline.frozen import unchanged
from voodoo.recordings.recording import refuse_blank
from voodoo.recordings.together import WAIT_S

GAP_S = 1.0
"""After this time without a measurement, persons have moved and the search starts again."""
_PASSED = 0.25
"""If stamps advance by more than a gap while less than this fraction of it has elapsed, the clock was set ahead."""


@dataclass(frozen=True)
class Verdict:
    """Result of checking a stamp.

    Args:
        fault: name in FAULTS, or "".
        usable: whether the measurement is used.
        breaks: time does not continue from the previous measurement.
    """

    fault: str = ""
    usable: bool = True
    breaks: bool = False


class Stamps:
    """Checks the stamps of a sensor, one after the other.

    A single stamp that is out of order is left out; if the next one continues from it, time has jumped.

    Attributes:
        last: last used stamp [s].
        period: difference of the last two [s]; 0 until there are two.
    """

    def __init__(self) -> None:
        """Nothing came yet."""
        self.last: float | None = None
        self.period = 0.0
        self._at = 0.0
        self._apart: float | None = None

    def judge(self, stamp: float, now: float) -> Verdict:
        """Check a stamp [s] that arrived at host time `now` [s]."""
        last, passed = self.last, now - self._at
        if last is None:
            return self._take(stamp, now, Verdict())
        if stamp == last:
            self._apart = None
            return Verdict("repeated stamp", usable=False)
        ahead = stamp - last > GAP_S and passed < _PASSED * (stamp - last)
        if stamp < last or ahead:
            goes_on = self._apart is not None and 0.0 < stamp - self._apart < GAP_S
            if goes_on:
                word = "time jumped ahead" if ahead else "time jumped back"
                return self._take(stamp, now, Verdict(word, breaks=True))
            self._apart = stamp
            return Verdict("late" if not ahead else "", usable=False)
        return self._take(stamp, now, Verdict(breaks=stamp - last > GAP_S))

    def _take(self, stamp: float, now: float, verdict: Verdict) -> Verdict:
        self.period = 0.0 if self.last is None or verdict.breaks else stamp - self.last
        self.last, self._at, self._apart = stamp, now, None
        return verdict


class HostTime:
    """Converts stamps to host time; stamps by the host clock are used unchanged.

    Stamps by another clock are aligned with the fastest arrival, so latencies are relative to the smallest one.

    Attributes:
        by_host: whether stamps are by the host clock.
    """

    NEAR_S = 10.0

    def __init__(self) -> None:
        """Nothing came yet."""
        self.by_host = True
        self._offset: float | None = None

    def of(self, stamp: float, now: float) -> float:
        """Host time of a measurement that has just arrived."""
        if abs(now - stamp) < self.NEAR_S:
            self.by_host, self._offset = True, None
            return min(stamp, now)
        self.by_host = False
        offset = now - stamp
        # After the clock was set, the alignment starts again.
        if self._offset is None or abs(offset - self._offset) > self.NEAR_S:
            self._offset = offset
        self._offset = min(self._offset, offset)
        return stamp + self._offset

    def forget(self) -> None:
        """Reset, because the clock was set."""
        self._offset = None


_STALE_S = 0.5
"""A measurement that is older than its frame by more does not belong to it."""
_PENDING = 4


@dataclass(frozen=True, eq=False)
class LiveFrame(RecordedFrame):
    """A recorded frame that has just arrived.

    Args:
        number: index from 0, counting usable frames.
        taken: time of measurement by the host clock [s].
        arrived: time of arrival by the host clock [s].
        breaks: it does not continue the previous frame: time jumped, a camera changed, or more than 1 s is missing.
    """

    number: int
    taken: float
    arrived: float
    breaks: bool


class Assembler:
    """Makes frames from arrivals; it uses no threads and no clock: the caller passes the time.

    Args:
        faults: counts unusable measurements.
        eager: decode images at once, not at first access.

    Attributes:
        refused: number of frame-defining arrivals that could not be used.
        frames: number of arrivals that became frames.
        kinds: sensor -> kind, for all arrivals.
    """

    def __init__(self, faults: Faults, *, eager: bool = True) -> None:
        """Start without arrivals."""
        self.refused = self.frames = 0
        self.kinds: dict[str, str] = {}
        self.host = HostTime()
        self._faults, self._eager = faults, eager
        self._stamps: dict[str, Stamps] = {}
        self._others: dict[str, deque[Arrival]] = {}
        self._driver: tuple[Arrival, float] | None = None
        self._breaks = False
        self._cameras: dict[str, Camera] = {}
        self._images: dict[str, npt.NDArray[np.generic]] = {}

    def feed(self, arrival: Arrival, now: float) -> None:
        """Add an arrival at host time `now` [s]; call `flush` before the next frame-defining arrival."""
        self.kinds.setdefault(arrival.sensor, arrival.kind)
        verdict = self._stamps.setdefault(arrival.sensor, Stamps()).judge(arrival.stamp, now)
        if verdict.fault:
            self._faults.add(verdict.fault, f"{arrival.sensor}, stamp {arrival.stamp:.6f}", now)
        if not verdict.usable:
            self.refused += arrival.drives
            return
        if not arrival.drives:
            pending = self._others.setdefault(arrival.sensor, deque(maxlen=_PENDING))
            if verdict.breaks:
                pending.clear()
            pending.append(arrival)
            return
        if verdict.breaks:
            self._breaks = True
            if verdict.fault:
                self.host.forget()
        self._driver = (arrival, now)

    def poll(self, now: float) -> LiveFrame | None:
        """The next frame, if one is ready."""
        return self.flush(now) if self.due(now) <= 0.0 else None

    def flush(self, now: float) -> LiveFrame | None:
        """A frame from the current arrivals, complete or not."""
        if self._driver is None:
            return None
        (driver, arrived), self._driver = self._driver, None
        taken = driver.taken if driver.taken is not None else self.host.of(driver.stamp, arrived)
        try:
            measured = self._checked(driver.measure(), now)
        except VoodooError as error:
            self.refused += 1
            self._faults.add_error(error, now, "unreadable message")
            return None
        items = (*self._joining(driver.stamp, now), measured)
        breaks, self._breaks = self._breaks, False
        self.frames += 1
        return LiveFrame(driver.stamp, items, self.frames - 1, taken, arrived, breaks)

    def due(self, now: float) -> float:
        """Seconds until a frame may be made from the arrivals; 0 when it is complete, infinity without arrivals."""
        if self._driver is None:
            return float("inf")
        driver, arrived = self._driver
        waited = now - arrived
        for_transforms = 0.0 if driver.ready() else driver.patience - waited
        for_pictures = 0.0 if self._is_complete(driver.stamp) else WAIT_S - waited
        return max(for_transforms, for_pictures, 0.0)

    def _is_complete(self, stamp: float) -> bool:
        """Whether every other live camera has sent its measurement for a time."""
        for sensor, kind in self.kinds.items():
            judged = self._stamps[sensor]
            if kind not in ("color", "keypoints", "depth") or judged.last is None or sensor not in self._others:
                continue
            # The camera's next image was due by then and has not arrived.
            missing = WAIT_S < stamp - judged.last < _STALE_S
            if missing and judged.last + 0.9 * judged.period <= stamp + WAIT_S:
                return False
        return True

    def _joining(self, stamp: float, now: float) -> list[Measurement]:
        """Decoded measurements of other sensors up to a time; later ones wait for the next frame."""
        found: list[Measurement] = []
        for pending in self._others.values():
            due = []
            while pending and pending[0].stamp <= stamp + WAIT_S:
                arrival = pending.popleft()
                if stamp - arrival.stamp <= _STALE_S:
                    due.append(arrival)
            # All scans of a faster laser are used; of a faster camera the last image suffices.
            for arrival in due if due and due[-1].kind in ("scan", "points") else due[-1:]:
                try:
                    item = self._checked(arrival.measure(), now)
                    if self._eager and isinstance(item, ColorImage):
                        _ = item.image
                    found.append(item)
                except VoodooError as error:
                    self._faults.add_error(error, now, "damaged picture")
        return sorted(found, key=lambda item: item.stamp)

    def _checked(self, item: Measurement, now: float) -> Measurement:
        """The measurement, after checking that image and camera are consistent.

        Raises:
            RecordingError: they are not.
        """
        camera = getattr(item, "camera", None)
        if isinstance(camera, Camera):
            before = self._cameras.setdefault(item.sensor, camera)
            if before != camera:
                self._faults.add("calibration changed", f"{item.sensor}: {camera} after {before}", now)
                self._cameras[item.sensor] = camera
                self._breaks = True
        if isinstance(item, DepthImage):
            refuse_blank(item, item.sensor)
            self._refuse_unit(item)
            before_image = self._images.get(item.sensor)
            self._images[item.sensor] = item.image
            if before_image is not None and unchanged(before_image, item.image):
                where = f"{item.sensor}, stamp {item.stamp:.6f}"
                raise RecordingError(f"{where}: the same as the image before", reason="frozen picture")
        return item

    def _refuse_unit(self, item: DepthImage) -> None:
        found = implausible_depth(item.image, item.meters_per_unit)
        if found is not None:
            where, expected = f"{item.sensor}, stamp {item.stamp:.6f}", "expected depths between 1 cm and 100 m"
            raise RecordingError(f"{where}: {expected}, found a median of {found:.3g} m", reason="wrong unit")
