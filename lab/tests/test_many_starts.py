"""What lab/experiments/many_starts.py prints."""

import sys
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from lab_scripts import BUNDLED, load_experiment


@pytest.fixture
def printed(monkeypatch, capsys):
    starts = load_experiment("many_starts")

    def of(*found):
        monkeypatch.setattr(starts, "ProcessPoolExecutor", ThreadPoolExecutor)
        monkeypatch.setattr(starts, "errors_of", lambda path: list(found))
        monkeypatch.setattr(sys, "argv", ["many_starts.py", "one"])
        starts.main()
        return capsys.readouterr().out

    return of


def test_starts_with_few_tracked_frames_are_counted(printed):
    line = printed((0.02, 0.04), (np.nan, np.nan), (0.04, 0.2))
    assert "2 starts: first pose 3.00 cm, mean 12.00 cm" in line and "50.0 % beyond 10 cm" in line
    assert "left out: 1 starts with at most 10 tracked frames" in line
    with pytest.raises(SystemExit, match="expected starts with a pose, found 1 starts with at most 10"):
        printed((np.nan, np.nan))


def test_where_nobody_is_found_the_errors_are_not_known(monkeypatch):
    starts = load_experiment("many_starts")
    monkeypatch.setattr(starts, "track", lambda *found, **how: [])
    monkeypatch.setattr(starts, "LEFT_S", 2.3)
    errors = starts.errors_of(BUNDLED)
    assert errors and np.isnan(errors).all()
