"""Whether keypoints fit the calibration of their cameras and the depth beside them, and if not, the likely reason."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import combinations, islice, permutations
from typing import TypeAlias, TypeVar

import numpy as np

from voodoo.errors import RecordingError
from voodoo.measurements import DepthImage, FloatArray, KeypointImage
from voodoo.model.camera import Camera
from voodoo.model.projection import transform
from voodoo.model.rays import passing
from voodoo.model.transforms import inverse
from voodoo.recordings.keypoint_layouts import LAYOUTS, LIMBS, layout_by_shape, layout_of

S = TypeVar("S")
T = TypeVar("T")
Instant: TypeAlias = Sequence[KeypointImage]
"""The keypoints of all cameras at one time."""
Change: TypeAlias = Callable[[FloatArray, tuple[int, int]], FloatArray]

WRONG_M, RIGHT_M = 0.10, 0.05
"""Median distance between the rays of two cameras to one keypoint: above the first the calibration does not fit, below the second
an explanation is accepted. It is 2 to 3 cm in sound recordings, and 15 cm and more with every mistake below."""
_ADULT_M, _SPREADS_M = 0.4, (0.1, 1.5)
"""Median distance of a person's keypoints from their center: that of a standing adult, and a range that other units are outside
of."""
_CONFIDENT = 0.3
_FEWEST = 20
"""Distances, or limbs, that a judgment needs."""
_FEWEST_OF_A_PERSON = 5
_PARALLEL = 0.05**2
"""Squared sine of the angle between two rays below which their distance says nothing."""
_OUTSIDE, _MOST_OUTSIDE = 0.05, 0.1
"""Networks guess joints a little outside of a picture: by this share of its size, and this share of the keypoints."""
_INSTANTS = 8
_OFF, _ON = 0.5, 0.75
"""Share of limbs that stand out: below the first the keypoints may not lie on a person, above the second they do. It is 0.9 of a
person in a room, 0.2 and less of keypoints on walls and furniture; also of who lies on a sofa, hence the second number."""
_BESIDE_M, _FARTHER_M = 0.3, 0.15
"""Beside a limb by the first, at least on one side, the surface is farther than the limb by the second."""
_CELL = 8
"""Width of the cells in which the nearest depth is kept [px]."""
_FARTHEST_PX = 1e6
"""Pixels beyond, which damaged files have, are in no picture."""
_UNITS = {1000.0: "millimeters", 100.0: "centimeters", 1.0 / 0.3048: "feet", 1.0 / 0.0254: "inches"}
_TIMES = (2.0, 1.5, 3.0, 4.0)
_USUAL = (*_TIMES, *(1.0 / times for times in _TIMES))
_SIZES = (*_USUAL, *(float(factor) for factor in np.geomspace(0.2, 5.0, 66)))
"""Factors from the pixels of the keypoints to those of the calibration that are tried: usual ones, then in steps of 5 %."""
_ALIKE_M = 0.01
"""Explanations whose distances differ by less are equally good; the first one, which is the more usual one, is named."""
_TURNS: dict[str, Change] = {
    "shares of the picture's width and height, not pixels": lambda at, size: at * size,
    "of mirrored pictures": lambda at, size: np.column_stack([size[0] - 1 - at[:, 0], at[:, 1]]),
    "of pictures turned by 180 degrees": lambda at, size: np.array(size) - 1 - at,
    "of pictures turned by 90 degrees clockwise": lambda at, size: np.column_stack([at[:, 1], size[1] - 1 - at[:, 0]]),
    "of pictures turned by 90 degrees counterclockwise": lambda at, size: np.column_stack(
        [size[0] - 1 - at[:, 1], at[:, 0]]
    ),
}


@dataclass(frozen=True)
class Agreement:
    """How well the rays of several cameras meet.

    Args:
        distance: median distance between two cameras' rays of one keypoint [m]; NaN: too few to say.
        spread: median distance of a person's keypoints from their center [m].
    """

    distance: float
    spread: float


def some_of(places: Sequence[S], read: Callable[[S], T], *, good: Callable[[T], object]) -> list[T]:
    """A few good items, spread over their places; all are read only if few are good."""
    count = len(places)
    step = max(count // _INSTANTS, 1)
    items = (read(places[index]) for index in dict.fromkeys((*range(step // 2, count, step), *range(count))))
    return list(islice(filter(good, items), _INSTANTS))


def check_keypoints(where: object, instants: Sequence[Instant]) -> tuple[str, ...]:
    """Compare keypoints with the calibration of their cameras.

    Args:
        where: named in errors.
        instants: some instants of a recording with persons.

    Returns:
        What should be said: rays that meet badly, though not badly enough for an error.

    Raises:
        RecordingError: the rays of the cameras do not meet, the persons have no human size, or keypoints are outside their
            pictures; names the likely reason.
    """
    found, outside = agreement(instants), _outside(instants)
    wrong = found.distance > WRONG_M
    # Where a person stands between level cameras, the rays of mirrored pictures meet, too, but not as well.
    some = instants[::3]
    other = _reading(some, sizes=_SIZES if wrong else _USUAL) if found.distance > _ALIKE_M else None
    if wrong or (other is not None and other[0].distance < agreement(some).distance / 2.0):
        met = f"expected keypoints at which the rays of two cameras meet, found {_long(found.distance)} between them"
        beside = f" and {outside:.0%} of the keypoints outside of their pictures" if outside > _MOST_OUTSIDE else ""
        if other is not None:
            reason = f"{other[1]}: then they meet within {_long(other[0].distance)}"
        else:
            reason = _unit(found) or "do keypoints and calibration belong to the same pictures?"
        raise RecordingError(f"{where}: {met} in the median{beside}; {reason}")
    if np.isfinite(found.distance) and not _human(found):
        size = f"persons whose keypoints are {_long(found.spread)} from their center, {_ADULT_M} m for an adult"
        reason = _unit(found) or "is it in another unit?"
        raise RecordingError(f"{where}: expected a calibration in meters, found {size}; {reason}")
    if outside > _MOST_OUTSIDE:
        reason = f"do keypoints and calibration belong to pictures of the same size?{_room(instants)}"
        raise RecordingError(
            f"{where}: expected keypoints inside of their pictures, found {outside:.0%} outside; {reason}"
        )
    notes = []
    if found.distance > RIGHT_M:
        notes.append(f"two cameras' rays to a keypoint meet within {_long(found.distance)}; 3 cm would be usual")
    for index, image in enumerate(instants[0] if instants else ()):
        own = agreement(instants, only=index).distance
        if len(instants[0]) > 2 and own > WRONG_M:
            away = f"its rays pass those of the other cameras at {_long(own)}; do its keypoints fit its calibration?"
            notes.append(f"{image.sensor}: {away}")
    return tuple(notes)


def taken_layout(people: Sequence[FloatArray], asked: str | None) -> tuple[str, tuple[str, ...]]:
    """The layout of the keypoints (K, 3) of some persons, and what should be said about it.

    `asked` is what the user says; None: it is told by the number of keypoints and the shape of the persons.
    """
    shape, certain = layout_by_shape(people)
    if shape is None:
        return asked or "body25b", ()
    if asked is None:
        fit = " and ".join(name for name, layout in LAYOUTS.items() if layout.count == len(people[0]))
        notes = f"{len(people[0])} keypoints fit {fit}, and the persons do not tell: taken for {shape}; --layout says another"
        return shape, (f"{len(people[0])} keypoints, taken for {shape}; --layout says another" if certain else notes,)
    notes = f"the layout is {asked}, as asked for, but the persons have the shape of {shape}"
    return asked, (notes,) if certain and shape != asked else ()


def agreement(instants: Sequence[Instant], change: Change = lambda at, _: at, *, only: int | None = None) -> Agreement:
    """How well the rays meet, after a change of the pixels; `only`: the rays of one camera with those of the others."""
    distances: list[FloatArray] = []
    spreads: list[float] = []
    for instant in instants:
        rays = [[_rays(image, rows, change) for rows in image.people] for image in instant]
        for pair in combinations(range(len(rays)), 2):
            few, many = sorted((rays[index] for index in pair), key=len)
            if only is not None and only not in pair:
                continue
            for one in few:
                # Networks list people in any order: the other camera's person is the one whose rays pass nearest.
                met = [passing(*one, *other, parallel=_PARALLEL) for other in many]
                met = [each for each in met if len(each[0]) >= _FEWEST_OF_A_PERSON]
                if met:
                    away, places, _ = min(met, key=lambda each: float(np.median(each[0])))
                    distances.append(away)
                    spreads.append(float(np.median(np.linalg.norm(places - np.median(places, axis=0), axis=1))))
    gathered = np.concatenate(distances) if distances else np.empty(0)
    if len(gathered) < _FEWEST:
        return Agreement(np.nan, np.nan)
    return Agreement(float(np.median(gathered)), float(np.median(spreads)))


def _rays(image: KeypointImage, rows: FloatArray, change: Change) -> tuple[FloatArray, FloatArray]:
    """Origin (3,) and directions (K, 3) of one person's keypoints in the root frame; NaN where there is none."""
    pixels = change(rows[:, :2], (image.camera.width, image.camera.height))
    ahead = np.column_stack([image.camera.undistorted(pixels), np.ones(len(rows))])
    ahead[rows[:, 2] < _CONFIDENT] = np.nan
    with np.errstate(over="ignore", invalid="ignore"):  # keypoints of damaged files are any numbers
        turned = ahead @ image.root_from_sensor[:3, :3].T
        return image.root_from_sensor[:3, 3], turned / np.linalg.norm(turned, axis=1, keepdims=True)


