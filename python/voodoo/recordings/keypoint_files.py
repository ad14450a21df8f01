"""Files of 2-D keypoints: OpenPose JSON, one for each image."""

from __future__ import annotations

import json
from collections.abc import Collection
from pathlib import Path
from typing import Any

import numpy as np

from voodoo.errors import RecordingError, reading
from voodoo.measurements import FloatArray
from voodoo.model.joint import short
from voodoo.recordings.keypoint_layouts import LAYOUTS, layout_of
from voodoo.recordings.left_out import LeftOut, leaving_out
from voodoo.stored import read_stored_text

_MOST = 2**24
"""Largest size of a file [bytes]: a thousand people have a tenth of it."""


def read_people(file: Path | None, *, layout: str | None, left_out: LeftOut | None) -> tuple[FloatArray, ...]:
    """People in a keypoint file, none in a missing one (None); an unreadable file is counted in `left_out` and has none, or is an
    error without it.

    Raises:
        RecordingError: see read_openpose_json.
    """
    with leaving_out(left_out):
        return () if file is None else tuple(read_openpose_json(file, layout=layout))
    return ()


def refuse_unread(where: object, people: Collection[FloatArray], unread: LeftOut | None) -> None:
    """Raise an error if nothing could be read of keypoint files, though some are there.

    Args:
        where: folder of the files.
        people: those who were read.
        unread: files that could not be read; None: they were errors themselves.

    Raises:
        RecordingError: names the first file.
    """
    if unread and not people:
        first = next(iter(unread.first.values()))
        raise RecordingError(f"{where}: expected keypoint files with people, found some unreadable, the first: {first}")


def read_openpose_json(path: str | Path, *, layout: str | None) -> list[FloatArray]:
    """People in a JSON file of OpenPose, AlphaPose or MMPose (one image): one (K, 3) array of (u, v, confidence) each.

    Args:
        path: the file.
        layout: name in LAYOUTS; None: any of them.

    Returns:
        Keypoints at exact zeros, and those that are not finite, were not detected: (0, 0, 0).

    Raises:
        RecordingError: unreadable, of another format, or with a number of keypoints that differs from the layout.
    """
    counts = {layout.count for layout in LAYOUTS.values()} if layout is None else {layout_of(layout).count}
    path = Path(path)
    with reading(path, "an OpenPose JSON file"):
        content = json.loads(read_stored_text(path, "an OpenPose JSON file", most=_MOST))
    people = content.get("people", content.get("instance_info")) if isinstance(content, dict) else content
    if not isinstance(people, list):
        raise RecordingError(f"{path}: expected an object with a list of people, found {short(content)}")
    images = {str(person.get("image_id")) for person in people if isinstance(person, dict)}
    if len(images) > 1:
        raise RecordingError(f"{path}: expected a file for each image, found {len(images)} image_id in one")
    found = []
    for index, person in enumerate(people):
        with reading(f"{path}, person {index}", "a score for each keypoint"):
            flat = _flat(person) if isinstance(person, dict) else None
        if person == {} or flat == []:  # Pose2Sim and OpenPose write these if no body was detected
            continue
        if not isinstance(flat, list) or not all(isinstance(value, (int, float)) for value in flat):
            raise RecordingError(f"{path}, person {index}: expected a list of numbers pose_keypoints_2d")
        if len(flat) / 3 not in counts:
            expected = (
                f"{' or '.join(map(str, sorted(counts)))} keypoints for {layout or 'one of ' + ', '.join(LAYOUTS)}"
            )
            raise RecordingError(f"{path}, person {index}: expected {expected}, found {len(flat) / 3:g}")
        with reading(f"{path}, person {index}", "numbers pose_keypoints_2d"):
            rows = np.array(flat, dtype=np.float64).reshape(-1, 3)
        rows[~np.isfinite(rows).all(axis=1) | (rows[:, :2] == 0.0).all(axis=1)] = 0.0
        found.append(rows)
    return found


def _flat(person: dict[str, Any]) -> Any:  # noqa: ANN401 - the caller checks it
    """u, v, confidence, u, ... of a person: pose_keypoints_2d of OpenPose, keypoints of AlphaPose, or nested with scores."""
    names = ("pose_keypoints_2d", "pose_keypoints", "keypoints")
    points = next((person[name] for name in names if name in person), None)
    if not (isinstance(points, list) and points and all(isinstance(row, list) for row in points)):
        return points
    scores = person.get("keypoint_scores")
    rows = points if scores is None else [[*row[:2], score] for row, score in zip(points, scores, strict=True)]
    return [value for row in rows for value in row]
