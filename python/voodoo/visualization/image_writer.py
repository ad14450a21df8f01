"""Writes overlay images to a folder of PNG files or a video: H.264 or VP9, which browsers play, by PyAV; MPEG-4 by OpenCV
where it is not installed."""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterable
from fractions import Fraction
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np

from voodoo.drawing.ink import Picture
from voodoo.errors import VoodooError, utf8_name
from voodoo.visualization.side_output import SideOutput
from voodoo.whole import appearing_whole, check_disk

NOT_IN_BROWSERS = "is MPEG-4, which browsers do not play: H.264 needs pip install 'voodoo-tracker[film]'"
# A picture of 1840x720 takes 8 ms and 39 kB as H.264 and 31 ms as VP9; "veryfast" H.264 24 ms and 18 kB; MPEG-4 11 ms and 72 kB.
_CODECS = {
    "libx264": {"preset": "ultrafast"},
    "libvpx-vp9": {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "30", "b": "0"},
}
NOT_SMALL = "pip install 'voodoo-tracker[film]' makes the film in a page ten times smaller"
# One of 1226x480 takes 49 ms and 4 kB; with the settings above 13 kB, and as OpenCV's VP8 48 kB.
_SMALL = {"libvpx-vp9": {"deadline": "realtime", "cpu-used": "5", "row-mt": "1", "crf": "44", "b": "0"}}


def codec_for_browsers() -> str | None:
    """The encoder of PyAV that is used; None: there is none."""
    return _first_of(_CODECS)


def codec_for_small_films() -> str | None:
    """That of films in pages."""
    return _first_of(_SMALL)


def _first_of(codecs: Iterable[str]) -> str | None:
    try:
        import av
    except ImportError:
        return None
    return next((name for name in codecs if name in av.codec.codecs_available), None)


