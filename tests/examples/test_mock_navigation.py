"""The example of a navigation stack, in a process of its own beside a service."""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

from tests.services.service_process import running

EXAMPLE = Path(__file__).parents[3] / "examples" / "mock_navigation.py"


def test_it_drives_what_the_service_says(tmp_path: Path) -> None:
    with running(tmp_path) as started:
        done = subprocess.run(
            [
                sys.executable, str(EXAMPLE), "--connect", started.endpoint, "--namespace",
                started.namespace, "--rate", "5", "--seconds", "4",
            ],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        told = re.search(r"(\d+) questions, (\d+) own stops.* ([\d.]+) m driven", done.stdout)
        assert told is not None, done.stdout
        asked, stops, way = int(told[1]), int(told[2]), float(told[3])
        assert asked >= 10
        assert stops < asked
        assert way > 0.5
