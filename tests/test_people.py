"""Several people from Python: who is there, what is refused, and real recordings of two."""

import csv
from itertools import islice

import numpy as np
import pytest

import voodoo
from measurement_data import data_folder
from synthetic.stories import four
from voodoo.errors import BodyError, ConfigError, MeasurementError
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.run import track
from voodoo.recordings import open_recording
from voodoo.recordings.marker_trajectories import Z_UP_FROM_Y_UP, read_trc
from voodoo.recordings.pose2sim import SITES
from voodoo.sensors.settings import FrontEndSettings
from voodoo.synthetic.render import render_depth

CAMERA = voodoo.Camera(160, 120, 120.0, 120.0, 79.5, 59.5)
WORLD_FROM_SENSOR = np.array([[0.0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1], [0, 0, 0, 1]])
STANDING = {
    "humanoid_root": (2.4, 0.0, 0.95), "vc7": (2.4, 0.0, 1.48), "l_shoulder": (2.4, -0.18, 1.42),
    "r_shoulder": (2.4, 0.18, 1.42), "l_hip": (2.4, -0.1, 0.92), "r_hip": (2.4, 0.1, 0.92),
}  # fmt: skip


def frame(stamp, *people):
    """What the camera sees of posed bodies before a wall."""
    depth = np.full((120, 160), 4.5)
    for body, estimate in people:
        observed = render_depth(
            body, estimate.world_from_limb, camera=CAMERA, world_from_sensor=WORLD_FROM_SENSOR
        ).depth
        depth = np.where(observed > 0.0, np.minimum(observed, depth), depth)
    displayed = voodoo.Frame(stamp)
    displayed.add_depth(
        depth.astype(np.float32), camera=CAMERA, meters_per_unit=1.0, world_from_sensor=WORLD_FROM_SENSOR
    )
    return displayed


@pytest.fixture(scope="module")
def someone():
    tracker = voodoo.Tracker(voodoo.Body.human(1.75))
    return tracker.body, tracker.reset(joints=STANDING, fit_sizes=False)


def test_a_person_enters_and_leaves(someone):
    people = voodoo.People()
    assert len(people.estimate) == 0 and np.isnan(people.estimate.stamp)
    for index in range(6):
        found = people.step(frame(index / 15.0, someone))
    (person,) = found
    # Of drawn bodies a detector tells sizes that are not quite theirs: a limb may be called lost.
    assert person.id == 1 and person.status in ("tracking", "degraded") and found is people.estimate
    assert np.linalg.norm(person.estimate.joints["humanoid_root"] - STANDING["humanoid_root"]) < 0.15
    assert people.body(1).limb_names == voodoo.Body.human().limb_names
    for index in range(6, 14):
        found = people.step(frame(index / 15.0))
    assert len(found) == 0
    with pytest.raises(BodyError, match=r"those who are there \(nobody\), found 1"):
        people.body(1)


def test_who_enters_while_somebody_is_hidden_gets_an_id_of_their_own():
    """The first of four is hidden when the last one, in other clothes, enters 1 m aside."""
    recording = four(3, seconds=3.4)
    *_, last = islice(track(recording, voodoo.People()), 50)
    truth = recording.people
    row = np.abs(truth.stamps - last.estimate.stamp).argmin()
    assert (truth.in_view[row] > 0.4).all()
    roots = {person.id: person.estimate.joints["humanoid_root"] for person in last.estimate}
    away = {number: np.linalg.norm(truth.of("humanoid_root")[row] - root, axis=1) for number, root in roots.items()}
    assert {number: int(each.argmin()) for number, each in away.items()} == {1: 0, 2: 1, 3: 2, 4: 3}
    assert max(each.min() for each in away.values()) < 0.2


