"""See what the tracker sees: measurements, limbs, rays, pictures and curves on one timeline, in Rerun.

Rerun is an optional extra: `pip install voodoo[view]`.
"""

from __future__ import annotations

import colorsys
import math
import os
import sys
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Any, TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo._core import Estimate, TaperedEllipticCylinder
from voodoo.body import Body
from voodoo.errors import VoodooError
from voodoo.recordings import ColorImage, DepthImage, KeypointImage, LaserScan, MarkerSet, PointCloud, RecordedFrame
from voodoo.sensors.front_end import FrontEnd
from voodoo.views import CameraView, limb_outline

FloatArray: TypeAlias = npt.NDArray[np.float64]

_AROUND = 24
_ON_BODY_M = 0.12
_BACKGROUND = (90, 90, 90)
_MOST_POINTS = 40_000
_EPOCH_S = 1e9


class Viewer:
    """Writes what happens in a step to a Rerun file, or to a viewer on this machine; use it in a `with` block.

    Entities: `world/body/limbs/<limb>`, `world/body/joints`, `world/body/bands`, `world/points/<source>` (coloured by
    the limb they lie on), `world/laser/<source>`, `world/markers/<source>`, `world/rays`, `world/cameras/<source>`
    (pictures with the outlines of the projected limbs, skin candidates and keypoints; in depth images the person's
    silhouette, limb by limb), `plots/...`; the timeline is `time`.

    Args:
        save: .rrd file to write; None opens the viewer.
        name: of the recording, shown in the viewer.

    Raises:
        VoodooError: Rerun is not installed, another suffix, or a viewer that cannot open here.
        OSError: the file cannot be written.
    """

    def __init__(self, *, save: str | Path | None = None, name: str = "voodoo") -> None:
        """Open the file or the viewer."""
        self._rr = _rerun()
        if save is not None and Path(save).suffix != ".rrd":
            raise VoodooError(f"{save}: expected a name that ends in .rrd, found {Path(save).suffix!r}")
        self._stream: Any = self._rr.RecordingStream("voodoo", recording_id=None)
        self._stream.send_recording_name(name)
        if save is None:
            self._open()
        else:
            Path(save).parent.mkdir(parents=True, exist_ok=True)
            self._stream.save(str(save))
        self._classes: tuple[str, ...] = ()
        self._stream.log("world", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._shapes: dict[str, TaperedEllipticCylinder] = {}

    def _open(self) -> None:
        """Start the viewer; without a screen it would end unseen."""
        if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise VoodooError(
                "view: expected a screen to open the viewer on, found none; --save FILE.rrd writes a file"
            )
        try:
            self._stream.spawn()
        except (RuntimeError, OSError) as error:
            reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            raise VoodooError(f"view: the viewer did not start ({reason}); --save FILE.rrd writes a file") from error

    def __enter__(self) -> Viewer:
        """The viewer itself."""
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Finish the file."""
        self.close()

    def close(self) -> None:
        """Write what is still held back, and close the file."""
        self._stream.flush()
        self._stream.disconnect()

    def log(
        self,
        estimate: Estimate,
        body: Body,
        *,
        recorded: RecordedFrame | None = None,
        front_end: FrontEnd | None = None,
        seconds: float | None = None,
    ) -> None:
        """Show one step.

        Args:
            estimate: of the step.
            body: with its current sizes (`Tracker.body`).
            recorded: the measurements.
            front_end: gives the rays and skin candidates of the step.
            seconds: time the step took.
        """
        # Stamps of a robot count from 1970, those of other recordings from their start.
        clock = "timestamp" if estimate.stamp > _EPOCH_S else "duration"
        self._stream.set_time("time", **{clock: estimate.stamp})
        self._log_body(estimate, body)
        if recorded is not None:
            for item in recorded.measurements:
                self._log_measurement(item, estimate, body)
        if front_end is not None:
            self._log_front_end(front_end, estimate)
        self._log_plots(estimate, seconds)

    def _log_body(self, estimate: Estimate, body: Body) -> None:
        rr, colours = self._rr, limb_colours(body)
        if self._classes != body.limb_names:
            # Names and colours of the silhouette's values; 0 is the background.
            self._classes = body.limb_names
            rows = [(0, "background", (0, 0, 0, 0))]
            rows += [(index, name, (*colours[name], 255)) for index, name in enumerate(self._classes, start=1)]
            self._stream.log("world", rr.AnnotationContext(rows), static=True)
        for limb in body.limbs:
            path = f"world/body/limbs/{limb.name}"
            if self._shapes.get(limb.name) != limb.shape:
                self._shapes[limb.name] = limb.shape
                vertices, triangles, normals = limb_mesh(limb.shape)
                self._stream.log(
                    path,
                    rr.Mesh3D(
                        vertex_positions=vertices,
                        triangle_indices=triangles,
                        vertex_normals=normals,
                        albedo_factor=(*colours[limb.name], 150),
                    ),
                )
            pose = estimate.world_from_limb[limb.name]
            self._stream.log(path, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        self._stream.log(
            "world/body/joints",
            rr.Points3D(estimate.joint_positions, radii=0.012, labels=list(estimate.joint_names), show_labels=False),
        )
        self._stream.log("world/body/bands", rr.LineStrips3D(bands(estimate, body), radii=0.004, colors=(255, 40, 40)))

    def _log_measurement(self, item: object, estimate: Estimate, body: Body) -> None:
        rr = self._rr
        if isinstance(item, ColorImage):
            path = self._log_camera(item)
            self._stream.log(f"{path}/picture", rr.Image(item.image, color_model="BGR").compress(jpeg_quality=80))
            self._log_model(path, item, estimate, body)
        elif isinstance(item, KeypointImage):
            path = self._log_camera(item)
            self._log_model(path, item, estimate, body)
            rows = np.vstack([*item.people, np.empty((0, 3))])
            rows = rows[np.isfinite(rows).all(axis=1) & (rows[:, 2] > 0.0)]
            rings = np.column_stack([np.full((len(rows), 3), (255, 120, 255)), 60 + 195 * rows[:, 2].clip(0.0, 1.0)])
            self._stream.log(
                f"{path}/picture/keypoints", rr.Points2D(rows[:, :2], radii=4.0, colors=rings.astype(np.uint8))
            )
        elif isinstance(item, MarkerSet):
            self._stream.log(
                f"world/markers/{_entity(item.sensor)}",
                rr.Points3D(
                    list(item.positions.values()),
                    radii=0.015,
                    colors=(255, 60, 60),
                    labels=list(item.positions),
                    show_labels=False,
                ),
            )
        elif isinstance(item, DepthImage):
            path = self._log_camera(item)
            self._stream.log(f"{path}/picture", rr.DepthImage(item.image, meter=1.0 / item.metres_per_unit))
            # Of a large image every n-th row and column.
            step = math.ceil(math.sqrt(item.image.size / _MOST_POINTS))
            z = item.image[::step, ::step].astype(np.float32) * np.float32(item.metres_per_unit)
            valid = np.isfinite(z) & (z > 0.0)
            points = np.column_stack([item.camera.rays()[::step, ::step][valid] * z[valid, None], z[valid]])
            limbs = self._log_points(
                f"world/points/{_entity(item.sensor)}", points, item.root_from_sensor, estimate, body
            )
            self._log_model(path, item, estimate, body)
            silhouette = np.zeros(z.shape, dtype=np.uint8)
            silhouette[valid] = np.where(limbs == len(body.limbs), 0, limbs + 1)
            height, width = item.image.shape
            silhouette = silhouette.repeat(step, axis=0).repeat(step, axis=1)[:height, :width]
            self._stream.log(f"{path}/picture/silhouette", rr.SegmentationImage(silhouette, opacity=0.5))
        elif isinstance(item, PointCloud):
            path = f"world/points/{_entity(item.sensor)}"
            some = item.points[:: max(len(item.points) // _MOST_POINTS, 1)]
            self._log_points(path, some, item.root_from_sensor, estimate, body)
        elif isinstance(item, LaserScan):
            pose = item.root_from_sensor
            points = item.points() @ pose[:3, :3].T + pose[:3, 3]
            self._stream.log(
                f"world/laser/{_entity(item.sensor)}", rr.Points3D(points, radii=0.015, colors=(255, 220, 0))
            )

    def _log_model(
        self, path: str, item: ColorImage | DepthImage | KeypointImage, estimate: Estimate, body: Body
    ) -> None:
        """The outlines of the limbs as the camera sees them."""
        outlines, colours = [], []
        for limb in body.limbs:
            view = CameraView(item.camera, item.root_from_sensor)
            outline = limb_outline(limb.shape, estimate.world_from_limb[limb.name], view)
            if outline is not None:
                outlines.append(np.vstack([outline, outline[:1]]) + 0.5)
                colours.append(limb_colours(body)[limb.name])
        self._stream.log(f"{path}/picture/model", self._rr.LineStrips2D(outlines, radii=0.5, colors=colours))

    def _log_camera(self, item: ColorImage | DepthImage | KeypointImage) -> str:
        rr, path, pose = self._rr, f"world/cameras/{_entity(item.sensor)}", item.root_from_sensor
        camera = item.camera
        self._stream.log(path, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        self._stream.log(
            f"{path}/picture",
            rr.Pinhole(
                image_from_camera=camera.matrix,
                resolution=(camera.width, camera.height),
                camera_xyz=rr.ViewCoordinates.RDF,
                image_plane_distance=0.3,
            ),
        )
        return path

    def _log_points(
        self, path: str, points: npt.NDArray[Any], pose: FloatArray, estimate: Estimate, body: Body
    ) -> npt.NDArray[np.intp]:
        """Show points (N, 3); the limb of each (N,)."""
        world = np.asarray(points, dtype=np.float64) @ pose[:3, :3].T + pose[:3, 3]
        colours = np.array([*limb_colours(body).values(), _BACKGROUND], dtype=np.uint8)
        limbs = nearest_limb(world, estimate, body)
        self._stream.log(path, self._rr.Points3D(world, radii=0.006, colors=colours[limbs]))
        return limbs

    def _log_front_end(self, front_end: FrontEnd, estimate: Estimate) -> None:
        strips, colours, labels = [], [], []
        for ray in front_end.rays:
            reach = float((estimate.joints[ray.site] - ray.origin) @ ray.direction)
            strips.append(np.array([ray.origin, ray.origin + ray.direction * (reach + 0.3)]))
            colours.append((0, 255, 120, round(60 + 195 * ray.trust)))
            labels.append(f"{ray.site} ({ray.source})")
        self._stream.log(
            "world/rays", self._rr.LineStrips3D(strips, radii=0.004, colors=colours, labels=labels, show_labels=False)
        )
        for sensor, skin in front_end.skin.items():
            places = [item.pixel for item in skin.candidates]
            path = f"world/cameras/{_entity(sensor)}/picture/skin"
            self._stream.log(path, self._rr.Points2D(places, radii=3.0, colors=(0, 255, 255)))

    def _log_plots(self, estimate: Estimate, seconds: float | None) -> None:
        values: dict[str, float] = {"residual_mm": 1e3 * estimate.residual, "steps": float(estimate.steps)}
        if seconds is not None:
            values["step_ms"] = 1e3 * seconds
        for source, (given, matched, residual) in estimate.sources.items():
            values[f"sources/{_entity(source)}/given"] = float(given)
            values[f"sources/{_entity(source)}/matched"] = float(matched)
            values[f"sources/{_entity(source)}/residual_mm"] = 1e3 * residual
        for name, value in values.items():
            if np.isfinite(value):
                self._stream.log(f"plots/{name}", self._rr.Scalars(value))
        self._stream.log("plots/status", self._rr.TextLog(estimate.status))


def limb_mesh(
    shape: TaperedEllipticCylinder,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.uint32], npt.NDArray[np.float32]]:
    """Vertices (V, 3) [m] in the limb frame, triangles (T, 3) counter-clockwise from outside, and unit normals (V,
    3)."""
    angle = np.linspace(0.0, 2.0 * np.pi, _AROUND, endpoint=False)
    ring = np.column_stack([np.cos(angle), np.sin(angle), np.zeros(_AROUND)])
    low = ring * (shape.a0, shape.b0, 0.0)
    high = ring * (shape.a1, shape.b1, 0.0) + (0.0, 0.0, shape.length)
    middles = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, shape.length]])
    # The rims twice: once with the normals of the side, once with those of the caps.
    outward = np.vstack([ring * (shape.b0, shape.a0, 0.0), ring * (shape.b1, shape.a1, 0.0)])
    side = outward + 1e-9 * np.vstack([ring, ring])  # a pointed end has a direction all the same
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    down, up = np.array([0.0, 0.0, -1.0]), np.array([0.0, 0.0, 1.0])
    vertices = np.vstack([low, high, low, high, middles])
    normals = np.vstack([side, np.tile(down, (_AROUND, 1)), np.tile(up, (_AROUND, 1)), down, up])
    here = np.arange(_AROUND)
    following = (here + 1) % _AROUND
    n = _AROUND
    triangles = np.vstack(
        [
            np.column_stack([here, following, n + here]),
            np.column_stack([following, n + following, n + here]),
            np.column_stack([np.full(n, 4 * n), 2 * n + following, 2 * n + here]),
            np.column_stack([np.full(n, 4 * n + 1), 3 * n + here, 3 * n + following]),
        ]
    )
    return vertices.astype(np.float32), triangles.astype(np.uint32), normals.astype(np.float32)


def limb_colours(body: Body) -> dict[str, tuple[int, int, int]]:
    """A colour for each limb: hues evenly spread."""
    count = len(body.limbs)
    colours = {}
    for index, limb in enumerate(body.limbs):
        red, green, blue = colorsys.hsv_to_rgb(index / count, 0.75, 1.0)
        colours[limb.name] = (round(255 * red), round(255 * green), round(255 * blue))
    return colours


def nearest_limb(points: FloatArray, estimate: Estimate, body: Body) -> npt.NDArray[np.intp]:
    """(N,) index of the limb whose surface is nearest to each world point (N, 3), the number of limbs for the
    background."""
    if not len(points):
        return np.empty(0, dtype=np.intp)
    distances = np.full((len(body.limbs) + 1, len(points)), np.inf)
    distances[-1] = _ON_BODY_M
    low = estimate.joint_positions.min(axis=0) - 0.4
    near = np.flatnonzero(((points > low) & (points < estimate.joint_positions.max(axis=0) + 0.4)).all(axis=1))
    if len(near):
        for index, limb in enumerate(body.limbs):
            pose = estimate.world_from_limb[limb.name]
            local = np.ascontiguousarray((points[near] - pose[:3, 3]) @ pose[:3, :3])
            distances[index, near] = np.abs(limb.shape.closest_points(local).signed_distance)
    return np.asarray(distances.argmin(axis=0))


def bands(estimate: Estimate, body: Body) -> list[FloatArray]:
    """The elastic band of each joint's centre as (2, 3): from the parent's half of the joint to the child's."""
    strips = []
    for name, parent, _, joint, _ in body.core.parts()[1]:
        if parent is None or joint is None:
            continue
        ends = []
        for limb, (place, _) in ((parent, joint[1]), (name, joint[2])):
            pose = estimate.world_from_limb[limb]
            ends.append(pose[:3, :3] @ np.asarray(place) + pose[:3, 3])
        strips.append(np.array(ends))
    return strips


def _entity(name: str) -> str:
    return name.strip("/").replace("/", "_").replace(" ", "_") or "sensor"


def _rerun() -> ModuleType:
    try:
        import rerun
    except ImportError as error:
        raise VoodooError("the viewer needs Rerun, which is not installed: pip install voodoo[view]") from error
    return rerun
