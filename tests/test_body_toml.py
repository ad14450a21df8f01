import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import voodoo
from commands import run
from scene import rest_pose
from voodoo import BodyError, VoodooError

EXAMPLES = Path(__file__).resolve().parent.parent / "examples" / "bodies"

THING = """
name = "thing"

[[limbs]]
name = "base"
shape = { length = 0.2, a0 = 0.1, b0 = 0.1, a1 = 0.08, b1 = 0.08 }

[[limbs]]
name = "arm"
parent = "base"
shape = { length = 0.4, a0 = 0.03, b0 = 0.03, a1 = 0.02, b1 = 0.02 }
match_caps = [false, true]
[limbs.joint]
name = "shoulder"
on_parent = { position = [0, 0, 0.2] }
semi_axes = [0.02, 0]

[[sites]]
name = "tip"
limb = "arm"
position = [0, 0, 0.4]
"""


COPY = """
[[limbs]]
name = "base"
parent = "arm"
shape = { length = 0.2, a0 = 0.1, b0 = 0.1, a1 = 0.08, b1 = 0.08 }
[limbs.joint]
name = "second"

"""


@pytest.mark.parametrize("model", ["papers", "full"])
def test_a_body_survives_the_round_trip(model):
    body = voodoo.Body.human(1.83, model=model)
    text = body.to_toml()
    again = voodoo.Body.from_toml(text)
    assert again.to_toml() == text
    assert (again.limb_names, again.site_names) == (body.limb_names, body.site_names)
    for pose, other in zip(rest_pose(body).values(), rest_pose(again).values(), strict=True):
        np.testing.assert_allclose(pose, other, atol=1e-7)
    for limb, other in zip(body.limbs, again.limbs, strict=True):
        assert limb.shape.length == pytest.approx(other.shape.length, abs=1e-8)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.toml")), ids=lambda path: path.stem)
def test_the_shipped_bodies_load_and_survive(path):
    body = voodoo.Body.load(path)
    assert voodoo.Body.from_toml(body.to_toml()).to_toml() == body.to_toml()


def shipped_human():
    body = voodoo.Body.human(1.75)
    counts = f"{len(body.limbs)} limbs and {len(body.limbs) - 1} joints"
    return (
        f"# The default human, stature 1.75 m: {counts}. The same as `voodoo.Body.human(1.75)`.\n"
        f"# The format is explained in docs/how-to/describe-a-body.md.\n\n{body.to_toml()}"
    )


def test_the_shipped_human_is_the_default_one():
    assert (EXAMPLES / "human.toml").read_text() == shipped_human(), "write it anew: python tests/test_body_toml.py"
    assert len(list(EXAMPLES.glob("*.toml"))) >= 2


