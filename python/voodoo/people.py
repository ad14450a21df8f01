"""Several persons at once, each with a number that lasts."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate, Frame
from voodoo.config import Config
from voodoo.detectors.base import AnyDetector
from voodoo.errors import BodyError, ConfigError, MeasurementError
from voodoo.model.body import Body, checked_joints

__all__ = ["Followed", "People", "PeopleEstimate", "Person"]


@dataclass(frozen=True)
class Person:
    """One of those who are there.

    Args:
        id: their number, from 1; whoever comes back has the same.
        estimate: their pose.
    """

    id: int
    estimate: Estimate

    @property
    def status(self) -> str:
        """That of the estimate: tracking, degraded, or lost (hidden, or about to be given up: the pose is carried)."""
        return self.estimate.status


@dataclass(frozen=True)
class PeopleEstimate:
    """Everybody who is there.

    Args:
        stamp: time of the frame [s].
        persons: in the order in which they first came.
    """

    stamp: float
    persons: tuple[Person, ...]

    def __iter__(self) -> Iterator[Person]:
        """The persons."""
        return iter(self.persons)

    def __len__(self) -> int:
        """How many are there."""
        return len(self.persons)


class People:
    """Follows everybody who comes, each with a number that lasts.

    Nobody needs to say where they are: persons are found in depth images. A pixel belongs to the person whose surface explains
    it. Who is hidden is carried, and who comes back has the same number where size, place, time and, with color pictures,
    clothes agree.

    Args:
        body: what every new person gets a copy of; None: `Body.human(model="measured")`.
        config: parameters; `threads` persons are followed side by side, with the same bits.
        detector: finds persons in depth images, as for `Tracker`; with None only those are followed who are added.
        limit: persons that are followed at the same time, at most; None: any number.
        nearest: of more than `limit` those nearest to a depth camera are followed; else those who came first.
        forget_after: who is away for longer is somebody new when they come back [s].
        region: low and high corner [m] of a box of the world; who is outside is left out. None: everywhere.
    """

    def __init__(
        self,
        body: Body | None = None,
        *,
        config: Config | None = None,
        detector: AnyDetector = "shipped",
        limit: int | None = None,
        nearest: bool = False,
        forget_after: float = 60.0,
        region: tuple[Sequence[float], Sequence[float]] | None = None,
    ) -> None:
        """Nobody is there yet.

        Raises:
            BodyError: `body` is not a Body.
            ConfigError: a parameter that cannot be used, or no detector.
        """
        if body is not None and not isinstance(body, Body):
            raise BodyError(f"body: expected a voodoo.Body, found {type(body).__name__}")
        if config is not None and not isinstance(config, Config):
            raise ConfigError(f"config: expected a voodoo.Config, found {type(config).__name__}")
        if limit is not None and (not isinstance(limit, int) or limit < 1):
            raise ConfigError(f"limit: expected a whole number from 1, or None, found {limit!r}")
        if not (isinstance(forget_after, int | float) and math.isfinite(forget_after) and forget_after >= 0.0):
            raise ConfigError(f"forget_after: expected a finite number of seconds, found {forget_after!r}")
        self.config = Config() if config is None else config
        self._prototype = Body.human(model="measured") if body is None else body
        self._core = _core.People(
            self._prototype.core,
            self.config.values(),
            detector,
            limit=limit,
            nearest=bool(nearest),
            forget_after=float(forget_after),
            region=_box(region),
        )
        self._estimate = PeopleEstimate(math.nan, ())

    @property
    def prototype(self) -> Body:
        """What every new person gets a copy of."""
        return self._prototype

    @property
    def estimate(self) -> PeopleEstimate:
        """The last one; at first with NaN as its stamp and nobody."""
        return self._estimate

    @property
    def detector_failures(self) -> int:
        """Steps in which a detector failed; each of them warned (`voodoo.DetectorWarning`)."""
        return self._core.detector_failures

    def step(self, frame: Frame, *, own: Mapping[int, Frame] | None = None) -> PeopleEstimate:
        """Everybody at the frame's time. Releases the GIL; after a refused frame all is as before.

        Args:
            frame: what all have in common: depth images, free points, color pictures, the floor. Whose it is, is found out.
            own: number of a person -> points, positions and rays of this person alone, with the same stamp; their depth images
                and color pictures are not looked at.

        Raises:
            MeasurementError: time not after the last frame, or a measurement that cannot be used.
            BodyError: a frame names a limb or site that is not in the body.
        """
        wrong = sorted({other.stamp for other in (own or {}).values()} - {frame.stamp})
        if wrong:
            raise MeasurementError(f"own: expected frames with the stamp {frame.stamp} s, found {wrong[0]} s")
        found = self._core.step(frame, list((own or {}).items()))
        self._estimate = PeopleEstimate(frame.stamp, tuple(Person(number, estimate) for number, estimate in found))
        return self._estimate

    def add(self, joints: Mapping[str, Sequence[float]], *, fit_sizes: bool = True) -> int:
        """Follow somebody whose place is known; their number, which is that of who was lost or away and can have come there.

        Who is seen in depth images need not be added.

        Args:
            joints: site name -> (x, y, z) [m] in the world frame, as for `Tracker.reset`.
            fit_sizes: also scale the body to the distances between the positions.

        Raises:
            BodyError: an unknown name, or an entry that is not three finite numbers.
            MeasurementError: the positions do not fix the pose.
        """
        return self._core.add(checked_joints(joints), fit_sizes)

    def only(self, *persons: int) -> None:
        """Follow these numbers and nobody else from now on; without numbers, everybody again."""
        self._core.only(list(persons) or None)

    @property
    def needs_color(self) -> bool:
        """Whether a color picture would tell something in the next frame; to decode it for nothing costs time."""
        return self._core.needs_colors()

    def body(self, person: int) -> Body:
        """The body of a person who is there, in their sizes.

        Raises:
            BodyError: nobody of this number is there.
        """
        core = self._core.body(person)
        if core is None:
            there = ", ".join(str(other.id) for other in self._estimate) or "nobody"
            raise BodyError(f"person: expected one of those who are there ({there}), found {person}")
        return Body(core)


class Followed:
    """One of those who are there, asked as a `Tracker` is; valid until the next step.

    Args:
        people: who follows them.
        number: of the person.
    """

    def __init__(self, people: People, number: int) -> None:
        """Ask `people` about somebody."""
        self._people = people
        self._number = number

    @property
    def _core(self) -> tuple[_core.People, int]:
        """What the compiled core knows them by."""
        return self._people._core, self._number

    @property
    def body(self) -> Body:
        """The body in their sizes."""
        return self._people.body(self._number)

    @property
    def estimate(self) -> Estimate:
        """The last estimate.

        Raises:
            BodyError: they are not there.
        """
        found = self._people._core.estimate(self._number)
        if found is None:
            raise BodyError(f"person: expected one of those who are there, found {self._number}")
        return found

    def predict(self, stamp: float) -> dict[str, npt.NDArray[np.float64]]:
        """See Tracker.predict."""
        return _core.expected_sites(self._core, stamp)

    def body_before(self, sites: npt.ArrayLike, camera: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """See Tracker.body_before."""
        places = np.ascontiguousarray(sites, dtype=np.float64).reshape(-1, 3)
        return _core.body_before(self._core, places, np.asarray(camera, dtype=np.float64))


def _box(region: tuple[Sequence[float], Sequence[float]] | None) -> tuple[list[float], list[float]] | None:
    if region is None:
        return None
    try:
        low, high = ([float(value) for value in corner] for corner in region)
    except (TypeError, ValueError):
        low, high = [], []
    good = len(low) == len(high) == 3 and all(math.isfinite(value) for value in (*low, *high))
    if not good or any(a > b for a, b in zip(low, high, strict=True)):
        raise ConfigError(f"region: expected a low and a high corner of three numbers each, found {region!r}")
    return low, high
