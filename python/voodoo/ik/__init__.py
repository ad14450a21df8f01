"""Inverse kinematics with image constraints (J10) on exact joints: a posture from a few known points and silhouettes.

docs/how-to/inverse-kinematics.md explains the method; the solver is in the compiled core.
"""

from voodoo.ik.chain import Chain as Chain
from voodoo.ik.image import Silhouette as Silhouette
from voodoo.ik.image import signed_distance as signed_distance
from voodoo.ik.solve import Follower as Follower
from voodoo.ik.solve import Posture as Posture
from voodoo.ik.solve import Postures as Postures
from voodoo.ik.solve import Rest as Rest
from voodoo.ik.solve import solve as solve
from voodoo.ik.solve import solve_many as solve_many
from voodoo.ik.values import Bone as Bone
from voodoo.ik.values import Options as Options
from voodoo.ik.values import Target as Target
from voodoo.ik.values import Targets as Targets
