"""From a frame to what the network learns from: the product's own candidates, each with its truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lab.training.anybody import GROUPS, THINGS
from lab.training.scenes import Frame, Person
from voodoo import Camera, _core
from voodoo.detectors.base import PersonCandidate

Array = NDArray[np.float64]
PERSON_FRACTION = (0.1, 0.45)  # of a candidate's pixels: below the first it is nobody, above the second somebody
PERSON_COVER = 0.5  # of the person's pixels that a candidate must hold
CLEAR = 1.3  # times the pixels of anybody else in the candidate
LEAST_JOINTS = 5  # seen, for a person to be worth learning from
ADULT = 1.7  # m; small people are shown enlarged to this stature, as the detector shows them in its second evaluation,
SMALL = 0.9  # below this fraction of it, by a stature that is known with
STATURE_SIGMA = 0.08  # this relative standard deviation from the first evaluation
ENLARGED = (0.7, 0.2)  # how often: small people, and what is nobody, by a factor up to
LARGEST = 2.2
NEAREST = 0.3  # m; joints nearer to the camera's plane have no place in the picture


@dataclass(frozen=True)
class Sample:
    """One candidate: picture (96, 96) float16 and mask bits, and its truth; joints in the picture's coordinates, m."""

    depth: NDArray[np.float16]
    mask: NDArray[np.uint8]
    middle: Array
    person: bool
    joints: Array
    weight: Array
    observed: NDArray[np.bool_]
    facing: float
    lengths: Array
    fraction: float
    cover: float
    up_known: bool
    group: int


def place(points: Array, middle: Array, roll: float) -> Array:
    """Points of the camera's frame in the coordinates of a picture: right, down and behind its middle, m."""
    c, s = np.cos(roll), np.sin(roll)
    x, y, z = (
        c * points[:, 0] - s * points[:, 1],
        s * points[:, 0] + c * points[:, 1],
        np.maximum(points[:, 2], NEAREST),
    )
    return np.stack([(x / z - middle[0]) * middle[2], (y / z - middle[1]) * middle[2], z - middle[2]], 1)


def lifted(places: Array, middle: Array) -> Array:
    """The inverse of `place`, in the turned camera's frame; any leading axes."""
    z = places[..., 2] + middle[..., None, 2]
    xy = places[..., :2] / middle[..., None, 2:3] + middle[..., None, :2]
    return np.concatenate([xy * z[..., None], z[..., None]], -1)


def samples(frame: Frame, rng: np.random.Generator, most: int = 2) -> list[Sample]:
    """At most so many candidates of a frame that show a person, and as many (one, beside people) that show none."""
    floor = None if frame.floor is None else (list(frame.floor[0]), float(frame.floor[1]))
    up = None if frame.up is None else list(frame.up)
    height, width = frame.depth.shape
    camera = Camera(width, height, *frame.intrinsics)
    found = _core.person_candidates(frame.depth, camera=camera, up=up, floor=floor)
    counts = {p.label: int((frame.labels == p.label).sum()) for p in frame.people}
    group = GROUPS.index(frame.group)

    def shown(i: int, factor: float, often: float) -> tuple[PersonCandidate, float]:
        if factor * SMALL < 1 or rng.random() > often:
            return found[i], 1.0
        return _core.person_candidates(frame.depth, camera=camera, up=up, floor=floor, enlarged=factor)[i], factor

    yes: list[Sample] = []
    no: list[Sample] = []
    for i in rng.permutation(len(found)):
        candidate = found[i]
        inside = frame.labels[candidate.mask]
        total = max(len(inside), 1)
        held = {label: int((inside == label).sum()) for label in counts}
        if (inside > 0).sum() < PERSON_FRACTION[0] * total:
            if len(no) < (1 if frame.people else most) and (not frame.people or rng.random() < 0.5):
                picture = shown(i, float(rng.uniform(1 / SMALL, LARGEST)), ENLARGED[1])
                no.append(_sample(picture, None, 0.0, 0.0, up is not None, group))
            continue
        largest = sorted(held.values())[-2:]
        if len(largest) == 2 and largest[1] < CLEAR * largest[0]:
            continue  # of two people nobody can tell which is meant
        for person in sorted(frame.people, key=lambda p: -held[p.label]):
            fraction = float((inside % THINGS == person.label).sum()) / total
            cover = held[person.label] / max(counts[person.label], 1)
            fits = fraction > PERSON_FRACTION[1] and cover > PERSON_COVER and person.observed.sum() >= LEAST_JOINTS
            if fits and len(yes) < most:
                factor = ADULT / float(person.lengths[-1]) * float(np.exp(STATURE_SIGMA * rng.normal()))
                yes.append(_sample(shown(i, factor, ENLARGED[0]), person, fraction, cover, up is not None, group))
                break
    return yes + no


def _sample(
    shown: tuple[PersonCandidate, float],
    person: Person | None,
    fraction: float,
    cover: float,
    up: bool,
    group: int,
) -> Sample:
    """One candidate and the factor by which it is enlarged: everything is larger and farther away by it."""
    candidate, enlarged = shown
    crop, middle = candidate.crop, np.array(candidate.middle) * [1.0, 1.0, enlarged]
    picture, mask = crop[0].astype(np.float16), np.packbits(crop[1] > 0.5, axis=-1)
    if person is None:
        nothing = np.zeros(17)
        return Sample(
            picture, mask, middle, False, np.zeros((17, 3)), nothing, nothing > 0, 0.0, np.ones(9), 0.0, 0.0, up, group
        )
    joints = place(enlarged * person.joints, middle, candidate.roll)
    weight = np.where(person.observed, 1.0, np.where(person.inside, 0.4, 0.15))
    weight[(person.joints[:, 2] < NEAREST) | (np.abs(joints) > 2.0).any(1)] = 0.0
    towards = -person.joints[2] / np.linalg.norm(person.joints[2])
    facing = float(person.forward @ towards)
    joints = np.clip(joints, -2.0, 2.0)
    lengths = enlarged * person.lengths
    return Sample(
        picture, mask, middle, True, joints, weight, person.observed, facing, lengths, fraction, cover, up, group
    )
