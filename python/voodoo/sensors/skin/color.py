"""The colour of one person's skin in the light of the moment: a histogram that is learnt and forgets."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt
from scipy.ndimage import gaussian_filter1d

import voodoo._core as _core

ByteImage = npt.NDArray[np.uint8]
Mask = npt.NDArray[np.bool_]
Histogram = npt.NDArray[np.float32]

LUMA_BINS, CHROMA_BINS = 8, 64
"""Bins of Y, and of either chroma axis, of YCrCb, as in the core. Luma is coarse: it parts a face from a dark poster of
the same hue."""
_SHAPE = (CHROMA_BINS, CHROMA_BINS, LUMA_BINS)
"""Of a histogram: Cr, Cb, Y."""
_SIZE = CHROMA_BINS**2 * LUMA_BINS
_SMOOTHING = (0.7, 0.8)
"""Standard deviations along luma and chroma [bins]."""

_IN_COMMON = 0.1
"""Two places that share less of their colours than this do not both show skin."""
_PRIOR_CENTRE, _PRIOR_SPREAD = (150.0, 110.0), (8.0, 8.0)
"""Chroma (Cr, Cb) of human skin of any tone under white light, and its spread."""


@dataclass(frozen=True, eq=False)
class Colours:
    """A picture's colours: the bin of each pixel (H, W), see `_core.color_bins`."""

    bins: npt.NDArray[np.uint16]

    @classmethod
    def of(cls, image: ByteImage) -> Colours:
        """Those of a BGR picture (H, W, 3)."""
        return cls(_core.color_bins(np.ascontiguousarray(image)))

    def within(self, mask: ByteImage) -> tuple[Colours, ByteImage]:
        """The smallest part that holds all of a mask (H, W), and the mask there."""
        x, y, w, h = cv2.boundingRect(mask)
        window = (slice(y, y + h), slice(x, x + w))
        return Colours(np.ascontiguousarray(self.bins[window])), np.ascontiguousarray(mask[window])

    def among(self, table: Mask) -> ByteImage:
        """(H, W): 1 where a picture is light enough to have a colour, and it is one of a histogram's bins."""
        return _core.bins_among(self.bins, table.reshape(-1))

    def shares(self, mask: ByteImage) -> Histogram:
        """Share of each bin among the pixels of a mask (H, W)."""
        counts = _core.bin_counts(self.bins, mask)
        return np.asarray(counts.reshape(_SHAPE) / np.float32(max(cv2.countNonZero(mask), 1)), dtype=np.float32)


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
        prior = np.broadcast_to(chroma[:, :, None], _SHAPE).astype(np.float32)
        self.skin: Histogram = prior / prior.sum()
        self.rest: Histogram = np.full(_SHAPE, 1.0 / _SIZE, dtype=np.float32)
        self._pictures = 0
        self._table: tuple[Histogram, Histogram, Mask] | None = None

    def table(self) -> Mask:
        """Which bins are skin's (32768,)."""
        known = self._table
        if known is None or known[0] is not self.skin or known[1] is not self.rest:
            known = self._table = (self.skin, self.rest, (self.skin > self.ratio * self.rest).reshape(-1))
        return known[2]

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
        near = self.skin > 0.5 * self.ratio * self.rest
        places = []
        for place in inside:
            if not place.any():
                continue
            part, mask = colours.within(place.view(np.uint8))
            places.append((part, mask & part.among(near)))
        sizes = [cv2.countNonZero(mask) for _, mask in places]
        places = [place for place, size in zip(places, sizes, strict=True) if size >= 8]
        if len(places) < 2 or sum(size for size in sizes if size >= 8) < 20:
            return False
        most, shown = np.zeros(_SHAPE, np.float32), np.zeros(_SHAPE, np.float32)
        for part, mask in places:
            shares = _smoothed(part.shares(mask))
            np.maximum(shown, np.minimum(most, shares), out=shown)
            np.maximum(most, shares, out=most)
        total = float(shown.sum())
        if total < _IN_COMMON:
            return False
        # The first pictures make the general skin this person's; later ones follow slowly.
        keep = np.float32(self.forgetting if self._pictures >= 5 else 0.5)
        self.skin = keep * self.skin + (1 - keep) * (shown / np.float32(total))
        rest = colours.shares(outside.view(np.uint8))
        if body is not None and (clothes := outside & body).any():
            rest = 0.5 * rest + 0.5 * colours.shares(clothes.view(np.uint8))
        # A colour seen nowhere yet is not skin.
        rest = 0.95 * _smoothed(rest) + np.float32(0.05 / _SIZE)
        self.rest = keep * self.rest + (1 - keep) * rest
        self._pictures += 1
        return True


def _smoothed(shares: Histogram) -> Histogram:
    """A smoothed histogram: the colours between those seen count too."""
    along_luma = (shares.reshape(-1, LUMA_BINS) @ _LUMA_KERNEL.T).reshape(_SHAPE)
    return np.asarray(
        cv2.sepFilter2D(along_luma, -1, _CHROMA_KERNEL, _CHROMA_KERNEL, borderType=cv2.BORDER_REFLECT), dtype=np.float32
    )


_LUMA_KERNEL = gaussian_filter1d(np.eye(LUMA_BINS), _SMOOTHING[0], axis=0, truncate=2.5).astype(np.float32)
"""Smoothing along the luma axis as a matrix."""
_CHROMA_KERNEL = cv2.getGaussianKernel(5, _SMOOTHING[1], cv2.CV_32F)
