"""From recorded measurements to the tracker's Frame, the one way there is: prediction, gates, agreement of rays, weights
from standard deviations."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import numpy.typing as npt

import voodoo
from voodoo.errors import MeasurementError
from voodoo.keypoints import KeypointReport, KeypointSensor, check_confidence, layout_of, nearest_person
from voodoo.recordings import (
    ColorImage,
    DepthImage,
    KeypointImage,
    LaserScan,
    MarkerSet,
    Measurement,
    PointCloud,
    RecordedFrame,
    Recording,
)
from voodoo.sensors.depth import DepthFilter, StillDepth, body_view
from voodoo.sensors.gating import SiteGate, SitePredictor
from voodoo.sensors.model import (
    PLANAR_LASER,
    POINTS_SHARING,
    PixelNoise,
    RangeNoise,
    SensorModel,
)
from voodoo.sensors.motion import LimbMotion
from voodoo.sensors.occlusion import body_before
from voodoo.sensors.pixels import FloatArray, in_sensor
from voodoo.sensors.rays import SiteRay, add_rays, agreed
from voodoo.sensors.skin import SkinSettings, SkinTracker

INPUTS = ("depth", "points", "scan", "keypoints", "skin", "markers")
"""Kinds of measurements a front end can use."""
SENSOR_INPUTS = {kind: kind for kind in INPUTS if kind != "skin"} | {"color": "skin"}
"""Which of them a recording's sensor of a kind serves, see `SensorInfo`."""
LEVEL_FRAMES = ("base_link", "base_footprint", "odom", "map")
"""Root frames whose z = 0 is the floor (REP-105)."""


@dataclass(frozen=True)
class FrontEndSettings:
    """What is used, and how much it is believed.

    Args:
        use: kinds from INPUTS; measurements of other kinds are left out.
        model: standard deviation to weight.
        depth_noise: of depth images and point clouds; the weight is that at the predicted range of the body. None:
            every point weighs 1, as in the papers (a time-of-flight point at 3 m).
        scan_noise: of laser scans; None: every return weighs 1.
        sharing: neighbouring depth pixels that share one error.
        scan_sharing: the same for a scan, whose beams lie farther apart.
        keypoint_noise: of 2-D keypoints.
        min_confidence: keypoints believed less are not used.
        gate_radius, gate_growth, gate_widest: see SiteGate.
        agreement: scale [m] of `agreed`; 0 switches it off.
        marker_sigma: standard deviation [m] of a marker that is given without one.
        depth_filter: what is dropped from depth images; None takes them as they are.
        skin: settings of the skin-colour cue.
        ground_z: height [m] of the floor in a root frame whose z points up; None: not known.

    Raises:
        MeasurementError: an unknown kind, or no finite least confidence.
    """

    use: tuple[str, ...] = INPUTS
    model: SensorModel = field(default_factory=SensorModel)
    depth_noise: RangeNoise | None = None
    scan_noise: RangeNoise | None = PLANAR_LASER
    sharing: float = POINTS_SHARING
    scan_sharing: float = 4.0
    keypoint_noise: PixelNoise = field(default_factory=PixelNoise)
    min_confidence: float = 0.1
    gate_radius: float = 0.15
    gate_growth: float = 0.5
    gate_widest: float = 0.40
    agreement: float = 0.08
    marker_sigma: float = 0.02
    depth_filter: DepthFilter | None = None
    skin: SkinSettings = field(default_factory=SkinSettings)
    ground_z: float | None = None

    def __post_init__(self) -> None:
        """Check the kinds, and what would silently let everything in."""
        check_confidence(self.min_confidence)
        unknown = sorted(set(self.use) - set(INPUTS))
        if unknown or not self.use:
            raise MeasurementError(f"use: expected some of {', '.join(INPUTS)}, found {', '.join(unknown) or 'none'}")

    @classmethod
    def of(cls, recording: Recording, *, use: Sequence[str] = INPUTS) -> FrontEndSettings:
        """The defaults for a recording: the floor is known where its root frame is one of LEVEL_FRAMES.

        Raises:
            MeasurementError: an unknown kind, or kinds of which the recording has none.
        """
        settings = cls(use=tuple(use))
        has = {SENSOR_INPUTS[sensor.kind] for sensor in recording.info().sensors if sensor.kind in SENSOR_INPUTS}
        if has and not has & set(use):
            raise MeasurementError(
                f"use: expected some of what {recording.name} has ({', '.join(sorted(has))}), found {', '.join(use)}"
            )
        return replace(settings, ground_z=0.0 if recording.root_frame in LEVEL_FRAMES else None)


