"""Color regions of images as an input: the contour of a limb lies where its colors end."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np

from voodoo._core import Frame
from voodoo.drawing.surfaces import Canvas
from voodoo.measurements import ByteImage, ColorImage
from voodoo.recordings.together import FARTHEST_S
from voodoo.sensors.adapters.base import Adapter, Context, Memory
from voodoo.sensors.pinhole import Pinhole
from voodoo.sensors.silhouettes.regions import LIKELY
from voodoo.tracker import Tracker

_INK = (90, 240, 250)
_GRAY = 2
"""Greatest difference between the channels of a gray camera's image, from compression."""


@dataclass(frozen=True, eq=False)
class _Known:
    """State of a camera: its lens, whether it is a gray camera, the tracker that has its empty scene, and whether its regions
    are drawn."""

    lens: Pinhole
    gray: bool
    tracker: Tracker
    drawn: bool

    def picture(self, image: ByteImage) -> ByteImage:
        """Converts an image (H, W, 3) for the tracker: undistorted, and (H, W) for a gray camera."""
        observed = self.lens.apply(image)
        return np.ascontiguousarray(observed[:, :, 1]) if self.gray else observed

    def add(self, frame: Frame, item: ColorImage) -> None:
        """Add an image with its own stamp."""
        place: dict[str, Any] = {"camera": self.lens.camera, "world_from_sensor": item.root_from_sensor}
        frame.add_color(self.picture(item.image), **place, stamp=item.stamp, source=item.sensor)


class ColorAdapter(Adapter[ColorImage]):
    """Pictures as a pinhole camera would have taken them; `Memory` keeps what is known of each camera under "color"."""

    kind = "color"
    measurement = ColorImage
    measured = "image"
    colored = True

    def add(self, frame: Frame, item: ColorImage, context: Context) -> None:
        """As a picture with its own stamp; the first one of a camera after pictures of the empty scene, if there are some."""
        if not isinstance(context.tracker, Tracker) or abs(item.stamp - context.stamp) > FARTHEST_S:
            return
        known = context.memory.all(self.kind).get(item.sensor)
        if known is None or known.lens.original != item.camera or known.tracker is not context.tracker:
            drawn = context.settings.draw_regions
            gray = bool((np.ptp(item.image, axis=2) <= _GRAY).all())
            known = _Known(Pinhole(item.camera), gray, context.tracker, drawn)
            empty = context.settings.empty_scene.get(item.sensor)
            if empty is not None:
                context.tracker.set_background(item.sensor, [known.picture(picture) for picture in empty])
            context.memory.put(self.kind, item.sensor, known)
        known.add(frame, item)

    def shares(self, item: ColorImage, persons: Mapping[int, Context]) -> Mapping[int, ColorImage]:
        """Color regions are those of a single person."""
        return {}

    def draw(self, item: ColorImage, canvas: Canvas, memory: Memory) -> None:
        """The border of what is the body by its colors, and the edges along its contour, where the settings ask for it."""
        known = memory.all(self.kind).get(item.sensor)
        if known is None or not known.drawn or known.lens.original != item.camera or not known.tracker.estimate.joints:
            return
        lines = known.tracker.region_lines(item.sensor)
        finite = np.isfinite(lines.sigmas)
        edges = (lines.places + lines.offsets[:, None] * lines.normals)[finite]
        frame = Frame(item.stamp)
        known.add(frame, item)
        likely = known.tracker.segment(frame)[item.sensor]
        size = (item.camera.width, item.camera.height)
        mask = cv2.resize((likely > LIKELY).astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
        scale = np.array(size) / (known.lens.camera.width, known.lens.camera.height)
        marks = [(float(u), float(v)) for u, v in (edges + 0.5) * scale - 0.5]
        canvas.regions(item, mask, marks=marks, names={}, color=_INK)
