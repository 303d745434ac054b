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

MEMORY = "1GiB"
"""Of a local worker; one that needs more is ended and started again."""

_AHEAD = 2  # tasks waiting beside each one that runs
_PATIENCE = 20.0  # [s] for a scheduler to answer

Task = tuple[str, T]
"""A name of its own, and what to work on."""


@dataclass(frozen=True, slots=True)
class Workers:
    """Who works.

    Attributes:
        count: of local processes; 0 is this one, None one for each processor.
        scheduler: address of a running Dask scheduler, empty for a local cluster.
    """

    count: int | None = None
    scheduler: str = ""


def check_installed() -> None:
    """Raise InputError unless the extra is installed."""
    for module in ("distributed", "pyarrow", "threadpoolctl"):
        if find_spec(module) is None:
            raise InputError("fleet", "", f"needs {module}: pip install '.[fleet]' in a clone")


def each_done(
    function: Callable[[T], R],
    tasks: Iterable[Task[T]],
    workers: Workers,
    given_up: Callable[[T], R] | None = None,
) -> Iterator[R]:
    """Results in the order in which they are done.

    Args:
        function: of one task; importable, it runs in other processes.
        tasks: drawn as workers become free.
        workers: who works.
        given_up: result of a task that several workers died of; such a task is the end of all if
            left out.

    Raises:
        InputError: no scheduler answers; and whatever the function raises.
    """
    if workers.count == 0 and not workers.scheduler:
        for _, task in tasks:
            yield on_one_thread(function, task)
        return
    with _client(workers) as client:
        yield from _spread(client, function, iter(tasks), given_up)


def on_one_thread(function: Callable[[T], R], task: T) -> R:
    """The same sums in the same order, whoever does them.

    Linear algebra that several threads share adds up in another order, and its last digits differ.
    """
    from threadpoolctl import threadpool_limits

    with threadpool_limits(limits=1):
        return function(task)


def _spread(
    client: Any,
    function: Callable[[T], R],
    tasks: Iterator[Task[T]],
    given_up: Callable[[T], R] | None,
) -> Iterator[R]:
    from distributed import KilledWorker, as_completed

    threads = max(sum(client.nthreads().values()), 1)
    out: dict[str, T] = {}

    def handed_out(some: int) -> list[Any]:
        fresh = {f"{function.__name__}-{name}": task for name, task in islice(tasks, some)}
        out.update(fresh)
        return [
            client.submit(on_one_thread, function, task, key=k, pure=False)
            for k, task in fresh.items()
        ]

    suspects: dict[str, T] = {}
    running = as_completed(handed_out((1 + _AHEAD) * threads))
    for future in running:
        task = out.pop(future.key)
        done = []
        try:
            done.append(future.result())
        except KilledWorker:
            suspects[future.key] = task
        future.release()
        for fresh in handed_out(1):
            running.add(fresh)
        yield from done
    # Tasks that waited on a worker are held for guilty with the one that it died of. Alone, each
    # answers for itself.
    for key, task in suspects.items():
        future = client.submit(on_one_thread, function, task, key=f"{key}-alone", pure=False)
        try:
            result = future.result()
        except KilledWorker:
            if given_up is None:
                raise
            result = given_up(task)
        future.release()
        yield result


@contextmanager
def _client(workers: Workers) -> Iterator[Any]:
    from distributed import Client, LocalCluster
    from distributed.comm.addressing import get_address_host_port

    for name in ("distributed", "bokeh", "tornado"):  # a worker that dies is no news for the user
        logging.getLogger(name).setLevel(logging.CRITICAL)
    if workers.scheduler:
        try:
            # A client that never got there hangs in its finaliser when it is collected.
            place = get_address_host_port(workers.scheduler)
            socket.create_connection(place, timeout=_PATIENCE).close()
            client = Client(workers.scheduler, timeout=_PATIENCE)
        except (OSError, ValueError, TypeError) as error:
            words = f"expected a Dask scheduler that answers, got {reason(error)}"
            raise InputError("--scheduler", workers.scheduler, words) from None
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