class FrontEnd:
    """Feeds one tracker from recorded measurements of any kind.

    Args:
        tracker: already reset to the first pose.
        settings: see FrontEndSettings.
    """

    def __init__(self, tracker: voodoo.Tracker, *, settings: FrontEndSettings | None = None) -> None:
        """Take up the tracker's current estimate as the first prediction."""
        self.tracker = tracker
        self.settings = settings or FrontEndSettings()
        self.reports: dict[str, KeypointReport] = {}
        self.skin: dict[str, SkinTracker] = {}
        self.rays: list[SiteRay] = []
        self.frozen: tuple[str, ...] = ()
        self._contents: dict[str, npt.NDArray[Any]] = {}
        self._scenes: dict[str, StillDepth] = {}
        self._steps = 0
        self._predictor = SitePredictor()
        self._motion = LimbMotion()
        chosen = self.settings
        self._gate = SiteGate(chosen.gate_radius, chosen.gate_growth, chosen.gate_widest)
        self._predictor.update(float("nan"), tracker.estimate.joints)

    def step(self, recorded: RecordedFrame) -> voodoo.Estimate:
        """Make the frame, step the tracker, and learn from the estimate.

        Raises:
            MeasurementError: a measurement that cannot be used.
            RecordingError: a picture that cannot be decoded.

        After either, tracker and front end are as they were.
        """
        before = self._memory()
        try:
            estimate = self.tracker.step(self.frame(recorded))
        except BaseException:
            vars(self).update(before)
            raise
        self._predictor.update(recorded.stamp, estimate.joints)
        self._motion.update(recorded.stamp, estimate.world_from_limb)
        for item in recorded.measurements:
            if isinstance(item, ColorImage) and item.sensor in self.skin:
                # The first frame shows the pose that was set; without it a colour camera alone would never begin.
                self.skin[item.sensor].learn(
                    item.image, item.camera, item.root_from_sensor, estimate, vouched=self._steps == 0
                )
        self._steps += 1
        return estimate

    def _memory(self) -> dict[str, Any]:
        """All that `frame` changes, as it is."""
        return {
            "frozen": self.frozen,
            "rays": self.rays,
            "reports": dict(self.reports),
            "skin": {sensor: copy(skin) for sensor, skin in self.skin.items()},
            "_contents": dict(self._contents),
            "_scenes": {sensor: copy(scene) for sensor, scene in self._scenes.items()},
            "_gate": copy(self._gate),
        }

    def frame(self, recorded: RecordedFrame) -> voodoo.Frame:
        """The tracker's frame, without stepping."""
        measurements = self._alive(recorded.measurements)
        frame = voodoo.Frame(stamp=recorded.stamp)
        if self.settings.ground_z is not None:
            frame.set_ground(normal=(0.0, 0.0, 1.0), offset=self.settings.ground_z)
        predicted = self._predictor.predict(recorded.stamp)
        self.rays = []
        depths = [item for item in measurements if isinstance(item, DepthImage)]
        if "depth" not in self.settings.use:
            depths = []
        for item in measurements:
            if isinstance(item, ColorImage):
                if "skin" in self.settings.use:
                    self._add_skin(item, predicted, depths[0] if depths else None)
            elif isinstance(item, KeypointImage):
                if "keypoints" in self.settings.use:
                    self._add_keypoints(frame, item, predicted, depths)
            else:
                self._add(frame, item, predicted)
        if self.settings.agreement > 0.0:
            self.rays = agreed(self.rays, predicted=predicted, scale=self.settings.agreement)
        add_rays(frame, self.rays, model=self.settings.model)
        return frame

    def _alive(self, measurements: Sequence[Measurement]) -> list[Measurement]:
        """Those measurements whose sensor is not frozen; `frozen` names the others.

        A sensor is frozen when it repeats its last measurement bit by bit while another one measures something new:
        real sensors have noise. A frozen depth camera would else say with all its points that nobody moves.
        """
        repeats, changes = [], False
        for item in measurements:
            content = _content(item, self.settings.use)
            if content is None:
                continue
            before = self._contents.get(item.sensor)
            self._contents[item.sensor] = content
            if before is not None and _same(before, content):
                repeats.append(item)
            else:
                changes = changes or before is not None
        stuck = repeats if changes else []
        self.frozen = tuple(item.sensor for item in stuck)
        return [item for item in measurements if not any(item is other for other in stuck)]

    def _add(self, frame: voodoo.Frame, item: Measurement, predicted: Mapping[str, FloatArray]) -> None:
        use = self.settings.use
        if isinstance(item, DepthImage) and "depth" in use:
            image = item.image
            if self.settings.depth_filter is not None:
                image = self.settings.depth_filter.apply(image, metres_per_unit=item.metres_per_unit)
            frame.add_depth(
                image,
                camera=item.camera,
                metres_per_unit=item.metres_per_unit,
                world_from_sensor=item.root_from_sensor,
                weight=self._points_weight(item, predicted),
                source=item.sensor,
            )
        elif isinstance(item, PointCloud) and "points" in use:
            weight = self._points_weight(item, predicted)
            points = self._carried(item, item.points, frame.stamp)
            frame.add_points(points, world_from_sensor=item.root_from_sensor, weight=weight, source=item.sensor)
        elif isinstance(item, LaserScan) and "scan" in use:
            weight = self._weight(self.settings.scan_noise, self.settings.scan_sharing, item, predicted)
            points = self._carried(item, item.points(), frame.stamp)
            frame.add_points(points, world_from_sensor=item.root_from_sensor, weight=weight, source=item.sensor)
        elif isinstance(item, MarkerSet) and "markers" in use:
            sigma = self.settings.marker_sigma if item.sigma is None else item.sigma
            weight = self.settings.model.weight(sigma)
            for site, position in item.positions.items():
                if site in predicted:
                    frame.add_position(site, position, weight=weight, source=item.sensor)

    def _carried(self, item: LaserScan | PointCloud, points: npt.NDArray[Any], stamp: float) -> npt.NDArray[Any]:
        """Points of the sensor (N, 3), those on the body where they are at `stamp`."""
        if not self._motion.moves(stamp - item.stamp):
            return points
        pose = item.root_from_sensor
        places = points.astype(np.float64) @ pose[:3, :3].T + pose[:3, 3]
        return in_sensor(pose, self._motion.carried(places, stamp - item.stamp, self.tracker.limb_distances))

    def _add_skin(self, item: ColorImage, predicted: Mapping[str, FloatArray], depth: DepthImage | None) -> None:
        skin = self.skin.get(item.sensor)
        if skin is None:
            skin = self.skin[item.sensor] = SkinTracker(self.settings.skin)
        # The picture is older or newer than the frame: the ray is moved along with its site.
        then = self._predictor.predict(item.stamp)
        body = None
        if depth is not None:
            body = body_view(
                depth.image,
                depth_camera=depth.camera,
                world_from_depth=depth.root_from_sensor,
                metres_per_unit=depth.metres_per_unit,
                color_camera=item.camera,
                world_from_color=item.root_from_sensor,
                joints=list(then.values()),
                step=max(depth.camera.width // 200, 1),
                scene=self._scenes.setdefault(depth.sensor, StillDepth()),
            )
        rays = skin.observe(
            item.image,
            item.camera,
            item.root_from_sensor,
            then,
            stamp=item.stamp,
            body=body,
            surface=self._limb_distances,
            lost=self._hands(skin.settings.sites, "forearm", measured=False) if depth is not None else (),
            held=self._hands(skin.settings.sites, "upperarm", measured=True) if depth is not None else (),
            shown=self._shown(skin.settings.sites) if depth is not None else (),
            source=item.sensor,
        )
        self.rays += [ray.moved(predicted[ray.site] - then[ray.site]) for ray in rays]

    def _hands(self, sites: Iterable[str], limb: str, *, measured: bool) -> set[str]:
        """Hands whose forearm or upper arm was, or was not, measured in the last frame."""
        status = self.tracker.estimate.limb_status
        known = {site: status.get(f"{site[:2]}{limb}") for site in sites}
        return {site for site, value in known.items() if value is not None and (value == "measured") == measured}

    def _shown(self, sites: Iterable[str]) -> set[str]:
        """Sites of the head, if it was measured in the last frame; what a hand's region shows changes as the hand turns."""
        measured = self.tracker.estimate.limb_status.get("head") == "measured"
        return {site for site in sites if measured and site.startswith("head")}

    def _limb_distances(self, places: FloatArray) -> dict[str, npt.NDArray[np.float32]]:
        return dict(zip(self.tracker.estimate.limb_names, self.tracker.limb_distances(places), strict=True))

    def _add_keypoints(
        self,
        frame: voodoo.Frame,
        item: KeypointImage,
        predicted: Mapping[str, FloatArray],
        depths: Sequence[DepthImage],
    ) -> None:
        place: dict[str, Any] = {
            "layout": item.layout,
            "camera": item.camera,
            "world_from_sensor": item.root_from_sensor,
        }
        person = nearest_person(item.people, predicted=predicted, **place)
        if person is None:
            self.reports[item.sensor] = KeypointReport()
            return
        sensor = KeypointSensor(
            **place,
            source=item.sensor,
            noise=self.settings.keypoint_noise,
            model=self.settings.model,
            min_confidence=self.settings.min_confidence,
        )
        registered = next((depth for depth in depths if _same_camera(depth, item)), None)
        with_depth: dict[str, Any] = {}
        if registered is not None:
            with_depth = {"depth": registered.image, "metres_per_unit": registered.metres_per_unit}
        joints = self.tracker.estimate.joints
        sites = [part.site for part in layout_of(item.layout).parts if part.site in joints]
        places = [joints[site] for site in sites]
        hidden = body_before(places, item.root_from_sensor[:3, 3], self.tracker.distance)
        report, rays, points = sensor.observe(
            person,
            stamp=frame.stamp,
            predicted=predicted,
            gate=self._gate,
            before=dict(zip(sites, hidden.tolist(), strict=True)),
            **with_depth,
        )
        self.reports[item.sensor] = report
        self.rays += rays
        for site, (position, sigma) in points.items():
            frame.add_position(site, position, weight=self.settings.model.weight(sigma), source=item.sensor)

    def _points_weight(self, item: DepthImage | PointCloud, predicted: Mapping[str, FloatArray]) -> float:
        return self._weight(self.settings.depth_noise, self.settings.sharing, item, predicted)

    def _weight(
        self,
        noise: RangeNoise | None,
        sharing: float,
        item: DepthImage | PointCloud | LaserScan,
        predicted: Mapping[str, FloatArray],
    ) -> float:
        if noise is None:
            return 1.0
        body = np.mean(list(predicted.values()), axis=0)
        away = max(float(np.linalg.norm(in_sensor(item.root_from_sensor, body[None])[0])), 0.1)
        return self.settings.model.weight(noise.sigma(away), sharing=sharing)


def _content(item: Measurement, use: Sequence[str]) -> npt.NDArray[Any] | None:
    """What a sensor of a kind in use measured."""
    if isinstance(item, DepthImage) and "depth" in use:
        return item.image
    if isinstance(item, PointCloud) and "points" in use:
        return item.points
    if isinstance(item, ColorImage) and "skin" in use:
        return item.image
    return item.ranges if isinstance(item, LaserScan) and "scan" in use else None


def _same(before: npt.NDArray[Any], content: npt.NDArray[Any]) -> bool:
    # Noise shows in the first rows that are looked at.
    return np.array_equal(before[::16], content[::16]) and np.array_equal(before, content)


def _same_camera(depth: DepthImage, item: KeypointImage) -> bool:
    return depth.camera == item.camera and np.allclose(depth.root_from_sensor, item.root_from_sensor, atol=1e-6)


def paired(recording: Recording, *, wait: float = 0.010) -> Iterator[RecordedFrame]:
    """The frames of a recording, each with the measurements that follow it within `wait` seconds.

    A colour picture taken a few milliseconds after a depth image belongs to it, not to the next one a whole period
    later; the price is a latency of at most `wait`. The stamp of a frame stays that of its own measurement.

    Raises:
        RecordingError: damage in the recording.
    """
    held: RecordedFrame | None = None
    for recorded in recording:
        if held is not None:
            # A fast sensor's next measurement, and the one a frame was made for, stay where they are.
            has = {item.sensor for item in held.measurements}
            early = tuple(
                item
                for item in recorded.measurements[:-1]
                if item.stamp - held.stamp <= wait and item.sensor not in has
            )
            yield RecordedFrame(held.stamp, held.measurements + early)
            late = tuple(item for item in recorded.measurements if not any(item is other for other in early))
            recorded = RecordedFrame(recorded.stamp, late)
        held = recorded
    if held is not None:
        yield held
