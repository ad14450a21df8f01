"""Arguments of voodoo.ik: options, targets, and their conversion to the form that the core takes."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import MeasurementError
from voodoo.measurements import FloatArray
from voodoo.model.joint import numbers_of, short

Vector: TypeAlias = Sequence[float] | FloatArray
Bone: TypeAlias = tuple[str, str, float]
"""Two sites and the radius [m] around the segment between them that must lie inside the silhouettes."""

_IDENTITY = np.eye(4)


def listed_bones(bones: Sequence[Bone] | None) -> list[Bone] | None:
    """Bones with plain floats.

    Raises:
        MeasurementError: not two sites and a radius of at least zero.
    """
    if bones is None:
        return None
    if isinstance(bones, str) or not isinstance(bones, Iterable):
        raise MeasurementError(f"bones: expected a list of (site, site, radius), found {short(bones)}")
    found: list[Bone] = []
    for bone in bones:
        try:
            first, second, radius = bone
            found.append((str(first), str(second), float(radius)))
        except (TypeError, ValueError, OverflowError):
            raise MeasurementError(f"bones: expected (site, site, radius), found {short(bone)}") from None
        if not 0.0 <= found[-1][2] < math.inf:
            raise MeasurementError(f"bones: expected a radius of at least 0 m, found {radius!r}")
    return found


def named(names: Sequence[str], values: FloatArray) -> MappingProxyType[str, FloatArray]:
    """Name -> row of values."""
    return MappingProxyType(dict(zip(names, values, strict=True)))


def listed_poses(poses: Mapping[str, npt.ArrayLike] | None) -> list[tuple[str, FloatArray]]:
    """Name and pose (4, 4) of limbs; the core checks them.

    Raises:
        MeasurementError: not a mapping, or poses that are not numbers.
    """
    if poses is None:
        return []
    if not isinstance(poses, Mapping):
        raise MeasurementError(f"others: expected limb name -> pose (4, 4), found {short(poses)}")
    return [(name, numbers("others", pose)) for name, pose in poses.items()]


def base_pose(pose: npt.ArrayLike | None) -> FloatArray:
    """A pose (4, 4), identity for None; the core checks it.

    Raises:
        MeasurementError: not numbers.
    """
    return _IDENTITY if pose is None else numbers("world_from_base", pose)


def vector(values: npt.ArrayLike) -> FloatArray:
    """Angles in a row; the core checks them.

    Raises:
        MeasurementError: not numbers.
    """
    return np.ascontiguousarray(numbers("angles", values)).reshape(-1)


def numbers(what: str, values: npt.ArrayLike) -> FloatArray:
    """An array.

    Raises:
        MeasurementError: not numbers; it names `what`.
    """
    return numbers_of(what, values, MeasurementError)


def three(what: str, values: Vector) -> FloatArray:
    """Three finite numbers.

    Raises:
        MeasurementError: it names `what`.
    """
    return numbers_of(what, values, MeasurementError, "three finite numbers", count=3)


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to solve.

    Args:
        steps: maximum number of steps of each priority level, and of the image (J10: 15).
        tolerance: a residual below this counts as zero [m].
        still: the search ends when a step changes no angle by more than this [rad].
        gain: fraction of the step h / |P grad h|^2 of the image criterion, above 0 to 1: alpha of J10 eq. 4.
        caution: damping of the image step if few samples lie outside, or the motion is along the optical axes: the
            smallest significant change of h per radian, as a fraction of the bones' length in the images; 0 trusts every
            pixel.
        largest_turn: largest change of an angle in one step [rad].
        margin: required depth of bones inside the silhouettes, in radii of their limbs, less the silhouette's border; 0 is
            J10's criterion.
        thin: a silhouette up to this many times that depth counts as the limb itself, and the bone is centered in it; 0: no
            bone is centered.
        bones: the segments that are projected; None: joint to joint.
    """

    steps: int = 15
    tolerance: float = 1e-6
    still: float = 1e-6
    gain: float = 1.0
    caution: float = 0.3
    largest_turn: float = 0.5
    margin: float = 1.1
    thin: float = 1.7
    bones: tuple[Bone, ...] | None = None

    def __post_init__(self) -> None:
        """Check the ranges.

        Raises:
            MeasurementError: it names the entry.
        """
        if isinstance(self.steps, bool) or not isinstance(self.steps, int) or not 0 <= self.steps <= 100_000:
            raise MeasurementError(f"steps: expected 0 to 100000, found {self.steps!r}")
        for name, low, high in (
            ("tolerance", 0.0, 1.0),
            ("still", 0.0, 1.0),
            ("gain", 1e-6, 1.0),
            ("caution", 0.0, 10.0),
            ("largest_turn", 1e-6, math.pi),
            ("margin", 0.0, 2.0),
            ("thin", 0.0, 3.0),
        ):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and low <= value <= high):
                raise MeasurementError(f"{name}: expected {low:g} to {high:g}, found {value!r}")
        listed_bones(self.bones)

    def of_images(self) -> tuple[list[Bone] | None, tuple[float, float]]:
        """The options of the image criterion as the core takes them."""
        return listed_bones(self.bones), (self.margin, self.thin)

    def parts(self) -> tuple[int, float, float, float, float, float]:
        """The options of the steps as the core takes them."""
        return (self.steps, self.tolerance, self.still, self.gain, self.caution, self.largest_turn)


