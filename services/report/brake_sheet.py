"""The brake sheet: one page of what the brakes of a model can do, for whoever files it.

Drawn once; a PDF holds it as text, an HTML page as a picture that prints on one page.
"""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slopewise.services.io.files import fault, write_atomic
from slopewise.services.report.brake_drawing import SIZE, SheetWords, draw
from slopewise.services.report.brake_numbers import BrakeNumbers
from slopewise.services.report.brake_table import shown_distances
from slopewise.services.report.brake_words import danger
from slopewise.services.report.figures import house_style, svg_uri
from slopewise.services.report.page import escaped, page

_ENDS = (".html", ".pdf")


def check_name(path: Path) -> None:
    """Raise InputError for a name that is neither HTML nor PDF."""
    if path.suffix.lower() not in _ENDS:
        words = f"expected a name that ends in .html or .pdf, got {path.suffix or 'no ending'}"
        raise fault(path, "", words)


def write_sheet(path: Path, numbers: BrakeNumbers, facts: Mapping[str, str], trace: str) -> None:
    """Write the sheet of one surface, all or nothing.

    Args:
        path: .html or .pdf.
        numbers: to tell. facts: what the stops say, name -> value.
        trace: lines of what it was made from.

    Raises:
        InputError: another ending, a place that cannot be written to, or no matplotlib.
    """
    check_name(path)
    table, title = shown_distances(numbers), f"Brake sheet of {numbers.model.name}"
    with house_style() as figure:
        drawn = draw(figure(SIZE), numbers, table, SheetWords(title, facts, trace))
        if path.suffix.lower() == ".pdf":
            write_atomic(path, _pdf(drawn, title))
            return
        picture = svg_uri(drawn)
    fields = {"sheet": picture, "words": escaped(f"{title}. {danger(numbers, table)}")}
    text = page(
        "brake_sheet.html",
        fields,
        title=title,
        styles=("page.css", "brake_sheet.css"),
        scripts=(),
        data=None,
    )
    write_atomic(path, text.encode("utf-8", "replace"))


def _pdf(figure: Any, title: str) -> bytes:
    import matplotlib

    buffer = io.BytesIO()
    about = {"Title": title, "Creator": "slopewise", "CreationDate": None}
    with matplotlib.rc_context({"pdf.fonttype": 42}):
        figure.savefig(buffer, format="pdf", metadata=about)
    return buffer.getvalue()
