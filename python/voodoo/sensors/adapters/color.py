"""Colour regions of pictures as an input: where the colours of a limb end, its contour is."""

from __future__ import annotations

from typing import Any

import numpy.typing as npt

from voodoo._core import Frame
from voodoo.measurements import ColorImage
from voodoo.sensors.adapters.base import Adapter, Context
from voodoo.sensors.pinhole import Pinhole


class ColorAdapter(Adapter[ColorImage]):
    """Pictures as they are; `Memory` keeps the lens of each camera under "color"."""

    kind = "color"
    measurement = ColorImage

    def content(self, item: ColorImage) -> npt.NDArray[Any]:
        """The image."""
        return item.image

    def add(self, frame: Frame, item: ColorImage, context: Context) -> None:
        """As a picture of a pinhole camera, with its own stamp."""
        lens = context.memory.all(self.kind).get(item.sensor)
        if lens is None or lens.original != item.camera:
            lens = Pinhole(item.camera)
            context.memory.put(self.kind, item.sensor, lens)
        frame.add_color(
            lens.apply(item.image),
            camera=lens.camera,
            world_from_sensor=item.root_from_sensor,
        )
