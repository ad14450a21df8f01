"""Detections that come with a frame: who is measured, who comes back, who is new."""

from types import MappingProxyType
from typing import NamedTuple

import numpy as np
import pytest

import voodoo
from scene import standing_joints
from voodoo.errors import BodyError, MeasurementError
from voodoo.live.assembly import LiveFrame
from voodoo.live.follow import Follower
from voodoo.measurements import MarkerSet, RecordedFrame
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.start import stature
from voodoo.sensors.adapters import Adapter, register, unregister
from voodoo.sensors.model import SensorModel
from voodoo.sensors.rays import SiteRay, add_rays
from voodoo.sensors.settings import FrontEndSettings

BODY = voodoo.Body.human(1.75)


def person(x=2.5, y=0.0):
    return {name: place + (x, y, 0.0) for name, place in standing_joints(BODY).items()}


def frame(stamp, *persons, **how):
    made = voodoo.Frame(stamp)
    for joints in persons:
        made.add_detection(joints, **{"weight": 8.0, **how})
    return made


def root(estimate):
    return estimate.joints["humanoid_root"]


def test_a_detection_starts_a_tracker_and_then_measures_the_person():
    tracker = voodoo.Tracker(BODY, detector=None)
    with pytest.raises(MeasurementError, match="pose"):
        tracker.step(frame(0.0))
    for index in range(20):
        there = person(2.5, 0.02 * index)
        estimate = tracker.step(frame(index / 30.0, there))
        assert estimate.status == "tracking"
        assert np.linalg.norm(root(estimate) - there["humanoid_root"]) < 0.03, index
    assert estimate.sources["detections"][0] == len(there)


def test_everybody_gets_a_number_and_keeps_it():
    people, before = voodoo.People(detector=None), None
    for index in range(30):
        # They pass each other, 1.2 m apart, and the order of the detections changes.
        here, there = person(2.0, 1.5 - 0.1 * index), person(3.2, 0.1 * index - 1.5)
        found = people.step(frame(index / 30.0, *((here, there) if index % 2 else (there, here))))
        assert [one.id for one in found] == [1, 2], index
        places = np.array([root(one.estimate) for one in found])
        assert before is None or np.linalg.norm(places - before, axis=1).max() < 0.2
        before = places
    again = people.step(frame(1.0, here))
    assert [one.id for one in again] == [1, 2] and [one.status for one in again].count("lost") == 1


def test_who_was_away_gets_the_same_number_and_their_sizes():
    people, child = voodoo.People(detector=None), {name: 0.7 * place for name, place in person().items()}
    for index in range(60):
        people.step(frame(index / 30.0, child))
    size = stature(people.body(1))
    for index in range(60, 150):
        found = people.step(voodoo.Frame(index / 30.0))
    assert len(found) == 0
    (back,) = people.step(frame(5.0, {name: place + (0.2, 0.0, 0.0) for name, place in child.items()}))
    assert back.id == 1 and back.status == "tracking"
    assert stature(people.body(1)) == pytest.approx(size, rel=0.01) and size < 1.4


def test_a_doubtful_detection_needs_others():
    people = voodoo.People(detector=None)
    count, words = [], []
    for index in range(4):
        count.append(len(people.step(frame(index / 30.0, person(), log_odds=2.5))))
        words.append(people.refusal)
    assert count == [0, 0, 1, 1]
    assert "of 0.818, expected 0.982" in words[0] and "of 0.953" in words[1] and words[2:] == [None, None]
    others = voodoo.People(detector=None)
    assert not any(len(others.step(frame(index / 30.0, person(), log_odds=0.5))) for index in range(9))


def test_limit_and_region_hold_for_detections():
    box = ((0.0, -1.0, -2.0), (5.0, 1.0, 4.0))
    inside = voodoo.People(detector=None, region=box)
    assert [root(one.estimate)[1] for one in inside.step(frame(0.0, person(), person(2.5, 2.0)))] == [
        pytest.approx(0.0)
    ]
    assert len(voodoo.People(detector=None, limit=1).step(frame(0.0, person(), person(2.5, 2.0)))) == 1


def test_what_determines_no_pose_starts_nobody_and_what_is_wrong_is_refused():
    people, tracker = voodoo.People(detector=None), voodoo.Tracker(BODY, detector=None)
    few = {name: person()[name] for name in ("l_wrist", "r_wrist")}
    assert not len(people.step(frame(0.0, few, {})))
    assert tracker.step(frame(0.0, few)).status == "searching"
    people.step(frame(0.1, person()))
    for joints, error, words in (
        ({"l_nose": (0, 0, 0)}, BodyError, "l_nose"),
        ({"l_hip": (0, 0)}, MeasurementError, "l_hip"),
        ({"l_hip": (np.nan, 0, 0)}, MeasurementError, r"detections\[0\]"),
    ):
        with pytest.raises(error, match=words):
            people.step(frame(0.2, joints))
    for how, words in (
        ({"weight": -1.0}, "weight"),
        ({"log_odds": np.nan}, "log odds"),
        ({"log_odds": "sure"}, "log_odds"),
    ):
        with pytest.raises(MeasurementError, match=words):
            people.step(frame(0.2, person(), **how))
    assert [one.id for one in people.step(frame(0.2, person()))] == [1]


