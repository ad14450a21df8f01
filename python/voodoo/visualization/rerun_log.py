"""What adapters log a step of Rerun with."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate
from voodoo.measurements import FloatArray
from voodoo.model.body import Body
from voodoo.model.projection import CameraView, limb_outline
from voodoo.sensors.adapters.drawing import Pictured
from voodoo.visualization.body_geometry import limb_colours, nearest_limb

_BACKGROUND = (90, 90, 90)


@dataclass(frozen=True, eq=False)
class StepLog:
    """See `voodoo.sensors.adapters.Log`.

    Args:
        rr: the module `rerun`.
        stream: what is written to, at the step's time.
        estimate: of the step.
        body: with its sizes in the step.
        most_points: of larger clouds and images only a part is shown.
    """

    rr: Any
    stream: Any
    estimate: Estimate
    body: Body
    most_points: int

    @property
    def limbs(self) -> int:
        """How many limbs the body has."""
        return len(self.body.limbs)

    def send(self, path: str, *archetypes: Any) -> None:  # noqa: ANN401 - Rerun's own
        """See Log."""
        self.stream.log(path, *archetypes)

    def entity(self, sensor: str) -> str:
        """See Log."""
        return entity(sensor)

    def camera(self, item: Pictured) -> str:
        """See Log."""
        rr, path, pose = self.rr, f"world/cameras/{entity(item.sensor)}", item.root_from_sensor
        camera = item.camera
        self.send(path, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        self.send(
            f"{path}/picture",
            rr.Pinhole(
                image_from_camera=camera.matrix,
                resolution=(camera.width, camera.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.3,
            ),
        )
        return path

    def outlines(self, path: str, item: Pictured) -> None:
        """See Log."""
        outlines, colours = [], []
        for limb in self.body.limbs if self.estimate.joints else ():
            view = CameraView(item.camera, item.root_from_sensor)
            outline = limb_outline(limb.shape, self.estimate.world_from_limb[limb.name], view)
            if outline is not None:
                outlines.append(np.vstack([outline, outline[:1]]) + 0.5)
                colours.append(limb_colours(self.body)[limb.name])
        self.send(f"{path}/picture/model", self.rr.LineStrips2D(outlines, radii=0.5, colors=colours))

    def body_points(self, path: str, points: npt.NDArray[Any], pose: FloatArray) -> npt.NDArray[np.intp]:
        """See Log."""
        world = np.asarray(points, dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3]
        colours = np.array([*limb_colours(self.body).values(), _BACKGROUND], dtype=np.uint8)
        limbs = nearest_limb(world, self.estimate, self.body)
        self.send(path, self.rr.Points3D(world, radii=0.006, colors=colours[limbs]))
        return limbs


def entity(name: str) -> str:
    """The name of a sensor as part of a path."""
    return name.strip("/").replace("/", "_").replace(" ", "_") or "sensor"
