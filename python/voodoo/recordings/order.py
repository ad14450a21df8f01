"""The order of files by the numbers in their names, and which files belong together."""

from __future__ import annotations

import re
from collections.abc import Sequence
from pathlib import Path


def natural(name: str) -> list[tuple[int, str]]:
    """Sort key by which cam_2 comes before cam_10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", name)]


def in_order(files: Sequence[Path]) -> list[Path]:
    """Files by the numbers in their names: 2.json before 10.json; names that are times in seconds are compared as such."""
    try:
        return sorted(files, key=lambda file: (float(file.stem), str(file)))
    except ValueError:
        return sorted(files, key=lambda file: (natural(file.stem), str(file)))


def numbers_of(files: Sequence[Path]) -> list[int] | None:
    """The number of each file: the last one of its name that differs between all of them; None: there is none."""
    rows = [[int(number) for number in re.findall(r"\d+", file.stem)] for file in files]
    if len({len(row) for row in rows}) == 1:
        for column in reversed(list(zip(*rows, strict=True))):
            if len(set(column)) == len(files):
                return list(column)
    return None


def by_image(files: Sequence[Path], count: int) -> list[Path | None] | None:
    """The file of each of `count` images, None where it is missing; None: names and number of files do not tell.

    As many files as images are taken in their order, fewer by their numbers if these reach from the first image to the last.
    """
    numbers = numbers_of(files)
    if len(files) == count:
        return list(in_order(files))
    first = min(numbers, default=0) if numbers else 0
    if not numbers or first > 1 or max(numbers) != first + count - 1:
        return None
    of = dict(zip(numbers, files, strict=True))
    return [of.get(first + index) for index in range(count)]


def matched(cameras: Sequence[str], sources: Sequence[str]) -> list[tuple[int, int]] | None:
    """Which camera each source belongs to, as (camera, source) in the order of the cameras; None: they do not tell.

    By their names (CAM_01 is cam1), by the last numbers in them, or, if there are as many of both, in natural order.
    """
    for key in (_plain, _last_number):
        of = {key(name): index for index, name in enumerate(sources)}
        pairs = [(index, of[key(name)]) for index, name in enumerate(cameras) if key(name) in of]
        if len({key(name) for name in cameras}) == len(cameras) and len(pairs) == len(of) == len(sources):
            return pairs
    if len(cameras) != len(sources):
        return None
    return list(zip(_natural_order(cameras), _natural_order(sources), strict=True))


def _natural_order(names: Sequence[str]) -> list[int]:
    return sorted(range(len(names)), key=lambda index: natural(names[index]))


def _plain(name: str) -> tuple[str, ...]:
    return tuple(str(int(part)) if part.isdecimal() else part for part in re.findall(r"[a-z]+|\d+", name.lower()))


def _last_number(name: str) -> int:
    return int((re.findall(r"\d+", name) or ["-1"])[-1])
