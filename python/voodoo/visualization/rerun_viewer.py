"""Shows measurements, limbs, rays, images and curves on one timeline in Rerun.

Rerun is an optional extra: `pip install 'voodoo-tracker[view]'`.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from datetime import timedelta
from pathlib import Path
from typing import Any

import numpy as np

from voodoo._core import Estimate, TaperedEllipticCylinder
from voodoo.children import children
from voodoo.drawing.ink import person_color
from voodoo.drawing.surfaces import Log, bands, entity, limb_colors
from voodoo.errors import VoodooError, installed
from voodoo.export.skeleton import ellipsoids
from voodoo.measurements import RecordedFrame
from voodoo.model.body import Body
from voodoo.model.projection import limb_mesh
from voodoo.people import ONE, PeopleEstimate
from voodoo.pipeline.front_end import FrontEnd, nobody
from voodoo.sensors.adapters import Memory, adapters_of
from voodoo.visualization.rerun_server import Server
from voodoo.visualization.side_output import SideOutput
from voodoo.whole import appearing_whole, check_disk

_MOST_POINTS = 40_000
_EPOCH_S = 1e9
_CHUNK_BYTES = 8_000_000
_VISIBLE_M = 0.002


class Viewer(SideOutput):
    """Writes the data of each step to a Rerun file, or to a viewer on this machine; use it in a `with` block.

    Entities: `world/body/limbs/<limb>`, `world/body/joints`, `world/body/uncertainty` (one standard
    deviation of each joint), `world/body/bands`, `world/points/<source>` (colored by
    the limb they are on), `world/laser/<source>`, `world/markers/<source>`, `world/rays`, `world/cameras/<source>`
    (images with the silhouettes of the projected limbs, skin candidates and keypoints; in depth images the
    silhouette of each limb), `plots/...`; the timeline is `time`.

    Args:
        save: .rrd file to write, which appears when it is complete; None opens the viewer. In a file depth is rounded to a
            quarter of a percent, and large depth images are subsampled.
        name: of the recording, shown in the viewer.
        serve: PORT, or HOST:PORT: serve it to browsers there instead, see `voodoo.visualization.rerun_server`.

    Attributes:
        address: address for browsers; "" if it is not served.
        failure: why the file is missing after a `with` block; None if it is there. If it is set before, the file is removed.

    Raises:
        VoodooError: Rerun is not installed, another suffix, or a viewer that cannot open here.
        OSError: the file cannot be written.
    """

    def __init__(self, *, save: str | Path | None = None, name: str = "voodoo", serve: str | None = None) -> None:
        """Open the file or the viewer."""
        super().__init__()
        self._rr = installed(
            "rerun", "the viewer needs Rerun, which is not installed: pip install 'voodoo-tracker[view]'"
        )
        if save is not None and Path(save).suffix != ".rrd":
            raise VoodooError(f"{save}: expected a name that ends in .rrd, found {Path(save).suffix!r}")
        chunks = None
        if save is not None:
            chunks = self._rr.ChunkBatcherConfig.DEFAULT()
            # Every chunk has an overhead of two kilobytes, and of a file the latency does not matter.
            chunks.flush_tick, chunks.flush_num_bytes = timedelta(seconds=60.0), _CHUNK_BYTES
        self._stream: Any = self._rr.RecordingStream("voodoo", recording_id=None, batcher_config=chunks)
        self._stream.send_recording_name(name)
        self.address = ""
        self._place: Path | None = None
        if serve is not None:
            server = Server(serve)
            self.address = server.address
            self._ends.callback(server.close)
            self._stream.connect_grpc(server.data)
        elif save is None:
            self._open()
        else:
            self._place = self._ends.enter_context(appearing_whole(Path(save)))
            self._stream.save(str(self._place))
        self._ends.push(self._finish)
        self._classes: tuple[str, ...] = ()
        self._stream.log("world", self._rr.ViewCoordinates.RIGHT_HAND_Z_UP, static=True)
        self._shapes: dict[str, TaperedEllipticCylinder] = {}
        self._people: set[int] = set()

    def _open(self) -> None:
        """Start the viewer; without a screen it would end without a message."""
        if sys.platform.startswith("linux") and not (os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")):
            raise VoodooError(
                "view: expected a screen to open the viewer on, found none; --save FILE.rrd writes a file"
            )
        try:
            with children(quiet=True):
                self._stream.spawn()
        except (RuntimeError, OSError) as error:
            reason = str(error).strip().splitlines()[0] if str(error).strip() else type(error).__name__
            raise VoodooError(f"view: the viewer did not start ({reason}); --save FILE.rrd writes a file") from error

    def _finish(self, failed: type[BaseException] | None, *_: object) -> None:
        """Flush buffered data, unless something failed."""
        try:
            if failed is None:
                self._stream.flush()
        except RuntimeError as error:
            if self._place is not None:  # a window may be closed before the end
                check_disk(self._place.parent)
                raise VoodooError(f"{self._place.name}: {str(error).strip() or type(error).__name__}") from error
        finally:
            self._stream.disconnect()
        if self._place is not None and failed is None:
            check_disk(self._place.parent)  # Rerun does not tell that it could not write the end

    def close(self) -> None:
        """Flush buffered data, and complete the file.

        Raises:
            VoodooError, OSError: it could not be written.
        """
        self._ends.close()

    def log(
        self,
        estimate: Estimate | PeopleEstimate,
        bodies: Body | Mapping[int, Body],
        *,
        recorded: RecordedFrame | None = None,
        front_end: FrontEnd[Any] | None = None,
        seconds: float | None = None,
    ) -> None:
        """Show one step. Several persons are `world/people/<id>/...`, each with a separate color and number.

        Args:
            estimate: of the step.
            bodies: with current sizes: that of a single person (`Tracker.body`), or number -> body.
            recorded: the measurements.
            front_end: provides the rays and skin candidates of the step.
            seconds: time the step took.
        """
        bodies = bodies if isinstance(bodies, Mapping) else {ONE: bodies}
        # Stamps of a robot are Unix times, those of other recordings start at zero.
        clock = "timestamp" if estimate.stamp > _EPOCH_S else "duration"
        self._stream.set_time("time", **{clock: estimate.stamp})
        if isinstance(estimate, PeopleEstimate):
            self._log_people(estimate, bodies)
            # Images and points are not assigned to persons.
            posed, body = nobody(estimate.stamp), Body.human()
        else:
            posed, body = estimate, bodies[ONE]
            colors = limb_colors(body)
            self._log_classes(body, colors)
            self._log_body("world/body", estimate, body, colors)
            if front_end is not None:
                self._log_rays(front_end, estimate)
            self._log_plots(estimate)
        memory = Memory() if front_end is None else front_end.memory
        log = Log(self._rr, self._stream, posed, body, _MOST_POINTS, self._place is None)
        for item in () if recorded is None else recorded.measurements:
            for adapter in adapters_of(item):
                adapter.log(item, log, memory)
        if seconds is not None:
            self._stream.log("plots/step_ms", self._rr.Scalars(1e3 * seconds))

    def _log_people(self, estimate: PeopleEstimate, bodies: Mapping[int, Body]) -> None:
        rr = self._rr
        there = {person.id for person in estimate if person.estimate.joints}
        for gone in self._people - there:
            self._clear(f"world/people/{gone}")
        self._people = there
        for person in estimate:
            if person.id in there:
                path, blue_green_red = f"world/people/{person.id}", person_color(person.id)
                color = (blue_green_red[2], blue_green_red[1], blue_green_red[0])
                body = bodies[person.id]
                self._log_body(path, person.estimate, body, dict.fromkeys(body.limb_names, color))
                head = person.estimate.joint_positions[person.estimate.joint_positions[:, 2].argmax()]
                words = [f"{person.id} {person.status}"]
                self._stream.log(f"{path}/number", rr.Points3D([head], labels=words, colors=[color], radii=0.02))
            self._stream.log(f"plots/status/{person.id}", rr.TextLog(str(person.status)))
        self._stream.log("plots/people", rr.Scalars(float(len(there))))

    def _clear(self, path: str) -> None:
        """Clear the body; the meshes must be sent again for the next person."""
        self._stream.log(path, self._rr.Clear(recursive=True))
        self._shapes = {name: shape for name, shape in self._shapes.items() if not name.startswith(f"{path}/")}

    def _log_classes(self, body: Body, colors: Mapping[str, tuple[int, int, int]]) -> None:
        """Log names and colors of the silhouette's values; 0 is the background."""
        if self._classes != body.limb_names:
            self._classes = body.limb_names
            rows = [(0, "background", (0, 0, 0, 0))]
            rows += [(index, name, (*colors[name], 255)) for index, name in enumerate(self._classes, start=1)]
            self._stream.log("world", self._rr.AnnotationContext(rows), static=True)

    def _log_body(self, path: str, estimate: Estimate, body: Body, colors: Mapping[str, tuple[int, int, int]]) -> None:
        rr = self._rr
        if not estimate.joints:
            self._clear(path)
            return
        for limb in body.limbs:
            place = f"{path}/limbs/{limb.name}"
            logged = self._shapes.get(place)
            if not _alike(logged, limb.shape):
                self._shapes[place] = limb.shape
                vertices, triangles, normals = limb_mesh(limb.shape)
                mesh = rr.Mesh3D.from_fields(vertex_positions=vertices)
                if logged is None:
                    about = {"vertex_normals": normals, "albedo_factor": (*colors[limb.name], 150)}
                    mesh = rr.Mesh3D(vertex_positions=vertices, triangle_indices=triangles, **about)
                self._stream.log(place, mesh)
            pose = estimate.world_from_limb[limb.name]
            self._stream.log(place, rr.Transform3D(translation=pose[:3, 3], mat3x3=pose[:3, :3]))
        names, places = list(estimate.joint_names), estimate.joint_positions
        self._stream.log(f"{path}/joints", rr.Points3D(places, radii=0.006, labels=names, show_labels=False))
        self._log_spread(f"{path}/uncertainty", estimate)
        self._stream.log(f"{path}/bands", rr.LineStrips3D(bands(estimate, body), radii=0.004, colors=(255, 40, 40)))

    def _log_spread(self, path: str, estimate: Estimate) -> None:
        """Ellipsoids of one standard deviation of the joints."""
        covariances = estimate.joint_covariances
        if not len(covariances):
            return
        known = np.isfinite(covariances).all(axis=(1, 2))
        sizes, turns = ellipsoids(covariances[known])
        how = {"half_sizes": sizes, "quaternions": turns if known.any() else None, "line_radii": 0.001}
        centers = estimate.joint_positions[known]
        self._stream.log(path, self._rr.Ellipsoids3D(centers=centers, colors=(255, 255, 255), **how))

    def _log_rays(self, front_end: FrontEnd[Any], estimate: Estimate) -> None:
        strips, colors, labels = [], [], []
        for ray in front_end.rays:
            reach = float((estimate.joints[ray.site] - ray.origin) @ ray.direction)
            strips.append(np.array([ray.origin, ray.origin + ray.direction * (reach + 0.3)]))
            colors.append((0, 255, 120, round(60 + 195 * ray.trust)))
            labels.append(f"{ray.site} ({ray.source})")
        self._stream.log(
            "world/rays", self._rr.LineStrips3D(strips, radii=0.004, colors=colors, labels=labels, show_labels=False)
        )

    def _log_plots(self, estimate: Estimate) -> None:
        values: dict[str, float] = {"residual_mm": 1e3 * estimate.residual, "steps": float(estimate.steps)}
        for source, (given, matched, residual) in estimate.sources.items():
            values[f"sources/{entity(source)}/given"] = float(given)
            values[f"sources/{entity(source)}/matched"] = float(matched)
            values[f"sources/{entity(source)}/residual_mm"] = 1e3 * residual
        for name, value in values.items():
            if np.isfinite(value):
                self._stream.log(f"plots/{name}", self._rr.Scalars(value))
        self._stream.log("plots/status", self._rr.TextLog(estimate.status))


def _alike(one: TaperedEllipticCylinder | None, other: TaperedEllipticCylinder) -> bool:
    """Whether the difference is invisible: sizes are refined in every frame, and a mesh needs kilobytes."""
    sizes = ("length", "a0", "b0", "a1", "b1")
    return one is not None and all(abs(getattr(one, name) - getattr(other, name)) < _VISIBLE_M for name in sizes)
