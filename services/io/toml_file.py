"""TOML files: every mistake of writing is named by its line."""

from __future__ import annotations

import re
import tomllib
from pathlib import Path
from typing import Any

from services.io.access import fault, read_text, reason

_PLACE = re.compile(r" \(at (line \d+, column \d+|end of document)\)$")


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of a file.

    Raises:
        InputError: names the file, and the line that is not TOML.
    """
    text = read_text(path)
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
