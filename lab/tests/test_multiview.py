"""Recordings of color cameras as lab.training.multiview makes them: what can be tracked, with the joints where they are seen."""

import cv2
import numpy as np
import pytest

pytest.importorskip("numba", reason="the extra `training` is not installed")

from lab.training.multiview import make

from voodoo.model.projection import CameraView
from voodoo.recordings import open_recording


@pytest.mark.long
def test_joints_lie_where_the_person_is_visible(voodoo_data, tmp_path):
    if not (voodoo_data / "bodies").is_dir() or not (voodoo_data / "mocap").is_dir():
        pytest.skip(f"no bodies and mocap in {voodoo_data}")
    how = {"seed": 5, "clip": "06_12", "body": 7, "cameras": 2, "first": 60, "frames": 2}
    make(tmp_path / "flat", voodoo_data, silhouettes=True, alike=False, **how)
    make(tmp_path / "dressed", voodoo_data, silhouettes=False, alike=True, **how)
    recording = open_recording(tmp_path / "flat")
    assert recording.root_frame == "world" and len(recording) == 2 and len(recording.empty_scene()) == 2
    dressed = list(open_recording(tmp_path / "dressed"))
    for index, recorded in enumerate(recording):
        places = recording.reference.positions[index]
        for item, colored in zip(recorded.measurements, dressed[index].measurements, strict=True):
            pixels, _ = CameraView(item.camera, item.root_from_sensor, 1.0).project(places)
            observed = cv2.cvtColor(item.image, cv2.COLOR_BGR2GRAY) > 128
            columns, rows = np.rint(pixels).astype(int).T
            assert observed[rows, columns].mean() > 0.9 and 0.01 < observed.mean() < 0.2
            assert colored.image.std() > 10.0
