"""Inverse kinematics through a recording, and `voodoo ik`."""

import gc
import json
import os
import signal
import sys
import tracemalloc
from functools import partial
from pathlib import Path

import numpy as np
import pytest

import commands
import voodoo
from commands import refused
from voodoo import ik
from voodoo.errors import VoodooError
from voodoo.export.track import Track
from voodoo.pipeline.ik import KNOWN, known_positions
from voodoo.pipeline.ik import follow as follow_frames
from voodoo.pipeline.start import start_tracker
from voodoo.recordings.loaders import sample_path
from voodoo.recordings.recording import Reference

sys.path.insert(0, str(Path(__file__).resolve().parent))
from test_exports import read_bvh


@pytest.fixture(scope="module")
def recording():
    return voodoo.open_recording(sample_path())


class Some(voodoo.recordings.Recording):
    """The first frames of a recording."""

    def __init__(self, recording, frames):
        self.whole = recording
        self.path, self.name, self.root_frame = recording.path, recording.name, recording.root_frame
        self.start, self.reference = recording.start, recording.reference
        self.frames = [frame for _, frame in zip(range(frames), recording, strict=False)]

    def __len__(self):
        return len(self.frames)

    def __iter__(self):
        return iter(self.frames)

    def info(self):
        return self.whole.info()


@pytest.fixture(scope="module")
def some(recording):
    return Some(recording, 12)


run = partial(commands.run, "ik")


def follow(*args, **kwargs):
    """The whole track, and the errors of every site in all frames."""
    steps = list(follow_frames(*args, **kwargs))
    names = dict.fromkeys(name for step in steps for name in step.errors)
    errors = {name: np.array([step.errors.get(name, np.nan) for step in steps]) for name in names}
    return Track.joined([step.track for step in steps]), errors


def test_follow_reaches_what_is_known_and_reports_the_rest(some):
    tracker = start_tracker(some)
    track, errors = follow(some, tracker, known_positions(some), pictures="depth")
    assert len(track) == 12 and set(track.status) <= {"tracking", "degraded"}
    assert set(errors) == set(some.reference.names) - set(KNOWN)
    assert np.nanmean(errors["l_elbow"]) < 0.08
    chain = ik.Chain(tracker.body)
    assert track.angle_names == chain.angle_names
    assert (track.angles >= chain.limits[:, 0] - 1e-12).all() and (track.angles <= chain.limits[:, 1] + 1e-12).all()
    # The residual of the file is that of the known sites.
    names = [name for name in KNOWN if name in some.reference.names]
    known = [some.reference.names.index(name) for name in names]
    sites = [track.joint_names.index(name) for name in names]
    apart = np.linalg.norm(track.joints[3, sites] - some.reference.positions[3, known], axis=1)
    assert track.residual[3] == pytest.approx(np.sqrt(np.mean(apart**2)), abs=1e-6)


def test_wrists_stand_in_for_hands_that_nobody_measured(some):
    reference = some.reference
    kept = [i for i, name in enumerate(reference.names) if name not in ("l_hand", "r_hand", "head_center")]
    names = tuple(reference.names[i] for i in kept)
    values = np.ascontiguousarray(reference.positions[:, kept])
    positions = Reference(reference.stamps, names, values, exact=False)
    _, errors = follow(some, start_tracker(some), positions, pictures="none")
    assert not {"l_wrist", "r_wrist", "skullbase"} & set(errors) and {"l_elbow", "r_elbow"} <= set(errors)
    # What is asked for is what is known.
    _, errors = follow(
        some, start_tracker(some), positions, pictures="none", sites=[name for name in KNOWN if name in positions.names]
    )
    assert {"l_wrist", "r_wrist", "skullbase"} <= set(errors)


def test_what_nothing_reports_goes_back_to_the_mean_unless_reported_otherwise(recording):
    some = Some(recording, 40)
    drawn, _ = follow(some, start_tracker(some), known_positions(some), pictures="none")
    left, _ = follow(some, start_tracker(some), known_positions(some), pictures="none", rest=False)
    # Targets come first: to be drawn costs them nothing.
    assert (drawn.residual <= left.residual + 1e-4).all()
    joints = slice(6, None)
    away = [np.abs(found.angles[:, joints] - found.angles[0, joints]).sum(axis=1) for found in (drawn, left)]
    assert away[0][-1] < away[1][-1]


def test_pictures_change_the_posture_and_nothing_known(some):
    tracker = start_tracker(some)
    plain, _ = follow(some, tracker, known_positions(some), pictures="none")
    depth, _ = follow(some, start_tracker(some), known_positions(some), pictures="depth")
    assert not np.allclose(plain.angles, depth.angles, atol=1e-3)
    assert (depth.residual <= plain.residual + 0.005).all()


