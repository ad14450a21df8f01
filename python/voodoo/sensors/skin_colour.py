"""The colour of one person's skin in the light of the moment: a histogram that is learnt and forgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

ByteImage = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Histogram = npt.NDArray[np.float32]

LUMA_BINS, CHROMA_BINS = 8, 64
"""Bins of Y, and of either chroma axis, of YCrCb. Luma is coarse: it parts a face from a dark poster of the same
hue."""
_SHAPE = (LUMA_BINS, CHROMA_BINS, CHROMA_BINS)
_SIZE = LUMA_BINS * CHROMA_BINS**2
_SMOOTHING = (0.7, 0.8)

_IN_COMMON = 0.1
"""Two places that share less of their colours than this do not both show skin."""
_PRIOR_CENTRE, _PRIOR_SPREAD = (150.0, 110.0), (8.0, 8.0)
"""Chroma (Cr, Cb) of human skin of any tone under white light, and its spread."""


@dataclass(frozen=True, eq=False)
class Colours:
    """A picture as histogram bins (H, W), and where it is light enough to have a colour (H, W), 1 or 0."""

    bins: npt.NDArray[np.int32]
    lit: ByteImage

    @classmethod
    def of(cls, image: ByteImage, *, darkest: int = 30) -> Colours:
        """Those of a BGR picture (H, W, 3); pixels with less luma than `darkest` have no reliable chroma."""
        planes = cv2.split(cv2.cvtColor(image, cv2.COLOR_BGR2YCrCb))
        luma, cr, cb = (np.asarray(plane, dtype=np.uint8) for plane in planes)
        chroma = ((cr >> 2).astype(np.int32) << 6) | (cb >> 2)
        return cls(((luma >> 5).astype(np.int32) << 12) | chroma, (luma >= darkest).astype(np.uint8))


class SkinColour:
    """Decides by the ratio of two histograms, skin's and everything else's.

    Args:
        forgetting: share of the old histograms that a picture leaves.
        ratio: skin has to be this many times as likely as the rest.
    """

    def __init__(self, *, forgetting: float = 0.86, ratio: float = 2.0) -> None:
        """Start with the colours of all skins against evenly spread ones."""
        self.forgetting = forgetting
        self.ratio = ratio
        axis = (np.arange(CHROMA_BINS, dtype=np.float32) + 0.5) * (256 / CHROMA_BINS)
        cr = ((axis - _PRIOR_CENTRE[0]) / _PRIOR_SPREAD[0]) ** 2
        cb = ((axis - _PRIOR_CENTRE[1]) / _PRIOR_SPREAD[1]) ** 2
        chroma = np.exp(-0.5 * (cr[:, None] + cb[None, :]))
        prior = np.broadcast_to(chroma, _SHAPE).astype(np.float32)
        self.skin: Histogram = prior / prior.sum()
        self.rest: Histogram = np.full(_SHAPE, 1.0 / _SIZE, dtype=np.float32)
        self._pictures = 0

    def classify(self, colours: Colours) -> Mask:
        """(H, W): True where a picture has the colour of skin; single pixels are removed."""
        table = (self.skin > self.ratio * self.rest).astype(np.uint8).ravel()
        return np.asarray(cv2.medianBlur(table[colours.bins] & colours.lit, 3), dtype=bool)

    def learn(self, colours: Colours, inside: Sequence[Mask], *, outside: Mask, body: Mask | None = None) -> bool:
        """Learn from the pixels where skin must be, and from those far from it.

        A colour is learnt as far as two places show it: a shirt behind one hand is not skin.

        Args:
            colours: of the picture.
            inside: (H, W) each, where the head is and where each hand is. Only pixels whose colour is near to what skin
                was are learnt.
            outside: (H, W) where no head or hand is.
            body: (H, W) where the body is, if known: half of the rest is learnt from its clothes.

        Returns:
            Whether there was enough skin to learn from.
        """
        bins = colours.bins
        near = (self.skin > 0.5 * self.ratio * self.rest).ravel()
        likely = near[bins] & colours.lit.astype(bool)
        places = [bins[place & likely] for place in inside]
        places = [place for place in places if len(place) >= 8]
        if len(places) < 2 or sum(len(place) for place in places) < 20:
            return False
        most, shown = np.zeros(_SHAPE, np.float32), np.zeros(_SHAPE, np.float32)
        for place in places:
            shares = _smoothed(_shares(place))
            np.maximum(shown, np.minimum(most, shares), out=shown)
            np.maximum(most, shares, out=most)
        total = float(shown.sum())
        if total < _IN_COMMON:
            return False
        # The first pictures make the general skin this person's; later ones follow slowly.
        keep = np.float32(self.forgetting if self._pictures >= 5 else 0.5)
        self.skin = keep * self.skin + (1 - keep) * (shown / np.float32(total))
        rest = _shares(bins[outside])
        if body is not None and (clothes := outside & body).any():
            rest = 0.5 * rest + 0.5 * _shares(bins[clothes])
        # A colour seen nowhere yet is not skin.
        rest = 0.95 * _smoothed(rest) + np.float32(0.05 / _SIZE)
        self.rest = keep * self.rest + (1 - keep) * rest
        self._pictures += 1
        return True


def _shares(bins: npt.NDArray[np.int32]) -> Histogram:
    """Share of each bin."""
    counts = np.bincount(bins, minlength=_SIZE).reshape(_SHAPE).astype(np.float32)
    return np.asarray(counts / np.float32(max(len(bins), 1)))


def _smoothed(shares: Histogram) -> Histogram:
    """A smoothed histogram: the colours between those seen count too."""
    across = _LUMA_KERNEL @ (_CHROMA_KERNEL @ shares @ _CHROMA_KERNEL.T).reshape(LUMA_BINS, -1)
    return np.asarray(across.reshape(_SHAPE))


def _kernel(bins: int, sigma: float) -> npt.NDArray[np.float32]:
    """Smoothing as a matrix: some small products are ten times as fast as filters along three axes."""
    return np.asarray(gaussian_filter1d(np.eye(bins), sigma, axis=0, truncate=2.5), dtype=np.float32)


_LUMA_KERNEL, _CHROMA_KERNEL = _kernel(LUMA_BINS, _SMOOTHING[0]), _kernel(CHROMA_BINS, _SMOOTHING[1])
