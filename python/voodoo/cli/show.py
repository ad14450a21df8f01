"""`voodoo info`, `voodoo config` and `voodoo body`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from voodoo.cli.common import clear_errors, loader_words, refuse_both
from voodoo.cli.options import (
    FrameOption,
    HeightOption,
    LayoutOption,
    LoaderNumberOption,
    LoaderOption,
    ModelOption,
    RecordingArgument,
    TopicOption,
)


def info_command(
    recording: RecordingArgument,
    topic: TopicOption = None,
    frame: FrameOption = None,
    loader: LoaderOption = None,
    option: LoaderNumberOption = None,
    layout: LayoutOption = None,
) -> None:
    """Print the contents of a recording: sensors, topics, frames, rates, root frame, reference and range of depths."""
    from voodoo.cli.running import opened
    from voodoo.recordings.depth_range import depth_range
    from voodoo.recordings.left_out import LeftOut

    with clear_errors():
        source = opened(recording, loader, frame, left_out=LeftOut(), **loader_words(topic, option, layout=layout))
        typer.echo(str(source.info()))
        depth = depth_range(source)
        if depth is not None:
            typer.echo(f"  depths     {depth}")
            if depth.warning:
                typer.echo(f"  note       {depth.warning}")


def config_command() -> None:
    """Print the default configuration as commented TOML, to edit and pass with --config.

    Example

    voodoo config > fast.toml
    """
    from voodoo.config import Config

    typer.echo(Config().to_toml(), nl=False)


def body_command(
    file: Annotated[Path | None, typer.Argument(metavar="FILE", help="A body file to check and print.")] = None,
    height: HeightOption = None,
    model: ModelOption = None,
) -> None:
    """Print a body as TOML: the default human of a stature, or a file after checking it."""
    from voodoo.model.body import Body

    with clear_errors():
        refuse_both("FILE", file, **{"--height": height, "--model": model})
        if file is not None:
            body = Body.load(file)
        else:
            body = Body.human(1.75 if height is None else height, model=model or "full")
        typer.echo(body.to_toml(), nl=False)