def _reading(instants: Sequence[Instant], *, sizes: Sequence[float]) -> tuple[Agreement, str] | None:
    """Another reading of the keypoints with which the rays meet best, in words; None: with none they do."""
    possible = _possible(instants, readings(instants[0][0].camera, sizes))
    tried = [(agreement(instants, change), words) for words, change in possible]
    tried += [(agreement(_reordered(instants, it)), _order_words(instants[0], it)) for it in _orders(instants[0])]
    tried = [(each, words) for each, words in tried if _human(each) and each.distance < RIGHT_M]
    least = min((each.distance for each, _ in tried), default=np.inf)
    return next((one for one in tried if one[0].distance < least + _ALIKE_M), None)


def readings(camera: Camera, sizes: Sequence[float] = _USUAL) -> Iterator[tuple[str, Change]]:
    """What keypoints could be of, in words, and the change to pixels of the calibrated pictures."""
    for words, change in _TURNS.items():
        yield f"they are {words}", change
    for factor in sizes:
        yield f"they are of pictures of about {_size_words(camera, factor)}", partial(_resized, by=factor)


def _size_words(camera: Camera, factor: float) -> str:
    size = f"{round(camera.width / factor)}x{round(camera.height / factor)} pixels"
    return f"{size} ({1.0 / factor:.2g} times the calibrated size)"


