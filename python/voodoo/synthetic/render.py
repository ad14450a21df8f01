"""Renders the depth image of a posed body."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.model.body import Body, ordered_poses
from voodoo.model.camera import Camera


@dataclass(frozen=True, eq=False, repr=False)
class RenderedDepth:
    """A predicted depth image.

    Attributes:
        depth: (height, width) float32, along the optical axis [m]; 0 without a limb.
        limb: (height, width) int16, index into `limb_names` of the visible limb; -1 without one.
        limb_names: names of the body's limbs.
    """

    depth: npt.NDArray[np.float32]
    limb: npt.NDArray[np.int16]
    limb_names: tuple[str, ...]

    def __repr__(self) -> str:
        """Size, number of pixels of the body, and of visible limbs."""
        observed = self.limb[self.limb >= 0]
        height, width = self.depth.shape
        return f"RenderedDepth({width}x{height}, {observed.size} pixels of {len(np.unique(observed))} limbs)"


def render_depth(
    body: Body,
    world_from_limb: Mapping[str, npt.ArrayLike],
    *,
    camera: Camera,
    world_from_sensor: npt.ArrayLike | None = None,
) -> RenderedDepth:
    """Render the depth image of a body: for every pixel the nearest limb on its ray.

    Args:
        body: its shapes; `tracker.body` has the current sizes.
        world_from_limb: pose of every limb, rigid (4, 4), as in `Estimate.world_from_limb`.
        camera: calibration; lens distortion is taken into account.
        world_from_sensor: pose of the camera's optical frame, rigid (4, 4); identity by default.

    Raises:
        BodyError: a limb is missing or unknown.
        MeasurementError: a matrix is not rigid.
    """
    poses = ordered_poses(body, world_from_limb)
    depth, limb = _core.render_depth(body.core, poses, camera=camera, world_from_sensor=world_from_sensor)
    return RenderedDepth(depth, limb, body.limb_names)
