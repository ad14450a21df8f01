"""The rooms and the table of lab/experiments/false_bodies.py."""

import sys
from dataclasses import replace

import numpy as np
import pytest

import voodoo
from lab_scripts import load_experiment

AHEAD = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [1.0, 0.5, 0.0], [1.0, 0.0, 0.5]])


@pytest.fixture
def false_bodies():
    return load_experiment("false_bodies")


@pytest.mark.parametrize(("kind", "beside"), [("box", 2.7), ("cylinder", None), ("ellipsoid", None)])
def test_rays_meet_solids_where_they_are(false_bodies, kind, beside):
    """0.3 m half thick, 3 m ahead; what is turned by a quarter is as wide as it was thick."""
    solid = false_bodies.rooms.Solid(kind, np.array([3.0, 0.0, 1.0]), np.array([0.3, 0.2, 0.9]))
    eye = np.array([0.0, 0.0, 1.0])
    hits = solid.hit(eye, AHEAD)
    assert hits[0] == pytest.approx(2.7) and np.isinf(hits[1:3]).all()
    near = solid.hit(eye, np.array([[1.0, 0.05, 0.0]]))[0]
    assert near == pytest.approx(2.7) if beside else 2.7 < near < 3.0
    turned = false_bodies.rooms.Solid(kind, solid.middle, solid.half, np.pi / 2)
    assert turned.hit(eye, AHEAD)[0] == pytest.approx(2.8)


def test_a_cylinder_has_a_lid_and_an_ellipsoid_a_round_top(false_bodies):
    down = np.array([[0.0, 0.0, -1.0]])
    for kind, top in (("cylinder", 2.0), ("ellipsoid", 2.0 - 1.0 + np.sqrt(0.75))):
        solid = false_bodies.rooms.Solid(kind, np.array([0.0, 0.0, 1.0]), np.array([0.2, 0.2, 1.0]))
        assert solid.hit(np.array([0.1, 0.0, 3.0]), down)[0] == pytest.approx(3.0 - top)


def test_a_room_comes_from_its_seed(false_bodies):
    room, again, other = (false_bodies.rooms.room(seed) for seed in (1, 1, 4))
    assert np.array_equal(room.depth, again.depth) and room.things == again.things
    assert room.sensor is other.sensor and not np.array_equal(room.depth, other.depth)
    image = room.sensor.image(room.depth, np.random.default_rng(0))
    known = image > 0
    noise = image[known] * false_bodies.rooms.METERS_PER_UNIT - room.depth[known]
    assert known.mean() > 0.8 and 0.01 < np.median(np.abs(noise)) < 0.03
    x, y = room.things[0][1:]
    assert room.nearest(x, y) == room.things[0][0]


def test_the_table_counts_runs_of_frames_with_a_body(false_bodies, monkeypatch, capsys):
    """Four frames of every room: a body in the second and third; two of a recording, one left behind by a person."""

    class Reported:
        def __init__(self, status):
            self.status = status
            self.joints = {"humanoid_root": np.zeros(3)} if status != "searching" else {}

    reported = [Reported(status) for status in ("searching", "tracking", "lost", "searching")]
    monkeypatch.setattr(false_bodies, "stepped", lambda frames: reported)
    one_of_many = sys.modules["one_of_many"]
    stamps = np.arange(8) / 10.0
    truth = one_of_many.People(stamps, np.array([1]), np.zeros((8, 1)), np.zeros((8, 1, 3)), np.zeros((8, 1, 12, 3)))
    who = np.array([-1, 0, 1, 1, -1, -1, 0, 0])
    result = one_of_many.Followed(truth, who, who == -1, np.full(8, np.nan))
    monkeypatch.setattr(false_bodies, "follow", lambda path: result)
    monkeypatch.setattr(sys, "argv", ["false_bodies.py", "people", "--rooms", "2", "--seconds", "2"])
    false_bodies.main()
    lines = capsys.readouterr().out.splitlines()
    rows = [[cell.strip() for cell in line.split("|")[1:-1]] for line in lines if line.startswith("|")][2:]
    assert rows[0][1:] == ["2", "1", "30.0", "0.1", "50 %", "0", "0"]
    assert rows[3] == ["people", "1", "1", "75.0", "0.1", "100 %", "1", "0"]
    assert rows[4][2] == "4" and rows[4][-2:] == ["1", "0"]
    assert lines[-1] == "people, 0.4 s (left): 0.2 s, 100 % of it called lost"


def test_a_person_in_a_room_is_a_body(false_bodies):
    """One run, from the frame in which they are found to the last."""
    facing = false_bodies.Stop(0.0, 2.4, 0.0, np.pi)
    walk = false_bodies.Walk(body=voodoo.Body.human(), stops=(facing, replace(facing, time=0.3)))
    estimates = false_bodies.stepped(map(walk.measurement, walk))
    (body,) = false_bodies.found(estimates, false_bodies.rooms.RATE_HZ, lambda index: f"frame {index}")
    assert body.lost == 0.0 and 0.1 < body.seconds <= len(walk) / false_bodies.rooms.RATE_HZ + 1e-9
    assert body.where == f"frame {len(walk) - round(body.seconds * false_bodies.rooms.RATE_HZ)}"