def chosen_options(options: Options | None, changes: Mapping[str, Any]) -> Options:
    """Options, or the defaults with changes.

    Raises:
        MeasurementError: both, or a field that does not exist.
    """
    if options is not None and changes:
        raise MeasurementError(f"options: expected options or single fields, found both: {', '.join(changes)}")
    if options is not None and not isinstance(options, Options):
        raise MeasurementError(f"options: expected ik.Options, found {options!r}")
    known = Options.__dataclass_fields__
    if unknown := [name for name in changes if name not in known]:
        raise MeasurementError(f"options: expected some of {', '.join(known)}, found {', '.join(unknown)}")
    return options or Options(**changes)


TargetParts: TypeAlias = tuple[str, str, tuple[float, float, float, float, float, float], float, int]
"""Site, kind, values, weight and priority of a target."""


@dataclass(frozen=True)
class Target:
    """A target of a site. Create it with `at` or `on_ray`.

    Args:
        site: name of a site on the chain.
        kind: "position" or "line".
        values: x, y, z [m], 0, 0, 0; or unit direction and moment of a line in Pluecker form (R07 eq. 11).
        weight: weight relative to the other targets of the same priority.
        priority: 0 is the highest; a target never disturbs one of higher priority.
    """

    site: str
    kind: Literal["position", "line"]
    values: tuple[float, float, float, float, float, float]
    weight: float = 1.0
    priority: int = 0

    def __post_init__(self) -> None:
        """Check the numbers.

        Raises:
            MeasurementError: it names the field.
        """
        if not isinstance(self.site, str):
            raise MeasurementError(f"targets: expected names of sites, found {short(self.site)}")
        if self.kind not in ("position", "line"):
            raise MeasurementError(f"target {self.site}: kind: expected position or line, found {self.kind!r}")
        if len(self.values) != 6 or not all(map(math.isfinite, self.values)):
            raise MeasurementError(f"target {self.site}: expected finite meters, found {short(self.values)}")
        if not (isinstance(self.weight, (int, float)) and math.isfinite(self.weight) and self.weight > 0.0):
            raise MeasurementError(f"target {self.site}: weight: expected a number above zero, found {self.weight!r}")
        if isinstance(self.priority, bool) or not isinstance(self.priority, int) or self.priority < 0:
            raise MeasurementError(f"target {self.site}: priority: expected 0, 1, ..., found {self.priority!r}")

    @classmethod
    def at(cls, site: str, position: Vector, *, weight: float = 1.0, priority: int = 0) -> Target:
        """A site at a world position (3,) [m].

        Raises:
            MeasurementError: not three finite numbers, or a weight that is not above zero.
        """
        x, y, z = three(f"target {site}: position", position).tolist()
        return cls(site, "position", (x, y, z, 0.0, 0.0, 0.0), weight, priority)

    @classmethod
    def on_ray(cls, site: str, *, origin: Vector, direction: Vector, weight: float = 1.0, priority: int = 0) -> Target:
        """A site on the line through `origin` (3,) [m] along `direction` (3,), e.g. the ray of a pixel.

        Raises:
            MeasurementError: not three finite numbers, no direction, or a weight that is not above zero.
        """
        o, n = three(f"target {site}: origin", origin), three(f"target {site}: direction", direction)
        length = float(np.linalg.norm(n))
        if not 1e-12 < length < math.inf:
            raise MeasurementError(f"target {site}: direction: expected a vector other than zero, found {direction!r}")
        n = n / length
        a, b, c, d, e, f = (float(value) for value in np.concatenate([n, np.cross(o, n)]))
        return cls(site, "line", (a, b, c, d, e, f), weight, priority)

    def parts(self) -> TargetParts:
        """The target in the form that the core takes."""
        return (self.site, self.kind, self.values, self.weight, self.priority)


Targets: TypeAlias = Mapping[str, Vector] | Sequence[Target]


def target_parts(targets: Targets) -> list[TargetParts]:
    """Targets in the form that the core takes; a mapping holds positions.

    Raises:
        MeasurementError: neither, or a position is not three finite numbers.
    """
    if isinstance(targets, Mapping):
        targets = [Target.at(site, position) for site, position in targets.items()]
    if not isinstance(targets, Sequence) or not all(isinstance(target, Target) for target in targets):
        raise MeasurementError(f"targets: expected site -> position (3,), or a list of Target, found {short(targets)}")
    return [target.parts() for target in targets]


def solved(
    chain: _core.Chain,
    starts: FloatArray,
    goals: Sequence[TargetParts],
    positions: FloatArray | None,
    world_from_base: npt.ArrayLike | None,
    views: Sequence[_core.View],
    others: Mapping[str, npt.ArrayLike] | None,
    options: Options,
    rest: Sequence[tuple[int, float]],
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, tuple[float, ...]]:
    """What the core finds from starts (N, n): angles, sites, numbers, poses and residuals; see `voodoo.ik.solve`.

    Raises:
        BodyError: a site or limb that is not on the chain, or one of `others` that is on it.
        MeasurementError: an invalid number.
    """
    base, known = base_pose(world_from_base), listed_poses(others)
    return chain.solve(base, starts, goals, positions, *options.of_images(), views, known, options.parts(), rest)
