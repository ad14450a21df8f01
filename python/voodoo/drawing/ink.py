"""Common definitions for drawing: image type, colors, and pixel coordinates for OpenCV."""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
import numpy.typing as npt

Picture: TypeAlias = npt.NDArray[np.uint8]
"""(H, W, 3) BGR."""
Color: TypeAlias = tuple[int, int, int]
"""BGR."""

INK, PAPER = (250, 250, 250), (24, 20, 18)
LEFT, RIGHT, MIDDLE = (235, 170, 60), (60, 140, 250), (190, 205, 190)
"""Blue, orange, gray."""
RAY = (120, 255, 60)
SUBPIXEL = 4
"""Fractional bits of OpenCV's fixed-point pixel coordinates."""


def fixed(pixels: npt.NDArray[np.floating]) -> npt.NDArray[np.int32]:
    """Pixel coordinates as OpenCV's fixed-point numbers."""
    return np.round(pixels * (1 << SUBPIXEL)).astype(np.int32)


def point(pixel: npt.NDArray[np.floating]) -> tuple[int, int]:
    """One pixel (2,) as OpenCV's fixed-point numbers."""
    x, y = (int(value) for value in fixed(pixel))
    return x, y


def drawable(pixels: npt.NDArray[np.floating]) -> npt.NDArray[np.bool_]:
    """Which pixels (..., 2) are known, and near enough for these numbers."""
    return np.asarray((np.abs(pixels) < 1e5).all(axis=-1))


def side_color(name: str) -> Color:
    """Color by side: blue for the person's left, orange for the right, gray for the middle."""
    return LEFT if name.startswith("l_") else RIGHT if name.startswith("r_") else MIDDLE


_PERSONS: tuple[Color, ...] = (
    (80, 190, 255), (255, 170, 60), (110, 220, 90), (220, 110, 230),
    (90, 100, 250), (220, 220, 80), (140, 170, 250), (200, 140, 140),
)  # fmt: skip


def person_color(person: int) -> Color:
    """The color of a person by number, from 1; the same in all images."""
    return _PERSONS[(person - 1) % len(_PERSONS)]
