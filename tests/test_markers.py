"""Marker files and markers on limbs."""

import re
from pathlib import Path

import c3d
import numpy as np
import pytest
from typer.testing import CliRunner

import voodoo
from scene import standing_joints
from voodoo.cli import app
from voodoo.errors import BodyError, MeasurementError, RecordingError
from voodoo.recordings import open_recording
from voodoo.recordings.marker_files import MarkerMap
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_markers, read_trc
from voodoo.sensors.markers import add_markers, body_with_markers, marker_offset

TRC = (
    "PathFileType\t4\t(X/Y/Z)\tx.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t2\t2\tmm\t100\t0\t2\n"
    "Frame#\tTime\tA\t\t\tB\t\t\t\n"
    "\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n"
    "1\t0.00\t1\t2\t3\t\t\t\n"
    "2\t0.01\t1\t2\t3\t4\t5\t6\n"
)


def test_trc_units_axes_and_missing_markers(tmp_path):
    path = tmp_path / "x.trc"
    path.write_text(TRC)
    markers = read_trc(path)
    assert (markers.names, markers.rate_hz) == (("A", "B"), 100.0)
    np.testing.assert_allclose(markers.stamps, [0.0, 0.01])
    np.testing.assert_allclose(markers.positions[1] @ Z_UP_FROM_Y_UP.T, [[0.003, 0.001, 0.002], [0.006, 0.004, 0.005]])
    assert np.isnan(markers.positions[0, 1]).all() and np.isfinite(markers.positions[0, 0]).all()


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("PathFileType", "Path"), "first line"),
        (("\tmm\t", "\tyd\t"), "Units"),
        (("4\t5\t6", "4\tfive\t6"), "line 7"),
        (("2\t0.01", "2\t0.00"), "rising"),
        (("\tB\t", "\tA\t"), "different"),
    ],
)
def test_damaged_trc_is_refused(tmp_path, change, message):
    path = tmp_path / "x.trc"
    path.write_text(TRC.replace(*change))
    with pytest.raises(RecordingError, match=message):
        read_markers(path)


def in_spaces(text):
    full = text.replace("1\t0.00\t1\t2\t3\t\t\t", "1\t0.00\t1\t2\t3\t4\t5\t6")
    return "\n".join(" ".join(line.split()) for line in full.splitlines()).encode()


@pytest.mark.parametrize(
    "encode",
    [
        lambda text: b"\xef\xbb\xbf" + text.encode(),
        lambda text: text.encode("utf-16"),
        lambda text: text.replace("x.trc", "Müller.trc").encode("cp1252"),
        lambda text: text.replace("\t", ",").encode(),
        in_spaces,
        lambda text: text.replace("0.01", "0,01").encode(),
        lambda text: text.replace("\tmm\t", "\tMillimeters\t").encode(),
        lambda text: text.replace("\tmm\t", "\tMM\t").encode(),
    ],
)
def test_other_encodings_separators_and_units_of_a_trc_are_read(tmp_path, encode):
    path = tmp_path / "x.trc"
    path.write_bytes(encode(TRC))
    markers = read_markers(path)
    assert (markers.names, markers.rate_hz, markers.remarks) == (("A", "B"), 100.0, ())
    np.testing.assert_allclose(markers.stamps, [0.0, 0.01])
    np.testing.assert_allclose(markers.positions[1], [[0.001, 0.002, 0.003], [0.004, 0.005, 0.006]])


def test_a_missing_marker_between_spaces_is_refused(tmp_path):
    """Its cells are nowhere, and the next marker would get its place."""
    path = tmp_path / "x.trc"
    path.write_bytes(in_spaces(TRC).replace(b"0.00 1 2 3 4 5 6", b"0.00 4 5 6"))
    with pytest.raises(RecordingError, match="line 6: expected 8 columns, found 5"):
        read_markers(path)