def test_who_is_hidden_does_not_move_to_who_enters():
    """The first of four is 9 % in view in the frame in which the last one comes in 1.7 m aside."""
    recording = four(155, seconds=2.8)
    *_, last = islice(track(recording, voodoo.People()), 41)
    truth = recording.people
    row = np.abs(truth.stamps - last.estimate.stamp).argmin()
    assert 0.05 < truth.in_view[row, 0] < 0.1 and truth.in_view[row, 3] >= 0.5
    first = next(person for person in last.estimate if person.id == 1)
    away = first.estimate.joints["humanoid_root"] - truth.of("humanoid_root")[row, 0]
    assert np.linalg.norm(away) < 0.3


def test_who_comes_back_from_behind_others_is_not_found_twice():
    """The track of the first of four was 0.3 m off while others hid them."""
    recording = four(50, seconds=5.0)
    *_, last = islice(track(recording, voodoo.People()), 75)
    assert [person.id for person in last.estimate] == [1, 2, 3, 4]
    first = next(iter(last.estimate)).estimate.joints["humanoid_root"]
    assert np.linalg.norm(first - recording.people.of("humanoid_root")[-1, 0]) < 0.1


def test_what_is_measured_of_one_person_is_theirs(someone):
    people = voodoo.People()
    assert people.add(STANDING, fit_sizes=False) == 1
    people.step(frame(0.0, someone))
    wrist = people.estimate.persons[0].estimate.joints["l_wrist"]
    own = voodoo.Frame(0.1)
    own.add_position("l_wrist", wrist + [-0.3, 0.0, 0.3], weight=500.0, source="glove")
    (person,) = people.step(frame(0.1, someone), own={1: own})
    assert person.estimate.sources["glove"][:2] == (1, 1)
    assert np.linalg.norm(person.estimate.joints["l_wrist"] - wrist) > 0.1
    late = voodoo.Frame(0.3)
    with pytest.raises(MeasurementError, match=r"own: expected frames with the stamp 0.2 s, found 0.3 s"):
        people.step(frame(0.2, someone), own={1: late})
    people.only(7)
    assert len(people.step(frame(0.2, someone))) == 0


def shifted(joints, *by):
    return {name: tuple(np.add(place, by)) for name, place in joints.items()}


def test_of_two_near_each_other_the_one_that_explains_more_stays(someone):
    people = voodoo.People()
    # The one who came first is 20 cm beside the one who is seen.
    assert [people.add(shifted(STANDING, 0.0, 0.2, 0.0), fit_sizes=False), people.add(STANDING, fit_sizes=False)] == [
        1,
        2,
    ]
    assert [person.id for person in people.step(frame(0.0, someone))] == [2]


def test_who_is_followed_beside_where_they_are_is_taken_up_and_not_found_twice(someone):
    people = voodoo.People()
    people.add(shifted(STANDING, 0.3, 0.2, -0.3), fit_sizes=False)
    for index in range(8):
        found = people.step(frame(index / 15.0, someone))
        assert [person.id for person in found] == [1]
    assert np.linalg.norm(found.persons[0].estimate.joints["humanoid_root"] - STANDING["humanoid_root"]) < 0.15


def test_free_points_belong_to_whose_surface_explains_them(someone):
    body, estimate = someone
    beside = shifted(STANDING, 0.0, 0.62, 0.0)
    people = voodoo.People()
    assert [people.add(joints, fit_sizes=False) for joints in (STANDING, beside)] == [1, 2]
    displayed = voodoo.Tracker(body)
    poses = (estimate.world_from_limb, displayed.reset(joints=beside, fit_sizes=False).world_from_limb)
    clouds = [render_depth(body, pose, camera=CAMERA, world_from_sensor=WORLD_FROM_SENSOR).depth for pose in poses]
    own = [(depth > 0.0) & ((other <= 0.0) | (depth < other)) for depth, other in (clouds, clouds[::-1])]
    points = [_points(np.where(mask, depth, 0.0)) for mask, depth in zip(own, clouds, strict=True)]
    observed = voodoo.Frame(0.0)
    observed.add_points(np.concatenate(points), world_from_sensor=WORLD_FROM_SENSOR, source="lidar")
    given = [person.estimate.sources["lidar"][0] for person in people.step(observed)]
    # Each of the two has the points of the other's near arm within its own box.
    assert given == [pytest.approx(len(each), rel=0.02) for each in points]


