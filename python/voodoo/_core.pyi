"""The compiled core. Arrays are NumPy; lengths in meters, times in seconds, angles in radians."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol, final

import numpy as np
import numpy.typing as npt

from voodoo.detectors.base import Detection, PersonCandidate

__all__ = [
    "Body",
    "Camera",
    "Chain",
    "ClosestPoints",
    "Detector",
    "Estimate",
    "Frame",
    "KeypointLayout",
    "Layout",
    "People",
    "SiteGate",
    "SiteRay",
    "SkinCue",
    "TaperedEllipticCylinder",
    "Template",
    "Tracker",
    "View",
    "__version__",
    "_estimate",
    "body_before",
    "carried",
    "config_fields",
    "euler_angles",
    "expected_sites",
    "implausible_depth",
    "linear_sum_assignment",
    "nearest_surface",
    "people_text",
    "person_candidates",
    "quaternions",
    "render_depth",
    "skeleton",
]

__version__: str

_Points = npt.NDArray[np.float32] | npt.NDArray[np.float64]

@final
class Camera:
    """A camera of the core; use voodoo.Camera."""

    def __new__(
        cls,
        width: int,
        height: int,
        intrinsics: tuple[float, float, float, float],
        model: str,
        coefficients: Sequence[float],
    ) -> Camera: ...
    def project(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Pixels (N, 2) of points (N, 3) in the camera frame [m]; NaN where a point has no pixel."""

    def undistorted(self, pixels: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """x/z, y/z (N, 2) of pixels (N, 2); NaN where the lens model has no ray for the pixel."""

    def rays(self) -> npt.NDArray[np.float32]:
        """x/z, y/z (height, width, 2) of all pixels."""

class _Camera(Protocol):
    @property
    def core(self) -> Camera: ...

def render_depth(
    body: Body,
    world_from_limb: Sequence[npt.ArrayLike],
    *,
    camera: _Camera,
    world_from_sensor: npt.ArrayLike | None = None,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int16]]:
    """Depth (height, width) [m], 0 where nothing is visible, and index of the limb, -1 for none; see voodoo.render_depth."""

def nearest_surface(
    pixels: npt.NDArray[np.float64], depths: npt.NDArray[np.float64], *, pixel: tuple[float, float], radius: float
) -> float | None:
    """Depth of the nearest surface around a pixel of an image [m]; None with fewer than three points there.

    Args:
        pixels: (N, 2) of the points in the image.
        depths: (N,) of the points [m].
        pixel: the pixel (u, v).
        radius: of the neighborhood whose points are used [px].

    Raises:
        MeasurementError: arrays of other shapes.
    """

def implausible_depth(image: npt.NDArray[np.uint16] | npt.NDArray[np.float32], meters_per_unit: float) -> float | None:
    """The median depth of a sample of an image's pixels [m] if no camera measures it, so that the unit is wrong.

    Raises:
        MeasurementError: an array of another type.
    """

def linear_sum_assignment(costs: npt.NDArray[np.float64]) -> list[tuple[int, int]]:
    """Pairs (row, column) that minimize the sum of finite costs (N, M), ordered by row.

    Every row is assigned once if N <= M, else every column.
    """

@final
class SkinCue:
    """The learned colors of skin of one camera, and regions of skin as candidates for head and hands; see voodoo.sensors.skin."""

    def __new__(
        cls, sites: Sequence[str], *, gate: float, growth: float, lost_gate: float, widest_gate: float
    ) -> SkinCue: ...
    def __copy__(self) -> SkinCue: ...
    @property
    def learned(self) -> int: ...
    @property
    def mask(self) -> npt.NDArray[np.bool_]: ...
    @property
    def candidates(self) -> list[tuple[float, float]]: ...
    @property
    def assigned(self) -> list[tuple[int, int]]: ...
    def observe(
        self,
        image: npt.NDArray[np.uint8],
        predicted: Mapping[str, npt.NDArray[np.float64]],
        *,
        stamp: float,
        world_from_sensor: npt.NDArray[np.float64],
        camera: _Camera,
        depth: tuple[npt.NDArray[Any], float, _Camera, npt.NDArray[np.float64]] | None,
        tracker: Tracker | tuple[People, int] | None,
        others: Sequence[Tracker | tuple[People, int]],
    ) -> list[tuple[int, npt.NDArray[np.float64], npt.NDArray[np.float64] | None, float]]:
        """Returns for each detected site its index, the direction of its ray, its position, and its predicted depth.

        Args:
            image: (H, W, 3) BGR.
            predicted: site name -> (3,) in the world.
            stamp: [s].
            world_from_sensor, camera: pose (4, 4) and calibration.
            depth: image, meters of one unit, calibration and pose of a depth camera.
            tracker: the tracker of the body.
            others: other persons.
        """

    def learn(
        self,
        image: npt.NDArray[np.uint8],
        joints: npt.NDArray[np.float64],
        sites: npt.NDArray[np.float64],
        *,
        world_from_sensor: npt.NDArray[np.float64],
        camera: _Camera,
    ) -> None:
        """Learns the colors of the face; `joints` (N, 3) are the body's, and `sites` those of the cue, NaN where unknown."""

