"""Depth recordings of a person with exact truth, on which nothing is tuned: motions and bodies that training has not seen.

    python -m lab.training.unseen OUT --count 40 --seed 1
    python -m lab.training.unseen OUT --count 8 --seed 1 --height 2.3 --tilt 25
    python -m lab.training.unseen OUT --count 14 --group child wheelchair desk

Writes folders `OUT/look/NAME` and `OUT/report/NAME` by turns: what is mended is mended by looking at the first half, the second
half is measured only. A folder holds depth/, calibration.toml, truth.csv, init.json (the first pose, which `--init auto` leaves
alone) and meta.json (what was drawn, lengths and girths of the body); `voodoo eval` and `lab/experiments/unseen_people.py` read
it. It needs numba.

Bodies and clips are those that `--held-out` keeps from training; motion is captured, or goes through poses that are captured or
made by rule: then arms may pass through the trunk. The sensors' noise is not that of the training pictures, and keeps its
character through a recording.
"""

from __future__ import annotations

import argparse
import json
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import cv2
import numpy as np
from numpy.typing import NDArray

from lab.training import anybody, poses, raster, sensors, shapes
from lab.training.bodies import BONES, JOINTS, Bodies, Body
from lab.training.motions import GROUPS, MILLIMETER, RATE, Clips, Motion, clips_of, of_group, story, walk
from lab.training.poses import Pose
from lab.training.rotations import about, unit

Array = NDArray[np.float64]
Rng = np.random.Generator
T = TypeVar("T")
HALVES = ("look", "report")
KINDS = ("flight", "stereo")
SIZES = {"flight": ((160, 120, 58), (176, 144, 62), (224, 172, 62), (320, 288, 75), (640, 480, 66)),
         "stereo": ((212, 120, 85), (320, 240, 70), (424, 240, 85), (640, 480, 69))}  # fmt: skip
"""Image sizes [px] and horizontal fields of view [degrees]."""
HEIGHTS = (0.4, 0.7, 1.0, 1.4, 1.8, 2.3)
TILT = 30.0
WHOLE, CUT = (0.97, 1.01), (0.6, 0.93)
"""Shares of the joints inside the image, the mean over a recording, of people who are whole and of those who are cut."""
TRIES = 400
ATTEMPTS = 10
HIDDEN = (0.1, 0.4)
"""Share of the pixels of somebody behind furniture that it hides, in any frame that is looked at."""
MATCHED, BASELINE = 848, 0.055
"""Columns in which a stereo camera matches, and the distance of its eyes [m]."""
GIRTHS = {"upperarm": ("shoulder", "elbow", "upper"), "forearm": ("elbow", "wrist", "fore"),
          "thigh": ("hip", "knee", "thigh"), "calf": ("knee", "ankle", "shank")}  # fmt: skip


class NotToBeHadError(Exception):
    """A motion cannot be seen as it should be."""


@dataclass(frozen=True)
class Plan:
    """What a recording shall be: camera's height [m], kind of sensor, from a captured clip or not, floor told or not, whether the
    person is "whole", "hidden" behind furniture in part, or "cut" by the image's border, and who it is of `motions.GROUPS`."""

    height: float
    kind: str
    clip: bool
    floor: bool
    person: str
    group: str = ""


@dataclass(frozen=True)
class View:
    """A camera above the origin that looks along x: its draw of a sensor, world_from_camera (4, 4), and the body's triangles."""

    sensor: sensors.Sensor
    pose: Array
    height: float
    tilt: float
    faces: NDArray[np.int32]


