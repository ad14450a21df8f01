"""The rendered recordings and the real laser, against what their READMEs say."""

import numpy as np
import pytest

from voodoo.recordings import DepthImage, LaserScan, open_recording

RENDERED = {
    "dev_01_bend_scoop_cmu": (190, (176, 144), 1.76),
    "dev_02_arms_cmu": (190, (176, 144), 1.65),
    "dev_03_punch": (140, (320, 240), 1.79),
    "dev_04_kick_ball_cmu": (130, (176, 144), 1.78),
    "dev_05_walk": (140, (320, 240), 1.92),
    "dev_06_cartwheel": (100, (320, 240), 1.68),
    "dev_07_sword_cmu": (190, (176, 144), 1.60),
    "dev_08_jump_l515_cmu": (50, (640, 480), 1.76),
}


@pytest.mark.parametrize("name", RENDERED)
def test_rendered_recordings_are_as_described(voodoo_data, name):
    count, size, height = RENDERED[name]
    recording = open_recording(voodoo_data / "rendered" / name)
    frames = list(recording)
    assert len(recording) == len(frames) == count and recording.name == name and recording.root_frame == "base_link"
    assert recording.start["height_m"] == height
    assert recording.info().rate_hz == pytest.approx(30.0, abs=0.01)
    stamps = [frame.stamp for frame in frames]
    np.testing.assert_allclose(recording.reference.stamps, stamps, atol=1e-6)
    scans = [m for frame in frames for m in frame.measurements if isinstance(m, LaserScan)]
    assert len(scans) == count // 2 and len(scans[0].ranges) == 361

    depth = frames[0].measurements[-1]
    assert isinstance(depth, DepthImage) and (depth.camera.width, depth.camera.height) == size
    z = depth.image * depth.meters_per_unit
    points = np.dstack([depth.camera.rays() * z[..., None], z]).reshape(-1, 3)[depth.image.ravel() > 0]
    points = points @ depth.root_from_sensor[:3, :3].T + depth.root_from_sensor[:3, 3]
    floor = points[(np.abs(points[:, 2]) < 0.06) & (points[:, 0] < 3.9)]
    assert len(floor) > 500 and abs(np.median(floor[:, 2])) < 0.01
    assert points[:, 2].min() > -0.25  # noise and flying pixels only

    sensor_from_root = np.linalg.inv(depth.root_from_sensor)
    joints = recording.reference.positions[0] @ sensor_from_root[:3, :3].T + sensor_from_root[:3, 3]
    behind = []
    for (u, v), distance in zip(np.round(depth.camera.project(joints)), joints[:, 2], strict=True):
        if 0 <= u < size[0] and 0 <= v < size[1] and depth.image[int(v), int(u)]:
            behind.append(distance - z[int(v), int(u)])
    assert len(behind) >= 12 and 0.0 < np.median(behind) < 0.2


def test_the_real_laser_opens_from_its_zip(voodoo_data):
    recording = open_recording(voodoo_data / "laser" / "general_tracking_moving_1.zip")
    info = recording.info()
    assert (info.loader, info.frames, info.root_frame) == ("ros1", 873, "odom")
    assert info.duration == pytest.approx(116.0, abs=1.0)
    frames = list(recording)
    assert len(frames) == 873 and all(len(frame.measurements) == 1 for frame in frames)
    scan = frames[400].measurements[0]
    points = scan.points()
    assert isinstance(scan, LaserScan) and len(points) > 300
    ranges = np.linalg.norm(points, axis=1)
    assert scan.range_min - 1e-6 <= ranges.min() and ranges.max() <= scan.range_max + 1e-6
    assert np.abs(points[:, 2]).max() == 0.0
