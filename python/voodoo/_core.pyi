"""The compiled core. Arrays are NumPy; lengths in meters, times in seconds, angles in radians."""

import os
from collections.abc import Callable, Mapping, Sequence
from typing import Any, ClassVar, Protocol, final

import numpy as np
import numpy.typing as npt

__all__ = [
    "Body",
    "BodyView",
    "Camera",
    "Chain",
    "ClosestPoints",
    "Detection",
    "Detector",
    "Estimate",
    "Frame",
    "KeypointLayout",
    "People",
    "PersonCandidate",
    "SiteGate",
    "SiteRay",
    "SkinCue",
    "SkinTeacher",
    "StillDepth",
    "TaperedEllipticCylinder",
    "Tracker",
    "View",
    "__version__",
    "_estimate",
    "body_before",
    "body_view",
    "carried",
    "config_fields",
    "expected_sites",
    "linear_sum_assignment",
    "nearest_surface",
    "person_candidates",
    "render_depth",
]

__version__: str

_Points = npt.NDArray[np.float32] | npt.NDArray[np.float64]

@final
class Camera:
    """A camera as the core holds it; use voodoo.Camera."""

    def __new__(
        cls,
        width: int,
        height: int,
        intrinsics: tuple[float, float, float, float],
        model: str,
        coefficients: Sequence[float],
    ) -> Camera: ...
    def project(self, points: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """Pixels (N, 2) of points (N, 3) in the camera's frame [m]; NaN where there is none."""

    def undistorted(self, pixels: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        """x/z, y/z (N, 2) of pixels (N, 2); NaN where the lens puts nothing."""

    def rays(self) -> npt.NDArray[np.float32]:
        """x/z, y/z (height, width, 2) of all pixels."""

class _Camera(Protocol):
    @property
    def core(self) -> Camera: ...

def render_depth(
    body: Body,
    world_from_limb: Sequence[npt.NDArray[np.float64]],
    *,
    camera: _Camera,
    world_from_sensor: npt.NDArray[np.float64] | None = None,
) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.int16]]:
    """Depth (height, width) [m], 0 where nothing is seen, and index of the limb, -1 for none; see voodoo.render_depth."""

def nearest_surface(
    pixels: npt.NDArray[np.float64], depths: npt.NDArray[np.float64], *, pixel: tuple[float, float], radius: float
) -> float | None:
    """Depth of the nearest surface around a place in a picture [m], None with fewer than three points there.

    Args:
        pixels: (N, 2) where points are seen.
        depths: (N,) [m].
        pixel: the place (u, v).
        radius: of what is looked at [px].

    Raises:
        MeasurementError: other shapes.
    """

def linear_sum_assignment(costs: npt.NDArray[np.float64]) -> list[tuple[int, int]]:
    """Pairs (row, column) of finite costs (N, M) with the least sum, every row or every column once, by rows."""

@final
class BodyView:
    """What a depth camera saw of the body, in the picture of a color camera beside it.

    Args:
        mask: (H, W) of the picture: True where something near the body was seen, or where the depth camera does not look.
        pixels: (N, 2) of the points in the picture.
        depths: (N,) of the points along the color camera's optical axis [m].
        still: (N,) whether nothing behind a point was ever seen there: it may be the scene. None: not known.
        before: (H, W) of the picture: True where something is before what was seen there once. None: not known.

    Raises:
        MeasurementError: shapes that do not belong together.
    """

    def __new__(
        cls,
        mask: npt.NDArray[np.bool_],
        pixels: npt.NDArray[np.float64],
        depths: npt.NDArray[np.float64],
        still: npt.NDArray[np.bool_] | None = None,
        before: npt.NDArray[np.bool_] | None = None,
    ) -> BodyView: ...
    @property
    def mask(self) -> npt.NDArray[np.bool_]: ...
    @property
    def pixels(self) -> npt.NDArray[np.float64]: ...
    @property
    def depths(self) -> npt.NDArray[np.float64]: ...
    @property
    def still(self) -> npt.NDArray[np.bool_] | None: ...
    @property
    def before(self) -> npt.NDArray[np.bool_] | None: ...

