"""Figures of pages: matplotlib without a screen, SVG inside the page."""

from __future__ import annotations

import base64
import io
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

INK, FIRST, SECOND, THIRD, FAINT = "#1b1d1f", "#0b5c8f", "#d55e00", "#00694f", "#8a9097"
SHORT = "#a82a0c"
"""Colour of a prediction that a stop exceeded."""
COLOURS = (FIRST, SECOND, THIRD, "#76388c", "#8a5300", "#cc79a7", "#3a9bdc", "#585f66")

_STYLE: Any = {
    "font.size": 9.5,
    "axes.edgecolor": FAINT,
    "axes.labelcolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.grid": True,
    "grid.color": "#ebeae5",
    "axes.axisbelow": True,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "svg.fonttype": "path",
    "svg.hashsalt": "slopewise",
}

Drawing = tuple[tuple[float, float], Callable[[Any], None]]
"""Size of a figure [inch], and the function that draws on it."""


@contextmanager
def figure_style() -> Iterator[type[Any]]:
    """Style of all figures; yields matplotlib's Figure."""
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context(_STYLE):
        yield Figure


def draw_figures(**drawings: Drawing) -> dict[str, str]:
    """Draw figures with a constrained layout; returns the data URI of each as SVG."""
    uris = {}
    with figure_style() as make_figure:
        for name, (size, draw) in drawings.items():
            figure = make_figure(size, layout="constrained")
            draw(figure)
            uris[name] = svg_uri(figure)
    return uris


def svg_uri(figure: Any) -> str:
    from matplotlib.backends.backend_svg import FigureCanvasSVG

    buffer = io.BytesIO()
    # `savefig` draws a figure with a layout twice; the layout is applied in either draw.
    FigureCanvasSVG(figure).print_svg(buffer, metadata={"Date": None})
    return "data:image/svg+xml;base64," + base64.b64encode(buffer.getvalue()).decode("ascii")


def pdf_bytes(figure: Any, title: str) -> bytes:
    """A figure as PDF, its text as text."""
    import matplotlib

    buffer = io.BytesIO()
    about = {"Title": title, "Creator": "slopewise", "CreationDate": None}
    with matplotlib.rc_context({"pdf.fonttype": 42}):
        figure.savefig(buffer, format="pdf", metadata=about)
    return buffer.getvalue()
