"""Pictures of lost joints, as lab/experiments/failures.py makes them."""

import cv2
import numpy as np
import pytest

import voodoo
from lab_scripts import BUNDLED, load_experiment
from voodoo.pipeline import run as running
from voodoo.recordings import DepthImage


def load():
    return load_experiment("failures")


@pytest.mark.long
def test_only_what_is_lost_gets_a_picture(monkeypatch):
    failures = load()
    assert failures.worst(voodoo.open_recording(BUNDLED, use=("depth",))) is None

    def blind(recording, **how):
        """A tracker whose body cannot move: it stays where it started."""
        still = voodoo.Config(
            gate_start=0.001, gate_end=0.001, hypotheses=False, relocalization=False, depth_contour=False
        )
        return running.start_tracker(recording, config=still, **how)

    monkeypatch.setattr(failures, "start_tracker", blind)
    picture = failures.worst(voodoo.open_recording(BUNDLED, use=("depth",)))
    assert picture.shape == (failures.HEIGHT, failures.WIDTH, 3)
    assert (picture == np.array(failures.MAGENTA)).all(axis=2).any(), "the reference is drawn"


def test_folders_of_pictures_are_opened_for_their_depth(tmp_path):
    camera = "width = 4\nheight = 3\nfx = 5.0\nfy = 5.0\ncx = 1.5\ncy = 1.0\n"
    (tmp_path / "calibration.toml").write_text(f"{camera}[color]\n{camera}")
    for folder, image in (("depth", np.ones((3, 4), np.uint16)), ("rgb", np.ones((3, 4, 3), np.uint8))):
        (tmp_path / folder).mkdir()
        cv2.imwrite(str(tmp_path / folder / "1.5.png"), image)
    failures = load()
    assert len(next(iter(voodoo.open_recording(tmp_path))).measurements) == 2
    for path in (tmp_path, BUNDLED):
        recording = failures.depth_of(path)
        assert {type(item) for frame in recording for item in frame.measurements} == {DepthImage}
        assert {sensor.kind for sensor in recording.info().sensors} == {"depth"}
