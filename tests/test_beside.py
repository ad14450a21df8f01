"""A depth camera's points in the picture of a camera beside it: the compiled functions against plain NumPy."""

import cv2
import numpy as np
import pytest

from voodoo import Camera, MeasurementError, _core

CAMERA = Camera(64, 48, 50.0, 52.0, 31.5, 23.5)


def pose(angle, shift):
    result = np.eye(4)
    result[:2, :2] = [[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]
    result[:3, 3] = shift
    return result


def within(depth, **changes):
    options = {
        "step": 1,
        "rows": (0, depth.shape[0]),
        "columns": (0, depth.shape[1]),
        "low": np.array([-0.8, -0.6, 1.0]),
        "high": np.array([0.7, 0.9, 2.4]),
        "world_from_sensor": pose(0.3, (0.1, 0.0, -0.2)),
        "other_from_sensor": pose(-0.1, (0.05, 0.02, 0.01)),
    }
    return _core.points_within(depth, CAMERA.rays(), **(options | changes))


def noisy(step=1, seed=1):
    chance = np.random.default_rng(seed)
    depth = chance.uniform(0.5, 4.0, (-(-48 // step), -(-64 // step))).astype(np.float32)
    depth[chance.random(depth.shape) < 0.1] = 0.0
    depth[3, 4], depth[5, 6], depth[7, 8] = np.nan, np.inf, -1.0
    return depth


@pytest.mark.parametrize("step", [1, 3])
def test_points_within_a_box_in_another_camera(step):
    depth = noisy(step)
    rows, columns = (2, depth.shape[0] - 1), (1, depth.shape[1] - 3)
    found, index = within(depth, step=step, rows=rows, columns=columns)
    good = np.isfinite(depth) & (depth > 0.0)
    z = np.where(good, depth, 1.0)
    points = np.dstack([CAMERA.rays()[::step, ::step] * z[..., None], z]).astype(np.float64)
    first, second = pose(0.3, (0.1, 0.0, -0.2)), pose(-0.1, (0.05, 0.02, 0.01))
    world = points @ first[:3, :3].T + first[:3, 3]
    chosen = good & (world > (-0.8, -0.6, 1.0)).all(axis=2) & (world < (0.7, 0.9, 2.4)).all(axis=2)
    chosen[: rows[0]] = chosen[rows[1] :] = False
    chosen[:, : columns[0]] = chosen[:, columns[1] :] = False
    assert 20 < chosen.sum() < chosen.size / 2
    np.testing.assert_array_equal(index, np.flatnonzero(chosen))
    np.testing.assert_allclose(found, points[chosen] @ second[:3, :3].T + second[:3, 3], atol=1e-6)


@pytest.mark.parametrize(
    "changes",
    [{"rows": (0, 49)}, {"columns": (0, 65)}, {"step": 2}, {"step": 0}],
    ids=["rows", "columns", "step", "none"],
)
def test_a_window_that_does_not_fit_is_refused(changes):
    with pytest.raises(MeasurementError, match="window: expected"):
        within(noisy(), **changes)


def test_points_fall_into_pixels_and_the_nearest_counts():
    pixels = np.array([[2.4, 1.0], [1.6, 0.6], [5.0, 3.0], [np.nan, 1.0], [-0.6, 1.0], [7.6, 2.0], [-0.4, 2.5]])
    points = np.column_stack([np.zeros((7, 2)), [2.0, 1.5, 3.0, 1.0, 1.0, 1.0, 4.0]])
    marks = np.array([False, False, True, True, True, True, False])
    seen, marked, inside, corner, nearest = _core.splat(pixels, points, marks, height=4, width=8)
    assert inside.tolist() == [0, 1, 2, 6]
    assert np.argwhere(seen).tolist() == [[1, 2], [2, 0], [3, 5]]
    assert np.argwhere(marked).tolist() == [[3, 5]]
    expected = np.full((4, 8), np.inf, np.float32)
    expected[1, 2], expected[2, 0], expected[3, 5] = 1.5, 4.0, 3.0  # a half goes to the even pixel
    assert corner == (1, 0)
    np.testing.assert_array_equal(nearest, expected[1:, :6])
    assert _core.splat(pixels, points, None, height=4, width=8)[1] is None
    nothing = _core.splat(np.full((2, 2), np.nan), np.ones((2, 3)), None, height=4, width=8)
    assert not nothing[0].any() and nothing[4].size == 0


def test_the_nearest_surface_around_a_place():
    chance = np.random.default_rng(5)
    pixels = chance.uniform(0.0, 40.0, (600, 2))
    depths = np.where(pixels[:, 0] < 20.0, 2.0, 3.0) + chance.normal(0.0, 0.01, 600)
    still, among = pixels[:, 0] < 20.0, pixels[:, 0] >= 20.0
    near = np.hypot(*(pixels - (20.0, 20.0)).T) < 8.0
    for chosen, moved in ((None, True), (among, False)):
        there = np.sort(depths[near if chosen is None else near & chosen])
        surface = there[np.abs(there - there[(len(there) - 1) // 5]) < 0.1]
        found = _core.nearest_surface(pixels, depths, still, pixel=(20.0, 20.0), radius=8.0, among=chosen)
        assert found == (surface[len(surface) // 2], moved)
    few = np.zeros(600, dtype=bool)
    few[np.flatnonzero(near)[:2]] = True  # two of them are too few to tell
    assert _core.nearest_surface(pixels, depths, None, pixel=(20.0, 20.0), radius=8.0, among=few)[0] == pytest.approx(
        2, abs=0.1
    )
    assert _core.nearest_surface(pixels, depths, None, pixel=(90.0, 20.0), radius=8.0) is None


def test_each_place_is_looked_at_among_the_points_of_its_region():
    chance = np.random.default_rng(6)
    pixels = np.vstack([chance.uniform(0.0, 40.0, (600, 2)), [[np.nan, 3.0], [-5.0, 3.0], [3.0, 99.0]]])
    depths = np.where(pixels[:, 0] < 20.0, 2.0, 3.0)
    labels = np.zeros((41, 41), np.int32)
    labels[:, 20:] = 7
    u, v = np.rint(np.nan_to_num(pixels, nan=-1.0)).astype(int).T
    inside = (u >= 0) & (v >= 0) & (u < 41) & (v < 41)
    of = np.where(inside, labels[v * inside, u * inside], -1)
    places = [((20.0, 20.0), 7), ((20.0, 20.0), 0), ((20.0, 20.0), 5), ((90.0, 90.0), 7)]
    found = _core.nearest_surfaces(pixels, depths, None, labels=labels, places=places, radius=8.0)
    alone = [
        _core.nearest_surface(pixels, depths, None, pixel=place, radius=8.0, among=of == region)
        for place, region in places
    ]
    assert found == alone == [(3.0, False), (2.0, False), (2.0, False), None]
    with pytest.raises(MeasurementError, match="depths: expected"):
        _core.nearest_surfaces(pixels, depths[1:], None, labels=labels, places=places, radius=8.0)


def test_bins_are_those_of_opencv():
    chance = np.random.default_rng(7)
    image = chance.integers(0, 256, (90, 70, 3), dtype=np.uint8)
    image[:20] //= 8
    luma, cr, cb = (plane.astype(int) for plane in cv2.split(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)))
    bins = _core.color_bins(image)
    number = (cr >> 2) * 512 + (cb >> 2) * 8 + (luma >> 5)
    np.testing.assert_array_equal(bins, number + 32768 * (luma < 30))
    table, mask = chance.random(32768) < 0.3, (chance.random((90, 70)) < 0.5).astype(np.uint8)
    np.testing.assert_array_equal(_core.bins_among(bins, table), table[number] & (luma >= 30))
    counts = np.bincount(number[mask > 0], minlength=32768)
    np.testing.assert_array_equal(_core.bin_counts(bins, mask), counts)
    with pytest.raises(MeasurementError, match="table: expected"):
        _core.bins_among(bins, table[1:])
    with pytest.raises(MeasurementError, match="mask: expected"):
        _core.bin_counts(bins, mask[1:])
    with pytest.raises(MeasurementError, match="image: expected shape"):
        _core.color_bins(np.zeros((4, 4, 4), np.uint8))


def test_arrays_that_do_not_belong_together_are_refused():
    pixels, points = np.zeros((4, 2)), np.zeros((4, 3))
    with pytest.raises(MeasurementError, match="points: expected"):
        _core.splat(pixels, points[:3], None, height=4, width=8)
    with pytest.raises(MeasurementError, match="marks"):
        _core.splat(pixels, points, np.zeros(3, bool), height=4, width=8)
    with pytest.raises(MeasurementError, match=r"pixels: expected shape \(N, 2\), found \(4, 3\)"):
        _core.splat(points, points, None, height=4, width=8)
    with pytest.raises(MeasurementError, match="depths: expected"):
        _core.nearest_surface(pixels, np.zeros(3), None, pixel=(0.0, 0.0), radius=1.0)
