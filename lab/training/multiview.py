"""Recordings of a person before several color cameras, with exact truth: other bodies, clothes, rooms and motions.

    python -m lab.training.multiview OUT --seed 1 --clip 05_18 --body 3 [--cameras 4] [--frames 120] [--alike]

Writes OUT/videos/cam_N.avi, OUT/Calib_scene.toml, init.json, truth.csv and background/, as `voodoo track OUT` and
`lab/experiments/color_regions.py OUT` read them. Nothing was ever tuned on what comes out of it. With `--silhouettes` the
person is white before black: the most that contours can tell. It needs numba.
"""

from __future__ import annotations

import argparse
import json
import os
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from lab.training import poses, raster
from lab.training.bodies import Bodies, Body

Array = NDArray[np.float64]
Picture = NDArray[np.uint8]
SIZE = (480, 640)
RATE = 30.0
SHADES = 3
NOTHING = 255


@dataclass(frozen=True)
class Camera:
    """A pinhole: world_from_camera (4, 4), (fx, fy, cx, cy), and gains of its channels."""

    pose: Array
    intrinsics: tuple[float, float, float, float]
    gains: Array


@dataclass(frozen=True)
class Appearance:
    """What everything looks like: faces and base colors (BGR) by label, of the room and of the body, and its light."""

    room: list[tuple[Array, NDArray[np.int32]]]
    body: list[NDArray[np.int32]]
    colors: Array
    waves: Array
    light: Array
    flat: bool


def _cameras(rng: np.random.Generator, count: int, middle: Array) -> list[Camera]:
    """Cameras around a place, at irregular angles, distances and heights, each rolled a little."""
    cameras = []
    for number in range(count):
        around = 2 * np.pi * (number + rng.uniform(-0.25, 0.25)) / count + 0.6
        place = middle + [rng.uniform(3.0, 4.0) * np.cos(around), rng.uniform(3.0, 4.0) * np.sin(around), 0.0]
        place[2] = rng.uniform(0.8, 2.3)
        z = middle + [0, 0, 0.9] - place
        z /= np.linalg.norm(z)
        x = np.cross(z, [0.0, 0.0, 1.0])
        x /= np.linalg.norm(x)
        roll = rng.uniform(-0.03, 0.03)
        y = np.cross(z, x)
        x, y = np.cos(roll) * x + np.sin(roll) * y, np.cos(roll) * y - np.sin(roll) * x
        pose = np.eye(4)
        pose[:3] = np.column_stack([x, y, z, place])
        focal = rng.uniform(480, 600)
        cameras.append(Camera(pose, (focal, focal, 319.5, 239.5), rng.uniform(0.94, 1.06, 3)))
    return cameras


def _box(low: Array, high: Array) -> tuple[Array, NDArray[np.int32]]:
    """The surface of a box: corners (8, 3) and triangles (12, 3)."""
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return corners, np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))], dtype=np.int32)


def _clothes(rng: np.random.Generator, body: Body) -> tuple[list[NDArray[np.int32]], Array]:
    """Triangles of the body by color, and these colors."""
    region, z = body.set.region, body.vertices[:, 2]
    kind = np.zeros(len(z), dtype=int)  # skin
    kind[(region["trunk"] + region["upper"]) > 0.5] = 1
    kind[(region["fore"] > 0.5) & (rng.random() < 0.4)] = 1
    kind[((region["trunk"] > 0.5) & (z < body.sites["l_hip"][2] + 0.08)) | (region["thigh"] > 0.5)] = 2
    kind[(region["shank"] > 0.5) & (rng.random() < 0.7)] = 2
    kind[region["foot"] > 0.5] = 3
    kind[z > body.sites["head_center"][2] + 0.07] = 4
    skin = np.array([115.0, 140.0, 195.0]) * rng.uniform(0.5, 1.1)
    base = [skin, *(rng.uniform(25, 225, 3) for _ in range(2)), rng.uniform(15, 80, 3), rng.uniform(15, 70, 3)]
    spread = [0.06, rng.uniform(0.1, 0.5), rng.uniform(0.05, 0.3), 0.1, 0.1]
    middle = body.vertices[body.set.faces].mean(axis=1)
    cells = np.floor(middle / rng.uniform(0.03, 0.08)).astype(int)
    shade = ((cells * [73856093, 19349663, 83492791]).sum(axis=1) % 1009) % SHADES
    of = np.median(kind[body.set.faces], axis=1).astype(int)
    groups, colors = [], []
    for number, color in enumerate(base):
        for step in range(SHADES):
            groups.append(np.ascontiguousarray(body.set.faces[(of == number) & (shade == step)]))
            colors.append(color * (1 + spread[number] * (step - 1)))
    return groups, np.array(colors)


