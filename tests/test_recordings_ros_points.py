"""Point clouds and laser scans of ROS bags, in any layout."""

from dataclasses import replace

import numpy as np
import pytest

from ros_bags import INFO, TF, M, bag, depth_entry, only
from voodoo.errors import RecordingError
from voodoo.recordings import LaserScan, PointCloud, open_recording

LAYOUTS = {
    "float": (np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4")]), [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]),
    "mixed": (
        np.dtype([("rgb", "<u4"), ("z", "<f8"), ("gap", "V3"), ("y", "<f4"), ("x", "<i2"), ("end", "V5")]),
        [("rgb", 0, 6), ("z", 4, 8), ("y", 15, 7), ("x", 19, 3)],
    ),
}


@pytest.mark.parametrize("height", [1, 2])
@pytest.mark.parametrize("row_padding", [0, 7])
@pytest.mark.parametrize("layout", LAYOUTS)
def test_clouds_of_any_layout_without_their_nan_rows(tmp_path, layout, row_padding, height):
    dtype, fields = LAYOUTS[layout]
    table = np.zeros(6, dtype)
    table["x"], table["y"], table["z"] = np.arange(6), np.arange(6) / 2, -np.arange(6) / 4
    table["z"][2] = np.nan
    table["y"][4] = np.inf
    message = M.cloud(10.0, table, fields, row_padding=row_padding, height=height)
    recording = open_recording(bag(tmp_path, TF, ("/points", 10.0, message)))
    (cloud,) = only(recording, PointCloud)
    k = np.array([0, 1, 3, 5])
    np.testing.assert_allclose(cloud.points, np.column_stack([k, k / 2, -k / 4]))
    assert cloud.root_from_sensor[2, 3] == 3 and recording.root_frame == "base_link"


def test_a_big_endian_cloud(tmp_path):
    table = np.array([(1, 2, 3)], np.dtype([("x", ">f4"), ("y", ">f4"), ("z", ">f4")]))
    message = M.cloud(10.0, table, LAYOUTS["float"][1], big=True)
    (cloud,) = only(open_recording(bag(tmp_path, TF, ("/points", 10.0, message))), PointCloud)
    np.testing.assert_array_equal(cloud.points, [[1, 2, 3]])


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"point_step": 8}, "leaves the point"),
        ({"width": 100}, "100 points"),
        ({"row_step": 4}, "rows of 4"),
        ({"fields": []}, "fields x, y, z"),
    ],
)
def test_clouds_whose_numbers_do_not_fit_are_refused(tmp_path, change, words):
    message = M.cloud(10.0, np.zeros(6, LAYOUTS["float"][0]), LAYOUTS["float"][1])
    vars_ = {name: getattr(message, name) for name in message.__dataclass_fields__ if name != "__msgtype__"}
    changed = type(message)(**{**vars_, **change})
    with pytest.raises(RecordingError, match=words):
        list(open_recording(bag(tmp_path, TF, ("/points", 10.0, changed))))


def test_a_cloud_of_the_depth_camera_is_not_counted_twice(tmp_path):
    cloud = ("/d/points", 10.0, M.cloud(10.0, np.zeros(6, LAYOUTS["float"][0]), LAYOUTS["float"][1]))
    path = bag(tmp_path, TF, INFO, cloud, depth_entry())
    recording = open_recording(path)
    assert not only(recording, PointCloud) and "/d/points" in str(recording.info())
    assert len(only(open_recording(path, points_topic="/d/points"), PointCloud)) == 1


def test_scans_give_valid_points_only(tmp_path):
    scan = ("/scan", 10.0, M.scan(10.0, [1.0, np.inf, 0.05], increment=0.1))
    recording = open_recording(bag(tmp_path, TF, scan))
    (scan,) = only(recording, LaserScan)
    np.testing.assert_allclose(scan.points(), [[np.cos(-0.1), np.sin(-0.1), 0.0]], atol=1e-7)
    np.testing.assert_allclose(scan.root_from_sensor[:3, 3], (1, 2, 4))
    nothing = replace(scan, ranges=np.array([1.0, 0.0, 0.05], np.float32), range_min=0.0)
    assert len(nothing.points()) == 2