def test_names_of_any_kind_survive():
    odd = 'a "quoted" \\ name, 100 % \u00e4 \U0001f9b4'
    quoted = '"""a \\"quoted\\" \\\\ name, 100 % \u00e4 \U0001f9b4"""'
    text = THING
    for word in ("thing", "base", "arm", "shoulder", "tip"):
        text = text.replace(f'"{word}"', quoted.replace('"""a', f'"""{word}'))
    body = voodoo.Body.from_toml(text)
    assert (body.name, body.limb_names[1], body.site_names[0]) == tuple(
        odd.replace("a ", f"{word} ", 1) for word in ("thing", "arm", "tip")
    )
    assert voodoo.Body.from_toml(body.to_toml()) == body


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('name = "thing"', "", ["name", "found none"]),
        ('name = "thing"', "name = 3", ["name", "a word"]),
        ('name = "thing"', 'name = "thing"\ncolor = "red"', ["color", "known key"]),
        ("length = 0.2", "length = -0.2", ["limbs.base.shape.length", "a number above 0", "-0.2"]),
        ("length = 0.2", "length = inf", ["limbs.base.shape.length", "finite"]),
        ("length = 0.2, ", "", ["limbs.base.shape.length", "found none"]),
        ("length = 0.2", "length = 5e9", ["limbs.base.shape", "length"]),
        (
            "length = 0.2",
            "length = 200.0",
            ["limbs.base.shape.length", "meters, 100 at most", "200 millimeters are 0.2"],
        ),
        ("a0 = 0.1, b0", "a0 = 120, b0", ["limbs.base.shape.a0", "meters, 100 at most", "found 120"]),
        (
            "semi_axes = [0.02, 0]",
            "limits = [[-90, 90], [0, 0], [0, 0]]",
            ["limbs.arm.joint.limits", "radians", "-90 degrees are -1.571"],
        ),
        (
            "position = [0, 0, 0.2]",
            "position = [0, 0, 0.2], rotation = [45, 0, 0]",
            ["limbs.arm.joint.on_parent.rotation", "radians", "found 45"],
        ),
        ("a0 = 0.1, b0 = 0.1, a1 = 0.08", "a0 = 0.0, b0 = 0.1, a1 = 0.0", ["limbs.base.shape", "a0 and a1", "flat"]),
        ('parent = "base"', 'parent = "leg"', ["limbs.arm.parent", "base", "leg"]),
        ('parent = "base"\n', "", ["limbs.arm", "both a parent and a joint"]),
        ('parent = "base"', 'parent = "arm"', ["limbs.arm.parent", "before"]),
        ("[[sites]]", COPY + "[[sites]]", ["limbs.base", "already taken"]),
        ("match_caps = [false, true]", "match_caps = [false]", ["limbs.arm.match_caps"]),
        ("semi_axes = [0.02, 0]", "semi_axes = [-0.02, 0]", ["limbs.arm.joint.semi_axes", "-0.02"]),
        ("semi_axes = [0.02, 0]", "semi_axes = [0.02]", ["limbs.arm.joint.semi_axes"]),
        ("semi_axes = [0.02, 0]", "weight = 0", ["limbs.arm.joint.weight", "above zero"]),
        ("semi_axes = [0.02, 0]", "limits = [[1, 0], [0, 0], [0, 0]]", ["limbs.arm.joint.limits"]),
        ("position = [0, 0, 0.2]", "position = [0, nan, 0.2]", ["limbs.arm.joint.on_parent.position", "finite"]),
        ('limb = "arm"', 'limb = "leg"', ["sites.tip.limb", "leg"]),
        ("position = [0, 0, 0.4]", "position = [0, 0]", ["sites.tip.position"]),
        ("[[sites]]", "[[sites]", ["syntax"]),
        (THING, "", ["name"]),
        (THING, 'name = "x"\nlimbs = []', ["at least one limb"]),
    ],
)
def test_every_error_names_its_key(old, new, words):
    assert old in THING
    with pytest.raises(BodyError) as caught:
        voodoo.Body.from_toml(THING.replace(old, new), source="thing.toml")
    message = str(caught.value)
    assert message.startswith("thing.toml: ") and all(word in message for word in words), message


def test_a_crane_and_a_full_turn_are_bodies():
    text = THING.replace("length = 0.2", "length = 29.0")
    text = text.replace("semi_axes = [0.02, 0]", f"limits = [[-6.2832, {2.0 * np.pi}], [0, 0], [0, 0]]")
    assert "29.0" in text and "6.2832" in text
    assert voodoo.Body.from_toml(text).limbs[0].shape.length == 29.0


def test_unreadable_files_are_named(tmp_path):
    (tmp_path / "bad.toml").write_bytes(b"\xff\xfe\x00")
    for path in (tmp_path / "none.toml", tmp_path / "bad.toml", tmp_path):
        with pytest.raises(BodyError, match="readable TOML") as caught:
            voodoo.Body.load(path)
        assert str(path) in str(caught.value)


def usable(call):
    """Run, and let only the package's own errors pass as a refusal; says whether it ran."""
    try:
        call()
    except VoodooError as error:
        assert len(str(error)) > 10
        return False
    return True


FAST = settings(max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow])


@FAST
@given(st.text())
def test_any_text_is_a_body_or_a_clear_error(text):
    usable(lambda: voodoo.Body.from_toml(text))
    usable(lambda: voodoo.Config.from_toml(text))


@FAST
@given(st.integers(0, len(THING) - 1), st.integers(0, 30), st.text(alphabet="[]{}=\"'.,-e019 \nnaif", max_size=8))
def test_any_damage_to_a_body_is_found_or_harmless(start, length, filling):
    text = THING[:start] + filling + THING[start + length :]
    bodies = []
    if usable(lambda: bodies.append(voodoo.Body.from_toml(text))):
        assert voodoo.Body.from_toml(bodies[0].to_toml()).limb_names == bodies[0].limb_names
        assert all(np.isfinite(pose).all() for pose in rest_pose(bodies[0]).values())


VALUES = st.one_of(
    st.none(), st.booleans(), st.integers(), st.floats(), st.text(max_size=5), st.lists(st.floats(), max_size=4)
)


