"""Silhouettes by region segmentation with the posed body as the shape prior (R07 section 3.1). This needs neither depth nor a
static background, but an approximate posture."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from voodoo._core import Frame
from voodoo.measurements import ColorImage
from voodoo.model.body import Body
from voodoo.model.camera import Camera
from voodoo.sensors.pinhole import Pinhole
from voodoo.sensors.silhouettes.masks import Mask, filled, without_specks
from voodoo.tracker import Tracker

LIKELY = 0.5
"""Least probability for a pixel to belong to the body."""
_SMALLEST_PX = 60
_lens_of = lru_cache(maxsize=16)(Pinhole)


class RegionSilhouettes:
    """Segments the body in color images by colors that are learned from known postures.

    Args:
        body: the body with the sizes of the postures.
    """

    def __init__(self, body: Body) -> None:
        """Start without learned colors."""
        self._tracker = Tracker(body)

    def of(
        self, pictures: Sequence[ColorImage], world_from_limb: Mapping[str, npt.ArrayLike]
    ) -> list[tuple[Mask, Camera]]:
        """Returns the mask of the body and the undistorted camera for each of several images of one instant.

        `world_from_limb` is an approximate posture: limb name -> (4, 4) in the root frame of the images. A camera's first image
        teaches its colors at that posture, which must then be accurate.

        Raises:
            VoodooError: a picture or posture that cannot be used.
        """
        if not pictures:
            return []
        found = self._tracker.segment(self._frame(pictures), world_from_limb=world_from_limb)
        masks = (without_specks(filled(found[item.sensor] > LIKELY), smallest=_SMALLEST_PX) for item in pictures)
        return [(mask, _lens_of(item.camera).camera) for mask, item in zip(masks, pictures, strict=True)]

    def learn(self, pictures: Sequence[ColorImage], world_from_limb: Mapping[str, npt.ArrayLike]) -> None:
        """Learn the colors from images of one instant with the posture of the body in them.

        Raises:
            VoodooError: a picture or posture that cannot be used.
        """
        if pictures:
            self._tracker.learn_colors(self._frame(pictures), world_from_limb=world_from_limb)

    def _frame(self, pictures: Sequence[ColorImage]) -> Frame:
        frame = Frame(pictures[0].stamp)
        for item in pictures:
            lens = _lens_of(item.camera)
            rectified = np.ascontiguousarray(lens.apply(item.image))
            frame.add_color(rectified, camera=lens.camera, world_from_sensor=item.root_from_sensor, source=item.sensor)
        return frame
