"""What depth cameras make of a true depth image: time of flight, structured light, stereo, or a mask of the user."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit
from numpy.typing import NDArray

Array = NDArray[np.float64]
FAR = 30.0  # m; nothing is farther


@dataclass(frozen=True)
class Sensor:
    """One draw of a camera: image size, horizontal field of view (radians), kind of noise, range (m), step (m)."""

    width: int
    height: int
    hfov: float
    kind: str
    reach: float
    step: float
    user_mask: bool

    @property
    def vfov(self) -> float:
        """Vertical field of view, radians."""
        return float(2 * np.arctan(np.tan(self.hfov / 2) * self.height / self.width))

    @property
    def intrinsics(self) -> tuple[float, float, float, float]:
        """fx, fy, cx, cy in pixels."""
        f = 0.5 * self.width / np.tan(0.5 * self.hfov)
        return f, f, 0.5 * (self.width - 1), 0.5 * (self.height - 1)


def draw_sensor(rng: np.random.Generator) -> Sensor:
    """A Kinect (with or without its mask of the user), a RealSense, a time-of-flight camera or an L515."""
    x, fov = rng.random(), np.deg2rad(rng.uniform(45, 75))
    step = rng.uniform(0.001, 0.005)
    if x < 0.22:
        return Sensor(320, 240, np.deg2rad(rng.normal(58.5, 0.7)), "light", 8.0, 0.001, True)
    if x < 0.37:
        return Sensor(320, 240, np.deg2rad(rng.normal(58.5, 0.7)), "light", 8.0, 0.001, False)
    if x < 0.62:
        w, h = ((320, 240), (240, 180), (320, 180), (212, 120))[rng.integers(4)]
        return Sensor(w, h, np.deg2rad(rng.uniform(55, 88)), "stereo", rng.uniform(5, 10), step, False)
    w, h = ((160, 120), (224, 172), (240, 180), (320, 240), (256, 192))[rng.integers(5)]
    return Sensor(w, h, fov, "flight", rng.uniform(4, 9), step, rng.random() < 0.05)


@njit(cache=True)
def _shadow(depth: Array, baseline_px: float) -> NDArray[np.bool_]:
    """Pixels that the projector beside the camera does not light; `baseline_px` = focal length x baseline."""
    h, w = depth.shape
    dark = np.zeros((h, w), np.bool_)
    for y in range(h):
        most = -1e9
        for x in range(w):  # the projector lies to the right: what is near hides what lies to its left
            xx = w - 1 - x
            z = depth[y, xx]
            if z <= 0:
                continue
            u = baseline_px / z - xx
            if u < most - 0.6:
                dark[y, xx] = True
            elif u > most:
                most = u
    return dark


def _smooth(rng: np.random.Generator, shape: tuple[int, int], cell: int) -> Array:
    """Noise of unit size with a grain of `cell` pixels."""
    h, w = shape
    grid = rng.normal(0, 1, (h // cell + 2, w // cell + 2))
    y, x = np.arange(h) / cell, np.arange(w) / cell
    i, j = y.astype(int), x.astype(int)
    a, b = (y - i)[:, None], (x - j)[None]
    rows = grid[i] * (1 - a) + grid[i + 1] * a
    return (rows[:, j] * (1 - b) + rows[:, j + 1] * b) * 1.4


def edges(depth: Array, step: float = 0.08) -> NDArray[np.bool_]:
    """Pixels beside a jump in depth."""
    out = np.zeros(depth.shape, bool)
    dx, dy = np.abs(np.diff(depth, axis=1)) > step, np.abs(np.diff(depth, axis=0)) > step
    out[:, 1:] |= dx
    out[:, :-1] |= dx
    out[1:] |= dy
    out[:-1] |= dy
    return out


def grazing(depth: Array, focal: float) -> Array:
    """About the cosine of the angle between a pixel's ray and its surface's normal."""
    dy, dx = np.gradient(depth)
    return 1 / np.sqrt(1 + (np.hypot(dx, dy) * focal / depth) ** 2)


def sense(
    rng: np.random.Generator, sensor: Sensor, true: Array, labels: NDArray[np.uint8]
) -> tuple[Array, NDArray[np.uint8]]:
    """The image that a sensor gives (m, 0 where it saw nothing), and the labels of the surfaces at its pixels."""
    depth, labels = true.copy(), labels.copy()
    h, w = depth.shape
    border = edges(depth)
    if rng.random() < 0.7:  # ragged borders: a pixel near one takes a neighbor's depth
        y, x = np.nonzero(border & (rng.random(depth.shape) < rng.uniform(0.1, 0.6)))
        yy, xx = np.clip(y + rng.integers(-1, 2, len(y)), 0, h - 1), np.clip(x + rng.integers(-1, 2, len(x)), 0, w - 1)
        depth[y, x], labels[y, x] = true[yy, xx], labels[yy, xx]
    lost = depth > sensor.reach
    gain = rng.uniform(0.3, 1.5)
    f = sensor.intrinsics[0]
    if sensor.kind == "light":
        disparity = f * 0.075 / depth
        disparity += 0.06 * gain * _smooth(rng, depth.shape, 2) * (f / 290)
        depth = f * 0.075 / np.maximum(np.round(disparity * 16 * 290 / f) / (16 * 290 / f), 1e-3)
        lost |= _shadow(true, f * 0.075)
        lost |= border & (rng.random(depth.shape) < rng.uniform(0, 0.4))
    elif sensor.kind == "stereo":
        wobble = 0.6 * _smooth(rng, depth.shape, 3) + 0.8 * _smooth(rng, depth.shape, int(rng.integers(5, 14)))
        depth = depth + 0.004 * gain * depth**2 * wobble * 0.7
        lost |= _smooth(rng, depth.shape, int(rng.integers(6, 16))) > rng.uniform(1.6, 4)
        lost |= border & (rng.random(depth.shape) < rng.uniform(0.0, 0.5))
    else:
        depth = depth + rng.normal(0, 1, depth.shape) * (0.003 + 0.0015 * depth) * gain * rng.choice([1.0, 2.0])
        lost |= grazing(true, f) < rng.choice([0.0, 0.08, 0.2])
        y, x = np.nonzero(border & (rng.random(depth.shape) < rng.uniform(0, 0.65)))
        other = true[
            np.clip(y + rng.integers(-1, 2, len(y)), 0, h - 1), np.clip(x + rng.integers(-1, 2, len(x)), 0, w - 1)
        ]
        t = rng.random(len(y))
        depth[y, x] = (1 - t) * depth[y, x] + t * np.minimum(other, depth[y, x] + 2)  # flying pixels
    if rng.random() < 0.3:
        depth = depth * (1 + rng.normal(0, 0.006))
    lost |= rng.random(depth.shape) < rng.choice([0, 0.002, 0.02, 0.08])
    if rng.random() < 0.25:  # dark or shiny stuff
        lost |= _smooth(rng, depth.shape, int(rng.integers(8, 30))) > rng.uniform(1.8, 3)
    if sensor.step > 0:
        depth = np.round(depth / sensor.step) * sensor.step
    depth[lost | (depth < 0.2) | (true >= FAR)] = 0
    labels[depth == 0] = 0
    return depth, labels


def speckled(rng: np.random.Generator, depth: Array, floor: NDArray[np.bool_]) -> Array:
    """A depth image whose floor comes back in specks, some at wrong depths."""
    out, grain = depth.copy(), _smooth(rng, depth.shape, int(rng.integers(1, 5)))
    out[floor & (grain > rng.uniform(-0.8, 1.0))] = 0
    wrong = floor & (out > 0) & (rng.random(depth.shape) < rng.uniform(0, 0.5))
    out[wrong] *= 1 + rng.normal(0, rng.uniform(0.01, 0.05), int(wrong.sum()))
    return out


def user_mask(rng: np.random.Generator, depth: Array, labels: NDArray[np.uint8], height: Array) -> Array:
    """A depth image cut to the person by a sensor's own mask, with its mistakes; `height` above the floor, m."""
    keep = labels > 0
    if rng.random() < 0.35:  # the floor about the feet stays
        y, x = np.nonzero(keep)
        if len(y):
            near = np.zeros(keep.shape, bool)
            r = int(rng.integers(2, 25))
            near[max(0, y.max() - 2 * r) : y.max() + r, max(0, x.min() - r) : x.max() + r] = True
            keep |= near & (np.abs(height) < 0.03) & (depth > 0)
    if rng.random() < 0.3:  # what the person touches stays, in part
        grown = keep.copy()
        for _ in range(int(rng.integers(2, 14))):
            g = grown.copy()
            g[1:] |= grown[:-1] & (np.abs(np.diff(depth, axis=0)) < 0.06)
            g[:-1] |= grown[1:] & (np.abs(np.diff(depth, axis=0)) < 0.06)
            g[:, 1:] |= grown[:, :-1] & (np.abs(np.diff(depth, axis=1)) < 0.06)
            g[:, :-1] |= grown[:, 1:] & (np.abs(np.diff(depth, axis=1)) < 0.06)
            grown = g & (depth > 0)
        keep = grown
    if rng.random() < 0.3:  # the floor is cut away in blocks, with parts of the feet
        rows, columns = (-(-n // 8) for n in keep.shape)
        blocks = np.kron(rng.random((rows, columns)) < 0.5, np.ones((8, 8), bool))[: keep.shape[0], : keep.shape[1]]
        keep &= ~(blocks & (height < rng.uniform(0.03, 0.12)))
    if rng.random() < 0.4:  # a border of a pixel is lost
        keep[1:] &= keep[:-1]
        keep[:, 1:] &= keep[:, :-1]
    return np.where(keep, depth, 0.0)
