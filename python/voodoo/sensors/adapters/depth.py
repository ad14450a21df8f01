"""Depth images as inputs; each pixel may be a point on the body."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo._core import Frame
from voodoo.drawing.surfaces import Log, every, grown
from voodoo.measurements import DepthImage
from voodoo.sensors.adapters.base import Adapter, Context, Memory
from voodoo.sensors.settings import FrontEndSettings


class DepthAdapter(Adapter[DepthImage]):
    """Depth images."""

    kind = "depth"
    measurement = DepthImage
    measured = "image"
    panel = 0
    while_searching = True

    def ready(self, item: DepthImage, settings: FrontEndSettings) -> DepthImage:
        """Without the pixels that the settings remove."""
        return settings.filtered(item)

    def add(self, frame: Frame, item: DepthImage, context: Context) -> None:
        """As a depth image, weighted for the distance of the body."""
        chosen = context.settings
        frame.add_depth(
            item.image,
            camera=item.camera,
            meters_per_unit=item.meters_per_unit,
            world_from_sensor=item.root_from_sensor,
            weight=context.range_weight(chosen.depth_noise, chosen.sharing, item.root_from_sensor),
            source=item.sensor,
        )

    def picture(self, item: DepthImage) -> npt.NDArray[Any]:
        """Depths [m]."""
        return item.image.astype(np.float32) * item.meters_per_unit

    def log(self, item: DepthImage, log: Log, memory: Memory) -> None:
        """The image, its points colored by limb, and the person's silhouette."""
        rr, path = log.rr, log.camera(item)
        log.depth(f"{path}/picture", item.image, item.meters_per_unit)
        # Of a large image every n-th row and column.
        step = every(item.image.size, log.most_points)
        z = item.image[::step, ::step].astype(np.float32) * np.float32(item.meters_per_unit)
        valid = np.isfinite(z) & (z > 0.0)
        points = np.column_stack([item.camera.rays()[::step, ::step][valid] * z[valid, None], z[valid]])
        # The background is already visible in the depth image, which is shown in 3-D as well.
        cloud = f"world/points/{log.entity(item.sensor)}"
        limbs = log.body_points(cloud, points, item.root_from_sensor, background=False)
        log.silhouettes(path, item)
        silhouette = np.zeros(z.shape, dtype=np.uint8)
        silhouette[valid] = np.where(limbs == log.limbs, 0, limbs + 1)
        whole = grown(silhouette, step, item.image.shape)
        log.send(f"{path}/picture/silhouette", rr.SegmentationImage(whole, opacity=0.5))
