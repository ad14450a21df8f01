"""Tracking of several persons, each with a persistent number."""

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
from voodoo.errors import BodyError, ConfigError, MeasurementError, of_kind, one_thread
from voodoo.model.body import Body, checked_joints
from voodoo.model.joint import corners

__all__ = ["ONE", "Followed", "People", "PeopleEstimate", "Person", "everybody"]

ONE = 1
"""Number of the person whom a `Tracker` follows."""
FORGET_AFTER_S = 60.0
"""By default a person who was away for longer counts as new [s]."""


@dataclass(frozen=True)
class Person:
    """A person who is present.

    Args:
        id: number from 1; a person who comes back has the same number.
        estimate: pose of the person.
    """

    id: int
    estimate: Estimate

    @property
    def status(self) -> str:
        """Status of the estimate: tracking, degraded, or lost (hidden, or about to be pruned: the pose is extrapolated)."""
        return self.estimate.status


@dataclass(frozen=True)
class PeopleEstimate:
    """All persons who are present.

    Args:
        stamp: time of the frame [s].
        persons: in the order of their first appearance.
    """

    stamp: float
    persons: tuple[Person, ...]

    def __iter__(self) -> Iterator[Person]:
        """The persons."""
        return iter(self.persons)

    def __len__(self) -> int:
        """Number of persons."""
        return len(self.persons)


def everybody(estimate: Estimate | PeopleEstimate) -> PeopleEstimate:
    """All persons of an estimate; that of a `Tracker` is of person ONE, also if nobody was found."""
    if isinstance(estimate, PeopleEstimate):
        return estimate
    return PeopleEstimate(estimate.stamp, (Person(ONE, estimate),))


