"""Small made-up recordings for the tests of several people."""

from functools import cache

import numpy as np

import voodoo
from synthetic.gait import path
from synthetic.people import MadeUpRecording, Scene, Walker
from synthetic.stories import base_from_camera

WALL = ((4.6, -4.0, 0.0), (4.8, 4.0, 3.0))


@cache
def two_people() -> MadeUpRecording:
    """Somebody stands; 0.8 s later somebody else comes from the left. 3.2 s, ten frames a second."""
    stands = Walker(body=voodoo.Body.human(1.72), stops=path([(0.3, 2.6, -0.5), (3.2, 2.6, -0.5)]))
    comes = Walker(
        body=voodoo.Body.human(1.84),
        stops=path([(0.6, 3.2, 2.3), (2.0, 3.2, 0.7), (3.2, 3.2, 0.7)]),
        shirt=(60, 150, 60),
    )
    return MadeUpRecording(
        Scene(
            name="two people",
            people=(stands, comes),
            seconds=3.2,
            furniture=(WALL,),
            root_from_sensor=lambda _: base_from_camera(),
            rate_hz=10.0,
            seed=3,
        )
    )


def places_in(recording: MadeUpRecording, index: int) -> np.ndarray:
    """Points (N, 3) [m] of a depth image in the root frame."""
    depth = next(item for item in list(recording)[index].measurements if item.sensor == "/camera/depth")
    z = depth.image.astype(float) * depth.meters_per_unit
    points = np.concatenate([depth.camera.rays()[..., :2] * z[..., None], z[..., None]], axis=2)[z > 0.0]
    return points @ depth.root_from_sensor[:3, :3].T + depth.root_from_sensor[:3, 3]
