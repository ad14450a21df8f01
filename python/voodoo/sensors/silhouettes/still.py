"""Masks of the person before a still scene, for voodoo.ik: in depth images, pixels connected to known sites and pixels in front
of the scene near them; in color images, differences from the background, even if the person never leaves the place."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import ByteImage, DepthImage, FloatArray
from voodoo.model.projection import CameraView
from voodoo.sensors.depth import depth_points
from voodoo.sensors.silhouettes.masks import Mask, filled, known_places, without_specks

_STEP = 0.03
"""Two neighbors whose depths differ by more than this fraction lie on different objects."""
_FLOOR_M = 0.05
_IN_FRONT_M, _BEHIND_M = 0.30, 0.05
"""Range of depths around a known site that belong to the person; the surface lies in front of the joints."""
_REACH_M = 0.6
"""No elbow or knee is farther from a known shoulder, hand, hip or ankle, girth included."""
_BEFORE = (0.04, 0.012)
"""An object in front of the scene is nearer by at least this: meters, and a fraction of the depth (three standard deviations of
a structured-light camera at 4 m)."""
_SPECK_PX = 30


class StillScene:
    """The scene of a static depth camera without the person: the farthest depth measured in each pixel."""

    def __init__(self, images: Sequence[DepthImage]) -> None:
        """Learn the scene from images spread over a recording, some tens.

        Raises:
            MeasurementError: no image, or images of different sizes.
        """
        if not images or len({image.image.shape for image in images}) != 1:
            raise MeasurementError(f"images: expected some of one size, found {len(images)}")
        depths = np.sort(np.stack([image.meters() for image in images]), axis=0)  # NaN comes last
        last = np.isfinite(depths).sum(axis=0)[None] - 1
        # The second-farthest depth, since the farthest may be an outlier; then the median of all depths near it.
        deep = np.take_along_axis(depths, np.maximum(last - 1, 0), axis=0)
        with np.errstate(invalid="ignore"):
            first = (depths < _nearest_of(deep)).sum(axis=0)[None]
        self._depth = np.take_along_axis(depths, np.maximum((first + last) // 2, 0), axis=0)[0]

    def before(self, z: FloatArray) -> Mask:
        """Where depths (height, width) [m] lie before the scene.

        Raises:
            MeasurementError: another size.
        """
        if z.shape != self._depth.shape:
            raise MeasurementError(f"depth: expected shape {self._depth.shape} as learned, found {z.shape}")
        with np.errstate(invalid="ignore"):
            return np.asarray(z < _nearest_of(self._depth), dtype=bool)


def from_depth(
    depth: DepthImage, known: Mapping[str, FloatArray], *, scene: StillScene | None = None, level: bool = True
) -> Mask:
    """Mask of the person in a depth image: all pixels connected in depth with a known site.

    With `scene`, pixels in front of it within 0.6 m of a known site are added, so that a leg behind the other one is included,
    and pixels of the scene farther from all known sites are removed, in case the person touches it.

    Args:
        depth: the image.
        known: positions (3,) [m] of the person's known sites in the root frame.
        scene: the still scene behind the person.
        level: z is up and 0 on the floor in the root frame, so that points lower than 5 cm are floor.

    Returns:
        (height, width); all false if no known site is visible.

    Raises:
        MeasurementError: a position is not three finite numbers, or the scene has another size.
    """
    height, width = depth.image.shape
    places = known_places(known)
    points, valid = depth_points(depth)
    solid = valid.copy()
    solid[valid] = points[:, 2] > _FLOOR_M if level else True
    z = np.where(solid.reshape(height, width), depth.meters(), np.nan)
    view = CameraView(depth.camera, depth.root_from_sensor)
    seeds = []
    for place in places.values():
        pixel, distance = view.project(place[None])
        if not np.isfinite(pixel).all():
            continue
        u, v = np.rint(pixel[0]).astype(int)
        if 0 <= u < width and 0 <= v < height and distance[0] - _IN_FRONT_M <= z[v, u] <= distance[0] + _BEHIND_M:
            seeds.append((int(u), int(v)))
    mask = _connected(z, seeds)
    if scene is not None and seeds:
        before = scene.before(z)
        near = valid.copy()
        near[valid] = np.any([np.square(points - place).sum(axis=1) < _REACH_M**2 for place in places.values()], axis=0)
        close = near.reshape(height, width)
        mask = (mask & (before | close)) | (before & close)
    return filled(without_specks(mask & np.isfinite(z), smallest=_SPECK_PX))


def _nearest_of(scene: FloatArray) -> FloatArray:
    """Least depths [m] of returns that belong to a scene at these depths [m]."""
    return np.asarray(scene - _BEFORE[0] - _BEFORE[1] * scene)


def _connected(z: FloatArray, seeds: Sequence[tuple[int, int]]) -> Mask:
    """Mask (height, width) of the pixels connected to the seed pixels (u, v) in a depth image (height, width) [m]."""
    height, width = z.shape
    # A relative difference of depths is an absolute difference of their logarithms.
    logarithm = np.log(np.where(np.isfinite(z), z, 1.0)).astype(np.float32)
    reached = np.zeros((height + 2, width + 2), dtype=np.uint8)
    reached[1:-1, 1:-1] = ~np.isfinite(z)
    step = float(np.log1p(_STEP))
    for u, v in seeds:
        if reached[v + 1, u + 1] == 0:
            flags = 4 | (2 << 8) | cv2.FLOODFILL_MASK_ONLY
            cv2.floodFill(logarithm, reached, (u, v), 0.0, loDiff=(step,), upDiff=(step,), flags=flags)
    return np.asarray(reached[1:-1, 1:-1] == 2, dtype=bool)


_DIFFERENT, _COLORFUL = 30.0, 8.0
"""Least difference of the foreground in any color channel, of 255; or in chroma (CIE 1976 a*, b*), which is independent of
lightness: skin in the shade is as dark as a dark floor, but redder."""
_SPECK_OF_COLOR_PX = 100
_SMOOTH_PX = 1.5
_INPAINT_PX = 5


class StillBackground:
    """The background of one static camera: the median color of each pixel over the images in which the person cannot be there.

    Pixels without such an image (`unknown`) are inpainted from their surroundings (Telea 2004).

    Args:
        pictures: some tens of images spread over a recording, (H, W, 3) BGR uint8.
        occupied: for each image, (H, W) where the person may be; None: anywhere, so that the person must be absent from every
            pixel in more than half of the images.

    Raises:
        MeasurementError: no image, images or masks of different sizes, or a person who may be everywhere in all images.
    """

    def __init__(self, pictures: Sequence[ByteImage], *, occupied: Sequence[Mask] | None = None) -> None:
        """Learn the background; see the class."""
        if not pictures:
            raise MeasurementError("pictures: expected some, found none")
        for picture in pictures:
            _check(picture, pictures[0].shape)
        if occupied is not None and [mask.shape for mask in occupied] != [picture.shape[:2] for picture in pictures]:
            raise MeasurementError(f"occupied: expected {len(pictures)} masks of the pictures' size, found others")
        stack = np.stack([_smooth(picture) for picture in pictures]).astype(np.float32)
        if occupied is not None:
            stack[np.stack(occupied)] = np.nan
        # Sorting puts NaN last, so the median of what is left is in the middle of the valid ones.
        free = np.isfinite(stack[..., 0]).sum(axis=0)
        middle = np.maximum(free - 1, 0) // 2
        median = np.take_along_axis(np.sort(stack, axis=0), middle[None, ..., None], axis=0)[0]
        self.unknown: Mask = np.asarray(free == 0, dtype=bool)
        if self.unknown.all():
            raise MeasurementError("occupied: expected pixels where the person is not in some picture, found none")
        hidden = self.unknown.astype(np.uint8)
        self._background = cv2.inpaint(np.nan_to_num(median).astype(np.uint8), hidden, _INPAINT_PX, cv2.INPAINT_TELEA)
        self._colors = _colors(np.asarray(self._background, dtype=np.uint8))
        self._shape = pictures[0].shape

    def mask(self, picture: ByteImage) -> Mask:
        """(H, W): True where the picture differs from the background.

        Raises:
            MeasurementError: another type or size than the background's.
        """
        _check(picture, self._shape)
        smooth = _smooth(picture)
        differs = cv2.absdiff(smooth, self._background).max(axis=2) > _DIFFERENT
        # The chroma threshold is low and smoothing spreads vivid colors by a pixel, so the mask is eroded.
        colorful = np.linalg.norm(_colors(smooth) - self._colors, axis=2) > _COLORFUL
        differs |= cv2.erode(colorful.astype(np.uint8), np.ones((3, 3), dtype=np.uint8)) != 0
        ellipse = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (5, 5))
        closed = cv2.morphologyEx(differs.astype(np.uint8), cv2.MORPH_CLOSE, ellipse)
        return without_specks(np.asarray(closed != 0, dtype=bool), smallest=_SPECK_OF_COLOR_PX)


def _check(image: ByteImage, shape: tuple[int, ...]) -> None:
    if image.dtype != np.uint8 or image.ndim != 3 or image.shape[2] != 3:
        raise MeasurementError(f"image: expected (H, W, 3) uint8, found {image.dtype} of {image.shape}")
    if image.shape != shape:
        raise MeasurementError(f"image: expected {shape} as before, found {image.shape}")


def _smooth(picture: ByteImage) -> ByteImage:
    return np.asarray(cv2.GaussianBlur(picture, (0, 0), _SMOOTH_PX), dtype=np.uint8)


def _colors(picture: ByteImage) -> npt.NDArray[np.float32]:
    """(H, W, 2): a* and b* of CIE 1976, without the lightness."""
    return cv2.cvtColor(picture.astype(np.float32) / np.float32(255.0), cv2.COLOR_BGR2LAB)[..., 1:]
