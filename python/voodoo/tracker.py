"""The tracker as Python holds it: names, defaults and validation around the compiled core."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

import voodoo._core as _core
from voodoo._core import Estimate, Frame, TaperedEllipticCylinder
from voodoo.config import Config
from voodoo.detectors.base import AnyDetector
from voodoo.errors import BodyError, ConfigError, MeasurementError
from voodoo.model.body import Body, Joint, checked_joints, ordered_poses
from voodoo.model.joint import number_of


class RegionLines(NamedTuple):
    """Lines across the contours of limbs in one picture, and where their colors end; pixels.

    Args:
        limbs: (N,) index in `Body.limb_names`.
        places: (N, 2) where the contour of the posed body is seen.
        normals: (N, 2) unit vectors outward.
        offsets: (N,) how far outward the edge of the colors lies.
        sigmas: (N,) its standard deviation; infinite where the colors tell nothing.
    """

    limbs: npt.NDArray[np.int64]
    places: npt.NDArray[np.float32]
    normals: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.float32]
    sigmas: npt.NDArray[np.float32]


class Tracker:
    """Follows one body through frames.

    A tracker belongs to one thread at a time: while one steps, any other call to it raises RuntimeError. Different trackers
    run side by side, since `step` releases the GIL. One with several threads of its own (`Config.threads`) is made in the
    process that steps it: its threads do not survive a fork, and a step after one would wait for them for ever.

    Args:
        body: what to track, in its initial sizes.
        config: parameters; the defaults are the measured ones.
        detector: finds the body in depth images: without a pose, when it is lost, and when it is elsewhere than it is tracked.
            "shipped" is the one that comes with the package and knows people, None is none; see `voodoo.detectors` for others.
    """

    def __init__(self, body: Body, *, config: Config | None = None, detector: AnyDetector = "shipped") -> None:
        """Make a tracker without a pose: `step` looks for somebody, `reset` puts the body where it is known to be.

        Raises:
            BodyError: `body` is not a Body.
            ConfigError: `config` is not a Config, or `detector` no detector.
        """
        if not isinstance(body, Body):
            raise BodyError(f"body: expected a voodoo.Body, found {type(body).__name__}")
        if config is not None and not isinstance(config, Config):
            raise ConfigError(f"config: expected a voodoo.Config, found {type(config).__name__}")
        self.config = Config() if config is None else config
        self.detector = detector
        self._initial = body
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
        """Whether `step` looks for the body while there is no pose: there is a detector that knows it."""
        return self._core.can_search

    @property
    def detector_failures(self) -> int:
        """Steps since the last `search` in which the detector failed; each of them warned (`voodoo.DetectorWarning`)."""
        return self._core.detector_failures

    def reset(self, *, joints: Mapping[str, Sequence[float]], fit_sizes: bool = True) -> Estimate:
        """Set the pose, and the sizes, from positions of named joints and sites; time may start anew afterwards.

        Args:
            joints: site name -> (x, y, z) [m] in the world frame. Any subset that fixes the pose: at least three
                positions that do not lie on a line. Limbs the positions do not reach keep their rest orientation.
            fit_sizes: also scale the body and stretch its limbs to the distances between the positions. What no body can be
                is corrected: a limb far shorter than its pair, a knee or elbow far along a straight leg or arm, and with
                the first depth image one arm or leg much longer than the other.

        Raises:
            BodyError: an unknown name, or an entry that is not three finite numbers.
            MeasurementError: the positions do not fix the pose, or with `fit_sizes` would make the body more than ten times
                larger or smaller: they are not in meters. The tracker is unchanged.
        """
        return self._core._reset(checked_joints(joints), fit_sizes=fit_sizes)

    def search(self) -> None:
        """Give up the pose and what was learned with it: from the next step on somebody is looked for, as in a new tracker."""
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
        """Show the scene without anybody in it, as the color camera `source` sees it (`Frame.add_color`).

        What a pixel shows then is compared with what it shows now; not needed, but it helps where clothes and scene have
        one color. It stays over `reset` and `search`.

        Args:
            source: name of the camera.
            images: (height, width, 3) or (height, width) uint8 each, of the size and kind of the camera's pictures; none:
                what was shown before is forgotten.

        Raises:
            MeasurementError: pictures of another kind, or of different sizes. The next step refuses those of another size
                than its own.
        """
        if not isinstance(source, str):
            raise MeasurementError(f"source: expected a name, found {type(source).__name__}")
        pictures = tuple(images)
        self._core._set_background(source, pictures)
        self._backgrounds[source] = pictures

    def step(self, frame: Frame) -> Estimate:
        """The pose at the frame's time. Releases the GIL; a refused frame leaves the tracker as it was.

        Without a pose a person is looked for in the frame's depth images. Where one is found the estimate is that of the body
        in their sizes, else it has the status "searching" and no poses. A tracker that found the person itself goes back to
        searching when they are gone for good.

        Raises:
            MeasurementError: time not after the last frame, a measurement that cannot be used, or no pose yet of a body that
                is not looked for: `can_search` says so.
            BodyError: the frame names a limb or site that is not in the body.
        """
        return self._core.step(_frame(frame))

    def region_lines(self, source: str) -> RegionLines:
        """The lines of the last step in the picture of the color camera `source`; none where it gave no picture."""
        rows = self._core._region_lines(source).reshape(-1, 7)
        return RegionLines(rows[:, 0].astype(np.int64), rows[:, 1:3], rows[:, 3:5], rows[:, 5], rows[:, 6])

    def segment(
        self, frame: Frame, *, world_from_limb: Mapping[str, npt.ArrayLike] | None = None
    ) -> dict[str, npt.NDArray[np.float32]]:
        """Which pixels of a frame's color pictures are the body, with a pose as the shape prior (R07 section 3.1).

        Colors are those that were learned in steps, or by `learn_colors`; a camera that is new learns them at this pose first.
        Nothing else changes.

        Args:
            frame: with pictures; measurements of other kinds are not looked at.
            world_from_limb: limb name -> rigid (4, 4); None: the pose of now.

        Returns:
            Name of the camera -> (height, width), how likely each pixel shows the body, 0 to 1.

        Raises:
            MeasurementError: no pose, or a picture that cannot be used.
            BodyError: a limb is missing or unknown.
        """
        return self._core._segment(_frame(frame), self._ordered(world_from_limb))

    def learn_colors(self, frame: Frame, *, world_from_limb: Mapping[str, npt.ArrayLike] | None = None) -> None:
        """Learn the colors of the body, and of what is around it, in a frame's pictures; steps do so by themselves.

        Args, Raises: as of `segment`.
        """
        self._core._learn_colors(_frame(frame), self._ordered(world_from_limb))

    def _ordered(self, world_from_limb: Mapping[str, npt.ArrayLike] | None) -> list[npt.NDArray[np.float64]] | None:
        return None if world_from_limb is None else ordered_poses(self.body, world_from_limb)

    def predict(self, stamp: float) -> dict[str, npt.NDArray[np.float64]]:
        """Site name -> (3,) where it is expected at `stamp` [s], before or after the last frame [m].

        The last estimate moved on by the share of its motion that is expected to go on, `Config.prediction`.

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
        """Length of body (N,) [m] that lies between each of some places and a camera: a network guesses what the body hides.

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
            BodyError: a factor that leaves no body.
        """
        self._core.scale(number_of("factor", factor))

    def set_shape(self, limb: str, shape: TaperedEllipticCylinder) -> None:
        """Change the dimensions [m] of one limb without losing the track; joints and sites on it move along with its length.

        Raises:
            BodyError: an unknown limb.
        """
        _check_parts(limb=(limb, str), shape=(shape, TaperedEllipticCylinder))
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
            BodyError: a name that is taken, an unknown parent, or numbers that make no joint.
        """
        _check_parts(
            name=(name, str), parent=(parent, str), shape=(shape, TaperedEllipticCylinder), joint=(joint, Joint)
        )
        places = list(checked_joints(sites or {}, what="sites").items())
        self._core._add_limb(name, parent, shape, joint.parts(), places)

    def remove_limb(self, name: str) -> None:
        """Remove a limb, and all that hangs on it, without losing the track.

        Raises:
            BodyError: an unknown limb, or the root.
        """
        _check_parts(name=(name, str))
        self._core.remove_limb(name)

    def __copy__(self) -> Tracker:
        """Refused: a copy that shares the state would be stepped along with this one."""
        raise TypeError("a tracker cannot be copied: make another with Tracker(tracker.body), and reset_pose")

    def __repr__(self) -> str:
        """Body, limbs and last estimate."""
        return repr(self._core)


def _check_parts(**parts: tuple[object, type]) -> None:
    """Refuse arguments of another kind.

    Raises:
        BodyError: it names the argument.
    """
    for name, (value, kind) in parts.items():
        if not isinstance(value, kind):
            expected = "a name" if kind is str else f"a voodoo.{kind.__name__}"
            raise BodyError(f"{name}: expected {expected}, found {type(value).__name__}")


def _frame(frame: object) -> Frame:
    """The frame, if it is one."""
    if not isinstance(frame, Frame):
        raise MeasurementError(f"frame: expected a voodoo.Frame, found {type(frame).__name__}")
    return frame