def test_rows_that_are_missing_are_told(tmp_path):
    path = write_rows(tmp_path / "x.trc", *walking([1, 2, 0]))
    path.write_text(path.read_text().replace("50\t50\t3\t", "50\t50\t40\t"))
    recording = open_recording(path)
    assert len(recording) == 3
    assert recording.assumed == ("x.trc: 3 frames, where its header says 40",)


def test_one_subject_before_all_names_is_left_out_and_two_are_not(tmp_path):
    names, rows = walking([1, 2, 0])
    path = write_rows(tmp_path / "x.trc", [f"P01:{name}" for name in names], rows)
    assert set(next(iter(open_recording(path))).measurements[0].positions) == set(names)
    write_rows(path, [f"P0{index % 2}:{name}" for index, name in enumerate(names)], rows)
    (said,) = open_recording(path).assumed
    assert "no marker is named like a site" in said and "P00:l_shoulder" in said and "--marker-map: [sites]" in said
    assert CliRunner().invoke(app, ["track", str(path), "--out", str(tmp_path / "pose.csv")]).exit_code == 1


@pytest.mark.filterwarnings("ignore:No analog data")
@pytest.mark.parametrize("units", ["m m m", "M  "])
def test_a_c3d_may_write_its_unit_once_for_every_marker(tmp_path, units):
    names, rows = walking([0, 1, 2])
    writer = c3d.Writer(point_rate=50.0, point_units=units, gen_scale=-1.0)
    writer.set_point_labels(names)
    for row in rows:
        writer.add_frames([(np.column_stack([row, np.zeros((len(row), 2))]), np.zeros((0, 1)))])
    with (tmp_path / "x.c3d").open("wb") as file:
        writer.write(file)
    np.testing.assert_allclose(read_markers(tmp_path / "x.c3d").positions, rows, atol=1e-6)


