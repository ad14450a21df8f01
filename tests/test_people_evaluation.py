"""Measures of several people: worked examples of the published definitions, and the table of result files."""

import csv
import sys
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from typer.testing import CliRunner

from voodoo.cli import app
from voodoo.errors import RecordingError, VoodooError
from voodoo.evaluation import metrics
from voodoo.evaluation.people import PeopleScore, score, together
from voodoo.evaluation.people_evaluate import people_markdown, read_rows, truth_of
from voodoo.export.table import save_result
from voodoo.recordings import sample_path
from voodoo.recordings.loaders import open_recording
from voodoo.recordings.people_truth import PeopleTruth
from voodoo.recordings.recording import Reference
from voodoo.recordings.truth import read_people_truth

pytest.importorskip("motmetrics")
NAMES = ("humanoid_root", *metrics.JOINTS)
FIRST = ("stamp_s", "person", "status", "residual_m")


def truth(places, in_view=None, persons=(1, 2)):
    """Persons at places (F, P) along y, NaN for who is not there, once in 0.1 s."""
    places = np.asarray(places, dtype=float)
    positions = np.zeros((*places.shape, len(NAMES), 3))
    positions[..., 1] = places[..., None]
    positions[np.isnan(places)] = np.nan
    observed = np.where(np.isnan(places), 0.0, 1.0) if in_view is None else np.asarray(in_view, dtype=float)
    return PeopleTruth(np.arange(len(places)) / 10.0, np.array(persons), observed, NAMES, positions)


def rows_of(stamps, persons, joints, names=NAMES):
    """Rows without angles, limbs and covariances."""
    count = len(stamps)
    return {
        "stamps": stamps,
        "person": persons,
        "status": np.full(count, "tracking"),
        "residual": np.full(count, np.nan),
        "joint_names": np.array(names),
        "joints": joints,
        **{name: np.empty(0, dtype=np.str_) for name in ("angle_names", "limb_status_names")},
        **{name: np.empty((count, 0)) for name in ("angles", "limb_status")},
        "covariance": np.empty((count, 0, 3, 3)),
    }


def result(bodies):
    """Rows of {id: places (F,)}, NaN for who has none."""
    rows = sorted(
        (frame / 10.0, one, place)
        for one, places in bodies.items()
        for frame, place in enumerate(places)
        if not np.isnan(place)
    )
    joints = np.zeros((len(rows), len(NAMES), 3))
    joints[..., 1] = np.array([row[2] for row in rows])[:, None]
    ids = np.array([row[1] for row in rows], dtype=np.int64)
    stamps = np.array([row[0] for row in rows])
    return rows_of(stamps, ids, joints)


def judged(known, found, **options):
    seconds = float(known.stamps[-1] - known.stamps[0])
    return score("made up", Path("made up"), known, found, **{"seconds": seconds, **options})


N = np.nan


def test_a_worked_example_of_clear_mot_and_identities():
    """Two persons for ten frames. Id 5 follows the first for six frames, then id 7; id 6 the second but for two frames, and id 8
    stands for three frames where nobody is: 20 expected, 2 missed, 3 extra, 1 switch. Pairs 1-5 and 2-6 share 14 frames; 20
    frames of persons and 21 of ids leave IDFN 6 and IDFP 7."""
    known = truth([[0.0, 3.0]] * 10)
    found = result({5: [0.1] * 6 + [N] * 4, 7: [N] * 6 + [0.1] * 4, 6: [3.2] * 8 + [N] * 2, 8: [N, 6, 6, 6] + [N] * 6})
    one = judged(known, found, seconds=30.0)
    assert (one.expected, one.missed, one.extra, one.switches) == (20, 2, 3, 1)
    assert one.mota == pytest.approx(1.0 - 6.0 / 20.0)
    assert one.idf1 == pytest.approx(2.0 * 14 / (20 + 21))
    assert (one.false_bodies, one.left_behind, one.ids) == (1, 0, 4)
    assert one.false_a_minute == pytest.approx(2.0)
    assert one.joint_error_m == pytest.approx((10 * 0.1 + 8 * 0.2) / 18)