@final
class KeypointLayout:
    """The keypoint layout of a network: for each site its keypoints with weights, spread and depth behind the surface [m]."""

    def __new__(cls, parts: Sequence[tuple[str, Sequence[tuple[int, float]], float, float]]) -> KeypointLayout: ...
    def pixels(
        self, keypoints: npt.NDArray[np.float64], least: float
    ) -> list[tuple[tuple[float, float], float] | None]: ...
    def nearest(
        self,
        people: Sequence[npt.NDArray[np.float64]],
        predicted: Mapping[str, npt.NDArray[np.float64]],
        *,
        world_from_sensor: npt.NDArray[np.float64],
        camera: _Camera,
        least: float,
    ) -> int | None: ...
    def observe(
        self,
        keypoints: npt.NDArray[np.float64],
        predicted: Mapping[str, npt.NDArray[np.float64]],
        *,
        stamp: float,
        source: str,
        world_from_sensor: npt.NDArray[np.float64],
        camera: _Camera,
        noise: float,
        place_sigma: float,
        least: float,
        gate: SiteGate | None,
        surface: Callable[[tuple[float, float]], float | None] | None,
        before: Mapping[str, float] | None,
    ) -> tuple[list[SiteRay], list[tuple[str, npt.NDArray[np.float64], float]], list[str], list[str]]: ...

@final
class SiteGate:
    """Accepts measurements near predicted sites, per site and source, and opens slowly while nothing is accepted.

    With a fixed gate a tracker that has drifted could never recover. So the radius grows by `growth` for every second since
    the last accepted measurement of the site, up to `widest`.

    Args:
        radius: [m].
        growth: [m/s].
        widest: [m].

    Raises:
        MeasurementError: a number is negative, or `widest` is less than `radius`.
    """

    def __new__(cls, radius: float = 0.15, growth: float = 0.5, widest: float = 0.40) -> SiteGate: ...
    def __copy__(self) -> SiteGate: ...
    def limit(self, site: str, source: str, stamp: float) -> float:
        """Radius [m] of a site's gate at `stamp` [s]."""

    def accepts(self, site: str, distance: float, stamp: float, source: str) -> bool:
        """Whether a measurement this far [m] from the predicted site is near enough."""

@final
class SiteRay:
    """A ray on which a site was detected.

    Args:
        site: its name.
        origin: focal point (3,) in the world [m].
        direction: (3,) unit vector in the world.
        sigma: standard deviation perpendicular to the ray at the site [m].
        source: name for `Estimate.sources`.
        trust: factor of its weight, in [0, 1].
        bias: greatest systematic error [m]; see `Frame.add_position`.
        place: (3,) position of the site on the ray [m], if a depth camera measured it; None: not known.
        place_sigma: standard deviation of `place` along the ray [m].
    """

    def __new__(
        cls,
        site: str,
        origin: npt.ArrayLike,
        direction: npt.ArrayLike,
        sigma: float,
        source: str,
        trust: float = 1.0,
        bias: float = 0.0,
        place: npt.ArrayLike | None = None,
        place_sigma: float = 0.04,
    ) -> SiteRay: ...
    @property
    def site(self) -> str:
        """Its name."""
    @property
    def origin(self) -> npt.NDArray[np.float64]:
        """Focal point (3,) in the world [m]."""
    @property
    def direction(self) -> npt.NDArray[np.float64]:
        """(3,) unit vector in the world."""
    @property
    def sigma(self) -> float:
        """Standard deviation perpendicular to the ray at the site [m]."""
    @property
    def source(self) -> str:
        """Name for `Estimate.sources`."""
    @property
    def trust(self) -> float:
        """Factor of its weight, in [0, 1]."""
    @property
    def bias(self) -> float:
        """Greatest systematic error [m]."""
    @property
    def place(self) -> npt.NDArray[np.float64] | None:
        """(3,) position of the site on the ray [m], if a depth camera measured it; None: not known."""
    @property
    def place_sigma(self) -> float:
        """Standard deviation of `place` along the ray [m]."""
    def moved(self, shift: npt.ArrayLike) -> SiteRay:
        """Returns the ray of a site that has moved by (3,) [m] since it was detected."""
    def trusted(self, trust: float) -> SiteRay:
        """Returns the ray with another trust."""