def test_a_frame_without_known_sites_is_degraded_and_stays(some):
    positions = known_positions(some)
    values = positions.positions.copy()
    values[5] = np.nan
    known = Reference(positions.stamps, positions.names, values, exact=False)
    track, errors = follow(some, start_tracker(some), known, pictures="none")
    assert track.status[5] == "degraded" and np.flatnonzero(np.isnan(track.residual)).tolist() == [5]
    assert np.array_equal(track.angles[5], track.angles[4])
    assert np.isnan(errors["l_elbow"][5]) and np.isfinite(errors["l_elbow"][4])


def test_every_frame_alone_forgets_the_one_before(some):
    later = Some(some, 12)
    later.frames = later.frames[6:]
    alone, _ = follow(some, start_tracker(some), known_positions(some), pictures="none", warm=False)
    only, _ = follow(later, start_tracker(some), known_positions(some), pictures="none", warm=False)
    warm, _ = follow(some, start_tracker(some), known_positions(some), pictures="none")
    assert np.array_equal(alone.angles[6:], only.angles)
    assert not np.allclose(alone.angles[6:], warm.angles[6:], atol=1e-6)


def test_every_frame_alone_begins_at_the_first_pose_with_regions_too(some, monkeypatch):
    begun = []

    def noted(*args, start, **how):
        begun.append(start)
        return ik.solve(*args, start=start, **how)

    monkeypatch.setattr("voodoo.pipeline.ik.solve", noted)
    follow(Some(some, 3), start_tracker(some), known_positions(some), pictures="regions", warm=False)
    assert len(begun) == 5 and all(start is begun[0] for start in begun)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"pictures": "thermal"}, "thermal"),
        ({"sites": ("nose",)}, "expected some of"),
        ({"pictures": "color"}, "expected color pictures, found none"),
    ],
)
def test_what_cannot_be_followed(some, change, words):
    depth_only = Some(some, 3)
    depth_only.frames = [
        type(frame)(frame.stamp, tuple(item for item in frame.measurements if type(item).__name__ == "DepthImage"))
        for frame in depth_only.frames
    ]
    with pytest.raises(voodoo.VoodooError, match=words):
        follow(depth_only, start_tracker(some), known_positions(some), **change)


def test_no_frames_and_no_reference(some, monkeypatch, tmp_path):
    monkeypatch.setattr("voodoo.pipeline.ik.follow", lambda *_, **__: iter(()))
    done = run(sample_path(), "--out", tmp_path / "pose.csv")
    assert done.exit_code == 3 and "at least one frame" in done.stderr and not list(tmp_path.iterdir())
    bare = Some(some, 1)
    bare.reference = None
    with pytest.raises(voodoo.VoodooError, match="no reference"):
        known_positions(bare)


def test_command_line(tmp_path, recording):
    out = tmp_path / "angles.csv"
    result = run(sample_path(), "--pictures", "none", "--out", out)
    assert result.exit_code == 0, result.output
    assert "mm mean error" in result.stdout and f"{len(recording)} frames" in result.stdout
    track = Track.load(out)
    assert len(track) == len(recording) and "l_elbow_flexion" in track.angle_names
    # Its own result can be the target of another run, with fewer sites.
    again = run(sample_path(), "--pictures", "none", "--targets", out, "--sites", "l_hand, r_hand,head_center",
                "--alone", "--out", tmp_path / "again.npz")  # fmt: skip
    assert again.exit_code == 0, again.output
    # Alone, from far away, a few frames end in a valley; nearly all reach what the first run reached.
    assert np.quantile(Track.load(tmp_path / "again.npz").residual, 0.9) < 1e-4


