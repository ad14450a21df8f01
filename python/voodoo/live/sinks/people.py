"""The persons of a step as upright skeletons, for sinks."""

from __future__ import annotations

from threading import Lock
from weakref import WeakKeyDictionary

from voodoo.export.skeleton import Skeleton, skeleton
from voodoo.export.track import Track
from voodoo.export.upright import SUFFIX, by_axes, upright
from voodoo.live.follow import Step

_made: WeakKeyDictionary[Step, dict[tuple[int, str], tuple[Track, Skeleton]]] = WeakKeyDictionary()
_lock = Lock()


def upright_person(step: Step, number: int, root_frame: str) -> tuple[Track, Skeleton]:
    """Track and skeleton of one frame of a person who has a pose, in the frame `upright_frame`; made once for all sinks."""
    with _lock:
        known = _made.setdefault(step, {})
        if (number, root_frame) not in known:
            track, _ = upright(Track.of([step.estimates[number]]), root_frame, step.turn)
            known[number, root_frame] = track, skeleton(track, step.bodies[number])
        return known[number, root_frame]


def upright_frame(step: Step, root_frame: str) -> str:
    """Name of the frame with z up: the root frame, unless that is a camera's."""
    turn = by_axes(root_frame) if step.turn is None else step.turn
    return f"{root_frame}{SUFFIX}" if turn.words else root_frame
