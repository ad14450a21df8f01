"""2-D keypoints as inputs: rays of named sites, and points where a registered depth image shows them."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from voodoo._core import Frame
from voodoo.drawing.surfaces import Canvas, Log, same_place
from voodoo.measurements import KeypointImage
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.sensors.adapters.base import NOBODY, Adapter, Context, Memory
from voodoo.sensors.keypoints.sites import KeypointReport, KeypointSensor, assign_keypoints, nearest_person

KEYPOINT = (255, 120, 255)
"""Color in overlays, BGR."""


class KeypointsAdapter(Adapter[KeypointImage]):
    """Keypoints of 2-D networks; the person nearest to the prediction is the tracked one."""

    kind = "keypoints"
    measurement = KeypointImage
    panel = 2
    panel_of_its_own = False

    def add(self, frame: Frame, item: KeypointImage, context: Context) -> None:
        """As rays, or with depth as positions; `Memory` keeps the report of each sensor under "keypoints"."""
        chosen = context.settings
        person = nearest_person(item, predicted=context.predicted, min_confidence=chosen.min_confidence)
        if person is None:
            context.memory.put(self.kind, item.sensor, KeypointReport())
            return
        sensor = KeypointSensor(
            item.layout,
            item.camera,
            item.root_from_sensor,
            source=item.sensor,
            noise=chosen.keypoint_noise,
            model=chosen.model,
            min_confidence=chosen.min_confidence,
        )
        registered = next((depth for depth in context.depth_images if same_place(depth, item)), None)
        depth, unit = (None, 1.0) if registered is None else (registered.image, registered.meters_per_unit)
        # As lists: rows of an array, one by one, are slower.
        joints = dict(zip(context.estimate.joint_names, context.estimate.joint_positions.tolist(), strict=True))
        sites = [part.site for part in layout_of(item.layout).parts if part.site in joints]
        places = [joints[site] for site in sites]
        hidden = context.tracker.body_before(places, item.root_from_sensor[:3, 3])
        report, rays, points = sensor.observe(
            person,
            stamp=context.stamp,
            predicted=context.predicted,
            gate=context.gate,
            before=dict(zip(sites, hidden.tolist(), strict=True)),
            depth=depth,
            meters_per_unit=unit,
        )
        context.memory.put(self.kind, item.sensor, report)
        context.rays.extend(rays)
        for site, (position, sigma) in points.items():
            frame.add_position(site, position, weight=chosen.model.weight(sigma), source=item.sensor)

    def shares(self, item: KeypointImage, persons: Mapping[int, Context]) -> Mapping[int, KeypointImage]:
        """The detected people are assigned to the persons jointly."""
        least = next(iter(persons.values())).settings.min_confidence
        predicted = {number: context.predicted for number, context in persons.items()}
        of, rest = assign_keypoints(item, predicted, min_confidence=least)
        return {**of, NOBODY: rest}

    def forget(self, memory: Memory) -> None:
        """Nobody's keypoints are used."""
        memory.drop(self.kind)

    def draw(self, item: KeypointImage, canvas: Canvas, memory: Memory) -> None:
        """Rings in the picture they were found in, fainter with less confidence."""
        for person in item.people:
            rows = person[np.isfinite(person).all(axis=1) & (person[:, 2] > 0.0)]
            canvas.rings(item, rows[:, :2], rows[:, 2], color=KEYPOINT)

    def log(self, item: KeypointImage, log: Log, memory: Memory) -> None:
        """Rings in the camera's picture, with the outlines of the limbs."""
        path = log.camera(item)
        log.silhouettes(path, item)
        rows = np.vstack([*item.people, np.empty((0, 3))])
        rows = rows[np.isfinite(rows).all(axis=1) & (rows[:, 2] > 0.0)]
        rings = np.column_stack([np.full((len(rows), 3), KEYPOINT), 60 + 195 * rows[:, 2].clip(0.0, 1.0)])
        log.send(f"{path}/picture/keypoints", log.rr.Points2D(rows[:, :2], radii=4.0, colors=rings.astype(np.uint8)))
