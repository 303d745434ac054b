"""Plays the commands of a page: unchanged, in one folder, with the extras that the page installs.

Changed are only ports, the length of a demonstration, how many processes work for a fleet, and what
`make` installs before it runs.
"""

from __future__ import annotations

import glob
import itertools
import os
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zenoh

from slopewise.services.settings.service_settings import ZenohSettings
from slopewise.services.settings.zenoh_session import zenoh_config
from tests.docs.shown import ROOT, Shown, environment, hidden, sizes
from tests.services.service_process import free_port
from tests.services.warm_process import WarmProcess

STAYS = ("serve", "ros", "guard")
"""Commands that run until they are terminated."""
ASKS = ("replay", "params", "query")
"""Commands that ask a running service."""
DEFAULT_PORT = "7447"


class Player:
    """One folder; commands that keep running are terminated with it."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self._stack = folder, stack
        self.port = free_port()
        self.exports: dict[str, str] = {}
        (folder / "examples").symlink_to(ROOT / "examples")
        shutil.copytree(ROOT / "configs", folder / "configs")
        for file in ("service.toml", "ros.toml", "guard.toml"):
            config = folder / "configs" / file
            config.write_text(config.read_text().replace(DEFAULT_PORT, str(self.port)))

    def play(self, command: Shown) -> None:
        """Run it and store its output in `exports`."""
        program, *arguments = command.arguments
        arguments = [name for pattern in arguments for name in self._expanded(pattern)]
        if program == "make":
            self._make(arguments[0])
        elif program == "pip":
            self._is_installable(command)
        elif program == "python":
            self._example(command, arguments)
        elif arguments[0] in STAYS:
            self._start(command, arguments)
        else:
            self._command(command, arguments)

    def router(self) -> None:
        """Stand-in for `rmw_zenohd` of a robot."""
        here = ZenohSettings(mode="router", listen=(f"tcp/127.0.0.1:{self.port}",))
        self._stack.enter_context(zenoh.open(zenoh_config(here)))

    def _expanded(self, pattern: str) -> list[str]:
        if "*" not in pattern:
            return [pattern]
        matches = sorted(glob.glob(pattern, root_dir=self.folder))
        assert matches, pattern
        return matches

    def _make(self, target: str) -> None:
        done = subprocess.run(
            ["make", "-n", target], cwd=ROOT, capture_output=True, text=True, check=True
        )
        # The target `test` is what runs this: that it exists must do.
        for line in re.findall(r"^\S*/(slopewise .*)$", done.stdout, re.MULTILINE):
            self.play(Shown(line, ""))

    def _is_installable(self, command: Shown) -> None:
        assert re.match(r"pip install ('\.\[[\w,]+\]'|\.)$", command.line), command.line
        assert set(command.extras) <= set(sizes.extras())

    def _example(self, command: Shown, arguments: list[str]) -> None:
        if "mock_navigation" in arguments[0]:
            arguments = [arguments[0], "--seconds", "4", *self._service()]
        done = self._warm(command, [sys.executable, *arguments]).finished(100.0)
        assert done.returncode in (0, 3), command.line + done.stdout + done.stderr
        self.exports[command.line] = done.stdout

    def _start(self, command: Shown, arguments: list[str]) -> None:
        process = self._warm(command, arguments)
        self._stack.callback(_end, process)
        line = process.stdout.readline()
        assert line.startswith("slopewise: "), line + process.stderr.read()
        self.exports[command.line] = line

    def _command(self, command: Shown, arguments: list[str]) -> None:
        if arguments[0] in ASKS:
            arguments = [*arguments, *self._service()]
        if arguments[0] == "fleet":  # any number of workers does the same
            arguments += ["--workers", "0"]
        done = self._warm(command, arguments).finished(300.0)
        assert done.returncode in (0, 3), f"{command.line}: {done.stdout}{done.stderr}"
        assert "pip install" not in done.stderr, done.stderr
        self.exports[command.line] = done.stdout
        for option, name in itertools.pairwise(arguments):
            if option in ("--out", "--report", "--sheet", "--update", "--c"):
                assert (self.folder / name).exists(), name

    def _warm(self, command: Shown, arguments: list[str]) -> WarmProcess:
        outside = environment(self.folder, command.extras)
        return WarmProcess(arguments, outside, folder=self.folder, hidden=hidden(command.extras))

    def _service(self) -> list[str]:
        return ["--connect", f"tcp/127.0.0.1:{self.port}"]


def _end(process: WarmProcess) -> None:
    process.terminate()
    try:
        assert process.wait(20.0) == 0
    finally:
        process.kill()


@contextmanager
def playing(folder: Path) -> Iterator[Player]:
    """A player, and the end of all that it started."""
    with ExitStack() as stack:
        os.makedirs(folder, exist_ok=True)
        yield Player(folder, stack)