@final
class StillDepth:
    """What may be the still scene of a depth camera that stands: what has been at its place for some pictures, and behind
    which nothing was ever seen. A table's edge does not become a hand.

    The surface of a person who has not moved yet looks the same, so this only tells what has moved.
    """

    def __new__(cls) -> StillDepth: ...
    def __copy__(self) -> StillDepth: ...

def body_view(
    depth: npt.NDArray[np.uint16] | npt.NDArray[np.float32],
    camera: _Camera,
    joints: npt.NDArray[np.float64],
    *,
    meters_per_unit: float,
    world_from_depth: npt.NDArray[np.float64],
    color_from_depth: npt.NDArray[np.float64],
    color_camera: _Camera,
    beyond: Callable[[float], npt.NDArray[np.bool_]],
    reach: int,
    step: int,
    margin: float,
    scene: StillDepth | None,
) -> BodyView:
    """See voodoo.sensors.body_view.

    Args:
        depth: (H, W).
        camera: its calibration.
        joints: (N, 3) of the body in the world [m].
        meters_per_unit: of `depth`.
        world_from_depth, color_from_depth: (4, 4).
        color_camera: calibration of the color camera.
        beyond: where the depth camera does not look (H, W) at a distance from it [m], in the color picture.
        reach: what is within so many rows and columns of a point belongs to it.
        step: every step-th row and column of the depth image is used.
        margin: enlargement of the box around the body [m].
        scene: takes up the image.

    Raises:
        MeasurementError: shapes that do not belong together.
    """

@final
class SkinTeacher:
    """What one camera's pictures taught of skin; see voodoo.sensors.skin."""

    def __new__(cls) -> SkinTeacher: ...
    @property
    def learned(self) -> int: ...
    @property
    def skin(self) -> npt.NDArray[np.float32]: ...
    def learn(
        self,
        cue: SkinCue,
        image: npt.NDArray[np.uint8] | None,
        places: npt.NDArray[np.float64],
        *,
        world_from_sensor: npt.NDArray[np.float64],
        camera: _Camera,
        half_life: float,
        every: int,
        settled: int,
    ) -> None: ...

@final
class SkinCue:
    """Regions of skin in one camera's pictures, followed and named; see voodoo.sensors.skin."""

    def __new__(
        cls,
        sites: Sequence[str],
        *,
        gate: float,
        growth: float,
        lost_gate: float,
        widest_gate: float,
        unexplained: float,
        ambiguity: float,
    ) -> SkinCue: ...
    def __copy__(self) -> SkinCue: ...
    @property
    def mask(self) -> npt.NDArray[np.bool_] | None: ...
    @property
    def candidates(self) -> list[tuple[tuple[float, float], int, int, bool]]: ...
    @property
    def assigned(self) -> list[tuple[int, int]]: ...
    @property
    def followed(self) -> list[tuple[int | None, int, float, list[float], list[float], list[float]]]: ...
    def observe(
        self,
        teacher: SkinTeacher,
        image: npt.NDArray[np.uint8],
        predicted: Mapping[str, npt.NDArray[np.float64]],
        *,
        stamp: float,
        world_from_sensor: npt.NDArray[np.float64],
        camera: _Camera,
        body: BodyView | None,
        settled: bool,
        arm_lost: Sequence[bool],
        upper_arm_visible: Sequence[bool],
        tracker: Tracker | tuple[People, int] | None,
        others: Sequence[Tracker | tuple[People, int]],
    ) -> list[tuple[int, npt.NDArray[np.float64], npt.NDArray[np.float64], npt.NDArray[np.float64] | None, float]]: ...

@final
class KeypointLayout:
    """A network's keypoints: of each site the keypoints with their shares, and its spread [m]."""

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
        only: Sequence[str] | None,
        gate: SiteGate | None,
        surface: Callable[[tuple[float, float]], float | None] | None,
        before: Mapping[str, float] | None,
    ) -> tuple[list[SiteRay], list[tuple[str, npt.NDArray[np.float64], float]], list[str], list[str]]: ...

