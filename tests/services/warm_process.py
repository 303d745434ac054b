"""Commands in processes that are forked from one that has imported everything already.

Such a process is one of its own, with its own signals, threads and sockets; only the second or two
in which Python imports numba, scipy and zenoh is spent once for all of them. A test about the very
start, or about what an environment brings into it, starts a fresh interpreter instead.
"""

from __future__ import annotations

import io
import multiprocessing
import os
import signal
import subprocess
import sys
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path

_FORKS = multiprocessing.get_context("forkserver")
_FORKS.set_forkserver_preload(
    ["services.daemon.daemon", "services.cli.commands.serve", "services.cli.app"]
)


def _run(
    words: list[str], environment: Mapping[str, str], place: tuple[str, Sequence[str]],
    out: Connection, err: Connection,
) -> None:  # fmt: skip
    from services.cli import app

    folder, hidden = place
    os.chdir(folder)
    os.environ.clear()
    os.environ.update(environment)
    sys.modules.update(dict.fromkeys(hidden))
    for connection, descriptor in ((out, 1), (err, 2)):
        os.dup2(connection.fileno(), descriptor)
        connection.close()
    sys.stdout = io.TextIOWrapper(os.fdopen(1, "wb", closefd=False), write_through=True)
    sys.stderr = io.TextIOWrapper(os.fdopen(2, "wb", closefd=False), write_through=True)
    app.main(words)


class WarmProcess:
    """A command line in a process of its own; what `subprocess.Popen` has of it that tests use."""

    def __init__(
        self, words: list[str], environment: Mapping[str, str], *, folder: Path | None = None,
        hidden: Sequence[str] = (),
    ) -> None:  # fmt: skip
        """Start it in a folder, without the modules that are hidden."""
        pipes = [_FORKS.Pipe(duplex=False) for _ in range(2)]
        writers = [writer for _, writer in pipes]
        place = (str(folder or Path.cwd()), tuple(hidden))
        arguments = (words, dict(environment), place, *writers)
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
        if self.poll() is None:
            os.kill(self.pid, number)

    def terminate(self) -> None:
        self.send_signal(signal.SIGTERM)

    def kill(self) -> None:
        self.send_signal(signal.SIGKILL)
