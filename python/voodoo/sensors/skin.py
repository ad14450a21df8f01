"""Skin colour as a cue for head and hands (K06 III-A): segmentation that adapts, regions, and their assignment.

All regions become candidates without a label; candidates and sites are matched one to one within a gate around the
predicted
sites, what is left over is ignored. Three things keep a hand with its owner:

* A region that is larger than a hand (a bare forearm, a door) offers its tips, not its middle.
* What has had skin's colour for long where no head or hand was is background (a wooden door); with a depth image, so
is what
  lies nowhere near the body.
* A site that other sensors measure well has a narrow gate, and where two candidates could both be it, neither is taken.
* The colours are learnt at the projected head and hands while they are matched, with a forgetting factor, so that they
  follow the light and the person.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import maximum_filter1d

from voodoo._core import Estimate
from voodoo.camera import Camera
from voodoo.errors import MeasurementError
from voodoo.sensors.assignment import assign
from voodoo.sensors.depth import BodyView
from voodoo.sensors.model import PixelNoise
from voodoo.sensors.pixels import FloatArray, in_sensor, ray_distance, rigid, world_rays
from voodoo.sensors.rays import SiteRay
from voodoo.sensors.skin_colour import Colours, SkinColour

Mask = npt.NDArray[np.bool_]
ByteImage = npt.NDArray[np.uint8]

PALM_M, FACE_M = 0.045, 0.085
"""Radii of a palm and of a face."""
LONGEST_HAND = 6.0
"""A hand with stretched fingers in radii of its palm, measured across the box around it."""


@dataclass(frozen=True)
class SkinSettings:
    """How skin regions become rays.

    Args:
        sites: site -> standard deviation [m] of a region's centre from it. A face is the front of the head.
        gate: a candidate farther than this from the predicted site is not it [m].
        lost_gate: the same for a site whose limb nothing else measures.
        depth_gate: with a depth image, a candidate must be as deep as its site up to its gate and this [m]: the
            surface is not the site.
        ambiguity: a second candidate that is not this many times as far as the first makes both useless.
        noise: of a region's centre in the image; its spread is that of the site.
        static_seconds: what has skin's colour for so long away from head and hands is background [s].
        settled_frames: pictures to learn from before the cue is used.
        learn_every: of the pictures after those, every n-th is learnt from.

    Raises:
        MeasurementError: a number that is not above zero.
    """

    sites: Mapping[str, float] = field(
        default_factory=lambda: {"head_center": 0.05, "l_hand": 0.04, "r_hand": 0.04},
    )
    gate: float = 0.12
    lost_gate: float = 0.35
    depth_gate: float = 0.10
    ambiguity: float = 1.5
    noise: PixelNoise = field(default_factory=lambda: PixelNoise(pixels=1.5, spread=0.0))
    static_seconds: float = 1.0
    settled_frames: int = 1
    learn_every: int = 3

    def __post_init__(self) -> None:
        """Check the numbers."""
        numbers = {"gate": self.gate, "lost_gate": self.lost_gate, "static_seconds": self.static_seconds, **self.sites}
        numbers["learn_every"] = float(self.learn_every)
        for name, value in numbers.items():
            if not (math.isfinite(value) and value > 0.0):
                raise MeasurementError(f"skin {name}: expected a number > 0, found {value!r}")


@dataclass(frozen=True, eq=False)
class Candidate:
    """A place in the image where a head or hand may be.

    Args:
        pixel: (u, v).
        region: number of the region it is of.
        area: of that region [px].
        hand: False for the middle of a region that is longer than a hand: it may be a face, but not a hand.
    """

    pixel: tuple[float, float]
    region: int
    area: int
    hand: bool = True


class SkinTracker:
    """The skin cue of one camera."""

    def __init__(self, settings: SkinSettings | None = None) -> None:
        """Start with the colours of all skins; `learn` makes them one person's."""
        self.settings = settings or SkinSettings()
        self.colour = SkinColour()
        self.candidates: list[Candidate] = []
        self.assigned: dict[str, Candidate] = {}
        self._skin: Mask | None = None
        self._seen: Mask | None = None
        self._colours: tuple[ByteImage, Colours] | None = None
        self._pictures = 0
        self._body: Mask | None = None
        self._static: npt.NDArray[np.float32] | None = None
        self._learnt = 0

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
        body: BodyView | None = None,
        lost: Collection[str] = (),
        source: str = "skin",
    ) -> list[SiteRay]:
        """Rays of those sites that were found.

        Args:
            image: (H, W, 3) BGR uint8.
            camera: calibration.
            world_from_sensor: (4, 4).
            predicted: site name -> (3,) in the world at the time of the picture.
            body: what a depth camera saw near the body; None: not known. A candidate must then lie at about the depth
                of its site, so that a hand hidden behind the body does not jump to what is in front.
            lost: sites whose limb nothing else measures.
            source: name for `Estimate.sources`.

        Raises:
            MeasurementError: the image is not of the camera's size.
        """
        pose = rigid(world_from_sensor)
        _check_image(image, camera)
        places = self._places(camera, pose, predicted)
        self._colours = (image, Colours.of(image))
        self._seen = self.colour.classify(self._colours[1])
        skin = self._seen.copy()
        self._body = None if body is None else body.mask
        if body is not None:
            skin &= body.mask
        if self._static is not None and self._static.shape == skin.shape:
            skin &= self._static < 0.5
        self._skin = skin
        focal = math.sqrt(camera.fx * camera.fy)
        self.candidates, self.assigned = [], {}
        if not places or not self.settled:
            return []
        nearest = min(z for _, z in places.values())
        self.candidates = candidates(skin, palm_px=PALM_M * focal / nearest)
        if not self.candidates:
            return []
        origin, directions = world_rays(camera, pose, [item.pixel for item in self.candidates])
        sites = list(places)
        cost = np.array([ray_distance(origin, directions, predicted[site]) for site in sites])
        cost[:, ~np.isfinite(directions).all(axis=1)] = np.inf
        no_hand = np.flatnonzero([not item.hand for item in self.candidates])
        hands = np.flatnonzero([not site.startswith("head") for site in sites])
        cost[np.ix_(hands, no_hand)] = np.inf
        if body is not None:
            reach = 1.5 * PALM_M * focal / nearest
            depths = [body.depth_at(item.pixel, reach) for item in self.candidates]
            for row, site in enumerate(sites):
                limit = self.settings.depth_gate + (self.settings.lost_gate if site in lost else self.settings.gate)
                for column, depth in enumerate(depths):
                    if depth is None or abs(depth - places[site][1]) > limit:
                        cost[row, column] = np.inf
        gates = np.array([self.settings.lost_gate if site in lost else self.settings.gate for site in sites])
        pixels = np.array([item.pixel for item in self.candidates])
        rays = []
        # Distances in units of each site's own gate.
        for row, column in assign(cost / gates[:, None], gate=1.0):
            site = sites[row]
            z = places[site][1]
            apart = np.linalg.norm(pixels - pixels[column], axis=1) > 2.0 * PALM_M * focal / z
            if (cost[row][apart] < max(self.settings.ambiguity * cost[row, column], 0.5 * gates[row])).any():
                continue
            self.assigned[site] = self.candidates[column]
            across = self.settings.noise.sigma(z, focal, spread=self.settings.sites[site])
            rays.append(SiteRay(site, origin, directions[column], across, source))
        return rays

    def learn(
        self,
        image: ByteImage,
        camera: Camera,
        world_from_sensor: npt.ArrayLike,
        estimate: Estimate,
        *,
        rate_hz: float = 30.0,
    ) -> None:
        """Learn colours and background from a picture and the estimate of its time; only while tracking is good.

        Colours are learnt around the sites that were matched (all of them before the cue has settled), and only from
        pixels that were skin already, or nearly: the hair on a head seen from behind is not skin.

        Raises:
            MeasurementError: the image is not of the camera's size.
        """
        if estimate.status != "tracking":
            return
        pose = rigid(world_from_sensor)
        _check_image(image, camera)
        places = self._places(camera, pose, estimate.joints)
        focal = math.sqrt(camera.fx * camera.fy)
        inside = np.zeros(image.shape[:2], dtype=np.uint8)
        near = np.zeros(image.shape[:2], dtype=np.uint8)
        for site, (pixel, z) in places.items():
            radius = (FACE_M if site.startswith("head") else PALM_M) * focal / z
            centre = (round(pixel[0]), round(pixel[1]))
            if not (-1e4 < centre[0] < 1e4 and -1e4 < centre[1] < 1e4):
                continue
            cv2.circle(near, centre, max(round(2.5 * radius), 2), 1, -1)
            if site in self.assigned or not self.settled:
                cv2.circle(inside, centre, max(round(0.8 * radius), 1), 1, -1)
        self._pictures += 1
        if self._seen is not None:
            self._learn_static(self._seen, ~near.astype(bool), rate_hz)
        # Light does not change from picture to picture; learning is the dearest part.
        if self.settled and self._pictures % self.settings.learn_every:
            return
        known = self._colours
        colours = known[1] if known is not None and known[0] is image else Colours.of(image)
        if self.colour.learn(colours, inside.astype(bool), outside=~near.astype(bool), body=self._body):
            self._learnt += 1

    def _learn_static(self, seen: Mask, away: Mask, rate_hz: float) -> None:
        """A running mean of "skin's colour, and no head or hand near": half of it is reached after static_seconds."""
        if self._static is None or self._static.shape != seen.shape:
            self._static = np.zeros(seen.shape, dtype=np.float32)
        share = np.float32(1.0 - 0.5 ** (1.0 / (self.settings.static_seconds * rate_hz)))
        self._static += away * share * (seen - self._static)

    def _places(
        self, camera: Camera, pose: FloatArray, positions: Mapping[str, npt.NDArray[np.float64]]
    ) -> dict[str, tuple[FloatArray, float]]:
        """Pixel and depth of every site that lies in front of the camera."""
        sites = [site for site in self.settings.sites if site in positions]
        if not sites:
            return {}
        points = in_sensor(pose, [positions[site] for site in sites])
        pixels = camera.project(points)
        return {
            site: (pixel, float(point[2]))
            for site, pixel, point in zip(sites, pixels, points, strict=True)
            if np.isfinite(pixel).all() and point[2] > 0.1
        }


