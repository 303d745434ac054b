"""TOML files: every mistake of writing is named by its line."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from slopewise.services.io.access import check_file, fault, read_text, reason

_PLACE = re.compile(r" \(at (line \d+, column \d+|end of document)\)$")

_MOST_BYTES = 1_000_000
_MOST_PARTS = 20
_PART = r"""(?:[A-Za-z0-9_-]+|"[^"\n]*"|'[^'\n]*')"""
_DEEP = re.compile(rf"{_PART}(?:[ \t]*\.[ \t]*{_PART}){{{_MOST_PARTS}}}")
"""The reader keeps every part of a dotted key beside all parts before it: memory by the square."""


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a file.

    Raises:
        InputError: names the file, and the line that is not TOML; or it is larger than any
            settings are.
    """
    check_file(path)
    if (size := path.stat().st_size) > _MOST_BYTES:
        raise fault(path, "", f"expected at most {_MOST_BYTES} bytes of TOML, got {size}")
    text = read_text(path)
    if (deep := _DEEP.search(text)) is not None:
        line = text.count("\n", 0, deep.start()) + 1
        raise fault(path, f"line {line}", f"expected keys of at most {_MOST_PARTS} parts")
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        message = str(error)
        place = _PLACE.search(message)
        field, end = (place[1], place.start()) if place else ("", None)
        raise fault(path, field, f"expected TOML, got: {message[:end]}") from None
    except (ValueError, RecursionError) as error:
        raise fault(path, "", f"expected TOML, got: {reason(error)}") from None


def beside(path: Path, data: dict[str, Any], *keys: str, exists: bool = True) -> None:
    """Take files that settings name relative to the settings; changes ``data``.

    Args:
        path: of the settings. data: its tables. keys: dotted keys that name files or folders.
        exists: leave alone what is not there: it may be another kind of name.
    """
    for key in keys:
        table, _, name = key.rpartition(".")
        inside = data.get(table) if table else data
        if not isinstance(inside, dict) or not isinstance(found := inside.get(name), str):
            continue
        if found and (not exists or (path.parent / found).is_file()):
            inside[name] = str(path.parent / found)
