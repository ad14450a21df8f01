"""Small sound samples of everything that voodoo reads, and how each is opened; calls of the Python API with odd arguments."""

from __future__ import annotations

import importlib.util
import json
import zipfile
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path
from random import Random
from typing import Any

import cv2
import numpy as np
import scipy.io

import fuzz_structures
import voodoo
from bag_writer import Messages, write_bag
from mcap_writer import write_mcap
from scene import standing_joints
from voodoo import ik
from voodoo.export.track import Track
from voodoo.pipeline.start import Init
from voodoo.recordings import ColorImage, open_recording
from voodoo.recordings.left_out import LeftOut
from voodoo.recordings.marker_files import MarkerMap

DEPTH = np.add.outer(np.arange(12), 100 * np.arange(16)).astype(np.uint16)
CALIBRATION = "width = 16\nheight = 12\nfx = 20.0\nfy = 20.0\ncx = 7.5\ncy = 5.5\ndistortion = [0.1, -0.05, 0.0, 0.0]\n"
JOINTS = {
    "l_hip": [2.0, 0.1, 0.9],
    "r_hip": [2.0, -0.1, 0.9],
    "l_shoulder": [2.0, 0.2, 1.4],
    "r_shoulder": [2.0, -0.2, 1.4],
}


@dataclass(frozen=True)
class Sample:
    """Writes its files into a folder; `mutated` are those that are damaged, `open` reads all there is, `damage` knows their
    structure."""

    make: Callable[[Path], None]
    mutated: tuple[str, ...]
    open: Callable[[Path, bool], Any]
    text: bool = False
    damage: Callable[[bytes, Random], bytes] | None = None


def read_all(path: Path, lenient: bool) -> None:
    recording = open_recording(path, left_out=LeftOut() if lenient else None)
    str(recording.info())
    for recorded in recording:
        for item in recorded.measurements:
            if isinstance(item, ColorImage):
                _ = item.image.shape


def inside(name: str) -> Callable[[Path, bool], None]:
    return lambda folder, lenient: read_all(folder / name, lenient)


def bag(folder: Path, *, storage: str = "mcap", ros: int = 2) -> Path:
    m = Messages(ros)
    stamps = [10.0 + k / 30 for k in range(4)]
    table = np.zeros(5, dtype=[("x", "f4"), ("y", "f4"), ("z", "f4")])
    fields = [("x", 0, 7), ("y", 4, 7), ("z", 8, 7)]
    size = {"width": 16, "height": 12}
    png = b"\0" * 12 + cv2.imencode(".png", DEPTH)[1].tobytes()
    jpg = cv2.imencode(".jpg", np.full((12, 16, 3), 90, np.uint8))[1].tobytes()
    entries = [("/tf_static", 10.0, m.tf((10.0, "base_link", "cam", (0, 0, 1), (0, 0, 0, 1))))]
    entries += [("/d/depth/camera_info", 10.0, m.camera_info(10.0, **size))]
    entries += [("/c/color/camera_info", 10.0, m.camera_info(10.0, **size, d=(0.1, 0.0, 0.0, 0.0, 0.0)))]
    for s in stamps:
        entries += [("/d/depth/image", s, m.image(s, DEPTH, "16UC1"))]
        entries += [("/c/color/image/compressed", s, m.compressed(s, jpg, "jpeg"))]
        entries += [("/points", s, m.cloud(s, table, fields)), ("/scan", s, m.scan(s, [1.0, 2.0], frame="cam"))]
        entries += [("/z/depth/image/compressedDepth", s, m.compressed(s, png, "16UC1; compressedDepth png"))]
    entries = [entry for entry in entries if not entry[0].startswith("/z") or storage == "sqlite3"]
    if storage == "sqlite3":
        entries = [entry for entry in entries if not entry[0].startswith("/d/depth/image")]
        entries += [("/z/depth/camera_info", 10.0, m.camera_info(10.0, **size))]
    path = folder / ("b.bag" if ros == 1 else "b")
    return write_bag(path, entries, storage=storage, ros=ros)


