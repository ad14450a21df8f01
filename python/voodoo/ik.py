"""Inverse kinematics with image constraints (J10) on exact joints: a posture from a few known points and silhouettes.

docs/ik.md explains the method; the solver is in the compiled core.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import cv2
import numpy as np
import numpy.typing as npt

from voodoo import _core
from voodoo.body import Body
from voodoo.camera import Camera
from voodoo.errors import MeasurementError

FloatArray: TypeAlias = npt.NDArray[np.float64]
Vector: TypeAlias = Sequence[float] | FloatArray
Bone: TypeAlias = tuple[str, str, float]
"""Two sites and the least depth [m] of the segment between them inside the silhouette."""

_IDENTITY = np.eye(4)
_UNDISTORTED = 0.5


@dataclass(frozen=True)
class Target:
    """What a site shall reach. Use `at` or `on_ray`.

    Args:
        site: name of a site on the chain.
        kind: "position" or "line".
        values: x, y, z [m], 0, 0, 0; or unit direction and moment of a line in Pluecker form (R07 eq. 11).
        weight: against the other targets of the same priority.
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
        if self.kind not in ("position", "line"):
            raise MeasurementError(f"target {self.site}: kind: expected position or line, found {self.kind!r}")
        if len(self.values) != 6 or not all(map(math.isfinite, self.values)):
            raise MeasurementError(f"target {self.site}: expected finite metres, found {self.values}")
        if not (math.isfinite(self.weight) and self.weight > 0.0):
            raise MeasurementError(f"target {self.site}: weight: expected a number above zero, found {self.weight!r}")
        if isinstance(self.priority, bool) or not isinstance(self.priority, int) or self.priority < 0:
            raise MeasurementError(f"target {self.site}: priority: expected 0, 1, ..., found {self.priority!r}")

    @classmethod
    def at(cls, site: str, position: Vector, *, weight: float = 1.0, priority: int = 0) -> Target:
        """A site at a world position (3,) [m].

        Raises:
            MeasurementError: not three finite numbers, or a weight that is not above zero.
        """
        x, y, z = _three(f"target {site}: position", position)
        return cls(site, "position", (x, y, z, 0.0, 0.0, 0.0), weight, priority)

    @classmethod
    def on_ray(cls, site: str, *, origin: Vector, direction: Vector, weight: float = 1.0, priority: int = 0) -> Target:
        """A site on the line through `origin` (3,) [m] along `direction` (3,), as a pixel tells it.

        Raises:
            MeasurementError: not three finite numbers, no direction, or a weight that is not above zero.
        """
        o = np.array(_three(f"target {site}: origin", origin))
        n = np.array(_three(f"target {site}: direction", direction))
        length = float(np.linalg.norm(n))
        if not 1e-12 < length < math.inf:
            raise MeasurementError(f"target {site}: direction: expected a vector other than zero, found {direction!r}")
        n /= length
        a, b, c, d, e, f = (float(value) for value in np.concatenate([n, np.cross(o, n)]))
        return cls(site, "line", (a, b, c, d, e, f), weight, priority)

    def parts(self) -> tuple[str, str, tuple[float, ...], float, int]:
        """The target as the core takes it."""
        return (self.site, self.kind, self.values, self.weight, self.priority)

    def residual(self, position: FloatArray) -> float:
        """Distance [m] of a position (3,) from the target."""
        first, second = np.array(self.values[:3]), np.array(self.values[3:])
        offset = position - first if self.kind == "position" else np.cross(position, first) - second
        return float(np.linalg.norm(offset))


Targets: TypeAlias = Mapping[str, Vector] | Sequence[Target]


