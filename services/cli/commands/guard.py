"""`slopewise guard`: a monitor between command and base."""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec
from pathlib import Path

from slopewise.models.errors import InputError
from slopewise.services.cli.screen import say_ready


def run(config_file: Path, seconds: float | None = None, as_json: bool = False) -> None:
    """Guard until a signal comes, or for so long.

    Raises:
        InputError: settings, or a file named in them, or nobody is where they point.
    """
    if find_spec("zenoh") is None:
        raise InputError("guard", "", "needs zenoh: pip install eclipse-zenoh")
    from slopewise.services.guard.watchdog import serve

    serve(config_file, seconds, partial(say_ready, as_json))
