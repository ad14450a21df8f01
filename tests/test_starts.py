"""First poses from whatever is measured: markers, keypoints of several cameras, keypoints with depth, walking legs."""

import shutil
from dataclasses import replace
from pathlib import Path
from typing import get_args

import numpy as np
import pytest

import voodoo
from scene import standing_joints, turn
from voodoo.errors import BodyError, MeasurementError, VoodooError
from voodoo.measurements import DepthImage, KeypointImage, LaserScan, MarkerSet, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.names import HumanModel
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.run import first_pose
from voodoo.pipeline.start import Init, pose_as_init, start_tracker, starts_of, stature
from voodoo.pipeline.starts import StartFrame, Starts
from voodoo.pipeline.starts.cameras import CamerasStart
from voodoo.pipeline.starts.given import GivenStart
from voodoo.pipeline.starts.keypoints_depth import KeypointsDepthStart
from voodoo.pipeline.starts.legs import LegsStart, legs_body
from voodoo.pipeline.starts.markers import MarkersStart
from voodoo.recordings import open_recording, sample_path
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.rays import TRUSTED, SiteRay, place_of
from voodoo.sensors.settings import FrontEndSettings

BODY = voodoo.Body.human(1.75)
CAMERA = Camera(640, 480, 525.0, 525.0, 319.5, 239.5)


def person(at=(2.5, 0.0), facing=np.pi):
    """Sites of the default human, standing on the floor at a place [m], bent arms; facing the origin by default."""
    sites = standing_joints(BODY)
    floor = min(place[2] for place in sites.values()) - 0.03
    bent = {"l_wrist": (0.24, 0.2, 0.0), "r_wrist": (0.24, -0.2, 0.0)}
    for name, shift in bent.items():
        sites[name] = sites[name.replace("wrist", "elbow")] + np.array(shift) * (1.0, 0.2, 1.0)
        sites[name.replace("wrist", "hand")] = sites[name] + (0.08, 0.0, 0.0)
    way = turn((0.0, 0.0, 1.0), facing)
    return {name: way @ (place - (0.0, 0.0, floor)) + (*at, 0.0) for name, place in sites.items()}


def facing_pose(origin, at):
    """Pose of a camera that looks from one place to another (3,), upright."""
    z = np.subtract(at, origin) / np.linalg.norm(np.subtract(at, origin))
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3] = np.column_stack([x, np.cross(z, x), z, origin])
    return pose


def keypoints(joints, pose, *, noise=0.0, seed=0, without=()):
    """BODY_25B keypoints (25, 3) of sites."""
    rng = np.random.default_rng(seed)
    rows = np.zeros((25, 3))
    for part in layout_of("body25b").parts:
        if part.site in joints and part.site not in without and len(part.weights) == 1:
            pixel = CAMERA.project(in_sensor(pose, [joints[part.site]]))[0]
            rows[next(iter(part.weights))] = (*(pixel + rng.normal(0.0, noise, 2)), 0.9)
    return rows


def images(people, poses, stamp=0.0, **how):
    return tuple(
        KeypointImage(
            f"cam{number}",
            stamp,
            tuple(keypoints(each, pose, seed=number, **how) for each in people[:: -1 if number % 2 else 1]),
            "body25b",
            CAMERA,
            pose,
        )
        for number, pose in enumerate(poses)
    )


def observed(*measurements, body=BODY, stamp=0.0, **settings):
    return StartFrame(stamp, measurements, body, FrontEndSettings(**settings))


def worst(found, joints):
    return max(float(np.linalg.norm(place - joints[name])) for name, place in found.joints.items())


AROUND = [facing_pose(origin, (2.5, 0.0, 1.0)) for origin in ((0.0, 0.0, 1.4), (2.0, -3.0, 1.2), (2.5, 3.0, 1.8))]


