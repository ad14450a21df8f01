"""Bodies, or parts of them, with exact joints."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo.errors import BodyError, MeasurementError, of_kind
from voodoo.ik.image import Silhouette, core_views
from voodoo.ik.values import Bone, Options, base_pose, listed_bones, listed_poses, named, numbers, vector
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.joint import short


class Chain:
    """A body, or connected limbs of one, with exact joints; made from any Body, hence from TOML."""

    def __init__(self, body: Body, *, limbs: Sequence[str] = (), root: Literal["free", "fixed"] | None = None) -> None:
        """Lay out the joint angles.

        Args:
            body: any body.
            limbs: limb names; () for all of them. All but the first must be children of another one of them.
            root: "free": the first limb's pose has six unknowns; "fixed": it is static (a whole body) or rotates in its
                joint to a static base (chosen limbs). None: free for a whole body, fixed for chosen limbs.

        Raises:
            BodyError: an unknown limb, or limbs that are not connected.
            MeasurementError: another value of root, or a single name for limbs.
        """
        self.body = of_kind("body", body, Body, BodyError)
        listed = not isinstance(limbs, str) and isinstance(limbs, Iterable)
        if not listed or not all(isinstance(name, str) for name in limbs):
            raise MeasurementError(f"limbs: expected a list of names, found {short(limbs)}")
        root = root if root is not None else ("fixed" if len(limbs) else "free")
        if not isinstance(root, str) or root not in ("free", "fixed"):
            raise MeasurementError(f'root: expected "free" or "fixed", found {short(root)}')
        self.core: _core.Chain = _core.Chain(body.core, list(limbs), root == "free")
        angle_names, limits, limb_names, site_names = self.core.parts()
        self.angle_names: tuple[str, ...] = tuple(angle_names)
        self.limb_names: tuple[str, ...] = tuple(limb_names)
        self.site_names: tuple[str, ...] = tuple(site_names)
        self.limits: FloatArray = np.array(limits, dtype=np.float64).reshape(-1, 2)
        self.limits.setflags(write=False)

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
        poses, sites = self.core.forward(base_pose(world_from_base), vector(angles))
        return named(self.limb_names, poses), named(self.site_names, sites)

    def jacobian(self, site: str, angles: npt.ArrayLike, *, world_from_base: npt.ArrayLike | None = None) -> FloatArray:
        """Derivative (3, n) of the position of a site by the angles (J10 eq. 2).

        Raises:
            BodyError: the site is not on the chain.
            MeasurementError: the angles are not n finite numbers, or the base is not rigid.
        """
        return self.core.jacobian(base_pose(world_from_base), vector(angles), site)

    def project(
        self,
        world_from_limb: Mapping[str, npt.ArrayLike],
        *,
        world_from_base: npt.ArrayLike | None = None,
        closest: bool = True,
    ) -> FloatArray:
        """Angles (n,) of a pose of the whole body whose joints may be open (the papers' elastic bands).

        Args:
            world_from_limb: rigid (4, 4) of every limb of the body.
            world_from_base: pose of the base of the chain.
            closest: angles of the closed chain nearest to the pose in the least-squares sense; else only the rotation of each
                joint is read.

        Raises:
            MeasurementError: a limb is missing, or a matrix is not rigid.
        """
        if not isinstance(world_from_limb, Mapping):
            raise MeasurementError(
                f"world_from_limb: expected limb name -> pose (4, 4), found {short(world_from_limb)}"
            )
        missing = [name for name in self.body.limb_names if name not in world_from_limb]
        if missing:
            raise MeasurementError(f"world_from_limb: expected every limb of the body, found no {', '.join(missing)}")
        poses = [numbers(f"world_from_limb[{name}]", world_from_limb[name]) for name in self.body.limb_names]
        return np.array(self.core.project(base_pose(world_from_base), poses, closest), dtype=np.float64)

    def criterion(
        self,
        angles: npt.ArrayLike,
        images: Sequence[Silhouette],
        *,
        world_from_base: npt.ArrayLike | None = None,
        margin: float = Options.margin,
        thin: float = Options.thin,
        bones: Sequence[Bone] | None = None,
        others: Mapping[str, npt.ArrayLike] | None = None,
    ) -> tuple[float, FloatArray]:
        """The image criterion h [px] and its gradient (n,) (J10 eq. 5, 8).

        Args:
            angles: (n,).
            images, world_from_base, others: see `solve`.
            margin, thin, bones: see `Options`.

        Raises:
            BodyError: a site or limb in the wrong role: bones must be on the chain, `others` must not.
            MeasurementError: an invalid number; it names the argument.
        """
        _, depths = Options(margin=margin, thin=thin).of_images()
        views, known = core_views(images), listed_poses(others)
        return self.core.criterion(
            base_pose(world_from_base), vector(angles), listed_bones(bones), depths, views, known
        )

    def __repr__(self) -> str:
        """Limbs and unknowns."""
        return f"Chain({', '.join(self.limb_names)}; {len(self.angle_names)} angles)"