@final
class SiteGate:
    """Which measurements of sites are near enough to be believed; see voodoo.sensors.gating.SiteGate."""

    def __new__(cls, radius: float, growth: float, widest: float) -> SiteGate: ...
    def __copy__(self) -> SiteGate: ...
    def limit(self, site: str, source: str, stamp: float) -> float: ...
    def accepts(self, site: str, distance: float, stamp: float, source: str) -> bool: ...

@final
class SiteRay:
    """A site was seen on a ray.

    Args:
        site: its name.
        origin: focal point (3,) in the world [m].
        direction: (3,) unit vector in the world.
        sigma: standard deviation across the ray at the site [m].
        source: name for `Estimate.sources`.
        trust: factor of its weight, in [0, 1].
        bias: it may always be this far off [m]; see `Frame.add_position`.
        place: (3,) where on the ray the site is [m], if a depth camera saw it; None: not known.
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
        """Standard deviation across the ray at the site [m]."""
    @property
    def source(self) -> str:
        """Name for `Estimate.sources`."""
    @property
    def trust(self) -> float:
        """Factor of its weight, in [0, 1]."""
    @property
    def bias(self) -> float:
        """It may always be this far off [m]."""
    @property
    def place(self) -> npt.NDArray[np.float64] | None:
        """(3,) where on the ray the site is [m], if a depth camera saw it; None: not known."""
    @property
    def place_sigma(self) -> float:
        """Standard deviation of `place` along the ray [m]."""
    def moved(self, shift: npt.ArrayLike) -> SiteRay:
        """The ray of a site that has gone on by (3,) [m] since it was seen."""
    def trusted(self, trust: float) -> SiteRay:
        """The ray with another trust."""

def carried(
    points: _Points,
    tracker: Tracker | tuple[People, int],
    *,
    elapsed: float,
    world_from_sensor: npt.NDArray[np.float64] | None = None,
) -> npt.NDArray[np.float64] | None:
    """Where points (N, 3) are that were measured some time before the next frame, those on a limb moved on with it.

    Args:
        points: (N, 3) [m].
        tracker: who follows the body.
        elapsed: time from the measurement to the frame [s].
        world_from_sensor: pose of the sensor in whose frame the points are; None: they are in the world.

    Returns:
        (N, 3), or None where nothing moves: too little time has passed, or the body's motion is not known.
    """

def body_before(
    tracker: Tracker | tuple[People, int], sites: npt.NDArray[np.float64], camera: npt.NDArray[np.float64]
) -> npt.NDArray[np.float64]:
    """Length of body (N,) [m] between places (N, 3) and a camera (3,); see voodoo.Tracker.body_before."""

def expected_sites(tracker: Tracker | tuple[People, int], stamp: float) -> dict[str, npt.NDArray[np.float64]]:
    """Site name -> (3,) where it is expected at a time [m]; see voodoo.Tracker.predict."""

def _estimate(
    head: tuple[Any, ...], names: tuple[Any, ...], found: tuple[Any, ...], spread: tuple[Any, ...] | None = None
) -> Estimate:
    """An estimate of what pickle and copy keep of it; earlier ones kept no `spread`."""

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
        """Closest surface points of many points (N, 3) [m] in the limb frame, by the tracker's SIMD kernel.

        Raises:
            MeasurementError: wrong shape or dtype, or points that are not finite.
        """
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

@final
class ClosestPoints:
    """Closest points (N, 3), outward normals (N, 3), signed distances (N,) and regions (N,), see REGIONS."""

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
    """A body as the core holds it; use voodoo.Body."""

    def __new__(cls, name: str, limbs: Sequence[Any], sites: Sequence[Any]) -> Body: ...
    def __getnewargs__(self) -> tuple[str, list[Any], list[Any]]: ...
    @staticmethod
    def human(stature: float, model: str) -> Body: ...
    def scaled(self, factor: float) -> Body: ...
    def parts(self) -> tuple[str, list[Any], list[Any]]: ...
    def __eq__(self, value: object, /) -> bool: ...
    def __ne__(self, value: object, /) -> bool: ...

@final
class Frame:
    """All measurements of one instant, from any number of sensors.

    Arrays are referenced, not copied (unless they are not contiguous): leave them unchanged until the step. Names of limbs
    and sites, weights, finiteness and the stamp are checked by the step, which refuses the whole frame.

    Args:
        stamp: time [s] by any clock; every step's is after the last one's.
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
        """Add 3-D points (N, 3) [m] in the sensor's frame (K06 IV-A, first three kinds).

        Far from the world's origin (map coordinates) float32 has no digits left for a body: give points in the sensor's frame.

        Args:
            points: float32 or float64, finite; no masked array.
            world_from_sensor: rigid (4, 4); identity by default.
            weight: weight of each point, above zero; a larger one costs no time.
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
            image: (height, width) uint16 or float32; 0, negative or not finite where nothing returned; no masked array.
            camera: its calibration, a voodoo.Camera of the same size.
            meters_per_unit: of the image. The default is that of uint16 in millimeters; an image in meters needs 1.0.
            world_from_sensor: rigid (4, 4) pose of the optical frame (x right, y down, z forward); identity by default.
            weight: weight of each pixel, above zero; a larger one costs no time.
            source: name for the report in `Estimate.sources`.

        Raises:
            MeasurementError: wrong shape or dtype, no calibration, or no rigid transform.
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
        """Add a color or gray picture: Tracker fits the body's contour to its regions, People tells persons apart by clothes.

        Args:
            image: (height, width, 3) uint8, channels in any order that is the same in all frames, or (height, width) uint8.
            camera: its calibration, a voodoo.Camera of the same size; Tracker refuses one with distortion: undistort first.
            world_from_sensor: rigid (4, 4) pose of the optical frame (x right, y down, z forward); identity by default.
            stamp: when the picture was taken [s], within 0.25 s of the frame's; the frame's by default.
            source: name of the camera, the same in every frame: what is learned of colors goes by it, and the report in
                `Estimate.sources`.

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
            weight: above zero; 20 is that of a datum good to 2.2 cm, see voodoo.sensors.model.
            bias: it may always be so far off [m]: within that distance of the site it says nothing, beyond, its force is that
                of the rest of the distance.
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
        """Add a ray in the world on which a named site was seen (2-D point-to-line relation).

        Args:
            site: one of `Body.site_names`.
            origin: (3,) [m] where it starts, the focal point of the camera.
            direction: (3,) where it goes, of any length.
            weight, bias, source: as in `add_position`.

        Raises:
            MeasurementError: not three numbers.
        """
    def _add_site_rays(
        self, rays: Sequence[SiteRay], *, reference_sigma: float, max_weight: float, min_trust: float
    ) -> int: ...
    def set_ground(self, *, normal: Sequence[float] | npt.NDArray[np.float64], offset: float = 0.0) -> None:
        """Tell the floor: free points p with normal . p < offset + Config.ground_clearance are background.

        Args:
            normal: (3,) unit vector upwards, in the world.
            offset: height of the floor along it [m].

        Raises:
            MeasurementError: not three numbers.
        """
    def exclude(
        self, low: Sequence[float] | npt.NDArray[np.float64], high: Sequence[float] | npt.NDArray[np.float64]
    ) -> None:
        """Leave out a box of the world: nothing in it belongs to anybody (the robot's own arm, a coat stand).

        Free points and depth pixels in it are neither matched nor searched; named sites and points of a limb are not touched.

        Args:
            low: (3,) the corner with the least coordinates [m], in the world.
            high: (3,) the other corner [m].

        Raises:
            MeasurementError: not three numbers; the step refuses corners that are not finite or in the wrong order.
        """