class _ForBrowsers:
    """A video by PyAV; an .mp4 has its index in front, so that it plays while it is loaded."""

    def __init__(self, place: Path, shape: tuple[int, ...], rate_hz: float, codec: str, *, small: bool = False) -> None:
        av: Any = import_module("av")
        self._encoded = av.VideoFrame.from_ndarray
        how: dict[str, Any] = {"format": "webm"} if small else {"format": "mp4", "options": {"movflags": "+faststart"}}
        self._file = av.open(f"file:{place.absolute()}", "w", **how)
        rate = max(Fraction(rate_hz).limit_denominator(1001), Fraction(1, 1000))
        self._stream = self._file.add_stream(codec, rate=rate, options=dict((_SMALL if small else _CODECS)[codec]))
        # Colors have half the resolution: sizes are even.
        self._stream.height, self._stream.width = (size // 2 * 2 for size in shape[:2])
        self._stream.pix_fmt = "yuv420p"
        self._count, self._sound = 0, True

    def write(self, picture: Picture) -> None:
        """As cv2.VideoWriter."""
        self._sound = False
        whole = np.ascontiguousarray(picture[: self._stream.height, : self._stream.width])
        frame = self._encoded(whole, format="bgr24")
        frame.pts, self._count = self._count, self._count + 1
        self._file.mux(self._stream.encode(frame))
        self._sound = True

    def release(self) -> None:
        """As cv2.VideoWriter; after an error nothing is written, because FFmpeg dies of it."""
        try:
            if self._sound:
                self._file.mux(self._stream.encode(None))
        finally:
            self._file.close()


Film: TypeAlias = _ForBrowsers | cv2.VideoWriter


def film(place: Path, shape: tuple[int, ...], *, rate_hz: float) -> Film:
    """Begin a video in .mp4 of pictures of a shape (height, width, 3); `write` adds one, and `release` completes the file.

    Raises:
        VoodooError, OSError: it cannot be written.
    """
    codec = codec_for_browsers()
    if codec is not None:
        return _ForBrowsers(place, shape, rate_hz, codec)
    made = cv2.VideoWriter(str(place), cv2.VideoWriter.fourcc(*"mp4v"), rate_hz, shape[1::-1])
    if not made.isOpened():
        raise VoodooError(f"{place.name}: expected a file that can be written as MPEG-4, found that OpenCV cannot")
    return made


def small_film(place: Path, shape: tuple[int, ...], *, rate_hz: float) -> Film:
    """The same in .webm, of fewer bytes: VP9 by PyAV, or VP8 by OpenCV, which takes ten times as many.

    Raises:
        VoodooError, OSError: it cannot be written.
    """
    codec = codec_for_small_films()
    if codec is not None:
        return _ForBrowsers(place, shape, rate_hz, codec, small=True)
    made = cv2.VideoWriter(str(place), cv2.VideoWriter.fourcc(*"VP80"), rate_hz, shape[1::-1])
    if not made.isOpened():
        raise VoodooError(f"{place.name}: expected a film that can be written as VP8, found that OpenCV cannot")
    return made


_LEAST_FREE = 2**16
"""Free space below which a disk is looked at [bytes]."""
_PICTURE = re.compile(r"frame_\d{6,}\.png")


class PictureWriter(SideOutput):
    """Writes images of one size to DIR/frame_000000.png, ... or into an .mp4; use it in a `with` block.

    What cannot be written does not end the block: `failure` holds the first error, and nothing more is written. A film or
    folder appears when it is complete; it replaces a film, or a folder of such images.

    Args:
        path: ends in .mp4 for a video; otherwise a folder.
        rate_hz: frame rate of the video.

    Attributes:
        failure: why images are missing; None if there are all.
        note: what to know about a film; "" if nothing.

    Raises:
        VoodooError: a suffix of another video or image format, a name that is not UTF-8, or a folder with other files.
    """

    def __init__(self, path: Path, *, rate_hz: float) -> None:
        """Check the name and create the folder."""
        if path.suffix.lower() in (".avi", ".mkv", ".mov", ".webm", ".gif", ".png", ".jpg"):
            raise VoodooError(f"{path}: expected a folder or a name that ends in .mp4, found {path.suffix!r}")
        utf8_name(path)
        super().__init__()
        self._path = path
        self._rate_hz = rate_hz
        self._is_film = path.suffix.lower() == ".mp4"
        self._film: Film | None = None
        self.note = f"{path} {NOT_IN_BROWSERS}" if self._is_film and codec_for_browsers() is None else ""
        self._count = 0
        self._place = path
        folder = path.parent if self._is_film else path
        if folder.exists() and not folder.is_dir():
            raise VoodooError(f"{folder}: expected a folder, found a file")
        if not self._is_film and path.exists():
            other = next((file.name for file in path.iterdir() if not _PICTURE.fullmatch(file.name)), None)
            if other is not None:
                raise VoodooError(
                    f"{path}: expected a new folder, or one of pictures like frame_000000.png, found {other}"
                )

    def write(self, picture: Picture) -> None:
        """Add an image."""
        self.attempt(self._write, picture)

    def _write(self, picture: Picture) -> None:
        if not self._count:
            self._place = self._ends.enter_context(appearing_whole(self._path))
            if self._is_film:
                self._film = self._open(picture)
                self._ends.push(lambda kind, *_: self._check() if kind is None else None)
                self._ends.callback(self._film.release)
            else:
                self._place.mkdir()
        if self._film is not None:
            self._film.write(picture)  # OpenCV does not tell that the disk is full
            if shutil.disk_usage(self._place.parent).free < _LEAST_FREE:
                check_disk(self._place.parent)
        else:
            _encode(self._place / f"frame_{self._count:06d}.png", picture)
        self._count += 1

    def _open(self, picture: Picture) -> Film:
        try:
            return film(self._place, picture.shape, rate_hz=self._rate_hz)
        except VoodooError:
            check_disk(self._place.parent)
            raise

    def _check(self) -> None:
        """Check that the film can be read."""
        made = cv2.VideoCapture(str(self._place))
        try:
            count = int(made.get(cv2.CAP_PROP_FRAME_COUNT)) if made.isOpened() else 0
            readable, _ = made.read()
        finally:
            made.release()
        if count != self._count or not readable:
            check_disk(self._place.parent)
            raise VoodooError(f"{self._path}: expected a film of {self._count} pictures, found {count} readable ones")


def save_picture(path: Path, picture: Picture) -> None:
    """Write one image in the format of its suffix; it appears when it is complete.

    Raises:
        VoodooError, OSError: it could not be written.
    """
    utf8_name(path)
    with appearing_whole(path) as place:
        _encode(place, picture)


def _encode(place: Path, picture: Picture) -> None:
    done, data = cv2.imencode(place.suffix, picture)
    if not done:
        raise VoodooError(f"{place.name}: expected a picture, found one that OpenCV cannot encode")
    place.write_bytes(data.tobytes())