def test_rays_meet_where_most_of_them_agree():
    place = np.array([2.0, 0.3, 1.1])
    origins = [pose[:3, 3] for pose in AROUND]
    towards = [place - origin for origin in origins]
    towards[2] = towards[2] + (0.0, 0.6, 0.0)
    rays = [SiteRay("l_wrist", o, w / np.linalg.norm(w), 0.02, "") for o, w in zip(origins, towards, strict=True)]
    met = place_of(rays)
    assert np.linalg.norm(met.position - place) < 0.005 and (met.trust >= TRUSTED).tolist() == [True, True, False]
    assert 0.01 < met.sigma < 0.05
    assert place_of(rays[:1]) is None
    assert place_of([rays[0], rays[0].moved((0.0, 0.01, 0.0))]) is None  # parallel
    away = [SiteRay("l_wrist", ray.origin, -ray.direction, 0.02, "") for ray in rays[:2]]
    assert place_of(away) is None  # behind both cameras


@pytest.mark.parametrize("cameras", [2, 3])
def test_keypoints_of_several_cameras(cameras):
    joints = person()
    found, *_ = CamerasStart().find(observed(*images([joints], AROUND[:cameras], noise=2.0)))
    assert len(found.joints) >= 14
    assert worst(found, joints) < 0.06
    assert all(0.0 < found.sigma[name] < 0.1 for name in found.joints)


def test_one_of_two_people_and_not_a_mixture_of_both():
    first, second = person((2.5, 0.7)), person((2.7, -0.7), facing=np.pi - 0.6)
    found, *_ = CamerasStart().find(observed(*images([first, second], AROUND, noise=2.0)))
    assert min(worst(found, first), worst(found, second)) < 0.08


def test_cameras_that_have_gone_do_not_count_among_those_that_see_a_person():
    joints, finder = person(), CamerasStart()
    there = images([joints], AROUND[:2])
    gone = [replace(item, sensor=f"gone{number}", people=()) for number, item in enumerate(there)]
    assert finder.find(observed(*there, *gone))[0].log_odds == 0.0
    later = [replace(item, stamp=1.5) for item in there]
    assert finder.find(observed(*later, stamp=1.5))[0].log_odds == np.inf


def test_cameras_that_disagree_or_stand_together_find_nobody():
    joints = person()
    pair = images([joints], AROUND[:2])
    assert not CamerasStart().find(observed(pair[0]))
    beside = replace(pair[0], sensor="beside")
    assert not CamerasStart().find(observed(pair[0], beside))
    higher = {name: place + (0.0, 0.0, 0.5) for name, place in joints.items()}
    elsewhere = images([higher], AROUND[1:2])[0]
    assert not CamerasStart().find(observed(pair[0], replace(elsewhere, sensor="cam1")))
    late = replace(pair[1], stamp=1.0)
    assert not CamerasStart().find(observed(pair[0], late))
    trunkless = images([joints], AROUND[:2], without=("l_hip", "r_hip", "l_shoulder"))
    assert not CamerasStart().find(observed(*trunkless))


def rendered(joints, pose):
    """The body in a pose near some sites, as a depth camera sees it before a wall, and its true sites."""
    tracker = voodoo.Tracker(BODY)
    tracker.reset(joints=joints, fit_sizes=False)
    depth = voodoo.render_depth(
        tracker.body, tracker.estimate.world_from_limb, camera=CAMERA, world_from_sensor=pose
    ).depth
    depth[depth == 0.0] = 4.5
    return DepthImage("depth", 0.0, depth, 1.0, CAMERA, pose), dict(tracker.estimate.joints)


def test_keypoints_with_depth_of_the_same_and_of_another_camera():
    pose = AROUND[0]
    depth, truth = rendered(person(), pose)
    other = pose.copy()
    other[:3, 3] += pose[:3, 0] * 0.06
    for at in (pose, other):
        (item,) = images([truth], [at], noise=1.0)
        found, *_ = KeypointsDepthStart().find(observed(item, depth))
        assert len(found.joints) >= 12
        assert np.mean([np.linalg.norm(place - truth[name]) for name, place in found.joints.items()]) < 0.05
    (item,) = images([truth], [pose])
    assert not KeypointsDepthStart().find(observed(item))
    assert not KeypointsDepthStart().find(observed(item, replace(depth, stamp=0.5)))
    wall = replace(depth, image=np.full_like(depth.image, 4.5))  # at the wall the trunk is half as large again
    assert not KeypointsDepthStart().find(observed(item, wall))


