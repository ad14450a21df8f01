"""What the tests of inverse kinematics share: a camera in front of the person, and small questions about chains."""

import numpy as np

import voodoo

ARM = ("l_upperarm", "l_forearm")
BAR = """name = "bar"
[[limbs]]
name = "base"
shape = { length = 0.1, a0 = 0.05, b0 = 0.05, a1 = 0.05, b1 = 0.05 }
[[limbs]]
name = "bone"
parent = "base"
shape = { length = 0.4, a0 = 0.08, b0 = 0.08, a1 = 0.08, b1 = 0.08 }
joint = { name = "joint" }
"""


def shoulder(arm):
    return arm.forward(arm.rest())[1]["l_shoulder"]


def within(chain, angles):
    return bool((angles >= chain.limits[:, 0]).all() and (angles <= chain.limits[:, 1]).all())


def front_camera(height=1.0):
    """Looks along +x of the world from 3 m behind its origin: person in front of base_link."""
    camera = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    pose[:3, 3] = (-3.0, 0.0, height)
    return camera, pose