class Silhouette:
    """The person's outline in one calibrated picture, as its Euclidean distance transform (J10 section 3)."""

    def __init__(self, mask: npt.ArrayLike, *, camera: Camera, world_from_camera: npt.ArrayLike) -> None:
        """Transform a mask; lens distortion is taken out of it first.

        Args:
            mask: (height, width), true (or not 0) where the person is.
            camera: its calibration.
            world_from_camera: rigid (4, 4) pose of the optical frame.

        Raises:
            MeasurementError: the mask has not the camera's size, or the pose is not rigid.
        """
        person = np.asarray(mask)
        if person.shape != (camera.height, camera.width):
            raise MeasurementError(
                f"mask: expected shape {(camera.height, camera.width)} of its camera, found {person.shape}"
            )
        person = (person != 0).astype(np.uint8)
        if camera.distorted:
            person = _undistorted(person, camera)
        self.camera = camera
        self.distance: npt.NDArray[np.float32] = signed_distance(person)
        self.distance.setflags(write=False)
        # A picture without the person says nothing; it takes no part.
        self.empty = not person.any()
        pose = np.asarray(world_from_camera, dtype=np.float64)
        if pose.shape != (4, 4) or not np.isfinite(pose).all():
            raise MeasurementError(f"world_from_camera: expected a rigid 4x4 transform, found {world_from_camera!r}")
        intrinsics = (camera.fx, camera.fy, camera.cx, camera.cy)
        # The core checks that the pose is rigid, so the inverse is the transposed one.
        inverse = np.eye(4)
        inverse[:3, :3] = pose[:3, :3].T
        inverse[:3, 3] = -pose[:3, :3].T @ pose[:3, 3]
        self._core = _core.View(self.distance, intrinsics, inverse)

    @property
    def core(self) -> _core.View:
        """The silhouette of the compiled core."""
        return self._core

    def __repr__(self) -> str:
        """Size, and whether there is anyone in it."""
        height, width = self.distance.shape
        return f"Silhouette({width}x{height}, {'empty' if self.empty else 'a person'})"