def test_swapped_ids_are_two_switches_and_halve_the_identities():
    known = truth([[0.0, 3.0]] * 10)
    one = judged(known, result({1: [0.0] * 5 + [3.0] * 5, 2: [3.0] * 5 + [0.0] * 5}))
    assert (one.switches, one.missed, one.extra) == (2, 0, 0)
    assert one.mota == pytest.approx(0.9)
    assert one.idf1 == pytest.approx(0.5)


def test_who_is_hardly_in_view_may_be_followed_or_not():
    known = truth([[0.0, 3.0]] * 4, in_view=[[1.0, 0.29]] * 4)
    with_them, without = result({1: [0.0] * 4, 2: [3.0] * 4}), result({1: [0.0] * 4})
    assert judged(known, with_them).mota == judged(known, without).mota == 1.0
    # But a second body at who is expected is one too many.
    assert judged(known, result({1: [0.0] * 4, 2: [0.3] * 4})).extra == 4


def test_a_match_ends_at_half_a_meter():
    known = truth([[0.0, 3.0]] * 2, in_view=[[1.0, 0.0]] * 2)
    assert judged(known, result({1: [0.49] * 2})).missed == 0
    assert judged(known, result({1: [0.51] * 2})).missed == 2


@pytest.mark.parametrize(("second", "expected"), [(1, (1, 1, 0)), (2, (1, 0, 1))])
def test_who_comes_back_should_have_the_same_id(second, expected):
    places = [[0.0]] * 10 + [[8.0]] * 40 + [[0.0]] * 10
    known = truth(places, in_view=[[1.0]] * 10 + [[0.0]] * 40 + [[1.0]] * 10, persons=(1,))
    bodies = {
        1: [0.0] * 10 + [N] * 50,
        second: [0.0] * 10 * (second == 1) + [N] * (50 - 10 * (second == 1)) + [0.0] * 10,
    }
    one = judged(known, result(bodies))
    assert (one.returns, one.returned, one.switches) == expected
    assert (one.visits, one.visits_matched) == (2, 2)


def test_the_time_to_the_first_pose_counts_from_when_most_is_in_view():
    known = truth([[0.0]] * 20, in_view=[[0.5]] * 5 + [[0.9]] * 15, persons=(1,))
    assert judged(known, result({1: [N] * 9 + [0.0] * 11})).first_pose_s == pytest.approx(0.4)
    assert judged(known, result({1: [0.0] * 20})).first_pose_s == 0.0
    nobody = judged(known, result({1: [9.0] * 20}))
    assert (nobody.visits, nobody.visits_matched) == (1, 0)
    assert np.isnan(nobody.first_pose_s)


def test_a_body_left_behind_is_reported_from_a_false_one():
    known = truth([[0.0]] * 3 + [[2.0]] * 3, persons=(1,))
    one = judged(known, result({1: [0.0] * 6, 2: [N] * 4 + [5.0] * 2}))
    assert (one.false_bodies, one.left_behind) == (1, 1)


def test_frames_in_which_nobody_is_in_the_scene_count():
    known = truth([[0.0]] * 3, persons=(1,))
    one = judged(known, result({1: [0.0] * 3 + [N] * 3, 4: [N] * 3 + [1.0] * 3}))
    assert (one.extra, one.false_bodies) == (3, 1)


def test_joints_count_where_most_of_a_person_is_in_view():
    known = truth([[0.0]] * 4, in_view=[[0.79], [0.8], [1.0], [0.79]], persons=(1,))
    one = judged(known, result({1: [0.4, 0.1, 0.1, 0.4]}))
    assert one.joint_error_m == pytest.approx(0.1)
    assert one.joints == 24


def test_recordings_add_up():
    known = truth([[0.0, 3.0]] * 10)
    good, bad = (judged(known, result({1: [0.0] * 10, **more}), seconds=20.0) for more in ({2: [3.0] * 10}, {}))
    both = together([good, bad, PeopleScore("gone", Path("gone"), failure="damaged")])
    assert (both.expected, both.missed, both.seconds) == (40, 10, 40.0)
    assert both.mota == pytest.approx(0.75)
    assert both.idf1 == pytest.approx(2 * 30 / (40 + 30))
    table = people_markdown([good, bad])
    assert "| made up | 2 | 2 | 1.000 | 1.000 | 0 |" in table
    assert "| together | 4 | 3 | 0.750 |" in table


def test_rows_are_read_as_they_are_written(tmp_path):
    rows = {**result({1: [0.5, N, 0.7], 12: [1.0, 1.1, 1.2]}), "residual": np.array([0.01, N, 0.02, 0.03, 0.04])}
    rows["joints"][2, 1:] = np.nan
    save_result(tmp_path / "r.csv", lambda: iter([rows]))
    assert (tmp_path / "r.csv").read_text().startswith("stamp_s,person,status,residual_m,humanoid_root_x,")
    again = read_rows(tmp_path / "r.csv")
    assert again["person"].tolist() == rows["person"].tolist() == [1, 12, 12, 1, 12]
    np.testing.assert_array_equal(again["stamps"], rows["stamps"])
    np.testing.assert_allclose(again["joints"], rows["joints"], atol=1e-6)
    np.testing.assert_array_equal(np.isnan(again["residual"]), np.isnan(rows["residual"]))


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        (["stamp_s,person,residual_m,a_x,a_y,a_z"], "expected columns stamp_s, person"),
        (
            [",".join([*FIRST, "a_x", "a_y", "a_z"]), "0,0,tracking,,1,1,1"],
            "line 2: person: expected an integer from 1",
        ),
        ([",".join([*FIRST, "a_x", "a_y", "a_z"]), "0,1,walking,,1,1,1"], "status: expected one of"),
        ([",".join([*FIRST, "a_x", "a_y", "a_z"]), "0,1,lost,,1,1"], "expected 7 cells, found 6"),
        ([",".join([*FIRST, "a_x", "a_y", "a_z"]), "0,1,lost,,1,1,q"], "expected numbers"),
        ([",".join([*FIRST, "a_x", "a_y", "a_z"]), *["0,1,lost,,1,1,1"] * 2], "one row for a person and stamp"),
        ([",".join([*FIRST, "a_x", "a_y", "a_z"]), "1,1,lost,,1,1,1", "0,1,lost,,1,1,1"], "do not fall"),
    ],
)
def test_other_files_are_refused(tmp_path, lines, words):
    (tmp_path / "r.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(VoodooError, match=words):
        read_rows(tmp_path / "r.csv")


HEADER = "stamp_s,person,in_view,humanoid_root_x,humanoid_root_y,humanoid_root_z"


def test_the_truth_comes_in_the_root_frame(tmp_path):
    (tmp_path / "t.csv").write_text(f"{HEADER}\n1.0,1,0.5,1,0,1\n1.0,2,1,2,0,1\n2.0,2,0.9,3,0,1\n")
    moved = np.eye(4)

    def root_from_base(stamp):
        return np.where(np.eye(4, k=3) > 0, stamp, moved)

    known = read_people_truth(tmp_path / "t.csv", root_from_base)
    assert known.persons.tolist() == [1, 2]
    np.testing.assert_array_equal(known.in_view, [[0.5, 1.0], [0.0, 0.9]])
    np.testing.assert_array_equal(known.of("humanoid_root")[:, 1], [[3.0, 0.0, 1.0], [5.0, 0.0, 1.0]])
    assert np.isnan(known.of("humanoid_root")[1, 0]).all()
    assert np.isnan(known.of("l_knee")).all()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (HEADER, "at least one row"),
        ("stamp_s,person,humanoid_root_x\n1,1,1", "expected columns"),
        (f"{HEADER}\n1,1,1,1", "expected 6 cells"),
        (f"{HEADER}\n1,1,1,1,2,x", "expected numbers"),
        (f"{HEADER}\n1,1.5,1,1,2,3", "persons from 1"),
        (f"{HEADER}\n1,1,1,1,2,3\n1,1,1,1,2,3", "one row for a person and stamp"),
    ],
)
def test_a_damaged_truth_is_refused(tmp_path, text, words):
    (tmp_path / "t.csv").write_text(text)
    with pytest.raises(RecordingError, match=words):
        read_people_truth(tmp_path / "t.csv", lambda _: np.eye(4))


