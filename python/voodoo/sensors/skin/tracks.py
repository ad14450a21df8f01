"""Skin regions followed from picture to picture, and which of them is the head and which a hand.

A face or hand tracker of K06 is a tracker of its own: it knows where its region was a moment ago. So a region keeps its
name while it moves on continuously, even when the body model has fallen behind, and the model names regions where they
appear. A name changes hands only when another region agrees with the model better for some time.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from voodoo.sensors.pixels import FloatArray, lengths
from voodoo.sensors.skin.assignment import assign

JUMP_M = 0.12
"""A region is at most this far from where its motion would have it, from one picture to the next."""
UNKNOWN_M = 0.24
"""The same for a region that was seen once: nothing is known about its motion."""
NEAR = 0.5
"""What is within this share of the possible motion went on as expected."""
FORGET_S = 0.25
"""A region that was not seen for so long has lost its name."""
FASTEST = 8.0
"""No hand moves faster [m/s]."""
UNSEEN_SPEED = 2.0
"""A region that is not seen gets away from its expected place this fast [m/s]."""
AGREEMENT_S = 0.15
"""Time over which agreement with the model is averaged."""
HELD, DRIFTED, TAKEN, NONE = 0.3, 0.75, 0.5, 0.8
"""Costs: of keeping a name at the edge of the gate, and at most; of taking a name from another region; of having no region.
A region that keeps its name costs less than none; two that were swapped cost more than changing back."""
SAME_M = 0.09
"""Two candidates this near are one hand."""
DOUBT_S, APART = 0.25, 1.25
"""A name is given up after this time in which the body did not come nearer to it than so many gates, or in which it lay on
another limb."""
OLD_ENOUGH = 3
"""Pictures in which a region was seen before it may be named from afar."""


@dataclass(frozen=True, eq=False)
class Sight:
    """A candidate in space.

    Args:
        direction: unit vector (3,) in the world from the camera's focal point.
        place: (3,) on the surface [m], or at a guessed distance.
        deep: whether a depth camera saw it.
        hand: False where it cannot be a hand.
        region: number of its region.
        still: whether nothing behind it was ever seen: it may be a thing, not the person.
    """

    direction: FloatArray
    place: FloatArray
    deep: bool
    hand: bool
    region: int
    still: bool = False


@dataclass(eq=False)
class Blob:
    """A region that is followed: where it was last seen, how it moves, and how far it was from each site."""

    sight: Sight
    stamp: float
    velocity: FloatArray = field(default_factory=lambda: np.zeros(3))
    count: int = 1
    label: str | None = None
    far: dict[str, float] = field(default_factory=dict)
    doubt: dict[str, float] = field(default_factory=dict)

    def copy(self) -> Blob:
        """The same, with a history of its own."""
        return Blob(self.sight, self.stamp, self.velocity, self.count, self.label, dict(self.far), dict(self.doubt))

    def move(self, sight: Sight, stamp: float) -> None:
        """It was seen again."""
        elapsed = stamp - self.stamp
        if elapsed > 0.0:
            velocity = (sight.place - self.sight.place) / elapsed
            if not (sight.deep and self.sight.deep):
                velocity = velocity - sight.direction * float(velocity @ sight.direction)
            if math.hypot(*velocity.tolist()) < FASTEST:
                self.velocity = 0.5 * self.velocity + 0.5 * velocity
        self.sight, self.stamp = sight, stamp
        self.count += 1

    def merge(self, seen: Blob) -> None:
        """It is the same as a blob that was seen just now, which takes over its name and history."""
        if self.label is not None and seen.label is None:
            seen.label, seen.far, seen.doubt = self.label, self.far, self.doubt
            seen.count = max(seen.count, self.count)


class Blobs:
    """All regions of one camera's picture that are followed."""

    def __init__(self) -> None:
        """None yet."""
        self.items: list[Blob] = []
        self._missed: dict[str, float] = {}
        self._stamp = -math.inf

    def __copy__(self) -> Blobs:
        """The same, with blobs of its own."""
        twin = Blobs()
        twin.items = [blob.copy() for blob in self.items]
        twin._missed, twin._stamp = dict(self._missed), self._stamp
        return twin

    def follow(self, sights: Sequence[Sight], stamp: float) -> list[Blob]:
        """The blob of each sight of a picture, new ones included; those that were not seen for long are dropped."""
        cost = _apart(self.items, sights, stamp)
        seen: list[Blob | None] = [None] * len(sights)
        pairs = assign(cost, gate=1.0)
        kept = {sights[column].region for row, column in pairs if self.items[row].label and cost[row, column] < NEAR}
        for row, column in pairs:
            # What reappears far from where it was going, as a part of a region that has a name, is that one's.
            if cost[row, column] >= NEAR and sights[column].region in kept:
                self.items[row].label = None
            self.items[row].move(sights[column], stamp)
            seen[column] = self.items[row]
        found = [Blob(sight, stamp) if blob is None else blob for blob, sight in zip(seen, sights, strict=True)]
        unseen = [blob for blob in self.items if blob.stamp < stamp and stamp - blob.stamp < FORGET_S]
        for blob in unseen:
            blob.velocity = 0.5 * blob.velocity
        apart = _apart(unseen, [blob.sight for blob in found], stamp)
        for blob, row in zip(unseen, apart, strict=True):
            same = np.flatnonzero(row * _limit(blob, stamp) <= SAME_M)
            if len(same):
                blob.merge(found[int(same[0])])
            else:
                found.append(blob)
        self.items = found
        return found[: len(sights)]

    def name(
        self,
        seen: Sequence[Blob],
        distance: FloatArray,
        allowed: FloatArray,
        elsewhere: npt.NDArray[np.bool_],
        *,
        sites: Sequence[str],
        gates: Mapping[str, float],
        growth: float,
        widest: Mapping[str, float],
        ambiguity: float,
        stamp: float,
    ) -> dict[str, int]:
        """Which of the seen blobs each site is.

        Args:
            seen: blobs of this picture.
            distance: (S, B) between the site where the model expects it and the blob [m].
            allowed: (S, B): 0 the blob cannot be the site, 1 only near where it is expected, 2 anywhere.
            elsewhere: (S, B): the blob is on another part of the body, as far as that is where it is thought to be.
            sites: their names.
            gates: site -> gate [m].
            growth: of a gate while its site is not seen [m/s].
            widest: site -> where that ends [m].
            ambiguity: a new name needs its second-best candidate this many times as far as the first.
            stamp: of the picture [s].

        Returns:
            Site -> number of its blob.
        """
        elapsed = min(max(stamp - self._stamp, 0.0), 0.1)
        self._stamp = stamp
        self._doubt(seen, distance, elsewhere, sites=sites, gates=gates, elapsed=elapsed)
        allowed = np.where([[blob.doubt[site] > DOUBT_S for blob in seen] for site in sites], 0.0, allowed)
        owner = {
            site
            for row, site in enumerate(sites)
            for column, blob in enumerate(seen)
            if blob.label == site and allowed[row, column]
        }
        cost = np.full((len(sites), len(seen)), np.inf)
        for row, site in enumerate(sites):
            gate = gates[site]
            waited = stamp - self._missed.setdefault(site, stamp)
            reach = max(gate, min(gate + growth * waited, widest[site]))
            able = [
                allowed[row, column]
                and not elsewhere[row, column]
                and (near < gate or (near < reach and allowed[row, column] > 1 and blob.count >= OLD_ENOUGH))
                for column, (blob, near) in enumerate(zip(seen, distance[row], strict=True))
            ]
            for column, blob in enumerate(seen):
                near = float(distance[row, column])
                sample = min(near / gate, 2.0) ** 2
                share = 1.0 if blob.count == 1 else 1.0 - math.exp(-1.0 / (30.0 * AGREEMENT_S))
                far = blob.far[site] = (1.0 - share) * blob.far.get(site, sample) + share * sample
                if blob.label == site and allowed[row, column]:
                    cost[row, column] = min(HELD * far, DRIFTED)
                elif not able[column]:
                    continue
                elif site in owner or blob.label in owner:
                    if blob.count >= OLD_ENOUGH and near < gate:
                        cost[row, column] = TAKEN + far
                else:
                    rivals = [
                        float(distance[row, other])
                        for other in range(len(seen))
                        if able[other]
                        and seen[other].label is None
                        and math.dist(seen[other].sight.place, blob.sight.place) > SAME_M
                    ]
                    if min(rivals, default=np.inf) >= max(ambiguity * near, 0.5 * gate):
                        cost[row, column] = DRIFTED * (near / reach) ** 2
        named = {sites[row]: column for row, column in assign(np.sqrt(cost), gate=1.0, none=NONE)}
        for blob in self.items:
            if blob.label in named or blob.stamp == stamp:
                blob.label = None
        for site, column in named.items():
            seen[column].label = site
            self._missed[site] = stamp
        return named

    @staticmethod
    def _doubt(
        seen: Sequence[Blob],
        distance: FloatArray,
        elsewhere: npt.NDArray[np.bool_],
        *,
        sites: Sequence[str],
        gates: Mapping[str, float],
        elapsed: float,
    ) -> None:
        """How long each blob has spoken against being each site: on another limb, or its name without the body going there."""
        for row, site in enumerate(sites):
            for column, blob in enumerate(seen):
                apart = blob.label == site and blob.sight.deep and distance[row, column] > APART * gates[site]
                change = elapsed if elsewhere[row, column] or apart else -elapsed
                blob.doubt[site] = min(max(blob.doubt.get(site, 0.0) + change, 0.0), 2.0 * DOUBT_S)


def _apart(blobs: Sequence[Blob], sights: Sequence[Sight], stamp: float) -> FloatArray:
    """(blobs, sights): distance of a sight from where a blob should be, in units of what is possible."""
    if not blobs or not sights:
        return np.zeros((len(blobs), len(sights)))
    elapsed = np.array([stamp - blob.stamp for blob in blobs])
    expected = np.array([blob.sight.place for blob in blobs]) + elapsed[:, None] * [blob.velocity for blob in blobs]
    offset = np.array([sight.place for sight in sights]) - expected[:, None]
    if not (all(blob.sight.deep for blob in blobs) and all(sight.deep for sight in sights)):
        directions = np.array([sight.direction for sight in sights])
        deep = np.outer([blob.sight.deep for blob in blobs], [sight.deep for sight in sights])
        along = np.where(deep, 0.0, (offset * directions).sum(axis=2))
        offset -= along[..., None] * directions
    return lengths(offset) / np.array([_limit(blob, stamp) for blob in blobs])[:, None]


def _limit(blob: Blob, stamp: float) -> float:
    return (JUMP_M if blob.count > 1 else UNKNOWN_M) + UNSEEN_SPEED * max(stamp - blob.stamp - 1.0 / 30.0, 0.0)
