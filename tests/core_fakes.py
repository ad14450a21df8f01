"""Stand-ins for the compiled core, so that the code around it is tested on known poses."""

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

import voodoo
from voodoo.errors import VoodooError
from voodoo.model.camera import Camera
from voodoo.model.projection import CameraView, body_mask
from voodoo.recordings import DepthImage, LaserScan, RecordedFrame, Recording, RecordingInfo, Reference

BONES = {
    "torso": ("humanoid_root", "vc7", 0.16, 0.11, 0.19, 0.11),
    "head": ("skullbase", "skull_tip", 0.07, 0.08, 0.08, 0.09),
    **{
        f"{s}_{name}": (f"{s}_{a}", f"{s}_{b}", *girth)
        for s in "lr"
        for name, a, b, girth in (
            ("upperarm", "shoulder", "elbow", (0.055, 0.055, 0.045, 0.045)),
            ("forearm", "elbow", "wrist", (0.045, 0.045, 0.03, 0.035)),
            ("thigh", "hip", "knee", (0.085, 0.085, 0.055, 0.06)),
            ("calf", "knee", "ankle", (0.06, 0.06, 0.04, 0.045)),
        )
    },
}

T_POSE = {
    "humanoid_root": (3.0, 0.0, 0.95), "vc7": (3.0, 0.0, 1.45), "skullbase": (3.0, 0.0, 1.52),
    "skull_tip": (3.0, 0.0, 1.76),
    "l_shoulder": (3.0, -0.2, 1.4), "l_elbow": (3.0, -0.5, 1.4), "l_wrist": (3.0, -0.76, 1.4),
    "r_shoulder": (3.0, 0.2, 1.4), "r_elbow": (3.0, 0.5, 1.4), "r_wrist": (3.0, 0.76, 1.4),
    "l_hip": (3.0, -0.1, 0.92), "l_knee": (3.0, -0.12, 0.5), "l_ankle": (3.0, -0.14, 0.08),
    "r_hip": (3.0, 0.1, 0.92), "r_knee": (3.0, 0.12, 0.5), "r_ankle": (3.0, 0.14, 0.08),
}  # fmt: skip
"""A person in front of base_link who faces the robot: left is at negative y."""


@dataclass(frozen=True)
class Shape:
    length: float
    a0: float
    b0: float
    a1: float
    b1: float


@dataclass(frozen=True)
class Limb:
    name: str
    parent: str | None
    shape: Shape


@dataclass(frozen=True)
class Estimate:
    stamp: float
    joints: dict
    world_from_limb: dict
    status: str = "tracking"
    residual: float = 0.012
    limb_points: dict = field(default_factory=dict)
    limb_status: dict = field(default_factory=dict)
    joint_covariances: np.ndarray = field(default_factory=lambda: np.empty((0, 3, 3)))
    root_covariance: object = field(default_factory=lambda: np.full((6, 6), np.nan))
    joint_sigma: dict = field(default_factory=dict)

    @property
    def joint_names(self):
        return tuple(self.joints)

    @property
    def limb_names(self):
        return tuple(self.world_from_limb)

    @property
    def joint_positions(self):
        return np.array(list(self.joints.values())).reshape(-1, 3)

    @property
    def limb_poses(self):
        return np.array(list(self.world_from_limb.values())).reshape(-1, 4, 4)


def searching(stamp):
    return Estimate(stamp, {}, {}, "searching", float("nan"))


class Body:
    def __init__(self, limbs=()):
        self.limbs = tuple(limbs)
        self.limb_names = tuple(limb.name for limb in self.limbs)
        self.site_names = tuple(T_POSE)

    @classmethod
    def human(cls, height=1.75, *, model="full"):
        body = cls()
        body.height = height
        return body

    def to_toml(self):
        return f"height_m = {self.height}\n"


class Config:
    def to_toml(self):
        return "max_steps = 5\n"