def _appearance(rng: np.random.Generator, body: Body, middle: Array, *, flat: bool, alike: bool) -> Appearance:
    """A room with furniture about the person, and clothes."""
    wall = np.array([rng.uniform(4.5, 6.0), rng.uniform(4.5, 6.0)])
    low, high = np.array([*(middle[:2] - wall), 0.0]), np.array([*(middle[:2] + wall), 2.9])
    corners, faces = _box(low, high)
    room = [(corners, np.ascontiguousarray(faces[2 * side : 2 * side + 2, ::-1])) for side in range(6)]
    for _ in range(10):
        around, far = rng.uniform(0, 2 * np.pi), rng.uniform(2.4, 4.2)
        place = middle[:2] + far * np.array([np.cos(around), np.sin(around)])
        size = rng.uniform(0.1, 0.45, 2)
        room.append(_box(np.array([*(place - size), 0.0]), np.array([*(place + size), rng.uniform(0.3, 1.1)])))
    groups, clothes = _clothes(rng, body)
    gray = rng.uniform(70, 200, (len(room), 1))
    if alike:
        dyed = clothes[rng.integers(SHADES, 3 * SHADES, len(room))]
        room_colors = np.clip(dyed + rng.normal(0, 10, dyed.shape), 20, 230)
    else:
        room_colors = np.clip(gray + rng.normal(0, 30, (len(room), 3)), 20, 230)
    colors = np.vstack([clothes, room_colors])
    light = np.array([rng.normal(), rng.normal(), 2.0])
    waves = rng.normal(0, 1, (12, 3)) * rng.uniform(2, 25, (12, 1))
    return Appearance(room, groups, colors, waves, light / np.linalg.norm(light), flat)


def _shoot(
    camera: Camera, appearance: Appearance, points: Array | None, time: float, rng: np.random.Generator
) -> Picture:
    """A picture of the room and a body's surface (V, 3), world frame, if there is one."""
    from_world = np.linalg.inv(camera.pose)
    depth, labels = np.full(SIZE, np.inf), np.full(SIZE, NOTHING, dtype=np.uint8)

    def observed(surface: Array) -> Array:
        return np.ascontiguousarray(surface @ from_world[:3, :3].T + from_world[:3, 3])

    for number, (corners, faces) in enumerate(appearance.room):
        # One is inside the room: its walls face inward, and boxes need no culling.
        raster.draw(observed(corners), faces, len(appearance.body) + number, camera.intrinsics, False, depth, labels)
    if points is not None:
        surface = observed(points)
        for number, faces in enumerate(appearance.body):
            raster.draw(surface, faces, number, camera.intrinsics, True, depth, labels)
    if appearance.flat:
        return np.repeat(np.where(labels < len(appearance.body), 235, 20).astype(np.uint8)[..., None], 3, axis=2)
    fx, fy, cx, cy = camera.intrinsics
    v, u = np.mgrid[: SIZE[0], : SIZE[1]]
    z = np.where(np.isfinite(depth), depth, 10.0)
    place = np.stack([(u - cx) / fx * z, (v - cy) / fy * z, z], axis=2) @ camera.pose[:3, :3].T + camera.pose[:3, 3]
    across, down = np.gradient(place, axis=1), np.gradient(place, axis=0)
    normal = np.cross(across, down)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True) + 1e-12
    normal *= np.sign(((camera.pose[:3, 3] - place) * normal).sum(axis=2, keepdims=True))
    shade = 0.6 + 0.4 * np.clip(normal @ appearance.light, 0, 1)
    texture = np.zeros(SIZE)
    for wave in appearance.waves:
        texture += np.sin(place @ wave)
    still = labels >= len(appearance.body)
    shade *= np.where(still, 1 + 0.09 * texture / np.sqrt(len(appearance.waves)), 1.0)
    if points is not None:
        # A soft shadow on the floor.
        under = place[..., :2] - points[:, :2].mean(axis=0) + 0.5 * appearance.light[:2]
        shade *= 1 - 0.3 * np.exp(-(under**2).sum(axis=2) / 0.3) * (place[..., 2] < 0.02)
    shade *= 1 + 0.06 * np.sin(place[..., 0] * 1.3 + 0.7 * time) + 0.02 * np.sin(1.1 * time)
    image = appearance.colors[np.minimum(labels, len(appearance.colors) - 1)] * shade[..., None] * camera.gains
    image = cv2.GaussianBlur(image, (0, 0), 0.6)
    image += rng.normal(0, 1.4, image.shape) * np.sqrt(np.maximum(image, 1) / 110)
    return np.clip(image, 0, 255).astype(np.uint8)


def _calibration(cameras: list[Camera]) -> str:
    tables = []
    for number, camera in enumerate(cameras):
        from_world = np.linalg.inv(camera.pose)
        fx, fy, cx, cy = camera.intrinsics
        tables.append(
            f'[cam_{number}]\nname = "cam_{number}"\nsize = [{SIZE[1]}.0, {SIZE[0]}.0]\n'
            f"matrix = [[{fx}, 0.0, {cx}], [0.0, {fy}, {cy}], [0.0, 0.0, 1.0]]\ndistortions = [0.0, 0.0, 0.0, 0.0]\n"
            f"rotation = {cv2.Rodrigues(from_world[:3, :3])[0].ravel().tolist()}\n"
            f"translation = {from_world[:3, 3].tolist()}\n"
        )
    return "\n".join(tables)


