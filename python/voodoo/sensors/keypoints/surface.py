"""Depth at keypoints: the surface around a pixel, and the distance of a site behind it."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

DepthArray: TypeAlias = npt.NDArray[np.uint16] | npt.NDArray[np.float32]


EDGE_M = 0.10
"""Depths in a window that differ by more than this belong to different surfaces."""


BEHIND_SURFACE_M: dict[str, float] = {
    "head_center": 0.09, "skullbase": 0.06, "skull_tip": 0.05, "vc7": 0.06, "humanoid_root": 0.11,
    "shoulder": 0.06, "elbow": 0.04, "wrist": 0.03, "hand": 0.02, "hip": 0.09, "knee": 0.055, "ankle": 0.04,
    "toe": 0.03,
}  # fmt: skip
"""How far behind the visible surface a site lies along the ray [m]: half the depth of the limb there, for an adult
(means of ANSUR II: head breadth 0.15 and length 0.19, chest depth 0.25, knee breadth 0.11, wrist breadth 0.06...)."""


def behind_surface(site: str) -> float:
    """How far behind the visible surface a site lies [m], of either side."""
    return BEHIND_SURFACE_M[site.removeprefix("l_").removeprefix("r_")]


def window_depth(
    depth: DepthArray, pixel: tuple[float, float], *, meters_per_unit: float = 0.001, radius: int = 2
) -> float | None:
    """Depth [m] of the nearest surface around a pixel, None where fewer than a quarter of the window's pixels returned.

    The nearest surface is what lies within EDGE_M behind the window's 20 % quantile; its median is robust against
    flying pixels on either side.
    """
    u, v = round(pixel[0]), round(pixel[1])
    height, width = depth.shape
    if not (0 <= u < width and 0 <= v < height):
        return None
    window = depth[max(v - radius, 0) : v + radius + 1, max(u - radius, 0) : u + radius + 1]
    values = window.astype(np.float64).ravel() * meters_per_unit
    values = values[np.isfinite(values) & (values > 0.0)]
    if len(values) < max(window.size // 4, 1):
        return None
    near = float(np.quantile(values, 0.2, method="lower"))
    surface = values[np.abs(values - near) <= EDGE_M]
    return float(np.median(surface))
