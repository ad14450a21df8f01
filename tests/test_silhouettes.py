"""Masks of a person in depth and color pictures of a scene made of boxes."""

import cv2
import numpy as np
import pytest

from voodoo import Camera, MeasurementError
from voodoo.recordings import DepthImage
from voodoo.sensors.silhouettes import still
from voodoo.sensors.silhouettes.masks import filled, surroundings
from voodoo.sensors.silhouettes.still import StillBackground, StillScene, from_depth

CAMERA = Camera(160, 120, 150.0, 150.0, 79.5, 59.5)
POSE = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
"""Looks along x from 1 m above the floor."""
FRONT, BEHIND = (slice(40, 100), slice(70, 85)), (slice(60, 100), slice(85, 100))


def picture(person=True, wall=4.0, noise=0):
    z = np.full((120, 160), wall)
    if person:
        z[FRONT], z[BEHIND] = 2.5, 2.8
    if noise:
        z += np.random.default_rng(noise).normal(0.0, 0.01, z.shape)
    return DepthImage("depth", 0.0, np.rint(1e3 * z).astype(np.uint16), 0.001, CAMERA, POSE)


def place(u, v, depth):
    x, y, z = depth * (u - CAMERA.cx) / CAMERA.fx, depth * (v - CAMERA.cy) / CAMERA.fy, depth
    return POSE[:3, :3] @ (x, y, z) + POSE[:3, 3]


KNOWN = {"vc7": place(77, 50, 2.55), "r_ankle": place(77, 95, 2.55)}


def test_a_leg_behind_is_visible_only_with_the_scene_or_a_seed():
    front = np.zeros((120, 160), dtype=bool)
    front[FRONT] = True
    both = front.copy()
    both[BEHIND] = True
    # What is nearer to the floor than 5 cm is floor.
    assert np.array_equal(from_depth(picture(), KNOWN), filled(front))
    scene = StillScene([picture(person=index % 3 == 0, noise=index + 1) for index in range(20)])
    assert (from_depth(picture(), KNOWN, scene=scene) ^ both).sum() < 20
    assert np.array_equal(from_depth(picture(), {**KNOWN, "l_knee": place(92, 80, 2.85)}), filled(both))


def test_the_scene_the_person_touches_is_left_out():
    touching = picture(wall=2.53)
    scene = StillScene([picture(person=False, wall=2.53)] * 5)
    assert from_depth(touching, KNOWN).mean() > 0.7
    # A wall is still taken for the person near the known sites, not in the whole picture.
    assert from_depth(touching, KNOWN, scene=scene).mean() < 0.35


def test_nobody_is_there():
    assert not from_depth(picture(person=False), KNOWN, scene=StillScene([picture()])).any()
    assert not from_depth(picture(), {"vc7": (-3.0, 0.0, 1.0)}).any()
    assert not from_depth(picture(), {}).any()


def test_depths_that_cannot_be_used():
    with pytest.raises(MeasurementError, match=r"known\[vc7\].*three finite numbers"):
        from_depth(picture(), {"vc7": (np.nan, 0.0, 0.0)})
    with pytest.raises(MeasurementError, match="expected some of one size, found 0"):
        StillScene([])
    with pytest.raises(MeasurementError, match="as learned"):
        StillScene([picture()]).before(np.ones((60, 80)))


def standing(x):
    """Known sites of a person 3 m away, in the optical axes' plane, `x` meters to the right."""
    sites = {"head_center": (0.0, 0.65), "vc7": (0.0, 0.45)}
    for side, sign in (("l", 1.0), ("r", -1.0)):
        sites |= {
            f"{side}_shoulder": (0.2 * sign, 0.4), f"{side}_wrist": (0.25 * sign, -0.1), f"{side}_hip": (0.1 * sign, -0.1),
            f"{side}_ankle": (0.1 * sign, -0.9),
        }  # fmt: skip
    return {name: np.array((3.0, y - x, 1.0 + z)) for name, (y, z) in sites.items()}