def test_of_two_detections_of_a_person_the_more_precise_one_is_the_start():
    depth, truth = rendered(person(), AROUND[0])
    middle = np.mean(list(truth.values()), axis=0)
    names = [f"{side}_{joint}" for side in "lr" for joint in ("shoulder", "hip", "elbow", "knee", "ankle")]
    larger = {name: truth[name] + 0.2 * (truth[name] - middle) for name in names}
    lengths = []
    for weight in (1.0, 100.0):
        tracker, frame = voodoo.Tracker(BODY), voodoo.Frame(0.0)
        frame.add_depth(depth.image, camera=CAMERA, meters_per_unit=1.0, world_from_sensor=depth.root_from_sensor)
        frame.add_detection(larger, weight=weight)
        tracker.step(frame)
        lengths.append(sum(limb.shape.length for limb in tracker.body.limbs) / sum(b.shape.length for b in BODY.limbs))
    assert abs(lengths[0] - 1.0) < 0.08
    assert lengths[1] > 1.12


def test_a_hand_before_the_trunk_does_not_bend_the_start():
    """A wrist whose keypoint shows something far nearer makes a forearm that nobody has."""
    pose = AROUND[0]
    depth, truth = rendered(person(), pose)
    u, v = np.rint(CAMERA.project(in_sensor(pose, [truth["r_wrist"]]))[0]).astype(int)
    depth.image[v - 12 : v + 12, u - 12 : u + 12] = 1.0
    (item,) = images([truth], [pose])
    found, *_ = KeypointsDepthStart().find(observed(item, depth))
    assert "r_wrist" not in found.joints and "l_wrist" in found.joints


def test_markers_start_where_they_fix_the_pose():
    joints = person()
    names = ["l_shoulder", "r_shoulder", "l_hip", "l_wrist"]
    suit = MarkerSet("suit", 0.0, {name: joints[name] for name in names})
    found, *_ = MarkersStart().find(observed(suit))
    assert sorted(found.joints) == sorted(names) and found.sigma["l_hip"] == 0.02
    few = replace(suit, positions={name: joints[name] for name in ("l_wrist", "r_wrist", "head_center", "l_elbow")})
    assert not MarkersStart().find(observed(few))
    gap = replace(suit, positions={**suit.positions, "l_hip": np.full(3, np.nan)})
    assert not MarkersStart().find(observed(gap))


ANGLES = np.arange(-1.2, 1.2, 0.006)


def sweep(stamp, circles, pose):
    """A laser's ranges [m] to circles ((x, y), radius) of the root frame, before a wall at 5 m."""
    ranges = np.full(len(ANGLES), 5.0)
    for center, radius in circles:
        local = in_sensor(pose, [(*center, pose[2, 3])])[0]
        along = local[0] * np.cos(ANGLES) + local[1] * np.sin(ANGLES)
        off = np.linalg.norm(local[:2]) ** 2 - along**2
        hit = (off < radius**2) & (along > 0.0)
        ranges[hit] = np.minimum(ranges[hit], along[hit] - np.sqrt(radius**2 - off[hit]))
    return LaserScan("scan", stamp, ranges.astype(np.float32), -1.2, 0.006, 0.1, 10.0, pose)


def walk(speed=1.0, turned=0.0, count=40, radius=0.05, rate=10.0):
    """Scans of a chair and somebody who walks past it."""
    pose = np.eye(4)
    pose[2, 3] = 0.3
    chair = [((2.0, -0.9), 0.03), ((2.3, -0.9), 0.03), ((2.0, -1.2), 0.03), ((2.3, -1.2), 0.03)]
    for index in range(count):
        stamp = index / rate
        middle = np.array([2.4, -2.0 + speed * stamp])
        stride = 0.25 * np.sin(2.0 * np.pi * stamp) * (speed > 0.0)
        legs = [((middle[0] - s * 0.09, middle[1] + s * stride), radius) for s in (1.0, -1.0)]
        here = pose.copy()
        here[:3, :3] = turn((0.0, 0.0, 1.0), turned * stamp)
        yield sweep(stamp, chair + legs, here), middle


