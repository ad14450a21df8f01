"""Scripts of lab/experiments as modules."""

from pathlib import Path

from commands import load_script
from voodoo.recordings import sample_path

BUNDLED = sample_path()
EXPERIMENTS = Path(__file__).resolve().parent.parent / "experiments"


def load_experiment(name):
    return load_script(EXPERIMENTS / f"{name}.py")