def test_surroundings_hold_the_bent_limbs_and_not_everything():
    known = standing(0.0)
    there = surroundings(known, CAMERA, POSE)
    for y, z in ((0.4, 0.15), (-0.4, 0.15), (0.1, -0.5), (0.0, 0.2)):  # elbows, a knee, the belly
        u, v = np.rint(CAMERA.cx - 150.0 * y / 3.0), np.rint(CAMERA.cy - 150.0 * z / 3.0)
        assert there[int(v), int(u)]
    assert there.mean() < 0.4
    assert surroundings({**known, "l_wrist": np.array((-1.0, 0.0, 1.0))}, CAMERA, POSE).all()
    assert surroundings({}, CAMERA, POSE).all()
    few = surroundings({name: known[name] for name in ("head_center", "l_wrist")}, CAMERA, POSE)
    assert 0.02 < few.mean() < 0.5


def color(x, seed):
    chance = np.random.default_rng(seed)
    image = np.tile(np.linspace(60, 180, 160)[None, :, None], (120, 1, 3)) + chance.normal(0, 3, (120, 160, 3))
    truth = np.zeros((120, 160), dtype=np.uint8)
    sites = {
        name: (CAMERA.cx - 50.0 * place[1], CAMERA.cy - 50.0 * (place[2] - 1.0)) for name, place in standing(x).items()
    }
    for first, last, width in (("vc7", "l_hip", 18), ("l_shoulder", "l_wrist", 5), ("l_hip", "l_ankle", 7)):
        for side in "lr":
            ends = [np.rint(sites[name.replace("l_", f"{side}_")]).astype(int).tolist() for name in (first, last)]
            cv2.line(truth, *ends, 1, width)
    cv2.circle(truth, np.rint(sites["head_center"]).astype(int).tolist(), 6, 1, -1)
    image[truth != 0] = (40, 30, 200)
    return np.clip(image, 0, 255).astype(np.uint8), truth.astype(bool)


def test_a_person_who_never_leaves_the_place_is_cut_out():
    places = 0.25 * np.sin(np.linspace(0.0, 6.0, 30))
    pictures = [color(x, seed)[0] for seed, x in enumerate(places)]
    there = [surroundings(standing(x), CAMERA, POSE) for x in places]
    image, truth = color(0.1, 99)

    def overlap(background):
        found = background.mask(image)
        return (found & truth).sum() / (found | truth).sum()

    careful = StillBackground(pictures, occupied=there)
    assert careful.unknown.any()
    assert overlap(careful) > 0.85
    assert overlap(careful) > overlap(StillBackground(pictures)) + 0.1


def test_skin_as_dark_as_the_floor_is_cut_out_and_a_shadow_is_not(monkeypatch):
    floor = np.full((120, 160, 3), 70, dtype=np.uint8)
    picture = floor.copy()
    picture[30:90, 40:70] = (58, 66, 88)  # BGR, redder and hardly brighter
    picture[30:90, 100:130] = 50  # a shadow
    background = StillBackground([floor])
    found = background.mask(picture)
    assert found[35:85, 45:65].all() and not found[:, 95:].any()
    monkeypatch.setattr(still, "_COLORFUL", 40.0)
    assert not background.mask(picture).any()


def test_backgrounds_that_cannot_be_learned():
    image, truth = color(0.0, 1)
    with pytest.raises(MeasurementError, match="found none"):
        StillBackground([])
    with pytest.raises(MeasurementError, match="as before"):
        StillBackground([image, image[:50]])
    with pytest.raises(MeasurementError, match="2 masks"):
        StillBackground([image, image], occupied=[truth])
    with pytest.raises(MeasurementError, match="not in some picture"):
        StillBackground([image], occupied=[np.ones_like(truth)])
    with pytest.raises(MeasurementError, match="uint8"):
        StillBackground([image.astype(float)])
    with pytest.raises(MeasurementError, match="as before"):
        StillBackground([image]).mask(image[:, :50])
