"""Skin in color images as an input: rays of head and hands."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy.typing as npt

from voodoo._core import Estimate, Frame
from voodoo.drawing.surfaces import Canvas, Log
from voodoo.measurements import ColorImage
from voodoo.sensors.adapters.base import Adapter, Context, Memory
from voodoo.sensors.skin.tracker import SkinTracker

SKIN = (80, 255, 255)
"""Color in overlays, BGR."""


class SkinAdapter(Adapter[ColorImage]):
    """Color images; `Memory` keeps the skin tracker of each camera under "skin"."""

    kind = "skin"
    measurement = ColorImage
    measured = "image"
    colored = True
    recorded_as = "color"
    panel = 1

    def add(self, frame: Frame, item: ColorImage, context: Context) -> None:
        """As rays, moved from the picture's time to the frame's."""
        skin = context.memory.get(self.kind, item.sensor, lambda: SkinTracker(context.settings.skin))
        # The picture is older or newer than the frame: the ray is moved along with its site.
        then = context.tracker.predict(item.stamp)
        depth = next(iter(context.depth_images), None)
        # What a hand's region shows changes as the hand turns.
        is_measured = depth is not None and context.estimate.limb_status.get("head") == "measured"
        heads = {site for site in skin.settings.sites if is_measured and site.startswith("head")}
        rays = skin.observe(
            item,
            then,
            depth=depth,
            tracker=context.tracker,
            others=context.others,
            head_visible=heads,
            moved=context.predicted,
        )
        context.rays.extend(rays)

    def shares(self, item: ColorImage, persons: Mapping[int, Context]) -> Mapping[int, ColorImage]:
        """Everybody's skin is searched for in the whole image, where the settings ask for it."""
        return {number: item for number, context in persons.items() if context.settings.skin.each}

    def learn(self, item: ColorImage, estimate: Estimate, memory: Memory, *, trusted_start: bool) -> None:
        """Colors of the face."""
        skin = memory.all(self.kind).get(item.sensor)
        if skin is not None:
            # Learning from the first frame with its set pose lets a color camera alone start.
            skin.learn(item, estimate, trusted_start=trusted_start)

    def forget(self, memory: Memory) -> None:
        """Discard the learned colors, since the next person's skin has others."""
        memory.drop(self.kind)

    def picture(self, item: ColorImage) -> npt.NDArray[Any]:
        """The image."""
        return item.image

    def draw(self, item: ColorImage, canvas: Canvas, memory: Memory) -> None:
        """Outlines of all skin regions; candidates are dots, the assigned ones are named."""
        skin = memory.all(self.kind).get(item.sensor)
        if skin is not None and skin.mask.size:
            canvas.regions(item, skin.mask, marks=skin.candidates, names=skin.assigned, color=SKIN)

    def log(self, item: ColorImage, log: Log, memory: Memory) -> None:
        """The picture with the outlines of the limbs and the skin candidates."""
        rr, path = log.rr, log.camera(item)
        log.send(f"{path}/picture", rr.Image(item.image, color_model="BGR").compress(jpeg_quality=80))
        log.silhouettes(path, item)
        skin = memory.all(self.kind).get(item.sensor)
        if skin is not None:
            log.send(f"{path}/picture/skin", rr.Points2D(skin.candidates, radii=3.0, colors=(0, 255, 255)))
