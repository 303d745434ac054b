"""The shell of every page: one HTML file that runs its own script only and loads nothing else."""

from __future__ import annotations

import base64
import hashlib
import html
import json
from collections.abc import Mapping, Sequence
from importlib import resources
from string import Template
from typing import Any


def asset(name: str) -> str:
    """Text of a file that comes with this package."""
    return (resources.files("slopewise.services.report") / "assets" / name).read_text(
        encoding="utf-8"
    )


def escaped(text: object) -> str:
    """Text for HTML, between tags or in a quoted attribute."""
    return html.escape(str(text), quote=True)


def script_json(value: Any) -> str:
    """JSON that may stand inside a script element: no character there can end it.

    Raises:
        ValueError: a number is not finite.
    """
    text = json.dumps(value, allow_nan=False, separators=(",", ":"))
    for character in "<>&":
        text = text.replace(character, f"\\u{ord(character):04x}")
    return text


def fact_list(named: Mapping[str, str]) -> str:
    """Names and what they are, for a description list."""
    return "".join(
        f"<div><dt>{escaped(name)}</dt><dd>{escaped(value)}</dd></div>"
        for name, value in named.items()
    )


def notices(told: Sequence[str]) -> str:
    """What a reader has to know, a paragraph each."""
    return "".join(f'<p class="notice">{escaped(words)}</p>' for words in told)


def number_row(label: str, cells: Sequence[str]) -> str:
    """A row of a table of numbers under its label."""
    columns = "".join(f'<td class="number">{escaped(cell)}</td>' for cell in cells)
    return f'<tr><th scope="row">{escaped(label)}</th>{columns}</tr>'


def page(
    template: str,
    fields: dict[str, str],
    *,
    title: str,
    styles: Sequence[str],
    scripts: Sequence[str],
    data: Any,
    own_style: str = "",
    own_server: bool = False,
) -> str:
    """A whole page.

    Args:
        template: name of the asset that holds the body, with ``$field`` places.
        fields: HTML for the places; not escaped here.
        title: of the window, as text.
        styles, scripts: names of assets, put in one after the other.
        own_style: CSS that stands before that of the assets.
        data: what the script reads, as JSON holds it.
        own_server: the script may ask the server that the page came from.
    """
    own = " 'self'; connect-src 'self'" if own_server else ""
    script = '"use strict";\n(() => {\n' + "\n".join(map(asset, scripts)) + "})();\n"
    digest = base64.b64encode(hashlib.sha256(script.encode()).digest()).decode("ascii")
    body = Template(asset(template)).substitute(fields)
    return Template(asset("page.html")).substitute(
        title=escaped(title),
        # Whatever a name may hold: nothing but this very script runs, and nothing is fetched.
        policy=f"default-src 'none'; img-src data:{own}; style-src 'unsafe-inline'; "
        f"script-src 'sha256-{digest}'; base-uri 'none'; form-action 'none'",
        style="\n".join((own_style, *map(asset, styles))),
        body=body,
        data=script_json(data),
        script=script,
    )