def test_legs_that_walk_are_found_and_furniture_is_not():
    finder, legs = LegsStart(), legs_body()
    found = [
        (finder.find(observed(scan, body=legs, stamp=scan.stamp, ground_z=0.0)), middle) for scan, middle in walk()
    ]
    hits = [(one.joints, middle) for each, middle in found for one in each]
    assert len(hits) >= 10
    for joints, middle in hits:
        assert np.linalg.norm((joints["l_hip"] + joints["r_hip"])[:2] / 2.0 - middle) < 0.12
        assert np.linalg.norm(joints["l_ankle"] - joints["l_hip"]) == pytest.approx(0.491 * 1.75)
    left = [float(joints["l_hip"][0] - joints["r_hip"][0]) for joints, _ in hits[-5:]]
    assert max(left) < 0.0  # who walks along y has the left side at smaller x
    still = LegsStart()
    assert not any(still.find(observed(scan, body=legs, stamp=scan.stamp)) for scan, _ in walk(speed=0.0))
    out = LegsStart()
    box = ((0.0, -5.0, 0.0), (5.0, 5.0, 1.0))
    assert not any(out.find(observed(scan, body=legs, stamp=scan.stamp, exclude=(box,))) for scan, _ in walk())
    assert not any(LegsStart().find(observed(scan, body=BODY, stamp=scan.stamp)) for scan, _ in walk())


def test_a_laser_that_turns_clockwise_finds_the_same_legs():
    """Of a child, whose shins are hardly wider than the least."""
    scans = [scan for scan, _ in walk(radius=0.025)]
    turned = [
        replace(scan, ranges=scan.ranges[::-1], angle_min=float(ANGLES[-1]), angle_increment=-0.006) for scan in scans
    ]
    finders, body = (LegsStart(), LegsStart()), legs_body(1.2)
    found = [
        [finder.find(observed(scan, body=body, stamp=scan.stamp)) for scan in each]
        for finder, each in zip(finders, (scans, turned), strict=True)
    ]
    assert sum(map(len, found[0])) >= 10
    assert [len(one) for one in found[0]] == [len(one) for one in found[1]]


def test_the_offset_of_two_lasers_is_no_motion():
    """Who walks along y faces it, though the second laser measures everything 0.1 m nearer."""
    finder, legs, left = LegsStart(), legs_body(), []
    for index, (scan, _) in enumerate(walk(count=80, rate=20.0)):
        pose = scan.root_from_sensor.copy()
        pose[0, 3] -= 0.1 * (index % 2)
        item = replace(scan, sensor=f"scan{index % 2}", root_from_sensor=pose)
        for one in finder.find(observed(item, body=legs, stamp=scan.stamp)):
            left.append(one.joints["l_hip"] - one.joints["r_hip"])
    assert len(left) >= 10
    assert all(across[0] < -2.0 * abs(across[1]) for across in left)


def test_the_sizes_of_a_start_from_legs_are_those_of_the_body():
    """A child stays one: the start also scales the body."""
    tracker = voodoo.Tracker(legs_body(1.2))
    front_end = FrontEnd(tracker)
    for scan, _ in walk():
        front_end.step(RecordedFrame(scan.stamp, (scan,)))
        if front_end.posed:
            break
    assert front_end.found.by == LegsStart.name
    lengths = [limb.shape.length for limb in tracker.body.limbs if limb.name != "pelvis"]
    assert lengths == pytest.approx([0.491 * 1.2] * 2, rel=0.02)


def frames(*measurements, count, rate=30.0):
    for index in range(count):
        moved = tuple(replace(item, stamp=index / rate) for item in measurements)
        yield RecordedFrame(index / rate, moved)


