"""The persons of a step, upright, for sinks: of each a row with all numbers that any sink tells, made once for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from itertools import compress
from typing import NamedTuple

import numpy as np

from voodoo._core import Estimate
from voodoo.export.layout import Layout, layout_of
from voodoo.export.ros2 import person_id
from voodoo.export.upright import SUFFIX, Turn, by_axes
from voodoo.live.follow import Step
from voodoo.measurements import FloatArray


class PosedPeople(NamedTuple):
    """Persons P of a step who have a pose.

    Attributes:
        frame: frame with z up of everything.
        turn: how the root frame was turned to it.
        estimates: number -> estimate in the root frame.
        layout: of their rows; None if there are no persons.
        rows: (P, ...).
        there: numbers of those who are not lost.
        ids: REP-155 ids of these.
        rows_there: rows of these.
        sure: whether the covariance of each of these is known.
    """

    frame: str
    turn: Turn
    estimates: Mapping[int, Estimate]
    layout: Layout | None
    rows: FloatArray
    there: tuple[int, ...] = ()
    ids: tuple[str, ...] = ()
    rows_there: FloatArray = np.empty((0, 0))
    sure: tuple[bool, ...] = ()


@lru_cache(maxsize=2)
def posed_people(step: Step, root_frame: str) -> PosedPeople:
    """The persons of a step who have a pose."""
    turn = by_axes(root_frame) if step.turn is None else step.turn
    frame = f"{root_frame}{SUFFIX}" if turn.words else root_frame
    statuses = {number: one.status for number, one in step.estimates.items()}
    found = {number: step.estimates[number] for number, status in statuses.items() if status != "searching"}
    if not found:
        return PosedPeople(frame, turn, found, None, np.empty((0, 0)))
    number, first = next(iter(found.items()))
    layout = layout_of(first.joint_names, step.bodies[number].limb_tree, step.bodies[number].limb_joints)
    cores = [step.bodies[number].core for number in found]
    rows = layout.core.rows(list(found.values()), cores, turn.pose if turn.words else None)
    known = np.isfinite(rows[:, sum(layout.widths[:5])]).tolist()  # the first number of the covariance
    tracked = [statuses[number] != "lost" for number in found]
    there, sure = tuple(compress(found, tracked)), tuple(compress(known, tracked))
    return PosedPeople(
        frame,
        turn,
        found,
        layout,
        rows,
        there,
        tuple(map(person_id, there)),
        rows if all(tracked) else rows[tracked],
        sure,
    )