def candidates(skin: Mask, *, palm_px: float) -> list[Candidate]:
    """Where in a skin mask (H, W) a head or a hand may be.

    Regions with less than a fifth of a palm's area are noise. Each other one offers its middle, unless it is larger
    than four faces (a door); one that is longer than a hand also offers its tips: the middles of what lies within a
    palm's reach of the contour's farthest points.

    Args:
        skin: True where the colour is skin's.
        palm_px: radius of a palm in the image [px].
    """
    smallest = max(0.2 * math.pi * palm_px**2, 6.0)
    largest = 4.0 * math.pi * (FACE_M / PALM_M * palm_px) ** 2
    count, labels, stats, centres = cv2.connectedComponentsWithStats(skin.astype(np.uint8), connectivity=8)
    found = []
    for region in range(1, count):
        left, top, width, height, area = (int(value) for value in stats[region])
        if not smallest <= area <= largest:
            continue
        extent = math.hypot(width, height)
        middle = (float(centres[region][0]), float(centres[region][1]))
        found.append(Candidate(middle, region, area, hand=extent <= LONGEST_HAND * palm_px))
        if extent > LONGEST_HAND * palm_px:
            mask = labels[top : top + height, left : left + width] == region
            for u, v in _tips(mask, palm_px):
                found.append(Candidate((u + left, v + top), region, area))
    return found


