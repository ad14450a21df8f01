"""Inverse kinematics with image constraints (J10) on exact joints: a posture from a few known points and silhouettes.

docs/how-to/inverse-kinematics.md explains the method; the solver is in the compiled core.
"""

from voodoo.ik.chain import Chain
from voodoo.ik.image import Silhouette, signed_distance
from voodoo.ik.options import Options
from voodoo.ik.posture import Posture, Postures
from voodoo.ik.rest import Rest
from voodoo.ik.solve import Follower, solve, solve_many
from voodoo.ik.targets import Target, Targets
from voodoo.ik.values import Bone

__all__ = [
    "Bone",
    "Chain",
    "Follower",
    "Options",
    "Posture",
    "Postures",
    "Rest",
    "Silhouette",
    "Target",
    "Targets",
    "signed_distance",
    "solve",
    "solve_many",
]
