"""Commands that run until a signal: `slopewise serve`, `ros` and `guard`."""

from __future__ import annotations

import contextlib
import signal
from functools import partial
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated

from slopewise.models.errors import InputError
from slopewise.services.cli import options
from slopewise.services.cli.command import print_ready
from slopewise.services.cli.options import option

_PACKAGES = {"zenoh": "eclipse-zenoh", "rosbags": "'.[ros]' in a clone"}  # by module


def serve(
    config: Annotated[Path, option("The service's settings.", "service.toml", "--config", "-c")],
    as_json: options.JsonLine = False,
) -> None:
    """Reply to plan requests over zenoh until a signal asks to stop.

    [bold]Example[/]  slopewise serve --config configs/service.toml
    """
    from slopewise.services.settings.service_settings import read_config

    _require("serve", "zenoh")
    settings = read_config(config)
    if settings.page.enabled and not all(map(find_spec, ("waitress", "prometheus_client"))):
        expected = "expected what serves the page: pip install '.[service]' in a clone"
        raise InputError(str(config), "page.enabled", expected)
    from slopewise.services.daemon.daemon import serve as run_service

    run_service(settings, None, partial(print_ready, as_json))


def ros(
    config: Annotated[Path, option("The edge's settings.", "ros.toml", "--config", "-c")],
    as_json: options.JsonLine = False,
) -> None:
    """Give a robot with ROS 2 speed limits: paths, maps and odometry in, limits out.

    Uses the keys of rmw_zenoh, without ROS, and requests plans from a running `slopewise serve`.

    [bold]Example[/]  slopewise ros --config configs/ros.toml
    """
    _require("ros", "zenoh", "rosbags")
    import zenoh

    from slopewise.services.ros.edge import RosEdge
    from slopewise.services.ros.settings import read_settings
    from slopewise.services.settings.service_settings import ZenohSettings
    from slopewise.services.settings.zenoh_session import zenoh_config

    settings = read_settings(config)
    peers = {"ros": (settings.ros.connect, settings.ros.config)}
    if settings.service.connect:
        peers["service"] = ((settings.service.connect,), settings.service.config)
    with contextlib.ExitStack() as stack:
        sessions = []
        for table, (connect, zenoh_file) in peers.items():
            client = ZenohSettings(mode="client", connect=connect, config=zenoh_file)
            try:
                sessions.append(stack.enter_context(zenoh.open(zenoh_config(client))))
            except zenoh.ZError:
                expected = f"expected a router or service at {', '.join(connect)}, got none"
                raise InputError(str(config), f"{table}.connect", expected) from None
        edge = stack.enter_context(RosEdge(settings, sessions[0], sessions[-1]))
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: edge.stop())
        paths, endpoints = settings.topics.paths, settings.ros.connect
        message = f"{', '.join(paths)} of ROS 2 at {', '.join(endpoints)}"
        print_ready(as_json, message, {"paths": [*paths], "connects": [*endpoints]})
        edge.wait(None)


def guard(
    config: Annotated[Path, option("The guard's settings.", "guard.toml", "--config", "-c")],
    as_json: options.JsonLine = False,
) -> None:
    """Monitor velocity commands: pass, limit or stop each so that the vehicle can always stop.

    Needs no planner, and integrates stopping distances independently of it; two processes watch
    each other, and a message that is late is a stop.

    [bold]Example[/]  slopewise guard --config configs/guard.toml
    """
    _require("guard", "zenoh")
    from slopewise.services.guard.watchdog import serve as run_guard

    run_guard(config, partial(print_ready, as_json))


def _require(command: str, *modules: str) -> None:
    """Raise InputError for a module that is not installed, with what installs it."""
    for module in modules:
        if find_spec(module) is None:
            raise InputError(command, "", f"needs {module}: pip install {_PACKAGES[module]}")