def signed_distance(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.float32]:
    """Distance (height, width) [px] to the border of a mask, negative inside; its zero is half-way between two
    pixels."""
    if mask.all():
        return np.full(mask.shape, -float(max(mask.shape)), dtype=np.float32)
    if not mask.any():
        return np.zeros(mask.shape, dtype=np.float32)
    outside = cv2.distanceTransform((mask == 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    inside = cv2.distanceTransform((mask != 0).astype(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_PRECISE)
    distance = np.where(mask != 0, 0.5 - inside, outside - 0.5)
    return np.ascontiguousarray(distance, dtype=np.float32)


@dataclass(frozen=True, eq=False, repr=False)
class Posture:
    """What a solve found; immutable. World frame, metres, radians.

    Attributes:
        angles: (n,) in the order of `angle_names`, within the limits.
        angle_names: see Chain.angle_names.
        joints: position (3,) of every site on the chain.
        world_from_limb: pose (4, 4) of every limb of the chain.
        residuals: distance of every target, in the order they were given [m].
        h: image criterion [px] (J10 eq. 5); 0 without images.
        steps: steps used.
        converged: the angles came to rest; what residual is left cannot be removed from here.
        images: silhouettes that took part; empty ones do not.
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
        """The numbers that say how it went."""
        worst = max(self.residuals, default=0.0)
        return (
            f"Posture({len(self.angles)} angles, worst residual {1e3 * worst:.3f} mm, h={self.h:.3f} px of {self.images} "
            f"images, {self.steps} steps, {'converged' if self.converged else 'not converged'})"
        )


class Chain:
    """A body, or limbs of one that hang together, with exact joints; made from any Body, hence from TOML."""

    def __init__(self, body: Body, *, limbs: Sequence[str] = (), root: Literal["free", "fixed"] | None = None) -> None:
        """Lay out the joint angles.

        Args:
            body: any body.
            limbs: limb names; () for all of them. All but the first must hang on another one of them.
            root: "free": the first limb's pose are six unknowns; "fixed": it stands still (a whole body) or turns in
            its
                joint to a base that does (chosen limbs). None: free for a whole body, fixed for chosen limbs.

        Raises:
            BodyError: an unknown limb, or limbs that do not hang together.
            MeasurementError: another word for root.
        """
        root = root if root is not None else ("fixed" if limbs else "free")
        if root not in ("free", "fixed"):
            raise MeasurementError(f'root: expected "free" or "fixed", found {root!r}')
        self.body = body
        self._core = _core.Chain(body.core, list(limbs), root == "free")
        self.angle_names: tuple[str, ...] = tuple(self._core.angle_names)
        self.limb_names: tuple[str, ...] = tuple(self._core.limb_names)
        self.site_names: tuple[str, ...] = tuple(self._core.site_names)
        self.limits: FloatArray = np.array(self._core.limits, dtype=np.float64).reshape(-1, 2)
        self.limits.setflags(write=False)

    @property
    def core(self) -> _core.Chain:
        """The chain of the compiled core."""
        return self._core

    def rest(self) -> FloatArray:
        """The angles (n,) at rest: zeros, moved into the limits."""
        return np.clip(np.zeros(len(self.angle_names)), self.limits[:, 0], self.limits[:, 1])

    def forward(
        self, angles: npt.ArrayLike, *, world_from_base: npt.ArrayLike | None = None
    ) -> tuple[Mapping[str, FloatArray], Mapping[str, FloatArray]]:
        """Poses (4, 4) of the limbs and positions (3,) [m] of the sites at angles (n,).

        Raises:
            MeasurementError: the angles are not n finite numbers, or the base is not rigid.
        """
        poses, sites = self._core.forward(_base(world_from_base), _vector(angles))
        return _named(self.limb_names, poses), _named(self.site_names, sites)

    def jacobian(self, site: str, angles: npt.ArrayLike, *, world_from_base: npt.ArrayLike | None = None) -> FloatArray:
        """Derivative (3, n) of the position of a site by the angles (J10 eq. 2).

        Raises:
            BodyError: the site is not on the chain.
            MeasurementError: the angles are not n finite numbers, or the base is not rigid.
        """
        return self._core.jacobian(_base(world_from_base), _vector(angles), site)

    def project(
        self,
        world_from_limb: Mapping[str, npt.ArrayLike],
        *,
        world_from_base: npt.ArrayLike | None = None,
        closest: bool = True,
    ) -> FloatArray:
        """Angles (n,) of a pose of the whole body whose joints may be apart (the papers' elastic bands).

        Args:
            world_from_limb: rigid (4, 4) of every limb of the body.
            world_from_base: where the chain is rooted.
            closest: of the closed chain nearest to the pose in the least-squares sense; else only read each joint's
            turn.

        Raises:
            MeasurementError: a limb is missing, or a matrix is not rigid.
        """
        missing = [name for name in self.body.limb_names if name not in world_from_limb]
        if missing:
            raise MeasurementError(f"world_from_limb: expected every limb of the body, found no {', '.join(missing)}")
        poses = [np.asarray(world_from_limb[name], dtype=np.float64) for name in self.body.limb_names]
        return np.array(self._core.project(_base(world_from_base), poses, closest), dtype=np.float64)

    def criterion(
        self,
        angles: npt.ArrayLike,
        images: Sequence[Silhouette],
        *,
        world_from_base: npt.ArrayLike | None = None,
        margin: float = 1.0,
        bones: Sequence[Bone] | None = None,
    ) -> tuple[float, FloatArray]:
        """The image criterion h [px] and its gradient (n,) (J10 eq. 5, 8); see `solve` for the arguments."""
        views = [image.core for image in images if not image.empty]
        return self._core.criterion(_base(world_from_base), _vector(angles), _bones(bones), margin, views)

    def __repr__(self) -> str:
        """Limbs and unknowns."""
        return f"Chain({', '.join(self.limb_names)}; {len(self.angle_names)} angles)"


@dataclass(frozen=True, kw_only=True)
class Options:
    """How to solve.

    Args:
        steps: most steps of each priority level, and of the image (J10: 15).
        tolerance: a residual below this is zero [m].
        still: a step that changes no angle by more ends the search [rad].
        gain: share of the step h / |P grad h|^2 of the image criterion, above 0 to 1: alpha of J10 eq. 4.
        caution: damping of the image step where few samples lie outside, or the cameras look along the motion: the
        change
            of h per radian, as a share of the bones' length in the images, that counts; 0 trusts every pixel.
        largest_turn: largest change of an angle in one step [rad].
        margin: how deep bones shall lie inside the silhouettes, in radii of their limbs; 0 is J10's criterion.
        bones: the segments that are projected; None: joint to joint.
    """

    steps: int = 15
    tolerance: float = 1e-6
    still: float = 1e-6
    gain: float = 1.0
    caution: float = 0.4
    largest_turn: float = 0.5
    margin: float = 1.0
    bones: tuple[Bone, ...] | None = field(default=None)

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
        ):
            value = getattr(self, name)
            if not (isinstance(value, (int, float)) and low <= value <= high):
                raise MeasurementError(f"{name}: expected {low:g} to {high:g}, found {value!r}")

    def parts(self) -> tuple[int, float, float, float, float, float]:
        """The options as the core takes them."""
        return (self.steps, self.tolerance, self.still, self.gain, self.caution, self.largest_turn)


def solve(
    chain: Chain | Body,
    targets: Targets,
    *,
    images: Sequence[Silhouette] = (),
    start: npt.ArrayLike | Posture | None = None,
    world_from_base: npt.ArrayLike | None = None,
    options: Options | None = None,
    **changes: Any,  # noqa: ANN401 - the fields of Options
) -> Posture:
    """One posture (J10 eq. 4): targets by priority, the silhouettes in what they leave free, limits throughout.

    Unreachable or contradictory targets give the posture of least weighted squares; their residuals say so. Nothing
    here is
    ever NaN.

    Args:
        chain: what moves; a body stands for the chain of all its limbs with a free root.
        targets: site name -> position (3,) [m], or Targets. Sites may occur more than once.
        images: silhouettes; empty ones take no part.
        start: angles (n,) or a posture to start from; None: at rest.
        world_from_base: rigid (4, 4) pose of the base: of the body's root frame's origin, or of the parent of the
        chosen
            limbs; None: identity.
        options: see Options.
        **changes: single fields of Options, e.g. `steps=30, margin=0.8`.

    Raises:
        BodyError: a site that is not on the chain.
        MeasurementError: a number that cannot be used; it says which.
    """
    chain = chain if isinstance(chain, Chain) else Chain(chain)
    options = _options(options, changes)
    wanted = _targets(targets)
    views = [image.core for image in images if not image.empty]
    begin = start.angles if isinstance(start, Posture) else chain.rest() if start is None else start
    angles, poses, sites, steps, converged, h = chain.core.solve(
        _base(world_from_base),
        _vector(begin),
        [target.parts() for target in wanted],
        _bones(options.bones),
        options.margin,
        views,
        options.parts(),
    )
    joints = _named(chain.site_names, sites)
    return Posture(
        angles=angles,
        angle_names=chain.angle_names,
        joints=joints,
        world_from_limb=_named(chain.limb_names, poses),
        residuals=tuple(target.residual(joints[target.site]) for target in wanted),
        h=h,
        steps=steps,
        converged=converged,
        images=len(views),
    )


@dataclass(frozen=True, eq=False, repr=False)
class Postures:
    """N postures of `solve_many`: angles (N, n), joints (N, S, 3) [m] in the order of Chain.site_names, h (N,) [px],
    steps
    (N,), converged (N,)."""

    angles: FloatArray
    joints: FloatArray
    h: FloatArray
    steps: FloatArray
    converged: npt.NDArray[np.bool_]

    def __repr__(self) -> str:
        """The counts."""
        return f"Postures({len(self.angles)}, {int(self.converged.sum())} converged)"


def solve_many(
    chain: Chain,
    sites: Sequence[str],
    positions: npt.ArrayLike,
    *,
    images: Sequence[Silhouette] = (),
    starts: npt.ArrayLike | None = None,
    world_from_base: npt.ArrayLike | None = None,
    options: Options | None = None,
    **changes: Any,  # noqa: ANN401 - the fields of Options
) -> Postures:
    """`solve` for N sets of positions (N, K, 3) [m] of K sites, with the same images, in one call on one core.

    Args:
        chain: what moves.
        sites: K site names.
        positions: where they shall be.
        images: silhouettes.
        starts: angles (n,) or (N, n); None: at rest.
        world_from_base: as in `solve`.
        options: see Options.
        **changes: single fields of Options.

    Raises:
        BodyError: a site that is not on the chain.
        MeasurementError: a shape or a number that cannot be used.
    """
    options = _options(options, changes)
    places = np.ascontiguousarray(positions, dtype=np.float64)
    if places.ndim != 3 or places.shape[1:] != (len(sites), 3) or not np.isfinite(places).all():
        raise MeasurementError(f"positions: expected finite numbers (N, {len(sites)}, 3), found shape {places.shape}")
    n = len(chain.angle_names)
    begin = chain.rest() if starts is None else np.asarray(starts, dtype=np.float64)
    if begin.shape not in ((n,), (len(places), n)) or not np.isfinite(begin).all():
        raise MeasurementError(f"starts: expected finite numbers ({n},) or (N, {n}), found shape {begin.shape}")
    begin = np.ascontiguousarray(np.broadcast_to(begin, (len(places), n)))
    goals = [Target.at(site, (0.0, 0.0, 0.0)).parts() for site in sites]
    views = [image.core for image in images if not image.empty]
    found = chain.core.solve_many(
        _base(world_from_base), begin, goals, places, _bones(options.bones), options.margin, views, options.parts()
    )
    angles, joints, h, steps, converged = found
    return Postures(angles, joints, h, steps, converged != 0.0)


class Follower:
    """Solves a sequence, each posture from the one before."""

    def __init__(self, chain: Chain | Body, *, start: npt.ArrayLike | Posture | None = None, **changes: Any) -> None:  # noqa: ANN401
        """Stand at a start.

        Args:
            chain: what moves.
            start: angles (n,) or a posture; None: at rest.
            **changes: fields of Options.

        Raises:
            MeasurementError: an option or an angle that cannot be used.
        """
        self.chain = chain if isinstance(chain, Chain) else Chain(chain)
        self.options = _options(None, changes)
        begin = start.angles if isinstance(start, Posture) else self.chain.rest() if start is None else start
        self.angles: FloatArray = np.array(_vector(begin))
        self.chain.forward(self.angles)

    def step(
        self,
        targets: Targets,
        *,
        images: Sequence[Silhouette] = (),
        world_from_base: npt.ArrayLike | None = None,
    ) -> Posture:
        """The next posture; see `solve`. A refused call leaves the follower where it was."""
        posture = solve(
            self.chain,
            targets,
            images=images,
            start=self.angles,
            world_from_base=world_from_base,
            options=self.options,
        )
        self.angles = posture.angles
        return posture

    def __repr__(self) -> str:
        """Chain and options."""
        return f"Follower({self.chain!r}, {self.options!r})"


def _options(options: Options | None, changes: Mapping[str, Any]) -> Options:
    if options is not None and changes:
        raise MeasurementError(f"options: expected options or single fields, found both: {', '.join(changes)}")
    if options is not None:
        return options
    try:
        return Options(**changes)
    except TypeError:
        known = Options.__dataclass_fields__
        unknown = [name for name in changes if name not in known]
        raise MeasurementError(f"options: expected some of {', '.join(known)}, found {', '.join(unknown)}") from None


def _targets(targets: Targets) -> list[Target]:
    if isinstance(targets, Mapping):
        return [Target.at(site, position) for site, position in targets.items()]
    return list(targets)


def _bones(bones: Sequence[Bone] | None) -> list[Bone] | None:
    return None if bones is None else [(first, second, float(radius)) for first, second, radius in bones]


def _named(names: Sequence[str], values: FloatArray) -> Mapping[str, FloatArray]:
    return MappingProxyType(dict(zip(names, values, strict=True)))


def _base(pose: npt.ArrayLike | None) -> FloatArray:
    return _IDENTITY if pose is None else np.asarray(pose, dtype=np.float64)


def _vector(values: npt.ArrayLike) -> FloatArray:
    return np.asarray(values, dtype=np.float64).reshape(-1)


def _three(what: str, values: Vector) -> tuple[float, float, float]:
    try:
        x, y, z = (float(value) for value in np.asarray(values, dtype=np.float64).reshape(-1))
    except (TypeError, ValueError):
        raise MeasurementError(f"{what}: expected three numbers, found {values!r}") from None
    return x, y, z


def _undistorted(mask: npt.NDArray[np.uint8], camera: Camera) -> npt.NDArray[np.uint8]:
    """The mask as a pinhole camera of the same focal lengths and centre would see it."""
    u, v = np.meshgrid(np.arange(camera.width, dtype=np.float64), np.arange(camera.height, dtype=np.float64))
    rays = [(u - camera.cx) / camera.fx, (v - camera.cy) / camera.fy, np.ones_like(u)]
    pixels = camera.project(np.stack(rays, axis=-1).reshape(-1, 3)).astype(np.float32)
    at = pixels.reshape(camera.height, camera.width, 2)
    soft = cv2.remap(mask.astype(np.float32), at[..., 0], at[..., 1], cv2.INTER_LINEAR)
    return np.asarray(soft >= _UNDISTORTED, dtype=np.uint8)
