"""Adds a synthetic person who walks by in front of the person of a recording, in real or rendered images."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from synthetic.gait import path, pose_at
from synthetic.people import WIDER, Noise, Walker, labels_of, paint, wider
from voodoo.errors import RecordingError
from voodoo.measurements import ColorImage, DepthImage, Measurement, RecordedFrame
from voodoo.model.body import Body
from voodoo.model.camera import Camera
from voodoo.recordings.people_truth import PeopleTruth
from voodoo.recordings.recording import Recording, RecordingInfo, Reference
from voodoo.synthetic.render import RenderedDepth, render_depth

FloatArray: TypeAlias = npt.NDArray[np.float64]

_ROOT = "humanoid_root"


class WithPasserBy(Recording):
    """A recording of one person with exact truth, and a second person who walks by in front; `people` is the truth of both.

    The passer-by, person 2, occludes depth and color. The visible fraction of person 1 is the fraction of joints that are not
    occluded. Lasers and clouds are left out, because they do not observe the passer-by.

    Args:
        recording: with an exact reference, in a root frame whose plane z = 0 is the floor.
        at: time from the first frame at which the passer-by is directly in front [s]; None: the middle of the recording.
        nearer: distance by which the passer-by is nearer to the first depth camera [m].
        speed: walking speed [m/s].
        body: of the passer-by.
        seed: of the noise.

    Raises:
        RecordingError: without exact truth or depth images.
    """

    def __init__(
        self,
        recording: Recording,
        *,
        at: float | None = None,
        nearer: float = 0.8,
        speed: float = 0.6,
        body: Body | None = None,
        seed: int = 0,
    ) -> None:
        """Plan the walk."""
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference = recording.start, recording.reference
        if self.reference is None or not self.reference.exact:
            raise RecordingError(f"{recording.path}: expected exact truth of one person, found none")
        self._recording, self._seed, self._noise = recording, seed, Noise()
        first = next((item for frame in recording for item in frame.measurements if isinstance(item, DepthImage)), None)
        if first is None:
            raise RecordingError(f"{recording.path}: expected depth images, found none")
        about = recording.info()
        middle = about.start_stamp + (about.duration / 2.0 if at is None else at)
        self._walker = _walk(self.reference, first, middle, (nearer, speed), body or Body.human(1.80))
        self.people = self._truth(first)

    @property
    def passes(self) -> tuple[float, float]:
        """Times at which the passer-by enters and leaves the scene [s]."""
        return self._walker.stops[0].time, self._walker.stops[-1].time

    def _truth(self, camera: DepthImage) -> PeopleTruth:
        """The truth of both persons at the stamps of the reference."""
        reference = self.reference
        assert reference is not None
        stamps, names = reference.stamps, reference.names
        positions = np.full((len(stamps), 2, len(names), 3), np.nan)
        in_view = np.zeros((len(stamps), 2))
        positions[:, 0] = reference.positions
        in_view[:, 0] = 1.0
        for index, stamp in enumerate(stamps.tolist()):
            if not self._walker.there(stamp):
                continue
            _, sites = pose_at(self._walker.body, self._walker.stops, stamp)
            positions[index, 1] = [sites.get(name, np.full(3, np.nan)) for name in names]
            observed = self._rendered(stamp, camera.camera, camera.root_from_sensor)
            whole = WIDER**2 * np.count_nonzero(
                self._rendered(stamp, wider(camera.camera), camera.root_from_sensor).depth
            )
            in_view[index, 1] = min(float(np.count_nonzero(observed.depth)) / max(whole, 1), 1.0)
            in_view[index, 0] = _uncovered(reference.positions[index], camera, observed.depth)
        return PeopleTruth(stamps, np.array([1, 2]), in_view, names, positions)

    def _rendered(self, stamp: float, camera: Camera, root_from_sensor: FloatArray) -> RenderedDepth:
        poses, _ = pose_at(self._walker.body, self._walker.stops, stamp)
        return render_depth(self._walker.body, poses, camera=camera, world_from_sensor=root_from_sensor)

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._recording)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames with the passer-by in the images."""
        chance = np.random.default_rng(self._seed)
        for recorded in self._recording:
            kept = [item for item in recorded.measurements if isinstance(item, (DepthImage, ColorImage))]
            yield RecordedFrame(recorded.stamp, tuple(self._covered(item, chance) for item in kept))

    def _covered(self, item: DepthImage | ColorImage, chance: np.random.Generator) -> Measurement:
        if not self._walker.there(item.stamp):
            return item
        if isinstance(item, ColorImage):
            return ColorImage(item.sensor, item.stamp, partial(self._painted, item), item.camera, item.root_from_sensor)
        observed = self._rendered(item.stamp, item.camera, item.root_from_sensor).depth
        own = self._noise.image(np.where(observed > 0.0, observed, np.inf), chance)
        units = np.rint(own * 0.001 / item.meters_per_unit).astype(item.image.dtype)
        # Nearer objects occlude the passer-by.
        nearer = (own > 0) & ((item.image == 0) | (units < item.image))
        return replace(item, image=np.where(nearer, units, item.image))

    def _painted(self, item: ColorImage) -> npt.NDArray[np.uint8]:
        observed = self._rendered(item.stamp, item.camera, item.root_from_sensor)
        label = np.where(observed.limb >= 0, labels_of(observed.limb_names, 0)[observed.limb], 0).astype(np.uint8)
        picture = np.array(item.image)
        own = paint(label, [self._walker], (self._seed, round(item.stamp * 1e3) % 2**31))
        picture[label > 0] = own[label > 0]
        return picture

    def info(self) -> RecordingInfo:
        """The summary of the recording."""
        about = self._recording.info()
        sensors = tuple(sensor for sensor in about.sensors if sensor.kind in ("depth", "color"))
        return replace(about, sensors=sensors, notes=(*about.notes, "with a made-up passer-by"))