@final
class PersonCandidate:
    """What may be a person in a depth image, with the picture of it that the network looks at. Camera frame, meters."""

    @property
    def crop(self) -> npt.NDArray[np.float32]:
        """The picture (2, 96, 96): depth behind the middle by 1.2 m from -1 to 1, and the mask."""
    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """Its pixels (H, W)."""
    @property
    def middle(self) -> tuple[float, float, float]:
        """The picture's middle: (x/z, y/z) in the turned camera, and the depth [m]."""
    @property
    def roll(self) -> float:
        """Angle by which the camera is turned about its optical axis for up to be up [rad]."""
    @property
    def area(self) -> float:
        """Surface seen [m^2]."""
    @property
    def floor(self) -> tuple[tuple[float, float, float], float] | None:
        """Normal and offset of the floor, told or found."""

def person_candidates(
    depth: npt.NDArray[np.float32],
    *,
    camera: _Camera,
    up: Sequence[float] | None = None,
    floor: tuple[Sequence[float], float] | None = None,
    most: int = 8,
) -> list[PersonCandidate]:
    """What may be a person in a depth image (H, W) [m]: what training cuts its pictures with.

    Args:
        depth: float32, 0 or NaN means no return.
        camera: its calibration.
        up: unit vector upwards in the camera's optical frame; None means upwards in the image.
        floor: its unit normal and offset in that frame, normal . p = offset; None means that it is looked for.
        most: so many are returned, those of a standing person's size first.

    Raises:
        MeasurementError: not such an array.
    """

