"""Sensors that drop out, freeze, come late or stand where they do not: the others carry on, and the report shows it."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

import voodoo
from voodoo.errors import MeasurementError
from voodoo.evaluation.metrics import JOINTS
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.pipeline.run import track
from voodoo.pipeline.start import start_tracker
from voodoo.recordings import (
    ColorImage,
    DepthImage,
    KeypointImage,
    LaserScan,
    PointCloud,
    RecordedFrame,
    open_recording,
    sample_path,
)
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.adapters.depth import DepthAdapter
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.gating import SiteGate
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings
from voodoo.sensors.skin.settings import SkinSettings

FRAMES = 40
MOVED = np.eye(4)
MOVED[1, 3] = 0.5


def run(change=lambda index, items: items, use=("depth", "scan", "skin")):
    """Mean error of the twelve joints [m], and the estimates, with changed measurements."""
    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=use, ground_z=0.0))
    reference = recording.reference
    columns = [reference.names.index(name) for name in JOINTS]
    errors, estimates = [], []
    for index, (recorded, _) in enumerate(zip(paired(recording), range(FRAMES), strict=False)):
        items = tuple(change(index, list(recorded.measurements)))
        estimate = front_end.step(RecordedFrame(recorded.stamp, items))
        found = np.array([estimate.joints[name] for name in JOINTS])
        errors.append(np.linalg.norm(found - reference.positions[index, columns], axis=1).mean())
        estimates.append(estimate)
    assert np.isfinite(errors).all()
    return float(np.mean(errors)), estimates


@pytest.fixture(scope="module")
def whole():
    return run()


def of(estimate, part):
    """(given, matched, residual) of the source whose name holds `part`, None when it gave nothing."""
    return next((row for name, row in estimate.sources.items() if part in name), None)


def test_all_sensors_contribute(whole):
    error, estimates = whole
    assert error < 0.10
    for part in ("depth", "scan", "color"):
        assert any(of(estimate, part) is not None and of(estimate, part)[1] > 0 for estimate in estimates), part


def test_random_dropouts(whole):
    chance = np.random.default_rng(7)
    error, estimates = run(lambda index, items: [item for item in items if chance.random() > 0.3])
    assert error < whole[0] + 0.03
    assert any(of(estimate, "depth") is None for estimate in estimates)


def test_a_sensor_that_stops_and_comes_back(whole):
    error, estimates = run(
        lambda index, items: [i for i in items if not (isinstance(i, DepthImage) and 20 <= index < 26)]
    )
    assert all(of(estimate, "depth") is None for estimate in estimates[20:26])
    # What was scene before is scene again, and the person is not.
    assert of(estimates[-1], "depth")[0] > 0.98 * of(whole[1][-1], "depth")[0]
    assert error < whole[0] + 0.05


def test_a_frozen_laser(whole):
    first = []

    def freeze(index, items):
        first.extend(item for item in items if isinstance(item, LaserScan) and not first)
        return [replace(first[0], stamp=i.stamp) if isinstance(i, LaserScan) else i for i in items]

    error, estimates = run(freeze)
    assert sum(of(estimate, "scan") is not None for estimate in estimates) == 1
    assert error < whole[0] + 0.03


def test_a_picture_that_is_100_ms_late(whole):
    held = []

    def late(index, items):
        held.extend(item for item in items if isinstance(item, ColorImage))
        rest = [item for item in items if not isinstance(item, ColorImage)]
        return rest + ([held.pop(0)] if len(held) > 3 else [])

    error, _ = run(late)
    assert error < whole[0] + 0.03


def test_a_laser_with_wrong_extrinsics(whole):
    turn = np.eye(4)
    turn[:2, :2] = [[0.94, -0.342], [0.342, 0.94]]  # 20 degrees: a meter off at the person
    turn[:3, :3] /= np.cbrt(np.linalg.det(turn[:3, :3]))
    u, _, v = np.linalg.svd(turn[:3, :3])
    turn[:3, :3] = u @ v

    def wrong(index, items):
        return [
            replace(i, root_from_sensor=i.root_from_sensor @ turn) if isinstance(i, LaserScan) else i for i in items
        ]

    error, estimates = run(wrong)
    assert error < whole[0] + 0.03
    # the report shows that its points are not on the body
    right = np.mean([of(e, "scan")[1] for e in whole[1] if of(e, "scan")])
    off = np.mean([of(e, "scan")[1] for e in estimates if of(e, "scan")])
    assert off < 0.5 * right


def test_a_color_camera_with_wrong_extrinsics(whole):
    shift = np.eye(4)
    shift[0, 3] = 0.25  # 25 cm to the side

    def wrong(index, items):
        return [
            replace(i, root_from_sensor=i.root_from_sensor @ shift) if isinstance(i, ColorImage) else i for i in items
        ]

    error, estimates = run(wrong)
    assert error < whole[0] + 0.03
    rays = sum(of(estimate, "color")[0] for estimate in estimates if of(estimate, "color"))
    full = sum(of(estimate, "color")[0] for estimate in whole[1] if of(estimate, "color"))
    assert rays < 0.7 * full


def second_camera(change):
    """The depth camera twice, the second time changed: (frame number, depth image) -> depth image or None."""

    def both(index, items):
        depth = next(item for item in items if isinstance(item, DepthImage))
        extra = change(index, replace(depth, sensor="second"))
        return items + ([] if extra is None else [extra])

    return both


def test_of_two_depth_cameras_one_is_frozen(whole):
    held = []

    def freeze(index, depth):
        held.append(depth)
        return replace(held[0], stamp=depth.stamp)

    error, estimates = run(second_camera(freeze), use=("depth", "skin"))
    assert error < whole[0] + 0.03
    assert of(estimates[0], "second") is not None
    assert all(of(estimate, "second") is None for estimate in estimates[1:])


def test_of_two_depth_cameras_one_comes_100_ms_late_and_at_random(whole):
    held, chance = [], np.random.default_rng(3)

    def late(index, depth):
        held.append(depth)
        return replace(held[max(index - 3, 0)], stamp=depth.stamp) if chance.random() > 0.3 else None

    error, estimates = run(second_camera(late), use=("depth", "skin"))
    assert error < whole[0] + 0.03
    assert 0 < sum(of(estimate, "second") is None for estimate in estimates) < FRAMES


def test_of_two_depth_cameras_one_stands_elsewhere(whole):
    away = np.eye(4)
    away[0, 3] = 1.0  # a meter to the side

    error, estimates = run(
        second_camera(lambda index, depth: replace(depth, root_from_sensor=depth.root_from_sensor @ away)),
        use=("depth", "skin"),
    )
    assert error < whole[0] + 0.03
    good = np.mean([of(estimate, "depth")[1] for estimate in estimates])
    bad = np.mean([of(estimate, "second")[1] for estimate in estimates])
    assert bad < 0.5 * good


def test_time_that_runs_backwards_is_refused_and_the_next_frame_accepted():
    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker)
    first, second, third = (recorded for recorded, _ in zip(paired(recording), range(3), strict=False))
    front_end.step(first)
    before = front_end.step(second)
    for again in (first, second):
        with pytest.raises(MeasurementError, match=r"stamp|time"):
            front_end.step(again)
        assert np.array_equal(tracker.estimate.joint_positions, before.joint_positions)
    assert front_end.step(third).stamp == third.stamp


def with_keypoints(recorded, joints):
    """The frame with keypoints of these joints, as a network would find them in its color picture."""
    layout = layout_of("body25b")
    added = []
    for item in (item for item in recorded.measurements if isinstance(item, ColorImage)):
        person = np.zeros((layout.count, 3))
        for part in (part for part in layout.parts if len(part.weights) == 1):
            pixel = item.camera.project(in_sensor(item.root_from_sensor, [joints[part.site]]))[0]
            person[next(iter(part.weights))] = *pixel, 0.9
        place = {"camera": item.camera, "root_from_sensor": item.root_from_sensor}
        added.append(KeypointImage("network", item.stamp, people=(person,), layout="body25b", **place))
    return RecordedFrame(recorded.stamp, (*added, *recorded.measurements))


def aside(item):
    """The same, but of a camera half a meter aside, with everything farther away."""
    moved = replace(item, root_from_sensor=MOVED @ item.root_from_sensor)
    return replace(moved, meters_per_unit=1.5 * item.meters_per_unit) if isinstance(item, DepthImage) else moved


def test_a_refused_frame_leaves_no_trace_in_the_front_end():
    """What is given after it, or again without what was wrong, is as if it came for the first time."""
    recording = open_recording(sample_path())
    frames = [recorded for recorded, _ in zip(paired(recording), range(25), strict=False)]
    spoiled = PointCloud("cloud", frames[0].stamp, points=np.full((4, 3), np.nan), root_from_sensor=np.eye(4))
    ends = []
    for refused in (range(0), range(0, 25, 2)):
        tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
        tracker.reset(joints=recording.start["joints"], fit_sizes=True)
        front_end = FrontEnd(tracker, settings=FrontEndSettings(use=(*FrontEndSettings().use, "skin")))
        steps = []
        for index, plain in enumerate(frames):
            observed = with_keypoints(plain, tracker.estimate.joints)
            if index in refused:
                if index % 4:
                    kept = KeypointImage if index % 8 == 2 else ()  # some pass the gates, some do not
                    items = [item if isinstance(item, kept) else aside(item) for item in observed.measurements]
                else:  # the picture is that of the frame before, so its camera seems to be frozen
                    last = frames[max(index - 1, 0)].measurements
                    items = [item for item in last if isinstance(item, ColorImage)]
                    items += [item for item in observed.measurements if isinstance(item, DepthImage)]
                before = front_end.frozen, dict(front_end.reports), list(front_end.rays)
                with pytest.raises(MeasurementError, match="finite"):
                    front_end.step(RecordedFrame(plain.stamp, (*items, spoiled)))
                assert (front_end.frozen, front_end.reports, front_end.rays) == before
            estimate = front_end.step(observed if index % 2 else plain)
            skin = [(cue.candidates, cue.assigned) for cue in front_end.skin.values()]
            gate = copy(front_end._persons[1].gate)
            gates = {site: gate.limit(site, "network", estimate.stamp + 0.05) for site in ("l_wrist", "r_wrist")}
            steps.append(
                repr(
                    (
                        estimate.sources,
                        front_end.frozen,
                        front_end.reports,
                        gates,
                        skin,
                    )
                )
            )
        ends.append((steps, tracker.estimate.joint_positions.tolist()))
    for index, (was, now) in enumerate(zip(ends[0][0], ends[1][0], strict=True)):
        assert was == now, index
    assert ends[0][1] == ends[1][1]
    assert "'l_hand'" in ends[0][0][-1] and gates["l_wrist"] > SiteGate().limit("l_wrist", "", 0.0), (
        "the network was heard"
    )


def work(estimate):
    """What a step did: ICP steps, and data given and matched of each source."""
    return estimate.steps, {name: row[:2] for name, row in estimate.sources.items()}


def test_a_weight_changes_no_run_time_and_a_sensor_costs_its_own_data_only():
    recording = open_recording(sample_path())
    recorded = next(iter(paired(recording)))
    depth = next(item for item in recorded.measurements if isinstance(item, DepthImage))
    config = voodoo.Config(min_change=0.0, hypotheses=False)
    done = {}
    for weight, more in ((1.0, False), (40.0, False), (1.0, True)):
        tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]), config=config)
        tracker.reset(joints=recording.start["joints"], fit_sizes=True)
        frame = voodoo.Frame(stamp=0.0)
        place = {"camera": depth.camera, "world_from_sensor": depth.root_from_sensor}
        frame.add_depth(depth.image, meters_per_unit=depth.meters_per_unit, weight=weight, source="depth", **place)
        if more:
            frame.add_ray("l_hand", origin=(3.0, 0.0, 1.0), direction=(-1.0, 0.0, 0.0), source="rays")
        done[weight, more] = work(tracker.step(frame))
    steps, sources = done[1.0, False]
    assert steps == config.max_steps
    assert done[40.0, False][0] == steps and done[40.0, False][1]["depth"][0] == sources["depth"][0]
    assert done[1.0, True][0] == steps and done[1.0, True][1]["depth"][0] == sources["depth"][0]
    assert done[1.0, True][1]["rays"] == (1, 1)


def test_a_frozen_color_camera_is_left_out():
    held = {}

    def freeze(index, items):
        return [
            held.setdefault("item", item) if isinstance(item, ColorImage) and index > 10 else item for item in items
        ]

    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("depth", "skin"), ground_z=0.0))
    frozen, estimates = [], []
    for index, (recorded, _) in enumerate(zip(paired(recording), range(FRAMES), strict=False)):
        items = tuple(freeze(index, list(recorded.measurements)))
        estimates.append(front_end.step(RecordedFrame(recorded.stamp, items)))
        frozen.append(any("color" in name for name in front_end.frozen))
    assert sum(frozen) > 20
    given = [of(estimate, "color") is not None for estimate in estimates]
    assert not any(given[index] for index in range(FRAMES) if frozen[index]) and any(given)


def test_a_face_pulls_less_while_depth_shows_the_head():
    recording = open_recording(sample_path())
    tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
    tracker.reset(joints=recording.start["joints"], fit_sizes=True)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("depth", "skin"), ground_z=0.0))
    biases = set()
    for recorded, _ in zip(paired(recording), range(12), strict=False):
        displayed = tracker.estimate.limb_status["head"] == "measured"
        front_end.step(recorded)
        biases |= {(displayed, ray.bias) for ray in front_end.rays if ray.site == "head_center"}
        hands = {ray.bias for ray in front_end.rays if ray.site != "head_center"}
        assert hands <= {SkinSettings().sites["l_hand"]}
    expected = {True: SkinSettings().visible_bias["head_center"], False: SkinSettings().sites["head_center"]}
    assert (True, expected[True]) in biases and all(bias == expected[displayed] for displayed, bias in biases)


def test_what_is_out_of_a_cameras_range_is_not_used():
    recording = open_recording(sample_path())
    counts = {}
    for farthest in (7.5, 1.0):
        tracker = voodoo.Tracker(voodoo.Body.human(height=recording.start["height_m"]))
        tracker.reset(joints=recording.start["joints"], fit_sizes=True)
        settings = FrontEndSettings(use=("depth",), depth_filter=DepthFilter(farthest=farthest))
        estimate = FrontEnd(tracker, settings=settings).step(next(iter(paired(recording))))
        row = of(estimate, "depth")
        counts[farthest] = 0 if row is None else row[0]
    assert counts[7.5] > 500 and counts[1.0] == 0


def test_what_is_out_of_a_cameras_range_is_not_behind_a_keypoint(monkeypatch):
    seen = []
    monkeypatch.setattr(
        DepthAdapter, "add", lambda self, frame, item, context: seen.append((item, context.depth_images))
    )
    recorded = next(iter(open_recording(sample_path())))
    for farthest, returns in ((7.5, True), (1.0, False)):
        settings = FrontEndSettings(use=("depth", "keypoints"), depth_filter=DepthFilter(farthest=farthest))
        FrontEnd(voodoo.Tracker(voodoo.Body.human()), settings=settings).frame(recorded)
        item, others = seen.pop()
        assert [item] == others and bool(item.image.any()) is returns


def test_a_laser_alone_is_lost_although_it_matches():
    recording = open_recording(sample_path(), use=("scan",))
    estimates = [step.estimate for step in track(recording, start_tracker(recording))]
    assert {estimate.status for estimate in estimates} == {"lost"}
    assert {word for estimate in estimates for word in estimate.limb_status.values()} == {"inferred"}
    given, matched, _ = np.array([estimate.sources["/scan"] for estimate in estimates]).T
    assert matched.sum() > 0.5 * given.sum(), (matched.sum(), given.sum())


def test_a_color_camera_alone_begins():
    _, estimates = run(use=("skin",))
    assert sum(of(estimate, "color") is not None for estimate in estimates) > FRAMES / 4
