"""What `voodoo track` says at its end: how it went, and what should be looked at."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from voodoo.recordings.recording import RecordingInfo

STATUS_PAGE = "docs/how-to/read-the-status.md"
_USUAL_M = (0.8, 2.1)
"""Statures from a small child to a tall adult."""
_TOLD = 0.06
"""A stature that differs from what was told by a larger fraction is doubted: sizes of limbs are found to some percent."""
_LEAST_TRACKING = 0.5


def closing_lines(
    states: Counter[str], seconds: Sequence[float], about: RecordingInfo, *, stature: float | None
) -> list[str]:
    """Stature, speed, root frame, and share of the frames by status (status -> frames)."""
    time = sum(seconds)
    parts = [] if stature is None else [f"stature {stature:.2f} m"]
    parts += [f"{len(seconds) / time:.0f} frames a second"] if time > 0.0 else []
    camera = " (a camera, not level)" if about.camera_root else ""
    shares = (f"{100 * count / states.total():.0f} % {word}" for word, count in states.items())
    return [
        "; ".join([*parts, f"root frame {about.root_frame}{camera}"]),
        f"{', '.join(shares)} ({STATUS_PAGE} says what that means)",
    ]


def closing_doubts(states: Counter[str], *, stature: float | None, told: float | None) -> list[str]:
    """What is unlikely in poses of these statuses (status -> frames); told: the stature that was given [m]."""
    doubts = []
    low, high = _USUAL_M
    if stature is not None and told is not None and abs(stature - told) > _TOLD * told:
        doubts.append(
            f"the stature is {stature:.2f} m, where {told:.2f} m was told: is the scale of depth or calibration right?"
        )
    elif stature is not None and told is None and not low <= stature <= high:
        doubts.append(f"the stature is {stature:.2f} m, which few people have ({low} to {high} m): is the scale right?")
    share = states["tracking"] / states.total()
    if share <= _LEAST_TRACKING:
        doubts.append(
            f"only {100 * share:.0f} % of the frames are tracking: look at --overlay look.mp4, and see {STATUS_PAGE}"
        )
    return doubts
