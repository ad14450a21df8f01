"""First pose from the keypoints of one camera with its depth, when nobody says where the person is.

    python lab/experiments/keypoints_start.py ../shared/data/rendered/dev_*

Keypoints are the true joints in the depth camera's image with 2 px of noise.
"""

import argparse
from pathlib import Path

import numpy as np

from voodoo.evaluation.evaluate import compare
from voodoo.export.track import Track
from voodoo.measurements import DepthImage, KeypointImage, RecordedFrame
from voodoo.pipeline.run import track
from voodoo.pipeline.start import AUTO, start_tracker
from voodoo.recordings.joined import Around
from voodoo.recordings.keypoint_layouts import layout_of
from voodoo.recordings.loaders import open_recording
from voodoo.sensors.pixels import in_sensor
from voodoo.sensors.settings import FrontEndSettings

LAYOUT, NOISE_PX, CONFIDENCE = "body25b", 2.0, 0.9
USED = ("depth", "keypoints")


class Projected(Around):
    """A recording with its true joints as keypoints of its depth camera."""

    def __iter__(self):
        """The frames."""
        rng, truth = np.random.default_rng(0), self._recording.reference
        for recorded in self._recording:
            depth = next(item for item in recorded.measurements if isinstance(item, DepthImage))
            joints = truth.positions[np.abs(truth.stamps - recorded.stamp).argmin()]
            pixels = depth.camera.project(in_sensor(depth.root_from_sensor, joints))
            rows = np.zeros((25, 3))
            for part in layout_of(LAYOUT).parts:
                if part.site in truth.names and len(part.weights) == 1:
                    pixel = pixels[truth.names.index(part.site)] + rng.normal(0.0, NOISE_PX, 2)
                    rows[next(iter(part.weights))] = (*pixel, CONFIDENCE)
            seen = KeypointImage("keypoints", depth.stamp, (rows,), LAYOUT, depth.camera, depth.root_from_sensor)
            yield RecordedFrame(recorded.stamp, (*recorded.measurements, seen))

    def info(self):
        """The summary of the recording, with the keypoints."""
        return self._info({"keypoints"}, f"{LAYOUT} from the truth")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("recordings", type=Path, nargs="+")
    for path in parser.parse_args().recordings:
        recording = Projected(open_recording(path))
        tracker = start_tracker(recording, init=AUTO, use=USED)
        steps = track(recording, tracker, settings=FrontEndSettings.of(recording, use=USED))
        first = next(((frame, step.estimate) for frame, step in enumerate(steps) if step.estimate.joints), None)
        if first is None:
            print(f"{path.name}: nobody found", flush=True)
            continue
        error = 100 * np.nanmean(compare(recording, Track.of([first[1]])))
        print(f"{path.name}: first pose in frame {first[0]}, {error:.1f} cm off", flush=True)


if __name__ == "__main__":
    main()