def test_an_empty_detection_is_nobodys_and_a_site_of_an_added_limb_is_of_the_one_who_is_followed():
    people = voodoo.People(detector=None)
    for index in range(5):
        found = people.step(frame(index / 30.0, {}, person(), {}))
        assert [one.id for one in found] == [1]
    tracker = voodoo.Tracker(BODY, detector=None)
    tracker.step(frame(0.0, person()))
    box = voodoo.TaperedEllipticCylinder(0.3, 0.1, 0.1, 0.1, 0.1)
    joint = voodoo.Joint(name="grip", on_parent=voodoo.Place(position=(0.0, 0.0, 0.1)))
    tracker.add_limb("box", parent="r_hand", shape=box, joint=joint, sites={"box_end": (0.0, 0.0, 0.3)})
    for index, x in enumerate((2.5, 2.52, 6.0, 6.0, 2.54), start=1):
        end = {"box_end": np.add(tracker.estimate.joints["box_end"], (0.01, 0.0, 0.0))}
        estimate = tracker.step(frame(index / 30.0, person(x) | end))
        assert np.linalg.norm(root(estimate) - person()["humanoid_root"]) < 0.2, index


class Tag(NamedTuple):
    """A position (3,) [m] of a site, from somebody's tag."""

    sensor: str
    stamp: float
    site: str
    position: np.ndarray


class TagAdapter(Adapter):
    kind = "tag"
    measurement = Tag

    def add(self, frame, item, context):
        if item.site in context.predicted:
            frame.add_position(item.site, item.position, source=item.sensor)


def test_suits_are_persons_and_a_tag_is_that_of_the_nearest():
    register(TagAdapter())
    try:
        front_end = FrontEnd(voodoo.People(detector=None), settings=FrontEndSettings(use=("markers", "tag")))
        for index in range(10):
            stamp, (near, far) = index / 30.0, (person(2.0, 0.6), person(3.0, -0.6))
            suits = [MarkerSet("a", stamp, near), MarkerSet("b", stamp, far)][:: -1 if index % 2 else 1]
            tag = Tag("tag", stamp, "l_wrist", far["l_wrist"])
            stray = Tag("stray", stamp, "l_wrist", far["l_wrist"] + (0.0, 0.0, 2.0))
            found = front_end.step(RecordedFrame(stamp, (*suits, tag, stray)))
        assert [one.id for one in found] == [1, 2]
        sources = [set(one.estimate.sources) for one in found]
        assert sources == [{"a"}, {"b", "tag"}]
    finally:
        unregister("tag")


def test_a_clock_that_is_set_back_keeps_pose_and_sizes_but_not_for_the_next_person():
    tracker = voodoo.Tracker(BODY)
    follower = Follower(tracker, settings=FrontEndSettings(use=("markers",)))
    child = {name: 0.7 * place for name, place in person().items()}

    def step(index, stamp, *, breaks=False):
        suit = MarkerSet("suit", stamp, child)
        live = follower.step(LiveFrame(stamp, (suit,), index, index / 30.0, index / 30.0, breaks))
        return live.estimates[1].status, live.bodies[1]

    for index in range(10):
        _, before = step(index, 10.0 + index / 30.0)
    status, body = step(10, 0.0, breaks=True)
    assert status == "tracking" and stature(body) == pytest.approx(stature(before), rel=0.01)
    follower.restart(back=False, gone=True)
    assert tracker.body == BODY and not tracker.estimate.joints


def test_any_mapping_is_a_detection_and_a_refused_one_leaves_nothing():
    made = voodoo.Frame(0.0)
    with pytest.raises(MeasurementError, match="joints"):
        made.add_detection({"l_wrist": "left"}, source="network")
    assert "network" not in repr(made)
    with pytest.raises(MeasurementError, match="joints: expected a mapping"):
        made.add_detection(3)
    made.add_detection(MappingProxyType(person()))
    assert voodoo.Tracker(BODY, detector=None).step(made).status == "tracking"


def test_rays_of_which_one_is_refused_leave_nothing():
    made = voodoo.Frame(0.0)
    rays = [SiteRay("l_wrist", np.zeros(3), np.array([1.0, 0.0, 0.0]), sigma, "camera") for sigma in (0.1, 0.0)]
    before = repr(made)
    with pytest.raises(MeasurementError, match="sigma"):
        add_rays(made, rays, model=SensorModel())
    assert repr(made) == before
