"""Which motion lab.training keeps from training."""

import numpy as np
from lab.training import poses


def test_a_clip_that_one_file_keeps_for_validation_is_trained_on_from_neither(tmp_path, monkeypatch):
    clips = [f"{number:02d}" for number in range(20)]
    for name, first in (("poses.npz", 0), ("sequences.npz", 3)):  # keep 05 and 15, and 08 and 18
        found = np.repeat(clips[first:], 3)
        places = np.array([float(clip) for clip in found])
        np.savez(tmp_path / name, clip=found, positions_m=places, joint_names=["root"])
    monkeypatch.setattr(poses, "from_positions", lambda positions, names: positions.tolist())
    trained, held_out = ([int(place) for place in poses.load(tmp_path, kept)] for kept in (False, True))
    assert set(held_out) == {5, 8, 15, 18} and set(trained) == set(range(20)) - set(held_out)
    assert held_out == [5] * 3 + [15] * 3 + [8, 18]
