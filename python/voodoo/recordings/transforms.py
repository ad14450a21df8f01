"""Rigid transforms of a recording: chains tf messages to root_from_sensor."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections import deque
from itertools import pairwise

import numpy as np

from voodoo.errors import RecordingError
from voodoo.measurements import FloatArray
from voodoo.model.rotations import matrix_of_quaternion, turned_between
from voodoo.model.transforms import inverse, pose_of
from voodoo.recordings.ros_messages import Message, seconds
from voodoo.recordings.set_back import SetBack

WAVERS_M, WAVERS_RAD = 0.05, math.radians(2.0)
"""A robot whose odometry stays within these limits is standing: they cover the drift of odometry in a recording."""


def matrix(translation: Message, rotation: Message, source: object) -> FloatArray:
    """(4, 4) of a geometry_msgs translation and quaternion (x, y, z, w).

    Raises:
        RecordingError: a number that is not finite or a quaternion whose norm is not 1 within 1 %.
    """
    t = np.array([translation.x, translation.y, translation.z], dtype=np.float64)
    q = np.array([rotation.x, rotation.y, rotation.z, rotation.w], dtype=np.float64)
    norm = math.sqrt(float(q @ q))
    if not np.isfinite(t).all() or not abs(norm - 1.0) < 0.01:
        raise RecordingError(f"{source}: expected a finite translation and a unit quaternion, found {t} and {q}")
    x, y, z, w = (q / norm).tolist()
    return pose_of(matrix_of_quaternion((x, y, z, w)), t)


def between(first: FloatArray, second: FloatArray, fraction: float) -> FloatArray:
    """Interpolated rigid transform (4, 4) at a fraction, 0 to 1: linear translation, constant angular velocity."""
    place = (1.0 - fraction) * first[:3, 3] + fraction * second[:3, 3]
    return pose_of(turned_between(first[:3, :3], second[:3, :3], fraction), place)


class _Edge:
    """parent_from_child over time, sorted by stamp."""

    def __init__(self) -> None:
        self.stamps: list[float] = []
        self.transforms: list[FloatArray] = []
        self.constant = True

    def add(self, stamp: float, transform: FloatArray, *, static: bool) -> None:
        if static:
            self.stamps, self.transforms, self.constant = [stamp], [transform], True
            return
        first = self.transforms[0] if self.transforms else transform
        if first is not transform and not np.array_equal(first, transform):
            self.constant = False
        at = bisect_right(self.stamps, stamp)
        self.stamps.insert(at, stamp)
        self.transforms.insert(at, transform)

    def keep(self, since: float, until: float) -> None:
        low, high = bisect_left(self.stamps, since), bisect_right(self.stamps, until)
        # The newest transform is kept even if it is too old, because errors name its age.
        low = min(low, max(len(self.stamps) - 1, 0))
        held = self.transforms[:1] if self.constant else []
        self.stamps, self.transforms = self.stamps[low:high], self.transforms[low:high]
        if held and not self.stamps:  # it is valid at all times
            self.stamps, self.transforms = [until], held

    def moves(self) -> bool:
        """Whether a transform differs from the first one by more than the drift of odometry."""
        if self.constant:
            return False
        all_of_them = np.array(self.transforms)
        away = np.linalg.norm(all_of_them[:, :3, 3] - all_of_them[0, :3, 3], axis=1).max()
        cosines = (np.einsum("fij,ij->f", all_of_them[:, :3, :3], all_of_them[0, :3, :3]) - 1.0) / 2.0
        return bool(away > WAVERS_M or np.arccos(np.clip(cosines, -1.0, 1.0)).max() > WAVERS_RAD)


class TransformTree:
    """Frames connected by transforms.

    A constant transform is valid at all times, on whichever topic it was published. A changing one is interpolated between
    the stamps before and after the requested one, if these are at most `2 max_age` apart. Otherwise, and after its last stamp,
    the previous one is used if it is at most `max_age` seconds old; before its first stamp the first one is used if it is at
    most `max_age` later.

    Args:
        source: name of the recording in errors.
        max_age: [s].
        set_back: moves stamps on where the clock was set back; None: they are as they come.
    """

    def __init__(self, source: object, *, max_age: float, set_back: SetBack | None = None) -> None:
        """Start without frames."""
        self._set_back = set_back
        self.source = source
        self.max_age = max_age
        self._neighbors: dict[str, dict[str, tuple[_Edge, bool]]] = {}
        self._last: dict[tuple[str, str], tuple[tuple[float, ...], FloatArray]] = {}

    @property
    def frames(self) -> tuple[str, ...]:
        """Names of all frames, sorted."""
        return tuple(sorted(self._neighbors))

    def add(self, message: Message, *, static: bool) -> None:
        """Add a tf2_msgs/TFMessage.

        Raises:
            RecordingError: a transform that cannot be used; the others are added.
        """
        problems = []
        for item in message.transforms:
            try:
                self._add(item, static=static)
            except RecordingError as error:
                problems.append(error)
        if problems:
            raise problems[0]

    def _add(self, item: Message, *, static: bool) -> None:
        """Add a geometry_msgs/TransformStamped."""
        parent, child = str(item.header.frame_id).lstrip("/"), str(item.child_frame_id).lstrip("/")
        where = f"{self.source}: transform {parent!r} from {child!r}"
        if not parent or not child or parent == child:
            raise RecordingError(f"{where}: expected two different frame names")
        stamp = seconds(item.header.stamp)
        transform = self._matrix((parent, child), item.transform, where)
        moved = stamp if static or self._set_back is None else self._set_back.of(f"{parent} {child}", stamp)
        if moved is not None:
            self.add_edge(parent, child, moved, transform, static=static)

    def _matrix(self, frames: tuple[str, str], item: Message, where: str) -> FloatArray:
        """(4, 4) of a geometry_msgs/Transform. Most never change and are sent many times a second: while the numbers are the
        same, so is the array."""
        place, turn = item.translation, item.rotation
        numbers = (place.x, place.y, place.z, turn.x, turn.y, turn.z, turn.w)
        before, made = self._last.get(frames, (None, None))
        if made is None or numbers != before:
            made = matrix(place, turn, where)
            self._last[frames] = numbers, made
        return made

    def add_edge(self, parent: str, child: str, stamp: float, transform: FloatArray, *, static: bool) -> None:
        """Add parent_from_child (4, 4) at a stamp [s]."""
        beside = self._neighbors.setdefault(parent, {})
        if child not in beside or not beside[child][1]:
            beside[child] = _Edge(), True
            self._neighbors.setdefault(child, {}).setdefault(parent, (beside[child][0], False))
        beside[child][0].add(stamp, transform, static=static)

    def keep(self, since: float, until: float) -> None:
        """Discard transforms outside these stamps [s], to limit the memory of a live source; of a constant one the last stays."""
        for edge, is_own in (one for others in self._neighbors.values() for one in others.values()):
            if is_own:
                edge.keep(since, until)

    def covers(self, root: str, frame: str, stamp: float) -> bool:
        """Whether every changing transform between two frames is known up to a stamp [s]; False if there is no chain."""
        edges = self._chain(root, frame)
        return edges is not None and all(
            edge.constant or (bool(edge.stamps) and edge.stamps[-1] >= stamp) for edge in edges
        )

    def reaches(self, root: str, frame: str) -> bool:
        """Whether transforms lead from `root` to `frame`."""
        return self._chain(root, frame) is not None

    def _chain(self, root: str, frame: str) -> list[_Edge] | None:
        """The transforms between two frames; None if they are not connected."""
        try:
            return [self._neighbors[a][b][0] for a, b in pairwise(self.path(root, frame))]
        except RecordingError:
            return None

    def path(self, root: str, frame: str) -> list[str]:
        """Frames from `root` to `frame`, both included.

        Raises:
            RecordingError: they are not connected.
        """
        previous: dict[str, str] = {}
        queue = deque([root])
        while queue and frame not in previous and root != frame:
            current = queue.popleft()
            for other in self._neighbors.get(current, ()):
                if other != root and other not in previous:
                    previous[other] = current
                    queue.append(other)
        if frame != root and frame not in previous:
            known = ", ".join(self.frames) or "none"
            raise RecordingError(
                f"{self.source}: expected a transform {root!r} from {frame!r} on tf or tf_static, "
                f"found no chain between them; frames with transforms: {known}"
            )
        result = [frame]
        while result[-1] != root:
            result.append(previous[result[-1]])
        return result[::-1]

    def moves(self, root: str, frame: str) -> bool:
        """Whether a frame moves in another one by more than the drift of a standing robot; False if not connected."""
        edges = self._chain(root, frame)
        return edges is not None and any(edge.moves() for edge in edges)

    def lookup(self, root: str, frame: str, stamp: float) -> FloatArray:
        """root_from_frame (4, 4) at `stamp`.

        Raises:
            RecordingError: not connected, or no transform near the stamp.
        """
        result = np.eye(4)
        for a, b in pairwise(self.path(root, frame)):
            edge, forward = self._neighbors[a][b]
            transform = self._at(edge, stamp, a, b)
            result = result @ (transform if forward else inverse(transform))
        return result

    def _at(self, edge: _Edge, stamp: float, a: str, b: str) -> FloatArray:
        if edge.constant:
            return edge.transforms[0]
        if not edge.stamps:
            raise RecordingError(
                f"{self.source}: expected a transform between {a!r} and {b!r} near stamp {stamp:.6f}, found none",
                reason="without a transform near its stamp",
            )
        index = max(bisect_right(edge.stamps, stamp) - 1, 0)
        span = edge.stamps[index + 1] - edge.stamps[index] if index + 1 < len(edge.stamps) else math.inf
        if stamp > edge.stamps[index] and span <= 2.0 * self.max_age:
            fraction = (stamp - edge.stamps[index]) / span
            return between(edge.transforms[index], edge.transforms[index + 1], fraction)
        age = stamp - edge.stamps[index]
        if abs(age) > self.max_age:
            raise RecordingError(
                f"{self.source}: expected a transform between {a!r} and {b!r} within {self.max_age} s of stamp "
                f"{stamp:.6f}, found the nearest usable one {abs(age):.3f} s {'before' if age > 0 else 'after'} it "
                "(loader's option tf_max_age, --option tf_max_age=SECONDS)",
                reason="without a transform near its stamp",
            )
        return edge.transforms[index]
