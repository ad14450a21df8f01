"""Skin color as a cue for head and hands (K06 III-A): segmentation that adapts, regions, and their assignment.

All regions become candidates without a label. They are followed in space, so that a hand keeps its name while the body
model falls behind; `voodoo_core::skin` says what keeps a hand with its owner. With a depth image a region is a place in
space, not only a ray.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate
from voodoo.errors import MeasurementError
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid
from voodoo.people import Followed
from voodoo.sensors.body_view import BodyView
from voodoo.sensors.pixels import FloatArray, checked_camera
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.skin.regions import Candidate
from voodoo.sensors.skin.settings import SkinSettings
from voodoo.tracker import Tracker

Mask = npt.NDArray[np.bool_]
ByteImage = npt.NDArray[np.uint8]


_NOWHERE = np.full(3, np.nan)


class FollowedRegion(NamedTuple):
    """A region that is followed.

    Args:
        label: the site whose name it has.
        pictures: in which it was seen.
        stamp: when it was last seen [s].
        velocity: (3,) [m/s].
        far: of each site how far it was from there, squared shares of the gate.
        mismatch_s: of each site how long it has spoken against being it [s].
    """

    label: str | None
    pictures: int
    stamp: float
    velocity: tuple[float, ...]
    far: tuple[float, ...]
    mismatch_s: tuple[float, ...]


class SkinTracker:
    """The skin cue of one camera."""

    def __init__(self, settings: SkinSettings | None = None) -> None:
        """Start with the colors of all skins; `learn` makes them one person's."""
        self.settings = chosen = settings or SkinSettings()
        self._sites = tuple(chosen.sites)
        self._teacher = _core.SkinTeacher()
        self._cue = _core.SkinCue(
            self._sites,
            gate=chosen.gate,
            growth=chosen.gate_growth,
            lost_gate=chosen.lost_gate,
            widest_gate=chosen.widest_gate,
            unexplained=chosen.unexplained,
            ambiguity=chosen.ambiguity,
        )
        self._stamp = 0.0
        self._image: ByteImage | None = None

    def __copy__(self) -> SkinTracker:
        """As it is, for what `observe` changes; what `learn` changes is shared."""
        twin = SkinTracker.__new__(SkinTracker)
        vars(twin).update(vars(self))
        twin._cue = copy(self._cue)
        return twin

    @property
    def settled(self) -> bool:
        """True when enough pictures were learned from."""
        return self._teacher.learned >= self.settings.settled_frames

    @property
    def colors(self) -> npt.NDArray[np.float32]:
        """Histogram of skin's colors (64, 64, 8), by Cr, Cb and Y."""
        return self._teacher.skin

    @property
    def mask(self) -> Mask | None:
        """(H, W): skin in the last picture, without what was ruled out; None before the first picture."""
        return self._cue.mask

    @property
    def candidates(self) -> list[Candidate]:
        """Where in the last picture a head or a hand may be."""
        return [Candidate(*item) for item in self._cue.candidates]

    @property
    def assigned(self) -> dict[str, Candidate]:
        """Site -> which of the candidates it is."""
        found = self.candidates
        return {self._sites[site]: found[number] for site, number in self._cue.assigned}

    @property
    def followed(self) -> list[FollowedRegion]:
        """All regions that are followed."""
        return [
            FollowedRegion(None if site is None else self._sites[site], count, stamp, *map(tuple, rest))
            for site, count, stamp, *rest in self._cue.followed
        ]

    def observe(
        self,
        image: ByteImage,
        camera: Camera,
        world_from_sensor: npt.ArrayLike,
        predicted: Mapping[str, FloatArray],
        *,
        stamp: float | None = None,
        body: BodyView | None = None,
        tracker: Tracker | Followed | None = None,
        others: Sequence[Followed] = (),
        arm_lost: Collection[str] = (),
        upper_arm_visible: Collection[str] = (),
        head_visible: Collection[str] = (),
        source: str = "skin",
        moved: Mapping[str, FloatArray] | None = None,
    ) -> list[SiteRay]:
        """Rays of those sites that were found.

        Args:
            image: (H, W, 3) BGR uint8.
            camera: calibration.
            world_from_sensor: (4, 4).
            predicted: site name -> (3,) in the world at the time of the picture.
            stamp: of the picture [s]; None: 1/30 s after the last.
            body: what a depth camera saw near the body; None: not known. A candidate must then lie at about the depth
                of its site, so that a hand hidden behind the body does not jump to what is in front.
            tracker: who follows the body, with its last pose; None: where the body's surface is, is not known.
            others: other persons; what is nearer to them than to the body is theirs.
            arm_lost: sites whose limb the other sensors do not show where the body has it.
            upper_arm_visible: sites whose upper arm they do show there: its hand is a forearm away from that elbow.
            head_visible: sites whose own limb they show there, see `SkinSettings.visible_bias`.
            source: name for `Estimate.sources`.
            moved: site name -> (3,) where it is at the time of the rays; None: that of the picture.

        Raises:
            MeasurementError: the image is not of the camera's size, or `tracker` has no pose yet.
        """
        pose = rigid(world_from_sensor)
        _check_image(image, camera)
        self._stamp = self._stamp + 1.0 / 30.0 if stamp is None else stamp
        self._image = image
        found = self._cue.observe(
            self._teacher,
            np.ascontiguousarray(image),
            predicted,
            stamp=self._stamp,
            world_from_sensor=pose,
            camera=camera,
            body=body,
            settled=self.settled,
            arm_lost=[site in arm_lost for site in self._sites],
            upper_arm_visible=[site in upper_arm_visible for site in self._sites],
            tracker=None if tracker is None else tracker._core,
            others=[other._core for other in others],
        )
        noise, focal = self.settings.noise, (camera.fx * camera.fy) ** 0.5
        rays = []
        for number, origin, direction, place, z in found:
            site = self._sites[number]
            bias = self.settings.sites[site]
            if site in head_visible:
                bias = max(bias, self.settings.visible_bias.get(site, bias))
            ray = SiteRay(site, origin, direction, noise.sigma(z, focal), source, bias=bias, place=place)
            rays.append(ray if moved is None else ray.moved(moved[site] - predicted[site]))
        return rays

    def learn(
        self,
        image: ByteImage,
        camera: Camera,
        world_from_sensor: npt.ArrayLike,
        estimate: Estimate,
        *,
        rate_hz: float = 30.0,
        trusted_start: bool = False,
    ) -> None:
        """Learn colors and background from a picture and the estimate of its time; only while tracking is good.

        Colors are learned around the sites that were matched (all of them before the cue has settled), and only from
        pixels that were skin already, or nearly: the hair on a head seen from behind is not skin.

        Args:
            image, camera, world_from_sensor: as in `observe`.
            estimate: of the picture's time.
            rate_hz: of the pictures.
            trusted_start: the pose is right whatever the status says: somebody set it.

        Raises:
            MeasurementError: the image is not of the camera's size.
        """
        if estimate.status != "tracking" and not trusted_start:
            return
        pose = rigid(world_from_sensor)
        _check_image(image, camera)
        names, positions = estimate.joint_names, estimate.joint_positions
        self._teacher.learn(
            self._cue,
            None if image is self._image else np.ascontiguousarray(image),
            np.array([positions[names.index(site)] if site in names else _NOWHERE for site in self._sites]),
            world_from_sensor=pose,
            camera=camera,
            half_life=self.settings.static_seconds * rate_hz,
            every=self.settings.learn_every,
            settled=self.settings.settled_frames,
        )


def _check_image(image: ByteImage, camera: Camera) -> None:
    checked_camera(camera)
    if not isinstance(image, np.ndarray):
        raise MeasurementError(f"image: expected an array (H, W, 3) of uint8, found {type(image).__name__}")
    if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
        raise MeasurementError(
            f"image: expected uint8 of shape {(camera.height, camera.width, 3)}, found {image.dtype} of {image.shape}"
        )
