"""A made-up person in clothes before patterned walls, seen by several color cameras, as a bag and as videos."""

import json
from functools import cache
from pathlib import Path

import cv2
import numpy as np

import voodoo
from bag_writer import Messages, write_bag
from synthetic.sequence import VirtualSequence
from voodoo.synthetic.render import render_depth

M = Messages()
CAMERA = voodoo.Camera(240, 180, 190.0, 190.0, 119.5, 89.5)
RATE = 30.0
START = 100.0
"""Stamp of the first picture [s]; header stamps are above zero."""
TRUTH = tuple(f"{side}_{name}" for name in ("shoulder", "elbow", "wrist", "hip", "knee", "ankle") for side in "lr")
_CLOTHES = {
    "head": (120, 150, 200), "neck": (120, 150, 200), "hand": (110, 140, 205), "forearm": (60, 60, 190),
    "upperarm": (50, 40, 160), "thigh": (150, 70, 40), "calf": (120, 90, 30), "foot": (20, 20, 20), "pelvis": (160, 80, 50),
}  # fmt: skip
_SHIRT = (60, 50, 175)


def sequence(frames):
    # Of the default human, hanging arms touch the trunk: no outline separates them.
    return VirtualSequence(body=voodoo.Body.human(1.75, model="full"), frames=frames, speed=3.0, seed=4)


@cache
def pose(number):
    """world_from_sensor of the cameras around the person, 90 degrees apart, who stands at x = 2.4."""
    around = np.radians((15.0, 100.0, 195.0, 280.0)[number])
    target = np.array([2.4, 0.0, 0.95])
    place = target + (2.9 * np.cos(around), 2.9 * np.sin(around), 0.3 + 0.1 * number)
    z = (target - place) / np.linalg.norm(target - place)
    x = np.cross(z, (0.0, 0.0, 1.0))
    x /= np.linalg.norm(x)
    found = np.eye(4)
    found[:3] = np.column_stack([x, np.cross(z, x), z, place])
    return found


@cache
def wall(number):
    """What a camera sees without anybody: gray-green patches."""
    chance = np.random.default_rng(number)
    patches = chance.integers(90, 170, (9, 12, 3)) * np.array([0.9, 1.0, 0.8])
    return cv2.resize(patches.astype(np.uint8), (CAMERA.width, CAMERA.height), interpolation=cv2.INTER_CUBIC)


def picture(scene, number, time):
    """(H, W, 3) BGR of a camera at a time [s]."""
    poses, _ = scene.truth(time)
    observed = render_depth(scene.body, poses, camera=CAMERA, world_from_sensor=pose(number))
    colors = np.array([_CLOTHES.get(name.split("_")[-1], _SHIRT) for name in observed.limb_names])
    image = wall(number).copy()
    image[observed.limb >= 0] = colors[observed.limb[observed.limb >= 0]]
    noise = np.random.default_rng((number, round(1e4 * time))).normal(0.0, 2.0, image.shape)
    return np.clip(cv2.GaussianBlur(image, (0, 0), 0.6) + noise, 0, 255).astype(np.uint8)


@cache
def pictures(frames, cameras, later):
    """Pictures [frame][camera] of the scene, each camera `later` seconds after the one before."""
    scene = sequence(frames)
    return [[picture(scene, n, k / RATE + n * later) for n in range(cameras)] for k in range(frames)]


def info_of(stamp, number, camera=CAMERA):
    info = M.camera_info(stamp, frame=f"cam_{number}_optical_frame", width=camera.width, height=camera.height)
    info.k[:] = camera.matrix.ravel()
    info.p[:] = np.hstack([camera.matrix, np.zeros((3, 1))]).ravel()
    return info


def transforms(cameras, parent="world"):
    from scipy.spatial.transform import Rotation

    edges = [
        (START, parent, f"cam_{n}_optical_frame", pose(n)[:3, 3], Rotation.from_matrix(pose(n)[:3, :3]).as_quat())
        for n in cameras
    ]
    return ("/tf_static", START, M.tf(*edges))


def bag_entries(frames, cameras=4, later=0.0):
    """What is in the bag of the scene, camera after camera for each instant."""
    entries = [transforms(range(cameras))]
    for k, row in enumerate(pictures(frames, cameras, later)):
        for n, image in enumerate(row):
            stamp = START + k / RATE + n * later
            entries.append((f"/cam_{n}/camera_info", stamp, info_of(stamp, n)))
            jpeg = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, 90])[1].tobytes()
            message = M.compressed(stamp, jpeg, "bgr8; jpeg compressed bgr8", frame=f"cam_{n}_optical_frame")
            entries.append((f"/cam_{n}/image_raw/compressed", stamp, message))
    return entries


def write_beside(folder, frames, cameras=4, first=START, background=True):
    """init.json, truth.csv and pictures of the empty scene."""
    scene = sequence(frames)
    sites = [scene.truth(k / RATE)[1] for k in range(frames)]
    joints = {name: [float(value) for value in sites[0][name]] for name in (*TRUTH, "vc7", "head_center")}
    (folder / "init.json").write_text(json.dumps({"height_m": 1.75, "joints": joints}))
    rows = [",".join(["stamp_s", *(f"{name}_{axis}" for name in TRUTH for axis in "xyz")])]
    for k, places in enumerate(sites):
        values = [first + k / RATE, *(value for name in TRUTH for value in places[name])]
        rows.append(",".join(f"{value:.9f}" for value in values))
    (folder / "truth.csv").write_text("\n".join(rows) + "\n")
    if background:
        (folder / "background").mkdir()
        for n in range(cameras):
            for k in range(2):
                cv2.imwrite(str(folder / "background" / f"cam_{n}_{k}.png"), wall(n))


def write_color_bag(folder, frames=12, cameras=4, later=0.0, **beside):
    """The scene as a bag with all that lies beside it; its folder."""
    folder.mkdir(parents=True, exist_ok=True)
    write_bag(folder / "bag", bag_entries(frames, cameras, later))
    write_beside(folder, frames, cameras, **beside)
    return folder


def calibration(cameras, names="cam_{}"):
    """A Calib.toml of the cameras."""
    tables = []
    for n in range(cameras):
        from_world = np.linalg.inv(pose(n))
        rotation = cv2.Rodrigues(from_world[:3, :3])[0].ravel().tolist()
        tables.append(
            f'[{names.format(n)}]\nname = "{names.format(n)}"\nsize = [{CAMERA.width}.0, {CAMERA.height}.0]\n'
            f"matrix = {CAMERA.matrix.tolist()}\ndistortions = [0.0, 0.0, 0.0, 0.0]\nrotation = {rotation}\n"
            f"translation = {from_world[:3, 3].tolist()}\n"
        )
    return "\n".join(tables)


def write_video(path: Path, images, rate=RATE):
    path.parent.mkdir(parents=True, exist_ok=True)
    film = cv2.VideoWriter(str(path), cv2.VideoWriter_fourcc(*"MJPG"), rate, images[0].shape[1::-1])
    assert film.isOpened()
    for image in images:
        film.write(image)
    film.release()


def write_videos(folder, frames=12, cameras=4, **beside):
    """The scene as a folder of videos with all that lies beside them; the folder."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "Calib_scene.toml").write_text(calibration(cameras))
    rows = pictures(frames, cameras, 0.0)
    for n in range(cameras):
        write_video(folder / "videos" / f"cam{n}.avi", [row[n] for row in rows])
    write_beside(folder, frames, cameras, first=0.0, **beside)
    return folder
