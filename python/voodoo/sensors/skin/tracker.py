"""Skin colour as a cue for head and hands (K06 III-A): segmentation that adapts, regions, and their assignment.

All regions become candidates without a label. They are followed in space (see `blobs`), so that a hand keeps its name
while the body model falls behind. What keeps a hand with its owner:

* A region that is larger than a hand (a bare forearm, a door) offers its tips, not its middle, and of the tips of a
  forearm the one that is not the elbow's.
* What has had skin's colour for long where no head or hand was is background (a wooden door); with a depth image, so is
  what lies nowhere near the body.
* Where two new candidates could both be a site, neither is taken. A site that was lost is taken up far from where it is
  expected only in a region that belongs to no other site and that the body does not explain where it is thought to be.
* The colours are learnt where two of head and hands show them, with a forgetting factor, so that they follow the light and
  the person.

With a depth image a region is a place in space, not only a ray.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from copy import copy
from typing import Any, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate
from voodoo.errors import MeasurementError
from voodoo.model.camera import Camera
from voodoo.model.transforms import rigid
from voodoo.sensors.body_view import BodyView
from voodoo.sensors.pixels import FloatArray, checked_camera, in_sensor, lengths, ray_distance, world_rays
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.skin.color import Colours, SkinColour
from voodoo.sensors.skin.hands import elsewhere, of_pieces, to_palm
from voodoo.sensors.skin.regions import FACE_M, LONGEST_JOINED, PALM_M, Candidate, candidates
from voodoo.sensors.skin.rules import allowed_sites
from voodoo.sensors.skin.settings import SkinSettings
from voodoo.sensors.skin.tracks import Blob, Blobs, Sight

Mask = npt.NDArray[np.bool_]
ByteImage = npt.NDArray[np.uint8]

Surface: TypeAlias = Callable[[FloatArray], Mapping[str, npt.NDArray[np.floating[Any]]]]
"""Limb name -> distances (N,) of places (N, 3) from its surface [m]."""
SPECK = 0.7
"""A smaller share of a palm is a speck."""
FACE_BEHIND_M, HAND_BEHIND_M = 0.075, 0.04
"""The middle of a head lies this far behind its face, that of a hand behind its skin."""


class SkinTracker:
    """The skin cue of one camera."""

    def __init__(self, settings: SkinSettings | None = None) -> None:
        """Start with the colours of all skins; `learn` makes them one person's."""
        self.settings = settings or SkinSettings()
        self.colour = SkinColour()
        self.blobs = Blobs()
        self._stamp = 0.0
        self.candidates: list[Candidate] = []
        self.assigned: dict[str, Candidate] = {}
        self._skin: Mask | None = None
        self._seen: Mask | None = None
        self._colours: tuple[ByteImage, Colours] | None = None
        self._pictures = 0
        self._body: Mask | None = None
        self._before: Mask | None = None
        self._static: npt.NDArray[np.float32] | None = None
        self._learnt = 0

    def __copy__(self) -> SkinTracker:
        """As it is, for what `observe` changes; what `learn` changes is shared."""
        twin = SkinTracker.__new__(SkinTracker)
        vars(twin).update(vars(self))
        twin.blobs = copy(self.blobs)
        return twin

    @property
    def settled(self) -> bool:
        """True when enough pictures were learnt from."""
        return self._learnt >= self.settings.settled_frames

    @property
    def mask(self) -> Mask | None:
        """(H, W): skin in the last picture, without what was ruled out; None before the first picture."""
        return self._skin

    def observe(
        self,
        image: ByteImage,
        camera: Camera,
        world_from_sensor: npt.ArrayLike,
        predicted: Mapping[str, FloatArray],
        *,
        stamp: float | None = None,
        body: BodyView | None = None,
        surface: Surface | None = None,
        strangers: Callable[[FloatArray], npt.NDArray[np.floating[Any]]] | None = None,
        arm_lost: Collection[str] = (),
        upper_arm_visible: Collection[str] = (),
        head_visible: Collection[str] = (),
        source: str = "skin",
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
            surface: distances of places (N, 3) from each limb's surface, limb name -> (N,) [m]; see
                `Tracker.limb_distances`.
            strangers: distances (N,) of places (N, 3) from other persons; what is nearer to them than to the body is theirs.
            arm_lost: sites whose limb the other sensors do not show where the body has it.
            upper_arm_visible: sites whose upper arm they do show there: its hand is a forearm away from that elbow.
            head_visible: sites whose own limb they show there, see `SkinSettings.shown_bias`.
            source: name for `Estimate.sources`.

        Raises:
            MeasurementError: the image is not of the camera's size.
        """
        pose = rigid(world_from_sensor)
        _check_image(image, camera)
        places = self._places(camera, pose, predicted)
        focal = math.sqrt(camera.fx * camera.fy)
        nearest = min((z for _, z in places.values()), default=1.0)
        palm_px = PALM_M * focal / nearest
        self._skin = self._segmented(image, body, palm_px)
        self.candidates, self.assigned = [], {}
        stamp = self._stamp + 1.0 / 30.0 if stamp is None else stamp
        self._stamp = stamp
        if not places or not self.settled:
            return []
        self.candidates, labels = candidates(self._skin, palm_px=palm_px)
        if not self.candidates:
            return []
        origin, directions = world_rays(camera, pose, [item.pixel for item in self.candidates])
        z, sights = self._sights(
            body, labels, origin, directions, pose[:3, 2], nearest=nearest, radius=1.5 * PALM_M * focal / nearest
        )
        seen = self.blobs.follow(sights, stamp)
        # Where each site is when a sight is its surface, (S, B, 3).
        sites = list(places)
        behind = np.array([FACE_BEHIND_M if site.startswith("head") else HAND_BEHIND_M for site in sites])
        surfaces = np.array([sight.place for sight in sights])
        inside = surfaces + directions * behind[:, None, None]
        deep = np.array([sight.deep for sight in sights])
        expected = np.array([predicted[site] for site in sites])[:, None]
        distance = np.where(deep, lengths(inside - expected), ray_distance(origin, directions, expected))
        limbs = {} if surface is None else surface(surfaces)
        specks = np.array([item.area for item in self.candidates]) < SPECK * math.pi * (PALM_M * focal / z) ** 2
        allowed = allowed_sites(
            sites,
            sights,
            inside,
            seen,
            predicted,
            limbs,
            arm_lost=arm_lost,
            upper_arm_visible=upper_arm_visible,
            specks=specks,
            unexplained=self.settings.unexplained,
        )
        if strangers is not None and limbs:
            own = np.min(list(limbs.values()), axis=0)
            allowed[:, deep & (strangers(surfaces) < own)] = 0.0
        # A speck far from where the hand is expected is what is left of another region.
        allowed[(distance > self.settings.gate) & specks] = 0.0
        others = elsewhere(sites, sights, limbs, arm_lost)
        found = self._named(seen, distance, allowed, others, sites, deep_camera=body is not None, stamp=stamp)
        free = (allowed > 0) & ~others & deep
        free[:, list(found.values())] = False
        rays = []
        for site, column in found.items():
            self.assigned[site] = self.candidates[column]
            row = sites.index(site)
            direction, place = directions[column], inside[row, column] if deep[column] else None
            if place is not None and not site.startswith("head"):
                place = of_pieces(place, list(inside[row, free[row]]), predicted[site])
                direction = (place - origin) / float(np.linalg.norm(place - origin))
            bias = self.settings.sites[site]
            if site in head_visible:
                bias = max(bias, self.settings.shown_bias.get(site, bias))
            across = self.settings.noise.sigma(places[site][1], focal)
            ray = SiteRay(site, origin, direction, across, source, bias=bias, place=place)
            rays.append(ray.moved(to_palm(site, predicted)))
        return rays

    def _segmented(self, image: ByteImage, body: BodyView | None, palm_px: float) -> Mask:
        """(H, W): skin, without what is nowhere near the body and what has been there for long."""
        colours = Colours.of(image)
        self._colours = (image, colours)
        self._body, self._before = (None, None) if body is None else (body.mask, body.before)
        always = self._static if self._static is not None and self._static.shape == image.shape[:2] else None
        self._seen, skin = _core.skin_mask(
            colours.bins,
            self.colour.table(),
            longest=LONGEST_JOINED * palm_px,
            body=self._body,
            always=always,
            # A hand before a wooden door is not the door.
            before=self._before,
        )
        return skin

    def _sights(
        self,
        body: BodyView | None,
        labels: npt.NDArray[np.int32],
        origin: FloatArray,
        directions: FloatArray,
        axis: FloatArray,
        *,
        nearest: float,
        radius: float,
    ) -> tuple[FloatArray, list[Sight]]:
        """Depths (B,) along the optical axis and places of the candidates: as the depth camera has it, else `nearest`."""
        looked: list[tuple[float, bool] | None] = [None] * len(self.candidates)
        if body is not None:
            looked = body.look_at(labels, [(item.pixel, item.region) for item in self.candidates], radius)
        z = np.array([nearest if found is None else found[0] for found in looked])
        surfaces = origin + directions * (z / (directions @ axis))[:, None]
        return z, [
            Sight(direction, place, found is not None, item.hand, item.region, found is not None and found[1])
            for direction, place, found, item in zip(directions, surfaces, looked, self.candidates, strict=True)
        ]

    def _named(
        self,
        seen: list[Blob],
        distance: FloatArray,
        allowed: FloatArray,
        others: Mask,
        sites: list[str],
        *,
        deep_camera: bool,
        stamp: float,
    ) -> dict[str, int]:
        """Site -> candidate; gates widen farther for hands that a depth camera sees."""
        chosen = self.settings
        return self.blobs.name(
            seen,
            distance,
            allowed,
            others,
            sites=sites,
            gates=dict.fromkeys(sites, chosen.gate),
            growth=chosen.gate_growth,
            widest={
                site: chosen.widest_gate if deep_camera and not site.startswith("head") else chosen.lost_gate
                for site in sites
            },
            ambiguity=chosen.ambiguity,
            stamp=stamp,
        )

    def learn(
        self,
        image: ByteImage,
        camera: Camera,
        world_from_sensor: npt.ArrayLike,
        estimate: Estimate,
        *,
        rate_hz: float = 30.0,
        vouched: bool = False,
    ) -> None:
        """Learn colours and background from a picture and the estimate of its time; only while tracking is good.

        Colours are learnt around the sites that were matched (all of them before the cue has settled), and only from
        pixels that were skin already, or nearly: the hair on a head seen from behind is not skin.

        Args:
            image, camera, world_from_sensor: as in `observe`.
            estimate: of the picture's time.
            rate_hz: of the pictures.
            vouched: the pose is right whatever the status says: somebody set it.

        Raises:
            MeasurementError: the image is not of the camera's size.
        """
        if estimate.status != "tracking" and not vouched:
            return
        pose = rigid(world_from_sensor)
        _check_image(image, camera)
        places = self._places(camera, pose, estimate.joints)
        focal = math.sqrt(camera.fx * camera.fy)
        discs = []
        away = np.ones(image.shape[:2], dtype=np.uint8)
        for site, (pixel, z) in places.items():
            radius = (FACE_M if site.startswith("head") else PALM_M) * focal / z
            centre = (round(pixel[0]), round(pixel[1]))
            if not (-1e4 < centre[0] < 1e4 and -1e4 < centre[1] < 1e4):
                continue
            cv2.circle(away, centre, max(round(2.5 * radius), 2), 0, -1)
            if site in self.assigned or not self.settled:
                discs.append((centre, max(round(0.8 * radius), 1)))
        self._pictures += 1
        outside = away.view(np.bool_)
        if self._seen is not None:
            self._learn_static(self._seen, outside if self._before is None else outside & ~self._before, rate_hz)
        # Light does not change from picture to picture; learning is the dearest part.
        if self.settled and self._pictures % self.settings.learn_every:
            return
        inside = [cv2.circle(np.zeros_like(away), *disc, 1, -1).view(np.bool_) for disc in discs]
        known = self._colours
        colours = known[1] if known is not None and known[0] is image else Colours.of(image)
        if self.colour.learn(colours, inside, outside=outside, body=self._body):
            self._learnt += 1

    def _learn_static(self, seen: Mask, away: Mask, rate_hz: float) -> None:
        """A running mean of "skin's colour, and no head or hand near": half of it is reached after static_seconds."""
        if self._static is None or self._static.shape != seen.shape:
            self._static = np.zeros(seen.shape, dtype=np.float32)
        share = 1.0 - 0.5 ** (1.0 / (self.settings.static_seconds * rate_hz))
        cv2.accumulateWeighted(seen.view(np.uint8), self._static, share, mask=away.view(np.uint8))

    def _places(
        self, camera: Camera, pose: FloatArray, positions: Mapping[str, npt.NDArray[np.float64]]
    ) -> dict[str, tuple[FloatArray, float]]:
        """Pixel and depth of every site that lies in front of the camera."""
        sites = [site for site in self.settings.sites if site in positions]
        if not sites:
            return {}
        points = in_sensor(pose, [positions[site] for site in sites])
        pixels = camera.project(points)
        usable = np.asarray(np.isfinite(pixels).all(axis=1) & (points[:, 2] > 0.1)).tolist()
        found = zip(sites, pixels, points[:, 2].tolist(), usable, strict=True)
        return {site: (pixel, z) for site, pixel, z, able in found if able}


def _check_image(image: ByteImage, camera: Camera) -> None:
    checked_camera(camera)
    if not isinstance(image, np.ndarray):
        raise MeasurementError(f"image: expected an array (H, W, 3) of uint8, found {type(image).__name__}")
    if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
        raise MeasurementError(
            f"image: expected uint8 of shape {(camera.height, camera.width, 3)}, found {image.dtype} of {image.shape}"
        )
