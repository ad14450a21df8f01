"""Creates the figures of an evaluation."""

from __future__ import annotations

from typing import Any

from voodoo.errors import installed


def new_figure(width: float, height: float) -> Any:  # noqa: ANN401 - of a library that may not be there
    """An empty figure of Matplotlib, which is optional; sizes in inches.

    Raises:
        VoodooError: Matplotlib is not installed; says how to install it.
    """
    missing = "pictures of an evaluation need Matplotlib: pip install 'voodoo-tracker[eval]'"
    figure = installed("matplotlib.figure", missing).Figure(figsize=(width, height), layout="constrained")
    installed("matplotlib.backends.backend_agg", missing).FigureCanvasAgg(figure)
    return figure
