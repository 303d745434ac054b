"""Commands in processes that are forked from one that has imported everything already.

Such a process is a separate one, with its signals, threads and sockets; only the seconds in
which Python imports scipy and zenoh are spent once for all of them. A test about the very start, or
about what an environment brings into it, starts a fresh interpreter instead.
"""

from __future__ import annotations

import contextlib
import io
import multiprocessing
import os
import runpy
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(["tests.services.warm_modules"])

_TAKEN_WHERE_FOUND = (
    "Cython",
    "_cffi_backend",
    "cffi",
    "charset_normalizer",
    "colorama",
    "cython",
    "pycparser",
    "yaml",
)
"""numba, numpy and scipy look for them and do without."""


def hide(modules: Sequence[str]) -> None:
    """Let modules be missing, as where they are not installed."""
    there = {name for name in modules if sys.modules.get(name) is not None}
    if more := sorted(there.difference(_TAKEN_WHERE_FOUND)):
        raise AssertionError(f"imported before the fork, so they cannot be hidden: {more}")
    sys.modules.update(dict.fromkeys(modules))


def _run(
    command: list[str],
    environment: Mapping[str, str],
    place: tuple[str, Sequence[str]],
    out: Connection,
    err: Connection,
) -> None:
    from slopewise.services.cli import app

    for connection, descriptor in ((out, 1), (err, 2)):
        os.dup2(connection.fileno(), descriptor)
        connection.close()
    sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False), write_through=True)
    sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", closefd=False), write_through=True)
    folder, hidden = place
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    hide(hidden)
    if command[0] == sys.executable:
        sys.argv = command[1:]
        sys.path[0:0] = environment.get("PYTHONPATH", "").split(os.pathsep)
        sys.path.insert(0, str(Path(folder, command[1]).parent))
        runpy.run_path(command[1], run_name="__main__")
    else:
        app.main(command)


class WarmProcess:
    """A command line in a separate process, with the part of `subprocess.Popen` that tests use."""

    def __init__(
        self,
        command: list[str],
        environment: Mapping[str, str],
        *,
        folder: Path | None = None,
        hidden: Sequence[str] = (),
    ) -> None:
        """Start it in a folder, without the modules that are hidden.

        Args:
            words: of `slopewise`; or this interpreter, a program's file, and its words.
            environment: all of it. folder: where it runs; here by default.
            hidden: modules that are missing.
        """
        pipes = [_FORKS.Pipe(duplex=False) for _ in range(2)]
        writers = [writer for _, writer in pipes]
        place = (str(folder or Path.cwd()), tuple(hidden))
        arguments = (command, dict(environment), place, *writers)
        self._process = _FORKS.Process(target=_run, args=arguments, daemon=True)
        self._process.start()
        for writer in writers:
            writer.close()
        self.stdout, self.stderr = (
            os.fdopen(os.dup(reader.fileno()), encoding="utf-8") for reader, _ in pipes
        )
        for reader, _ in pipes:
            reader.close()
        assert self._process.pid is not None
        self.pid = self._process.pid

    def poll(self) -> int | None:
        return self._process.exitcode

    def wait(self, timeout: float | None = None) -> int:
        self._process.join(timeout)
        if self._process.exitcode is None:
            raise subprocess.TimeoutExpired("slopewise", timeout or 0.0)
        return self._process.exitcode

    def send_signal(self, number: int) -> None:
        # It may end before the signal arrives.
        with contextlib.suppress(ProcessLookupError):
            if self.poll() is None:
                os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)

    def finished(self, timeout: float) -> subprocess.CompletedProcess[str]:
        """Its output and status, once it has ended."""
        out, err = self.stdout.read(), self.stderr.read()
        return subprocess.CompletedProcess([], self.wait(timeout), out, err)
