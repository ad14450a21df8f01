"""Creates the figures of an evaluation."""

from __future__ import annotations

from typing import Any

from voodoo.errors import VoodooError


def new_figure(width: float, height: float) -> Any:  # noqa: ANN401 - of a library that may not be there
    """An empty figure of Matplotlib, which is optional; sizes in inches.

    Raises:
        VoodooError: Matplotlib is not installed; says how to install it.
    """
    try:
        from matplotlib.backends.backend_agg import FigureCanvasAgg
        from matplotlib.figure import Figure
    except ImportError:
        raise VoodooError("pictures of an evaluation need Matplotlib: pip install 'voodoo-tracker[eval]'") from None
    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure
