import csv
import json
from dataclasses import replace

import numpy as np
import pytest

import voodoo
from core_fakes import T_POSE, pose, searching
from scene import standing_joints
from voodoo.errors import VoodooError
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.pipeline.start import Init


def estimates(frames=5):
    rng = np.random.default_rng(0)
    for index in range(frames):
        joints = {name: np.add(position, rng.normal(0.0, 0.02, 3)) for name, position in T_POSE.items()}
        yield pose(joints, 1700201000.123456 + index / 30.0, status="lost" if index == 3 else "tracking")[1]


def test_npz_round_trip_is_exact(tmp_path):
    track = Track.of(list(estimates()))
    track.save(tmp_path / "pose.npz")
    again = Track.load(tmp_path / "pose.npz")
    for name in ("stamps", "residual", "joints", "world_from_limb"):
        assert np.array_equal(getattr(again, name), getattr(track, name))
    for name in ("status", "joint_names", "limb_names"):
        assert getattr(again, name) == getattr(track, name)
    assert again.world_from_limb.shape == (5, 10, 4, 4)
    assert again.status == ("tracking", "tracking", "tracking", "lost", "tracking")


def test_csv_round_trip_keeps_stamps_exactly_and_positions_to_a_micrometer(tmp_path):
    track = Track.of(list(estimates()))
    track.save(tmp_path / "pose.csv")
    again = Track.load(tmp_path / "pose.csv")
    assert np.array_equal(again.stamps, track.stamps)
    assert np.abs(again.joints - track.joints).max() <= 0.5001e-6
    assert again.joint_names == track.joint_names
    assert again.status == track.status
    assert again.limb_names == ()


def test_csv_columns(tmp_path):
    track = Track.of(list(estimates(2)))
    track.save(tmp_path / "new" / "pose.csv")
    with (tmp_path / "new" / "pose.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert list(rows[0])[:7] == [
        "stamp_s",
        "person",
        "status",
        "residual_m",
        "humanoid_root_x",
        "humanoid_root_y",
        "humanoid_root_z",
    ]
    assert list(rows[0])[-len(track.limb_names) :] == [f"{limb}_status" for limb in track.limb_names]
    assert [row["person"] for row in rows] == ["1", "1"]
    assert len(rows[0]) == 4 + 3 * len(T_POSE) + len(track.limb_names)
    assert float(rows[1]["l_wrist_y"]) == pytest.approx(
        track.joints[1, track.joint_names.index("l_wrist"), 1], abs=1e-6
    )
    assert [path.name for path in (tmp_path / "new").iterdir()] == ["pose.csv"]


def test_nan_is_refused():
    items = list(estimates(3))
    items[1].joints["l_elbow"][2] = np.nan
    with pytest.raises(VoodooError, match=r"joints: .* frame 1"):
        Track.of(items)


def test_no_frames_and_changing_bodies_are_refused():
    with pytest.raises(VoodooError, match="at least one frame"):
        Track.of([])
    items = list(estimates(2))
    del items[1].joints["l_wrist"]
    with pytest.raises(VoodooError, match="estimate 1"):
        Track.of(items)


@pytest.mark.parametrize("content", [b"", b"stamp_s,status\n1,2\n", b"PK\x03\x04rubbish", b"\xff\xfe\x00"])
@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_other_files_are_refused_by_name(tmp_path, content, suffix):
    path = tmp_path / f"bad{suffix}"
    path.write_bytes(content)
    with pytest.raises(VoodooError, match=r"bad\."):
        Track.load(path)


def test_truncated_npz_and_short_csv_row(tmp_path):
    track = Track.of(list(estimates(3)))
    for name in ("pose.npz", "pose.csv"):
        track.save(tmp_path / name)
        content = (tmp_path / name).read_bytes()
        (tmp_path / name).write_bytes(content[: len(content) * 2 // 3])
        with pytest.raises(VoodooError, match="pose"):
            Track.load(tmp_path / name)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_path_may_be_a_string(tmp_path, suffix):
    Track.of(list(estimates(2))).save(str(tmp_path / f"pose{suffix}"))
    assert len(Track.load(str(tmp_path / f"pose{suffix}"))) == 2


def test_a_file_that_is_not_there_is_no_damage(tmp_path):
    with pytest.raises(VoodooError, match=r"pose\.csv: expected a result of voodoo track, found no such file$"):
        Track.load(tmp_path / "pose.csv")


def test_other_suffixes_are_refused(tmp_path):
    with pytest.raises(VoodooError, match=r"\.csv or \.npz, found '\.txt'"):
        Track.of(list(estimates(1))).save(tmp_path / "pose.txt")


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_a_lost_frame_without_measurements_has_no_residual(tmp_path, suffix):
    result = Track.of(list(estimates(3)))
    residual = result.residual.copy()
    residual[1] = np.nan
    with pytest.raises(VoodooError, match="residual"):
        replace(result, residual=residual)
    lost = replace(result, residual=residual, status=("tracking", "lost", "tracking"))
    lost.save(tmp_path / f"result{suffix}")
    again = Track.load(tmp_path / f"result{suffix}")
    assert np.isnan(again.residual[1]) and np.isfinite(again.residual[[0, 2]]).all()


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_searching_frames_are_empty_and_nothing_else_is(tmp_path, suffix):
    items = list(estimates(4))
    items[0], items[2] = (searching(items[index].stamp) for index in (0, 2))
    result = Track.of(items)
    assert result.found.tolist() == [False, True, False, True] and result.joint_names == tuple(T_POSE)
    result.save(tmp_path / f"pose{suffix}")
    again = Track.load(tmp_path / f"pose{suffix}")
    assert again.status == result.status and np.array_equal(again.stamps, result.stamps)
    assert np.array_equal(np.isfinite(again.joints).all(axis=(1, 2)), result.found)
    part = again.of_frames(again.found)
    assert len(part) == 2 and np.isfinite(part.joints).all() and part.status == ("tracking", "lost")
    joints = result.joints.copy()
    joints[0] = 0.0
    with pytest.raises(VoodooError, match=r"joints: expected NaN while searching, found 0\.0 in frame 0"):
        replace(result, joints=joints)
    with pytest.raises(VoodooError, match="residual: expected finite numbers, found nan in frame 2"):
        replace(result, status=("searching", "tracking", "tracking", "tracking"))


def test_nobody_has_the_names_of_the_body(tmp_path):
    body = voodoo.Body.human(1.7)
    Track.of([searching(0.0), searching(0.1)], body=body).save(tmp_path / "pose.csv")
    read = Track.load(tmp_path / "pose.csv")
    assert read.joint_names == body.site_names and "l_knee_flexion" in read.angle_names
    assert np.isnan(read.joints).all() and read.joints.shape == (2, 21, 3)


@pytest.fixture
def supported():
    body = voodoo.Body.human(1.7, model="papers")
    tracker = voodoo.Tracker(body)
    standing = standing_joints(body)
    tracker.reset(joints=standing)
    found = [searching(0.0)]
    for number in range(1, 4):
        frame = voodoo.Frame(stamp=number / 30)
        for name, place in standing.items():
            frame.add_position(name, place, weight=20.0)
        found.append(tracker.step(frame))
    return Track.of(found, body=body, left_out={"that are blank": 3, "without a stamp": 1})


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_the_status_of_every_limb_is_kept(tmp_path, supported, suffix):
    assert supported.limb_status["l_forearm"][0] == ""
    assert "measured" in {word for words in supported.limb_status.values() for word in words}
    supported.save(tmp_path / f"pose{suffix}")
    again = Track.load(tmp_path / f"pose{suffix}")
    assert again.limb_status == supported.limb_status
    assert again.left_out == ({} if suffix == ".csv" else supported.left_out)
    assert supported.of_frames(supported.found).limb_status["l_forearm"] == supported.limb_status["l_forearm"][1:]


def test_limb_columns_stand_behind_the_angles(tmp_path, supported):
    supported.save(tmp_path / "pose.csv")
    header = (tmp_path / "pose.csv").read_text().splitlines()[0].split(",")
    last = max(index for index, name in enumerate(header) if name.endswith("_rad"))
    sure = [f"{name}_sigma_m" for name in supported.joint_names]
    assert header[last + 1 :] == [f"{limb}_status" for limb in supported.limb_names] + sure


def test_readers_pass_over_columns_and_arrays_of_later_versions(tmp_path, supported):
    supported.save(tmp_path / "pose.csv")
    lines = (tmp_path / "pose.csv").read_text().splitlines()
    more = [lines[0] + ",l_wrist_sx,l_wrist_sy,l_wrist_sz,mood"] + [line + ",0.01,0.02,,fine" for line in lines[1:]]
    (tmp_path / "later.csv").write_text("\n".join(more) + "\n")
    later, now = Track.load(tmp_path / "later.csv"), Track.load(tmp_path / "pose.csv")
    assert np.array_equal(later.joints, now.joints, equal_nan=True) and later.limb_status == now.limb_status
    assert np.array_equal(later.angles, now.angles, equal_nan=True) and later.angle_names == now.angle_names
    supported.save(tmp_path / "pose.npz")
    content = dict(np.load(tmp_path / "pose.npz"))
    assert content["format_version"] == 3
    np.savez(tmp_path / "more.npz", **content, mood=np.ones(3))
    assert len(Track.load(tmp_path / "more.npz")) == 4
    np.savez(tmp_path / "late.npz", **{**content, "format_version": np.array(99)})
    with pytest.raises(VoodooError, match="format_version: expected 3 at most, found 99"):
        Track.load(tmp_path / "late.npz")
    old = {name: content[name] for name in content if not name.startswith(("format", "limb_status", "left_out"))}
    np.savez(tmp_path / "old.npz", **old)
    assert Track.load(tmp_path / "old.npz").limb_status == {}


def test_a_file_of_before_is_person_1(tmp_path, supported):
    """It had no persons."""
    for suffix in (".csv", ".npz"):
        supported.save(tmp_path / f"pose{suffix}")
    lines = [line.split(",") for line in (tmp_path / "pose.csv").read_text().splitlines()]
    (tmp_path / "old.csv").write_text("".join(",".join([line[0], *line[2:]]) + "\n" for line in lines))
    content = dict(np.load(tmp_path / "pose.npz"))
    assert np.array_equal(content.pop("frame_stamps"), supported.stamps) and content.pop("person").tolist() == [1] * 4
    np.savez(tmp_path / "old.npz", **{**content, "format_version": np.array(2)})
    for suffix in (".csv", ".npz"):
        old, now = Track.load(tmp_path / f"old{suffix}"), Track.load(tmp_path / f"pose{suffix}")
        assert np.array_equal(old.joints, now.joints, equal_nan=True) and old.limb_status == now.limb_status
        assert old.status == now.status == supported.status
        people = PeopleTrack.load(tmp_path / f"old{suffix}")
        assert list(people.tracks) == [1] and people.stamps.tolist() == supported.stamps.tolist()


def test_a_first_pose_carries_a_format_version():
    init = Init.model_validate({"joints": {"l_hip": (0.0, 0.0, 1.0)}})
    assert json.loads(init.to_json())["format_version"] == 1
    with pytest.raises(ValueError, match="less than or equal to 1"):
        Init.model_validate({"format_version": 2, "joints": {"l_hip": (0.0, 0.0, 1.0)}})