def _possible(instants: Sequence[Instant], tried: Iterable[tuple[str, Change]]) -> Iterator[tuple[str, Change]]:
    """The readings by which keypoints are inside of their pictures: those outside are of larger ones, not of smaller ones."""
    return ((words, change) for words, change in tried if _outside(instants, change) <= _MOST_OUTSIDE)


def _room(instants: Sequence[Instant]) -> str:
    """The smallest of the usual pictures in which keypoints have room, in words; "" if they have in none."""
    camera = instants[0][0].camera
    larger = ((_size_words(camera, factor), partial(_resized, by=factor)) for factor in sorted(_USUAL, reverse=True))
    words = next((words for words, _ in _possible(instants, larger)), "")
    return words and f" They have room in pictures of {words}"


def _resized(at: FloatArray, _: tuple[int, int], *, by: float) -> FloatArray:
    return (at + 0.5) * by - 0.5


def _human(found: Agreement) -> bool:
    return _SPREADS_M[0] < found.spread < _SPREADS_M[1]


def _unit(found: Agreement) -> str:
    if _human(found):
        return ""
    for units, name in _UNITS.items():
        scaled = Agreement(found.distance / units, found.spread / units)
        if _human(scaled) and scaled.distance < RIGHT_M:
            near = f"in meters they meet within {_long(scaled.distance)}"
            return f"the calibration is in {name}: {near}; --option meters_per_unit={1.0 / units:g}"
    return ""


def _orders(cameras: Instant) -> Iterator[tuple[int, ...]]:
    """Other assignments of keypoints to cameras: all of up to four cameras, exchanges of two and shifts of more."""
    count = len(cameras)
    same = tuple(range(count))
    if count <= 4:
        yield from (order for order in permutations(same) if order != same)
        return
    yield from (same[shift:] + same[:shift] for shift in range(1, count))
    for a, b in combinations(same, 2):
        yield tuple(b if item == a else a if item == b else item for item in same)


def _reordered(instants: Sequence[Instant], order: tuple[int, ...]) -> list[Instant]:
    """The instants with the people of image `order[i]` in camera i."""
    return [
        [replace(image, people=instant[other].people) for image, other in zip(instant, order, strict=True)]
        for instant in instants
    ]


def _order_words(cameras: Instant, order: tuple[int, ...]) -> str:
    pairs = [
        f"{cameras[other].sensor}'s for {image.sensor}"
        for image, other in zip(cameras, order, strict=True)
        if image is not cameras[other]
    ]
    return f"they are of other cameras, {', '.join(pairs)}"


def _outside(instants: Sequence[Instant], change: Change = lambda at, _: at) -> float:
    """Share of the confident keypoints that lie outside of their pictures, after a change of the pixels."""
    out = []
    for image in (image for instant in instants for image in instant):
        size = (image.camera.width, image.camera.height)
        for rows in image.people:
            at = change(rows[rows[:, 2] >= _CONFIDENT, :2], size) / np.array(size)
            out.append(((at < -_OUTSIDE) | (at > 1.0 + _OUTSIDE)).any(axis=1))
    gathered = np.concatenate(out) if out else np.empty(0)
    return float(gathered.mean()) if len(gathered) else 0.0


def _long(meters: float) -> str:
    return f"{meters * 100:.1f} cm" if meters < 1.0 else f"{meters:.1f} m"