def _tips(mask: Mask, palm_px: float) -> list[tuple[float, float]]:
    """Middles of the parts of a region around its tips, farthest first, at most four."""
    contours, _ = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    outline = max(contours, key=len).reshape(-1, 2).astype(np.float64)
    rows, columns = np.nonzero(mask)
    pixels = np.column_stack([columns, rows]).astype(np.float64)
    distance = np.linalg.norm(outline - pixels.mean(axis=0), axis=1)
    # A tip is farther out than all of the contour around it.
    peak = distance >= maximum_filter1d(distance, 2 * round(2.5 * palm_px) + 1, mode="wrap")
    tips: list[tuple[float, float]] = []
    taken: list[FloatArray] = []
    for index in np.argsort(-distance, kind="stable"):
        if len(tips) == 4 or distance[index] < 1.5 * palm_px:
            break
        tip = outline[index]
        if not peak[index] or any(float(np.linalg.norm(tip - other)) < 3.0 * palm_px for other in taken):
            continue
        taken.append(tip)
        near = pixels[np.linalg.norm(pixels - tip, axis=1) < 3.2 * palm_px]
        u, v = near.mean(axis=0)
        tips.append((float(u), float(v)))
    return tips


def _check_image(image: ByteImage, camera: Camera) -> None:
    if image.shape != (camera.height, camera.width, 3) or image.dtype != np.uint8:
        raise MeasurementError(
            f"image: expected uint8 of shape {(camera.height, camera.width, 3)}, found {image.dtype} of {image.shape}"
        )
