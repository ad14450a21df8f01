"""What is unlikely in a recording, before it is tracked: a wrong unit, calibration or pose gives a wrong person, or none."""

from __future__ import annotations

from dataclasses import dataclass

from voodoo.pipeline.floor import FloorSight, floor_words, look
from voodoo.recordings.first_images import FirstFrames, doubts, first_frames
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.recording import Recording
from voodoo.sensors.settings import inputs_in


@dataclass(frozen=True)
class Inspection:
    """What the first seconds of a recording show.

    Args:
        first: its first frames.
        sight: persons and floor in its depth images; None if their poses cannot be judged: a camera is the root frame.
        doubts: what is unlikely in stamps, calibration and poses.
    """

    first: FirstFrames
    sight: FloorSight | None
    doubts: tuple[str, ...]


def inspect(recording: Recording, *, left_out: LeftOut | None = None, count: bool = False) -> Inspection:
    """Read the first seconds of a recording.

    Args:
        recording: is read from its start.
        left_out: that of the recording, which does not count what is read here.
        count: it does count what is wrong with the first frames.
    """
    first = first_frames(recording, left_out=None if count else left_out)
    judged = "depth" in inputs_in(recording) and not recording.info().camera_root
    sight = look(recording, left_out=left_out) if judged else None
    floor = "" if sight is None else floor_words(sight.floor, recording.root_frame)
    return Inspection(first, sight, (*doubts(first), *filter(None, [floor])))