def test_a_result_of_another_time_is_refused():
    known = truth([[0.0]] * 3, persons=(1,))
    later = result({1: [0.0] * 3})
    with pytest.raises(VoodooError, match="none in common"):
        judged(known, {**later, "stamps": later["stamps"] + 50.0})


def test_any_result_can_be_judged_by_the_command_line(voodoo_data, tmp_path):
    path = voodoo_data / "people" / "pp_p2_two_cross_twice_cmu"
    known = open_recording(path).people
    frame, person = np.nonzero(known.in_view >= 0.3)
    count = len(frame)
    places = known.positions[frame, person] + [0.03, 0.0, 0.0]
    rows = rows_of(known.stamps[frame], known.persons[person] + 6, places, names=known.names)
    save_result(tmp_path / "theirs.csv", lambda: iter([rows]))
    command = ["eval", str(path), "--result", str(tmp_path / "theirs.csv"), "--out", str(tmp_path / "out")]
    message = CliRunner().invoke(app, command)
    assert message.exit_code == 0, message.output
    assert (
        "| pp_p2_two_cross_twice_cmu | 2 | 2 | 1.000 | 1.000 | 0 | - | 0.00 (0.00) | 0 of 2 | 0.0 | 0 | 3.0 | - |"
        in message.output
    )
    with (tmp_path / "out" / "people.csv").open() as file:
        (row,) = csv.DictReader(file)
    assert float(row["mota"]) == float(row["idf1"]) == 1.0
    assert int(row["expected"]) == count

    no_truth = CliRunner().invoke(app, ["eval", str(voodoo_data / "rendered"), "--only", "rd_r1*", *command[2:]])
    assert no_truth.exit_code != 0


def test_a_result_of_the_only_person_is_judged_beside_their_truth(tmp_path):
    known = open_recording(sample_path()).reference
    places = known.positions + [0.0, 0.02, 0.0]
    rows = rows_of(known.stamps, np.full(len(known.stamps), 4), places, names=known.names)
    save_result(tmp_path / "theirs.csv", lambda: iter([rows]))
    command = ["eval", str(sample_path()), "--result", str(tmp_path / "theirs.csv")]
    message = CliRunner().invoke(app, command)
    assert message.exit_code == 0, message.output
    assert "| bend_scoop | 1 | 1 | 1.000 | 1.000 | 0 | - | 0.00 (0.00) | 0 of 1 | 0.0 | 0 | 2.0 | - |" in message.output


@pytest.mark.parametrize(
    ("reference", "words"),
    [
        (None, "found none"),
        (
            Reference(np.zeros(1), ("humanoid_root",), np.zeros((1, 1, 3)), exact=False),
            "that another tracker estimated",
        ),
        (Reference(np.zeros(1), ("l_hip",), np.zeros((1, 1, 3)), exact=True), "found l_hip"),
    ],
)
def test_a_truth_that_cannot_judge_is_named(reference, words):
    recording = SimpleNamespace(path="walk", people=None, reference=reference)
    with pytest.raises(
        RecordingError, match=rf"walk: expected truth_people.csv or truth.csv with humanoid_root.*{words}"
    ):
        truth_of(recording)


def test_without_the_library_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "motmetrics", None)
    with pytest.raises(VoodooError, match=r"voodoo-tracker\[eval\]"):
        judged(truth([[0.0]] * 3, persons=(1,)), result({1: [0.0] * 3}))
