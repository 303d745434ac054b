"""`slopewise serve`: the zenoh service."""

from __future__ import annotations

from functools import partial
from importlib.util import find_spec
from pathlib import Path

from slopewise.models.errors import InputError
from slopewise.services.cli.screen import say_ready
from slopewise.services.settings.service_settings import read_config


def run(config_file: Path, seconds: float | None = None, as_json: bool = False) -> None:
    """Serve until a signal comes, or for so long.

    Raises:
        InputError: settings, or a file named in them.
    """
    if find_spec("zenoh") is None:
        raise InputError("serve", "", "needs zenoh: pip install eclipse-zenoh")
    config = read_config(config_file)
    if config.page.enabled and not all(map(find_spec, ("waitress", "prometheus_client"))):
        words = "expected what serves the page: pip install '.[service]' in a clone"
        raise InputError(str(config_file), "page.enabled", words)
    from slopewise.services.daemon.daemon import serve

    serve(config, seconds, partial(say_ready, as_json))
