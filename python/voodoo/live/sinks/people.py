"""The persons of a step as upright skeletons, for sinks."""

from __future__ import annotations

from voodoo.export.skeleton import Skeleton, skeleton
from voodoo.export.track import Track
from voodoo.export.upright import SUFFIX, upright
from voodoo.live.follow import Step
from voodoo.model.standing import is_optical


def upright_person(step: Step, number: int, root_frame: str) -> tuple[Track, Skeleton]:
    """Track and skeleton of one frame of a person who has a pose, in the frame `upright_frame`."""
    track, _ = upright(Track.of([step.estimates[number]]), root_frame)
    return track, skeleton(track, step.bodies[number])


def upright_frame(root_frame: str) -> str:
    """Name of the frame with z up: the root frame, unless that is a camera's."""
    return f"{root_frame}{SUFFIX}" if is_optical(root_frame) else root_frame