@final
class Template:
    """Messages with places for `count` whole numbers from `first` on: wherever they are found, and not all need to be.

    Numbers are stored in double precision with the least significant byte first, or in single precision with the most.
    """

    def __new__(cls, messages: Sequence[bytes], first: float, count: int, single: bool, stamp: bytes) -> Template: ...
    def filled(self, numbers: Sequence[npt.NDArray[np.float64]], stamp: bytes) -> list[bytes]:
        """The messages with other numbers, in arrays one after the other, and another stamp that takes as many bytes."""

@final
class Layout:
    """Finds everything that live outputs and files tell of a person, as one row of numbers.

    Of L limbs, J joints, N frames and A angles: N times place x, y, z and rotation x, y, z, w on the parent; L times middle,
    rotation, both diameters, length, and scales of both ends of a limb's cylinder (12 numbers); J joints; L times head and
    rotation of a bone; A angles [rad]; the covariance (6, 6) of the first frame; and L times place and rotation of a limb on its
    parent, with the axes of Unity (left-handed: left is -X, up Y, ahead Z).

    Args:
        own: as of `skeleton`.
        frames: of each frame (4) the bone with which it turns, two points (heads of bones, then joints) in the middle of which it
            is, and its parent among the frames, or -1.
        angles: of each angle (8) the numbers of the bone above and of the other; the three moving axes of Euler angles (0, 1, 2:
            x, y, z), or -1 for the twist about y; which of the three angles it is; its sign; and whether half a turn is added
            before.
        arms: turns (1, L, 3, 3) from limbs at rest to those of Unity.
        limbs: as `frames`, of heads.
    """

    def __new__(
        cls,
        own: npt.NDArray[np.int64],
        frames: npt.NDArray[np.int64],
        angles: npt.NDArray[np.int64],
        arms: npt.NDArray[np.float64],
        limbs: npt.NDArray[np.int64],
    ) -> Layout: ...
    def rows_of_frames(
        self,
        body: Body,
        poses: npt.NDArray[np.float64],
        joints: npt.NDArray[np.float64],
        covariances: npt.NDArray[np.float64],
    ) -> npt.NDArray[np.float64]:
        """The rows (F, ...) of poses (F, L, 4, 4) of a body: joints (F, J, 3), covariances (F, 6, 6) of the first limb."""

    def rows(
        self, estimates: Sequence[Estimate], bodies: Sequence[Body], turn: npt.NDArray[np.float64] | None
    ) -> npt.NDArray[np.float64]:
        """The rows (P, ...) of persons who have a pose, turned by a rigid (4, 4)."""

def people_text(
    text: bytes, numbers: Sequence[npt.NDArray[np.float64]], stamp: float, estimates: Sequence[Estimate]
) -> bytes:
    """A text whose characters 0 are replaced by numbers of arrays in units of 1e-5, its characters 2 in units of 1e-6, and its
    characters 1 by the stamp and of each person status, residual, and status of the limbs, in their order."""

def quaternions(rotations: npt.NDArray[np.float64]) -> tuple[npt.NDArray[np.float64], bool]:
    """Unit quaternions x, y, z, w (..., 4) of rotation matrices (..., 3, 3), whose largest entry is positive; and whether one of
    the matrices is only approximately a rotation."""

def euler_angles(quaternions: npt.NDArray[np.float64], order: tuple[int, int, int]) -> npt.NDArray[np.float64]:
    """Angles (..., 3) [rad] about moving axes, in their order (0, 1, 2: x, y, z), of unit quaternions (..., 4).

    If the first and third axes are parallel, only their sum is determined; the third angle is then zero.
    """

