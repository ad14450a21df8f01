"""Joins further inputs to a recording: keypoints of its own cameras, and other recordings of the same scene."""

from __future__ import annotations

from collections.abc import Container, Iterator, Mapping, Sequence
from contextlib import nullcontext, suppress
from dataclasses import replace
from functools import partial
from itertools import islice
from pathlib import Path

from voodoo.errors import RecordingError
from voodoo.measurements import (
    ROUNDED_S,
    ByteImage,
    ColorImage,
    DepthImage,
    FloatArray,
    KeypointImage,
    Measurement,
    RecordedFrame,
)
from voodoo.recordings.keypoint_check import check_keypoints, check_on_depth, some_of, taken_layout
from voodoo.recordings.keypoint_files import read_people, refuse_unread
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.order import by_image
from voodoo.recordings.recording import Recording, RecordingInfo

_CHECKED = 30
"""Number of frames at the start whose keypoints are compared with calibration and depth."""


class Around(Recording):
    """A recording with something added to its frames."""

    def __init__(self, recording: Recording) -> None:
        """As the recording is."""
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference, self.assumed = recording.start, recording.reference, recording.assumed
        self.people, self.complete, self.numbers = recording.people, recording.complete, recording.numbers
        self._recording = recording

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._recording)

    def root_from(self, frame: str, stamp: float) -> FloatArray:
        """See Recording."""
        return self._recording.root_from(frame, stamp)

    def empty_scene(self) -> Mapping[str, Sequence[ByteImage]]:
        """See Recording."""
        return self._recording.empty_scene()

    def _info(self, cameras: Container[str], detail: str, notes: tuple[str, ...] = ()) -> RecordingInfo:
        """The summary of the recording, with keypoints of some cameras."""
        about = self._recording.info()
        sensors = tuple(
            replace(sensor, name=f"{sensor.name}/keypoints", kind="keypoints", detail=detail)
            for sensor in about.sensors
            if sensor.name in cameras
        )
        return replace(about, sensors=about.sensors + sensors, notes=(*about.notes, *notes))


