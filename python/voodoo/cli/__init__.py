"""The command line. Every command is a few calls of the package; nothing is computed here.

Modules are imported when a command runs, so that help and version are fast.
"""

from __future__ import annotations

import io
import sys
from collections.abc import Callable
from contextlib import redirect_stderr, redirect_stdout
from typing import Annotated

import typer

from voodoo.cli.batch import batch_command
from voodoo.cli.demo import demo_command
from voodoo.cli.evaluate import eval_command
from voodoo.cli.ik import ik_command
from voodoo.cli.init import init_command
from voodoo.cli.live import live_command
from voodoo.cli.options import grouped
from voodoo.cli.paths import Checked
from voodoo.cli.recover import recover_command
from voodoo.cli.report import report_command
from voodoo.cli.show import body_command, config_command, info_command
from voodoo.cli.terminal import Escaped
from voodoo.cli.track import track_command

app = typer.Typer(
    name="voodoo",
    no_args_is_help=True,
    rich_markup_mode=None,  # importing Rich takes longer than the rest of the help
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def main() -> None:
    """Entry point of the `voodoo` command."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # file names may contain any bytes
            stream.reconfigure(errors="backslashreplace")
    sys.stdout, sys.stderr = Escaped(sys.stdout), Escaped(sys.stderr)  # also for the help
    app()


def _show_version(expected: bool) -> None:
    if expected:
        # Three times as fast as reading the metadata of the distribution.
        from voodoo._core import __version__

        typer.echo(f"voodoo {__version__}")
        raise typer.Exit


@app.callback()
def voodoo_command(
    context: typer.Context,
    show_version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Follow a person's pose through depth, laser and point cloud recordings, on a plain CPU.

    Try voodoo demo first; then voodoo info RECORDING and
    voodoo track RECORDING --out pose.csv --overlay look.mp4.
    """
    context.with_resource(redirect_stdout(Escaped(sys.stdout)))
    context.with_resource(redirect_stderr(Escaped(sys.stderr)))


_COMMANDS: dict[str, tuple[Callable[..., None], str]] = {
    "track": (track_command, "Track the body through a recording: a row a frame."),
    "live": (live_command, "Track what a camera, ROS 2 or a played recording measures."),
    "demo": (demo_command, "Track the bundled recording and draw what is found."),
    "init": (init_command, "Find the first pose and write it, to edit and give back."),
    "ik": (ik_command, "Find postures from a few known sites and silhouettes."),
    "eval": (eval_command, "Measure the tracker on recordings with a truth."),
    "batch": (batch_command, "Track a thousand recordings, one task each."),
    "report": (report_command, "Write a result as a web page to look at."),
    "recover": (recover_command, "Make the files of commands that were killed."),
    "info": (info_command, "Say what is in a recording."),
    "config": (config_command, "Print the default configuration as commented TOML."),
    "body": (body_command, "Print a body as TOML: the default human, or a file."),
}
for name, (command, words) in _COMMANDS.items():
    app.command(name, cls=Checked, short_help=words)(grouped(command))
