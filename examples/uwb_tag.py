"""A new sensor in one file: ultra-wideband tags, each telling where a named site of the body is, with its own sigma.

    python examples/uwb_tag.py

A measurement is any frozen dataclass with `sensor` and `stamp`. Its adapter says how it joins the tracker's frame and how it
is drawn; once registered, front end, overlay, viewer and `FrontEndSettings.use` know it like any other.
"""

from dataclasses import dataclass

import numpy as np

import voodoo
from voodoo.measurements import RecordedFrame
from voodoo.pipeline.front_end import FrontEnd, FrontEndSettings
from voodoo.sensors.adapters import Adapter, Canvas, Context, Log, Memory, register

TAGGED = ("head_center", "l_shoulder", "r_shoulder", "l_wrist", "r_wrist", "l_hip", "r_hip", "l_ankle", "r_ankle")
SIGMA_M = 0.05
RATE_HZ = 30.0


@dataclass(frozen=True, eq=False)
class UwbTag:
    """Position (3,) [m] of a site in the root frame, and the standard deviation [m] the tag reports."""

    sensor: str
    stamp: float
    site: str
    position: np.ndarray
    sigma: float


class UwbAdapter(Adapter[UwbTag]):
    kind = "uwb"
    measurement = UwbTag

    def content(self, item: UwbTag) -> np.ndarray:
        return item.position  # a tag that repeats itself to the last bit is broken

    def add(self, frame: voodoo.Frame, item: UwbTag, context: Context) -> None:
        if item.site in context.predicted:
            weight = context.settings.model.weight(item.sigma)
            frame.add_position(item.site, item.position, weight=weight, source=item.sensor)

    def draw(self, item: UwbTag, canvas: Canvas, memory: Memory) -> None:
        canvas.dots(item.position[None], color=(40, 200, 255), radius=5)

    def log(self, item: UwbTag, log: Log, memory: Memory) -> None:
        log.send(f"world/uwb/{log.entity(item.sensor)}", log.rr.Points3D(item.position[None], radii=item.sigma))


def truth(chain: voodoo.ik.Chain, stamp: float) -> tuple[dict[str, np.ndarray], dict[str, np.ndarray]]:
    """True poses of the limbs and positions of the sites of a body whose joints swing."""
    swing = 0.3 * np.sin(0.5 * stamp + np.arange(len(chain.angle_names)))
    return chain.forward(np.clip(swing, *chain.limits.T))


def recorded(chain: voodoo.ik.Chain, frames: int) -> list[tuple[RecordedFrame, dict[str, np.ndarray]]]:
    """Frames of tags with noise on that body, with the true positions of its sites."""
    rng = np.random.default_rng(1)
    found = []
    for index in range(frames):
        stamp = index / RATE_HZ
        _, sites = truth(chain, stamp)
        tags = tuple(
            UwbTag(f"tag_{site}", stamp, site, sites[site] + rng.normal(0.0, SIGMA_M, 3), SIGMA_M) for site in TAGGED
        )
        found.append((RecordedFrame(stamp, tags), sites))
    return found


def main(frames: int = 90) -> float:
    """Track a body by its tags alone; the mean error of the tagged sites [m]."""
    chain = voodoo.ik.Chain(voodoo.Body.human(model="full"))
    poses, _ = truth(chain, 0.0)
    tracker = voodoo.Tracker(chain.body)
    tracker.reset_pose(poses)
    front_end = FrontEnd(tracker, settings=FrontEndSettings(use=("uwb",)))
    errors = []
    for frame, sites in recorded(chain, frames):
        estimate = front_end.step(frame)
        errors += [np.linalg.norm(estimate.joints[site] - sites[site]) for site in TAGGED]
    return float(np.mean(errors))


register(UwbAdapter())

if __name__ == "__main__":
    print(f"tags alone: {100 * main():.1f} cm mean error of {len(TAGGED)} tagged sites, noise {100 * SIGMA_M:.0f} cm")