def _walk(reference: Reference, camera: DepthImage, middle: float, how: tuple[float, float], body: Body) -> Walker:
    """A walk across the view, directly in front of the person at a time; `how` is the distance [m] and speed [m/s]."""
    nearer, speed = how
    index = int(np.abs(reference.stamps - middle).argmin())
    place = reference.positions[index, reference.names.index(_ROOT), :2]
    towards = camera.root_from_sensor[:2, 3] - place
    towards = towards / np.linalg.norm(towards)
    x, y = place + nearer * towards
    across = np.array([-towards[1], towards[0]])
    depth = float(np.linalg.norm(camera.root_from_sensor[:2, 3] - (x, y)))
    half = depth * camera.camera.width / (2.0 * camera.camera.fx) + 0.7
    time = half / speed
    ends = [(middle + sign * time, x + sign * half * across[0], y + sign * half * across[1]) for sign in (-1.0, 1.0)]
    return Walker(body=body, stops=path([(float(t), float(a), float(b)) for t, a, b in ends]))


def _uncovered(joints: FloatArray, item: DepthImage, nearer: npt.NDArray[np.float32]) -> float:
    """Fraction of the joints (J, 3) [m] that the passer-by's depths (H, W) [m] do not occlude."""
    known = joints[np.isfinite(joints).all(axis=1)]
    sensor_from_root = np.linalg.inv(item.root_from_sensor)
    places = known @ sensor_from_root[:3, :3].T + sensor_from_root[:3, 3]
    camera = item.camera
    # NaN, for positions outside the view, is in no pixel.
    columns, rows = np.rint(camera.project(places)).T
    inside = (columns >= 0) & (columns < camera.width) & (rows >= 0) & (rows < camera.height)
    there = nearer[rows[inside].astype(int), columns[inside].astype(int)]
    covered = (there > 0.0) & (there < places[inside, 2])
    return float(np.count_nonzero(~covered) / max(len(known), 1)) if len(known) else math.nan