def check_on_depth(where: object, pairs: Sequence[tuple[KeypointImage, DepthImage]]) -> None:
    """Compare keypoints with the depth they lie on.

    Args:
        where: named in errors.
        pairs: keypoint images with a depth image of about the same time; some are used.

    Raises:
        RecordingError: limbs do not stand out from what is behind them, but would with another reading of the keypoints, which
            is named.
    """
    pairs = [pair for pair in pairs if pair[0].people]
    views = [(image, _nearest(image, depth)) for image, depth in pairs[:: max(len(pairs) // _INSTANTS, 1)][:_INSTANTS]]
    found = _standing_out(views, lambda at, _: at)
    if found is None or found.share >= _OFF:
        return
    possible = _possible([[image] for image, _ in views], readings(views[0][0].camera))
    tried = [(other, words) for words, change in possible if (other := _standing_out(views, change)) is not None]
    # Furniture stands out as well: of the readings that fit, the size of the person tells.
    fitting = [(other.share - other.misfit, other, words) for other, words in tried if other.share >= _ON]
    if fitting:
        _, other, words = max(fitting, key=lambda each: each[0])
        raise RecordingError(
            f"{where}: expected keypoints on a person in the depth images, found {found.share:.0%} of the limbs before what is "
            f"behind them; {words}: then {other.share:.0%} are"
        )


@dataclass(frozen=True)
class _Standing:
    """How keypoints lie on depth: share of the limbs whose middle is nearer than the surface on one of their sides, and size of
    the persons at that depth, as the logarithm of how many times an adult's it is, without its sign."""

    share: float
    misfit: float


def _standing_out(views: Sequence[tuple[KeypointImage, FloatArray]], change: Change) -> _Standing | None:
    """How keypoints lie on depth after a change of the pixels; None: too few limbs."""
    near, count = 0, 0
    spreads: list[float] = []
    for image, nearest in views:
        at = {part.site: next(iter(part.weights)) for part in layout_of(image.layout).parts}
        ends = np.array([(at[above], at[below]) for above, below in LIMBS if above in at and below in at])
        for rows in image.people:
            pixels = np.clip(rows[:, :2], -_FARTHEST_PX, _FARTHEST_PX)
            pixels = change(pixels, (image.camera.width, image.camera.height))
            a, b = pixels[ends[(rows[ends, 2] >= _CONFIDENT).all(axis=1)]].transpose(1, 0, 2)
            middle, along = (a + b) / 2.0, b - a
            across = np.column_stack([-along[:, 1], along[:, 0]]) / np.maximum(np.hypot(*along.T), 1e-9)[:, None]
            depth = _at(nearest, middle)
            visible = np.isfinite(depth)
            aside = (
                np.where(visible, image.camera.fx * _BESIDE_M / np.where(visible, depth, 1.0), 0.0)[:, None] * across
            )
            behind = np.maximum(_at(nearest, middle + aside), _at(nearest, middle - aside))
            if visible.any():
                at_person = pixels[rows[:, 2] >= _CONFIDENT]
                spread = np.median(np.linalg.norm(at_person - np.median(at_person, axis=0), axis=1))
                spreads.append(float(spread * np.median(depth[visible]) / image.camera.fx))
            near += int((visible & (behind > np.where(visible, depth, 0.0) + _FARTHER_M)).sum())
            count += len(a)
    if count < _FEWEST:
        return None
    spread = float(np.median(spreads)) if spreads else 0.0
    return _Standing(near / count, abs(np.log(spread / _ADULT_M)) if spread > 0.0 else np.inf)


def _nearest(image: KeypointImage, depth: DepthImage) -> FloatArray:
    """The nearest depth [m] in cells of the keypoints' picture; infinite where nothing is seen."""
    z, rays = depth.meters(), depth.camera.rays().astype(np.float64)
    valid = np.isfinite(z) & np.isfinite(rays).all(axis=2)
    points = np.column_stack([rays[valid] * z[valid][:, None], z[valid]])
    points = transform(inverse(image.root_from_sensor) @ depth.root_from_sensor, points)
    cells = np.floor(image.camera.project(points) / _CELL)
    shape = np.array([image.camera.width, image.camera.height]) // _CELL + 1
    inside = (np.isfinite(cells) & (cells >= 0) & (cells < shape)).all(axis=1)
    nearest = np.full(shape[::-1], np.inf)
    u, v = cells[inside].astype(int).T
    np.minimum.at(nearest, (v, u), points[inside, 2])
    return nearest


def _at(nearest: FloatArray, pixels: FloatArray) -> FloatArray:
    u, v = np.floor(pixels / _CELL).astype(int).T
    inside = (u >= 0) & (v >= 0) & (v < nearest.shape[0]) & (u < nearest.shape[1])
    return np.where(inside, nearest[np.where(inside, v, 0), np.where(inside, u, 0)], np.inf)
