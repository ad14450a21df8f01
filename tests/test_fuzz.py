"""A few of the cases of scripts/fuzz: every kind of file and the Python API, mutated; and that the harness sees what fails."""

from pathlib import Path

import fuzz_samples
import fuzzing

CASES = 2 * (len(fuzz_samples.SAMPLES) + 3)


def test_mutated_files_and_odd_arguments_are_refused_or_read():
    report = fuzzing.fuzz(CASES, first=1)
    assert report.failures == []
    assert report.counts.total() == CASES and set(report.counts) == {*fuzz_samples.SAMPLES, "api"}
    assert report.accepted.total() > CASES / 20  # or the mutations would be too crude to get far


def test_sound_samples_are_read(tmp_path):
    for name, sample in fuzz_samples.SAMPLES.items():
        if name.startswith(("realsense", "db3", "ros1")):
            continue  # read in tests of their own
        folder = tmp_path / name.replace(" ", "_")
        folder.mkdir()
        sample.make(folder)
        sample.open(folder, False)


def test_the_harness_reports_what_fails(tmp_path, monkeypatch):
    """In a child with samples of its own: one that raises, one that dies, one that never ends."""
    (tmp_path / "fuzz_samples.py").write_text(
        "import os, re\nfrom pathlib import Path\n"
        "class Sample:\n"
        "    mutated, text, damage = ('x',), False, None\n"
        "    def __init__(self, do): self.do = do\n"
        "    def make(self, folder): (folder / 'x').write_bytes(b'abc')\n"
        "    def open(self, folder, lenient): self.do()\n"
        "def spin():\n    while True: pass\n"
        "SAMPLES = {'good': Sample(int), 'raises': Sample(lambda: int('x')), 'dies': Sample(os.abort), 'spins': Sample(spin)}\n"
        "def call(rng): pass\n"
    )
    text = Path(fuzzing.__file__).read_text(encoding="utf-8").replace("LONGEST_S = 5.0", "LONGEST_S = 0.3")
    source = tmp_path / "fuzzing.py"
    source.write_text(text, encoding="utf-8")
    monkeypatch.setattr(fuzzing, "__file__", str(source))
    report = fuzzing.fuzz(7)
    message = "\n".join(report.failures)
    assert len(report.failures) == 3, message
    assert "(raises): ValueError: invalid literal" in message
    assert "(dies): the process died" in message and "(spins): more than 0.3 s" in message
