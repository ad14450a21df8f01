"""Pose2Sim folders."""

import numpy as np
import pytest

from commands import refused, run
from measurement_data import data_folder
from test_keypoint_check import write_folder
from voodoo.errors import RecordingError
from voodoo.recordings import open_recording
from voodoo.recordings.camera_files import read_camera_toml
from voodoo.recordings.pose2sim import calibrations
from voodoo.sensors.rays import SiteRay, agreed

CALIBRATION = """
[cam_01]
name = "left"
size = [1088.0, 1920.0]
matrix = [[1680.0, 0.0, 533.0], [0.0, 1681.0, 948.0], [0.0, 0.0, 1.0]]
distortions = [-0.0007, 0.002, 0.0, 0.0]
rotation = [1.5707963267948966, 0.0, 0.0]
translation = [0.0, 1.0, 3.0]
[metadata]
error = 0.0
"""


def test_camera_toml(tmp_path):
    path = tmp_path / "Calib.toml"
    path.write_text(CALIBRATION)
    (placed,) = read_camera_toml(path)
    assert (placed.name, placed.camera.width, placed.camera.fy) == ("left", 1088, 1681.0)
    # camera_from_world turns world y into the optical axis' opposite: the camera looks along -z' = world y
    np.testing.assert_allclose(placed.world_from_sensor[:3, 3], [0.0, -3.0, 1.0], atol=1e-12)
    np.testing.assert_allclose(placed.world_from_sensor[:3, 2], [0.0, 1.0, 0.0], atol=1e-12)
    path.write_text(CALIBRATION.replace("rotation", "turn"))
    with pytest.raises(RecordingError, match=r"cam_01.*no rotation"):
        read_camera_toml(path)


@pytest.mark.parametrize("command", ["info", "track"])
def test_keypoints_without_a_calibration_are_told_what_is_missing(tmp_path, command):
    path = tmp_path / "walk"
    camera = path / "keypoints" / "cam01_json"
    camera.mkdir(parents=True)
    (camera / "cam01_0000.json").write_text('{"people": []}')
    done = run(command, path)
    assert done.exit_code == 1
    assert done.stderr.startswith(
        f"voodoo: {path}: expected one Calib*.toml, the calibration of the cameras, found none"
    )
    _, _, template = done.stderr.partition("\n\n")
    (path / "Calib.toml").write_text(template)
    assert [one.name for one in read_camera_toml(path / "Calib.toml")] == ["cam01"]
    (path / "Calib.toml").unlink()
    for alone in (path / "keypoints", camera):
        refused(run(command, alone), "found keypoint files alone", "Calib*.toml and keypoints/CAMERA_json/*.json")
    (tmp_path / "settings.json").write_text("{}")
    refused(run(command, tmp_path), "expected a ROS bag")


def test_another_number_of_files_names_the_cameras(tmp_path):
    for camera, count in (("left", 2), ("right", 0)):
        folder = tmp_path / "keypoints" / f"{camera}_json"
        folder.mkdir(parents=True)
        for number in range(count):
            (folder / f"{number}.json").write_text('{"people": []}')
    tables = [
        CALIBRATION.partition("[metadata]")[0],
        CALIBRATION.partition("[metadata]")[0].replace("cam_01", "cam_02"),
    ]
    (tmp_path / "Calib.toml").write_text(tables[0] + tables[1].replace('"left"', '"right"'))
    refused(
        run("info", tmp_path), "expected as many keypoint files for every camera", "found left_json 2, right_json 0"
    )


def test_an_empty_folder_is_called_so(tmp_path):
    refused(run("info", tmp_path), f"{tmp_path}: expected a recording, found an empty folder; loaders: ros2")


