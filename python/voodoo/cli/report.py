"""`voodoo report`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from voodoo.cli.common import print_message
from voodoo.errors import VoodooError


def report_command(
    result: Annotated[Path, typer.Argument(metavar="FILE", help="A .csv or .npz of voodoo track.")],
    out: Annotated[Path, typer.Option(metavar="FILE.html", help="The page.")] = Path("report.html"),
    film: Annotated[
        Path | None, typer.Option(metavar="FILE.mp4", help="The film of voodoo track --overlay, shown in the page.")
    ] = None,
) -> None:
    """Write a result as one web page: the skeleton turning in 3-D with a timeline, status of limbs, joint angles with standard
    deviations, residual, and what was left out.

    The page needs no network, and holds each person of the result.
    Needs pip install 'voodoo-tracker[report]'.

    Example

    voodoo report pose.npz --film look.mp4 --out report.html
    """
    from voodoo.export.people import PeopleTrack
    from voodoo.visualization.image_writer import NOT_SMALL, codec_for_small_films
    from voodoo.visualization.report_page import report_page
    from voodoo.whole import write_whole

    if out.suffix != ".html":
        raise VoodooError(f"{out}: expected a name that ends in .html, found {out.suffix!r}")
    people = PeopleTrack.load(result)
    tracks = {f"person {number}": people.unbroken(number) for number in people.tracks}
    write_whole(out, report_page(result.stem, tracks, film=film))
    typer.echo(f"wrote {out}")
    if film is not None and codec_for_small_films() is None:
        print_message(NOT_SMALL)
