"""Who is found in single real depth images, each shown for a second, with `--people any`.

    python lab/experiments/real_images.py D/real

Prints for every recording the most persons of a frame, and how many ids there were.
"""

import argparse
from pathlib import Path

import voodoo
from voodoo.evaluation.search import find_recordings
from voodoo.pipeline.run import track
from voodoo.recordings import open_recording
from voodoo.sensors.settings import FrontEndSettings


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    print("| recording | persons | ids |\n|---|---|---|")
    for path in find_recordings([parser.parse_args().folder]):
        recording = open_recording(path)
        settings = FrontEndSettings.of(recording, use=("depth",))
        found = [
            [person.id for person in step.estimate] for step in track(recording, voodoo.People(), settings=settings)
        ]
        print(f"| {path.name} | {max(map(len, found))} | {len(set().union(*found))} |", flush=True)


if __name__ == "__main__":
    main()