def storage(name: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        written = bag(folder, storage=name)
        part = next(item for item in written.iterdir() if item.suffix in (".mcap", ".db3"))
        part.rename(folder / f"b{part.suffix}")
        (written / "metadata.yaml").unlink()
        written.rmdir()

    return make


def chunked(**how: Any) -> Callable[[Path], None]:
    """An MCAP file of several chunks."""

    def make(folder: Path) -> None:
        m = Messages()
        info = [("/d/depth/camera_info", 10.0, m.camera_info(10.0, width=16, height=12))]
        images = [[("/d/depth/image", 10.0 + k / 30, m.image(10.0 + k / 30, DEPTH, "16UC1"))] for k in range(4)]
        write_mcap(folder / "b.mcap", [info, *images], **how)

    return make


def zipped(folder: Path) -> None:
    written = bag(folder)
    with zipfile.ZipFile(folder / "b.zip", "w", zipfile.ZIP_DEFLATED) as archive:
        for part in sorted(written.iterdir()):
            archive.write(part, part.name)
            part.unlink()
    written.rmdir()


def folder_of_images(folder: Path) -> None:
    for name, suffix, image in (("depth", ".png", DEPTH), ("rgb", ".jpg", np.full((12, 16, 3), 90, np.uint8))):
        (folder / name).mkdir()
        for number in range(2):
            cv2.imwrite(str(folder / name / f"{number}.5{suffix}"), image)
    (folder / "depth.txt").write_text("0.5 depth/0.5.png\n1.5 depth/1.5.png\n")
    (folder / "calibration.toml").write_text(CALIBRATION + "depth_factor = 1000.0\n[color]\n" + CALIBRATION)


def matlab(folder: Path) -> None:
    (folder / "Depth").mkdir()
    (folder / "Skeleton").mkdir()
    depth = np.broadcast_to(np.arange(320, dtype=np.uint16)[None, :, None], (240, 320, 2))
    scipy.io.savemat(folder / "Depth" / "a_depth.mat", {"d_depth": depth}, do_compression=True)
    skeleton = np.linspace(-1.0, 1.0, 120).reshape(20, 3, 2)
    scipy.io.savemat(folder / "Skeleton" / "a_skeleton.mat", {"d_skel": skeleton}, do_compression=False)


TRC = (
    "PathFileType\t4\t(X/Y/Z)\tx.trc\n"
    "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\n"
    "100\t100\t2\t2\tmm\t100\t1\t2\nFrame#\tTime\tl_wrist\t\t\tr_wrist\t\t\n\t\tX1\tY1\tZ1\tX2\tY2\tZ2\n\n"
    "1\t0.00\t1\t2\t3\t4\t5\t6\n2\t0.01\t1\t2\t3\t\t\t\n"
)


def c3d_file(folder: Path) -> None:
    content = (Path(__file__).parent / "data" / "x.c3d").read_bytes()
    (folder / "x.c3d").write_bytes(content.replace(b"LWRA", b"vc7 "))  # a marker that stands for a site


def pose2sim(folder: Path) -> None:
    camera = "size = [640.0, 480.0]\nmatrix = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]\n"
    camera += "distortions = [0.0, 0.0, 0.0, 0.0]\nrotation = [0.1, 0.2, 0.3]\ntranslation = [0.0, 0.0, 3.0]\n"
    (folder / "Calib_x.toml").write_text(f"[a]\n{camera}[b]\n{camera}")
    person = {"people": [{"pose_keypoints_2d": [320.0, 240.0, 0.9] * 25}]}
    for name in "ab":
        (folder / "keypoints" / f"{name}_json").mkdir(parents=True)
        (folder / "keypoints" / f"{name}_json" / "0.json").write_text(json.dumps(person))


def videos(folder: Path) -> None:
    camera = "size = [16.0, 12.0]\nmatrix = [[20.0, 0.0, 7.5], [0.0, 20.0, 5.5], [0.0, 0.0, 1.0]]\n"
    camera += "distortions = [0.0, 0.0, 0.0, 0.0]\nrotation = [0.1, 0.2, 0.3]\ntranslation = [0.0, 0.0, 3.0]\n"
    (folder / "Calib_x.toml").write_text(f"[a]\n{camera}[b]\n{camera}")
    (folder / "videos").mkdir()
    for name in "ab":
        film = cv2.VideoWriter(str(folder / "videos" / f"{name}.avi"), cv2.VideoWriter_fourcc(*"MJPG"), 30.0, (16, 12))
        for level in range(3):
            film.write(np.full((12, 16, 3), 60 * level, np.uint8))
        film.release()


def beside(folder: Path) -> None:
    bag(folder)
    (folder / "init.json").write_text(json.dumps({"height_m": 1.7, "frame": "cam", "joints": JOINTS}))
    (folder / "truth.csv").write_text("stamp_s,l_hip_x,l_hip_y,l_hip_z\n10.0,1,2,3\n10.1,1,2,\n")


def result(suffix: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        body = voodoo.Body.human(1.7, model="papers")
        tracker = voodoo.Tracker(body)
        tracker.reset(joints=standing_joints(body))
        estimates = []
        for number in range(2):
            frame = voodoo.Frame(stamp=number / 30)
            frame.add_position("l_wrist", standing_joints(body)["l_wrist"])
            estimates.append(tracker.step(frame))
        Track.of(estimates, body=body, left_out={"that are blank": 2}).save(folder / f"x{suffix}")

    return make


def written(name: str, text: str) -> Callable[[Path], None]:
    def make(folder: Path) -> None:
        (folder / name).write_text(text, encoding="utf-8")

    return make


def realsense(folder: Path) -> None:
    source = Path(__file__).parent / "data" / "realsense"
    for name in ("recorded_2_55.bag", "recorded_2_59.db3"):
        (folder / name).write_bytes((source / name).read_bytes())


def azure_kinect(folder: Path) -> None:
    """A .mkv of the smallest mode, without color; needs PyAV."""
    import av

    film = av.open(str(folder / "x.mkv"), "w", format="matroska", options={"allow_raw_vfw": "1"})
    track = film.add_stream("rawvideo", rate=30)
    track.width, track.height, track.pix_fmt, track.codec_context.codec_tag = 320, 288, "gray16be", "b16g"
    track.metadata.update({"title": "DEPTH", "K4A_DEPTH_MODE": "NFOV_2X2BINNED"})
    lens = {"ModelParameters": [0.5, 0.5, 0.5, 0.5, 0.5, 0, 0, 0.9, 0.1, 0, 0, 0, 0, 0]}
    cameras = [{"Purpose": "CALIBRATION_CameraPurposeDepth", "Intrinsics": lens}]
    content = json.dumps({"CalibrationInformation": {"Cameras": cameras}}).encode()
    film.add_attachment("calibration.json", "application/octet-stream", content)
    for number in range(2):
        packet = av.Packet(np.full((288, 320), 1500, ">u2").tobytes())
        packet.stream, packet.time_base, packet.is_keyframe = track, Fraction(1, 1000), True
        packet.pts = packet.dts = 33 * number
        film.mux(packet)
    film.close()


SMALL_BODY = voodoo.Body.human(1.7, model="papers").to_toml()
MAP = (
    'y_up = true\nsigma_m = 0.02\n[sites]\nA = "l_wrist"\n[limbs]\nB = { limb = "head", position = [0.0, 0.1, 0.0] }\n'
)
SAMPLES: dict[str, Sample] = {
    "mcap": Sample(storage("mcap"), ("b.mcap",), inside("b.mcap"), damage=fuzz_structures.mcap),
    "mcap packed": Sample(chunked(), ("b.mcap",), inside("b.mcap"), damage=fuzz_structures.mcap),
    "mcap plain": Sample(
        chunked(compression="", checksum=False), ("b.mcap",), inside("b.mcap"), damage=fuzz_structures.mcap
    ),
    "db3": Sample(storage("sqlite3"), ("b.db3",), inside("b.db3"), damage=fuzz_structures.sqlite),
    "metadata.yaml": Sample(lambda f: void(bag(f)), ("b/metadata.yaml",), inside("b"), text=True),
    "ros1 bag": Sample(lambda f: void(bag(f, ros=1)), ("b.bag",), inside("b.bag"), damage=fuzz_structures.ros1),
    "realsense bag": Sample(
        realsense, ("recorded_2_55.bag",), inside("recorded_2_55.bag"), damage=fuzz_structures.ros1
    ),
    "realsense db3": Sample(
        realsense, ("recorded_2_59.db3",), inside("recorded_2_59.db3"), damage=fuzz_structures.sqlite
    ),
    "zip": Sample(zipped, ("b.zip",), inside("b.zip")),
    "pictures": Sample(folder_of_images, ("depth/0.5.png", "rgb/0.5.jpg"), inside("")),
    "calibration.toml": Sample(folder_of_images, ("calibration.toml",), inside(""), text=True),
    "depth.txt": Sample(folder_of_images, ("depth.txt",), inside(""), text=True),
    "mat": Sample(matlab, ("Depth/a_depth.mat", "Skeleton/a_skeleton.mat"), inside("Depth/a_depth.mat")),
    "c3d": Sample(c3d_file, ("x.c3d",), inside("x.c3d")),
    "trc": Sample(written("x.trc", TRC), ("x.trc",), inside("x.trc"), text=True),
    "pose2sim": Sample(pose2sim, ("Calib_x.toml", "keypoints/a_json/0.json"), inside(""), text=True),
    "videos": Sample(videos, ("videos/a.avi",), inside("")),
    "init, truth": Sample(beside, ("init.json", "truth.csv"), inside("b"), text=True),
    "init": Sample(
        written("x.json", json.dumps({"height_m": 1.7, "stamp_s": 1.0, "joints": JOINTS})),
        ("x.json",),
        lambda folder, _: Init.load(folder / "x.json"),
        text=True,
    ),
    "result csv": Sample(result(".csv"), ("x.csv",), lambda folder, _: Track.load(folder / "x.csv"), text=True),
    "result npz": Sample(result(".npz"), ("x.npz",), lambda folder, _: Track.load(folder / "x.npz")),
    "body": Sample(written("x.toml", SMALL_BODY), ("x.toml",), lambda f, _: voodoo.Body.load(f / "x.toml"), text=True),
    "config": Sample(
        written("x.toml", voodoo.Config().to_toml()),
        ("x.toml",),
        lambda f, _: voodoo.Config.load(f / "x.toml"),
        text=True,
    ),
    "marker map": Sample(written("x.toml", MAP), ("x.toml",), lambda f, _: MarkerMap.load(f / "x.toml"), text=True),
}
if importlib.util.find_spec("av"):
    SAMPLES["azure kinect"] = Sample(azure_kinect, ("x.mkv",), inside("x.mkv"))


def void(_: object) -> None:
    """What is made is in the folder."""


NUMBERS: tuple[Any, ...] = (
    0, -1, 1, 0.5, -0.0, float("nan"), float("inf"), -float("inf"), 1e300, -1e300, 1e-300, 10**400, 2**31, 2**63, True,
)  # fmt: skip
SANE = (0.1, 0.3, 1.7, 3, 12)
THINGS: tuple[Any, ...] = (
    None,
    "x",
    "",
    b"x",
    [],
    {},
    (),
    object(),
    [1, 2],
    {"a": 1},
    np.zeros(3),
    np.zeros((0, 3)),
    print,
)


def any_thing(rng: Random) -> Any:
    """A number, or what is none."""
    return rng.choice(rng.choice((NUMBERS, NUMBERS, SANE, SANE, THINGS)))


def array(rng: Random) -> Any:
    """An array of any shape and kind, and now and then something else."""
    if rng.random() < 0.2:
        return any_thing(rng)
    shape = rng.choice(((3,), (5, 3), (0, 3), (4, 4), (12, 16), (12, 16, 3), (), (2, 2, 2), (3, 5)))
    kind = rng.choice(("f8", "f4", "u2", "u1", "i8", "?", "c16", "M8[s]", "U3", "O"))
    if kind in ("M8[s]", "U3", "O"):
        return np.zeros(shape, dtype=kind)
    found = np.ones(shape).astype(kind)
    if found.size and kind in ("f8", "f4") and rng.random() < 0.7:
        found.reshape(-1)[rng.randrange(found.size)] = max(min(float(rng.choice(NUMBERS[:11])), 3e38), -3e38)
    return (
        np.eye(4) if shape == (4, 4) and rng.random() < 0.5 else found[::-1] if shape and rng.random() < 0.2 else found
    )


def call(rng: Random) -> None:
    """One call of the public API with arguments of any kind."""
    a, b, c = (any_thing(rng) for _ in range(3))
    camera = voodoo.Camera(16, 12, 20.0, 20.0, 7.5, 5.5)
    body = BODY
    frame = voodoo.Frame(stamp=1.0)
    joints = dict(JOINTS) | {"l_wrist": rng.choice(([a, 0, 0], a, array(rng)))}
    chain = CHAIN
    calls: tuple[Callable[[], Any], ...] = (
        lambda: voodoo.Camera(a, b, 20.0, c, 1.0, 1.0),
        lambda: voodoo.Camera(16, 12, 20.0, 20.0, a, b, c),
        lambda: voodoo.Camera(16, 12, 20.0, 20.0, 1.0, 1.0, (0.1, 0.0, 0.0, 0.0), a),
        lambda: voodoo.Camera.from_camera_info(width=a, height=12, k=array(rng), d=b, model=c),
        lambda: camera.project(array(rng)),
        lambda: voodoo.Body.human(a),
        lambda: voodoo.Body.human(1.7, model=a),
        lambda: voodoo.Body.load(a),
        lambda: voodoo.Body.from_toml(a),
        lambda: voodoo.Config.load(a),
        lambda: voodoo.Config(max_steps=a, threads=1, point_sigma=b),
        lambda: voodoo.Config(solver=a),
        lambda: voodoo.TaperedEllipticCylinder(a, b, 0.1, c, 0.1),
        lambda: voodoo.Joint(name=a, weight=b, semi_axes=c),
        lambda: voodoo.Place(position=a, rotation=b),
        lambda: body.scaled(a),
        lambda: voodoo.Tracker(a, config=b),
        lambda: voodoo.Tracker(body).reset(joints=joints, fit_sizes=rng.random() < 0.5),
        lambda: voodoo.Tracker(body).reset(joints=a),
        lambda: voodoo.Tracker(body).reset_pose(a),
        lambda: voodoo.Tracker(body).reset_pose(dict.fromkeys(body.limb_names, array(rng))),
        lambda: voodoo.Tracker(body).scale(a),
        lambda: voodoo.Tracker(body).set_shape("head", a),
        lambda: voodoo.Tracker(body).add_limb("box", parent="head", shape=a, joint=b, sites=c),
        lambda: voodoo.Tracker(body).distance(array(rng)),
        lambda: voodoo.Tracker(body).step(a),
        lambda: voodoo.Frame(stamp=a),
        lambda: frame.add_points(array(rng), weight=a, world_from_sensor=array(rng)),
        lambda: frame.add_depth(array(rng), camera=camera, meters_per_unit=a),
        lambda: frame.add_depth(array(rng), camera=a),
        lambda: frame.add_position("l_wrist", array(rng), weight=a, bias=b),
        lambda: frame.add_ray("l_wrist", origin=array(rng), direction=a),
        lambda: frame.add_detection({"l_wrist": array(rng)}, log_odds=a, weight=b),
        lambda: frame.add_detection(c, weight=a),
        lambda: frame.set_ground(normal=array(rng), offset=a),
        lambda: frame.exclude(array(rng), a),
        lambda: voodoo.render_depth(
            body, dict.fromkeys(body.limb_names, array(rng)), camera=camera, world_from_sensor=a
        ),
        lambda: ik.Chain(a),
        lambda: ik.Chain(body, limbs=a),
        lambda: ik.Chain(body, limbs=("head",), root=a),
        lambda: ik.Options(steps=a, tolerance=b, bones=c),
        lambda: ik.Target.at("l_wrist", a, weight=b, priority=c),
        lambda: ik.Target.on_ray("l_wrist", origin=a, direction=b),
        lambda: ik.solve(chain, {"l_wrist": array(rng)}),
        lambda: ik.solve(chain, a),
        lambda: ik.solve(chain, {"l_wrist": (0.3, 0.3, 1.0)}, start=array(rng)),
        lambda: chain.forward(array(rng)),
        lambda: chain.project(dict.fromkeys(body.limb_names, array(rng))),
        lambda: ik.Silhouette(array(rng), camera=camera, world_from_camera=array(rng), border=a),
        lambda: open_recording(a),
        lambda: Track.load(a),
    )
    chosen = rng.choice(calls)
    chosen()
    if chosen in calls[27:34] and rng.random() < 0.5:
        tracker = voodoo.Tracker(body)
        tracker.reset(joints=JOINTS)
        assert np.isfinite(tracker.step(frame).joint_positions).all()


BODY = voodoo.Body.human(1.7, model="papers")
CHAIN = ik.Chain(BODY)
