"""voodoo track --people: rows, files of every kind, pictures; and recordings of made-up people."""

import csv
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest
from rosbags.highlevel import AnyReader
from typer.testing import CliRunner

import voodoo
from made_up import places_in, two_people
from synthetic.people import COLOR, MadeUpRecording
from voodoo.cli import app
from voodoo.cli.common import NO_POSE
from voodoo.drawing.ink import person_color
from voodoo.errors import VoodooError
from voodoo.evaluation.people_evaluate import judge
from voodoo.export.files import save
from voodoo.export.people import PeopleTrack
from voodoo.export.track import Track
from voodoo.measurements import LaserScan, MarkerSet, RecordedFrame
from voodoo.names import SEARCHING
from voodoo.pipeline.run import track
from voodoo.recordings import SensorInfo
from voodoo.sensors.adapters import Adapter, register, unregister
from voodoo.sensors.settings import FrontEndSettings
from voodoo.visualization.overlay import Overlay


@pytest.fixture(scope="module")
def followed():
    """Estimates of all frames, and the bodies of everybody."""
    people, bodies, estimates = voodoo.People(), {}, []
    for step in track(two_people(), people):
        estimates.append(step.estimate)
        bodies |= {person.id: people.body(person.id) for person in step.estimate}
    return PeopleTrack.of(estimates, bodies=bodies), bodies


@pytest.fixture
def run(monkeypatch, tmp_path):
    opened = {}

    def open_recording(path, **options):
        opened.update(options)
        return two_people()

    monkeypatch.setattr("voodoo.cli.running.open_recording", open_recording)
    monkeypatch.chdir(tmp_path)

    def call(*words):
        result = CliRunner().invoke(app, ["track", "somewhere", *words])
        result.opened = opened
        return result

    return call


def test_the_made_up_people_are_where_the_truth_reports(followed):
    recording = two_people()
    truth = recording.people
    assert truth.persons.tolist() == [1, 2]
    assert truth.in_view[0].tolist() == [0.0, 0.0]
    assert truth.in_view[2, 0] == 0.0
    assert (truth.in_view[3:, 0] > 0.8).all()
    assert (truth.in_view[-3:] > 0.8).all()
    points = places_in(recording, 30)
    for person in range(2):
        root = truth.of("humanoid_root")[30, person]
        assert np.linalg.norm(points - root, axis=1).min() < 0.15
    assert judge(recording, voodoo.People()).mota > 0.8


def test_recordings_are_the_same_for_the_same_seed():
    first, again = two_people(), MadeUpRecording(two_people().scene)
    for a, b in zip(list(first)[28:], list(again)[28:], strict=True):
        np.testing.assert_array_equal(a.measurements[1].image, b.measurements[1].image)
        np.testing.assert_array_equal(a.measurements[0].image, b.measurements[0].image)
    picture = list(first)[30].measurements[0].image
    green = (picture[..., 1].astype(int) - picture[..., 2] > 50).sum()
    assert green > 200, "the shirt of the second"


def test_a_row_exists_only_for_who_is_there(followed, run):
    result, _ = followed
    message = run("--people", "any", "--out", "all.csv")
    assert message.exit_code == 0, message.output
    assert "32 frames, 2 persons in" in message.stdout
    with Path("all.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header[:5] == ["stamp_s", "person", "status", "residual_m", "humanoid_root_x"]
    assert len(rows) == sum(len(track) for track in result.tracks.values()) < 2 * 32
    assert {row[1] for row in rows} == {"1", "2"}
    stamps = [float(row[0]) for row in rows]
    assert stamps == sorted(stamps)
    assert set(stamps) <= {recorded.stamp for recorded in two_people()}
    assert message.opened["bare"] is True
    assert PeopleTrack.load("all.csv").tracks.keys() == {1, 2}


def test_at_most_so_many_are_followed(run):
    assert run("--people", "2", "--use", "depth", "--out", "two.npz").exit_code == 0
    assert PeopleTrack.load("two.npz").tracks.keys() == {1, 2}


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (("--people", "0"), "expected any or a whole number from 1, found '0'"),
        (("--people", "all"), "expected any or a whole number from 1, found 'all'"),
        (("--people", "any", "--init", "start.json"), "init: expected none with --people"),
        (("--people", "any", "--use", "skin"), "several people are found in depth images"),
    ],
)
def test_what_does_not_go_together_is_refused(run, words, expected):
    message = run(*words, "--out", "no.csv")
    assert message.exit_code == 1
    assert expected in message.stderr


