"""Silhouettes by region segmentation with the posed body as the shape prior (R07 section 3.1): neither depth nor a still
background is needed, but a posture that is near."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
"""From this likelihood on a pixel is the body's."""
_SMALLEST_PX = 60


class RegionSilhouettes:
    """What of pictures is the body, by colors that are learned where it was.

    Args:
        body: in the sizes that its postures have.
    """

    def __init__(self, body: Body) -> None:
        """Nothing is learned yet."""
        self._tracker = Tracker(body)
        self._lenses: dict[str, Pinhole] = {}

    def of(
        self, pictures: Sequence[ColorImage], world_from_limb: Mapping[str, npt.ArrayLike]
    ) -> list[tuple[Mask, Camera]]:
        """The masks of pictures of one time and the cameras without distortion that they belong to, one a picture, near a
        posture: limb name -> (4, 4) in the pictures' root frame.

        A camera that is new learns the colors at that posture, which must be right, then.

        Raises:
            VoodooError: a picture or posture that cannot be used.
        """
        if not pictures:
            return []
        found = self._tracker.segment(self._frame(pictures), world_from_limb=world_from_limb)
        masks = (without_specks(filled(found[item.sensor] > LIKELY), smallest=_SMALLEST_PX) for item in pictures)
        return [(mask, self._lenses[item.sensor].camera) for mask, item in zip(masks, pictures, strict=True)]

    def learn(self, pictures: Sequence[ColorImage], world_from_limb: Mapping[str, npt.ArrayLike]) -> None:
        """Learn the colors in pictures of one time, where the body was found in them.

        Raises:
            VoodooError: a picture or posture that cannot be used.
        """
        if pictures:
            self._tracker.learn_colors(self._frame(pictures), world_from_limb=world_from_limb)

    def _frame(self, pictures: Sequence[ColorImage]) -> Frame:
        frame = Frame(pictures[0].stamp)
        for item in pictures:
            lens = self._lenses.get(item.sensor)
            if lens is None or lens.original != item.camera:
                lens = self._lenses[item.sensor] = Pinhole(item.camera)
            frame.add_color(
                np.ascontiguousarray(lens.apply(item.image)),
                camera=lens.camera,
                world_from_sensor=item.root_from_sensor,
                source=item.sensor,
            )
        return frame
