"""Python interface of the tracker: names, defaults and validation around the compiled core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate, Frame, TaperedEllipticCylinder
from voodoo.config import Config
from voodoo.detectors.base import AnyDetector
from voodoo.errors import BodyError, ConfigError, MeasurementError, MissingPoseError, of_kind, one_thread
from voodoo.model.body import Body, Joint, checked_joints, ordered_poses
from voodoo.model.joint import number_of
from voodoo.names import SEARCHING


class _Searching(dict[str, Any]):
    """What an estimate without a pose has of joints and limbs: nothing, and it says so."""

    def __missing__(self, name: str) -> Any:  # noqa: ANN401 - nothing is returned
        raise MissingPoseError(
            f"{name!r}: expected an estimate with a pose, found one with the status {SEARCHING!r}: no person was found "
            "yet, or the person has left; check estimate.status first"
        )


_NO_POSE = MappingProxyType(_Searching())


def _says_if_searching(plain: Any) -> property:  # noqa: ANN401 - a property of the core
    """A mapping by names of joints or limbs that, where there is no pose, says so instead of doubting the name."""

    def read(estimate: Estimate) -> Any:  # noqa: ANN401 - a mapping
        found = plain.__get__(estimate)
        return found if found or estimate.status != SEARCHING else _NO_POSE

    return property(read, doc=plain.__doc__)


for _name in (
    *("joints", "covariance", "joint_sigma", "joint_gaps", "angle_covariance"),
    *("world_from_limb", "limb_status", "limb_probability", "limb_covariance", "limb_points", "limb_residual"),
    *("length_sigma", "girth_sigma"),
):
    setattr(Estimate, _name, _says_if_searching(vars(Estimate)[_name]))


class RegionLines(NamedTuple):
    """Search lines perpendicular to the contours of limbs in one image, and the color edges found on them; in pixels.

    Args:
        limbs: (N,) index in `Body.limb_names`.
        places: (N, 2) pixels on the contour of the posed body.
        normals: (N, 2) unit vectors outward.
        offsets: (N,) outward distance from the contour to the color edge.
        sigmas: (N,) its standard deviation; infinite if the colors give no evidence.
    """

    limbs: npt.NDArray[np.int64]
    places: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.float32]
    sigmas: npt.NDArray[np.float32]


@one_thread
class Tracker:
    """Tracks one body through frames.

    Use a tracker from one thread at a time: during a step, any other call to it raises VoodooError. Different trackers can
    run in parallel, since `step` releases the GIL. A tracker goes on in a forked process: its threads are started again there.

    Args:
        body: body to track, with its initial sizes.
        config: parameters; the defaults were tuned by measurements.
        detector: finds the body in depth images: when there is no pose, when the body is lost, and when the tracked position is
            wrong; and everybody else who moves in view, so that nobody else is taken for the body. "shipped" is the person
            detector that comes with the package; None disables detection. See `voodoo.detectors` for others.
    """

    def __init__(self, body: Body, *, config: Config | None = None, detector: AnyDetector = "shipped") -> None:
        """Make a tracker without a pose: `step` searches for a person, `reset` sets a known pose.

        Raises:
            BodyError: `body` is not a Body.
            ConfigError: `config` is not a Config, or `detector` is not a detector.
        """
        self._initial = of_kind("body", body, Body, BodyError)
        self.config = of_kind("config", Config() if config is None else config, Config, ConfigError)
        self.detector = detector
        self._backgrounds: dict[str, tuple[npt.NDArray[np.uint8], ...]] = {}
        self.search()

    @property
    def body(self) -> Body:
        """The body with its current sizes."""
        return Body(self._core._body())

    @property
    def estimate(self) -> Estimate:
        """The last estimate; at first one with status "searching", NaN as its stamp and no poses."""
        return self._core.estimate

    @property
    def can_search(self) -> bool:
        """Whether `step` searches for the body while there is no pose, i.e. the detector supports this body."""
        return self._core.can_search

    @property
    def detector_failures(self) -> int:
        """Steps since the last `search` in which the detector failed; each of them warned (`voodoo.DetectorWarning`)."""
        return self._core.detector_failures

    @property
    def refusal(self) -> str | None:
        """Why somebody who was detected in the last step is not tracked; None if nobody was, or everybody is."""
        return self._core.refusal

    def reset(self, *, joints: Mapping[str, Sequence[float]], fit_sizes: bool = True) -> Estimate:
        """Set the pose, and the sizes, from positions of named joints and sites; stamps may restart afterwards.

        Args:
            joints: site name -> (x, y, z) [m] in the world frame. Any subset that determines the pose: at least three
                positions that are not collinear. Limbs without positions keep their rest orientation.
            fit_sizes: also scale the body and stretch its limbs to the distances between the positions. Implausible
                sizes are corrected: a limb much shorter than its counterpart, a knee or elbow too far along a straight leg
                or arm, and with the first depth image one arm or leg much longer than the other.

        Raises:
            BodyError: an unknown name, or an entry that is not three finite numbers.
            MeasurementError: the positions do not determine the pose, or with `fit_sizes` would make the body more than ten times
                larger or smaller: they are not in meters. The tracker is unchanged.
        """
        return self._core._reset(checked_joints(joints), fit_sizes=fit_sizes)

    def search(self) -> None:
        """Discard the pose and everything learned with it: the next step searches for a person, as in a new tracker."""
        self._core = _core.Tracker(self._initial.core, self.config.values(), self.detector)
        for source, images in self._backgrounds.items():
            self._core._set_background(source, images)

    def reset_pose(self, world_from_limb: Mapping[str, npt.ArrayLike]) -> Estimate:
        """Set the pose of every limb directly: limb name -> rigid (4, 4) world_from_limb; sizes stay as they are.

        Raises:
            BodyError: a limb is missing or unknown.
            MeasurementError: a matrix is not rigid; it names the limb.
        """
        return self._core._reset_pose(ordered_poses(self.body, world_from_limb))

    def set_background(self, source: str, images: Sequence[npt.NDArray[np.uint8]]) -> None:
        """Set images of the empty scene, as observed by the color camera `source` (`Frame.add_color`).

        Each pixel is compared with its color in the empty scene. This is optional, but helps where clothes and scene have the
        same color. The images are kept after `reset` and `search`.

        Args:
            source: name of the camera.
            images: (height, width, 3) or (height, width) uint8 each, of the size and kind of the camera's images. An
                empty sequence removes earlier images.

        Raises:
            MeasurementError: images of another kind, or of different sizes. The next step rejects images whose size differs
                from its own.
        """
        of_kind("source", source, str, MeasurementError)
        pictures = tuple(images)
        self._core._set_background(source, pictures)
        self._backgrounds[source] = pictures

    def step(self, frame: Frame) -> Estimate:
        """Estimate the pose at the time of the frame. Releases the GIL; a rejected frame leaves the tracker unchanged.

        Without a pose, the tracker searches for a person in the depth images of the frame. If one is found, the estimate is
        that of the body with the person's sizes; else it has the status "searching" and no poses. A tracker that was
        auto-initialized returns to searching when the person has left.

        Raises:
            MeasurementError: time not after the last frame, an invalid measurement, or no pose, `can_search` false and no
                detection.
            BodyError: the frame names a limb or site that is not in the body.
        """
        return self._core.step(of_kind("frame", frame, Frame, MeasurementError))

    def region_lines(self, source: str) -> RegionLines:
        """The search lines of the last step in the image of the color camera `source`; none if it had no image."""
        rows = self._core._region_lines(source).reshape(-1, 7)
        return RegionLines(rows[:, 0].astype(np.int64), rows[:, 1:3], rows[:, 3:5], rows[:, 5], rows[:, 6])

    def segment(
        self, frame: Frame, *, world_from_limb: Mapping[str, npt.ArrayLike] | None = None
    ) -> dict[str, npt.NDArray[np.float32]]:
        """Segment the body in the color images of a frame, with a pose as the shape prior (R07 section 3.1).

        Uses the colors learned in steps or by `learn_colors`; for a new camera they are first learned at this pose. Nothing else
        changes.

        Args:
            frame: frame with images; measurements of other kinds are ignored.
            world_from_limb: limb name -> rigid (4, 4); None: the current pose.

        Returns:
            Name of the camera -> (height, width), probability of each pixel to belong to the body, 0 to 1.

        Raises:
            MeasurementError: no pose, or an invalid image.
            BodyError: a limb is missing or unknown.
        """
        return self._core._segment(of_kind("frame", frame, Frame, MeasurementError), self._ordered(world_from_limb))

    def learn_colors(self, frame: Frame, *, world_from_limb: Mapping[str, npt.ArrayLike] | None = None) -> None:
        """Learn the colors of the body and of its surroundings in the images of a frame; `step` does so by itself.

        Args, Raises: as for `segment`.
        """
        self._core._learn_colors(of_kind("frame", frame, Frame, MeasurementError), self._ordered(world_from_limb))

    def _ordered(self, world_from_limb: Mapping[str, npt.ArrayLike] | None) -> list[npt.ArrayLike] | None:
        return None if world_from_limb is None else ordered_poses(self.body, world_from_limb)

    def predict(self, stamp: float) -> dict[str, npt.NDArray[np.float64]]:
        """Site name -> predicted position (3,) [m] at `stamp` [s], before or after the last frame.

        Extrapolates the last estimate with the fraction `Config.prediction` of its motion.

        Raises:
            MeasurementError: no pose yet.
        """
        return _core.expected_sites(self._core, stamp)

    def distance(self, points: npt.NDArray[np.float32] | npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
        """Signed distances (N,) [m] of world points (N, 3) to the posed body, negative inside.

        Raises:
            MeasurementError: no pose yet, wrong shape or dtype, or points that are not finite.
        """
        return self._core.distance(points)

    def limb_distances(self, points: npt.NDArray[np.float32] | npt.NDArray[np.float64]) -> npt.NDArray[np.float32]:
        """Signed distances (limbs, N) [m] of world points (N, 3) to each limb, in the order of `Body.limb_names`.

        Raises:
            MeasurementError: as `distance`.
        """
        return self._core.limb_distances(points)

    def body_before(self, sites: npt.ArrayLike, camera: npt.ArrayLike) -> npt.NDArray[np.float64]:
        """Length (N,) [m] of the body between each of some positions and a camera, to detect self-occluded keypoints, which a
        network only guesses.

        Args:
            sites: (N, 3) in the world, inside the posed body.
            camera: focal point (3,).

        Raises:
            MeasurementError: no pose yet, or another shape.
        """
        places = np.ascontiguousarray(sites, dtype=np.float64).reshape(-1, 3)
        return _core.body_before(self._core, places, np.asarray(camera, dtype=np.float64))

    def scale(self, factor: float) -> None:
        """Scale the whole body by a factor above zero without losing the track.

        Raises:
            BodyError: the factor gives no valid body.
        """
        self._core.scale(number_of("factor", factor))

    def set_shape(self, limb: str, shape: TaperedEllipticCylinder) -> None:
        """Change the dimensions [m] of one limb without losing the track; joints and sites on it move along with its length.

        Raises:
            BodyError: an unknown limb.
        """
        of_kind("limb", limb, str, BodyError)
        of_kind("shape", shape, TaperedEllipticCylinder, BodyError)
        self._core.set_shape(limb, shape)

    def add_limb(
        self,
        name: str,
        *,
        parent: str,
        shape: TaperedEllipticCylinder,
        joint: Joint,
        sites: Mapping[str, Sequence[float]] | None = None,
    ) -> None:
        """Add a limb (a held box) without losing the track; it starts with its joint closed and at rest.

        Args:
            name: its name, new in the body.
            parent: the limb it is joined to.
            shape: its surface.
            joint: where it is joined.
            sites: named points on it: name -> position [m] in the new limb's frame.

        Raises:
            BodyError: a name that is taken, an unknown parent, or numbers that give no valid joint.
        """
        of_kind("name", name, str, BodyError)
        of_kind("parent", parent, str, BodyError)
        of_kind("shape", shape, TaperedEllipticCylinder, BodyError)
        of_kind("joint", joint, Joint, BodyError)
        self._core._add_limb(name, parent, shape, joint.parts(), checked_joints(sites or {}, what="sites"))

    def remove_limb(self, name: str) -> None:
        """Remove a limb and its descendants without losing the track.

        Raises:
            BodyError: an unknown limb, or the root.
        """
        of_kind("name", name, str, BodyError)
        self._core.remove_limb(name)

    def __copy__(self) -> Tracker:
        """Not supported: a copy that shares the state would be stepped along with this tracker."""
        raise TypeError("a tracker cannot be copied: make another with Tracker(tracker.body), and reset_pose")

    def __repr__(self) -> str:
        """Body, limbs and last estimate."""
        return repr(self._core)
