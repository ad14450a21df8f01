"""Color alone on recordings with truth: rendered people, and real cameras against what others triangulated."""

import numpy as np
import pytest

from measurement_data import data_folder
from voodoo.evaluation.evaluate import compare, evaluate
from voodoo.export.track import Track
from voodoo.pipeline.run import start_tracker, track
from voodoo.recordings import open_recording
from voodoo.sensors.settings import FrontEndSettings

RENDERED = ("mv_d1_walk_turn_cmu", "mv_d2_arms_fast_cmu", "mv_d3_cartwheel_cmu")
USE = ("color",)


@pytest.mark.parametrize("name", [RENDERED[2], *(pytest.param(name, marks=pytest.mark.long) for name in RENDERED[:2])])
def test_four_rendered_cameras_lose_nobody(voodoo_data, name):
    score, table = evaluate(data_folder(voodoo_data, "multiview", name))
    assert score.frames == len(table.stamps) > 90 and score.exact
    assert score.error_m < 0.035 and score.lost_joints == () and score.angle_error_deg < 8.0


def errors(path, cameras=None):
    """Errors (F, 12) [m] against the triangulation, from pictures alone."""
    options = {} if cameras is None else {"color_topic": cameras}
    recording = open_recording(path, loader="videos", **options)
    tracker = start_tracker(recording, use=USE)
    settings = FrontEndSettings.of(recording, use=USE)
    estimates = [step.estimate for step in track(recording, tracker, settings=settings)]
    return compare(recording, Track.of(estimates, body=tracker.body), at_best_lag=True)


@pytest.mark.long
def test_four_real_cameras_agree_with_the_triangulation(voodoo_data):
    """From pictures alone; the triangulation is from keypoints of the same pictures, which agree with it to 2.5 cm."""
    path = data_folder(voodoo_data, "pose2sim")
    assert np.nanmean(errors(path)) < 0.05
    names = [f"cam_0{number}" for number in range(1, 5)]
    for missing in names[:3]:
        assert np.nanmean(errors(path, [name for name in names if name != missing])) < 0.08, missing
