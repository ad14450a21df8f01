"""Who is off, the estimate or the reference: lab/experiments/reference_or_estimate.py."""

import numpy as np
import pytest

from lab_scripts import load_experiment
from voodoo.model.body import TaperedEllipticCylinder
from voodoo.model.camera import Camera

CAMERA = Camera(width=200, height=200, fx=200.0, fy=200.0, cx=99.5, cy=99.5)
LIMB = TaperedEllipticCylinder(length=0.3, a0=0.05, b0=0.05, a1=0.05, b1=0.05)
UPRIGHT = np.array([[0.0, -0.15, 2.0], [0.0, 0.15, 2.0]])
EMPTY, WALL = np.zeros((200, 200)), np.full((200, 200), 3.0)


def scene(middle_m):
    """A limb's front as a plate before a wall."""
    depth = WALL.copy()
    depth[84:116, 94:106] = middle_m
    return depth


def test_a_limb_that_is_visible_alone_wins():
    net = load_experiment("reference_or_estimate").net
    observed = net(UPRIGHT, LIMB, scene(1.96), EMPTY, CAMERA, False)
    aside = net(UPRIGHT + [0.3, 0.0, 0.0], LIMB, scene(1.96), EMPTY, CAMERA, False)
    assert observed > 0.9 and aside == pytest.approx(-1.0)


def test_what_another_limb_explains_or_hides_reports_nothing():
    net = load_experiment("reference_or_estimate").net
    assert net(UPRIGHT, LIMB, scene(1.96), scene(1.97), CAMERA, False) == 0.0
    assert net(UPRIGHT, LIMB, scene(1.5), scene(1.5), CAMERA, False) == 0.0


def test_a_missing_return_speaks_against_a_limb_only_where_the_body_was_cut_out():
    net = load_experiment("reference_or_estimate").net
    assert net(UPRIGHT, LIMB, EMPTY, EMPTY, CAMERA, False) == 0.0
    assert net(UPRIGHT, LIMB, EMPTY, EMPTY, CAMERA, True) == pytest.approx(-1.0)