@final
class Detector:
    """Finds people in depth images, with a small network that comes with the library.

    Args:
        weights: path of another network's weights, as training/ exports them; None means those that come with the library.

    Raises:
        MeasurementError: a file that holds no such weights.
    """

    def __new__(cls, *, weights: str | os.PathLike[str] | None = None) -> Detector: ...
    def detect(self, frame: Frame, *, up: Sequence[float] | npt.NDArray[np.float64] | None = None) -> list[Detection]:
        """The people in the depth images of a frame, the surest first.

        Floor and boxes to leave out are those of the frame; what else it holds is not looked at. Releases the GIL.

        Args:
            frame: with at least one depth image.
            up: (3,) unit vector upwards in the world, where the frame tells no floor; None means upwards in the image.

        Raises:
            MeasurementError: a measurement that cannot be used.
        """

@final
class Detection:
    """A person in a depth image. World frame, meters."""

    @property
    def joints(self) -> dict[str, npt.NDArray[np.float64]]:
        """Joint name -> position (3,) [m]; `l_` and `r_` are the person's own."""
    @property
    def joint_sigma(self) -> dict[str, float]:
        """Joint name -> standard deviation along each axis [m]."""
    @property
    def visible(self) -> dict[str, float]:
        """Joint name -> probability that it is in the image and not hidden."""
    @property
    def lengths(self) -> dict[str, float]:
        """Upper arm, forearm, thigh, shank, shoulder and hip width, trunk, neck and stature [m]."""
    @property
    def length_sigma(self) -> dict[str, float]:
        """The same names -> standard deviation [m]."""
    @property
    def stature(self) -> float:
        """Height of the person when standing upright [m]."""
    @property
    def facing(self) -> float:
        """Probability that the front of the trunk shows."""
    @property
    def confidence(self) -> float:
        """Probability that it is a person."""
    @property
    def source(self) -> str:
        """The depth image it was found in."""
    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """The pixels (H, W) of that image that show it."""
    @property
    def floor(self) -> tuple[tuple[float, float, float], float] | None:
        """The floor as the image shows it, or as the frame gave it: unit normal (3,) upwards and height along it [m]; or None."""