def walking(axes, zeros=()):
    """Rows (3, 12, 3) of a person's joints in a file whose axis `axes` [2] is up, 1 m from the origin; some are zeros."""
    joints = standing_joints(voodoo.Body.human())
    names = [f"{side}_{name}" for side in "lr" for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")]
    places = np.array([joints[name] for name in names]) + (1.0, 0.5, 0.9)
    rows = np.array([places + (0.02 * index, 0.0, 0.0) for index in range(3)])
    for name in zeros:
        rows[1:, names.index(name)] = 0.0
    return names, rows[:, :, axes]


def write_rows(path, names, rows):
    markers = [("", "", *(f"X{i}\tY{i}\tZ{i}" for i in range(len(names))))]
    lines = TRC.splitlines()[:2] + [f"50\t50\t{len(rows)}\t{len(names)}\tm\t50\t1\t{len(rows)}"]
    lines += ["Frame#\tTime\t" + "\t\t\t".join(names), "\t".join(markers[0])]
    lines += ["\t".join(map(str, (i, i / 50.0, *row.ravel()))) for i, row in enumerate(rows)]
    path.write_text("\n".join(lines) + "\n")
    return path


def test_zeros_were_not_seen(tmp_path):
    path = write_rows(tmp_path / "x.trc", *walking([1, 2, 0], zeros=["l_knee", "r_wrist"]))
    first, *others = (frame.measurements[0].positions for frame in open_recording(path))
    assert len(first) == 12
    assert all(first.keys() - other.keys() == {"l_knee", "r_wrist"} for other in others)


def test_a_trc_whose_body_lies_is_doubted(tmp_path):
    assert open_recording(write_rows(tmp_path / "up.trc", *walking([1, 2, 0]))).assumed == ()
    (said,) = open_recording(write_rows(tmp_path / "lies.trc", *walking([0, 1, 2]))).assumed
    assert "the body stands along its +Z" in said and "y_up = false" in said
    told = open_recording(tmp_path / "lies.trc", markers=MarkerMap(y_up=False))
    assert told.assumed == ()
    assert upright(told) > 0.4
    names, rows = walking([1, 2, 0])
    (said,) = open_recording(write_rows(tmp_path / "high.trc", names, rows + (0.0, 4.0, 0.0))).assumed
    assert "no marker is lower than 4." in said


def upright(recording):
    """Height of the shoulders above the hips [m]."""
    positions = next(iter(recording)).measurements[0].positions
    return positions["l_shoulder"][2] - positions["l_hip"][2]


@pytest.mark.filterwarnings("ignore:No analog data")
@pytest.mark.parametrize(
    ("screen", "axes", "signs"),
    [
        ("+Z", [0, 1, 2], (1, 1, 1)),
        ("+Y", [1, 2, 0], (1, 1, 1)),
        ("+X", [2, 0, 1], (1, 1, 1)),
        ("-Z", [0, 1, 2], (1, -1, -1)),
        ("-Y", [1, 2, 0], (1, -1, -1)),
        ("-X", [2, 0, 1], (-1, 1, -1)),
    ],
)
def test_a_c3d_says_which_axis_is_up(tmp_path, screen, axes, signs):
    names, rows = walking(axes)
    right = "+X" if screen[1] != "X" else "+Y"
    recording = open_recording(write_c3d(tmp_path / "x.c3d", names, rows * signs, X=right, Y=screen))
    assert f"up is {screen} of the file" in str(recording.info())
    assert upright(recording) > 0.4
    assert recording.start["joints"]["l_shoulder"][2] > 1.2
    assert recording.assumed == ()


def write_c3d(path, names, rows, **screens):
    writer = c3d.Writer(point_rate=50.0, point_units="m  ", gen_scale=-1.0)
    writer.set_point_labels(names)
    for screen, axis in screens.items():
        writer.point_group.set_str(f"{screen}_SCREEN", "", axis, len(axis))
    for row in rows:
        writer.add_frames([(np.column_stack([row, np.zeros((len(row), 2))]), np.zeros((0, 1)))])
    with path.open("wb") as file:
        writer.write(file)
    return path


@pytest.mark.filterwarnings("ignore:No analog data")
@pytest.mark.parametrize(
    ("axes", "screens", "up", "said"),
    [
        ([0, 1, 2], {"Y": "Z"}, "+Z", None),
        ([0, 1, 2], {"X": "+X"}, "+Z", "only that X is level; +Z is taken for up, along which the body stands"),
        ([1, 2, 0], {"X": "-Z"}, "+Y", "only that Z is level; +Y is taken for up, along which"),
        ([1, 2, 0], {"X": "+Y"}, "+Z", "+Z is taken for up, a guess"),  # which the body contradicts
        ([0, 1, 2], {"X": "+Z", "Y": "-Z"}, "+Y", "X_SCREEN +Z and Y_SCREEN -Z are the same axis"),
        ([0, 1, 2], {"X": "+X", "Y": "+Y"}, "+Y", "the body stands along its +Z"),
        ([1, 2, 0], {"X": "+X", "Y": "+Z"}, "+Z", "if that is up, y_up = true"),
        ([0, 1, 2], {}, "+Y", "the body stands along its +Z"),
    ],
)
def test_half_of_the_screen_of_a_c3d_and_a_wrong_one_are_said(tmp_path, axes, screens, up, said):
    recording = open_recording(write_c3d(tmp_path / "x.c3d", *walking(axes), **screens))
    assert f"up is {up} of the file" in str(recording.info())
    assert (said in " ".join(recording.assumed)) if said else recording.assumed == ()
    doubted = any("the body stands along its" in words for words in recording.assumed)
    assert (upright(recording) > 0.4) != doubted


def test_c3d_round_trip_with_the_library_that_defines_it(tmp_path):
    ezc3d = pytest.importorskip("ezc3d", reason="ezc3d is not installed")
    content = ezc3d.c3d()
    content["parameters"]["POINT"]["RATE"]["value"] = [50.0]
    content["parameters"]["POINT"]["LABELS"]["value"] = ["LWRA", "RWRA"]
    content["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    points = np.ones((4, 2, 5))
    points[:3] = np.arange(30).reshape(3, 2, 5)
    points[:3, 1, 2] = np.nan
    content["data"]["points"] = points
    content.write(str(tmp_path / "x.c3d"))
    markers = read_markers(tmp_path / "x.c3d")
    assert (markers.names, markers.rate_hz, len(markers.stamps)) == (("LWRA", "RWRA"), 50.0, 5)
    np.testing.assert_allclose(markers.positions[3, 0], points[:3, 0, 3] / 1000.0, atol=1e-6)
    assert np.isnan(markers.positions[2, 1]).all()
    (tmp_path / "bad.c3d").write_bytes(b"not a c3d file")
    with pytest.raises(RecordingError, match="c3d"):
        read_markers(tmp_path / "bad.c3d")


def test_a_marker_with_an_offset_pulls_its_limb():
    joints = {
        "l_hip": (0, 0.1, 0.9),
        "r_hip": (0, -0.1, 0.9),
        "l_shoulder": (0, 0.2, 1.4),
        "r_shoulder": (0, -0.2, 1.4),
    }
    body = body_with_markers(voodoo.Body.human(height=1.75, model="papers"), {"BACK": ("torso", (-0.12, 0.0, 0.3))})
    tracker = voodoo.Tracker(body, config=voodoo.Config(max_steps=50))
    start = tracker.reset(joints=joints, fit_sizes=False)
    position = start.joints["BACK"]
    np.testing.assert_allclose(marker_offset(start.world_from_limb["torso"], position), (-0.12, 0.0, 0.3), atol=1e-6)
    frame = voodoo.Frame(stamp=0.0)
    for name in ("BACK", "l_hip", "r_hip", "l_shoulder", "r_shoulder"):
        frame.add_position(name, start.joints[name] + [0.02, 0.01, 0.0], weight=100.0)
    moved = tracker.step(frame)
    assert np.linalg.norm(moved.joints["BACK"] - position - [0.02, 0.01, 0.0]) < 0.005
    with pytest.raises(BodyError, match="tail"):
        body_with_markers(body, {"X": ("tail", (0, 0, 0))})


def test_add_markers_leaves_out_what_is_missing(tmp_path):
    path = tmp_path / "x.trc"
    path.write_text(TRC)
    markers = read_trc(path)
    sites = {"A": "l_wrist", "B": "r_wrist", "C": "vc7"}
    assert add_markers(voodoo.Frame(stamp=0.0), markers, 0, sites=sites, weight=1.0) == ("l_wrist",)
    assert add_markers(voodoo.Frame(stamp=0.0), markers, 1, sites=sites, weight=1.0) == ("l_wrist", "r_wrist")
    with pytest.raises(MeasurementError, match="0 to 1"):
        add_markers(voodoo.Frame(stamp=0.0), markers, 2, sites=sites, weight=1.0)


def test_a_result_does_not_overwrite_what_is_read(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for name in ("walk.trc", "other.trc"):
        Path(name).write_text(TRC)
    Path("again.trc").symlink_to("walk.trc")
    for arguments in (["walk.trc"], ["again.trc"], ["other.trc", "--with", "walk.trc"]):
        result = CliRunner().invoke(app, ["track", *arguments, "--out", "walk.trc"])
        assert result.exit_code == 1 and "walk.trc: expected another file than what is read" in result.stderr
        assert Path("walk.trc").read_text() == TRC


def test_the_documented_marker_map_fits_the_default_human(tmp_path):
    text = (Path(__file__).parents[1] / "docs" / "how-to" / "keypoints.md").read_text(encoding="utf-8")
    (block,) = [block for block in re.findall(r"```toml\n(.*?)```", text, re.DOTALL) if "markers.toml" in block]
    (tmp_path / "markers.toml").write_text(block, encoding="utf-8")
    chosen = MarkerMap.load(tmp_path / "markers.toml")
    body = body_with_markers(voodoo.Body.human(), chosen.worn())
    assert chosen.limbs and set(chosen.limbs) <= set(body.site_names)
    assert set(chosen.sites.values()) <= set(body.site_names)
