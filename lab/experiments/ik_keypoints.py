"""The 2-D keypoints the published triangulation of Pose2Sim's trial was made from: how far each camera agrees with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from ik_limbs import LIMBS, Truth

from voodoo.model.projection import CameraView
from voodoo.recordings import KeypointImage, Recording
from voodoo.recordings.keypoint_layouts import LAYOUTS

SURE = 0.3
TURNS = np.radians(np.arange(-180.0, 180.0, 1.0))


@dataclass
class Keypoints:
    """Of each camera its view, and of each site the pixels (F, 2) where a network sees it; NaN where it is not sure."""

    views: dict[str, CameraView]
    pixels: dict[str, dict[str, np.ndarray]]

    def offsets(self, truth: Truth) -> dict[str, np.ndarray]:
        """Camera -> offsets (N, 2) [px] of the known sites' keypoints from the truth as projected into it."""
        found = {}
        for camera, sites in self.pixels.items():
            rows = [
                self.views[camera].project(truth[s])[0] - observed for s, observed in sites.items() if s not in LIMBS
            ]
            every = np.concatenate(rows)
            found[camera] = every[np.isfinite(every).all(axis=1)]
        return found

    def turned(self, cameras: Sequence[str], truth: Truth) -> dict[str, np.ndarray]:
        """Positions (F, 3) of elbows and knees, each turned about the line between its known ends to where the cameras' own
        keypoints of it say (least squares of pixels; of several such turns the one that is nearest to the truth).

        What the very observations that the truth was triangulated from tell about it; NaN where none of them is sure.
        """
        found = {}
        for joint, (_, first, last) in LIMBS.items():
            rows = []
            for frame, (start, end, middle) in enumerate(zip(truth[first], truth[last], truth[joint], strict=True)):
                way = (end - start) / np.linalg.norm(end - start)
                along = way * ((middle - start) @ way)
                side = middle - start - along
                places = start + along + np.outer(np.cos(TURNS), side) + np.outer(np.sin(TURNS), np.cross(way, side))
                observed = [(self.views[camera], self.pixels[camera][joint][frame]) for camera in cameras]
                squares = [
                    ((view.project(places)[0] - at) ** 2).sum(axis=1) for view, at in observed if np.isfinite(at).all()
                ]
                if not squares:
                    rows.append(np.full(3, np.nan))
                    continue
                cost = np.sum(squares, axis=0)
                least = (cost <= np.roll(cost, 1)) & (cost <= np.roll(cost, -1))
                far = np.linalg.norm(places - middle, axis=1)
                rows.append(places[np.argmin(np.where(least, far, np.inf))])
            found[joint] = np.array(rows)
        return found


def keypoints(recording: Recording, sites: Sequence[str]) -> Keypoints:
    """The keypoints of the first person in every picture."""
    found = Keypoints({}, {})
    for frame, recorded in enumerate(recording):
        for item in recorded.measurements:
            if not isinstance(item, KeypointImage) or not item.people:
                continue
            found.views[item.sensor] = CameraView(item.camera, item.root_from_sensor)
            there = found.pixels.setdefault(item.sensor, {s: np.full((len(recording), 2), np.nan) for s in sites})
            for part in LAYOUTS[item.layout].parts:
                u, v, sure = np.sum(
                    [fraction * item.people[0][index] for index, fraction in part.weights.items()], axis=0
                )
                if part.site in there and sure > SURE:
                    there[part.site][frame] = u, v
    return found
