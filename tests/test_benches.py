"""The benches in Python still find what they time."""

from pathlib import Path

from commands import load_script
from voodoo.pipeline.pairing import paired
from voodoo.recordings import open_recording, sample_path

BENCHES = Path(__file__).resolve().parent.parent / "benches"


def test_every_part_of_a_fused_frame_is_timed():
    bench = load_script(BENCHES / "fusion_frame.py")
    recording = open_recording(sample_path())
    spent = bench.parts(recording, bench.with_keypoints(recording, list(paired(recording))[:6]))
    assert len(spent) == 5 and all(seconds > 0.0 for seconds in spent.values()), spent
