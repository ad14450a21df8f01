"""The mesh of a limb, for viewers and files."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from voodoo._core import TaperedEllipticCylinder

_AROUND = 24


def limb_mesh(
    shape: TaperedEllipticCylinder,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Vertices (V, 3) [m] in the limb frame, triangles (T, 3) counter-clockwise from outside, and unit normals (V,
    3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_AROUND)])
    low = ring * (shape.a0, shape.b0, 0.0)
    high = ring * (shape.a1, shape.b1, 0.0) + (0.0, 0.0, shape.length)
    middles = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, shape.length]])
    # The rims are doubled: with the normals of the side, and with those of the caps.
    outward = np.vstack([ring * (shape.b0, shape.a0, 0.0), ring * (shape.b1, shape.a1, 0.0)])
    side = outward + 1e-9 * np.vstack([ring, ring])  # so that the normals of a pointed end are defined
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    vertices = np.vstack([low, high, low, high, middles])
    normals = np.vstack([side, np.tile(down, (_AROUND, 1)), np.tile(up, (_AROUND, 1)), down, up])
    here = np.arange(_AROUND)
    following = (here + 1) % _AROUND
    n = _AROUND
    corners = (
        (here, following, n + here),
        (following, n + following, n + here),
        (4 * n, 2 * n + following, 2 * n + here),
        (4 * n + 1, 3 * n + here, 3 * n + following),
    )
    triangles = np.vstack([np.column_stack(np.broadcast_arrays(*each)) for each in corners])
    return vertices.astype(np.float32), triangles.astype(np.uint32), normals.astype(np.float32)
