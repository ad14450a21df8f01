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
    return _core.points_within(depth, CAMERA, **(options | changes))


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


def far_side(nearest):
    """A line on the far side of edges between surfaces, filled and eroded by OpenCV."""
    unknown = np.isinf(nearest)
    _, labels = cv2.distanceTransformWithLabels(
        unknown.view(np.uint8), cv2.DIST_L2, cv2.DIST_MASK_3, labelType=cv2.DIST_LABEL_PIXEL
    )
    z = np.concatenate([np.zeros(1, np.float32), nearest[~unknown]]).take(labels)
    return z > cv2.erode(z, np.ones((3, 3), np.uint8)) + 0.1


def drawn(pixels, depths, chosen, height, width):
    """A mask of points, and the least depth in each pixel."""
    mask, nearest = np.zeros((height, width), np.uint8), np.full((height, width), np.inf, np.float32)
    u, v = np.rint(pixels[chosen]).astype(int).T
    mask[v, u] = 1
    np.minimum.at(nearest, (v, u), depths[chosen].astype(np.float32))
    return mask, nearest


@pytest.mark.parametrize("seed", range(60))
def test_what_is_shown_is_what_opencv_makes_of_it(seed):
    chance = np.random.default_rng(seed)
    height, width, reach = (int(number) for number in chance.integers((1, 1, 0), (60, 90, 6)))
    count = int(chance.integers(0, height * width // 3 + 2))
    pixels = chance.uniform(-3.0, 3.0 + np.array([width, height]), (count, 2))
    pixels[chance.random(count) < 0.05] = np.nan
    points = np.zeros((count, 3))
    points[:, 2] = chance.choice([1.0, 1.05, 1.5, 2.3], count) + chance.normal(0.0, 0.02, count)
    marks, beyond = chance.random(count) < 0.2, chance.random((height, width)) < 0.05
    mask, before, inside = _core.shown(pixels, points, marks, beyond=beyond, reach=reach)
    rounded = np.nan_to_num(np.rint(pixels), nan=-9.0)
    there = ((rounded >= 0.0) & (rounded < (width, height))).all(axis=1)
    np.testing.assert_array_equal(inside, np.flatnonzero(there))
    seen, nearest = drawn(pixels, points[:, 2], there, height, width)
    around = np.ones((2 * reach + 1, 2 * reach + 1), np.uint8)
    grown = cv2.dilate(seen, around).view(bool)
    edges = np.zeros_like(grown)
    if there.any():
        rows, columns = (slice(places.min(), places.max() + 1) for places in np.nonzero(seen))
        edges[rows, columns] = far_side(nearest[rows, columns].copy())
    np.testing.assert_array_equal(mask, np.where(grown, ~edges, beyond))
    marked = cv2.dilate(drawn(pixels, points[:, 2], there & marks, height, width)[0], around).view(bool)
    np.testing.assert_array_equal(before, marked & ~edges)
    assert _core.shown(pixels, points, None, beyond=beyond, reach=reach)[1] is None


def filled(mask, palm):
    """Gaps closed between regions whose boxes are no longer than three palms, by OpenCV."""
    x, y, w, h = cv2.boundingRect(mask.view(np.uint8))
    if not w:
        return mask
    window = (slice(y, y + h), slice(x, x + w))
    _, labels, stats, _ = cv2.connectedComponentsWithStats(mask[window].view(np.uint8), connectivity=8)
    small = np.hypot(stats[:, cv2.CC_STAT_WIDTH], stats[:, cv2.CC_STAT_HEIGHT]) <= 3.0 * palm
    small[0] = False
    result = mask.copy()
    result[window] |= cv2.morphologyEx(small[labels].view(np.uint8), cv2.MORPH_CLOSE, np.ones((3, 3))).view(bool)
    return result


@pytest.mark.parametrize("seed", range(40))
def test_masks_and_regions_are_those_of_opencv(seed):
    chance = np.random.default_rng(seed)
    height, width = (int(number) for number in chance.integers(1, (60, 90)))
    grain, palm = chance.uniform(0.3, 2.0), chance.uniform(1.0, 8.0)
    mask = cv2.GaussianBlur(chance.random((height, width)), (0, 0), grain) > chance.uniform(0.4, 0.6)
    _, expected, stats, centres = cv2.connectedComponentsWithStats(mask.view(np.uint8), connectivity=8)
    labels, regions = _core.mask_regions(mask)
    np.testing.assert_array_equal(labels, expected)
    told = [[x0, y0, x1 - x0, y1 - y0, area] for (y0, y1), (x0, x1), area, _ in regions]
    assert (told, [middle for *_, middle in regions]) == (stats[1:].tolist(), [tuple(row) for row in centres[1:]])
    np.testing.assert_array_equal(_core.joined_mask(mask, longest=3.0 * palm), filled(mask, palm))

    # The same of a picture, with all that may rule skin out.
    bins = np.where(mask, 5, chance.integers(0, 65536, mask.shape)).astype(np.uint16)
    table = chance.random(32768) < chance.uniform(0.3, 0.8)
    table[5] = True
    body, before = chance.random((2, height, width)) < [[[0.9]], [[0.5]]]
    always = chance.uniform(0.0, 0.6, mask.shape).astype(np.float32)
    seen, skin = _core.skin_mask(bins, table, longest=3.0 * palm, body=body, always=always, before=before)
    light = table[bins & 32767] & (bins < 32768)
    found = cv2.medianBlur(light.astype(np.uint8), 3).view(bool)
    np.testing.assert_array_equal(seen, found)
    found = found & body & ((always < 0.5) | before)
    opened = cv2.morphologyEx(found.view(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8)).view(bool)
    np.testing.assert_array_equal(skin, filled(opened, palm) & body)
    with pytest.raises(MeasurementError, match="skin: expected"):
        _core.skin_mask(bins, table, longest=1.0, body=np.ones((height, width + 1), bool))


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
    view = _core.BodyView(np.ones((41, 41), bool), pixels, depths)
    found = view.look_at(labels, places, 8.0)
    alone = [
        _core.nearest_surface(pixels, depths, None, pixel=place, radius=8.0, among=of == region)
        for place, region in places
    ]
    assert found == alone == [(3.0, False), (2.0, False), (2.0, False), None]
    with pytest.raises(MeasurementError, match="pixels: expected"):
        _core.BodyView(np.ones((41, 41), bool), pixels, depths[1:])


def test_bins_are_those_of_opencv():
    chance = np.random.default_rng(7)
    image = chance.integers(0, 256, (90, 70, 3), dtype=np.uint8)
    image[:20] //= 8
    luma, cr, cb = (plane.astype(int) for plane in cv2.split(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb)))
    bins = _core.color_bins(image)
    number = (cr >> 2) * 512 + (cb >> 2) * 8 + (luma >> 5)
    np.testing.assert_array_equal(bins, number + 32768 * (luma < 30))
    with pytest.raises(MeasurementError, match="table: expected"):
        _core.skin_mask(bins, np.ones(32767, bool), longest=1.0)
    with pytest.raises(MeasurementError, match="image: expected shape"):
        _core.color_bins(np.zeros((4, 4, 4), np.uint8))


def test_arrays_that_do_not_belong_together_are_refused():
    pixels, points, beyond = np.zeros((4, 2)), np.zeros((4, 3)), np.zeros((4, 8), bool)
    with pytest.raises(MeasurementError, match="points: expected"):
        _core.shown(pixels, points[:3], None, beyond=beyond, reach=1)
    with pytest.raises(MeasurementError, match="marks"):
        _core.shown(pixels, points, np.zeros(3, bool), beyond=beyond, reach=1)
    with pytest.raises(MeasurementError, match=r"pixels: expected shape \(N, 2\), found \(4, 3\)"):
        _core.shown(points, points, None, beyond=beyond, reach=1)
    with pytest.raises(MeasurementError, match="depths: expected"):
        _core.nearest_surface(pixels, np.zeros(3), None, pixel=(0.0, 0.0), radius=1.0)