def _points(depth):
    rows, columns = np.nonzero(depth > 0.0)
    z = depth[rows, columns]
    return np.stack([(columns - CAMERA.cx) / CAMERA.fx * z, (rows - CAMERA.cy) / CAMERA.fy * z, z], axis=1)


def test_what_cannot_be_meant_is_refused(someone):
    for wrong in ({"limit": 0}, {"forget_after": float("nan")}, {"region": ((0, 0, 0), (1, 1))}, {"config": "fast"}):
        with pytest.raises(ConfigError, match=next(iter(wrong))):
            voodoo.People(**wrong)
    with pytest.raises(BodyError, match="body"):
        voodoo.People("human")
    people = voodoo.People()
    people.step(frame(1.0, someone))
    with pytest.raises(MeasurementError, match="stamp"):
        people.step(frame(0.5, someone))
    with pytest.raises(MeasurementError, match=r"image: expected an array of shape \(120, 160, 3\) or \(120, 160\)"):
        voodoo.Frame(0.0).add_color(np.zeros((120, 160), dtype=np.uint16), camera=CAMERA)


def test_two_persons_in_four_pictures_without_names(voodoo_data):
    folder = data_folder(voodoo_data, "pose2sim-two")
    recording, people = open_recording(folder), voodoo.People()
    files = [next(folder.glob(f"*_P{number}_0-100.trc")) for number in (1, 2)]
    read = [read_trc(file).of(SITES) for file in files]
    known = [(names, positions @ Z_UP_FROM_Y_UP.T) for names, positions in read]
    front_end = FrontEnd(people, settings=FrontEndSettings.of(recording))
    errors = []
    for index, recorded in enumerate(islice(paired(recording), 40)):
        found = front_end.step(recorded)
        assert [person.id for person in found] == [1, 2], index
        errors.append(
            [
                min(
                    np.nanmean([np.linalg.norm(person.estimate.joints[name] - places[index, row])])
                    for person in found
                    for row in [names.index(name)]
                )
                for names, places in known
                for name in names
                if name[2:] in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle")
            ]
        )
    assert np.nanmean(errors) < 0.05


def test_persons_who_touch_are_one_segment_and_several_bodies(voodoo_data):
    recording = open_recording(data_folder(voodoo_data, "real", "pcl_five"))
    steps = [step.estimate for step in track(recording, voodoo.People())]
    assert len(steps[17]) == 5  # 0.57 s
    roots = np.array([person.estimate.joints["humanoid_root"] for person in steps[-1]])
    apart = np.linalg.norm(roots[:, None] - roots, axis=2) + 9.0 * np.eye(len(roots))
    assert len(roots) == 5 and apart.min() > 0.4
    shoulders = [
        np.linalg.norm(person.estimate.joints["l_shoulder"] - person.estimate.joints["r_shoulder"])
        for person in steps[-1]
    ]
    assert max(shoulders) < 0.5, "no body spans two persons"


def test_two_who_cross_keep_their_numbers(voodoo_data):
    folder = data_folder(voodoo_data, "people", "pp_p2_two_cross_twice_cmu")
    with (folder / "truth_people.csv").open(newline="") as file:
        rows = [row for row in csv.DictReader(file) if float(row["in_view"]) > 0.3]
    recording, people = open_recording(folder / "bag"), voodoo.People()
    front_end, numbers = FrontEnd(people, settings=FrontEndSettings.of(recording)), {}
    for recorded in islice(paired(recording), 72):
        for person in front_end.step(recorded):
            root = person.estimate.joints["humanoid_root"]
            for row in rows:
                place = [float(row[f"humanoid_root_{axis}"]) for axis in "xyz"]
                if abs(float(row["stamp_s"]) - recorded.stamp) < 1e-4 and np.linalg.norm(root - place) < 0.5:
                    numbers.setdefault(person.id, set()).add(row["person"])
    assert sorted(numbers) == [1, 2] and sorted(map(len, numbers.values())) == [1, 1], numbers
