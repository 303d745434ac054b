"""A shell in which `slopewise` and `python` begin with everything imported.

On its path stand two small programs that hand their words to this process, which starts them as
forked ones (:mod:`tests.services.warm_process`) and returns their output and status.
"""

from __future__ import annotations

import json
import os
import socket
import subprocess
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

from tests.services.warm_process import WarmProcess

PROGRAMS: dict[str, list[str]] = {"slopewise": [], "python": [sys.executable]}
_LONGEST = 300.0
_ASKS = """#!{python} -IS
import json, os, socket, sys
with socket.socket(socket.AF_UNIX) as asked:
    asked.connect({address!r})
    words = {begin!r} + sys.argv[1:]
    asked.sendall(json.dumps([words, os.getcwd(), dict(os.environ)]).encode())
    asked.shutdown(socket.SHUT_WR)
    status, out, err = json.loads(b"".join(iter(lambda: asked.recv(1 << 16), b"")))
sys.stdout.write(out)
sys.stderr.write(err)
sys.exit(status)
"""


@contextmanager
def warm_shell(environment: Mapping[str, str], hidden: Sequence[str]) -> Iterator[dict[str, str]]:
    """The environment for a shell, whose programs lack the modules that are hidden."""
    # The path of a socket may have a hundred letters.
    with tempfile.TemporaryDirectory() as folder, socket.socket(socket.AF_UNIX) as server:
        address = os.path.join(folder, "asked")
        for name, begin in PROGRAMS.items():
            program = Path(folder, name)
            program.write_text(_ASKS.format(python=sys.executable, address=address, begin=begin))
            program.chmod(0o755)
        server.bind(address)
        server.listen()
        answering = threading.Thread(target=_answer, args=(server, hidden), daemon=True)
        answering.start()
        try:
            yield dict(environment) | {
                "PATH": os.pathsep.join([folder, environment.get("PATH", "")])
            }
        finally:
            server.shutdown(socket.SHUT_RDWR)
            answering.join(_LONGEST)


def _answer(server: socket.socket, hidden: Sequence[str]) -> None:
    with suppress(OSError):  # the end of the shell
        while True:
            asking, _ = server.accept()
            with asking:
                job = b"".join(iter(lambda: asking.recv(1 << 16), b""))  # noqa: B023
                asking.sendall(json.dumps(_done(json.loads(job), hidden)).encode())


def _done(job: tuple[list[str], str, dict[str, str]], hidden: Sequence[str]) -> list[Any]:
    arguments, folder, environment = job
    process = WarmProcess(arguments, environment, folder=Path(folder), hidden=hidden)
    try:
        done = process.finished(_LONGEST)
    except subprocess.TimeoutExpired:
        process.kill()
        return [1, "", f"{arguments} did not end within {_LONGEST:.0f} s"]
    return [done.returncode, done.stdout, done.stderr]
