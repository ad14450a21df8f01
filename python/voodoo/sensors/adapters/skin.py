"""Skin in color images as an input: rays of head and hands."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

import numpy.typing as npt

from voodoo._core import Estimate, Frame
from voodoo.measurements import ColorImage
from voodoo.sensors.adapters.base import Adapter, Context, Memory
from voodoo.sensors.adapters.drawing import Canvas, Log
from voodoo.sensors.body_view import BodyView, StillDepth, body_view
from voodoo.sensors.pixels import FloatArray
from voodoo.sensors.skin.tracker import SkinTracker

SKIN = (80, 255, 255)
"""Color in overlays, BGR."""
SCENE = "scene"
"""Name under which `Memory` keeps the still scene of a depth camera."""


class SkinAdapter(Adapter[ColorImage]):
    """Color images; `Memory` keeps the skin tracker of each camera under "skin"."""

    kind = "skin"
    measurement = ColorImage
    colored = True
    recorded_as = "color"
    panel = 1

    def content(self, item: ColorImage) -> npt.NDArray[Any]:
        """The image."""
        return item.image

    def add(self, frame: Frame, item: ColorImage, context: Context) -> None:
        """As rays, moved from the picture's time to the frame's."""
        skin = context.memory.get(self.kind, item.sensor, lambda: SkinTracker(context.settings.skin))
        # The picture is older or newer than the frame: the ray is moved along with its site.
        then = context.tracker.predict(item.stamp)
        view = _body_view(item, context, then)
        sites = skin.settings.sites if view is not None else ()
        status = context.estimate.limb_status
        rays = skin.observe(
            item.image,
            item.camera,
            item.root_from_sensor,
            then,
            stamp=item.stamp,
            body=view,
            tracker=context.tracker,
            others=context.others,
            arm_lost=_hands(status, sites, "forearm", measured=False),
            upper_arm_visible=_hands(status, sites, "upperarm", measured=True),
            head_visible=_heads(status, sites),
            source=item.sensor,
            moved=context.predicted,
        )
        context.rays.extend(rays)

    def shares(self, item: ColorImage, persons: Mapping[int, Context]) -> Mapping[int, ColorImage]:
        """Everybody's skin is searched for in the whole image, where the settings ask for it."""
        return {number: item for number, context in persons.items() if context.settings.skin.each}

    def learn(self, item: ColorImage, estimate: Estimate, memory: Memory, *, trusted_start: bool) -> None:
        """Colors and background of the picture."""
        skin = memory.all(self.kind).get(item.sensor)
        if skin is not None:
            # Learning from the first frame with its set pose lets a color camera alone start.
            skin.learn(item.image, item.camera, item.root_from_sensor, estimate, trusted_start=trusted_start)

    def forget(self, memory: Memory) -> None:
        """Discard the learned colors, since the next person's skin has others."""
        memory.drop(self.kind)

    def picture(self, item: ColorImage) -> npt.NDArray[Any]:
        """The image."""
        return item.image

    def draw(self, item: ColorImage, canvas: Canvas, memory: Memory) -> None:
        """Outlines of all skin regions; candidates are dots, the assigned ones are named."""
        skin = memory.all(self.kind).get(item.sensor)
        if skin is not None and skin.mask is not None:
            canvas.regions(
                item,
                skin.mask,
                marks=[candidate.pixel for candidate in skin.candidates],
                names={site: candidate.pixel for site, candidate in skin.assigned.items()},
                color=SKIN,
            )

    def log(self, item: ColorImage, log: Log, memory: Memory) -> None:
        """The picture with the outlines of the limbs and the skin candidates."""
        rr, path = log.rr, log.camera(item)
        log.send(f"{path}/picture", rr.Image(item.image, color_model="BGR").compress(jpeg_quality=80))
        log.silhouettes(path, item)
        skin = memory.all(self.kind).get(item.sensor)
        if skin is not None:
            places = [candidate.pixel for candidate in skin.candidates]
            log.send(f"{path}/picture/skin", rr.Points2D(places, radii=3.0, colors=(0, 255, 255)))


def _body_view(item: ColorImage, context: Context, predicted: Mapping[str, FloatArray]) -> BodyView | None:
    """The depth measurements of the frame's first depth camera, registered to this image; None without one."""
    depth = next(iter(context.depth_images), None)
    if depth is None:
        return None
    return body_view(
        depth.image,
        depth_camera=depth.camera,
        world_from_depth=depth.root_from_sensor,
        meters_per_unit=depth.meters_per_unit,
        color_camera=item.camera,
        world_from_color=item.root_from_sensor,
        joints=list(predicted.values()),
        step=max(depth.camera.width // 200, 1),
        scene=context.memory.get(SCENE, depth.sensor, StillDepth),
    )


def _hands(status: Mapping[str, str], sites: Iterable[str], limb: str, *, measured: bool) -> set[str]:
    """Hands whose forearm or upper arm was, or was not, measured in the last frame, by the status of limbs."""
    known = {site: status.get(f"{site[:2]}{limb}") for site in sites}
    return {site for site, value in known.items() if value is not None and (value == "measured") == measured}


def _heads(status: Mapping[str, str], sites: Iterable[str]) -> set[str]:
    """Sites of the head, if it was measured in the last frame; what a hand's region shows changes as the hand turns."""
    measured = status.get("head") == "measured"
    return {site for site in sites if measured and site.startswith("head")}
