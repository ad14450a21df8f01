"""The tables of lab/experiments/one_of_many.py."""

import csv
import sys

import numpy as np
import pytest

from lab_scripts import BUNDLED, load_experiment


@pytest.fixture
def many():
    return load_experiment("one_of_many")


def cells(line):
    return [cell.strip() for cell in line.split("|")[1:-1]]


def test_the_bundled_person_is_followed(many, tmp_path, monkeypatch, capsys):
    """Its truth as that of person 3, in view from the third frame on."""
    (tmp_path / "bag").symlink_to(BUNDLED / "bag")
    with (BUNDLED / "truth.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    with (tmp_path / "truth_people.csv").open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(["stamp_s", "person", "in_view", *header[1:]])
        writer.writerows([row[0], 3, 1.0 if index > 1 else 0.0, *row[1:]] for index, row in enumerate(rows))
    few = many.track
    monkeypatch.setattr(many, "track", lambda *a, **k: (step for step, _ in zip(few(*a, **k), range(20), strict=False)))
    monkeypatch.setattr(sys, "argv", ["one_of_many.py", str(tmp_path)])
    many.main()
    lines = [cells(line) for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert lines[1][1:3] == ["person 3", "0 %"] and 0.5 < float(lines[1][3]) < 8.0
    visit = lines[-1]
    assert visit[0].startswith("3: 0.1 to ") and visit[1] == "+0.00 s (+0)" and visit[3] == "100 %"


def made(many):
    """Person 1 comes at 0.2 s, sits for 0.2 s and leaves; person 2 comes. A second of ten frames."""
    stamps = np.arange(10) / 10.0
    in_view = np.zeros((10, 2))
    in_view[2:6, 0], in_view[7:, 1] = (0.5, 1.0, 1.0, 1.0), 1.0
    roots = np.zeros((10, 2, 3))
    roots[:, 0], roots[:, 1] = (2.0, 0.0, 0.9), (3.0, 0.0, 0.9)
    roots[4:6, 0, 2] = 0.5
    joints = np.repeat(roots[:, :, None], 12, axis=2)
    return many.People(stamps, np.array([1, 2]), in_view, roots, joints)


def test_found_seated_gone_and_the_next_one_found(many):
    who = np.array([0, 0, 0, 0, 1, 1, -1, 0, 0, 2])
    errors = np.where(who > 0, 0.05, np.nan)
    result = many.Followed(made(many), who, who == -1, errors)
    first, second = map(cells, many.visits(result))
    assert first == ["1: 0.2 to 0.5", "+0.10 s (+1)", "5.0", "50 %", "100 %, 5.0 cm", "0.1 s"]
    assert second == ["2: 0.7 to 0.9", "+0.20 s (+2)", "5.0", "33 %", "", ""]
    assert [cells(line)[:3] for line in many.timeline(result)] == [
        ["0.0 to 0.3", "nobody", ""],
        ["0.4 to 0.5", "person 1", "0 %"],
        ["0.6 to 0.6", "something else", "100 %"],
        ["0.7 to 0.8", "nobody", ""],
        ["0.9 to 0.9", "person 2", "0 %"],
    ]


def test_a_body_that_is_left_behind_stays_until_the_end(many):
    who = np.array([0, 0, 0, 0, 1, 1, -1, -1, -1, -1])
    first, _ = map(cells, many.visits(many.Followed(made(many), who, who == -1, np.where(who > 0, 0.05, np.nan))))
    assert first[-1] == "over 0.3 s"


def test_a_root_belongs_to_the_nearest_person_within_half_a_meter(many):
    roots = np.array([[2.4, 0.0, 0.9], [2.6, 0.0, 0.9], [2.0, 1.0, 0.9], [np.nan] * 3])
    truth = made(many)
    four = many.People(
        *(getattr(truth, name)[:4] for name in ("stamps",)),
        truth.numbers,
        *(getattr(truth, name)[:4] for name in ("in_view", "roots", "joints")),
    )
    assert four.followed(roots).tolist() == [1, 2, -1, 0]


def test_truth_of_another_form_is_refused(many, tmp_path):
    path = tmp_path / "truth_people.csv"
    path.write_text("stamp_s,x\n0.0,1.0\n")
    with pytest.raises(SystemExit, match="expected rows of stamp_s, person, in_view"):
        many.People.load(path)
