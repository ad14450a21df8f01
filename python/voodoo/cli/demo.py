"""`voodoo demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from voodoo.cli import options
from voodoo.cli.common import refuse_missing, states
from voodoo.cli.signals import INTERRUPTED
from voodoo.errors import NoPoseError

_SHEET = 0.3
"""Scale of the pictures in the sheet."""


def demo_command(
    out: Annotated[Path, typer.Option(metavar="DIR", help="Folder for result and pictures.")] = Path("voodoo-demo"),
) -> None:
    """Run the main job on the bundled recording, a person who bends, scoops and reaches up.

    No start is given: the person is detected first. Writes pose.csv, overlay.mp4 and sheet.png and compares the pose with the
    recording's exact ground truth.
    """
    import cv2
    import numpy as np

    from voodoo._core import Estimate
    from voodoo.cli.running import opened, run
    from voodoo.evaluation.evaluate import compare
    from voodoo.export.track import Track
    from voodoo.pipeline.run import track
    from voodoo.pipeline.start import AUTO, start_tracker
    from voodoo.recordings.loaders import sample_path
    from voodoo.visualization.image_writer import save_picture
    from voodoo.visualization.overlay import in_rows, legend

    source = opened(sample_path(), options.Reading())
    tracker = start_tracker(source, init=AUTO)
    estimates: list[Estimate] = []
    steps = track(source, tracker)
    how: dict[str, Any] = {"overlay": out / "overlay.mp4", "sheet": 6}
    done = run(source, steps, take=lambda step: estimates.append(step.estimate), **how)
    seconds, sheet, interrupted, _, failures = done
    if interrupted:
        raise typer.Exit(INTERRUPTED)
    result = Track.of(estimates, body=tracker.body)
    result.save(out / "pose.csv")
    refuse_missing(failures, f"wrote {out / 'pose.csv'}")
    whole = in_rows(sheet, columns=3)
    pictures = cv2.resize(whole, None, fx=_SHEET, fy=_SHEET, interpolation=cv2.INTER_AREA)
    save_picture(out / "sheet.png", np.vstack([pictures.astype(np.uint8), legend(pictures.shape[1])]))
    if not result.found.any():
        raise NoPoseError(f"{source.name}: expected somebody, found nobody in {len(result)} frames")
    errors = compare(source, result)
    typer.echo(f"{source.name}: {len(result)} frames, {states(result.status)}")
    typer.echo(f"time of a frame   {1e3 * np.mean(seconds):.2f} ms (mean), {1e3 * np.median(seconds):.2f} ms (median)")
    typer.echo(f"mean joint error  {100 * np.nanmean(errors):.1f} cm against exact truth, twelve joints")
    typer.echo(f"wrote             {out / 'pose.csv'}, {out / 'overlay.mp4'}, {out / 'sheet.png'}")
