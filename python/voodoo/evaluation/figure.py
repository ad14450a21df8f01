"""Creates the figures of an evaluation."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from voodoo.errors import installed
from voodoo.whole import appearing_whole


def new_figure(width: float, height: float) -> Any:  # noqa: ANN401 - of a library that may not be there
    """An empty figure of Matplotlib, which is optional; sizes in inches.

    Raises:
        VoodooError: Matplotlib is not installed; says how to install it.
    """
    missing = "pictures of an evaluation need Matplotlib: pip install 'voodoo-tracker[eval]'"
    figure = installed("matplotlib.figure", missing).Figure(figsize=(width, height), layout="constrained")
    installed("matplotlib.backends.backend_agg", missing).FigureCanvasAgg(figure)
    return figure


def save_figure(figure: Any, path: Path) -> None:  # noqa: ANN401
    """Write a figure, without the frames of its axes on top and on the right."""
    for axes in figure.axes:
        axes.spines[["top", "right"]].set_visible(False)
    with appearing_whole(path) as place:
        figure.savefig(place, dpi=130)
