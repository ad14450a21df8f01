"""UTD-MHAD sequences: Kinect v1 depth and the Kinect SDK's skeleton, in MATLAB files (level 5), which are read without a library.

C. Chen, R. Jafari, N. Kehtarnavaz, "UTD-MHAD: A Multimodal Dataset for Human Action Recognition Utilizing a Depth
Camera and a Wearable Inertial Sensor", ICIP 2015.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo.errors import RecordingError, reading
from voodoo.measurements import DepthImage, FloatArray, RecordedFrame
from voodoo.model.camera import Camera
from voodoo.recordings.recording import Recording, Reference, SensorInfo
from voodoo.stored import read_stored
from voodoo.unpacking import Unpacking

CAMERA = Camera(width=320, height=240, fx=285.63, fy=285.63, cx=160.5, cy=119.0)
"""Kinect v1 at 320x240, for the un-mirrored image. The nominal center of the mirrored one is (160, 120), hence
(159, 120) after u -> 319 - u; the skeleton fits the silhouettes best with (158.5, 119), hence (160.5, 119)."""

FRAME = "kinect_depth_optical_frame"
RATE_HZ = 30.0

# Kinect's order. Its spine (the middle of the trunk) has no counterpart here; its foot is the front of the foot.
_JOINTS: tuple[str | None, ...] = (
    "head_center", "vc7", None, "humanoid_root",
    "l_shoulder", "l_elbow", "l_wrist", "l_hand", "r_shoulder", "r_elbow", "r_wrist", "r_hand",
    "l_hip", "l_knee", "l_ankle", "l_toe", "r_hip", "r_knee", "r_ankle", "r_toe",
)  # fmt: skip
NAMES = tuple(name for name in _JOINTS if name is not None)


class UtdMhadRecording(Recording):
    """One UTD-MHAD sequence, un-mirrored: left is the person's own left.

    The root frame is the camera's optical frame (x right, y down, z forward). The images of the data set are
    mirrored, so columns are reversed and the skeleton's X and Y change sign (it is Y up). The person is already segmented;
    the band of floor at the feet and the chair of the sitting actions remain.

    Stamps are k / 30 s: the paper says 30 Hz, but the data itself suggests that the true rate may be near 19 Hz,
    so speeds are uncertain by that factor. The skeleton leads the depth by one or two frames; compare at the best
    constant lag. It is another tracker's estimate: `reference.exact` is False. Kinect's joints correspond to ours
    approximately: head -> head_center, shoulder_center -> vc7, hip_center (above the hip line) -> humanoid_root,
    foot -> toe; its spine is left out.

    Args:
        path: the *_depth.mat file; the skeleton is expected in ../Skeleton/*_skeleton.mat (no reference without it).
        bare: do not read the skeleton.

    Raises:
        RecordingError: damaged, or not in the format of the data set.
    """

    loader = "utd-mhad"
    _notes = (
        "stamps are nominal (30 Hz); the true rate may be near 19 Hz",
        "the reference leads the depth by one or two frames",
    )

    def __init__(self, path: Path, *, bare: bool = False) -> None:
        """Read depth and skeleton; see the class."""
        self.path = path
        self.name = path.name.removesuffix("_depth.mat").removesuffix(".mat")
        self.root_frame = FRAME
        depth = _variable(path, "d_depth")
        if depth.dtype != np.uint16 or depth.ndim != 3 or depth.shape[:2] != (CAMERA.height, CAMERA.width):
            raise RecordingError(
                f"{path}: expected d_depth uint16 of shape (240, 320, N), found {depth.dtype} of {depth.shape}"
            )
        self._depth: npt.NDArray[np.uint16] = depth
        self._stamps: FloatArray = np.arange(depth.shape[2]) / RATE_HZ
        skeleton = path.parent.parent / "Skeleton" / f"{self.name}_skeleton.mat"
        self.reference = _read_skeleton(skeleton, len(self)) if not bare and skeleton.is_file() else None
        # A body without feet has no toes.
        self.start = None if self.reference is None else self.reference.as_start(without=("_toe",))

    def __iter__(self) -> Iterator[RecordedFrame]:
        """Depth images in order; see Recording."""
        for index, stamp in enumerate(self._stamps.tolist()):
            image = np.ascontiguousarray(self._depth[:, ::-1, index])
            yield RecordedFrame(stamp, (DepthImage("depth", stamp, image, 0.001, CAMERA, np.eye(4)),))

    def _sensors(self) -> Iterator[SensorInfo]:
        yield SensorInfo.of("depth", "depth", FRAME, self._stamps, "320x240 16UC1, person cut out")


def _variable(path: Path, name: str) -> npt.NDArray[Any]:
    content = read_mat(path)
    if name not in content:
        names = ", ".join(content) or "no numeric variables"
        raise RecordingError(f"{path}: expected the variable {name}, found {names}")
    return content[name]


def _read_skeleton(path: Path, frames: int) -> Reference:
    skeleton = _variable(path, "d_skel")
    if skeleton.dtype.kind != "f" or skeleton.shape != (len(_JOINTS), 3, frames):
        raise RecordingError(
            f"{path}: expected d_skel float of shape (20, 3, {frames}), found {skeleton.dtype} of {skeleton.shape}"
        )
    if not np.isfinite(skeleton).all() or np.abs(skeleton).max() > 20.0:
        raise RecordingError(f"{path}: expected joints in meters, found values that are not finite or beyond 20 m")
    kept = [index for index, name in enumerate(_JOINTS) if name is not None]
    # X changes sign because the image was mirrored, Y because the optical frame points down.
    positions = skeleton[kept].transpose(2, 0, 1).astype(np.float64) * (-1.0, -1.0, 1.0)
    positions[(positions == 0.0).all(axis=2)] = np.nan  # the SDK's "not tracked"
    return Reference(np.arange(frames) / RATE_HZ, NAMES, positions, exact=False)


_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
_NUMBERS = {1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8"}
"""Storage types of numbers, by the type in their tag."""
_CLASSES = range(6, 16)
"""Classes of arrays that hold numbers."""
_COMPLEX = 0x08


def read_mat(path: Path) -> dict[str, npt.NDArray[Any]]:
    """The numeric arrays of a .mat file by name, in their storage type (integer-valued doubles are stored as integers); other
    variables (text, cells, structures) are left out. See MathWorks, "MAT-File Format".

    SciPy's reader is compiled code that trusts the lengths in a file: damaged files have crashed the process. Here every length
    is checked against the size of the data.

    Raises:
        RecordingError: not a MATLAB file of level 5, damage, or arrays that unpack to too much; names the file.
    """
    data = read_stored(path, "a MATLAB file")
    if len(data) < _HEADER or data[126:128] not in (b"IM", b"MI"):
        other = "one of version 7.3, which is HDF5 (save it with -v7)" if b"HDF" in data[:_HEADER] else "another file"
        raise RecordingError(f"{path}: expected a MATLAB file of level 5, found {other}")
    order = "<" if data[126:128] == b"IM" else ">"
    found: dict[str, npt.NDArray[Any]] = {}
    unpacking = Unpacking()
    with reading(path, "a sound MATLAB file"):
        for kind, content in _elements(data[_HEADER:], order):
            packed = kind == _COMPRESSED
            inside = _elements(unpacking.unpack(content, "zlib"), order) if packed else [(kind, content)]
            for one, body in inside:
                if one == _MATRIX and body and (named := _matrix(body, order)) is not None:
                    found[named[0]] = named[1]
    return found


def _elements(data: bytes, order: str) -> Iterator[tuple[int, bytes]]:
    """(type, content) of the consecutive elements in `data`."""
    at = 0
    while at + 8 <= len(data):
        kind, length = struct.unpack_from(order + "II", data, at)
        if kind >> 16:  # up to four bytes are stored in the tag itself
            kind, length = kind & 0xFFFF, kind >> 16
            start, after = at + 4, at + 8
        else:
            start = at + 8
            # Compressed elements are not padded to eight bytes.
            after = start + (length if kind == _COMPRESSED else -(-length // 8) * 8)
        if start + length > len(data) or (start == at + 4 and length > 4):
            raise ValueError(f"expected {length} bytes of an element, found {len(data) - start}")
        yield kind, data[start : start + length]
        at = after


def _matrix(data: bytes, order: str) -> tuple[str, npt.NDArray[Any]] | None:
    """Name and numbers of an array; None if it is not numeric, or complex."""
    parts = _elements(data, order)
    (_, flags), (_, shape), (_, name) = next(parts), next(parts), next(parts)
    (word,) = struct.unpack_from(order + "I", flags)
    if word & 0xFF not in _CLASSES or (word >> 8) & _COMPLEX:
        return None
    sizes = [int(size) for size in np.frombuffer(shape, order + "i4")]
    kind, numbers = next(parts)
    if kind not in _NUMBERS:
        raise ValueError(f"expected numbers, found an element of type {kind}")
    values = np.frombuffer(numbers, np.dtype(order + _NUMBERS[kind]))
    if len(sizes) < 2 or min(sizes) < 0 or math.prod(sizes) != values.size:
        raise ValueError(f"expected an array of {sizes}, found {values.size} numbers")
    return name.decode("ascii"), values.astype(values.dtype.newbyteorder("=")).reshape(sizes, order="F")
