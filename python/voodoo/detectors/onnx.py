"""A network in an ONNX file as a detector."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from os import PathLike
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.detectors.base import JOINTS, DetectedPerson, DetectorImage, PersonCandidate, names_of
from voodoo.errors import ConfigError, a_path, installed
from voodoo.stored import MOST_RECORDED, check_stored

SIZE = 96
"""Edge length [px] of the image crops that a network takes."""


class OnnxDetector:
    """A network that evaluates crops of candidates, run by ONNX Runtime (`pip install 'voodoo-tracker[onnx]'`).

    Candidates are cropped from the depth image as for the shipped network. The only input is a batch of crops
    (N, 2, 96, 96), float32, 2.6 m wide at the depth z0 of the candidate's median pixel, rotated to be upright. Channel 0 is
    (z - z0) / 1.2 m, clipped to -1 ... 1, and 1 outside the candidate; channel 1 is 1 on the candidate and 0 outside. Two
    outputs are read, others are ignored: `p` (N, J, 3), meters from the crop's center to the right, downwards and backwards;
    and `vis` (N, J + 2), the log odds that each joint is in the image, that the trunk faces the camera, and that it is a person.

    Args:
        path: the file.
        joints: names of its J joints, in its order.
        joint_sigma: standard deviation of a joint along each axis [m].
        outputs: names of the two outputs.
        most: maximum number of crops evaluated per image.
        threads: threads of ONNX Runtime. With one, results do not depend on the machine's load.
    """

    lengths: tuple[str, ...] = ()

    def __init__(
        self,
        path: str | PathLike[str],
        *,
        joints: Sequence[str] = JOINTS,
        joint_sigma: float = 0.05,
        outputs: tuple[str, str] = ("p", "vis"),
        most: int = 4,
        threads: int = 1,
    ) -> None:
        """See the class.

        Raises:
            ConfigError: onnxruntime is missing, the file cannot be read, or its input and outputs differ from the above.
        """
        missing = "OnnxDetector: expected onnxruntime, found none; pip install 'voodoo-tracker[onnx]'"
        onnxruntime = installed("onnxruntime", missing, error=ConfigError)
        self.joints = names_of("joints", joints)
        self._sigma, self._most = float(joint_sigma), int(most)
        self.path = a_path(path, error=ConfigError)
        check_stored(self.path, "an ONNX file", most=MOST_RECORDED, error=ConfigError)
        options = onnxruntime.SessionOptions()
        options.intra_op_num_threads, options.inter_op_num_threads = int(threads), 1
        try:
            self._session = onnxruntime.InferenceSession(str(self.path), options, providers=["CPUExecutionProvider"])
        except Exception as cause:  # ONNX Runtime's errors share no other class
            raise ConfigError(f"{self.path}: expected an ONNX file, found: {cause}") from cause
        self._outputs = list(outputs)
        self._input = self._checked()

    def _checked(self) -> str:
        """The input's name, after checking that an empty crop gives outputs of the right shapes."""
        (first, *rest), names = self._session.get_inputs(), [output.name for output in self._session.get_outputs()]
        if rest or not set(self._outputs) <= set(names):
            raise ConfigError(
                f"{self.path}: expected one input and the outputs {', '.join(self._outputs)}, "
                f"found {1 + len(rest)} and {', '.join(names)}"
            )
        try:
            found = self._session.run(self._outputs, {first.name: np.zeros((1, 2, SIZE, SIZE), dtype=np.float32)})
        except Exception as cause:
            raise ConfigError(f"{self.path}: expected an input (N, 2, {SIZE}, {SIZE}), found: {cause}") from cause
        count = len(self.joints)
        expected, shapes = [(1, count, 3), (1, count + 2)], [np.shape(output) for output in found]
        if shapes != expected:
            raise ConfigError(f"{self.path}: expected outputs of shape {expected} for {count} joints, found {shapes}")
        return str(first.name)

    def detect(self, image: DetectorImage) -> Iterator[DetectedPerson]:
        """The persons in an image."""
        candidates = self._candidates(image)
        if not candidates:
            return
        pictures = np.stack([candidate.crop for candidate in candidates])
        places, odds = self._session.run(self._outputs, {self._input: pictures})
        taken = np.zeros(image.depth.shape, dtype=bool)
        # Of candidates that share pixels the most confident is kept.
        for number in sorted(range(len(candidates)), key=lambda number: -float(odds[number][-1])):
            candidate, log_odds = candidates[number], odds[number].astype(np.float64)
            if log_odds[-1] <= 0.0 or (taken & candidate.mask).any():
                continue
            taken |= candidate.mask
            yield self._person(image, candidate, places[number].astype(np.float64), log_odds)

    def _candidates(self, image: DetectorImage) -> list[PersonCandidate]:
        from voodoo._core import person_candidates

        floor = None
        if image.floor is not None:
            normal, offset = np.asarray(image.floor[0], dtype=np.float64), image.floor[1]
            height = offset - float(normal @ image.world_from_sensor[:3, 3])
            floor = ((normal @ image.world_from_sensor[:3, :3]).tolist(), height)
        return person_candidates(image.depth, camera=image.camera, floor=floor, most=self._most)

    def _person(
        self,
        image: DetectorImage,
        candidate: PersonCandidate,
        places: npt.NDArray[np.float64],
        log_odds: npt.NDArray[np.float64],
    ) -> DetectedPerson:
        probabilities = 1.0 / (1.0 + np.exp(-np.clip(log_odds, -50.0, 50.0)))
        points = image.to_world(in_camera(candidate, places))
        floor: Any = None
        if candidate.floor is not None:
            normal = image.world_from_sensor[:3, :3] @ np.asarray(candidate.floor[0])
            floor = (normal, candidate.floor[1] + float(normal @ image.world_from_sensor[:3, 3]))
        return DetectedPerson(
            joints=dict(zip(self.joints, points, strict=True)),
            confidence=float(probabilities[-1]),
            facing=float(probabilities[-2]),
            joint_sigma=self._sigma,
            visible=dict(zip(self.joints, probabilities[:-2].tolist(), strict=True)),
            mask=candidate.mask,
            floor=floor,
        )


def in_camera(candidate: PersonCandidate, places: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
    """Positions (J, 3) in a candidate's crop as points (J, 3) in the camera frame [m]."""
    x0, y0, z0 = candidate.middle
    z = z0 + places[:, 2]
    x, y = z * (x0 + places[:, 0] / z0), z * (y0 + places[:, 1] / z0)
    sin, cos = math.sin(candidate.roll), math.cos(candidate.roll)
    return np.stack([cos * x + sin * y, cos * y - sin * x, z], axis=-1)
