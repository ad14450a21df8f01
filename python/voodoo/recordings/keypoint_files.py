"""Files of 2-D keypoints: OpenPose JSON, one for each image."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np

from voodoo.errors import RecordingError, reading
from voodoo.measurements import FloatArray
from voodoo.model.joint import short
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.stored import read_stored_text

_MOST = 2**24
"""Largest size of a file [bytes]: a thousand people have a tenth of it."""


def read_openpose_json(path: str | Path, *, layout: str) -> list[FloatArray]:
    """People in an OpenPose JSON file (one image): one (K, 3) array of (u, v, confidence) each; empty without any.

    Raises:
        RecordingError: unreadable, of another format, or with a number of keypoints that differs from the layout.
    """
    count = layout_of(layout).count
    path = Path(path)
    with reading(path, "an OpenPose JSON file"):
        content = json.loads(read_stored_text(path, "an OpenPose JSON file", most=_MOST))
    people = content.get("people") if isinstance(content, dict) else None
    if not isinstance(people, list):
        raise RecordingError(f"{path}: expected an object with a list of people, found {short(content)}")
    found = []
    for index, person in enumerate(people):
        flat = person.get("pose_keypoints_2d") if isinstance(person, dict) else None
        if person == {} or flat == []:  # Pose2Sim and OpenPose write these if no body was detected
            continue
        if not isinstance(flat, list) or not all(isinstance(value, (int, float)) for value in flat):
            raise RecordingError(f"{path}, person {index}: expected a list of numbers pose_keypoints_2d")
        if len(flat) != 3 * count:
            raise RecordingError(
                f"{path}, person {index}: expected {count} keypoints for {layout}, found {len(flat) / 3:g}"
            )
        with reading(f"{path}, person {index}", "numbers pose_keypoints_2d"):
            rows = np.array(flat, dtype=np.float64).reshape(count, 3)
        if not np.isfinite(rows).all():
            raise RecordingError(f"{path}, person {index}: expected finite keypoints, found others")
        found.append(rows)
    return found