@pytest.mark.parametrize("program", ["anipose", "caliscope", "kalibr", "opencv"])
def test_calibrations_of_other_programs(tmp_path, program):
    turn = [[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]
    texts = {
        "anipose": ("freemocap_camera_calibration.toml", CALIBRATION.replace("1.0, 3.0]", "1000.0, 3000.0]")),
        "caliscope": ("config.toml", CALIBRATION.replace("[1.5707963267948966, 0.0, 0.0]", str(turn))),
        "kalibr": ("camchain.yaml", KALIBR),
        "opencv": ("cameras.yml", OPENCV),
    }
    name, text = texts[program]
    (tmp_path / name).write_text(text)
    (found,) = calibrations(tmp_path)
    placed = read_camera_toml(found, meters_per_unit=0.001 if program == "anipose" else 1.0)[-1]
    assert (placed.camera.width, placed.camera.height, placed.camera.fx) == (1088, 1920, 1680.0)
    np.testing.assert_allclose(placed.world_from_sensor[:3, 3], [0.0, -3.0, 1.0], atol=1e-6)
    np.testing.assert_allclose(placed.world_from_sensor[:3, 2], [0.0, 1.0, 0.0], atol=1e-6)
    (tmp_path / name).write_text(text.replace("1680", "nothing"))
    with pytest.raises(RecordingError, match=name):
        read_camera_toml(found)


KALIBR = """cam0:
  camera_model: pinhole
  intrinsics: [1600.0, 1600.0, 533.0, 948.0]
  distortion_model: radtan
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [1088, 1920]
cam1:
  T_cn_cnm1:
  - [1.0, 0.0, 0.0, 0.0]
  - [0.0, 0.0, -1.0, 1.0]
  - [0.0, 1.0, 0.0, 3.0]
  - [0.0, 0.0, 0.0, 1.0]
  camera_model: pinhole
  intrinsics: [1680.0, 1681.0, 533.0, 948.0]
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.0, 0.0, 0.0]
  resolution: [1088, 1920]
"""
OPENCV = """%YAML:1.0
---
left:
   image_width: 1088
   image_height: 1920
   K: !!opencv-matrix
      rows: 3
      cols: 3
      dt: d
      data: [ 1680., 0., 533., 0., 1681., 948., 0., 0., 1. ]
   D: !!opencv-matrix
      rows: 4
      cols: 1
      dt: d
      data: [ 0., 0., 0., 0. ]
   R: !!opencv-matrix
      rows: 3
      cols: 3
      dt: d
      data: [ 1., 0., 0., 0., 0., -1., 0., 1., 0. ]
   T: !!opencv-matrix
      rows: 3
      cols: 1
      dt: d
      data: [ 0., 1., 3. ]
"""


def test_rays_that_disagree_lose_their_trust():
    point = np.array([0.1, 0.2, 1.0])
    origins = np.array([[-3.0, 0, 1], [0, -3, 1], [3, 0.5, 1.2], [0, 3, 0.8]])
    towards = point - origins
    towards[3] += [0.4, 0.0, 0.0]  # this camera's network is 40 cm off
    rays = [
        SiteRay("l_wrist", origin, way / np.linalg.norm(way), 0.02, f"cam{index}")
        for index, (origin, way) in enumerate(zip(origins, towards, strict=True))
    ]
    trust = [ray.trust for ray in agreed(rays, predicted={"l_wrist": point + 0.05})]
    assert min(trust[:3]) > 0.9 and trust[3] < 0.1
    two = agreed(rays[2:], predicted={"l_wrist": point})
    assert [ray.trust for ray in two] == [1.0, 1.0]


@pytest.fixture(scope="module")
def folder(voodoo_data):
    return data_folder(voodoo_data, "pose2sim")


def test_recording(folder):
    recording = open_recording(folder)
    assert (len(recording), recording.root_frame, len(recording.cameras)) == (100, "world", 4)
    assert recording.start is not None and "l_knee" in recording.start["joints"]
    assert recording.start["joints"]["l_shoulder"][2] > 1.3  # z is up
    first = next(iter(recording))
    assert [item.sensor for item in first.measurements] == ["cam_01", "cam_02", "cam_03", "cam_04"]
    assert "keypoints" in str(recording.info())
    with pytest.raises(RecordingError, match="cam_09"):
        open_recording(folder, cameras=("cam_09",))
    with pytest.raises(RecordingError, match="17 keypoints"):
        next(iter(open_recording(folder, layout="coco17")))


@pytest.mark.parametrize(
    ("start", "since", "first"),
    [(0, 1, 0), (0, 0, 0), (4, 1, 4), (4, 4, 4), (1, 0, 0), (40, 1, None)],
    ids=["all", "newer", "part", "newer part", "counts from 1", "another recording"],
)
def test_a_triangulation_of_some_images_keeps_their_times(tmp_path, start, since, first):
    """Pose2Sim writes its frame_range into the header; the time of the first row depends on its version."""
    folder = write_folder(tmp_path, count=6)
    header = ["DataRate", "NumFrames", "NumMarkers", "Units", "OrigDataStartFrame"]
    rows = [[row + since, (row + since) / 60.0, row, 1.0, 2.0] for row in range(3)]
    lines = [["PathFileType"], header, [60, 3, 1, "m", start], ["Frame#", "Time", "LWrist"], [], *rows]
    (folder / "walk.trc").write_text("\n".join("\t".join(map(str, line)) for line in lines))
    recording = open_recording(folder)
    if first is None:
        assert recording.reference is None
        return
    count = min(3, 6 - first)
    np.testing.assert_allclose(recording.reference.stamps, (first + np.arange(count)) / 60.0)
    np.testing.assert_allclose(recording.reference.positions[:, 0, 1], np.arange(count))
    assert (recording.start is None) == (first > 0)
    (folder / "walk.trc").write_text(
        "\n".join("\t".join(map(str, line)) for line in [*lines[:5], rows[0][:2], *rows[1:]])
    )
    assert open_recording(folder).start is None, "nobody is there in the first row"


def test_keypoint_files_of_which_none_can_be_read_are_an_error(tmp_path):
    (tmp_path / "Calib.toml").write_text(CALIBRATION)
    folder = tmp_path / "keypoints" / "left_json"
    folder.mkdir(parents=True)
    (folder / "0.json").write_text('{"poses": []}')
    done = run("info", tmp_path)
    refused(done, "found some unreadable, the first:", "0.json")