def test_the_npz_holds_everybody_exactly(followed, tmp_path):
    result, _ = followed
    result.save(tmp_path / "all.npz")
    again = PeopleTrack.load(tmp_path / "all.npz")
    np.testing.assert_array_equal(again.stamps, result.stamps)
    for one, own in result.tracks.items():
        for name in ("stamps", "residual", "joints", "world_from_limb", "angles"):
            np.testing.assert_array_equal(getattr(again.tracks[one], name), getattr(own, name))
        assert (again.tracks[one].status, again.tracks[one].limb_status) == (own.status, own.limb_status)


def test_the_csv_holds_of_everybody_what_it_holds_of_one(followed, tmp_path):
    result, _ = followed
    result.save(tmp_path / "all.csv")
    again = PeopleTrack.load(tmp_path / "all.csv")
    for one, alone in result.tracks.items():
        np.testing.assert_allclose(again.tracks[one].joints, alone.joints, atol=1e-6)
        assert (again.tracks[one].status, again.tracks[one].limb_status) == (alone.status, alone.limb_status)
        alone.save(tmp_path / "one.csv")
        with (tmp_path / "one.csv").open(newline="") as first, (tmp_path / "all.csv").open(newline="") as together:
            own = [{**row, "person": str(one)} for row in csv.DictReader(first)]
            assert own == [row for row in csv.DictReader(together) if row["person"] == str(one)]


def test_there_is_a_bvh_and_a_trc_for_every_person(followed, tmp_path):
    result, bodies = followed
    for suffix in (".bvh", ".trc"):
        written = save(result, tmp_path / f"all{suffix}", body=bodies, root_frame="base_link")
        assert [path.name for path in written] == [f"all_1{suffix}", f"all_2{suffix}"]
        assert all(path.is_file() for path in written)
    frames = [line for line in (tmp_path / "all_2.bvh").read_text().splitlines() if line.startswith("Frames:")]
    assert frames == [f"Frames: {len(result.unbroken(2))}"]


def test_the_bag_has_the_frames_of_everybody(followed, tmp_path):
    result, bodies = followed
    save(result, tmp_path / "all", body=bodies, root_frame="odom")
    children, stamps = {}, []
    with AnyReader([tmp_path / "all"]) as bag:
        topics = {connection.topic for connection in bag.connections}
        for connection, stamp, raw in bag.messages():
            stamps.append(stamp)
            if connection.topic == "/tf":
                for item in bag.deserialize(raw, connection.msgtype).transforms:
                    children.setdefault(item.child_frame_id, []).append(item.header.frame_id)
    assert {f"/humans/bodies/p{one}/joint_states" for one in (1, 2)} <= topics
    assert stamps == sorted(stamps)
    for one in (1, 2):
        assert set(children[f"body_p{one}"]) == {"odom"}
        assert len(children[f"body_p{one}"]) == len(result.tracks[one])
        assert f"l_elbow_p{one}" in children


def test_files_of_nobody_are_written_all_the_same(tmp_path):
    nobody = PeopleTrack(np.array([0.0, 0.1]), {})
    nobody.save(tmp_path / "nobody.csv")
    nobody.save(tmp_path / "nobody.npz")
    assert PeopleTrack.load(tmp_path / "nobody.npz").tracks == {}
    assert save(nobody, tmp_path / "nobody.bvh", body={}, root_frame="odom") == []
    save(nobody, tmp_path / "nobody.mcap", body={}, root_frame="odom")
    assert (tmp_path / "nobody.mcap").is_file()
    assert PeopleTrack.load(tmp_path / "nobody.csv").tracks == {}


def test_who_was_away_has_an_unbroken_track_with_a_gap(followed):
    result, _ = followed
    track = result.tracks[1]
    gone = PeopleTrack(result.stamps, {1: track.of_frames(np.r_[0:4, 9 : len(track)])})
    unbroken = gone.unbroken(1)
    assert len(unbroken) == len(track)
    assert unbroken.status[4:9] == (SEARCHING,) * 5
    np.testing.assert_array_equal(unbroken.of_frames(unbroken.found).joints, gone.tracks[1].joints)
    assert len(gone.unbroken(1, to_the_end=True)) >= len(unbroken)