def main() -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("VOODOO_DATA", "../shared/data")))
    parser.add_argument("--count", type=int, default=40, help="recordings, both halves together")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--height", type=float, help="of the camera above the floor [m]; drawn by default")
    parser.add_argument("--tilt", type=float, help="of the camera, downwards [degrees]; drawn by default")
    parser.add_argument("--group", nargs="+", choices=GROUPS, default=[], help="of persons by turns; adults by default")
    parser.add_argument("--stature", type=float, nargs=2, help="of children [m]; drawn between these")
    a = parser.parse_args()
    if a.stature and a.group != ["child"]:
        parser.error(f"--stature: expected --group child alone, found {a.group}")
    bodies = Bodies(a.data / "bodies", held_out=True)
    # Each half has all heights, sensors and kinds of people, in orders of their own.
    plans = {half: _plan(np.random.default_rng([a.seed, which]), a.count, a.group) for which, half in enumerate(HALVES)}
    clips, still = clips_of(a.data), poses.load(a.data / "mocap", held_out=True)
    for number in range(a.count):
        half = HALVES[number % 2]
        place, plan = a.out / half / f"un_{a.seed:d}_{number:02d}", plans[half][number // 2]
        for attempt in range(ATTEMPTS):
            rng = np.random.default_rng([a.seed, number, attempt] if attempt else [a.seed, number])
            try:
                words = make(place, rng, plan, bodies, clips, still, height=a.height, tilt=a.tilt, stature=a.stature)
            except NotToBeHadError as error:
                print(f"{half}/{place.name}: {error}; another motion is drawn", flush=True)
            else:
                print(f"{half}/{place.name}: {words}", flush=True)
                break
        else:
            raise SystemExit(f"{place.name}: expected one of {ATTEMPTS} motions to be had as {plan}, found none")


def _plan(rng: Rng, count: int, groups: Sequence[str]) -> list[Plan]:
    """What the recordings of a half shall be."""

    def order(values: Sequence[T]) -> list[T]:
        return [values[i] for _ in range(count // len(values) + 1) for i in rng.permutation(len(values))]

    heights, kinds, clips, floors = (
        order(HEIGHTS),
        order(KINDS),
        order((True, False, False)),
        order((True, True, False)),
    )
    people = order(("whole",) if groups else ("whole", "whole", "hidden", "cut"))
    who = order(groups or ("",))
    return [Plan(*row) for row in zip(heights, kinds, clips, floors, people, who, strict=False)]


def make(
    out: Path,
    rng: Rng,
    plan: Plan,
    bodies: Bodies,
    clips: Clips,
    still: list[Pose],
    *,
    height: float | None,
    tilt: float | None,
    stature: Sequence[float] | None = None,
) -> str:
    """Write one recording; what it is, in words."""
    index = int(rng.integers(len(bodies)))
    body = bodies[index]
    dress = int(rng.integers(2**31))
    if plan.group:
        which = frozenset({plan.group})
        body = anybody.child(rng, body, *stature) if stature else anybody.shaped(rng, body, which)
        motion = of_group(rng, plan.group, body, dress, clips, still, clip=plan.clip)
    else:
        motion = walk(rng, body, dress, clips) if plan.clip else story(rng, body, dress, still)
    motion, view = _view(rng, motion, plan, bodies.faces, height=height, tilt=tilt)
    away = float(np.linalg.norm(motion.joints[:, 2, :2], axis=1).min())
    room = _room(rng, motion, view, plan)
    root_from_camera = view.pose if plan.floor else np.eye(4)
    root_from_floor = root_from_camera @ np.linalg.inv(view.pose)
    truth = motion.joints @ root_from_floor[:3, :3].T + root_from_floor[:3, 3]
    (out / "depth").mkdir(parents=True, exist_ok=True)
    noise = _noise(rng, view.sensor)
    empty = _drawn(view, room)
    for frame, surface in enumerate(motion.surfaces):
        depth, labels = empty[0].copy(), empty[1].copy()
        _draw(view, surface, bodies.faces, 1, depth, labels)
        for points, faces, closed in motion.things[frame] if motion.things else ():
            _draw(view, points, faces, 2, depth, labels, closed)
        image = np.rint(noise(depth) * MILLIMETER).astype(np.uint16)
        cv2.imwrite(str(out / "depth" / f"{frame / RATE:.6f}.png"), image)
    _write_calibration(out, view, root_from_camera, plan.floor)
    names = ",".join(f"{name}_{axis}" for name in JOINTS for axis in "xyz")
    rows = [f"{i / RATE:.6f}," + ",".join(f"{v:.5f}" for v in row.ravel()) for i, row in enumerate(truth)]
    (out / "truth.csv").write_text("\n".join([f"stamp_s,{names}", *rows]) + "\n")
    start = {name: [round(float(v), 5) for v in place] for name, place in zip(JOINTS, truth[0], strict=True)}
    (out / "init.json").write_text(json.dumps({"height_m": round(body.stature, 3), "joints": start}) + "\n")
    sensor = view.sensor
    meta = {
        "motion": motion.words,
        "body": bodies.use[index],
        "sensor": f"{sensor.kind} {sensor.width}x{sensor.height}",
        "camera_height_m": view.height,
        "camera_tilt_deg": view.tilt,
        "nearest_m": away,
        "floor_known": plan.floor,
        "person": plan.person,
        "group": plan.group or "adult",
        "stature_m": body.stature,
        "lengths_m": dict(zip(BONES, body.lengths.tolist(), strict=False)),
        "radii_m": _radii(body, dress),
    }
    (out / "meta.json").write_text(json.dumps(meta, indent=1) + "\n")
    return ", ".join(
        [
            motion.words,
            f"{len(truth)} frames",
            str(meta["sensor"]),
            f"height {view.height:.1f} m, tilt {view.tilt:.0f} degrees, {away:.1f} m",
            plan.person,
            "floor known" if plan.floor else "floor not known",
        ]
    )


def _view(
    rng: Rng, motion: Motion, plan: Plan, faces: NDArray[np.int32], *, height: float | None, tilt: float | None
) -> tuple[Motion, View]:
    """A camera and the motion where it sees as much of it as it should."""
    size = SIZES[plan.kind][int(rng.integers(len(SIZES[plan.kind])))]
    sensor = sensors.Sensor(size[0], size[1], float(np.deg2rad(size[2])), plan.kind, 8.0, 0.001, False)
    cut = plan.person == "cut"
    middle = np.array([*motion.joints[:, 2, :2].mean(axis=0), 0.0])
    expected = CUT if cut else WHOLE
    drawn_height = plan.height if height is None else height
    for _ in range(TRIES):
        away = rng.uniform(1.3, 3.0) if cut else rng.uniform(1.6, 4.2)
        facing = rng.normal(np.pi, 0.6) if rng.random() < 0.6 else rng.uniform(-np.pi, np.pi)
        turn, shift = about("z", facing), np.array([away, away * rng.uniform(-0.25, 0.25), 0.0])
        high = drawn_height if height is not None else drawn_height + rng.uniform(-0.15, 0.15) * (drawn_height < 2.2)
        aim = np.degrees(np.arctan2(high - 0.9, away)) + rng.normal(0, 8.0)
        down = float(np.clip(aim if tilt is None else tilt, -TILT, TILT))
        forward = about("y", np.deg2rad(down)) @ np.array([1.0, 0, 0])
        right = np.array([0, -1.0, 0])
        pose = np.eye(4)
        pose[:3, :3] = np.stack([right, np.cross(forward, right), forward], 1) @ about("z", rng.normal(0, 0.02)).T
        pose[:3, 3] = [0, 0, max(high, 0.4)]
        view = View(sensor, pose, float(pose[2, 3]), down, faces)
        joints = (motion.joints - middle) @ turn.T + shift
        fraction = _inside(view, joints)
        far = np.linalg.norm(joints[:, 2, :2], axis=1)
        if expected[0] <= fraction < expected[1] and 1.0 <= far.min() and far.max() <= 4.7:
            return motion.moved(turn, shift - turn @ middle), view
    raise NotToBeHadError(f"{motion.words}: expected a view of it from {drawn_height} m, {plan.person}, found none")


def _inside(view: View, joints: Array) -> float:
    """Share of joints (F, J, 3) inside the image."""
    at = (joints - view.pose[:3, 3]) @ view.pose[:3, :3]
    fx, fy, cx, cy = view.sensor.intrinsics
    z = np.maximum(at[..., 2], 0.05)
    u, v = fx * at[..., 0] / z + cx, fy * at[..., 1] / z + cy
    return float(np.mean((at[..., 2] > 0.2) & (u >= 0) & (v >= 0) & (u < view.sensor.width) & (v < view.sensor.height)))


def _room(rng: Rng, motion: Motion, view: View, plan: Plan) -> list[shapes.Mesh]:
    """Floor, walls, furniture that stands out of the way, a seat, and at times a thing before the person."""
    low, high = HIDDEN if plan.person == "hidden" else (0.0, HIDDEN[0])
    for _ in range(TRIES):
        meshes = _furnished(rng, motion, hidden=plan.person == "hidden")
        fractions = [_hidden(view, motion.surfaces[i], meshes) for i in (0, len(motion.surfaces) // 2, -1)]
        if max(fractions) < high and low <= np.mean(fractions):
            return meshes
    raise NotToBeHadError(f"{motion.words}: expected furniture with somebody {plan.person}, found none")


def _hidden(view: View, surface: Array, room: list[shapes.Mesh]) -> float:
    """Share of a person's pixels that the room hides."""
    alone, labels = _drawn(view, [])
    _draw(view, surface, view.faces, 1, alone, labels)
    whole = labels == 1
    depth, _ = _drawn(view, room)
    return float(np.mean(depth[whole] < alone[whole])) if whole.any() else 0.0


def _furnished(rng: Rng, motion: Motion, *, hidden: bool) -> list[shapes.Mesh]:
    at = motion.joints[:, 2, :2]
    back = float(at[:, 0].max() + rng.uniform(0.5, 2.0))
    side = float(np.abs(at[:, 1]).max())
    meshes = shapes.room(rng, back, side + rng.uniform(0.8, 2.5), side + rng.uniform(0.8, 2.5), 1.0)
    if motion.seat is not None:
        make = (shapes.stool, shapes.chair, shapes.sofa)[int(rng.integers(3))]
        root, knees = motion.joints[0, 2], motion.joints[0, [13, 14]].mean(axis=0)
        ahead = unit((knees - root)[:2])
        place = root[:2] - 0.05 * ahead
        meshes += shapes.moved(make(rng, motion.seat), (place[0], place[1]), float(np.arctan2(ahead[1], ahead[0])))
    if hidden:
        middle = at.mean(axis=0)
        make = (shapes.table, shapes.chair, shapes.boxes)[int(rng.integers(3))]
        place = middle * (1 - rng.uniform(0.5, 0.7) / np.linalg.norm(middle)) + [0, rng.normal(0, 0.15)]
        gap = float(np.linalg.norm(motion.joints[..., :2] - place, axis=-1).min())
        place = place - max(0.45 - gap, 0) * unit(middle)
        if np.linalg.norm(place) > 0.7:
            meshes += shapes.moved(make(rng), (place[0], place[1]), rng.uniform(-0.4, 0.4))
    for _ in range(int(rng.integers(1, 5))):
        for _ in range(6):
            x, y = rng.uniform(1.2, back + 0.2), rng.uniform(-2.5, 2.5)
            gap = np.linalg.norm(motion.joints[..., :2] - [x, y], axis=-1).min()
            bearing = np.abs(np.arctan2(at[:, 1], at[:, 0]) - np.arctan2(y, x)).min()
            if gap > rng.choice([0.45, 0.8]) and (bearing > 0.4 or x > at[:, 0].max()):
                make = shapes.ANY[int(rng.integers(len(shapes.ANY)))]
                meshes += shapes.moved(make(rng), (x, y), rng.uniform(-np.pi, np.pi))
                break
    return meshes


def _draw(
    view: View,
    points: Array,
    faces: NDArray[np.int32],
    label: int,
    depth: Array,
    labels: NDArray[np.uint8],
    closed: bool = True,
) -> None:
    observed = np.ascontiguousarray((points - view.pose[:3, 3]) @ view.pose[:3, :3])
    raster.draw(observed, faces, label, view.sensor.intrinsics, closed, depth, labels)


def _drawn(view: View, room: list[shapes.Mesh]) -> tuple[Array, NDArray[np.uint8]]:
    depth = np.full((view.sensor.height, view.sensor.width), sensors.FAR)
    labels = np.zeros(depth.shape, np.uint8)
    for points, faces, closed in room:
        _draw(view, points, faces, 0, depth, labels, closed)
    return depth, labels


def _noise(rng: Rng, sensor: sensors.Sensor) -> Callable[[Array], Array]:
    """What a camera makes of exact depths [m]: 0 where nothing returns."""
    reach = rng.uniform(5.0, 8.0)
    gain, lost, flying = rng.uniform(0.6, 1.5), rng.choice([0.001, 0.005, 0.02]), rng.uniform(0.2, 0.6)
    focal, grain = sensor.intrinsics[0], int(rng.integers(4, 9))
    # A stereo camera matches in its own pixels and hands out fewer.
    matched = focal * max(1.0, MATCHED / sensor.width) * BASELINE

    def flight(true: Array) -> Array:
        depth = true + rng.normal(0, 1, true.shape) * (0.004 + 0.002 * true) * gain
        border = sensors.edges(true)
        y, x = np.nonzero(border & (rng.random(true.shape) < flying))
        beside = true[np.clip(y + rng.integers(-1, 2, len(y)), 0, len(true) - 1),
                      np.clip(x + rng.integers(-1, 2, len(x)), 0, true.shape[1] - 1)]  # fmt: skip
        fraction = rng.random(len(y))
        depth[y, x] = fraction * depth[y, x] + (1 - fraction) * np.minimum(beside, depth[y, x] + 2.0)
        return np.where(sensors.grazing(true, focal) < 0.08, 0.0, depth)

    def stereo(true: Array) -> Array:
        # Disparities with noise that neighbors share, in steps of a sixteenth of a pixel, fattened borders.
        fat = cv2.erode(true, np.ones((3, 3)))
        near = np.where(rng.random(true.shape) < 0.4, fat, true)
        disparity = matched / near + 0.08 * gain * sensors._smooth(rng, true.shape, grain)
        depth = matched / np.maximum(np.round(disparity * 16) / 16, 1e-3)
        hole = sensors._shadow(true, focal * BASELINE) & (rng.random(true.shape) < 0.8)
        return np.where(hole, 0.0, depth)

    def image(true: Array) -> Array:
        depth = flight(true) if sensor.kind == "flight" else stereo(true)
        gone = (true > reach) | (depth < 0.25) | (rng.random(true.shape) < lost)
        return np.where(gone, 0.0, np.minimum(depth, 60.0))

    return image


def _radii(body: Body, dress: int) -> dict[str, float]:
    """Mean distance [m] of the dressed surface from the middle of its cross-sections, from 30 to 70 % of each limb."""
    rng = np.random.default_rng(dress)
    rng.normal(0.0, 0.5, 2)  # as `posed` draws
    surface = body.vertices + raster.normals(body.vertices, body.set.faces) * body.cloth(rng)[:, None]
    found = {}
    for limb, (start, end, region) in GIRTHS.items():
        for side in ("l", "r"):
            a, b = body.sites[f"{side}_{start}"], body.sites[f"{side}_{end}"]
            own = (body.set.region[region] > 0.5) & (np.sign(surface[:, 1]) == np.sign(a[1]))
            along = unit(b - a)
            t = (surface[own] - a) @ along / np.linalg.norm(b - a)
            middle = (t > 0.3) & (t < 0.7)
            across = surface[own][middle] @ (np.eye(3) - np.outer(along, along))
            # The limb's middle line, straight but not through the joints.
            line = np.stack([np.ones(middle.sum()), t[middle]], 1)
            off = across - line @ np.linalg.lstsq(line, across, rcond=None)[0]
            found[f"{side}_{limb}"] = float(np.linalg.norm(off, axis=1).mean())
    return found


def _write_calibration(out: Path, view: View, root_from_camera: Array, floor_known: bool) -> None:
    fx, fy, cx, cy = view.sensor.intrinsics
    lines = [f"width = {view.sensor.width}", f"height = {view.sensor.height}"]
    lines += [
        f"{name} = {value!r}"
        for name, value in zip(("fx", "fy", "cx", "cy"), map(float, (fx, fy, cx, cy)), strict=True)
    ]
    lines += [f"depth_factor = {MILLIMETER}", 'sensor_frame = "camera_depth_optical_frame"']
    if floor_known:
        lines += ['root_frame = "base_link"', f"root_from_sensor = {root_from_camera.tolist()}"]
    (out / "calibration.toml").write_text("\n".join(lines) + "\n")


if __name__ == "__main__":
    main()
