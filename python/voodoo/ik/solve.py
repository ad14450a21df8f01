"""Solvers for one posture, many postures, and sequences (J10 eq. 4): their results, and the rest posture towards which angles are
pulled in directions that targets and images leave free."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import BodyError, MeasurementError
from voodoo.ik.chain import Chain
from voodoo.ik.image import Silhouette, core_views
from voodoo.ik.values import (
    Options,
    Target,
    Targets,
    chosen_options,
    named,
    numbers,
    solved,
    target_parts,
    vector,
)
from voodoo.measurements import FloatArray
from voodoo.model.body import Body


@dataclass(frozen=True, eq=False, repr=False)
class Posture:
    """Result of `solve`; immutable. World frame, meters, radians.

    Attributes:
        angles: (n,) in the order of `angle_names`, within the limits.
        angle_names: see Chain.angle_names.
        joints: position (3,) of every site on the chain.
        world_from_limb: pose (4, 4) of every limb of the chain.
        residuals: distance of every target, in the order they were given [m].
        h: image criterion [px] (J10 eq. 5); 0 without images.
        steps: steps used.
        converged: the angles, or the image criterion, stopped changing; the remaining residual is a local minimum.
        images: number of silhouettes used; empty ones are not.
    """

    angles: FloatArray
    angle_names: tuple[str, ...]
    joints: Mapping[str, FloatArray]
    world_from_limb: Mapping[str, FloatArray]
    residuals: tuple[float, ...]
    h: float
    steps: int
    converged: bool
    images: int

    def __repr__(self) -> str:
        """Summary in numbers."""
        worst = max(self.residuals, default=0.0)
        return (
            f"Posture({len(self.angles)} angles, worst residual {1e3 * worst:.3f} mm, h={self.h:.3f} px of {self.images} "
            f"images, {self.steps} steps, {'converged' if self.converged else 'not converged'})"
        )


@dataclass(frozen=True, eq=False, repr=False)
class Postures:
    """N postures of `solve_many`: angles (N, n), joints (N, S, 3) [m] in the order of Chain.site_names, h (N,) [px],
    steps (N,), number of evaluated postures (N,), of those compared with the images (N,), converged (N,)."""

    angles: FloatArray
    joints: FloatArray
    h: FloatArray
    steps: FloatArray
    tried: FloatArray
    compared: FloatArray
    converged: npt.NDArray[np.bool_]

    def __repr__(self) -> str:
        """The counts."""
        return f"Postures({len(self.angles)}, {int(self.converged.sum())} converged)"


Rest: TypeAlias = Mapping[str, float] | npt.ArrayLike | Posture
"""Angles (n,) or a posture of the chain, for all joint angles; or name of an angle -> value [rad, m], for these alone."""


def rest_parts(chain: Chain, rest: Rest | None) -> list[tuple[int, float]]:
    """Index and value of every angle with a rest value; for whole postures all but the pose of a free root.

    Raises:
        BodyError: a name that is not an angle of the chain.
        MeasurementError: not finite, another number of angles than the chain has, or of another chain.
    """
    names = chain.angle_names
    if rest is None:
        return []
    if isinstance(rest, Mapping):
        unknown = [name for name in rest if name not in names]
        if unknown:
            raise BodyError(f"rest: expected some of {', '.join(names)}, found {', '.join(map(repr, unknown))}")
        values = _finite(list(rest.values()), len(rest))
        return [(names.index(name), value) for name, value in zip(rest, values, strict=True)]
    if isinstance(rest, Posture) and rest.angle_names != names:
        raise MeasurementError(f"rest: expected a posture of {chain!r}, found one of {', '.join(rest.angle_names)}")
    values = _finite(rest.angles if isinstance(rest, Posture) else rest, len(names))
    # The position of the root has no rest value.
    joints = 6 if names[:1] == ("root_x",) else 0
    return list(enumerate(values))[joints:]


def named_rest(chain: Chain, rest: Rest | None) -> dict[str, float]:
    """`rest_parts` by name."""
    return {chain.angle_names[index]: value for index, value in rest_parts(chain, rest)}


def _finite(values: npt.ArrayLike, count: int) -> list[float]:
    """An array of this many numbers.

    Raises:
        MeasurementError: another number of them, or not finite.
    """
    found = numbers("rest", values)
    if found.shape != (count,) or not np.isfinite(found).all():
        raise MeasurementError(f"rest: expected {count} finite numbers, found {values!r}")
    return [float(value) for value in found]


def solve(
    chain: Chain | Body,
    targets: Targets,
    *,
    images: Sequence[Silhouette] = (),
    start: npt.ArrayLike | Posture | None = None,
    world_from_base: npt.ArrayLike | None = None,
    others: Mapping[str, npt.ArrayLike] | None = None,
    rest: Rest | None = None,
    options: Options | None = None,
    **changes: Any,  # noqa: ANN401 - the fields of Options
) -> Posture:
    """Solve one posture (J10 eq. 4): targets by priority, silhouettes in the null space of the targets, a rest posture in the
    remaining null space, and limits throughout.

    Unreachable or contradictory targets give the weighted least-squares posture, with large residuals. Results are never NaN.

    Args:
        chain: chain to solve; a body means the chain of all its limbs with a free root.
        targets: site name -> position (3,) [m], or Targets. Sites may occur more than once.
        images: silhouettes; empty ones are not used.
        start: angles (n,) or a posture to start from; None: at rest.
        world_from_base: rigid (4, 4) pose of the base: of the body's root frame's origin, or of the parent of the
            chosen limbs; None: identity.
        others: known limbs of the body that are not on the chain: name -> rigid (4, 4) pose, e.g. `world_from_limb` of the
            posture of the other leg. With images, bones of the chain are kept outside of them.
        rest: posture towards which angles are pulled where targets and silhouettes leave them free: angles (n,), e.g.
            `chain.rest()`, or a posture, without the pose of a free root; or only some angles, name -> value [rad, m]. None:
            free angles keep their values.
        options: see Options.
        **changes: single fields of Options, e.g. `steps=30, margin=0.0`.

    Raises:
        BodyError: a site or angle that is not on the chain, or one of `others` that is on it or not in the body.
        MeasurementError: an invalid number; it names the argument.
    """
    chain = _chain(chain)
    options = chosen_options(options, changes)
    views = core_views(images)
    begin = start.angles if isinstance(start, Posture) else chain.rest() if start is None else start
    known = world_from_base, views, others
    angles, sites, (h, steps, _, _, converged), poses, residuals = solved(
        chain.core, vector(begin)[np.newaxis], target_parts(targets), None, *known, options, rest_parts(chain, rest)
    )
    return Posture(
        angles=angles[0],
        angle_names=chain.angle_names,
        joints=named(chain.site_names, sites[0]),
        world_from_limb=named(chain.limb_names, poses),
        residuals=residuals,
        h=float(h[0]),
        steps=int(steps[0]),
        converged=bool(converged[0]),
        images=len(views),
    )


def solve_many(
    chain: Chain,
    sites: Sequence[str],
    positions: npt.ArrayLike,
    *,
    images: Sequence[Silhouette] = (),
    starts: npt.ArrayLike | None = None,
    world_from_base: npt.ArrayLike | None = None,
    rest: Rest | None = None,
    options: Options | None = None,
    **changes: Any,  # noqa: ANN401 - the fields of Options
) -> Postures:
    """`solve` for N sets of positions (N, K, 3) [m] of K sites, with the same images, in one call on one core.

    Args:
        chain: chain to solve.
        sites: K site names.
        positions: target positions.
        images: silhouettes.
        starts: angles (n,) or (N, n); None: at rest.
        world_from_base: as in `solve`.
        rest: as in `solve`.
        options: see Options.
        **changes: single fields of Options.

    Raises:
        BodyError: a site or an angle that is not on the chain.
        MeasurementError: an invalid shape or number.
    """
    options = chosen_options(options, changes)
    places = np.ascontiguousarray(positions, dtype=np.float64)
    if places.ndim != 3 or places.shape[1:] != (len(sites), 3) or not np.isfinite(places).all():
        raise MeasurementError(f"positions: expected finite numbers (N, {len(sites)}, 3), found shape {places.shape}")
    n = len(chain.angle_names)
    begin = chain.rest() if starts is None else np.asarray(starts, dtype=np.float64)
    if begin.shape not in ((n,), (len(places), n)) or not np.isfinite(begin).all():
        raise MeasurementError(f"starts: expected finite numbers ({n},) or (N, {n}), found shape {begin.shape}")
    begin = np.ascontiguousarray(np.broadcast_to(begin, (len(places), n)))
    goals = [Target.at(site, (0.0, 0.0, 0.0)).parts() for site in sites]
    known = world_from_base, core_views(images), None
    angles, joints, (h, steps, tried, compared, converged), *_ = solved(
        chain.core, begin, goals, places, *known, options, rest_parts(chain, rest)
    )
    return Postures(angles, joints, h, steps, tried, compared, converged != 0.0)


def _chain(chain: Chain | Body) -> Chain:
    if not isinstance(chain, (Chain, Body)):
        raise MeasurementError(f"chain: expected an ik.Chain or a voodoo.Body, found {chain!r}")
    return chain if isinstance(chain, Chain) else Chain(chain)


class Follower:
    """Solves a sequence, each posture starting from the previous one."""

    def __init__(
        self,
        chain: Chain | Body,
        *,
        start: npt.ArrayLike | Posture | None = None,
        rest: Rest | Literal["mean"] | None = None,
        **changes: Any,  # noqa: ANN401 - the fields of Options
    ) -> None:
        """Initialize with a start posture.

        Args:
            chain: chain to solve.
            start: angles (n,) or a posture; None: at rest.
            rest: as in `solve`, for every posture; "mean": the mean of the start and all postures so far, so that
                unobserved angles return to their usual values.
            **changes: fields of Options.

        Raises:
            BodyError: an angle that is not on the chain.
            MeasurementError: an invalid option or angle.
        """
        self.chain = _chain(chain)
        self.options = chosen_options(None, changes)
        begin = start.angles if isinstance(start, Posture) else self.chain.rest() if start is None else start
        self.angles: FloatArray = np.array(vector(begin))
        self.chain.forward(self.angles)
        self._count = 1 if isinstance(rest, str) and rest == "mean" else 0
        self._rest = named_rest(self.chain, self.angles if self._count else rest)

    @property
    def rest(self) -> Mapping[str, float]:
        """Rest values of the next posture: name of an angle -> value [rad, m]."""
        return self._rest

    def step(
        self,
        targets: Targets,
        *,
        images: Sequence[Silhouette] = (),
        world_from_base: npt.ArrayLike | None = None,
        others: Mapping[str, npt.ArrayLike] | None = None,
    ) -> Posture:
        """The next posture; see `solve`. A rejected call leaves the follower unchanged.

        A frame without targets and images does not pull the posture towards the mean of the postures so far.
        """
        silent = bool(self._count) and not targets and not images
        posture = solve(
            self.chain,
            targets,
            images=images,
            start=self.angles,
            world_from_base=world_from_base,
            others=others,
            rest=None if silent else self._rest,
            options=self.options,
        )
        self.angles = posture.angles
        if self._count and not silent:
            self._count += 1
            now = named_rest(self.chain, posture)
            self._rest = {name: mean + (now[name] - mean) / self._count for name, mean in self._rest.items()}
        return posture

    def __repr__(self) -> str:
        """Chain and options."""
        return f"Follower({self.chain!r}, {self.options!r})"
