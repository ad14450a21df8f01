"""Videos of pictures: H.264 or VP9, which browsers play, by PyAV; MPEG-4 by OpenCV where it is not installed."""

from __future__ import annotations

from fractions import Fraction
from importlib import import_module
from pathlib import Path
from typing import Any, TypeAlias

import cv2
import numpy as np

from voodoo.drawing.ink import Picture
from voodoo.errors import VoodooError

NOT_IN_BROWSERS = "is MPEG-4, which browsers do not play: H.264 needs pip install 'voodoo-tracker[film]'"
# A picture of 1840x720 takes 8 ms and 39 kB as H.264 and 31 ms as VP9; "veryfast" H.264 24 ms and 18 kB; MPEG-4 11 ms and 72 kB.
_CODECS = {
    "libx264": {"preset": "ultrafast"},
    "libvpx-vp9": {"deadline": "realtime", "cpu-used": "8", "row-mt": "1", "crf": "30", "b": "0"},
}


def codec_for_browsers() -> str | None:
    """The encoder of PyAV that is used; None: there is none."""
    try:
        import av
    except ImportError:
        return None
    return next((name for name in _CODECS if name in av.codec.codecs_available), None)


class _ForBrowsers:
    """A video by PyAV, with its index in front, so that it plays while it is loaded."""

    def __init__(self, place: Path, shape: tuple[int, ...], rate: Fraction, codec: str) -> None:
        av: Any = import_module("av")
        self._encoded = av.VideoFrame.from_ndarray
        self._file = av.open(f"file:{place.absolute()}", "w", format="mp4", options={"movflags": "+faststart"})
        self._stream = self._file.add_stream(codec, rate=rate, options=_CODECS[codec])
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
        return _ForBrowsers(place, shape, max(Fraction(rate_hz).limit_denominator(1001), Fraction(1, 1000)), codec)
    made = cv2.VideoWriter(str(place), cv2.VideoWriter.fourcc(*"mp4v"), rate_hz, shape[1::-1])
    if not made.isOpened():
        raise VoodooError(f"{place.name}: expected a file that can be written as MPEG-4, found that OpenCV cannot")
    return made
