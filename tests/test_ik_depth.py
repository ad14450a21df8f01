"""Silhouettes with depths: bones lie behind what a depth camera sees, and no farther than their limb is thick."""

import numpy as np
import pytest

import voodoo
from ik_cases import BAR
from voodoo import ik

CAMERA = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
VISIBLE_M = 2.5
RADIUS_M = 0.08


def bar(distance, image):
    """Criterion, and derivative by the turn that moves its far end along the line of sight, of an upright bone in the middle of
    the picture at a distance [m]."""
    chain = ik.Chain(voodoo.Body.from_toml(BAR), limbs=("bone",))
    base = np.eye(4)
    base[:3, :3] = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    base[:3, 3] = (0.0, -0.2, distance)

    def h(angles):
        return chain.criterion(angles, [image], world_from_base=base, margin=1.0)

    angles = np.array([0.05, 0.02, 0.0])
    value, gradient = h(angles)
    numeric = [(h(angles + step)[0] - h(angles - step)[0]) / 2e-6 for step in np.eye(3) * 1e-6]
    assert gradient == pytest.approx(numeric, rel=1e-3, abs=1e-3)
    return value


def silhouette(half_width, depth):
    v, u = np.mgrid[:120, :160]
    mask = (np.abs(u - 79.5) < half_width) & (np.abs(v - 60) < 55)
    return ik.Silhouette(mask, camera=CAMERA, world_from_camera=np.eye(4), depth=depth)


def test_a_bone_lies_behind_what_is_visible():
    plane = np.full((120, 160), VISIBLE_M)
    wide = silhouette(60, plane)
    assert bar(VISIBLE_M + RADIUS_M, wide) == 0.0
    # In a wide silhouette something else may be seen before it; nothing can be seen through it.
    assert bar(VISIBLE_M + 6.0 * RADIUS_M, wide) == 0.0
    before = bar(VISIBLE_M - 2.0 * RADIUS_M, wide)
    assert before == pytest.approx(150.0 / 2.35 * 2.5 * RADIUS_M - 1.0, rel=0.15)
    assert bar(VISIBLE_M - 2.0 * RADIUS_M, silhouette(60, None)) == 0.0


def test_a_limb_that_is_visible_alone_is_no_farther_than_it_is_thick():
    plane = np.full((120, 160), VISIBLE_M)
    alone, without = silhouette(6, plane), silhouette(6, None)
    for distance, more in ((VISIBLE_M + 1.5 * RADIUS_M, False), (VISIBLE_M + 6.0 * RADIUS_M, True)):
        deep, flat = bar(distance, alone), bar(distance, without)
        assert (deep > flat + 1.0) == more and deep >= flat


def test_depths_beside_the_person_and_edges_report_nothing():
    v, u = np.mgrid[:120, :160]
    for depth in (np.zeros((120, 160)), np.full((120, 160), np.nan), np.full((120, 160), np.inf), 2.0 + 0.5 * (u % 2)):
        assert bar(VISIBLE_M - 0.4, silhouette(60, depth)) == 0.0
    # A wall behind a bone that lies outside of the silhouette: only the silhouette speaks.
    mask = (u < 40) & (np.abs(v - 60) < 55)
    wall = np.where(mask, 2.0, 5.0)
    deep, flat = (
        ik.Silhouette(mask, camera=CAMERA, world_from_camera=np.eye(4), depth=depth) for depth in (wall, None)
    )
    assert bar(VISIBLE_M, deep) == bar(VISIBLE_M, flat) > 10.0


def test_a_lens_is_taken_out_of_depths_as_it_is_out_of_silhouettes():
    bent = voodoo.Camera(160, 120, 150.0, 150.0, 79.5, 59.5, distortion=(-0.25, 0.05, 0.0, 0.0))
    # A board on the left is nearer; its border, at x = -0.12 z, runs beside the bone in the middle.
    x, y = np.moveaxis(bent.rays(), -1, 0)
    depth, mask = np.where(x < -0.12, VISIBLE_M - 0.5, VISIBLE_M), (np.abs(x) < 0.4) & (np.abs(y) < 0.36)
    through = ik.Silhouette(mask, camera=bent, world_from_camera=np.eye(4), depth=depth)
    v, u = np.mgrid[:120, :160]
    x, y = (u - 79.5) / 150.0, (v - 59.5) / 150.0
    depth, mask = np.where(x < -0.12, VISIBLE_M - 0.5, VISIBLE_M), (np.abs(x) < 0.4) & (np.abs(y) < 0.36)
    straight = ik.Silhouette(mask, camera=CAMERA, world_from_camera=np.eye(4), depth=depth)
    for distance in (VISIBLE_M - 2.0 * RADIUS_M, VISIBLE_M + RADIUS_M):
        assert bar(distance, through) == pytest.approx(bar(distance, straight), abs=0.2)


@pytest.mark.parametrize(
    ("depth", "camera", "words"),
    [
        (np.ones((160, 120)), CAMERA, "shape"),
        (np.full((120, 160), -1.0), CAMERA, "negative"),
        ("far", CAMERA, "expected numbers"),
        (np.full((120, 160), 2500, np.uint16), CAMERA, "expected meters, as floats, found uint16"),
    ],
)
def test_depths_that_cannot_be_used(depth, camera, words):
    with pytest.raises(voodoo.MeasurementError, match=words):
        ik.Silhouette(np.ones((120, 160)), camera=camera, world_from_camera=np.eye(4), depth=depth)
