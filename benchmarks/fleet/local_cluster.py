"""A Dask scheduler and its workers as processes on this machine."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from ..common.timing import free_port

_LIMIT = "1GiB"  # memory of a worker, below the size of the map
_TIMEOUT = 60.0  # [s] until workers have registered, on a busy machine


@contextmanager
def cluster(count: int) -> Iterator[tuple[str, list[int]]]:
    """Start scheduler and workers as processes; yields its address and the workers' nannies."""
    from distributed import Client

    environment = os.environ | {"OMP_NUM_THREADS": "1", "PYTHONUNBUFFERED": "1"}
    quiet = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "env": environment}
    port = free_port()
    address = f"tcp://127.0.0.1:{port}"
    dask = [sys.executable, "-m", "dask"]
    listen = ["--host", "127.0.0.1", "--port", str(port), "--no-dashboard"]
    processes = [subprocess.Popen([*dask, "scheduler", *listen], **quiet)]  # type: ignore[call-overload]
    try:
        options = ["--nthreads", "1", "--memory-limit", _LIMIT, "--no-dashboard"]
        for _ in range(count):
            command = [*dask, "worker", address, "--host", "127.0.0.1", *options]
            processes.append(subprocess.Popen(command, **quiet))  # type: ignore[call-overload]
        with Client(address, timeout=_TIMEOUT) as client:
            client.wait_for_workers(count, timeout=_TIMEOUT)
        yield address, [process.pid for process in processes[1:]]
    finally:
        for process in reversed(processes):
            process.terminate()
        for process in processes:
            try:
                process.wait(timeout=20.0)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()


def workers_of(nannies: list[int]) -> list[Any]:
    """The largest child process of each nanny, which plans."""
    import psutil

    workers = []
    for pid in nannies:
        try:
            children = psutil.Process(pid).children(recursive=True)
            workers.append(max(children, key=lambda child: child.memory_info().rss))
        except (psutil.NoSuchProcess, ValueError):
            continue
    return workers