class Joined(Around):
    """A recording whose frames also hold the measurements of other recordings since the previous frame.

    All must be of the same scene, in the same root frame and by the same clock. Start, reference and the times of the
    frames are those of the first one. A sensor whose name is taken by one before it gets that of its recording in front.

    Args:
        first: provides the frames.
        others: recordings that are added; their own start and reference are not used.
        offset: [s] added to the stamps of the others.

    Raises:
        RecordingError: one of the others has no measurements during the first, which indicates another clock.
    """

    def __init__(self, first: Recording, others: Sequence[Recording], *, offset: float = 0.0) -> None:
        """Check that they overlap in time."""
        super().__init__(first)
        self.people, self.complete = None, False
        self.assumed = tuple(words for one in (first, *others) for words in one.assumed)
        self._others, self._offset = tuple(others), offset
        about = first.info()
        low, high = about.start_stamp, about.start_stamp + about.duration
        taken = {sensor.name for sensor in about.sensors}
        self._names: list[dict[str, str]] = []
        for number, other in enumerate(others, start=2):
            this = other.info()
            own = {name: name for name in (sensor.name for sensor in this.sensors)}
            for name in own.keys() & taken:
                renamed = f"{other.name}/{name.lstrip('/')}"
                own[name] = f"{number}/{renamed}" if renamed in taken | own.keys() else renamed
            taken.update(own.values())
            self._names.append(own)
            begin = this.start_stamp + offset
            if begin > high or begin + this.duration < low:
                raise RecordingError(
                    f"{other.path}: expected stamps between {low:.3f} and {high:.3f} s as in {first.path}, found "
                    f"{begin:.3f} to {begin + this.duration:.3f} s; is an offset of the clock missing (--offset)?"
                )

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames of the first recording with the measurements of all."""
        streams = [_Ahead(other, self._offset, own) for other, own in zip(self._others, self._names, strict=True)]
        for recorded in self._recording:
            added = tuple(item for stream in streams for item in stream.until(recorded.stamp))
            # The measurement that defines the frame stays last.
            yield RecordedFrame(recorded.stamp, (*recorded.measurements[:-1], *added, *recorded.measurements[-1:]))

    def empty_scene(self) -> Mapping[str, Sequence[ByteImage]]:
        """Images of the empty scene of all recordings."""
        others = zip(self._others, self._names, strict=True)
        found = {own.get(name, name): seen for other, own in others for name, seen in other.empty_scene().items()}
        return found | dict(self._recording.empty_scene())

    def info(self) -> RecordingInfo:
        """The summary of the first, with the sensors of all."""
        about = self._recording.info()
        others = zip(self._others, self._names, strict=True)
        sensors = tuple(
            replace(sensor, name=own[sensor.name]) for other, own in others for sensor in other.info().sensors
        )
        joined = ", ".join(str(other.path) for other in self._others)
        return replace(about, sensors=about.sensors + sensors, notes=(*about.notes, f"joined with {joined}"))


class _Ahead:
    """Reads the measurements of a recording in step with time."""

    def __init__(self, recording: Recording, offset: float, names: Mapping[str, str]) -> None:
        self._frames, self._offset, self._names = iter(recording), offset, names
        self._next = next(self._frames, None)

    def until(self, stamp: float) -> tuple[Measurement, ...]:
        """Measurements since the last call, up to `stamp`: the last of each sensor."""
        found: tuple[Measurement, ...] = ()
        while self._next is not None and self._next.stamp + self._offset <= stamp + ROUNDED_S:
            moved = tuple(
                replace(item, stamp=item.stamp + self._offset, sensor=self._names.get(item.sensor, item.sensor))
                for item in self._next.measurements
            )
            latest = {item.sensor for item in moved}
            found = tuple(item for item in found if item.sensor not in latest) + moved
            self._next = next(self._frames, None)
        return found


class WithKeypoints(Around):
    """A recording whose images have the keypoints that a network detected in them.

    Args:
        recording: with color or depth images.
        folders: sensor -> folder of OpenPose JSON files, one for each of its images, in the order of their numbers; if some are
            missing, the numbers are those of the images, from 0 or 1.
        layout: of the keypoints, see voodoo.sensors.keypoints.LAYOUTS; None: told by their number and the shape of the persons.
        left_out: of the recording, see open_recording.

    Raises:
        RecordingError: an unknown sensor, another number of files than images, no file that can be read, or keypoints and
            calibration do not fit.
        MeasurementError: an unknown layout.
    """

    def __init__(
        self,
        recording: Recording,
        folders: Mapping[str, Path],
        *,
        layout: str | None = None,
        left_out: LeftOut | None = None,
    ) -> None:
        """List the files."""
        layout_of(layout or "body25b")
        super().__init__(recording)
        self._left_out = left_out
        self._files: dict[str, list[Path | None]] = {}
        sensors = {item.name: item for item in recording.info().sensors if item.kind in ("color", "depth")}
        for name, folder in folders.items():
            if name not in sensors:
                raise RecordingError(f"keypoints: expected one of {', '.join(sensors) or 'no cameras'}, found {name!r}")
            files = list(folder.glob("*.json"))
            images = by_image(files, sensors[name].messages)
            if images is None:
                raise RecordingError(
                    f"{folder}: expected {sensors[name].messages} .json files, one for each image of {name} or named by it, "
                    f"found {len(files)}"
                )
            self._files[name] = images
        people = {folder: self._some_people(self._files[name], folder, layout) for name, folder in folders.items()}
        empty = (f"{folder}: nobody is in these keypoint files" for folder, found in people.items() if not found)
        self._layout, notes = taken_layout([rows for found in people.values() for rows in found], layout)
        self._notes = (*empty, *notes, *self._checked())
        self.assumed = (*self.assumed, *self._notes)

    def _some_people(self, files: Sequence[Path | None], folder: Path, layout: str | None) -> list[FloatArray]:
        """Some of the people in the files of a folder; damaged files are counted when they are read again."""
        unread = None if self._left_out is None else LeftOut()
        found = some_of(files, partial(read_people, layout=layout, left_out=unread), good=bool)
        people = [rows for each in found for rows in each]
        refuse_unread(folder, people, unread)
        return people

    def _checked(self) -> tuple[str, ...]:
        """Check the keypoints of the first frames against calibration and depth."""
        instants: list[list[KeypointImage]] = []
        pairs: list[tuple[KeypointImage, DepthImage]] = []
        # Reading the frames again reports what is damaged.
        with nullcontext() if self._left_out is None else self._left_out.aside(), suppress(RecordingError):
            for recorded in islice(self, _CHECKED):
                images = [item for item in recorded.measurements if isinstance(item, KeypointImage)]
                depths = [item for item in recorded.measurements if isinstance(item, DepthImage)]
                pairs += [(image, depths[-1]) for image in images if depths]
                if len(images) == len(self._files) and any(image.people for image in images):
                    instants.append(sorted(images, key=lambda image: image.sensor))
        check_on_depth("keypoints", pairs)
        return check_keypoints("keypoints", instants)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames, with a KeypointImage before each image that has one."""
        count = dict.fromkeys(self._files, 0)
        for recorded in self._recording:
            items: list[Measurement] = []
            for item in recorded.measurements:
                if isinstance(item, (ColorImage, DepthImage)) and count.get(item.sensor, -1) >= 0:
                    # The numbers of images count those that are in no frame.
                    number = self.numbers.get((item.sensor, item.stamp), count[item.sensor])
                    count[item.sensor] = number + 1
                    people = read_people(self._files[item.sensor][number], layout=self._layout, left_out=self._left_out)
                    items.append(KeypointImage.of(item, people, self._layout))
                items.append(item)
            yield RecordedFrame(recorded.stamp, tuple(items))

    def info(self) -> RecordingInfo:
        """The summary of the recording, with the keypoints."""
        return self._info(self._files, f"{self._layout} keypoints", self._notes)
