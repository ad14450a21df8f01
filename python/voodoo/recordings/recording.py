"""Base class of the recordings that loaders return: iterable frames and metadata."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType
from typing import TypedDict, TypeVar

import numpy as np

from voodoo.errors import RecordingError
from voodoo.measurements import ByteImage, DepthImage, FloatArray, Measurement, RecordedFrame, nearest_stamps
from voodoo.model.joint import short
from voodoo.model.standing import is_optical
from voodoo.recordings.empty_scene import EmptyScene
from voodoo.recordings.left_out import LeftOut, leaving_out
from voodoo.recordings.people_truth import PeopleTruth

M = TypeVar("M", bound=Measurement)


class Start(TypedDict, total=False):
    """Pose of the body in the first frame: `joints` [m] in the root frame and, if known, its stature `height_m`."""

    joints: dict[str, tuple[float, float, float]]
    height_m: float


@dataclass(frozen=True, eq=False, repr=False)
class Reference:
    """Joint positions to compare an estimate with.

    Args:
        stamps: (F,) [s].
        names: J site names.
        positions: (F, J, 3) [m] in the recording's root frame; NaN = missing.
        exact: True for rendered truth, False for an estimate of another tracker.
    """

    stamps: FloatArray
    names: tuple[str, ...]
    positions: FloatArray
    exact: bool

    def as_start(self, *, without: tuple[str, ...] = ()) -> Start | None:
        """The first row as a start, without the joints whose names end in one of these words; None if it has no others."""
        joints = {}
        for name, position in zip(self.names, self.positions[0], strict=True):
            if not name.endswith(without) and np.isfinite(position).all():
                x, y, z = (float(value) for value in position)
                joints[name] = (x, y, z)
        return Start(joints=joints) if joints else None

    def at(self, stamp: float, names: Sequence[str], *, within: float) -> dict[str, FloatArray]:
        """The known positions (3,) of some joints nearest to a time, if they are within so many seconds; else none."""
        index = int(nearest_stamps(self.stamps, [stamp], within=within)[0])
        if index < 0:
            return {}
        row = {name: self.positions[index, self.names.index(name)] for name in names if name in self.names}
        return {name: position for name, position in row.items() if np.isfinite(position).all()}

    def __repr__(self) -> str:
        """One line with the counts."""
        kind = "exact" if self.exact else "estimated"
        return f"Reference({len(self.stamps)} stamps, {len(self.names)} joints, {kind})"


@dataclass(frozen=True)
class SensorInfo:
    """A source of measurements: topic or folder, kind ("depth", "points", "scan", "color", "keypoints", "markers"), frame
    id, number of messages, mean rate [Hz] (NaN with less than two messages) and a description of the format."""

    name: str
    kind: str
    frame: str
    messages: int
    rate_hz: float
    detail: str

    @classmethod
    def of(cls, name: str, kind: str, frame: str, stamps: Sequence[float] | FloatArray, detail: str) -> SensorInfo:
        """A source with messages at these stamps [s]."""
        span = stamps[-1] - stamps[0] if len(stamps) else 0.0
        return cls(name, kind, frame, len(stamps), mean_rate(len(stamps), span), detail)


@dataclass(frozen=True)
class RecordingInfo:
    """Summary of a recording; str() gives readable text.

    Args:
        name: short name.
        path: what was opened.
        loader: which loader reads it.
        frames: number of RecordedFrames.
        start_stamp: stamp of the first frame [s].
        duration: from the first to the last frame [s].
        rate_hz: mean frame rate, NaN with less than two frames.
        root_frame: frame of all `root_from_sensor` and of the reference.
        sensors: sources that are yielded; the first one defines the frames.
        unused: (topic, reason) of topics that were recognized but are not yielded.
        reference: description of the reference, or "none".
        notes: remarks on this kind of recording.
    """

    name: str
    path: Path
    loader: str
    frames: int
    start_stamp: float
    duration: float
    rate_hz: float
    root_frame: str
    sensors: tuple[SensorInfo, ...]
    unused: tuple[tuple[str, str], ...] = ()
    reference: str = "none"
    notes: tuple[str, ...] = ()

    @property
    def camera_root(self) -> bool:
        """Whether the root frame is a camera's optical frame, so that its axes are not level: y points down."""
        images = (sensor.frame for sensor in self.sensors if sensor.kind in ("depth", "color"))
        return is_optical(self.root_frame) or self.root_frame in images

    def __str__(self) -> str:
        """Several lines of text."""
        rate = "" if np.isnan(self.rate_hz) else f" at {self.rate_hz:.2f} Hz"
        lines = [
            f"{self.name}  ({self.loader}, {self.path})",
            f"  frames     {self.frames} in {self.duration:.3f} s{rate}, from {self.start_stamp:.6f} s",
            f"  root frame {self.root_frame}{' (a camera, not level: y down, z forward)' if self.camera_root else ''}",
        ]
        width = max((len(sensor.name) for sensor in self.sensors), default=0)
        for sensor in self.sensors:
            rate = "" if np.isnan(sensor.rate_hz) else f", {sensor.rate_hz:.2f} Hz"
            count = f"{sensor.messages} x {sensor.detail}{rate}, frame {sensor.frame}"
            lines.append(f"  {sensor.kind:<10} {sensor.name:<{width}}  {count}")
        lines += [f"  unused     {topic}: {reason}" for topic, reason in self.unused]
        lines.append(f"  reference  {self.reference}")
        lines += [f"  note       {note}" for note in self.notes]
        return "\n".join(lines)