def _motion(data: Path, clip: str, first: int, frames: int) -> tuple[list[poses.Pose], Array]:
    """Poses of a clip, and where its root is (F, 3) in meters, of the clip's own person."""
    stored = np.load(data / "mocap" / "sequences.npz")
    names = [str(name) for name in stored["joint_names"]]
    chosen = stored["positions_m"][stored["clip"] == clip] / 1000.0
    # Frames of the whole clip say what upright is.
    found = poses.from_positions(chosen, names)
    if not all(np.isfinite(pose.pelvis).all() for pose in found):
        raise SystemExit(
            f"{clip}: expected a clip with frames in which somebody stands upright, found none: take another"
        )
    heading = _headings(chosen, names)
    turned = []
    for pose, angle in zip(found, heading, strict=True):
        c, s = np.cos(angle), np.sin(angle)
        turned.append(pose.turned(np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])))
    return turned[first : first + frames], chosen[first : first + frames, names.index("root")]


def _headings(positions: Array, names: list[str]) -> Array:
    lateral = positions[:, names.index("l_hip")] - positions[:, names.index("r_hip")]
    forward = np.cross(lateral, [0, 0, 1.0])
    return np.arctan2(forward[:, 1], forward[:, 0])


def make(
    out: Path,
    data: Path,
    *,
    seed: int,
    clip: str,
    body: int,
    cameras: int,
    first: int,
    frames: int,
    silhouettes: bool,
    alike: bool,
) -> None:
    """Write a recording."""
    rng = np.random.default_rng(seed)
    person = Bodies(data / "bodies", held_out=False)[body]
    motion, roots = _motion(data, clip, first, frames)
    scale = person.stature / 1.75
    surfaces, joints = [], []
    for pose, root in zip(motion, roots, strict=True):
        surface, places = person.posed(pose, np.random.default_rng(seed))
        surfaces.append(surface + scale * root)
        joints.append({name: place + scale * root for name, place in places.items()})
    floor = float(np.median([surface[:, 2].min() for surface in surfaces]))
    middle = np.array([*np.mean([surface.mean(axis=0)[:2] for surface in surfaces], axis=0), 0.0])
    surfaces = [surface - [0, 0, floor] for surface in surfaces]
    joints = [{name: place - [0, 0, floor] for name, place in places.items()} for places in joints]
    appearance, views = _appearance(rng, person, middle, flat=silhouettes, alike=alike), _cameras(rng, cameras, middle)
    (out / "videos").mkdir(parents=True, exist_ok=True)
    (out / "background").mkdir(exist_ok=True)
    (out / "Calib_scene.toml").write_text(_calibration(views))
    for number, camera in enumerate(views):
        for index in range(4):
            empty = _shoot(camera, appearance, None, -0.5 * (index + 1), rng)
            cv2.imwrite(str(out / "background" / f"cam_{number}_{index}.png"), empty)
        film = cv2.VideoWriter(
            str(out / "videos" / f"cam_{number}.avi"), cv2.VideoWriter_fourcc(*"MJPG"), RATE, SIZE[::-1]
        )
        film.set(cv2.VIDEOWRITER_PROP_QUALITY, 85)
        for index, surface in enumerate(surfaces):
            film.write(_shoot(camera, appearance, surface, index / RATE, rng))
        film.release()
    start = {name: [float(value) for value in place] for name, place in joints[0].items()}
    (out / "init.json").write_text(json.dumps({"height_m": round(person.stature, 3), "joints": start}))
    names = list(joints[0])
    rows = [",".join(["stamp_s", *(f"{name}_{axis}" for name in names for axis in "xyz")])]
    for index, places in enumerate(joints):
        values = [index / RATE, *(value for name in names for value in places[name])]
        rows.append(",".join(f"{value:.9f}" for value in values))
    (out / "truth.csv").write_text("\n".join(rows) + "\n")


def main() -> None:
    """Make one recording."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--data", type=Path, default=Path(os.environ.get("VOODOO_DATA", "../shared/data")))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--clip", default="05_18", help="motion, of mocap/sequences.npz")
    parser.add_argument("--body", type=int, default=3, help="number of the body")
    parser.add_argument("--cameras", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="first frame of the clip")
    parser.add_argument("--frames", type=int, default=120)
    parser.add_argument("--silhouettes", action="store_true", help="the person white before black")
    parser.add_argument("--alike", action="store_true", help="the room in the colors of the clothes")
    options = vars(parser.parse_args())
    make(options.pop("out"), options.pop("data"), **options)


if __name__ == "__main__":
    main()
