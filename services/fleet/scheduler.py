"""Where tasks run: in this process, on a local Dask cluster, or on a scheduler that is there.

Tasks are handed out a few at a time, so that neither scheduler nor workers hold more than they work
on. A task whose worker dies goes to another one; a task that several workers died of is given up.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.util import find_spec
from itertools import islice
from typing import Any, TypeVar

from slopewise.models.errors import InputError
from slopewise.services.io.files import reason

T = TypeVar("T")
R = TypeVar("R")

MEMORY = "1GiB"  # Of a local worker; one that needs more is ended and started again
_AHEAD = 2  # Tasks queued for each one that runs: a worker never waits for the client
_CONNECT_TIMEOUT = 20.0
"""For a scheduler to answer [s]: longer than a busy one takes on a slow network."""

Task = tuple[str, T]  # Unique name, and the argument of the function


@dataclass(frozen=True, slots=True)
class Workers:
    """Local worker processes, or a running scheduler."""

    count: int | None = None  # of local processes; 0 is this one, None one for each processor
    scheduler: str = ""  # address of a running Dask scheduler, empty for a local cluster


def check_installed() -> None:
    """Raise InputError unless the extra is installed."""
    for module in ("distributed", "pyarrow", "threadpoolctl"):
        if find_spec(module) is None:
            raise InputError("fleet", "", f"needs {module}: pip install '.[fleet]' in a clone")


def each_done(
    function: Callable[[T], R],
    tasks: Iterable[Task[T]],
    workers: Workers,
    failed: Callable[[T], R] | None = None,
) -> Iterator[R]:
    """Results in the order in which they are done.

    Args:
        function: applied to each task; importable, it runs in other processes.
        failed: result of a task that ended several workers; omitted, such a task ends all.
    """
    if workers.count == 0 and not workers.scheduler:
        for _, task in tasks:
            yield on_one_thread(function, task)
        return
    with _client(workers) as client:
        yield from _spread(client, function, iter(tasks), failed)


def on_one_thread(function: Callable[[T], R], task: T) -> R:
    """Run on one thread: the same sums in the same order on every worker.

    Linear algebra that several threads share adds up in another order, and its last digits differ.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        return function(task)


def _spread(
    client: Any,
    function: Callable[[T], R],
    tasks: Iterator[Task[T]],
    failed: Callable[[T], R] | None,
) -> Iterator[R]:
    from distributed import KilledWorker, as_completed

    threads = max(sum(client.nthreads().values()), 1)
    submitted: dict[str, T] = {}

    def submit(count: int) -> list[Any]:
        fresh = {f"{function.__name__}-{name}": task for name, task in islice(tasks, count)}
        submitted.update(fresh)
        return [
            client.submit(on_one_thread, function, task, key=k, pure=False)
            for k, task in fresh.items()
        ]

    suspects: dict[str, T] = {}
    running = as_completed(submit((1 + _AHEAD) * threads))
    for future in running:
        task = submitted.pop(future.key)
        done = []
        try:
            done.append(future.result())
        except KilledWorker:
            suspects[future.key] = task
        future.release()
        for fresh in submit(1):
            running.add(fresh)
        yield from done
    # Tasks queued on a worker count as the cause of its death with the one that ran. Each is run
    # again alone.
    for key, task in suspects.items():
        future = client.submit(on_one_thread, function, task, key=f"{key}-alone", pure=False)
        try:
            result = future.result()
        except KilledWorker:
            if failed is None:
                raise
            result = failed(task)
        future.release()
        yield result


@contextmanager
def _client(workers: Workers) -> Iterator[Any]:
    from distributed import Client, LocalCluster
    from distributed.comm.addressing import get_address_host_port

    for name in ("distributed", "bokeh", "tornado"):  # a worker that dies is handled here
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if workers.scheduler:
        try:
            # A client that never got there hangs in its finaliser when it is collected.
            address = get_address_host_port(workers.scheduler)
            socket.create_connection(address, timeout=_CONNECT_TIMEOUT).close()
            client = Client(workers.scheduler, timeout=_CONNECT_TIMEOUT)
        except (OSError, ValueError, TypeError) as error:
            message = f"expected a Dask scheduler that answers, got {reason(error)}"
            raise InputError("--scheduler", workers.scheduler, message) from None
        with client:
            yield client
        return
    count = workers.count or os.cpu_count() or 1
    with (
        LocalCluster(
            n_workers=count,
            threads_per_worker=1,
            processes=True,
            memory_limit=MEMORY,
            dashboard_address="127.0.0.1:0",
            silence_logs=logging.CRITICAL,
        ) as cluster,
        Client(cluster) as client,
    ):
        yield client
