"""Rotations against SciPy's."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.spatial.transform import Rotation, Slerp

from voodoo.model.rotations import axes, euler_angles, matrix_of_turn, quaternions, turned_between

CHANCE = np.random.default_rng(4)
MATRICES = np.concatenate(
    [
        Rotation.random(300, rng=CHANCE).as_matrix(),
        Rotation.from_rotvec(CHANCE.normal(0.0, 1e-4, (50, 3))).as_matrix(),
        Rotation.from_rotvec(np.pi * np.eye(3)).as_matrix(),
        np.eye(3)[None],
    ]
)


def test_axes():
    assert (axes("z -x -y") @ (1.0, 2.0, 3.0)).tolist() == [3.0, -1.0, -2.0]
    np.testing.assert_array_equal(axes("x y z"), np.eye(3))


def test_quaternions():
    theirs = Rotation.from_matrix(MATRICES).as_quat()
    np.testing.assert_allclose(quaternions(MATRICES), theirs, atol=1e-15)
    np.testing.assert_array_equal(quaternions(MATRICES[0]), quaternions(MATRICES)[0])
    bent = MATRICES + CHANCE.normal(0.0, 1e-5, MATRICES.shape)
    np.testing.assert_allclose(quaternions(bent), Rotation.from_matrix(bent).as_quat(), atol=1e-12)


@pytest.mark.parametrize("size", [1.0, 1e-5, 0.0])
def test_turns(size):
    for turn in CHANCE.normal(0.0, size, (50, 3)):
        np.testing.assert_allclose(matrix_of_turn(turn), Rotation.from_rotvec(turn).as_matrix(), atol=1e-15)


@pytest.mark.parametrize("fraction", [0.0, 0.3, 1.0])
def test_half_way_between_two_rotations(fraction):
    for first, second in pairwise(MATRICES):
        theirs = Slerp([0.0, 1.0], Rotation.from_matrix([first, second]))(fraction).as_matrix()
        np.testing.assert_allclose(turned_between(first, second, fraction), theirs, atol=1e-14)


@pytest.mark.filterwarnings("ignore:Gimbal lock")
@pytest.mark.parametrize("order", ["ZXY", "XZY", "ZXZ"])
def test_euler_angles(order):
    locked = Rotation.from_euler(order, [[0.4, middle, 0.3] for middle in np.radians([-90.0, 0.0, 90.0, 180.0])])
    matrices = np.concatenate([MATRICES, locked.as_matrix()])
    theirs = Rotation.from_matrix(matrices).as_euler(order)
    apart = (euler_angles(matrices, order) - theirs + np.pi) % (2.0 * np.pi) - np.pi
    assert np.abs(apart).max() < 1e-7
    np.testing.assert_allclose(
        Rotation.from_euler(order, euler_angles(matrices, order)).as_matrix(), matrices, atol=1e-7
    )
