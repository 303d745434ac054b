"""Plays the commands of a page: as they stand, in one folder, with what the page said to install.

Changed are only ports, the length of a demonstration, and what `make` installs before it runs.
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
"""Commands that run until they are told to end."""
ASKS = ("replay", "params", "query")
"""Commands that ask a running service."""
USUAL_PORT = "7447"


class Player:
    """One folder; what runs until it is told to end is ended with it."""

    def __init__(self, folder: Path, stack: ExitStack) -> None:
        self.folder, self._stack = folder, stack
        self.port = free_port()
        self.told: dict[str, str] = {}
        (folder / "examples").symlink_to(ROOT / "examples")
        shutil.copytree(ROOT / "configs", folder / "configs")
        for file in ("service.toml", "ros.toml", "guard.toml"):
            config = folder / "configs" / file
            config.write_text(config.read_text().replace(USUAL_PORT, str(self.port)))

    def play(self, one: Shown) -> None:
        """Run it; what it says is in `told`."""
        program, *words = one.words
        words = [name for word in words for name in self._expanded(word)]
        if program == "make":
            self._make(words[0])
        elif program == "pip":
            self._is_installable(one)
        elif program == "python":
            self._example(one, words)
        elif words[0] in STAYS:
            self._start(one, words)
        else:
            self._command(one, words)

    def router(self) -> None:
        """What `rmw_zenohd` is on a robot."""
        here = ZenohSettings(mode="router", listen=(f"tcp/127.0.0.1:{self.port}",))
        self._stack.enter_context(zenoh.open(zenoh_config(here)))

    def _expanded(self, word: str) -> list[str]:
        if "*" not in word:
            return [word]
        found = sorted(glob.glob(word, root_dir=self.folder))
        assert found, word
        return found

    def _make(self, target: str) -> None:
        done = subprocess.run(
            ["make", "-n", target], cwd=ROOT, capture_output=True, text=True, check=True
        )
        # The target `test` is what runs this: that it exists must do.
        for line in re.findall(r"^\S*/(slopewise .*)$", done.stdout, re.MULTILINE):
            self.play(Shown(line, ""))

    def _is_installable(self, one: Shown) -> None:
        assert re.match(r"pip install ('\.\[[\w,]+\]'|\.)$", one.line), one.line
        assert set(one.extras) <= set(sizes.extras())

    def _example(self, one: Shown, words: list[str]) -> None:
        if "mock_navigation" in words[0]:
            words = [words[0], "--seconds", "4", *self._service()]
        done = self._warm(one, [sys.executable, *words]).finished(100.0)
        assert done.returncode in (0, 3), one.line + done.stdout + done.stderr
        self.told[one.line] = done.stdout

    def _start(self, one: Shown, words: list[str]) -> None:
        process = self._warm(one, words)
        self._stack.callback(_end, process)
        line = process.stdout.readline()
        assert line.startswith("slopewise: "), line + process.stderr.read()
        self.told[one.line] = line

    def _command(self, one: Shown, words: list[str]) -> None:
        if words[0] in ASKS:
            words = [*words, *self._service()]
        if words[:2] == [
            "fleet",
            "plan",
        ]:  # workers are children, which a forked process has none of
            done = subprocess.run(
                [sys.executable, "-m", "slopewise", *words],
                cwd=self.folder,
                text=True,
                env=environment(self.folder, one.extras),
                capture_output=True,
                timeout=300,
            )
        else:
            if words[0] == "fleet":  # any number of workers does the same
                words += ["--workers", "0"]
            done = self._warm(one, words).finished(300.0)
        status, out, err = done.returncode, done.stdout, done.stderr
        assert status in (0, 3), f"{one.line}: {out}{err}"
        assert "pip install" not in err, err
        self.told[one.line] = out
        for option, name in itertools.pairwise(words):
            if option in ("--out", "--report", "--sheet", "--update", "--c"):
                assert (self.folder / name).exists(), name

    def _warm(self, one: Shown, words: list[str]) -> WarmProcess:
        outside = environment(self.folder, one.extras)
        return WarmProcess(words, outside, folder=self.folder, hidden=hidden(one.extras))

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