@final
class Estimate:
    """What a step found; immutable. World frame, meters, seconds."""

    @property
    def stamp(self) -> float:
        """Time of the frame [s]; NaN after a reset and before the first one."""
    @property
    def status(self) -> str:
        """tracking, degraded (more than a quarter of the limbs not measured) or lost (hardly anything is measured,
        or what is seen there is flat), or searching (there is no pose: nobody was found)."""
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
        """Positions (J, 3) [m] of all joints and sites; J = 0 before the first reset."""
    @property
    def limb_poses(self) -> npt.NDArray[np.float64]:
        """world_from_limb (L, 4, 4) of all limbs."""
    @property
    def joints(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Position (3,) [m] of every named joint and site."""
    @property
    def world_from_limb(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Pose (4, 4) of every limb."""
    @property
    def limb_status(self) -> Mapping[str, str]:
        """What the frame says about every limb: "measured", "inferred" (hidden, out of view, or nothing seen that another
        limb would not explain as well: carried by joints and prediction) or "lost" (it should show where it is, and does
        not)."""
    @property
    def covariance(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Covariance (3, 3) [m^2] of the position of every joint and site, world frame; NaN before the first frame."""
    @property
    def joint_covariances(self) -> npt.NDArray[np.float64]:
        """The same as an array (J, 3, 3) in the order of joint_names."""
    @property
    def joint_sigma(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Standard deviation (3,) [m] of every joint's and site's x, y and z in the world."""
    @property
    def limb_covariance(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Covariance (6, 6) of the pose of every limb: x, y, z [m], then turns about the world's x, y, z [rad] through the
        origin of the limb's frame, as in geometry_msgs/PoseWithCovariance."""
    @property
    def angle_covariance(self) -> Mapping[str, npt.NDArray[np.float64]]:
        """Covariance (3, 3) [rad^2] of the turn of every joint about the world's axes."""
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
        """What each source gave: candidates, those that matched, root of their mean squared distance [m]."""

@final
class Tracker:
    """The tracker of the core; use voodoo.Tracker."""

    def __new__(cls, body: Body, values: Mapping[str, Any], detector: object) -> Tracker: ...
    @property
    def can_search(self) -> bool: ...
    @property
    def detector_failures(self) -> int: ...
    @property
    def estimate(self) -> Estimate: ...
    def _body(self) -> Body: ...
    def _reset(self, joints: Mapping[str, tuple[float, float, float]], *, fit_sizes: bool = True) -> Estimate: ...
    def _reset_pose(self, world_from_limb: Sequence[npt.NDArray[np.float64]]) -> Estimate: ...
    def step(self, frame: Frame) -> Estimate: ...
    def _segment(
        self, frame: Frame, poses: Sequence[npt.NDArray[np.float64]] | None = None
    ) -> dict[str, npt.NDArray[np.float32]]: ...
    def _learn_colors(self, frame: Frame, poses: Sequence[npt.NDArray[np.float64]] | None = None) -> None: ...
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
    """Several persons as the core follows them; use voodoo.People."""

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
    def step(self, frame: Frame, own: Sequence[tuple[int, Frame]]) -> list[tuple[int, Estimate]]: ...
    def add(self, joints: Mapping[str, tuple[float, float, float]], fit_sizes: bool) -> int: ...
    def needs_colors(self) -> bool: ...
    def only(self, ids: Sequence[int] | None) -> None: ...
    def estimate(self, id: int) -> Estimate | None: ...
    def body(self, id: int) -> Body | None: ...

@final
class View:
    """A silhouette as the core holds it; use voodoo.ik.Silhouette."""

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
    """A kinematic chain as the core holds it; use voodoo.ik.Chain."""

    def __new__(cls, body: Body, limbs: Sequence[str], free_root: bool) -> Chain: ...
    @property
    def angle_names(self) -> list[str]: ...
    @property
    def limits(self) -> list[list[float]]: ...
    @property
    def limb_names(self) -> list[str]: ...
    @property
    def site_names(self) -> list[str]: ...
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
        start: npt.NDArray[np.float64],
        goals: Sequence[tuple[str, str, tuple[float, ...], float, int]],
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
        tuple[float, ...],
        int,
        bool,
        float,
    ]: ...
    def solve_many(
        self,
        base: npt.ArrayLike,
        starts: npt.NDArray[np.float64],
        goals: Sequence[tuple[str, str, tuple[float, ...], float, int]],
        positions: npt.NDArray[np.float64],
        segments: Sequence[tuple[str, str, float]] | None,
        depth: tuple[float, float],
        views: Sequence[View],
        how: tuple[int, float, float, float, float, float],
        rest: Sequence[tuple[int, float]],
    ) -> tuple[
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
        npt.NDArray[np.float64],
    ]: ...
