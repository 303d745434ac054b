"""`slopewise ros` as a child process: settings file in, ready line out, ended by a signal."""

from __future__ import annotations

import json
import shutil
import signal
import subprocess
import tempfile
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TextIO

READY = "slopewise: "
"""What the first line on standard output begins with once the edge is connected."""


class EdgeError(Exception):
    """The edge cannot be started; says why."""


def settings_text(values: Mapping[str, object]) -> str:
    """Parameters such as ``topics.map`` as the TOML file that `slopewise ros` reads."""
    tables: dict[str, list[str]] = {}
    for name, value in values.items():
        table, key = name.split(".", 1)
        tables.setdefault(table, []).append(f"{key} = {_toml(value)}")
    return "\n".join(f"[{table}]\n" + "\n".join(lines) + "\n" for table, lines in tables.items())


def _toml(value: object) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, str):
        return json.dumps(value, ensure_ascii=False)
    if isinstance(value, (list, tuple)):
        return "[" + ", ".join(_toml(item) for item in value) + "]"
    return repr(value)


class Edge:
    """One `slopewise ros`; started and stopped as often as the lifecycle wants."""

    def __init__(
        self, executable: str, values: Mapping[str, object], say: Callable[[str], None]
    ) -> None:
        """Write its settings; each line of its log goes to `say`.

        Raises:
            EdgeError: there is no such program.
        """
        program = shutil.which(executable)
        if program is None:
            raise EdgeError(f"executable: expected a program on PATH, got {executable!r}")
        self._program = program
        self._folder = tempfile.TemporaryDirectory(prefix="slopewise_ros_")
        self.settings = Path(self._folder.name) / "ros.toml"
        self.settings.write_text(settings_text(values), encoding="utf-8")
        self._process: subprocess.Popen[str] | None = None
        self._say = say
        self._last = ""

    def start(self, patience: float) -> str:
        """Start it and wait until it is connected [s]; returns its ready line.

        Raises:
            EdgeError: it ended, or was silent too long; with its last line.
        """
        command = [self._program, "ros", "--config", str(self.settings)]
        process = subprocess.Popen(
            command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )
        self._process, self._last = process, ""
        assert process.stdout is not None
        assert process.stderr is not None
        log = threading.Thread(target=self._listen, args=(process.stderr,), daemon=True)
        log.start()
        # Reading a line cannot be given a time limit; ending the process ends the reading.
        late = threading.Timer(patience, process.kill)
        late.start()
        line = process.stdout.readline().strip()
        late.cancel()
        if line.startswith(READY):
            return line
        self.stop(1.0)
        log.join(1.0)
        raise EdgeError(self._last or f"expected its ready line within {patience:g} s, got none")

    def _listen(self, log: TextIO) -> None:
        with log:
            for line in log:
                self._last = line.strip()
                self._say(self._last)

    def running(self) -> bool:
        """Return True while the process runs."""
        return self._process is not None and self._process.poll() is None

    def stop(self, patience: float) -> bool:
        """Let it send its last stop, and end; kill it after `patience` [s] and return False."""
        process, self._process = self._process, None
        if process is None:
            return True
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        try:
            process.wait(patience)
            return True
        except subprocess.TimeoutExpired:
            process.kill()
            process.wait()
            return False
        finally:
            if process.stdout is not None:
                process.stdout.close()

    def forget(self) -> None:
        """End it if it runs, and remove its settings."""
        self.stop(1.0)
        self._folder.cleanup()