@FAST
@given(st.sampled_from([*voodoo.Config.model_fields, "color"]), VALUES)
def test_any_value_of_a_configuration_is_taken_or_named(key, value):
    if not usable(lambda: voodoo.Config(**{key: value})):
        with pytest.raises(voodoo.ConfigError, match=key):
            voodoo.Config(**{key: value})


def tracked(points, image, stamp, weight):
    """Which of the two were tracked."""
    body = voodoo.Body.from_toml(THING)
    tracker = voodoo.Tracker(body)
    tracker.reset_pose(rest_pose(body))
    camera = voodoo.Camera(6, 6, 5.0, 5.0, 2.5, 2.5)
    before = tracker.estimate.joint_positions

    def step():
        frame = voodoo.Frame(stamp=stamp)
        frame.add_points(points, weight=weight, on_body=True)
        tracker.step(frame)

    def depth():
        frame = voodoo.Frame(stamp=stamp)
        frame.add_depth(image, camera=camera, weight=weight)
        tracker.step(frame)

    taken = []
    for attempt in (step, depth):
        tracker.reset_pose(rest_pose(body))
        taken.append(usable(attempt))
        if not taken[-1]:
            np.testing.assert_array_equal(tracker.estimate.joint_positions, before)
        else:
            assert math.isfinite(stamp) and math.isfinite(weight) and weight > 0.0
        assert np.isfinite(tracker.estimate.limb_poses).all()
    return taken


def share_taken(test, **drawn):
    """The share of examples, or of each of several parts of them, that a test says were taken."""
    taken = []
    FAST(given(**drawn)(lambda **example: taken.append(test(**example))))()
    return np.mean(taken, axis=0)


ANY_ARRAY = arrays.arrays(
    st.sampled_from([np.float32, np.float64, np.int64, np.uint16, np.bool_, np.complex64]),
    arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=6),
)


@pytest.mark.filterwarnings("ignore::voodoo.UnitWarning")
@FAST
@given(ANY_ARRAY, st.floats(), st.floats())
def test_any_array_is_tracked_or_refused_and_no_nan_comes_out(array, stamp, weight):
    tracked(array, array, stamp, weight)


@pytest.mark.filterwarnings("ignore::voodoo.UnitWarning")
def test_any_numbers_in_arrays_of_the_right_form_are_tracked_or_refused_and_no_nan_comes_out():
    rows, near = st.tuples(st.integers(0, 30), st.just(3)), st.floats(-2.0, 2.0, width=32)
    share = share_taken(
        tracked,
        points=st.one_of(
            arrays.arrays(np.float32, rows, elements=near),
            arrays.arrays(np.float64, rows, elements=near),
            arrays.arrays(st.sampled_from([np.float32, np.float64]), rows),
        ),
        image=arrays.arrays(st.sampled_from([np.uint16, np.float32]), (6, 6)),
        stamp=st.floats(allow_nan=False, allow_infinity=False),
        weight=st.floats(0.0, 1e6, exclude_min=True),
    )
    assert (share >= 1 / 3).all(), share


def started(joints):
    """Whether a start of the thing with three sites was taken."""
    more = "".join(f'\n[[sites]]\nname = "{name}"\nlimb = "base"\nposition = {place}\n' for name, place in SITES)
    tracker = voodoo.Tracker(voodoo.Body.from_toml(THING + more))
    taken = usable(lambda: tracker.reset(joints=joints))
    if taken:
        assert np.isfinite(tracker.estimate.limb_poses).all()
    return taken


SITES = (("side", [0.1, 0, 0]), ("front", [0, 0.1, 0]))


@FAST
@given(st.dictionaries(st.sampled_from(["tip", "side", "front", "no"]), st.lists(st.floats(), max_size=4), max_size=3))
def test_any_start_is_taken_or_refused(joints):
    started(joints)


def test_any_start_at_places_of_all_sites_is_taken_or_refused():
    place = st.tuples(*3 * [st.floats(-0.5, 0.5)])
    share = share_taken(started, joints=st.fixed_dictionaries(dict.fromkeys(("tip", "side", "front"), place)))
    assert share >= 1 / 3, share


if __name__ == "__main__":
    (EXAMPLES / "human.toml").write_text(shipped_human())


def test_the_body_that_is_printed_is_the_one_that_is_tracked():
    assert run("body").stdout == voodoo.Body.human().to_toml()
