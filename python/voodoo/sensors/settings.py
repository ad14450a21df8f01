"""Settings of the inputs: which are used, and with what weights."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from voodoo.errors import MeasurementError
from voodoo.measurements import MARKER_SIGMA_M, ByteImage, DepthImage, FloatArray
from voodoo.model.joint import corners
from voodoo.names import INPUTS
from voodoo.recordings.recording import Recording
from voodoo.sensors.depth import DepthFilter
from voodoo.sensors.keypoints.sites import MIN_CONFIDENCE, check_confidence
from voodoo.sensors.model import PLANAR_LASER, POINTS_SHARING, PixelNoise, RangeNoise, SensorModel
from voodoo.sensors.skin.settings import SkinSettings

KNOWN: dict[str, str] = {kind: "color" if kind == "skin" else kind for kind in INPUTS}
"""Kind of input -> kind of its sensors in recordings (see `SensorInfo`): INPUTS first, then others in the order in which their
adapters were registered."""
Box: TypeAlias = tuple[tuple[float, float, float], tuple[float, float, float]]
"""Two opposite corners [m], the lower one first."""
Corner: TypeAlias = tuple[float, float, float] | FloatArray
LEVEL_FRAMES = ("base_link", "base_footprint", "odom", "map")
"""Root frames whose z = 0 is the floor (REP-105)."""
WHOLE_BODY = ("depth", "points", "keypoints", "markers")
"""Inputs that determine the whole body's pose; beside them color regions are used only on request."""


def default_inputs() -> tuple[str, ...]:
    """Returns the default inputs: all but the two cues of color images."""
    return tuple(kind for kind in KNOWN if kind not in ("color", "skin"))


@dataclass(frozen=True)
class FrontEndSettings:
    """Which inputs are used, and with what weights.

    Args:
        use: kinds of inputs, by default all but "color" and "skin"; measurements of other kinds are ignored.
        model: converts standard deviations to weights.
        depth_noise: of depth images and point clouds; the weight is that at the predicted range of the body. None:
            every point has weight 1, as in the papers (a time-of-flight point at 3 m).
        scan_noise: of laser scans; None: every return has weight 1.
        sharing: number of neighboring depth pixels that share one error.
        scan_sharing: number of neighboring returns of a scan that share one error; its beams lie farther apart.
        keypoint_noise: of 2-D keypoints.
        min_confidence: keypoints with a lower confidence are not used.
        marker_sigma: standard deviation [m] of a marker that is given without one.
        depth_filter: removes pixels from depth images; None uses the images unchanged.
        skin: settings of the skin-color cue.
        exclude: boxes (low, high), two corners [m] in the root frame, that contain no person: points in them are not used.
        empty_scene: sensor -> images (H, W, 3) of the scene without people, for color regions.
        draw_regions: overlays show the body's color regions and the edges detected along its contour.
        ground_z: height [m] of the floor in a root frame whose z points up; None: not known.

    Raises:
        MeasurementError: an unknown kind, no finite least confidence, or a box without corners or without inside.
    """

    use: tuple[str, ...] = field(default_factory=default_inputs)
    model: SensorModel = field(default_factory=SensorModel)
    depth_noise: RangeNoise | None = None
    scan_noise: RangeNoise | None = PLANAR_LASER
    sharing: float = POINTS_SHARING
    scan_sharing: float = 4.0
    keypoint_noise: PixelNoise = field(default_factory=PixelNoise)
    min_confidence: float = MIN_CONFIDENCE
    marker_sigma: float = MARKER_SIGMA_M
    depth_filter: DepthFilter | None = None
    skin: SkinSettings = field(default_factory=SkinSettings)
    exclude: tuple[Box, ...] = ()
    empty_scene: Mapping[str, Sequence[ByteImage]] = field(default_factory=dict)
    draw_regions: bool = False
    ground_z: float | None = None

    def __post_init__(self) -> None:
        """Check the kinds, the boxes, and the confidence, which would accept every keypoint if it were NaN."""
        check_confidence(self.min_confidence)
        for box in self.exclude:
            corners("exclude", box, MeasurementError)
        unknown = sorted(set(self.use) - set(KNOWN))
        if unknown or not self.use:
            raise MeasurementError(f"use: expected some of {', '.join(KNOWN)}, found {', '.join(unknown) or 'none'}")

    @property
    def clothes(self) -> bool:
        """Whether colors of clothes tell several persons apart: by default, and if a cue of color images is used."""
        return self.use == default_inputs() or not {"color", "skin"}.isdisjoint(self.use)

    def filtered(self, depth: DepthImage) -> DepthImage:
        """A depth image without the pixels that `depth_filter` removes."""
        if self.depth_filter is None:
            return depth
        return replace(depth, image=self.depth_filter.apply(depth.image, meters_per_unit=depth.meters_per_unit))

    @classmethod
    def of(cls, recording: Recording, *, use: Sequence[str] | None = None) -> FrontEndSettings:
        """Returns the defaults for a recording, with the inputs in `use`.

        Without `use` all inputs are used, with exceptions: color regions are used only if no input determines the whole body's
        pose (see WHOLE_BODY), and skin never. The floor is known if the root frame is one of LEVEL_FRAMES.

        Raises:
            MeasurementError: an unknown kind, or kinds of which the recording has none.
        """
        has = inputs_in(recording)
        settings = cls(use=inputs_for(recording) if use is None else tuple(use))
        if has and not has & set(settings.use):
            raise MeasurementError(
                f"use: expected some of what {recording.name} has ({', '.join(sorted(has))}), found {', '.join(settings.use)}"
            )
        scene = recording.empty_scene() if "color" in settings.use else {}
        skin = replace(settings.skin, each=use is not None and "skin" in settings.use)
        return replace(
            settings, skin=skin, empty_scene=scene, ground_z=0.0 if recording.root_frame in LEVEL_FRAMES else None
        )


def inputs_in(recording: Recording) -> set[str]:
    """The inputs that the sensors of a recording provide."""
    recorded = {sensor.kind for sensor in recording.info().sensors}
    return {kind for kind, name in KNOWN.items() if name in recorded}


def inputs_for(recording: Recording) -> tuple[str, ...]:
    """Returns the default inputs for tracking a recording, see `FrontEndSettings.of`."""
    has = inputs_in(recording)
    if has & set(WHOLE_BODY) or "color" not in has:
        return default_inputs()
    return tuple(kind for kind in KNOWN if kind != "skin")


def within_boxes(places: FloatArray, boxes: Sequence[tuple[Corner, Corner]]) -> npt.NDArray[np.bool_]:
    """Which positions (N, 3) [m] lie in one of the boxes."""
    inside = np.zeros(len(places), dtype=bool)
    for low, high in boxes:
        x, y, z = ((places[:, axis] >= low[axis]) & (places[:, axis] <= high[axis]) for axis in range(3))
        inside |= x & y & z
    return inside
