"""Skin color as a cue for head and hands (K06 III-A): adaptive segmentation, regions, and their assignment to sites.

All regions are unlabeled candidates. They are tracked in 3-D, so that a hand keeps its label while the body model lags; the
documentation of `voodoo_core::skin` lists the rules that keep each region with its site. With a depth image a region has a
3-D position, not only a ray.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy
from dataclasses import dataclass

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
from voodoo.sensors.skin.settings import SkinSettings
from voodoo.tracker import Tracker

Mask = npt.NDArray[np.bool_]
ByteImage = npt.NDArray[np.uint8]


_NOWHERE = np.full(3, np.nan)


@dataclass(frozen=True, eq=False)
class Candidate:
    """A pixel where a head or hand may be.

    Args:
        pixel: (u, v).
        region: label of its region.
        area: of that region [px].
        hand: False for the center of a region longer than a hand, which may be a face but not a hand.
    """

    pixel: tuple[float, float]
    region: int
    area: int
    hand: bool = True


class SkinTracker:
    """The skin cue of one camera."""

    def __init__(self, settings: SkinSettings | None = None) -> None:
        """Start with the colors of all skin tones; `learn` adapts them to one person."""
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
        """Copy the state that `observe` changes; the models that `learn` changes are shared."""
        twin = SkinTracker.__new__(SkinTracker)
        vars(twin).update(vars(self))
        twin._cue = copy(self._cue)
        return twin

    @property
    def settled(self) -> bool:
        """True if the colors were learned from enough images."""
        return self._teacher.learned >= self.settings.settled_frames

    @property
    def colors(self) -> npt.NDArray[np.float32]:
        """Histogram of skin colors (64, 64, 8), by Cr, Cb and Y."""
        return self._teacher.skin

    @property
    def mask(self) -> Mask | None:
        """(H, W): skin of the body in the last image, without excluded pixels; None before the first image."""
        return self._cue.mask

    @property
    def candidates(self) -> list[Candidate]:
        """Candidates for heads and hands in the last image."""
        return [Candidate(*item) for item in self._cue.candidates]

    @property
    def assigned(self) -> dict[str, Candidate]:
        """Site -> the candidate that is assigned to it."""
        found = self.candidates
        return {self._sites[site]: found[number] for site, number in self._cue.assigned}

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
        """Updates the cue with an image and returns a ray for each detected site.

        Args:
            image: (H, W, 3) BGR uint8.
            camera: calibration.
            world_from_sensor: (4, 4).
            predicted: site name -> (3,) in the world at the time of the picture.
            stamp: time of the image [s]; None: 1/30 s after the last.
            body: depth measurements near the body; None: not known. With them a candidate must lie approximately at the depth
                of its site, so that the track of a hand hidden behind the body does not jump to a region in front.
            tracker: the tracker of the body, with its last pose; None: the position of the body's surface is not known.
            others: other persons; a region nearer to them than to the body belongs to them.
            arm_lost: sites whose limb is not supported by other sensors at its estimated pose.
            upper_arm_visible: sites whose upper arm is supported there; the hand is then one forearm away from that elbow.
            head_visible: sites whose own limb is supported there, see `SkinSettings.visible_bias`.
            source: name for `Estimate.sources`.
            moved: site name -> position (3,) at the time of the rays; None: the rays have the time of the image.

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
        """Learn colors and background from an image and the estimate at its time, if its status is "tracking".

        Colors are learned around the sites that were detected (all sites before the cue has settled). Only pixels whose
        colors are close to those of skin are used, because a head seen from behind shows hair.

        Args:
            image, camera, world_from_sensor: as in `observe`.
            estimate: the estimate at the time of the image.
            rate_hz: frame rate of the camera.
            trusted_start: the pose was set by the user and is learned from whatever the status is.

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
