"""The four real cameras of Pose2Sim's balancing trial for ik_tables.py: silhouettes by background subtraction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from ik_limbs import LIMBS, Truth, follow, limb_lengths

import voodoo
from voodoo import ik
from voodoo.markers import Z_UP_FROM_Y_UP, read_trc
from voodoo.recordings.pose2sim import SITES
from voodoo.sensors.background import StillBackground
from voodoo.silhouettes import surroundings

SCALE = 0.25
LEARN_EVERY = 2


@dataclass
class Trial:
    """The published triangulation, and of each camera its silhouettes (F) and its pose (4, 4)."""

    truth: Truth
    height: float
    views: dict[str, tuple[list[ik.Silhouette], np.ndarray]]

    def solve(self, cameras: Sequence[str]) -> dict[str, np.ndarray]:
        """Positions (F, 3) of elbows and knees with the silhouettes of some cameras."""

        def silhouettes(frame: int, last: Mapping[str, np.ndarray]) -> list[ik.Silhouette]:
            return [self.views[camera][0][frame] for camera in cameras]

        return follow(self.truth, self.height, silhouettes if cameras else None)


def four_cameras(path: Path) -> Trial:
    recording = voodoo.open_recording(path)
    names, positions = read_trc(next(path.glob("*_butterworth.trc")), world_from_file=Z_UP_FROM_Y_UP).of(SITES)
    truth = {name: positions[:, i] for i, name in enumerate(names)}
    height = stature(truth)
    views = {}
    for placed, video in zip(recording.cameras, sorted((path / "videos").glob("*.mp4")), strict=True):
        pictures, camera = read(video, placed.camera)
        known = [name for name in truth if name not in LIMBS]
        there = [
            surroundings({name: truth[name][frame] for name in known}, camera, placed.world_from_sensor, height=height)
            for frame in range(len(pictures))
        ]
        background = StillBackground(pictures[::LEARN_EVERY], occupied=there[::LEARN_EVERY])
        masks = [background.mask(picture) & near for picture, near in zip(pictures, there, strict=True)]
        outlines = [ik.Silhouette(mask, camera=camera, world_from_camera=placed.world_from_sensor) for mask in masks]
        views[placed.name] = (outlines, placed.world_from_sensor)
    return Trial(truth, height, views)


def read(video: Path, camera: voodoo.Camera) -> tuple[list[np.ndarray], voodoo.Camera]:
    """All pictures, a quarter as large, and their camera."""
    capture, pictures = cv2.VideoCapture(str(video)), []
    while (found := capture.read())[0]:
        pictures.append(cv2.resize(found[1], None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_AREA))
    height, width = pictures[0].shape[:2]
    # Integer coordinates are pixel centres.
    cx, cy = (SCALE * (value + 0.5) - 0.5 for value in (camera.cx, camera.cy))
    return pictures, voodoo.Camera(width, height, SCALE * camera.fx, SCALE * camera.fy, cx, cy, camera.distortion)


def stature(truth: Truth) -> float:
    """Height [m] of a person with these legs, see Winter's share in voodoo.silhouettes."""
    lengths = limb_lengths(truth)
    return float(np.mean([np.median(lengths[f"{s}_knee"].sum(axis=1)) for s in "lr"]) / 0.491)
