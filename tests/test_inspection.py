"""What is told of units, calibration and poses before a recording is tracked: they give a wrong person, or none, in silence."""

from itertools import islice

import cv2
import numpy as np
import pytest

from commands import run
from voodoo.measurements import DepthImage
from voodoo.model.rotations import axes
from voodoo.model.transforms import pose_of
from voodoo.pipeline.floor import floor_words
from voodoo.pipeline.inspection import inspect
from voodoo.recordings import open_recording, sample_path

FRAMES = 13
POSES = {
    "right": lambda pose: pose,
    "inverse": np.linalg.inv,
    "upside down": lambda pose: pose_of(axes("x -y -z")) @ pose,
    "low": lambda pose: pose_of(np.eye(3), (0.0, 0.0, -5.0)) @ pose,
}


@pytest.fixture(scope="module")
def depths():
    """The first depth images of the bundled recording."""
    items = (item for recorded in open_recording(sample_path()) for item in recorded.measurements)
    return list(islice((item for item in items if isinstance(item, DepthImage)), FRAMES))


@pytest.fixture
def folder(tmp_path, depths):
    """They and their calibration, with another pose and scale of depth."""

    def written(pose, scale=1.0, root="base_link"):
        (tmp_path / "depth").mkdir()
        for item in depths:
            millimeters = np.nan_to_num(item.meters()) * 1000.0 * scale
            cv2.imwrite(str(tmp_path / f"depth/{item.stamp:.6f}.png"), millimeters.round().astype(np.uint16))
        camera = depths[0].camera
        numbers = {name: getattr(camera, name) for name in ("width", "height", "fx", "fy", "cx", "cy")}
        numbers |= {"distortion": list(camera.distortion), "depth_factor": 1000.0}
        numbers["root_from_sensor"] = POSES[pose](depths[0].root_from_sensor).tolist()
        lines = [f"root_frame = '{root}'", f"model = '{camera.model}'"]
        lines += [f"{name} = {value}" for name, value in numbers.items()]
        (tmp_path / "calibration.toml").write_text("\n".join(lines))
        return tmp_path

    return written


@pytest.mark.parametrize(
    ("pose", "root", "words"),
    [
        ("right", "base_link", None),
        ("inverse", "base_link", "tilted by 89 deg in base_link, whose z axis should point up"),
        ("upside down", "cell", "tilted by 180 deg in cell, whose z axis should point up"),
        ("low", "base_link", "5.0 m below z = 0 of base_link, where it is expected"),
        ("low", "cell", None),
    ],
)
def test_the_floor_speaks_against_a_wrong_pose_of_the_camera(folder, pose, root, words):
    seen = inspect(open_recording(folder(pose, root=root)))
    assert len(seen.doubts) == (words is not None) and all(words in one for one in seen.doubts)
    assert np.median(seen.sight.statures) == pytest.approx(1.75, abs=0.1), "whatever the pose is"


def test_info_and_track_tell_a_wrong_pose(folder):
    path = folder("inverse")
    words = "the floor that depth shows is tilted by 89 deg in base_link"
    assert words in run("info", path).stdout
    assert words in run("track", path, "--out", path.parent / "o.csv").stderr


def test_a_floor_nearly_where_it_is_expected_is_not_doubted():
    def floor(degrees, height):
        angle = np.deg2rad(degrees)
        return (np.array([np.sin(angle), 0.0, np.cos(angle)]), height)

    assert (
        floor_words(None, "odom") == floor_words(floor(4.0, 0.2), "odom") == floor_words(floor(0.0, 2.0), "cell") == ""
    )
    assert "tilted by 9 deg" in floor_words(floor(9.0, 0.0), "cell")
    assert "1.0 m above z = 0 of map" in floor_words(floor(0.0, 1.0), "map")


@pytest.mark.parametrize("root", ["base_link", "camera_optical_frame"])
def test_what_is_looked_at_twice_is_counted_once(folder, root):
    path = folder("right", root=root)
    for file in sorted((path / "depth").iterdir())[::4]:
        cv2.imwrite(str(file), np.zeros((144, 176), np.uint16))
    assert "left out 4 that are blank" in run("info", path).stdout
    # Of a camera's frame a .glb is turned by the floor that is seen.
    assert "left out 4 that are blank" in run("track", path, "--out", path.parent / "o.glb").stderr


def test_who_is_not_tracked_for_their_size_is_told_with_it(folder):
    path = folder("right", scale=0.5)
    said = " ".join(run("track", path, "--out", path.parent / "o.csv").stderr.split())
    assert "the floor that depth shows is 0.6 m above z = 0 of base_link" in said
    assert "though depth shows somebody 0.86 m tall: are the unit of depth and the pose of the camera right?" in said
    assert "voodoo info" not in said