def pose(joints, stamp=0.0, **fields):
    """Body and estimate whose limbs run exactly between the named joints."""
    joints = {name: np.asarray(position, dtype=float) for name, position in joints.items()}
    across = joints["l_shoulder"] - joints["r_shoulder"]
    limbs, poses = [], {}
    for name, (start, end, a0, b0, a1, b1) in BONES.items():
        z = joints[end] - joints[start]
        length = float(np.linalg.norm(z))
        z = z / length
        y = np.cross(z, across if abs(z @ across) < 0.9 * np.linalg.norm(across) else (1.0, 0.0, 0.0))
        y /= np.linalg.norm(y)
        transform = np.eye(4)
        transform[:3, :3] = np.column_stack([np.cross(y, z), y, z])
        transform[:3, 3] = joints[start]
        limbs.append(Limb(name, None, Shape(length, a0, b0, a1, b1)))
        poses[name] = transform
    return Body(limbs), Estimate(stamp, joints, poses, **fields)


class Frame:
    def __init__(self, *, stamp):
        self.stamp, self.calls, self.excluded = stamp, [], []

    def add_depth(self, image, **options):
        self.calls.append(("depth", image.shape, options))

    def add_points(self, points, **options):
        self.calls.append(("points", points.shape, options))

    def exclude(self, low, high):
        self.excluded.append((low, high))

    def set_ground(self, **options):
        self.ground = options


class Tracker:
    """Knows the answer: stands in `reference` displaced by `offset`, or stays where it was reset to.

    Without a reset it finds the person in frame `found_at`, and in frame `gone_at` the person is gone.
    """

    _core = voodoo.Tracker(voodoo.Body.human())._core
    """Of a body that has no pose: nothing is known of its motion."""
    can_search, detector_failures, refusal = True, 0, None
    reference = None
    offset = (0.0, 0.0, 0.0)
    found_at = None
    gone_at = None
    refuse_at = None
    refused = None
    interrupt_at = None

    def __init__(self, body, *, config, detector="shipped"):
        self.initial, self.config, self.frames = body, config, []
        self.search()

    def search(self):
        self.body, self.estimate, self.was_reset = self.initial, searching(float("nan")), False

    def reset(self, *, joints, fit_sizes):
        unknown = set(joints) - set(T_POSE) - {"l_hand", "r_hand", "head_center", "l_toe", "r_toe"}
        if unknown:
            raise VoodooError(f"joints: unknown site {sorted(unknown)[0]!r}")
        self.body, self.estimate = pose({**T_POSE, **joints})
        self.was_reset = True
        return self.estimate

    def step(self, frame):
        if self.refuse_at == len(self.frames) and self.refused in (None, frame.stamp):
            self.refused = frame.stamp
            raise VoodooError("points: expected finite numbers, found NaN")
        if self.interrupt_at == len(self.frames):
            raise KeyboardInterrupt
        self.frames.append(frame)
        type(self).last = frame
        if not self.was_reset:
            number = len(self.frames) - 1
            there = self.found_at is not None and number >= self.found_at
            if not there or (self.gone_at is not None and number >= self.gone_at):
                self.estimate = searching(frame.stamp)
                return self.estimate
        joints = self.estimate.joints or {name: np.asarray(place, dtype=float) for name, place in T_POSE.items()}
        if self.reference is not None:
            row = int(np.argmin(np.abs(self.reference.stamps - frame.stamp)))
            joints = {**joints, **dict(zip(self.reference.names, self.reference.positions[row], strict=True))}
            joints = {name: position + np.asarray(self.offset) for name, position in joints.items()}
        self.body, self.estimate = pose(joints, frame.stamp)
        return self.estimate

    def predict(self, stamp):
        """Everybody stays where they are."""
        return dict(self.estimate.joints)

    def distance(self, points):
        """Signed distance to cylinders of mean girth without ends: enough to tell near from far."""
        best = np.full(len(points), np.inf)
        for limb in self.body.limbs:
            transform = self.estimate.world_from_limb[limb.name]
            local = (points - transform[:3, 3]) @ transform[:3, :3]
            t = np.clip(local[:, 2] / limb.shape.length, 0.0, 1.0)
            a = limb.shape.a0 + (limb.shape.a1 - limb.shape.a0) * t
            b = limb.shape.b0 + (limb.shape.b1 - limb.shape.b0) * t
            local[:, 2] -= t * limb.shape.length
            best = np.minimum(best, np.linalg.norm(local, axis=1) - (a + b) / 2.0)
        return best.astype(np.float32)


