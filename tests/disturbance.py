"""Image disturbances of R07 section 5.2."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from synthetic.sequence import VirtualFrame


@dataclass(frozen=True, kw_only=True)
class Disturbance:
    """Kinds and rates of the disturbances of R07 section 5.2.

    Args:
        noise: fraction of pixels with a random depth, R07: 0.15.
        rectangles: random rectangles of random depth in every frame.
        rectangle_fraction: their largest width and height, as a fraction of the image's.
        corrupted, blank, repeated, late: probability that a frame has random pixels only, no returns, the previous image, or
            a stamp that is not later than the previous one.
        seed: of the random numbers.
    """

    noise: float = 0.15
    rectangles: int = 4
    rectangle_fraction: float = 0.125
    corrupted: float = 0.02
    blank: float = 0.02
    repeated: float = 0.02
    late: float = 0.02
    seed: int = 7


def disturbed_image(
    image: npt.NDArray[np.uint16], how: Disturbance, rng: np.random.Generator
) -> npt.NDArray[np.uint16]:
    """A depth image (height, width) [mm] with random pixels and random rectangles between 0.5 m and 4.5 m."""
    height, width = image.shape
    found = image.copy()
    hit = rng.random(image.shape) < how.noise
    found[hit] = rng.integers(500, 4500, int(hit.sum()))
    for _ in range(how.rectangles):
        rows, columns = (int(size * how.rectangle_fraction * rng.uniform(0.2, 1.0)) for size in (height, width))
        top, left = rng.integers(0, height - rows), rng.integers(0, width - columns)
        found[top : top + rows, left : left + columns] = rng.integers(500, 4500)
    return found


def disturbed(frames: Iterable[VirtualFrame], how: Disturbance) -> Iterator[VirtualFrame]:
    """The disturbed frames of a sequence; a late frame is an additional one that repeats the previous stamp and image."""
    rng = np.random.default_rng(how.seed)
    last: VirtualFrame | None = None
    for frame in frames:
        image = disturbed_image(frame.image, how, rng)
        draw = rng.random()
        if last is not None and draw < how.late:
            yield last
        elif last is not None and draw < how.late + how.repeated:
            image = last.image
        elif last is not None and draw < how.late + how.repeated + how.blank:
            image = np.zeros_like(image)
        elif last is not None and draw < how.late + how.repeated + how.blank + how.corrupted:
            image = rng.integers(500, 4500, image.shape).astype(np.uint16)
        last = replace(frame, image=image)
        yield last
