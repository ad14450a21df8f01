"""A RealSense camera without hardware: the maker's software device, fed with a rendered person. Needs pyrealsense2."""

from __future__ import annotations

import threading
import time

import numpy as np

import voodoo

W, H = 640, 480
CAMERA = voodoo.Camera(W, H, 525.0, 525.0, 319.5, 239.5)


def pictures(count: int = 30) -> list[np.ndarray]:
    """Depth images (H, W) uint16 [mm] of somebody who stands 2.4 m away before a wall and moves the arms, with noise."""
    body = voodoo.Body.human(1.75)
    camera_from_world = np.array([[0.0, -1, 0, 0], [0, 0, -1, 1.0], [1, 0, 0, 0], [0, 0, 0, 1]])
    rng = np.random.default_rng(7)
    found = []
    for number in range(count):
        phase = 2.0 * np.pi * number / count
        joints = standing(2.4, 0.25 * np.sin(phase), 0.10 * np.sin(2 * phase))
        tracker = voodoo.Tracker(body)
        tracker.reset(joints=joints, fit_sizes=False)
        rendered = voodoo.render_depth(
            tracker.body,
            tracker.estimate.world_from_limb,
            camera=CAMERA,
            world_from_sensor=np.linalg.inv(camera_from_world),
        ).depth
        depth = np.where(np.isfinite(rendered) & (rendered > 0), rendered, 4.0)
        noise = rng.normal(0.0, 0.004, (H, W)).astype(np.float32)
        found.append(np.clip((depth + noise) * 1000.0, 0, 65535).astype(np.uint16))
    return found


def standing(away: float, swing: float, shift: float) -> dict[str, tuple[float, float, float]]:
    """Joints [m] of somebody who faces a camera in the origin that looks along x."""
    joints = {"humanoid_root": (away, shift, 0.95)}
    for side, s in (("r", 1.0), ("l", -1.0)):
        joints |= {
            f"{side}_shoulder": (away, shift + s * 0.19, 1.42),
            f"{side}_elbow": (away - 0.05, shift + s * (0.22 + 0.1 * abs(swing)), 1.13),
            f"{side}_wrist": (away - 0.20 - abs(swing), shift + s * 0.22, 0.95 + abs(swing)),
            f"{side}_hip": (away, shift + s * 0.09, 0.93),
            f"{side}_knee": (away - 0.02, shift + s * 0.10, 0.50),
            f"{side}_ankle": (away, shift + s * 0.10, 0.09),
        }
    return joints


class SoftwareCamera:
    """Sends pictures at a rate from a thread of its own.

    Attributes:
        device: for RealSenseSource.
        sent: how many.
    """

    def __init__(self, rate: float = 30.0, images: list[np.ndarray] | None = None) -> None:
        import pyrealsense2 as rs

        self.rs, self.rate, self.images = rs, rate, images if images is not None else pictures()
        self.device = rs.software_device()
        self.sensor = self.device.add_sensor("Depth")
        intrinsics = rs.intrinsics()
        intrinsics.width, intrinsics.height = W, H
        intrinsics.fx, intrinsics.fy, intrinsics.ppx, intrinsics.ppy = CAMERA.fx, CAMERA.fy, CAMERA.cx, CAMERA.cy
        intrinsics.model, intrinsics.coeffs = rs.distortion.brown_conrady, [0.0] * 5
        stream = rs.video_stream()
        stream.type, stream.index, stream.uid = rs.stream.depth, 0, 0
        stream.width, stream.height, stream.fps, stream.bpp = W, H, int(rate), 2
        stream.fmt, stream.intrinsics = rs.format.z16, intrinsics
        self.profile = self.sensor.add_video_stream(stream).as_video_stream_profile()
        self.sensor.add_read_only_option(rs.option.depth_units, 0.001)
        self.sent = 0
        self._stop = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def send(self) -> None:
        frame = self.rs.software_video_frame()
        frame.stride, frame.bpp, frame.frame_number = 2 * W, 2, self.sent
        frame.timestamp, frame.domain = time.time() * 1e3, self.rs.timestamp_domain.system_time
        frame.profile, frame.depth_units = self.profile, 0.001
        frame.pixels = self.images[self.sent % len(self.images)]
        self.sensor.on_video_frame(frame)
        self.sent += 1

    def _run(self) -> None:
        due = time.monotonic()
        while not self._stop.is_set():
            self.send()
            due += 1.0 / self.rate
            time.sleep(max(due - time.monotonic(), 0.0))

    def __enter__(self) -> SoftwareCamera:
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._stop.set()
        self._thread.join()