CAMERA = Camera(width=80, height=60, fx=60.0, fy=60.0, cx=39.5, cy=29.5)
BASE_FROM_CAMERA = np.array([[0.0, 0.0, 1.0, 0.0], [-1.0, 0.0, 0.0, 0.0], [0.0, -1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
"""One meter above base_link, looking along its x."""


def depth_of(joints, stamp=0.0):
    """The body as a flat depth image at its mean distance, nothing around it."""
    body, estimate = pose(joints)
    mask = body_mask(body, estimate, CameraView(CAMERA, BASE_FROM_CAMERA), width=80, height=60)
    millimeters = round(1000.0 * float(np.mean([position[0] for position in joints.values()])))
    image = np.where(mask, millimeters, 0).astype(np.uint16)
    return DepthImage("depth", stamp, image, 0.001, CAMERA, BASE_FROM_CAMERA)


def scan_at(stamp):
    return LaserScan("scan", stamp, np.full(11, 3.0, np.float32), -0.5, 0.1, 0.1, 10.0, np.eye(4))


class FakeRecording(Recording):
    """A person who moves forward 1 cm a frame at 30 Hz, with or without depth, laser, start and truth."""

    def __init__(self, path=Path("fake"), *, frames=40, exact=True, start=True, depth=True, loader="ros2"):
        self.path, self.name, self.root_frame = Path(path), Path(path).name, "base_link"
        self.stamps = 1700200000.0 + np.arange(frames) / 30.0
        self.depth, self.loader = depth, loader
        names = tuple(T_POSE)
        positions = np.array(list(T_POSE.values()))[None] + np.arange(frames)[:, None, None] * (0.01, 0.0, 0.0)
        self.reference = None if exact is None else Reference(self.stamps, names, positions, exact)
        self.start = {"height_m": 1.76, "joints": dict(T_POSE)} if start else None

    def __len__(self):
        return len(self.stamps)

    def __iter__(self):
        for index, stamp in enumerate(self.stamps):
            joints = {name: np.add(position, (0.01 * index, 0.0, 0.0)) for name, position in T_POSE.items()}
            yield RecordedFrame(float(stamp), (depth_of(joints, stamp),) if self.depth else (scan_at(stamp),))

    def info(self):
        duration = float(self.stamps[-1] - self.stamps[0])
        return RecordingInfo(
            self.name, self.path, self.loader, len(self), float(self.stamps[0]), duration, 30.0, self.root_frame, ()
        )


def install(monkeypatch):
    """Put the stand-ins where the package looks for the core."""
    import voodoo.cli.running
    import voodoo.evaluation.evaluate
    import voodoo.export.spool
    import voodoo.pipeline.front_end
    import voodoo.pipeline.start
    from voodoo.export import track as results

    # The fake body has no joints to take angles from.
    monkeypatch.setattr(results, "Chain", lambda body: body)
    monkeypatch.setattr(results, "angle_names_of", lambda body: ("l_elbow_flexion",))
    monkeypatch.setattr(results, "angles_of", lambda chain, estimate: np.array([0.25]))
    tracker = type("FreshTracker", (Tracker,), {})
    fakes = {"Body": Body, "Config": Config, "Frame": Frame, "Tracker": tracker}
    places = (
        (voodoo, "Body Config Frame Tracker"),
        (voodoo.model.body, "Body"),
        (voodoo.config, "Config"),
        (voodoo.pipeline.start, "Body Config Tracker"),
        (voodoo.pipeline.front_end, "Frame"),
        (voodoo.cli.running, "Config"),
        (voodoo.evaluation.evaluate, "Config"),
    )
    for module, names in places:
        for name in names.split():
            monkeypatch.setattr(module, name, fakes[name], raising=False)
    return tracker