def test_an_unbroken_track_is_in_the_order_of_frames_whose_stamps_do_not_rise(followed):
    result, _ = followed
    track = result.tracks[1].of_frames(np.arange(4))
    late, start = track.stamps[3], track.stamps[0]
    stamps = np.array([late, start, track.stamps[1], late + 1.0])
    set_back = PeopleTrack(stamps, {1: track.of_frames(np.array([0, 1, 3]))})
    unbroken = set_back.unbroken(1, to_the_end=True)
    assert unbroken.stamps.tolist() == stamps.tolist()
    assert unbroken.status[3] == SEARCHING
    np.testing.assert_array_equal(unbroken.joints[:3], track.joints[[3, 0, 1]])
    for wrong in ([start, start, late], [start, late, late + 9.0]):
        twice_or_of_no_frame = PeopleTrack(stamps, {1: replace(track.of_frames(np.arange(3)), stamps=np.array(wrong))})
        with pytest.raises(VoodooError, match="person 1: expected one row for a frame"):
            twice_or_of_no_frame.unbroken(1)


@pytest.mark.parametrize("suffix", [".csv", ".npz"])
def test_readers_of_one_person_take_the_only_one_and_refuse_several(followed, tmp_path, suffix):
    result, _ = followed
    PeopleTrack(result.stamps, {2: result.tracks[2]}).save(tmp_path / f"one{suffix}")
    assert len(Track.load(tmp_path / f"one{suffix}")) == len(result.tracks[2])
    result.save(tmp_path / f"two{suffix}")
    with pytest.raises(VoodooError, match=r"found persons 1, 2; PeopleTrack\.load reads them"):
        Track.load(tmp_path / f"two{suffix}")


def test_the_overlay_shows_everybody_in_a_color_of_their_own():
    people = voodoo.People()
    *_, last = track(two_people(), people)
    bodies = {person.id: people.body(person.id) for person in last.estimate}
    picture = Overlay(two_people()).draw(last.recorded, bodies, last.estimate, index=last.index)
    assert sorted(bodies) == [1, 2]
    for one in bodies:
        assert (np.abs(picture.astype(int) - person_color(one)).max(axis=2) < 40).sum() > 300


def test_the_command_line_draws_every_frame(run, monkeypatch):
    monkeypatch.setattr(MadeUpRecording, "__len__", lambda _: 2)
    monkeypatch.setattr(MadeUpRecording, "__iter__", lambda own, every=MadeUpRecording.__iter__: islice(every(own), 2))
    message = run("--people", "any", "--out", "a.csv", "--overlay", "look")
    assert message.exit_code == NO_POSE, message.output
    assert len(list(Path("look").iterdir())) == 2
    assert "nobody was found in 2 frames" in message.stderr


def test_a_frame_that_is_refused_costs_no_other_one(run, monkeypatch):
    def with_one_twice(own, every=MadeUpRecording.__iter__):
        first, second, third = islice(every(own), 3)
        return iter((first, second, second, third))

    monkeypatch.setattr(MadeUpRecording, "__iter__", with_one_twice)
    refused = run("--people", "any", "--out", "a.csv", "--strict")
    assert refused.exit_code == 1 and "frame 2" in refused.stderr
    message = run("--people", "any", "--out", "a.csv")
    assert message.exit_code == NO_POSE and message.stdout.startswith("3 frames"), message.output
    assert "left out 1 that the tracker refuses" in message.stderr


def test_boxes_reach_the_frame():
    """Without one there are two persons in the end."""
    recording = two_people()
    *_, last = track(recording, voodoo.People(), settings=FrontEndSettings(use=("depth",)))
    assert len(last.estimate) == 2
    everywhere = FrontEndSettings(use=("depth",), exclude=(((0.0, -5.0, -1.0), (9.0, 5.0, 3.0)),))
    steps = list(track(recording, voodoo.People(), settings=everywhere))
    assert all(len(step.estimate) == 0 for step in steps)


def test_skin_is_searched_for_on_everybody_where_it_is_asked_for():
    recording = two_people()
    used = {}
    for use in (None, ("depth", "skin")):
        steps = track(recording, voodoo.People(), settings=FrontEndSettings.of(recording, use=use))
        sources = [[person.estimate.sources for person in step.estimate] for step in steps]
        *_, last = [persons for persons in sources if persons and COLOR in persons[0]]
        used[use] = [person[COLOR][1] for person in last]
    assert len(used[None]) == 2 and max(used[None]) == 0
    assert min(used["depth", "skin"]) >= 1, used