def skeleton(
    body: Body,
    poses: npt.NDArray[np.float64],
    joints: npt.NDArray[np.float64],
    own: npt.NDArray[np.int64],
) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
    """Rotations world_from_bone (F, L, 3, 3) and heads (F, L, 3) of poses (F, L, 4, 4) of a body.

    Rows of `own` are limbs whose joint to the parent is one of joints (F, J, 3), and the number of that.
    """

def carried(
    points: _Points,
    tracker: Tracker | tuple[People, int],
    *,
    elapsed: float,
    world_from_sensor: npt.NDArray[np.float64] | None = None,
) -> npt.NDArray[np.float64] | None:
    """Extrapolates points (N, 3) that were measured some time before the next frame: points on a limb move with it.

    Args:
        points: (N, 3) [m].
        tracker: the tracker of the body.
        elapsed: time from the measurement to the frame [s].
        world_from_sensor: pose of the sensor in whose frame the points are; None: they are in the world.

    Returns:
        (N, 3), or None if no point moves: too little time has passed, or the body's motion is not known.
    """

def body_before(
    tracker: Tracker | tuple[People, int], sites: npt.NDArray[np.float64], camera: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Length (N,) [m] within the body of the lines from positions (N, 3) to a camera (3,); see voodoo.Tracker.body_before."""

def expected_sites(tracker: Tracker | tuple[People, int], stamp: float) -> dict[str, npt.NDArray[np.float64]]:
    """Site name -> predicted position (3,) [m] at a time; see voodoo.Tracker.predict."""

def _estimate(
    found: dict[str, Any],
    limbs: Sequence[str],
    sites: Sequence[str],
    joints: Sequence[str | None],
    sources: Sequence[str],
) -> Estimate:
    """Restores an estimate from its pickled state; what that leaves out is as in a frame in which nobody is tracked."""

def config_fields() -> list[tuple[str, str, str, Any, tuple[float, float] | None, list[str]]]:
    """Name, documentation, unit, default, (least, greatest) and words of every configuration entry."""

@final
class TaperedEllipticCylinder:
    """The shape of a limb: axis +z from z = 0 to z = length, semi-axes a along x and b along y, linear in z.

    Raises:
        BodyError: the numbers do not make a solid.
    """

    REGIONS: ClassVar[list[str]]
    def __new__(cls, length: float, a0: float, b0: float, a1: float, b1: float) -> TaperedEllipticCylinder: ...
    def __getnewargs__(self) -> tuple[float, float, float, float, float]: ...
    @property
    def length(self) -> float:
        """Length [m]."""
    @property
    def a0(self) -> float:
        """Semi-axis along x at the proximal end [m]."""
    @property
    def b0(self) -> float:
        """Semi-axis along y at the proximal end [m]."""
    @property
    def a1(self) -> float:
        """Semi-axis along x at the distal end [m]."""
    @property
    def b1(self) -> float:
        """Semi-axis along y at the distal end [m]."""
    def closest_point(
        self, point: Sequence[float] | npt.NDArray[np.float64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64], float]:
        """Closest surface point (3,) [m], outward normal (3,) and signed distance [m] of one point, all in the limb frame.

        Raises:
            MeasurementError: not three finite numbers.
        """
    def closest_points(self, points: _Points) -> ClosestPoints:
        """Closest surface points of many points (N, 3) [m] in the limb frame, with the tracker's SIMD kernel.

        Raises:
            MeasurementError: wrong shape or dtype, or points that are not finite.
        """
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

@final
class ClosestPoints:
    """Closest points (N, 3), outward normals (N, 3), signed distances (N,) and regions (N,) of the surface, see REGIONS."""

    @property
    def points(self) -> npt.NDArray[np.float32]: ...
    @property
    def normals(self) -> npt.NDArray[np.float32]: ...
    @property
    def signed_distance(self) -> npt.NDArray[np.float32]: ...
    @property
    def region(self) -> npt.NDArray[np.uint8]: ...

@final
class Body:
    """A body of the core; use voodoo.Body."""

    def __new__(cls, name: str, limbs: Sequence[Any], sites: Sequence[Any]) -> Body: ...
    def __getnewargs__(self) -> tuple[str, list[Any], list[Any]]: ...
    @staticmethod
    def human(stature: float, model: str) -> Body: ...
    def scaled(self, factor: float) -> Body: ...
    def parts(self) -> tuple[str, list[Any], list[Any]]: ...
    def at_rest(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Orientations standing_from_limb (L, 3, 3), and where each limb is joined to its parent, in its own frame (L, 3) [m]."""
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

@final
class Frame:
    """All measurements of one instant, from any number of sensors.

    Contiguous arrays are referenced, not copied: leave them unchanged until the step. Names of limbs and sites, weights,
    finiteness and the stamp are checked by the step. If one of them is invalid, the step rejects the whole frame.

    Args:
        stamp: time [s] of any clock; it must increase from step to step.
    """

    def __new__(cls, stamp: float) -> Frame: ...
    @property
    def stamp(self) -> float:
        """Time [s]."""
    def add_points(
        self,
        points: _Points,
        *,
        world_from_sensor: npt.ArrayLike | None = None,
        weight: float = 1.0,
        limb: str | None = None,
        on_body: bool = False,
        source: str = "points",
    ) -> None:
        """Add 3-D points (N, 3) [m] in the sensor frame (K06 IV-A, first three kinds).

        Far from the world's origin (map coordinates) float32 is too coarse for a body: pass points in the sensor frame.

        Args:
            points: float32 or float64, finite; no masked array.
            world_from_sensor: rigid (4, 4); identity by default.
            weight: weight of each point, above zero; it does not affect the computation time.
            limb: the points are known to be on this limb.
            on_body: the points are known to be on the body; not needed with `limb`.
            source: name for the report in `Estimate.sources`.

        Raises:
            MeasurementError: wrong shape or dtype, or no rigid transform.
        """
    def add_depth(
        self,
        image: npt.NDArray[np.uint16] | npt.NDArray[np.float32],
        *,
        camera: _Camera,
        meters_per_unit: float = 0.001,
        world_from_sensor: npt.ArrayLike | None = None,
        weight: float = 1.0,
        source: str = "depth",
    ) -> None:
        """Add an organized depth image: depth along the optical axis (z, not range).

        Args:
            image: (height, width) uint16 or float32; 0, negative or not finite where there is no return; no masked array.
            camera: its calibration, a voodoo.Camera of the same size.
            meters_per_unit: of the image. The default is for uint16 in millimeters; an image in meters needs 1.0.
            world_from_sensor: rigid (4, 4) pose of the optical frame (x right, y down, z forward); identity by default.
            weight: weight of each pixel, above zero; it does not affect the computation time.
            source: name for the report in `Estimate.sources`.

        Raises:
            MeasurementError: wrong shape or dtype, no calibration, or no rigid transform.

        Warns:
            voodoo.UnitWarning: the median depth is below 1 cm or beyond 100 m, so that `meters_per_unit` is wrong.
        """
    def add_color(
        self,
        image: npt.NDArray[np.uint8],
        *,
        camera: _Camera,
        world_from_sensor: npt.ArrayLike | None = None,
        stamp: float | None = None,
        source: str = "color",
    ) -> None:
        """Add a color or gray image.

        Tracker fits the body's contour to its color regions; People distinguishes persons by the colors of their clothes.

        Args:
            image: (height, width, 3) uint8, channels in any order that is the same in all frames, or (height, width) uint8.
            camera: its calibration, a voodoo.Camera of the same size; Tracker rejects one with distortion: undistort first.
            world_from_sensor: rigid (4, 4) pose of the optical frame (x right, y down, z forward); identity by default.
            stamp: when the image was taken [s], within 0.25 s of the frame's stamp, which is the default.
            source: name of the camera, the same in every frame: the learned colors are stored under it, and it names the
                report in `Estimate.sources`.

        Raises:
            MeasurementError: wrong shape or dtype, no calibration, or no rigid transform.
        """
    def add_position(
        self,
        site: str,
        position: Sequence[float] | npt.NDArray[np.float64],
        *,
        weight: float = 1.0,
        bias: float = 0.0,
        source: str = "positions",
    ) -> None:
        """Add the position (3,) [m] of a named site in the world (3-D point-to-point relation).

        Args:
            site: one of `Body.site_names`.
            position: (3,) [m].
            weight: above zero; 20 corresponds to a standard deviation of 2.2 cm, see voodoo.sensors.model.
            bias: greatest systematic error [m]. Within that distance of the site the measurement has no effect; beyond it, only
                the excess distance counts as residual.
            source: name for the report in `Estimate.sources`.

        Raises:
            MeasurementError: not three numbers.
        """
    def add_ray(
        self,
        site: str,
        *,
        origin: Sequence[float] | npt.NDArray[np.float64],
        direction: Sequence[float] | npt.NDArray[np.float64],
        weight: float = 1.0,
        bias: float = 0.0,
        source: str = "rays",
    ) -> None:
        """Add a ray in the world on which a named site was detected (2-D point-to-line relation).

        Args:
            site: one of `Body.site_names`.
            origin: (3,) [m] where it starts, the focal point of the camera.
            direction: (3,) its direction, of any length.
            weight, bias, source: as in `add_position`.

        Raises:
            MeasurementError: not three numbers.
        """
    def add_detection(
        self,
        joints: Mapping[str, Sequence[float] | npt.NDArray[np.float64]],
        *,
        log_odds: float = ...,
        weight: float = 1.0,
        source: str = "detections",
    ) -> None:
        """Add a person whom something else found in this instant: a network, several cameras, markers.

        The joints measure the tracked person whom they are nearest to, as `add_position` does. Where they show nobody who is
        tracked, that person is tracked from this frame on: a lost or absent one who may have moved there, or a new one, from the
        joints (a weight of 1 stands for 0.1 m) or from the depth image, if the detector is more precise. Joints that do not
        determine the pose start nobody.

        Args:
            joints: site name -> (x, y, z) [m] in the world; three that are not collinear determine the pose.
            log_odds: ln(p / (1 - p)) that it is a person, infinite by default; successive detections with a sum of some 4 start a
                track.
            weight, source: as in `add_position`.

        Raises:
            MeasurementError: a position that is not three numbers.
        """
    def _distance(self, sites: Mapping[str, npt.NDArray[np.float64]]) -> float: ...
    def _add_site_rays(
        self, rays: Sequence[SiteRay], *, reference_sigma: float, max_weight: float, min_trust: float
    ) -> int: ...
    def set_ground(self, *, normal: Sequence[float] | npt.NDArray[np.float64], offset: float = 0.0) -> None:
        """Set the ground plane: free points p with normal . p < offset + Config.ground_clearance are background.

        Args:
            normal: (3,) unit vector upwards, in the world.
            offset: height of the floor along it [m].

        Raises:
            MeasurementError: not three numbers.
        """
    def exclude(
        self, low: Sequence[float] | npt.NDArray[np.float64], high: Sequence[float] | npt.NDArray[np.float64]
    ) -> None:
        """Exclude a box of the world that contains no person (the robot's own arm, a coat stand).

        Free points and depth pixels in it are neither matched nor searched; named sites and points of a limb are not affected.

        Args:
            low: (3,) the corner with the least coordinates [m], in the world.
            high: (3,) the other corner [m].

        Raises:
            MeasurementError: not three numbers; the step rejects corners that are not finite or in the wrong order.
        """

def person_candidates(
    depth: npt.NDArray[np.float32],
    *,
    camera: _Camera,
    up: Sequence[float] | None = None,
    floor: tuple[Sequence[float], float] | None = None,
    most: int = 8,
    enlarged: float = 1.0,
) -> list[PersonCandidate]:
    """Person candidates in a depth image (H, W) [m]; training uses this function to crop its images.

    Args:
        depth: float32, 0 or NaN means no return.
        camera: its calibration.
        up: unit vector upwards in the camera's optical frame; None means upwards in the image.
        floor: unit normal and offset of the ground plane in that frame, normal . p = offset; None means that it is detected.
        most: greatest number returned; candidates of a standing person's size come first.
        enlarged: factor by which crops are enlarged, their depth included; for small persons.

    Raises:
        MeasurementError: an array of another type or shape, or a factor that is not above 0.
    """

@final
class Detector:
    """Detects people in depth images with a small network that ships with the library.

    Args:
        weights: path of another network's weights, as lab/training exports them; None means those that ship with the library.
        stature: stature of the people [m], if it is known: lengths are scaled to it.
        stature_sigma: relative standard deviation of `stature`.

    Raises:
        MeasurementError: a file that holds no such weights.
        ConfigError: a stature that is no person's.
    """

    def __new__(
        cls,
        *,
        weights: str | os.PathLike[str] | None = None,
        stature: float | None = None,
        stature_sigma: float = 0.02,
    ) -> Detector: ...
    def detect(self, frame: Frame, *, up: Sequence[float] | npt.NDArray[np.float64] | None = None) -> list[Detection]:
        """Returns the people in the depth images of a frame, in order of decreasing confidence.

        Uses the ground plane and the excluded boxes of the frame and ignores its other measurements. Releases the GIL.

        Args:
            frame: with at least one depth image.
            up: (3,) unit vector upwards in the world, used if the frame has no ground plane; None means upwards in the image.

        Raises:
            MeasurementError: a measurement that cannot be used.
        """

@final
class Estimate:
    """The result of a step; immutable. World frame, meters, seconds."""

    @property
    def stamp(self) -> float:
        """Time of the frame [s]; NaN after a reset and before the first one."""
    @property
    def status(self) -> str:
        """One of four words: tracking; degraded (more than a quarter of the limbs are not measured,
        or a source's measurements are 15 cm from the pose, root mean square); lost (hardly any limb is
        measured, or the measured surface is flat); searching (there is no pose, because no person was detected)."""
    @property
    def steps(self) -> int:
        """ICP steps used."""
    @property
    def mean_squared_distance(self) -> float:
        """Weighted mean of the squared distances of all measurements to the final pose [m^2]; NaN without any."""
    @property
    def residual(self) -> float:
        """Root of the mean squared distance [m]."""
    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the rows of joint_positions."""
    @property
    def limb_names(self) -> tuple[str, ...]:
        """Names of the rows of limb_poses."""
    @property
    def joint_positions(self) -> npt.NDArray[np.float64]:
        """Positions (J, 3) [m] of all sites; J = 0 before the first reset."""
    @property
    def limb_poses(self) -> npt.NDArray[np.float64]:
        """world_from_limb (L, 4, 4) of all limbs."""
    @property
    def joints(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Position (3,) [m] of every site."""
    @property
    def world_from_limb(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Pose (4, 4) of every limb."""
    @property
    def limb_status(self) -> Mapping[str, str]:
        """Status of every limb in the frame: "measured"; "inferred" (occluded, out of view, or without points that another limb
        would not explain as well, so that its pose follows from joints and prediction); or "lost" (it should be visible at its
        estimated pose, but is not)."""
    @property
    def limb_probability(self) -> Mapping[str, float]:
        """Probability that the distal end of every limb is within 10 cm of its position, fitted to depth images; NaN before the
        first frame, {} while searching. From 0.8 on the limb's status is "measured"."""
    @property
    def covariance(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Covariance (3, 3) [m^2] of the position of every site, world frame; NaN before the first frame."""
    @property
    def joint_covariances(self) -> npt.NDArray[np.float64]:
        """The covariances of `covariance` as an array (J, 3, 3) in the order of joint_names."""
    @property
    def joint_sigma(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Standard deviation (3,) [m] of every site's x, y and z in the world."""
    @property
    def limb_covariance(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Covariance (6, 6) of the pose of every limb: x, y, z [m], then rotations about the world's x, y, z [rad] through the
        origin of the limb frame, as in geometry_msgs/PoseWithCovariance."""
    @property
    def root_covariance(self) -> npt.NDArray[np.float64]:
        """The covariance (6, 6) of the first limb in `limb_covariance`."""
    @property
    def angle_covariance(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Covariance (3, 3) [rad^2] of the rotation of every joint about the world's axes."""
    @property
    def length_sigma(self) -> Mapping[str, float]:
        """Standard deviation of every limb's length [m]; NaN where lengths are not refined."""
    @property
    def girth_sigma(self) -> Mapping[str, float]:
        """Standard deviation of every limb's mean radius [m]; NaN where girths are not refined."""
    @property
    def limb_points(self) -> Mapping[str, int]:
        """Matched points of every limb."""
    @property
    def limb_residual(self) -> Mapping[str, float]:
        """Root of the mean squared distance of every limb's points [m]; NaN without any."""
    @property
    def joint_gaps(self) -> Mapping[str, float]:
        """Distance between the two halves of every joint [m]."""
    @property
    def sources(self) -> Mapping[str, tuple[int, int, float]]:
        """For each source: number of candidates, number of matched ones, root of their mean squared distance [m]."""

@final
class Tracker:
    """The tracker of the core; use voodoo.Tracker."""

    def __new__(cls, body: Body, values: Mapping[str, Any], detector: object) -> Tracker: ...
    @property
    def can_search(self) -> bool: ...
    @property
    def detector_failures(self) -> int: ...
    @property
    def refusal(self) -> str | None: ...
    @property
    def estimate(self) -> Estimate: ...
    def _body(self) -> Body: ...
    def _reset(
        self, joints: Sequence[tuple[str, tuple[float, float, float]]], *, fit_sizes: bool = True
    ) -> Estimate: ...
    def _reset_pose(self, world_from_limb: Sequence[npt.ArrayLike]) -> Estimate: ...
    def step(self, frame: Frame) -> Estimate: ...
    def _segment(
        self, frame: Frame, poses: Sequence[npt.ArrayLike] | None = None
    ) -> dict[str, npt.NDArray[np.float32]]: ...
    def _learn_colors(self, frame: Frame, poses: Sequence[npt.ArrayLike] | None = None) -> None: ...
    def _region_lines(self, source: str) -> npt.NDArray[np.float32]: ...
    def _set_background(self, source: str, images: Sequence[npt.NDArray[np.uint8]]) -> None: ...
    def distance(self, points: _Points) -> npt.NDArray[np.float32]: ...
    def limb_distances(self, points: _Points) -> npt.NDArray[np.float32]: ...
    def scale(self, factor: float) -> None: ...
    def set_shape(self, limb: str, shape: TaperedEllipticCylinder) -> None: ...
    def _add_limb(
        self,
        name: str,
        parent: str,
        shape: TaperedEllipticCylinder,
        parts: tuple[Any, ...],
        sites: Sequence[tuple[str, tuple[float, float, float]]],
    ) -> None: ...
    def remove_limb(self, name: str) -> None: ...

@final
class People:
    """The multi-person tracker of the core; use voodoo.People."""

    def __new__(
        cls,
        body: Body,
        values: Mapping[str, Any],
        detector: object,
        *,
        limit: int | None,
        nearest: bool,
        forget_after: float,
        region: tuple[Sequence[float], Sequence[float]] | None,
    ) -> People: ...
    @property
    def detector_failures(self) -> int: ...
    @property
    def refusal(self) -> str | None: ...
    def step(self, frame: Frame, own: Sequence[tuple[int, Frame]]) -> list[tuple[int, Estimate]]: ...
    def add(self, joints: Sequence[tuple[str, tuple[float, float, float]]], fit_sizes: bool) -> int: ...
    def needs_colors(self) -> bool: ...
    def present(self) -> list[int]: ...
    def only(self, ids: Sequence[int] | None) -> None: ...
    def estimate(self, id: int) -> Estimate: ...
    def body(self, id: int) -> Body: ...

@final
class View:
    """A silhouette of the core; use voodoo.ik.Silhouette."""

    def __new__(
        cls,
        distance: npt.NDArray[np.float32],
        thickness: npt.NDArray[np.float32],
        depth: npt.NDArray[np.float32] | None,
        border: float,
        camera: _Camera,
        camera_from_world: npt.ArrayLike,
    ) -> View: ...

@final
class Chain:
    """A kinematic chain of the core; use voodoo.ik.Chain."""

    def __new__(cls, body: Body, limbs: Sequence[str], free_root: bool) -> Chain: ...
    def parts(self) -> tuple[list[str], list[list[float]], list[str], list[str]]: ...
    def forward(
        self, base: npt.ArrayLike, angles: npt.NDArray[np.float64]
    ) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]: ...
    def jacobian(self, base: npt.ArrayLike, angles: npt.NDArray[np.float64], site: str) -> npt.NDArray[np.float64]: ...
    def criterion(
        self,
        base: npt.ArrayLike,
        angles: npt.NDArray[np.float64],
        segments: Sequence[tuple[str, str, float]] | None,
        depth: tuple[float, float],
        views: Sequence[View],
        others: Sequence[tuple[str, npt.NDArray[np.float64]]],
    ) -> tuple[float, npt.NDArray[np.float64]]: ...
    def project(
        self, base: npt.ArrayLike, world_from_limb: Sequence[npt.NDArray[np.float64]], closest: bool
    ) -> list[float]: ...
    def solve(
        self,
        base: npt.ArrayLike,
        starts: npt.NDArray[np.float64],
        goals: Sequence[tuple[str, str, tuple[float, ...], float, int]],
        positions: npt.NDArray[np.float64] | None,
        segments: Sequence[tuple[str, str, float]] | None,
        depth: tuple[float, float],
        views: Sequence[View],
        others: Sequence[tuple[str, npt.NDArray[np.float64]]],
        how: tuple[int, float, float, float, float, float],
        rest: Sequence[tuple[int, float]],
    ) -> tuple[
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        tuple[float, ...],
    ]: ...
