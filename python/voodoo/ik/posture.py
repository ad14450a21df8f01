"""Results of the solver."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from voodoo.ik.values import FloatArray


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
