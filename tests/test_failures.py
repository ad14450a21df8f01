"""Pictures of lost joints, as examples/failures.py makes them."""

from pathlib import Path

import numpy as np

import voodoo
from ik_cases import load_example
from voodoo.pipeline import run as running

ROOT = Path(__file__).resolve().parent.parent
BUNDLED = ROOT / "python" / "voodoo" / "data" / "bend_scoop"


def load():
    return load_example("failures")


def test_only_what_is_lost_gets_a_picture(monkeypatch):
    failures = load()
    assert failures.worst(voodoo.open_recording(BUNDLED, use=("depth",))) is None

    def blind(recording, **how):
        """A tracker whose body cannot move: it stays where it started."""
        still = voodoo.Config(gate_start=0.001, gate_end=0.001, hypotheses=False, relocalization=False, outline=False)
        return running.start_tracker(recording, config=still, **how)

    monkeypatch.setattr(failures, "start_tracker", blind)
    picture = failures.worst(voodoo.open_recording(BUNDLED, use=("depth",)))
    assert picture.shape == (failures.HEIGHT, failures.WIDTH, 3)
    assert (picture == np.array(failures.MAGENTA)).all(axis=2).any(), "the reference is drawn"
