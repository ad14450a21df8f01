"""`voodoo info`, `voodoo config` and `voodoo body`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from voodoo.cli import options
from voodoo.cli.common import print_json, print_text, refuse_both


def info_command(
    *,
    recording: options.RecordingArgument,
    reading: options.Reading,
    as_json: options.JsonOption = False,
) -> None:
    """Print the contents of a recording: sensors, topics, frames, rates, root frame and reference, and of the first image of each
    camera size, bits, calibration, field of view and range of depths."""
    from voodoo.cli.running import opened
    from voodoo.pipeline.inspection import inspect
    from voodoo.recordings.first_images import warnings
    from voodoo.recordings.left_out import LeftOut

    left_out = LeftOut()
    source = opened(recording, reading, left_out=left_out)
    about = source.info()
    seen = inspect(source, left_out=left_out, count=True)
    images, depth = seen.first.images, seen.first.depths
    notes = [*seen.doubts, *warnings(about, left_out), seen.first.damage, "" if depth is None else depth.warning]
    if as_json:
        print_json(
            {**vars(about), "camera_root": about.camera_root, "images": images, "depths": depth}
            | {"notes": [*about.notes, *filter(None, notes)]}
        )
        return
    lines = [str(about), *(f"  image      {image}" for image in images)]
    lines += [] if depth is None else [f"  depths     {depth}"]
    print_text("\n".join([*lines, *(f"  note       {note}" for note in notes if note)]))


def config_command() -> None:
    """Print the default configuration as commented TOML, to edit and pass with --config.

    Example

    voodoo config > fast.toml
    """
    from voodoo.config import Config

    typer.echo(Config().to_toml(), nl=False)


def body_command(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="A body file to check and print.")] = None,
    height: options.HeightOption = None,
    model: options.ModelOption = None,
) -> None:
    """Print a body as TOML: the default human of a stature, or a file after checking it."""
    from voodoo.model.body import STATURE_M, Body

    refuse_both("FILE", file, **{"--height": height, "--model": model})
    if file is not None:
        body = Body.load(file)
    else:
        body = Body.human(STATURE_M if height is None else height, model=model or "measured")
    typer.echo(body.to_toml(), nl=False)