def test_a_front_end_auto_initializes_and_again_after_the_person_has_left():
    joints = person()
    tracker = voodoo.Tracker(BODY)
    front_end = FrontEnd(tracker)
    there = MarkerSet("suit", 0.0, joints)
    nothing = MarkerSet("suit", 0.0, {})
    status, stamp = [], 0.0
    for item, seconds in ((nothing, 0.5), (there, 1.0), (nothing, 3.0), (there, 0.5)):
        for _ in range(round(10 * seconds)):
            stamp += 0.1
            estimate = front_end.step(RecordedFrame(stamp, (replace(item, stamp=stamp),)))
            assert estimate.stamp == stamp and bool(estimate.joints) == (estimate.status != "searching")
            status.append(str(estimate.status))
    assert set(status[:5]) == {"searching"}
    assert "searching" not in status[5:15] and set(status[5:15]) != {"lost"}
    changes = [word for word, before in zip(status, ["", *status], strict=False) if word != before]
    assert changes.count("searching") == 2 and changes[-3:-1] == ["lost", "searching"]
    waited = status[15:-5]
    assert waited.count("searching") == pytest.approx(
        10, abs=3
    )  # of the last second, less what no marker tells at first
    assert "searching" not in status[-5:]
    error = [np.linalg.norm(estimate.joints[name] - place) for name, place in joints.items()]
    assert np.mean(error) < 0.03


def test_a_refused_frame_leaves_the_search_as_it_was():
    tracker = voodoo.Tracker(BODY)
    front_end = FrontEnd(tracker)
    suit = MarkerSet("suit", 0.0, person())
    with pytest.raises(MeasurementError):
        front_end.step(RecordedFrame(0.0, (replace(suit, sigma=-1.0),)))
    assert not front_end.posed and front_end.found is None and not tracker.estimate.joints
    good = front_end.step(RecordedFrame(0.0, (suit,)))
    assert good.status != "searching" and front_end.found.by == "markers"


def test_a_given_start_that_cannot_be_meant_is_an_error():
    for joints, error in (({"l_nose": (0, 0, 0)}, BodyError), ({"l_hip": (0, 0, 0)}, MeasurementError)):
        starts = Starts((GivenStart(joints, 0.0),), by_tracker=False)
        with pytest.raises(error):
            FrontEnd(voodoo.Tracker(BODY), starts=starts).step(RecordedFrame(0.0, ()))


def test_the_found_pose_is_a_start(tmp_path):
    recording = open_recording(sample_path())
    reference = recording.reference
    rows = {name: reference.positions[3, index] for index, name in enumerate(reference.names)}
    init = Init(stamp_s=float(reference.stamps[3]), joints={name: tuple(place) for name, place in rows.items()})
    tracker = start_tracker(recording, init=init)
    assert not tracker.estimate.joints
    estimate = first_pose(recording, tracker, starts=starts_of(init, recording))
    assert estimate.stamp == pytest.approx(reference.stamps[3])
    written = pose_as_init(estimate, tracker.body)
    (tmp_path / "start.json").write_text(written.to_json())
    assert Init.load(tmp_path / "start.json") == written
    assert written.height_m == pytest.approx(recording.start["height_m"], abs=0.08)
    assert np.linalg.norm(np.subtract(written.joints["l_knee"], rows["l_knee"])) < 0.06
    for model in get_args(HumanModel):
        assert stature(voodoo.Body.human(1.6, model=model)) == 1.6
    assert stature(legs_body()) is None


def test_what_nothing_can_find_is_reported_at_once(tmp_path):
    recording = open_recording(sample_path(), bare=True)
    lamp = voodoo.Body.load(Path(__file__).parent.parent / "examples" / "bodies" / "lamp.toml")
    with pytest.raises(VoodooError, match=r"by depth, scan alone the body 'lamp' is not found.*--init FILE"):
        start_tracker(recording, body=lamp)
    with pytest.raises(VoodooError, match="by scan alone"):
        start_tracker(recording, use=("scan",), model="full")
    assert start_tracker(recording, use=("scan",)).body.name == "standing legs"
    assert start_tracker(recording, use=("scan", "depth")).body.name == "human"


def test_nothing_beside_a_recording_is_read_where_a_start_is_searched_for(tmp_path):
    folder = tmp_path / "rec"
    shutil.copytree(sample_path(), folder)
    whole = open_recording(folder)
    assert whole.start is not None and whole.reference is not None
    for name in ("truth.csv", "init.json"):
        (folder / name).write_text("damaged")
    bare = open_recording(folder, bare=True)
    assert bare.start is None and bare.reference is None
    assert (bare.name, bare.root_frame, len(bare)) == (whole.name, whole.root_frame, len(whole))
