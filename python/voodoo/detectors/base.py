"""Input and output of a detector, and a detector made from a function."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal, Protocol, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import ConfigError

if TYPE_CHECKING:
    from voodoo._core import Detector
    from voodoo.model.camera import Camera

JOINTS = (
    "head_center", "vc7", "humanoid_root",
    *(f"{side}_{joint}" for joint in ("shoulder", "elbow", "wrist", "hand", "hip", "knee", "ankle") for side in "lr"),
)  # fmt: skip
"""The joints that the shipped detector reports, in its order (H-Anim names, ISO/IEC 19774)."""

LENGTHS = ("upper_arm", "forearm", "thigh", "shank", "shoulder_width", "hip_width", "trunk", "neck", "stature")
"""Lengths that the tracker uses: distances between joints, averaged over both sides, and the stature.

`trunk` is the distance from humanoid_root to vc7, `neck` that from vc7 to head_center.
"""


@dataclass(frozen=True, eq=False)
class DetectorImage:
    """A depth image as the input of a detector.

    Args:
        depth: (H, W) float32 [m] along the optical axis; 0 where nothing returned, and in regions that are not
            requested: excluded boxes, the learned background, persons who are tracked already.
        camera: its calibration.
        world_from_sensor: (4, 4) pose of its optical frame (x right, y down, z forward).
        floor: unit normal (3,) upwards and height along it [m], in the world frame, if known.
        query: "all": all persons; "any" or "new": one person suffices; "near": the person at `near`. A detector may always
            return all persons.
        near: (3,) position in the world frame [m] at which a person is expected, with the query "near".
    """

    depth: npt.NDArray[np.float32]
    camera: Camera
    world_from_sensor: npt.NDArray[np.float64]
    floor: tuple[Sequence[float], float] | None = None
    query: Literal["all", "any", "new", "near"] = "all"
    near: npt.NDArray[np.float64] | None = None

    def points(self) -> npt.NDArray[np.float64]:
        """The point (H, W, 3) of every pixel in the sensor's frame [m]; the origin where depth is 0."""
        depth = self.depth.astype(np.float64)[..., None]
        return np.concatenate([depth * np.nan_to_num(self.camera.rays()), depth], axis=-1)

    def to_world(self, points: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Points (..., 3) [m] of the sensor's frame in the world."""
        rotation, translation = self.world_from_sensor[:3, :3], self.world_from_sensor[:3, 3]
        return np.asarray(points, dtype=np.float64) @ rotation.T + translation


@dataclass(frozen=True, eq=False)
class DetectedPerson:
    """A detected person. World frame, meters; probabilities from 0 to 1.

    A `voodoo.Detection` has the same attributes and can be returned instead.

    Args:
        joints: name -> position (3,). Any of the detector's `joints`; those that were not found are left out.
        confidence: probability that it is a person. One detection of 0.994 or two of 0.96 are enough to start a track;
            detections below 0.74 never are.
        joint_sigma: standard deviation along each axis, one for all or name -> number.
        visible: probability that a joint is in the image and not hidden, one for all or name -> number.
        facing: probability that the trunk faces the camera; None if the detector does not report it.
        lengths: name -> length, all of the detector's `lengths` or none.
        length_sigma: name -> standard deviation of it.
        mask: (H, W) bool, pixels of the person; None: all within 0.2 m of the bounding box of the joints.
        floor: unit normal (3,) upwards and height along it, if the detector found the floor.
    """

    joints: Mapping[str, Sequence[float] | npt.NDArray[np.float64]]
    confidence: float
    joint_sigma: float | Mapping[str, float] = 0.05
    visible: float | Mapping[str, float] = 1.0
    facing: float | None = None
    lengths: Mapping[str, float] = field(default_factory=dict)
    length_sigma: Mapping[str, float] = field(default_factory=dict)
    mask: npt.NDArray[np.bool_] | None = None
    floor: tuple[Sequence[float], float] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class Detection:
    """A person in a depth image, as `voodoo.Detector` reports it. World frame, meters; probabilities from 0 to 1.

    Args:
        joints: joint name -> position (3,); `l_` and `r_` are the person's own.
        joint_sigma: joint name -> standard deviation along each axis.
        visible: joint name -> probability that it is in the image and not occluded.
        lengths: upper arm, forearm, thigh, shank, shoulder and hip width, trunk, neck and stature.
        length_sigma: names as in `lengths` -> standard deviation.
        stature: height of the person when standing upright.
        facing: probability that the front of the trunk faces the camera.
        confidence: probability that it is a person.
        source: source name of the depth image in which it was detected.
        mask: the person's pixels (H, W) in that image.
        floor: ground plane, detected or given by the frame: unit normal (3,) upwards and height along it; or None.
    """

    joints: dict[str, npt.NDArray[np.float64]]
    joint_sigma: dict[str, float]
    visible: dict[str, float]
    lengths: dict[str, float]
    length_sigma: dict[str, float]
    stature: float
    facing: float
    confidence: float
    source: str
    mask: npt.NDArray[np.bool_]
    floor: tuple[Sequence[float], float] | None

    def __repr__(self) -> str:
        """Summary in numbers."""
        return (
            f'Detection(source="{self.source}", confidence={self.confidence:.2f}, facing={self.facing:.2f}, '
            f"stature={self.stature:.2f})"
        )


@dataclass(frozen=True, eq=False)
class PersonCandidate:
    """A person candidate in a depth image, with the crop that is the network's input. Camera frame, meters.

    Args:
        crop: input of the network (2, 96, 96): depth relative to the center, scaled so that +-1.2 m is +-1, and the mask.
        mask: its pixels (H, W) in the depth image.
        middle: center of the crop: (x/z, y/z) in the camera rotated by `roll`, and the depth.
        roll: rotation of the camera about its optical axis that makes the vertical point up in the image [rad].
        floor: normal and offset of the ground plane, given or detected.
    """

    crop: npt.NDArray[np.float32]
    mask: npt.NDArray[np.bool_]
    middle: Sequence[float]
    roll: float
    floor: tuple[Sequence[float], float] | None


class PersonDetector(Protocol):
    """Interface of objects that detect persons in depth images for a tracker.

    A step releases the GIL, and acquires it again for each call. One object serves all persons of a `People`.
    """

    @property
    def joints(self) -> Sequence[str]:
        """Names of the joints that it reports: those of sites of the body; others are ignored."""

    @property
    def lengths(self) -> Sequence[str]:
        """Names of the lengths that it reports, of `LENGTHS`; others are ignored."""

    def detect(self, image: DetectorImage) -> Iterable[Any]:
        """The persons in an image, each with the attributes of `DetectedPerson`.

        An exception does not end the tracker's step: it continues without detections and warns (`voodoo.DetectorWarning`).
        """


AnyDetector: TypeAlias = "Literal['shipped'] | Detector | PersonDetector | None"
"""Detectors that trackers accept: the shipped detector, the same network with other weights, a custom one, or none."""


class CallableDetector:
    """Detector that calls a function.

    Args:
        function: takes a `DetectorImage`, returns the persons in it, each a `DetectedPerson`.
        joints: names of the joints that it reports, such as those of `Body.site_names`.
        lengths: names of the lengths that it reports, of `LENGTHS`.
    """

    def __init__(
        self,
        function: Callable[[DetectorImage], Iterable[Any]],
        *,
        joints: Sequence[str],
        lengths: Sequence[str] = (),
    ) -> None:
        """See the class.

        Raises:
            ConfigError: not a function, or invalid names.
        """
        if not callable(function):
            raise ConfigError(f"function: expected something that can be called, found {type(function).__name__}")
        self._function = function
        self.joints = names_of("joints", joints)
        self.lengths = names_of("lengths", lengths)

    def detect(self, image: DetectorImage) -> Iterable[Any]:
        """The persons that the function returns."""
        return self._function(image)


def names_of(what: str, names: object) -> tuple[str, ...]:
    """Check names.

    Raises:
        ConfigError: not names, or a duplicate; it says of what.
    """
    if isinstance(names, str) or not isinstance(names, Sequence) or not all(isinstance(name, str) for name in names):
        raise ConfigError(f"{what}: expected a sequence of names, found {names!r:.80}")
    twice = sorted({name for name in names if list(names).count(name) > 1})
    if twice:
        raise ConfigError(f"{what}: expected each name once, found {twice[0]!r} twice")
    return tuple(names)