@dataclass(frozen=True)
class Tag:
    """A measurement that a registered adapter knows."""

    stamp: float
    sensor: str = "tag"


class TagAdapter(Adapter):
    kind = "tag"
    measurement = Tag
    seen = 0

    def add(self, frame, item, context):
        TagAdapter.seen += 1


@pytest.fixture
def with_sensor(monkeypatch):
    """The made-up recording with another sensor, which is made for each stamp."""

    def added(kind, make, begin=30):
        plain, about = MadeUpRecording.__iter__, two_people().info()
        sensor = SensorInfo(make(0.0).sensor, kind, about.root_frame, 3, 30.0, "")
        monkeypatch.setattr(MadeUpRecording, "info", lambda _: replace(about, sensors=(*about.sensors, sensor)))

        def several(recording):
            for frame in islice(plain(recording), begin, None):
                yield RecordedFrame(frame.stamp, (make(frame.stamp), *frame.measurements))

        monkeypatch.setattr(MadeUpRecording, "__iter__", several)

    return added


LAMP = """name = "lamp"
[[limbs]]
name = "foot"
shape = { length = 0.2, a0 = 0.10, b0 = 0.10, a1 = 0.08, b1 = 0.08 }
"""


REFUSED = {
    "`--init FILE`": ("init: expected none", ("--init", "start.json")),
    "`--draw-regions`, `--background`": ("draw-regions: expected none with", ("--draw-regions",)),
    "a body that the detector does not know": (
        "by depth alone the body 'lamp' is not found",
        ("--body", "lamp.toml"),
    ),
}
USED = {
    "depth images": (),
    "`--use depth,skin`": ("--use", "depth,skin"),
    "color images": ("--use", "depth,color"),
    "markers, `--marker-map`": (),
    "any other registered adapter": (),
    "an adapter with `while_searching`": (),
}
ELSEWHERE = {
    "keypoints of several cameras",  # test_people.py
    "point clouds, laser scans",
    "`--exclude`, `--depth-range`, `--height`, `--age`, `--upright`",
}
"""Rows with tests of their own."""


def test_the_table_of_what_works_with_several_people_is_tested():
    text = (Path(__file__).parents[1] / "docs/how-to/people.md").read_text()
    rows = text.split("## What works")[1].split("|---|---|\n")[1].split("\n\n")[0].splitlines()
    assert {row.split(" | ")[0].removeprefix("| ") for row in rows} == {*REFUSED, *USED, *ELSEWHERE}
    assert {row.split(" | ")[0].removeprefix("| ") for row in rows if "an error" in row and "alone, an" not in row} == {
        *REFUSED
    }


@pytest.fixture
def everybody(monkeypatch):
    """Persons of each frame that a command tracks, and their bodies."""
    found, bodies, step = [], {}, voodoo.People.step

    def stepped(people, *items, **own):
        estimate = step(people, *items, **own)
        found.append({person.id: person.estimate for person in estimate})
        bodies.update({one: people.body(one) for one in found[-1]})
        return estimate

    monkeypatch.setattr(voodoo.People, "step", stepped)
    return found, bodies


@pytest.mark.parametrize("what", [*REFUSED, *USED])
def test_what_works_with_several_people(run, with_sensor, everybody, what, monkeypatch):
    words, options = REFUSED.get(what, ("", USED.get(what)))
    found, _ = everybody
    monkeypatch.setattr(TagAdapter, "seen", 0)
    if "adapter" in what:
        adapter = TagAdapter()
        adapter.while_searching = "while_searching" in what
        register(adapter)
    try:
        if "markers" in what:
            wrist = two_people().people.of("l_wrist")[-1, 1]
            with_sensor("markers", lambda stamp: MarkerSet("m", stamp, {"l_wrist": tuple(wrist)}), begin=22)
        elif "adapter" in what:
            with_sensor("tag", Tag)
        if "body" in what:
            Path("lamp.toml").write_text(LAMP)
        done = run("--people", "2", *options, "--out", "x.csv")
    finally:
        if "adapter" in what:
            unregister("tag")
    assert (done.exit_code, words in done.stderr) == (1 if words else 0, True), done.output
    if words:
        return
    assert found[-1].keys() == {1, 2}
    used = {one: {name for name, row in estimate.sources.items() if row[1]} for one, estimate in found[-1].items()}
    assert all("/camera/depth" in sources for sources in used.values())
    if "skin" in what:
        assert all(COLOR in sources for sources in used.values())
    elif "markers" in what:
        truth = two_people().people.of("humanoid_root")[-1]
        near = {
            one: np.linalg.norm(truth - each.joints["humanoid_root"], axis=1).argmin()
            for one, each in found[-1].items()
        }
        assert {near[one] for one in used if "m" in used[one]} == {1}
    elif "adapter" in what:  # in the first of two frames nobody is known
        assert TagAdapter.seen == (2 if "while_searching" in what else 1)


