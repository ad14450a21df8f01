"""Other configurations of arms and legs are tried where the frame speaks against the current ones."""

import pytest

from voodoo.evaluate import evaluate


@pytest.mark.parametrize("name", ["a24_s3_t3", "a25_s1_t1", "a25_s1_t2", "a25_s1_t4"])
def test_nobody_is_lost_who_sits_down_or_stands_up(voodoo_data, name):
    """The stool draws a calf, the sinking body pushes straight legs through the floor, one or both; no foot has moved."""
    score, _ = evaluate(voodoo_data / "utd-mhad" / "Depth" / f"{name}_depth.mat")
    assert score.tracking_class > 0, f"lost at the end: {score.lost_joints}"