class Recording(ABC):
    """Base class of all recordings: sized, iterable any number of times, read while iterating.

    Attributes:
        path: path that was opened.
        name: short name for reports.
        root_frame: frame all poses and the reference are in.
        start: pose of the body in the first frame, or None.
        reference: joint positions to compare with, or None.
        assumed: descriptions of assumptions that the recording does not confirm, and of unused data.
        loader: which loader reads it.
        people: exact positions of all persons, if the recording has such a truth, or None.
        complete: whether each frame holds all measurements of its time, so that none of the next frame belongs to it.
        numbers: (sensor, stamp) -> index of that image among those of the sensor, for data that is paired by index, where some
            images may be in no frame; those that were read so far.
    """

    assumed: tuple[str, ...] = ()
    path: Path
    name: str
    root_frame: str
    start: Start | None = None
    reference: Reference | None = None
    people: PeopleTruth | None = None
    complete: bool = False
    numbers: Mapping[tuple[str, float], int] = MappingProxyType({})
    loader: str
    _stamps: Sequence[float] | FloatArray
    _unused: Sequence[tuple[str, str]] = ()
    _notes: tuple[str, ...] = ()
    _scene: EmptyScene | None = None
    _left_out: LeftOut | None = None

    def empty_scene(self) -> Mapping[str, Sequence[ByteImage]]:
        """Sensor -> images (H, W, 3) BGR uint8 of the empty scene; {}: there are none.

        Raises:
            RecordingError: a picture that cannot be read.
        """
        return {} if self._scene is None else self._scene.read(left_out=self._left_out)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._stamps)

    @abstractmethod
    def __iter__(self) -> Iterator[RecordedFrame]:
        """Read the frames in the order of their stamps.

        Raises:
            RecordingError: damage; the frames before it have been yielded.
        """

    def info(self) -> RecordingInfo:
        """Summarize without decoding the images."""
        start, end = self._span()
        return RecordingInfo(
            name=self.name,
            path=self.path,
            loader=self.loader,
            frames=len(self),
            start_stamp=start,
            duration=end - start,
            rate_hz=mean_rate(len(self), end - start),
            root_frame=self.root_frame,
            sensors=tuple(self._sensors()),
            unused=tuple(self._unused),
            reference=reference_words(self.reference, self.people),
            notes=(*self.assumed, *self._notes, *(() if self._scene is None else self._scene.words)),
        )

    def _span(self) -> tuple[float, float]:
        """Stamps of the first and the last frame [s]."""
        return float(self._stamps[0]), float(self._stamps[-1])

    def _sensors(self) -> Iterable[SensorInfo]:
        """The sources that are yielded; the first one defines the frames."""
        return ()

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """root_from_frame (4, 4) of a frame of the recording at a time [s].

        Raises:
            RecordingError: the frame is unknown.
        """
        if frame != self.root_frame:
            raise RecordingError(f"{self.path}: expected the frame {self.root_frame!r}, found {short(frame)}")
        return np.eye(4)

    def __repr__(self) -> str:
        """Class, name and length."""
        return f"{type(self).__name__}({self.name!r}, {len(self)} frames, root frame {self.root_frame!r})"


def reference_words(reference: Reference | None, people: PeopleTruth | None = None) -> str:
    """Describe the reference for RecordingInfo."""
    if reference is None and people is not None:
        return f"{len(people.persons)} persons, {len(people.names)} joints, {len(people.stamps)} stamps, exact"
    if reference is None:
        return "none"
    kind = "exact" if reference.exact else "estimated by another tracker"
    return f"{len(reference.names)} joints, {len(reference.stamps)} stamps, {kind}"


def refuse_blank(item: DepthImage, where: object) -> None:
    """Raise an error for a depth image without valid depths.

    Raises:
        RecordingError: it is blank.
    """
    image = item.image
    observed = image.any() if image.dtype.kind == "u" else (np.isfinite(image) & (image > 0.0)).any()
    if not observed:
        raise RecordingError(
            f"{where}, stamp {item.stamp:.6f}: expected depths, found a blank image", reason="that are blank"
        )


def usable(
    make: Callable[[], M],
    number: int,
    where: object,
    left_out: LeftOut | None,
    numbers: dict[tuple[str, float], int],
) -> M | None:
    """A measurement, whose number becomes known; of a damaged recording, in which also blank depth images are left out, None for
    one that is.

    Raises:
        RecordingError: without `left_out`, that of `make`.
    """
    with leaving_out(left_out):
        item = make()
        if left_out is not None and isinstance(item, DepthImage):
            refuse_blank(item, where)
        numbers[item.sensor, item.stamp] = number
        return item
    return None


_NUMBERS = {
    "rate": ("images per second > 0", False, 1e4), "meters_per_unit": ("a length > 0", False, 1e3),
    "tf_max_age": ("seconds >= 0", True, math.inf), "unpacked_gb": ("gigabytes > 0", False, 1e6),
    "seconds_per_unit": ("seconds > 0", False, 1e3),
}  # fmt: skip
"""Options of loaders that are numbers: what is expected, whether it may be zero, and the greatest one."""


def number_option(path: object, name: str, value: object) -> float:
    """Check one of `_NUMBERS` given to a loader.

    Raises:
        RecordingError: it is out of range; names the option and what was expected.
    """
    expected, zero, most = _NUMBERS[name]
    try:
        number = float(value) if not isinstance(value, str) else math.nan  # type: ignore[arg-type]
    except (TypeError, ValueError, OverflowError):
        number = math.nan
    if not (0.0 < number <= most or (number == 0.0 and zero)):
        raise RecordingError(f"{path}: {name}: expected {expected}, found {short(value)}")
    return number


def mean_rate(count: int, duration: float) -> float:
    """Mean rate [Hz] of `count` stamps over `duration` seconds from first to last; NaN when undefined."""
    return (count - 1) / duration if count > 1 and duration > 0.0 else float("nan")