@one_thread
class People:
    """Tracks all persons, each with a persistent number.

    No initial poses are needed: persons are detected in depth images. A pixel is assigned to the person whose surface explains
    it. Hidden persons are extrapolated. A person who comes back gets the same number if size, position, time and, with color
    images, clothes agree.

    Args:
        body: body that is copied for every new person; None: `Body.human()`.
        config: parameters; `threads` persons are tracked in parallel, with bit-identical results.
        detector: finds persons in depth images, as for `Tracker`; with None only those of `add` and
            `Frame.add_detection` are tracked.
        limit: largest number of persons tracked at the same time; None: any number.
        nearest: of more than `limit` persons those nearest to a depth camera are tracked; else those who came first.
        forget_after: a person who was away for longer counts as new [s].
        region: lower and upper corner [m] of a box in the world; persons outside are ignored. None: everywhere.
    """

    def __init__(
        self,
        body: Body | None = None,
        *,
        config: Config | None = None,
        detector: AnyDetector = "shipped",
        limit: int | None = None,
        nearest: bool = False,
        forget_after: float = FORGET_AFTER_S,
        region: tuple[Sequence[float], Sequence[float]] | None = None,
    ) -> None:
        """Start without persons.

        Raises:
            BodyError: `body` is not a Body.
            ConfigError: an invalid parameter, or `detector` is not a detector.
        """
        self._prototype = of_kind("body", Body.human() if body is None else body, Body, BodyError)
        self.config = of_kind("config", Config() if config is None else config, Config, ConfigError)
        if limit is not None and (not isinstance(limit, int) or limit < 1):
            raise ConfigError(f"limit: expected a whole number from 1, or None, found {limit!r}")
        if not (isinstance(forget_after, int | float) and math.isfinite(forget_after) and forget_after >= 0.0):
            raise ConfigError(f"forget_after: expected a finite number of seconds, found {forget_after!r}")
        self.detector = detector
        self._core = _core.People(
            self._prototype.core,
            self.config.values(),
            detector,
            limit=limit,
            nearest=bool(nearest),
            forget_after=float(forget_after),
            region=None if region is None else corners("region", region, ConfigError),
        )
        self._estimate = PeopleEstimate(math.nan, ())

    @property
    def prototype(self) -> Body:
        """Body that is copied for every new person."""
        return self._prototype

    @property
    def estimate(self) -> PeopleEstimate:
        """The last estimate; at first with NaN as its stamp and without persons."""
        return self._estimate

    @property
    def detector_failures(self) -> int:
        """Steps in which a detector failed; each of them warned (`voodoo.DetectorWarning`)."""
        return self._core.detector_failures

    @property
    def refusal(self) -> str | None:
        """Why somebody who was detected in the last step is not tracked; None if nobody was, or everybody is."""
        return self._core.refusal

    @property
    def numbers(self) -> tuple[int, ...]:
        """Numbers of the persons who are present."""
        return tuple(self._core.present())

    def step(self, frame: Frame, *, own: Mapping[int, Frame] | None = None) -> PeopleEstimate:
        """Estimate all persons at the time of the frame. Releases the GIL; a rejected frame leaves the state unchanged.

        Args:
            frame: shared measurements: depth images, free points, color images, the floor. They are assigned to persons by the
                tracker.
            own: person number -> frame with points, positions and rays of this person alone, with the same stamp; its depth
                and color images are ignored.

        Raises:
            MeasurementError: time not after the last frame, or an invalid measurement.
            BodyError: a frame names a limb or site that is not in the body.
        """
        wrong = sorted({other.stamp for other in (own or {}).values()} - {frame.stamp})
        if wrong:
            raise MeasurementError(f"own: expected frames with the stamp {frame.stamp} s, found {wrong[0]} s")
        found = self._core.step(frame, list((own or {}).items()))
        self._estimate = PeopleEstimate(frame.stamp, tuple(Person(number, estimate) for number, estimate in found))
        return self._estimate

    def add(self, joints: Mapping[str, Sequence[float]], *, fit_sizes: bool = True) -> int:
        """Track a person at a known position. Returns its number: that of a matching lost or absent person, or a new one.

        Persons visible in depth images need not be added.

        Args:
            joints: site name -> (x, y, z) [m] in the world frame, as for `Tracker.reset`.
            fit_sizes: also scale the body to the distances between the positions.

        Raises:
            BodyError: an unknown name, or an entry that is not three finite numbers.
            MeasurementError: the positions do not determine the pose.
        """
        return self._core.add(checked_joints(joints), fit_sizes)

    def only(self, *persons: int) -> None:
        """Track only these persons from now on; without numbers, track everybody again."""
        self._core.only(list(persons) or None)

    @property
    def needs_color(self) -> bool:
        """Whether a color image would be used in the next frame, so that callers can avoid decoding it needlessly."""
        return self._core.needs_colors()

    def body(self, person: int) -> Body:
        """The body of a person who is present, with their sizes.

        Raises:
            BodyError: there is no person with this number.
        """
        return Body(self._core.body(person), same=self._prototype)


class Followed:
    """One of the persons, with the query interface of a `Tracker`; valid until the next step.

    Args:
        people: the tracker of all persons.
        number: number of the person.
    """

    def __init__(self, people: People, number: int) -> None:
        """Store `people` and the number."""
        self._people = people
        self._number = number
        self._core = people._core, number

    @property
    def body(self) -> Body:
        """The body with the person's sizes."""
        return self._people.body(self._number)

    @property
    def estimate(self) -> Estimate:
        """The last estimate.

        Raises:
            BodyError: the person is not present.
        """
        return self._people._core.estimate(self._number)

    def predict(self, stamp: float) -> dict[str, npt.NDArray[np.float64]]:
        """See Tracker.predict."""
        return _core.expected_sites(self._core, stamp)

    def body_before(self, sites: npt.ArrayLike, camera: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """See Tracker.body_before."""
        places = np.ascontiguousarray(sites, dtype=np.float64).reshape(-1, 3)
        return _core.body_before(self._core, places, np.asarray(camera, dtype=np.float64))
