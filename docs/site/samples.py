"""Sample output on a page, written into it by running the command that stands above it.

    <!-- sample: slopewise plan dem.tif paths.csv --model atv -->
    what it printed
    <!-- end of sample -->

Commands run in one folder that holds what `examples/made_up.py` writes.
`python docs/site/samples.py` writes the samples of README.
"""

from __future__ import annotations

import os
import re
import shlex
import subprocess
import sys
import tempfile
from collections.abc import Callable
from pathlib import Path

ROOT = Path(__file__).parents[2]
PLACE = re.compile(
    r"(?P<begin>^<!-- sample: (?P<command>slopewise .*?) -->\n)(?P<so_far>.*?)"
    r"(?P<end>^<!-- end of sample -->\n)",
    re.DOTALL | re.MULTILINE,
)


def filled(page: str, output_of: Callable[[str], str]) -> str:
    """The page with the output of each command in its place."""

    def put(match: re.Match[str]) -> str:
        lines = [line.rstrip() for line in output_of(match["command"]).splitlines()]
        text = "\n".join(lines).strip("\n")
        return f"{match['begin']}\n```\n{text}\n```\n\n{match['end']}"

    return PLACE.sub(put, page)


def made_up(folder: Path) -> None:
    """Map, paths and log, by the example."""
    sys.path.insert(0, str(ROOT))
    from examples import made_up as example

    example.main(folder)


def output_of(command: str, folder: Path) -> str:
    """Output of a command in a folder, 80 columns wide."""
    argv = [sys.executable, "-m", *shlex.split(command)]
    environment = os.environ | {"PYTHONPATH": str(ROOT), "COLUMNS": "80"}
    done = subprocess.run(
        argv, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return done.stdout


def main() -> None:
    """Write the samples of README."""
    page = ROOT / "README.md"
    with tempfile.TemporaryDirectory() as folder:
        made_up(Path(folder))
        text = filled(page.read_text(), lambda command: output_of(command, Path(folder)))
    page.write_text(text)


if __name__ == "__main__":
    main()