@pytest.mark.parametrize("options", [("--exclude", "0,-5,-1,9,5,3"), ("--depth-range", "0.1,1.0")], ids=" ".join)
def test_who_is_cut_off_is_not_found(run, options):
    done = run("--people", "any", *options, "--out", "x.csv")
    assert done.exit_code == NO_POSE and "nobody was found" in done.stderr


@pytest.mark.parametrize("options", [("--height", "1.5"), ("--age", "6")], ids=" ".join)
def test_a_stature_or_an_age_holds_for_everybody(run, everybody, options):
    """Sizes are fitted from there, and those who are taller come out too small."""
    _, bodies = everybody
    lengths = []
    for more in ((), options):
        assert run("--people", "2", *more, "--out", "x.csv").exit_code == 0
        lengths.append([sum(limb.shape.length for limb in bodies[one].limbs) for one in (1, 2)])
    assert (np.array(lengths[1]) < 0.97 * np.array(lengths[0])).all()


def test_upright_is_taken_for_everybody(run):
    done = run("--people", "2", "--upright", "--out", "x.csv")
    assert done.exit_code == 0 and "--upright turned nothing: z = 0 of the root frame is the floor" in done.stderr


def laser():
    """Returns of the legs of both in the last frame, 0.4 m above the floor."""
    pose = np.eye(4)
    pose[2, 3] = 0.4
    places = places_in(two_people(), -1)
    x, y = places[(np.abs(places[:, 2] - 0.4) < 0.03) & (places[:, 0] < 4.4)].T[:2]
    step, ranges = np.radians(0.5), np.full(361, np.nan, np.float32)
    rays = np.rint((np.arctan2(y, x) + np.pi / 2) / step).astype(int)
    ranges[rays] = np.hypot(x, y)
    return LaserScan("laser", 0.0, ranges, -np.pi / 2, step, 0.05, 20.0, pose)


def test_a_scan_is_assigned_by_the_surface_and_is_an_error_alone(run, with_sensor, everybody):
    found, _ = everybody
    scan, chance = laser(), np.random.default_rng(0)

    def measured(stamp):
        return replace(scan, stamp=stamp, ranges=scan.ranges + chance.normal(0.0, 0.005, 361).astype(np.float32))

    with_sensor("scan", measured, begin=26)
    assert run("--people", "2", "--out", "x.csv").exit_code == 0
    given, matched, _ = zip(*(found[-1][one].sources["laser"] for one in (1, 2)), strict=True)
    assert min(matched) > 5 and sum(given) <= np.isfinite(scan.ranges).sum()
    alone = run("--people", "2", "--use", "scan", "--out", "x.csv")
    assert alone.exit_code == 1 and "several people are found in depth images" in alone.stderr


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--layout", "body25"), "layout: expected an input it is for (keypoints), found depth"),
        (("--marker-map", "map.toml"), "marker-map: expected an input it is for (markers)"),
        (("--draw-regions", "--overlay", "o"), "draw-regions: expected an input it is for (color)"),
        (("--use", "skin", "--depth-range", "1,3"), "depth-range: expected an input it is for (depth), found skin"),
        (("--use", "skin", "--exclude", "0,0,0,1,1,1"), "exclude: expected an input it is for (depth, points, scan)"),
    ],
)
def test_an_option_for_an_input_that_is_not_there_is_refused(run, options, words):
    Path("map.toml").write_text("")
    done = run(*options, "--out", "x.csv")
    assert done.exit_code == 1 and words in done.stderr, done.output
