"""Synthetic recordings in memory of several persons in a furnished room, with exact truth."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from synthetic.boxes import Box, room_depth
from synthetic.gait import Stop, pose_at
from voodoo.measurements import ColorImage, DepthImage, RecordedFrame
from voodoo.model.body import Body
from voodoo.model.camera import Camera
from voodoo.recordings.people_truth import PeopleTruth
from voodoo.recordings.recording import Recording, SensorInfo
from voodoo.synthetic.render import render_depth

FloatArray: TypeAlias = npt.NDArray[np.float64]
Color: TypeAlias = tuple[int, int, int]
"""Blue, green, red, 0 to 255."""

CAMERA = Camera(320, 240, 277.0, 277.0, 159.5, 119.5)
"""60 degrees wide."""
METERS_PER_UNIT = 0.001
DEPTH, COLOR = "/camera/depth", "/camera/color"
"""Names of the sensors."""
TRUTH_SITES = (
    "humanoid_root", "vc7", "head_center",
    *(f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")),
)  # fmt: skip
_EDGE = (0.06, 0.04)
"""Depth steps, in meters and as a fraction of the depth, above which a pixel may return a mixture."""
WIDER = 2
"""Factor of the field of view in which all pixels of a person are counted, at a resolution reduced by the same factor."""
_SKIN: Color = (120, 150, 200)
_ROOM: Color = (150, 155, 150)
_BARE = ("head", "neck", "l_hand", "r_hand")


@dataclass(frozen=True, kw_only=True)
class Walker:
    """A person of a synthetic recording.

    Args:
        body: the true body.
        stops: positions in the order of time; the person is in the scene from the first to the last of them.
        shirt, trousers: colors of the clothes.
    """

    body: Body
    stops: Sequence[Stop]
    shirt: Color = (60, 60, 170)
    trousers: Color = (110, 60, 50)

    def there(self, time: float) -> bool:
        """Whether the person is in the scene at a time [s]."""
        return self.stops[0].time <= time <= self.stops[-1].time


@dataclass(frozen=True, kw_only=True)
class Noise:
    """Noise model of a synthetic depth camera.

    Args:
        sigma_m, sigma_square: standard deviation `sigma_m + sigma_square z^2` [m] at z meters.
        flying: fraction of the pixels at an edge that return a depth between both surfaces.
        lost: fraction of pixels without a return.
        reach_m: largest depth with a return.
    """

    sigma_m: float = 0.003
    sigma_square: float = 0.0008
    flying: float = 0.4
    lost: float = 0.004
    reach_m: float = 6.0

    def image(self, depth: FloatArray, chance: np.random.Generator) -> npt.NDArray[np.uint16]:
        """Measured depths for exact depths (H, W) [m], in METERS_PER_UNIT."""
        observed = np.where(np.isfinite(depth), depth, 2.0 * self.reach_m)
        beside = np.roll(observed, 1, axis=1)
        edge = np.abs(observed - beside) > np.maximum(_EDGE[0], _EDGE[1] * observed)
        mixed = edge & (chance.random(observed.shape) < self.flying)
        fraction = chance.random(observed.shape)
        noise = (self.sigma_m + self.sigma_square * observed**2) * chance.standard_normal(observed.shape)
        observed = np.where(mixed, fraction * observed + (1.0 - fraction) * beside, observed + noise)
        gone = (observed > self.reach_m) | (observed < 0.3) | (chance.random(observed.shape) < self.lost)
        return np.where(gone, 0.0, np.rint(observed / METERS_PER_UNIT)).astype(np.uint16)


@dataclass(frozen=True, kw_only=True)
class Scene:
    """Scene, camera and duration of a synthetic recording.

    Args:
        name: of the recording.
        people: persons 1, 2, ... of the truth.
        seconds: duration.
        furniture: boxes that stand on the floor z = 0, walls among them.
        root_from_sensor: pose (4, 4) of the camera's optical frame at a time [s]; it changes if the robot moves.
        root_frame: its name.
        noise: of the camera.
        rate_hz: of the images.
        color: whether there is a color image with each depth image.
        seed: of the noise.
    """

    name: str
    people: Sequence[Walker]
    seconds: float
    furniture: Sequence[Box]
    root_from_sensor: Callable[[float], FloatArray]
    root_frame: str = "base_link"
    noise: Noise = Noise()
    rate_hz: float = 15.0
    color: bool = True
    seed: int = 0


class MadeUpRecording(Recording):
    """A recording in memory: depth and color images of a scene, and `people`, the truth.

    Args:
        scene: is rendered once.
    """

    loader = "synthetic"

    def __init__(self, scene: Scene) -> None:
        """Render all frames."""
        self.path, self.name, self.root_frame = Path(scene.name), scene.name, scene.root_frame
        self.scene = scene
        self._stamps = np.arange(round(scene.seconds * scene.rate_hz)) / scene.rate_hz
        self._poses = [np.asarray(scene.root_from_sensor(float(stamp)), dtype=np.float64) for stamp in self._stamps]
        chance = np.random.default_rng(scene.seed)
        self._depths: list[npt.NDArray[np.uint16]] = []
        self._labels: list[npt.NDArray[np.uint8]] = []
        rendered = [self._render(float(stamp), pose, chance) for stamp, pose in self._frames()]
        self.people = PeopleTruth(
            stamps=self._stamps,
            persons=np.arange(1, len(scene.people) + 1),
            in_view=np.array([one[0] for one in rendered]),
            names=TRUTH_SITES,
            positions=np.array([one[1] for one in rendered]),
        )

    def _frames(self) -> Iterator[tuple[float, FloatArray]]:
        yield from zip(self._stamps.tolist(), self._poses, strict=True)

    def _render(self, time: float, pose: FloatArray, chance: np.random.Generator) -> tuple[FloatArray, FloatArray]:
        """Store the images of a frame; returns visible fractions (P,) and sites (P, J, 3) of all persons."""
        scene, count = self.scene, len(self.scene.people)
        depth = room_depth(CAMERA, pose, scene.furniture)
        owner = np.full(depth.shape, -1)
        label = np.zeros(depth.shape, dtype=np.uint8)
        whole, sites = np.zeros(count), np.full((count, len(TRUTH_SITES), 3), np.nan)
        for number, person in enumerate(scene.people):
            if not person.there(time):
                continue
            poses, places = pose_at(person.body, person.stops, time)
            sites[number] = [places[name] for name in TRUTH_SITES]
            observed = render_depth(person.body, poses, camera=CAMERA, world_from_sensor=pose)
            nearest = (observed.depth > 0.0) & (observed.depth < depth)
            depth = np.where(nearest, observed.depth, depth)
            owner[nearest] = number
            label[nearest] = labels_of(person.body.limb_names, number)[observed.limb[nearest]]
            wide = render_depth(person.body, poses, camera=wider(CAMERA), world_from_sensor=pose)
            whole[number] = WIDER**2 * np.count_nonzero(wide.depth)
        owner[depth > scene.noise.reach_m] = -1
        visible = np.array([np.count_nonzero(owner == number) for number in range(count)])
        self._depths.append(scene.noise.image(depth, chance))
        self._labels.append(label)
        return np.clip(visible / np.maximum(whole, 1.0), 0.0, 1.0), sites

    def __len__(self) -> int:
        """Number of frames."""
        return len(self._stamps)

    def __iter__(self) -> Iterator[RecordedFrame]:
        """The frames: a color image, if the scene has color, and a depth image."""
        for index, (stamp, pose) in enumerate(self._frames()):
            depth = DepthImage(DEPTH, stamp, self._depths[index], METERS_PER_UNIT, CAMERA, pose)
            if not self.scene.color:
                yield RecordedFrame(stamp, (depth,))
                continue
            color = ColorImage(COLOR, stamp, partial(self.picture, index), CAMERA, pose)
            yield RecordedFrame(stamp, (color, depth))

    def picture(self, index: int) -> npt.NDArray[np.uint8]:
        """Colors (H, W, 3) BGR of a frame: clothes, skin and gray furniture, with noise."""
        return paint(self._labels[index], self.scene.people, (self.scene.seed, index))

    def _sensors(self) -> Iterator[SensorInfo]:
        size, rate = f"{CAMERA.width}x{CAMERA.height}", self.scene.rate_hz
        kinds = [(DEPTH, "depth", "16UC1"), *([(COLOR, "color", "bgr8")] if self.scene.color else [])]
        for name, kind, words in kinds:
            yield SensorInfo(name, kind, "camera_optical_frame", len(self), rate, f"{size} {words}")


def paint(label: npt.NDArray[np.uint8], people: Sequence[Walker], seed: tuple[int, int]) -> npt.NDArray[np.uint8]:
    """Colors (H, W, 3) BGR of labels (H, W), see `labels_of`; 0 is the room."""
    colors = [_ROOM, _SKIN, *(color for person in people for color in (person.shirt, person.trousers))]
    noise = np.random.default_rng(seed).integers(-4, 5, (*label.shape, 3))
    return np.clip(np.array(colors, dtype=np.int64)[label] + noise, 0, 255).astype(np.uint8)


def labels_of(limbs: Sequence[str], number: int) -> npt.NDArray[np.uint8]:
    """Index of the color of each limb of a person."""
    legs = ("thigh", "calf", "foot", "pelvis")
    worn = [1 if name in _BARE else 3 + 2 * number if name.endswith(legs) else 2 + 2 * number for name in limbs]
    return np.array(worn, dtype=np.uint8)


def wider(camera: Camera) -> Camera:
    """A camera with WIDER times the field of view and the same number of pixels."""
    width, height = camera.width, camera.height
    return Camera(width, height, camera.fx / WIDER, camera.fy / WIDER, (width - 1) / 2.0, (height - 1) / 2.0)
