"""RTMPose by rtmlib and ONNX Runtime: a detector of persons, then keypoints in each of them."""

from __future__ import annotations

import sys
from collections.abc import Sequence
from contextlib import redirect_stdout
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.errors import ConfigError, installed

_MODES = ("lightweight", "balanced", "performance")
_LAYOUTS = {17: "coco17", 26: "halpe26"}


class RtmPose:
    """RTMPose with the feet, on the processor.

    Args:
        words: "lightweight", "balanced" or "performance", whose networks rtmlib downloads once; empty: balanced. Or two files,
            "DETECTOR.onnx,POSE.onnx": YOLOX, and an RTMPose with 17 (COCO) or 26 (Halpe) keypoints.

    Raises:
        ConfigError: rtmlib is missing, or the networks cannot be loaded.
    """

    def __init__(self, words: str) -> None:
        """Load the networks."""
        missing = "rtmpose: expected rtmlib, found none; pip install 'voodoo-tracker[rtmpose]'"
        rtmlib = installed("rtmlib", missing, error=ConfigError)
        mode, files = words or "balanced", [Path(word) for word in words.split(",")]
        how: dict[str, Any] = {"mode": mode}
        if mode not in _MODES:
            if len(files) != 2 or not all(file.is_file() for file in files):
                raise ConfigError(
                    f"rtmpose: expected {', '.join(_MODES)} or the files DETECTOR.onnx,POSE.onnx, found {words!r}"
                )
            how = {"det": str(files[0]), "pose": str(files[1])}
        try:
            with redirect_stdout(sys.stderr):  # rtmlib tells what it loads, and stdout may be a result
                network = rtmlib.BodyWithFeet(backend="onnxruntime", device="cpu", **how)
        except Exception as error:
            raise ConfigError(
                f"rtmpose: expected networks that can be downloaded or read, found {type(error).__name__}: {error}; "
                "rtmpose:DETECTOR.onnx,POSE.onnx names files"
            ) from error
        self._persons, self._pose = network.det_model, network.pose_model
        for each, rows_first in ((self._persons, True), (self._pose, False)):
            height, width = each.session.get_inputs()[0].shape[2:]
            if isinstance(height, int) and isinstance(width, int):
                each.model_input_size = (height, width) if rows_first else (width, height)
        count = self._pose.session.get_outputs()[0].shape[1]
        if count not in _LAYOUTS:
            raise ConfigError(
                f"rtmpose: expected a network with {' or '.join(map(str, _LAYOUTS))} keypoints, found {count}"
            )
        self.layout = _LAYOUTS[count]

    def __call__(self, image: npt.NDArray[np.uint8]) -> Sequence[npt.NDArray[np.float64]]:
        """See `Detect`."""
        boxes = self._persons(image)
        if not len(boxes):  # RTMPose would search the whole image
            return ()
        pixels, scores = self._pose(image, bboxes=boxes)
        return tuple(np.dstack([pixels, np.clip(scores, 0.0, 1.0)]).astype(np.float64))