def test_command_line_writes_what_animation_and_opensim_read(tmp_path, recording):
    out = {suffix: tmp_path / f"pose.{suffix}" for suffix in ("npz", "bvh", "trc")}
    result = run(sample_path(), "--pictures", "none", *(word for file in out.values() for word in ("--out", file)))
    assert result.exit_code == 0, result.output
    track = Track.load(out["npz"])
    # The reader shares no code with the writer; centimeters, X left, Y up, Z forward.
    places, _ = read_bvh(out["bvh"])
    for bone, site in (("l_forearm", "l_elbow"), ("r_calf", "r_knee"), ("l_hand", "l_wrist"), ("head", "skullbase")):
        error = places[bone][:, [2, 0, 1]] / 100.0 - track.joints[:, track.joint_names.index(site)]
        assert np.abs(error).max() < 1e-4, bone
    # The bend of an elbow in the file is the joint angle of the posture.
    ways = [places[far] - places[near] for near, far in (("l_upperarm", "l_forearm"), ("l_forearm", "l_hand"))]
    first, second = (way / np.linalg.norm(way, axis=1, keepdims=True) for way in ways)
    bend = np.arccos(np.clip((first * second).sum(axis=1), -1.0, 1.0))
    flexion = track.angles[:, track.angle_names.index("l_elbow_flexion")]
    assert np.ptp(flexion) > 0.3
    assert np.abs(np.diff(bend) - np.diff(flexion)).max() < 0.1 and np.corrcoef(bend, flexion)[0, 1] > 0.99
    table = np.loadtxt(out["trc"], skiprows=6, delimiter="\t")
    wrist = 2 + 3 * track.joint_names.index("l_wrist")
    expected = track.joints[:, track.joint_names.index("l_wrist")]
    assert table[:, wrist : wrist + 3] == pytest.approx(expected[:, [1, 2, 0]], abs=1e-6)


def test_command_line_takes_other_bodies(tmp_path):
    body = tmp_path / "body.toml"
    body.write_text(voodoo.Body.human(1.6, model="papers").to_toml())
    out = tmp_path / "pose.npz"
    result = run(sample_path(), "--pictures", "none", "--body", body, "--out", out)
    assert result.exit_code == 0, result.output
    assert set(Track.load(out).limb_names) == set(voodoo.Body.human(1.6, model="papers").limb_names)
    both = run(sample_path(), "--body", body, "--height", "1.7")
    assert both.exit_code != 0 and "not both" in both.stderr


def test_command_line_refuses_bad_input(tmp_path):
    refused(run(tmp_path / "nothing"), "nothing")
    refused(run(sample_path(), "--pictures", "thermal"), "thermal", "depth")
    refused(run(sample_path(), "--sites", "nose"), "nose", "l_hand")
    refused(run(sample_path(), "--out", tmp_path / "angles.doc"), ".csv")
    refused(run(sample_path(), "--targets", tmp_path / "missing.npz"), "missing.npz")
    # A result of another recording had no position for any frame, and a posture was written for each.
    cases = {"other.csv": ("12.5,1,tracking,0.01,1,2,3\n", "targets", "bend_scoop"), "empty.csv": ("", "found nobody")}
    for name, (rows, *words) in cases.items():
        (tmp_path / name).write_text(f"stamp_s,person,status,residual_m,l_hand_x,l_hand_y,l_hand_z\n{rows}")
        refused(run(sample_path(), "--targets", tmp_path / name, "--out", tmp_path / "o.npz"), *words)
    init = tmp_path / "init.json"
    init.write_text(json.dumps({"joints": {"l_shoulder": [0, 0]}}))
    refused(run(sample_path(), "--init", init), "l_shoulder")
    assert {path.name for path in tmp_path.iterdir()} == {"other.csv", "empty.csv", "init.json"}


def test_sites_that_nobody_knows_are_refused_by_name(some):
    how = {"positions": known_positions(some), "pictures": "none"}
    with pytest.raises(VoodooError, match=r"sites: expected some of .*l_wrist.*, found nose, l_wirst$"):
        follow(some, start_tracker(some), sites=("l_wrist", "nose", "l_wirst"), **how)


@pytest.mark.parametrize("name", ["SIGINT", "SIGTERM", "SIGHUP"])
def test_a_signal_keeps_the_frames_up_to_there(tmp_path, monkeypatch, name):
    steps, count = ik.Follower.step, iter(range(1000))

    def interrupted(self, *args, **kwargs):
        if next(count) == 5:
            os.kill(os.getpid(), getattr(signal, name))
        return steps(self, *args, **kwargs)

    monkeypatch.setattr(ik.Follower, "step", interrupted)
    done = run(sample_path(), "--pictures", "none", "--out", tmp_path / "pose.csv")
    assert done.exit_code == 128 + getattr(signal, name), done.output
    assert "interrupted: the rest of 90 frames is missing: 6 frames" in done.stderr
    assert len(Track.load(tmp_path / "pose.csv")) == 6 and len(list(tmp_path.iterdir())) == 1


def test_nothing_is_kept_of_a_frame(recording):
    """The memory is that of the frame, however many there were."""
    frames, start = (2 * list(recording))[:150], start_tracker(recording)
    many = Some(recording, 0)
    many.frames, used = frames, []
    tracemalloc.start()
    for number, _ in enumerate(follow_frames(many, start, known_positions(recording), pictures="none")):
        if number in (60, 149):
            gc.collect()
            used.append(tracemalloc.get_traced_memory()[0])
    tracemalloc.stop()
    assert used[1] - used[0] < 100 * 89, used
