"""Shell of every page: one HTML file that runs only its own script and loads nothing else."""

from __future__ import annotations

import base64
import hashlib
import json
from collections.abc import Mapping, Sequence
from functools import cache
from importlib import resources
from pathlib import Path
from typing import Any

from slopewise.services.io.files import write_atomic

MAX_ROWS = 50
"""Rows of a table of excluded data on a page; the rest is counted [1]."""


def asset(name: str) -> str:
    folder = resources.files("slopewise.services.report") / "assets"
    return (folder / name).read_text(encoding="utf-8")


def script_json(value: Any) -> str:
    """JSON without the characters that could end its script element; its numbers are finite."""
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def render(
    template: str,
    values: Mapping[str, Any],
    *,
    title: str,
    styles: Sequence[str],
    scripts: Sequence[str] = (),
    data: Any = None,
    extra_style: str = "",
    asks_server: bool = False,
) -> str:
    """Render a template with the styles and scripts of some assets, and the data that they read.

    Values are escaped in the template; the extra style comes before the others; `asks_server`: the
    script may fetch from the server that the page came from.
    """
    server = " 'self'; connect-src 'self'" if asks_server else ""
    script = f'"use strict";\n(() => {{\n{_compact(*map(asset, scripts))}\n}})();\n'
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    text: str = (
        _environment()
        .get_template(template)
        .render(
            values,
            title_of_window=title,
            # Only this very script runs, and nothing is fetched, for any content of a name.
            policy=f"default-src 'none'; img-src data:{server}; style-src 'unsafe-inline'; "
            f"script-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'",
            style=_compact(extra_style, *map(asset, styles)),
            data=script_json(data),
            script=script,
        )
    )
    return text


def _compact(*texts: str) -> str:
    """Texts without indentation, empty lines, and lines of comments."""
    lines = (line.strip() for text in texts for line in text.splitlines())
    return "\n".join(line for line in lines if line and not line.startswith("//"))


def write_page(
    path: Path,
    template: str,
    values: Mapping[str, Any],
    command: str,
    styles: Sequence[str] = ("page.css", "calibration.css"),
    **shell: Any,
) -> None:
    """Render the page of a command, see :func:`render`, and write it all or nothing."""
    title = f"{values['title']} – slopewise {command}"
    page = render(template, values, title=title, styles=styles, **shell)
    write_atomic(path, page.encode("utf-8", "replace"))


@cache
def _environment() -> Any:
    # Imported here: it takes 50 ms, and most commands write no page.
    from jinja2 import Environment, FunctionLoader, StrictUndefined

    return Environment(
        autoescape=True,
        loader=FunctionLoader(asset),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
