"""A stereo pair to depth: rectification from calibration, semi-global matching, uncertainty that grows with z^2 (K06
III-A)."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import ByteImage, FloatArray
from voodoo.model.camera import Camera
from voodoo.model.transforms import inverse, pose_of, rigid
from voodoo.sensors.model import RangeNoise, stereo_noise

_FRACTIONS = 16  # StereoSGBM gives sixteenths of a pixel


@dataclass(frozen=True, eq=False)
class StereoDepth:
    """Depth of a stereo pair.

    Args:
        image: (H, W) float32 [m] along the optical axis of `camera`, 0 where nothing was matched.
        camera: the rectified left camera, without distortion.
        world_from_sensor: (4, 4) of that camera's optical frame.
        noise: standard deviation of the depth.
    """

    image: npt.NDArray[np.float32]
    camera: Camera
    world_from_sensor: FloatArray
    noise: RangeNoise


class StereoPair:
    """Two calibrated cameras side by side.

    Args:
        left, right: calibrations, of the same size.
        left_from_right: (4, 4) pose of the right camera in the left one's optical frame; its x is the baseline.
        nearest, farthest: range of depths to search [m].
        block: side of the matched squares [px], odd.
        disparity_sigma: standard deviation of a disparity [px].
        max_difference: greatest difference between the disparities of left and right [px]; where it is exceeded, the point is
            not visible to one of the cameras.

    Raises:
        MeasurementError: sizes differ, the right camera is not to the right, an empty range, or a fish-eye lens.
    """

    def __init__(
        self,
        left: Camera,
        right: Camera,
        left_from_right: npt.ArrayLike,
        *,
        nearest: float = 0.7,
        farthest: float = 7.5,
        block: int = 7,
        disparity_sigma: float = 0.5,
        max_difference: int = 1,
    ) -> None:
        """Rectify once; see the class."""
        pose = rigid(left_from_right, name="left_from_right")
        if (left.width, left.height) != (right.width, right.height):
            raise MeasurementError(
                f"stereo: expected cameras of one size, found {left.width}x{left.height} px and "
                f"{right.width}x{right.height} px"
            )
        others = {left.model, right.model} & {"equidistant", "inverse_plumb_bob"}
        if others:
            raise MeasurementError(
                f"stereo: expected lenses that OpenCV's polynomials describe, found {', '.join(others)}"
            )
        if not (pose[0, 3] > 0.0 and abs(pose[0, 3]) > abs(pose[1, 3]) + abs(pose[2, 3])):
            raise MeasurementError(
                f"stereo: expected the right camera to the right, found it at {pose[:3, 3].tolist()} m"
            )
        if not 0.0 < nearest < farthest or block < 1 or block % 2 == 0:
            raise MeasurementError(
                f"stereo: expected 0 < nearest < farthest and an odd block, found {nearest!r}, {farthest!r}, {block!r}"
            )
        size, right_from_left = (left.width, left.height), inverse(pose)
        lenses = [(camera.matrix, np.array(camera.distortion or (0.0,) * 4)) for camera in (left, right)]
        turn, shift = right_from_left[:3, :3], right_from_left[:3, 3:]
        turn_left, turn_right, project_left, project_right, _, _, _ = cv2.stereoRectify(
            *lenses[0], *lenses[1], size, turn, shift, flags=cv2.CALIB_ZERO_DISPARITY, alpha=0
        )
        self._maps = [
            cv2.initUndistortRectifyMap(*lens, turn, project, size, cv2.CV_16SC2)
            for lens, turn, project in zip(lenses, (turn_left, turn_right), (project_left, project_right), strict=True)
        ]
        p = np.asarray(project_left)
        self.camera = Camera(left.width, left.height, float(p[0, 0]), float(p[1, 1]), float(p[0, 2]), float(p[1, 2]))
        self.baseline = float(np.linalg.norm(pose[:3, 3]))
        self.noise = stereo_noise(focal=self.camera.fx, baseline=self.baseline, disparity_sigma=disparity_sigma)
        self._left_from_rectified = pose_of(np.asarray(turn_left).T)
        self._nearest, self._farthest = nearest, farthest
        least = int(self.camera.fx * self.baseline / farthest)
        most = int(np.ceil(self.camera.fx * self.baseline / nearest))
        count = max(_FRACTIONS * -(-(most - least + 1) // _FRACTIONS), _FRACTIONS)
        self._matcher = cv2.StereoSGBM.create(
            minDisparity=least,
            numDisparities=count,
            blockSize=block,
            P1=8 * block * block,
            P2=32 * block * block,
            disp12MaxDiff=max_difference,
            uniquenessRatio=10,
            speckleWindowSize=80,
            speckleRange=2,
            mode=cv2.STEREO_SGBM_MODE_SGBM_3WAY,
        )

    def depth(
        self,
        left: ByteImage,
        right: ByteImage,
        *,
        world_from_left: npt.ArrayLike | None = None,
    ) -> StereoDepth:
        """Depth of one pair of pictures (H, W) gray or (H, W, 3) BGR.

        Use it as `frame.add_depth(d.image, camera=d.camera, meters_per_unit=1.0, world_from_sensor=d.world_from_sensor,
        weight=model.weight(d.noise.sigma(range), sharing=...))`.

        Args:
            left, right: taken at the same time.
            world_from_left: (4, 4) of the left camera's optical frame; identity by default.

        Raises:
            MeasurementError: not of the cameras' size, or not uint8.
        """
        pictures = []
        for name, image, maps in (("left", left, self._maps[0]), ("right", right, self._maps[1])):
            if image.dtype != np.uint8 or image.shape[:2] != (self.camera.height, self.camera.width):
                expected = (self.camera.height, self.camera.width)
                raise MeasurementError(f"{name}: expected uint8 of {expected}, found {image.dtype} of {image.shape}")
            gray = image if image.ndim == 2 else cv2.cvtColor(image, cv2.COLOR_BGR2GRAY)
            pictures.append(cv2.remap(gray, maps[0], maps[1], cv2.INTER_LINEAR))
        disparity = self._matcher.compute(pictures[0], pictures[1]).astype(np.float32) / _FRACTIONS
        with np.errstate(divide="ignore"):
            z = np.float32(self.camera.fx * self.baseline) / disparity
        z[~((disparity > 0.0) & (z >= self._nearest) & (z <= self._farthest))] = 0.0
        pose = np.eye(4) if world_from_left is None else rigid(world_from_left, name="world_from_left")
        return StereoDepth(z.astype(np.float32), self.camera, pose @ self._left_from_rectified, self.noise)
