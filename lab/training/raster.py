"""A depth rasterizer: triangles in the camera's frame to distance along the optical axis, and who is seen."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
Indices = NDArray[np.int32]
Labels = NDArray[np.uint8]
Four = tuple[float, float, float, float]

NEAR = 0.05  # m; nearer surfaces are cut away


@njit(cache=True, fastmath=True)
def _triangle(
    ax: float, ay: float, aw: float, bx: float, by: float, bw: float, cx: float, cy: float, cw: float,
    label: int, depth: Array, labels: Labels,
) -> None:  # fmt: skip
    """Fill one projected triangle; `?w` is 1/z, which is linear in the image."""
    h, w = depth.shape
    area = (bx - ax) * (cy - ay) - (by - ay) * (cx - ax)
    if abs(area) < 1e-9:
        return
    x0 = max(0, int(np.ceil(min(ax, bx, cx))))
    x1 = min(w - 1, int(np.floor(max(ax, bx, cx))))
    y0 = max(0, int(np.ceil(min(ay, by, cy))))
    y1 = min(h - 1, int(np.floor(max(ay, by, cy))))
    inv = 1.0 / area
    for y in range(y0, y1 + 1):
        for x in range(x0, x1 + 1):
            u = ((bx - x) * (cy - y) - (by - y) * (cx - x)) * inv
            v = ((cx - x) * (ay - y) - (cy - y) * (ax - x)) * inv
            t = 1.0 - u - v
            if u >= 0.0 and v >= 0.0 and t >= 0.0:
                z = 1.0 / (u * aw + v * bw + t * cw)
                if z < depth[y, x]:
                    depth[y, x] = z
                    labels[y, x] = label


@njit(cache=True, fastmath=True)
def draw(points: Array, faces: Indices, label: int, camera: Four, closed: bool, depth: Array, labels: Labels) -> None:
    """Draw a mesh (points in meters, optical frame) into `depth` and `labels` with camera = (fx, fy, cx, cy).

    `closed` meshes have outward faces (counter-clockwise): those that look away are skipped.
    """
    fx, fy, cx, cy = camera
    poly = np.empty((4, 3))
    for i in range(faces.shape[0]):
        a, b, c = points[faces[i, 0]], points[faces[i, 1]], points[faces[i, 2]]
        if a[2] < NEAR and b[2] < NEAR and c[2] < NEAR:
            continue
        if closed:
            nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
            ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
            nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
            if nx * a[0] + ny * a[1] + nz * a[2] > 0.0:
                continue
        n = 0
        if a[2] >= NEAR and b[2] >= NEAR and c[2] >= NEAR:
            for k in range(3):
                poly[0, k], poly[1, k], poly[2, k] = a[k], b[k], c[k]
            n = 3
        else:
            for j in range(3):
                p = points[faces[i, j]]
                q = points[faces[i, (j + 1) % 3]]
                if p[2] >= NEAR:
                    for k in range(3):
                        poly[n, k] = p[k]
                    n += 1
                if (p[2] >= NEAR) != (q[2] >= NEAR):
                    s = (NEAR - p[2]) / (q[2] - p[2])
                    for k in range(3):
                        poly[n, k] = p[k] + s * (q[k] - p[k])
                    n += 1
        for j in range(1, n - 1):
            wa, wb, wc = 1.0 / poly[0, 2], 1.0 / poly[j, 2], 1.0 / poly[j + 1, 2]
            _triangle(
                fx * poly[0, 0] * wa + cx, fy * poly[0, 1] * wa + cy, wa,
                fx * poly[j, 0] * wb + cx, fy * poly[j, 1] * wb + cy, wb,
                fx * poly[j + 1, 0] * wc + cx, fy * poly[j + 1, 1] * wc + cy, wc,
                label, depth, labels,
            )  # fmt: skip


@njit(cache=True, fastmath=True)
def skin(rest: Array, bones: Indices, weights: Array, rotation: Array, shift: Array) -> Array:
    """Linear blend skinning: rest (V, 3), four bones a vertex, rotation (B, 3, 3), shift (B, 3): posed (V, 3)."""
    out = np.zeros((rest.shape[0], 3))
    for i in range(rest.shape[0]):
        x, y, z = rest[i, 0], rest[i, 1], rest[i, 2]
        for j in range(bones.shape[1]):
            w = weights[i, j]
            if w > 0.0:
                r = rotation[bones[i, j]]
                t = shift[bones[i, j]]
                for k in range(3):
                    out[i, k] += w * (r[k, 0] * x + r[k, 1] * y + r[k, 2] * z + t[k])
    return out


@njit(cache=True, fastmath=True)
def normals(points: Array, faces: Indices) -> Array:
    """Unit normals of the vertices of a mesh."""
    out = np.zeros(points.shape)
    for i in range(faces.shape[0]):
        a, b, c = points[faces[i, 0]], points[faces[i, 1]], points[faces[i, 2]]
        nx = (b[1] - a[1]) * (c[2] - a[2]) - (b[2] - a[2]) * (c[1] - a[1])
        ny = (b[2] - a[2]) * (c[0] - a[0]) - (b[0] - a[0]) * (c[2] - a[2])
        nz = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
        for j in range(3):
            k = faces[i, j]
            out[k, 0] += nx
            out[k, 1] += ny
            out[k, 2] += nz
    for i in range(points.shape[0]):
        n = np.sqrt(out[i, 0] ** 2 + out[i, 1] ** 2 + out[i, 2] ** 2) + 1e-12
        for k in range(3):
            out[i, k] /= n
    return out
