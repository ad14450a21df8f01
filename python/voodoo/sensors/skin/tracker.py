"""Skin color as a cue for head and hands (K06 III-A): regions of skin become rays of the nearest predicted sites."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from copy import copy

import numpy as np

import voodoo._core as _core
from voodoo._core import Estimate
from voodoo.errors import MeasurementError, of_kind
from voodoo.measurements import ByteImage, ColorImage, DepthImage, FloatArray
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid
from voodoo.people import Followed
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.silhouettes.masks import Mask
from voodoo.sensors.skin.settings import SkinSettings
from voodoo.tracker import Tracker

_NOWHERE = np.full(3, np.nan)


class SkinTracker:
    """The skin cue of one camera."""

    def __init__(self, settings: SkinSettings | None = None) -> None:
        """Start with the colors of all skin tones; `learn` adapts them to one person."""
        self.settings = chosen = settings or SkinSettings()
        self._sites = tuple(chosen.sites)
        self._cue = _core.SkinCue(
            self._sites,
            gate=chosen.gate,
            growth=chosen.gate_growth,
            lost_gate=chosen.lost_gate,
            widest_gate=chosen.widest_gate,
        )
        self._images = 0

    def __copy__(self) -> SkinTracker:
        """Copy the state."""
        twin = SkinTracker.__new__(SkinTracker)
        vars(twin).update(vars(self))
        twin._cue = copy(self._cue)
        return twin

    @property
    def mask(self) -> Mask:
        """(H, W): skin near the body in the last image; empty before the first image."""
        return self._cue.mask

    @property
    def candidates(self) -> list[tuple[float, float]]:
        """Pixels (u, v) in the last image where a head or hand may be."""
        return self._cue.candidates

    @property
    def assigned(self) -> dict[str, tuple[float, float]]:
        """Site -> the candidate that is assigned to it."""
        found = self.candidates
        return {self._sites[site]: found[number] for site, number in self._cue.assigned}

    def observe(
        self,
        item: ColorImage,
        predicted: Mapping[str, FloatArray],
        *,
        depth: DepthImage | None = None,
        tracker: Tracker | Followed | None = None,
        others: Sequence[Followed] = (),
        head_visible: Collection[str] = (),
        moved: Mapping[str, FloatArray] | None = None,
    ) -> list[SiteRay]:
        """Updates the cue with an image and returns a ray for each detected site.

        Args:
            item: the image.
            predicted: site name -> (3,) in the root frame at the time of the image; skin is searched for around them.
            depth: image of a depth camera beside this one. With it, skin that is not at the body's distance is left out, and
                a candidate has a position, not only a ray.
            tracker: the tracker of the body, with its last pose: what is on its trunk or its legs is no hand, if `depth` is
                given.
            others: other persons; a region nearer to them than to the body belongs to them.
            head_visible: sites whose own limb is measured by other sensors, see `SkinSettings.visible_bias`.
            moved: site name -> position (3,) at the time of the rays; None: the rays have the time of the image.

        Raises:
            MeasurementError: an image is not of its camera's size, or `tracker` has no pose yet.
        """
        camera, pose, image = item.camera, *_checked(item)
        beside = None if depth is None else (depth.image, depth.meters_per_unit, depth.camera, depth.root_from_sensor)
        found = self._cue.observe(
            image,
            predicted,
            stamp=item.stamp,
            world_from_sensor=pose,
            camera=camera,
            depth=beside,
            tracker=None if tracker is None else tracker._core,
            others=[other._core for other in others],
        )
        noise, focal = self.settings.noise, (camera.fx * camera.fy) ** 0.5
        rays = []
        for number, direction, place, z in found:
            site = self._sites[number]
            bias = self.settings.sites[site]
            if site in head_visible:
                bias = max(bias, self.settings.visible_bias.get(site, bias))
            ray = SiteRay(site, pose[:3, 3], direction, noise.sigma(z, focal), item.sensor, bias=bias, place=place)
            rays.append(ray if moved is None else ray.moved(moved[site] - predicted[site]))
        return rays

    def learn(self, item: ColorImage, estimate: Estimate, *, trusted_start: bool = False) -> None:
        """Learn the colors of the face, if it was detected, from an image and the estimate at its time, if that is "tracking".

        Args:
            item: the image.
            estimate: the estimate at the time of the image.
            trusted_start: the pose was set by the user and is learned from whatever the status is.

        Raises:
            MeasurementError: the image is not of the camera's size.
        """
        pose, image = _checked(item)
        if estimate.status != "tracking" and not trusted_start:
            return
        self._images += 1
        # The light changes slowly.
        if self._cue.learned and self._images % self.settings.learn_every:
            return
        names, positions = estimate.joint_names, np.ascontiguousarray(estimate.joint_positions)
        sites = np.array([positions[names.index(site)] if site in names else _NOWHERE for site in self._sites])
        self._cue.learn(image, positions, sites, world_from_sensor=pose, camera=item.camera)


def _checked(item: ColorImage) -> tuple[FloatArray, ByteImage]:
    """The pose (4, 4) of the camera, and the image (H, W, 3).

    Raises:
        MeasurementError: the pose is not rigid, or the image is not of its camera's size.
    """
    camera, image = of_kind("camera", item.camera, Camera, MeasurementError), item.image
    if not isinstance(image, np.ndarray):
        raise MeasurementError(f"image: expected an array (H, W, 3) of uint8, found {type(image).__name__}")
    if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
        raise MeasurementError(
            f"image: expected uint8 of shape {(camera.height, camera.width, 3)}, found {image.dtype} of {image.shape}"
        )
    return rigid(item.root_from_sensor), np.ascontiguousarray(image)
