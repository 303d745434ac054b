"""`slopewise ros`: the edge to ROS 2."""

from __future__ import annotations

import contextlib
import signal
from importlib.util import find_spec
from pathlib import Path

from slopewise.models.errors import InputError
from slopewise.services.cli.screen import say_ready


def run(config_file: Path, seconds: float | None = None, as_json: bool = False) -> None:
    """Serve ROS 2 until a signal comes, or for so long.

    Raises:
        InputError: settings, or nobody is where they point.
    """
    for module, extra in (("zenoh", "eclipse-zenoh"), ("rosbags", "'.[ros]' in a clone")):
        if find_spec(module) is None:
            raise InputError("ros", "", f"expected {module}, got none: pip install {extra}")
    import zenoh

    from slopewise.services.ros.edge import RosEdge
    from slopewise.services.ros.settings import read_settings
    from slopewise.services.settings.service_settings import ZenohSettings
    from slopewise.services.settings.zenoh_session import zenoh_config

    settings = read_settings(config_file)
    meets = ZenohSettings(mode="client", connect=settings.ros.connect, config=settings.ros.config)
    with contextlib.ExitStack() as stack:
        sessions = []
        asked = settings.service
        wanted = [(meets, "ros.connect")]
        if asked.connect:
            other = ZenohSettings(mode="client", connect=(asked.connect,), config=asked.config)
            wanted.append((other, "service.connect"))
        for place, key in wanted:
            try:
                sessions.append(stack.enter_context(zenoh.open(zenoh_config(place))))
            except zenoh.ZError:
                words = f"expected a router or service at {', '.join(place.connect)}, got none"
                raise InputError(str(config_file), key, words) from None
        edge = stack.enter_context(RosEdge(settings, sessions[0], sessions[-1]))
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: edge.stop())
        paths, at = settings.topics.paths, settings.ros.connect
        words = f"{', '.join(paths)} of ROS 2 at {', '.join(at)}"
        say_ready(as_json, words, {"paths": [*paths], "connects": [*at]})
        edge.wait(seconds)
