"""What people see of a command while it runs. Results go to standard output."""

from __future__ import annotations

import json

from slopewise.services.planning.progress import progress_bar as progress_bar


def say_ready(as_json: bool, words: str, facts: dict[str, object]) -> None:
    """The line of a command that runs until a signal: who waits for it reads standard output."""
    print(json.dumps({"ready": True, **facts}) if as_json else f"slopewise: {words}", flush=True)
