"""The four real cameras of Pose2Sim's balancing trial for ik_tables.py: silhouettes by background subtraction."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from ik_keypoints import Keypoints, keypoints
from ik_limbs import LIMBS, Truth, follow, limb_lengths, steady

import voodoo
from voodoo import ik
from voodoo.model.projection import CameraView
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_trc
from voodoo.recordings.pose2sim import SITES
from voodoo.sensors.silhouettes.masks import filled, surroundings
from voodoo.sensors.silhouettes.still import StillBackground

SCALE = 0.25
LEARN_EVERY = 2
AGREES_PX = 15.0
"""Pose2Sim leaves a camera out of its triangulation that is farther off by default."""
CORNERS = ("l_shoulder", "r_shoulder", "l_hip", "r_hip")


@dataclass
class Trial:
    """The published triangulation, the chains of constant limbs nearest to it, and of each camera its silhouettes (F) and its
    pose (4, 4), the 2-D keypoints, and how far those of the known sites lie from the triangulation as it sees it: offsets
    (N, 2), pixels."""

    truth: Truth
    steady: Truth
    height: float
    views: dict[str, tuple[list[ik.Silhouette], np.ndarray]]
    keypoints: Keypoints
    offsets: dict[str, np.ndarray]

    @property
    def apart(self) -> dict[str, float]:
        """Camera -> median length of the offsets [px]."""
        return {name: float(np.median(np.linalg.norm(offset, axis=1))) for name, offset in self.offsets.items()}

    def border(self, camera: str) -> float:
        """How far an outline is from where it should be in the smaller pictures [px]: a pixel of its own, and what the
        calibration is off across a limb, the median of the offsets along either axis."""
        return 1.0 + SCALE * float(np.median(np.abs(self.offsets[camera])))

    def best(self, count: int) -> tuple[str, ...]:
        """So many cameras, chosen before anything is estimated: one is that which agrees best with the known sites. Several
        are those by which a point amid these sites is known best, if each is off by as much as it is there: cameras that agree
        and look from directions that complement each other."""
        if count == 1:
            return (min(self.apart, key=lambda name: self.apart[name]),)
        return min(combinations(self.views, count), key=self._uncertainty)

    def _uncertainty(self, cameras: Sequence[str]) -> float:
        """Standard deviation [m] of a point amid the known sites, from pixels off by `apart` along both axes."""
        middle = np.mean([places for name, places in self.truth.items() if name not in LIMBS], axis=(0, 1))
        information = np.zeros((3, 3))
        for name in cameras:
            view = self.keypoints.views[name]
            way = middle - view.root_from_sensor[:3, 3]
            distance = float(np.linalg.norm(way))
            sigma = self.apart[name] * distance / view.camera.fx
            information += (np.eye(3) - np.outer(way, way) / distance**2) / sigma**2
        return float(np.sqrt(np.trace(np.linalg.inv(information))))

    @property
    def agreeing(self) -> tuple[str, ...]:
        """The cameras whose calibration agrees with the triangulation."""
        return tuple(name for name, pixels in self.apart.items() if pixels < AGREES_PX)

    def solve(self, cameras: Sequence[str], truth: Truth, **options: Any) -> dict[str, np.ndarray]:
        """Positions (F, 3) of elbows and knees with the silhouettes of some cameras, known sites as in `truth`."""

        def silhouettes(frame: int, last: Mapping[str, np.ndarray]) -> list[ik.Silhouette]:
            return [self.views[camera][0][frame] for camera in cameras]

        return follow(truth, self.height, silhouettes if cameras else None, **options)


def four_cameras(path: Path) -> Trial:
    recording = voodoo.open_recording(path)
    names, positions = read_trc(next(path.glob("*_butterworth.trc"))).of(SITES)
    truth = {name: positions[:, i] @ Z_UP_FROM_Y_UP.T for i, name in enumerate(names)}
    pictures = {
        placed.name: (*read(video, placed.camera), placed.world_from_sensor)
        for placed, video in zip(recording.cameras, sorted((path / "videos").glob("*.mp4")), strict=True)
    }
    visible_in = keypoints(recording, names)
    trial = Trial(truth, steady(truth), stature(truth), {}, visible_in, visible_in.offsets(truth))
    known = {name: places for name, places in truth.items() if name not in LIMBS}
    # Twice: elbows and knees found with the first silhouettes tell better where the person is not, hence the background.
    for _ in range(2):
        trial.views = {
            name: (cut_out(*views, known, trial.height, trial.border(name)), views[2])
            for name, views in pictures.items()
        }
        known = {**known, **trial.solve(trial.agreeing, truth)}
    return trial


def cut_out(
    pictures: Sequence[np.ndarray], camera: voodoo.Camera, pose: np.ndarray, known: Truth, height: float, border: float
) -> list[ik.Silhouette]:
    """The person in all pictures of a camera: what differs from the background near the known sites, and the trunk."""
    frames = range(len(pictures))
    sites = [{name: places[frame] for name, places in known.items()} for frame in frames]
    there = [surroundings(places, camera, pose, height=height) for places in sites]
    background = StillBackground(pictures[::LEARN_EVERY], occupied=there[::LEARN_EVERY])
    silhouettes = []
    for picture, near, places in zip(pictures, there, sites, strict=True):
        trunk = np.zeros(near.shape, dtype=np.uint8)
        corners, _ = CameraView(camera, pose).project(np.stack([places[site] for site in CORNERS]))
        cv2.fillPoly(trunk, [cv2.convexHull(np.rint(corners).astype(np.int32))], 1)
        mask = filled((background.mask(picture) & near) | (trunk != 0))
        silhouettes.append(ik.Silhouette(mask, camera=camera, world_from_camera=pose, border=border))
    return silhouettes


def read(video: Path, camera: voodoo.Camera) -> tuple[list[np.ndarray], voodoo.Camera]:
    """All pictures, a quarter as large, and their camera."""
    capture, pictures = cv2.VideoCapture(str(video)), []
    while (found := capture.read())[0]:
        pictures.append(cv2.resize(found[1], None, fx=SCALE, fy=SCALE, interpolation=cv2.INTER_AREA))
    height, width = pictures[0].shape[:2]
    # Integer coordinates are pixel centers.
    cx, cy = (SCALE * (value + 0.5) - 0.5 for value in (camera.cx, camera.cy))
    return pictures, voodoo.Camera(width, height, SCALE * camera.fx, SCALE * camera.fy, cx, cy, camera.distortion)


def stature(truth: Truth) -> float:
    """Height [m] of a person with these legs, see Winter's share in voodoo.sensors.silhouettes."""
    lengths = limb_lengths(truth)
    return float(np.mean([np.median(lengths[f"{s}_knee"].sum(axis=1)) for s in "lr"]) / 0.491)
