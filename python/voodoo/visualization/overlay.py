"""Overlay images: limbs, joints and measured points drawn over the sensor's image."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from itertools import islice
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.drawing.ink import INK, LEFT, MIDDLE, PAPER, RIGHT, SUBPIXEL, Color, Picture, person_color, point
from voodoo.drawing.surfaces import Canvas, Pictured, same_place
from voodoo.measurements import RecordedFrame
from voodoo.model.body import Body
from voodoo.model.projection import Axes, CameraView, TopView
from voodoo.model.standing import is_optical
from voodoo.names import SEARCHING
from voodoo.people import ONE, PeopleEstimate, everybody
from voodoo.pipeline.front_end import FrontEnd
from voodoo.pipeline.pairing import paired
from voodoo.recordings.recording import Recording
from voodoo.sensors.adapters import Memory, adapter_of, adapters_of
from voodoo.sensors.adapters.points import SCAN
from voodoo.sensors.adapters.skin import SKIN
from voodoo.visualization.body_drawing import draw_body, draw_people

_STATUS = {"tracking": (150, 220, 120), "degraded": (80, 200, 250), "lost": (80, 80, 250), SEARCHING: (230, 190, 110)}
_AHEAD_FRAMES, _MOST_PANELS = 5, 4
_TARGET_HEIGHT, _TARGET_HEIGHT_OF_FOUR = 640, 480
_TOP_SIZE, _TOP_METERS = 720, 6.0


class Overlay:
    """Draws the frames of one recording, with the same mapping of depth to color in all frames.

    Args:
        recording: provides the number of frames and the root frame.
    """

    def __init__(self, recording: Recording) -> None:
        """Find the cameras in the first frames, because every image of a video has the same size."""
        self._frames = len(recording)
        self._axes: Axes = "optical" if is_optical(recording.root_frame) else "rep103"
        self._range: tuple[float, float] | None = None
        self._origin: float | None = None
        # Center of the view from above until a person is found.
        self._center = (0.0, 0.0, 0.0)
        found: dict[str, Pictured] = {}
        for recorded in islice(paired(recording), _AHEAD_FRAMES):
            for item in _pictured(recorded):
                own = adapter_of(item).panel_of_its_own
                if item.sensor not in found and (own or not any(same_place(item, other) for other in found.values())):
                    found[item.sensor] = item
        self._panels = dict(sorted(found.items(), key=lambda pair: adapter_of(pair[1]).panel or 0)[:_MOST_PANELS])
        # Four landscape images are arranged two by two.
        four = len(self._panels) == 4 and all(i.camera.width > i.camera.height for i in self._panels.values())
        self._columns = 2 if four else max(len(self._panels), 1)
        self._height = _TARGET_HEIGHT_OF_FOUR if four else _TARGET_HEIGHT

    def draw(
        self,
        recorded: RecordedFrame,
        bodies: Body | Mapping[int, Body],
        estimate: Estimate | PeopleEstimate,
        *,
        index: int,
        front_end: FrontEnd[Any] | None = None,
    ) -> Picture:
        """Draw one frame over the image of each camera, side by side or two by two; without images, as a view from above.

        Several persons have a separate color and number each, and are drawn without the measurements.

        Args:
            recorded: the measurements.
            bodies: with the sizes they had in this frame: that of a single person, or number -> body.
            estimate: the poses.
            index: number of the frame, from 0, for the caption.
            front_end: provides the rays and skin regions of the frame.
        """
        bodies = bodies if isinstance(bodies, Mapping) else {ONE: bodies}
        canvases = list(self._canvases(recorded))
        if not canvases:
            places = [place for one in everybody(estimate) for place in one.estimate.joints.values()]
            if places:
                x, y, z = (float(value) for value in np.median(places, axis=0))
                self._center = x, y, z
            top = TopView(self._center, _TOP_METERS / _TOP_SIZE, _TOP_SIZE, self._axes)
            canvases.append(Canvas(_grid(top), top))
        memory, rays = (Memory(), ()) if front_end is None else (front_end.memory, front_end.rays)
        for canvas in canvases:
            if isinstance(estimate, PeopleEstimate):
                draw_people(canvas.picture, estimate, bodies, canvas.view)
            else:
                draw_body(canvas.picture, bodies[ONE], estimate, canvas.view)
                for item in recorded.measurements:
                    for adapter in adapters_of(item):
                        adapter.draw(item, canvas, memory)
                canvas.rays(rays, estimate)
            canvas.finish()
        picture = in_rows([canvas.picture for canvas in canvases], columns=self._columns)
        self._origin = estimate.stamp if self._origin is None else self._origin
        when = f"{index + 1}/{self._frames}   {estimate.stamp - self._origin:.2f} s"
        caption(picture, when, estimate)
        return picture

    def _canvases(self, recorded: RecordedFrame) -> Iterator[Canvas]:
        """The canvas of each camera."""
        current = {item.sensor: item for item in _pictured(recorded)}
        for sensor, first in self._panels.items():
            scale = _scale(first, self._height)
            observed = self._background(current.get(sensor), first)
            resized = cv2.resize(observed, None, fx=scale, fy=scale, interpolation=cv2.INTER_NEAREST)
            item = current.get(sensor, first)
            view = CameraView(item.camera, item.root_from_sensor, scale)
            yield Canvas(np.asarray(resized, dtype=np.uint8), view, item, scale)

    def _background(self, item: Pictured | None, first: Pictured) -> Picture:
        """The image of the camera; a dark background if there is no new one, or only keypoints."""
        observed = None if item is None else adapter_of(item).picture(item)
        if observed is None:
            return np.full((first.camera.height, first.camera.width, 3), PAPER, dtype=np.uint8)
        return np.array(observed) if observed.ndim == 3 else self._depth_picture(observed)

    def _depth_picture(self, meters: npt.NDArray[np.float32]) -> Picture:
        """Depth as color: near is bright; pixels without a return are dark."""
        observed = np.isfinite(meters) & (meters > 0.0)
        if self._range is None and observed.any():
            near, far = np.percentile(meters[observed], [1.0, 97.0])
            self._range = float(near) - 0.3, float(far) + 0.6
        near, far = self._range or (0.5, 5.0)
        level = np.where(observed, 1.0 - np.clip((meters - near) / (far - near), 0.0, 1.0), 0.0)
        tone = (40.0 + 190.0 * level**1.3).astype(np.uint8)
        picture = np.asarray(cv2.applyColorMap(tone, cv2.COLORMAP_BONE), dtype=np.uint8)
        picture[~observed] = PAPER
        return picture


def _pictured(recorded: RecordedFrame) -> Sequence[Pictured]:
    return [item for item in recorded.measurements if adapter_of(item).panel is not None]  # type: ignore[misc]


def caption(picture: Picture, text: str, estimate: Estimate | PeopleEstimate) -> None:
    """Write frame number, status and, if there is one, residual into the top left corner; of several the status of each."""
    if isinstance(estimate, PeopleEstimate):
        parts = [(f"{person.id} {person.status}", person_color(person.id)) for person in estimate]
    else:
        parts = [(estimate.status, _STATUS.get(estimate.status, INK))]
        if np.isfinite(estimate.residual):
            parts.append((f"{1e3 * estimate.residual:.0f} mm", INK))
    write_parts(picture, [(text, INK), *parts])


def legend(width: int) -> Picture:
    """A strip (36, width, 3) that tells what the colors of the model and of the status mean."""
    strip = np.full((36, width, 3), PAPER, dtype=np.uint8)
    sides = [("left limbs of the person", LEFT), ("right limbs", RIGHT), ("trunk and head", MIDDLE), ("joints", INK)]
    write_parts(strip, [*sides, ("skin", SKIN), ("laser", SCAN), ("status:", INK), *_STATUS.items()], size=0.55)
    return strip


def write_parts(picture: Picture, parts: Sequence[tuple[str, Color]], *, size: float | None = None) -> None:
    """Write text in several colors into the top left corner; size: of the letters, None: by the height of the picture."""
    size = picture.shape[0] / 1100.0 if size is None else size
    x, y = round(22 * size), round(42 * size)
    for part, color in parts:
        for dx, dy in ((-1, 0), (1, 0), (0, -1), (0, 1)):  # a dark rim keeps the text legible over bright depth
            cv2.putText(picture, part, (x + dx, y + dy), cv2.FONT_HERSHEY_DUPLEX, size, PAPER, 1, cv2.LINE_AA)
        cv2.putText(picture, part, (x, y), cv2.FONT_HERSHEY_DUPLEX, size, color, 1, cv2.LINE_AA)
        x += cv2.getTextSize(part, cv2.FONT_HERSHEY_DUPLEX, size, 1)[0][0] + round(28 * size)


def _scale(item: Pictured, target: int) -> float:
    """Scale factor: small images are enlarged by an integer, large ones are reduced to the target height."""
    height = item.camera.height
    return float(-(-target // height)) if height <= target else target / height


def _grid(view: TopView) -> Picture:
    """Dark background with a grid of one meter."""
    picture = np.full((view.size, view.size, 3), PAPER, dtype=np.uint8)
    half = view.size * view.meters_per_pixel / 2.0
    center = np.array(view.center)
    horizontal = (0, 1) if view.axes == "rep103" else (0, 2)
    for along, across in (horizontal, horizontal[::-1]):
        for value in np.arange(np.ceil(center[along] - half), center[along] + half):
            ends = np.repeat(center[None], 2, axis=0)
            ends[:, along] = value
            ends[:, across] += (-half, half)
            a, b = (point(pixel) for pixel in view.project(ends)[0])
            cv2.line(picture, a, b, (62, 56, 52), 1, cv2.LINE_AA, SUBPIXEL)
    return picture


def in_rows(pictures: Sequence[Picture], *, columns: int) -> Picture:
    """Images in rows of `columns`, scaled to the height of the first one in a row, all rows to the width of the first one;
    black where there are too few."""
    pictures = [*pictures, *[np.zeros_like(pictures[0])] * (-len(pictures) % columns)]
    starts = range(0, len(pictures), columns)
    rows = [np.hstack(_fitted(pictures[start : start + columns], 0)) for start in starts]
    return np.asarray(np.vstack(_fitted(rows, 1)), dtype=np.uint8)


def _fitted(pictures: Sequence[Picture], axis: int) -> list[npt.NDArray[Any]]:
    """Images scaled to the size of the first one along an axis: 0 height, 1 width."""
    size = pictures[0].shape[axis]
    fitted = []
    for picture in pictures:
        height, width = (round(side * size / picture.shape[axis]) for side in picture.shape[:2])
        fitted.append(cv2.resize(picture, (width, height), interpolation=cv2.INTER_AREA))
    return fitted
