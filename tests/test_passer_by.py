"""Somebody walks by in front of the person of a recording."""

import numpy as np
import pytest

from synthetic.passer_by import WithPasserBy
from voodoo.errors import RecordingError
from voodoo.measurements import ColorImage, DepthImage
from voodoo.recordings import open_recording, sample_path


@pytest.fixture(scope="module")
def both():
    recording = open_recording(sample_path())
    return recording, WithPasserBy(recording, speed=1.2)


def test_the_passer_by_covers_what_is_behind(both):
    recording, passed = both
    begin, end = passed.passes
    middle = (begin + end) / 2.0
    pairs = [pair for pair in zip(recording, passed, strict=True) if abs(pair[0].stamp - middle) < 0.05]
    assert pairs
    for before, after in pairs:
        depth, covered = (
            next(item for item in each.measurements if isinstance(item, DepthImage)) for each in (before, after)
        )
        changed = depth.image != covered.image
        assert changed.sum() > 500
        assert (covered.image[changed & (depth.image > 0)] < depth.image[changed & (depth.image > 0)]).all()
    colors = [item for each in pairs[0] for item in each.measurements if isinstance(item, ColorImage)]
    assert (colors[0].image != colors[-1].image).any(axis=2).sum() > 500
    kinds = {type(item) for _, after in pairs for item in after.measurements}
    assert kinds == {DepthImage, ColorImage}, "a laser would not see the passer-by"


def test_the_truth_is_that_of_both(both):
    _, passed = both
    truth = passed.people
    begin, end = passed.passes
    inside = (truth.stamps >= begin) & (truth.stamps <= end)
    np.testing.assert_array_equal(truth.of("humanoid_root")[:, 0], truth.positions[:, 0, 0])
    assert (truth.in_view[~inside] == [1.0, 0.0]).all()
    middle = int(np.abs(truth.stamps - (begin + end) / 2.0).argmin())
    assert truth.in_view[middle, 0] < 0.7
    assert truth.in_view[middle, 1] > 0.7
    away = truth.of("humanoid_root")[middle, 0] - truth.of("humanoid_root")[middle, 1]
    assert np.linalg.norm(away[:2]) == pytest.approx(0.8, abs=0.1)


def test_only_exact_truth_can_be_passed_by():
    without = open_recording(sample_path(), bare=True)
    with pytest.raises(RecordingError, match="expected exact truth"):
        WithPasserBy(without)
