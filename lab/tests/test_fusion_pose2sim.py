"""The body carried by rays alone: lab/experiments/fusion_pose2sim.py."""

import fusion_pose2sim
import pytest

from measurement_data import data_folder
from voodoo.recordings import open_recording


@pytest.fixture(scope="module")
def folder(voodoo_data):
    return data_folder(voodoo_data, "pose2sim")


@pytest.mark.parametrize("solver", ["limbwise", "chain"])
def test_rays_alone_follow_the_balancing_trial(folder, solver):
    run = fusion_pose2sim.track(folder, "all", fusion_pose2sim.CONFIG.model_copy(update={"solver": solver}))
    assert run.errors.shape == (100, 12)
    assert run.errors.mean() < 0.03


@pytest.mark.parametrize("missing", [0, 2, *(pytest.param(other, marks=pytest.mark.long) for other in (1, 3))])
def test_a_camera_less(folder, missing):
    names = [camera.name for camera in open_recording(folder).cameras]
    assert len(names) == 4
    kept = tuple(name for name in names if name != names[missing])
    assert fusion_pose2sim.track(folder, "three", fusion_pose2sim.CONFIG, cameras=kept).errors.mean() < 0.045


def test_random_pixels(folder):
    wrong = fusion_pose2sim.track(folder, "20 %", fusion_pose2sim.CONFIG, outliers=0.2)
    assert wrong.errors[-10:].mean() < 0.05
    assert all(estimate.status == "tracking" for estimate in wrong.estimates)
