"""Jobs on two processes; what was kept of an earlier run is not done again."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from typing import Any, Literal, TypeVar

from .kept import KeptPickles

Progress = Callable[[str, int], Callable[[int], Any]]
"""Called with a name and a total, gives what advances the bar."""

_PROCESSES = 2

Work = Callable[[int], Any]
Job = TypeVar("Job")

_work: Work | None = None
_keep: KeptPickles | None = None


def finished(
    do: Callable[[Job], Any],
    jobs: Iterable[Job],
    start: Literal["fork", "spawn"],
    prepare: Callable[..., None],
    *given: Any,
    until: float = float("inf"),
) -> Iterator[tuple[Job, Any]]:
    """Jobs with their results, as they end.

    Args:
        do: gives the result of a job. jobs: begun in their order.
        start: of the processes: forked ones inherit what cannot be sent.
        prepare: called with ``given`` in each process.
        until: time of the monotonic clock after which no further job is begun [s].
    """
    rest = iter(jobs)
    context = multiprocessing.get_context(start)
    with ProcessPoolExecutor(_PROCESSES, context, prepare, given) as pool:
        running: dict[Any, Job] = {}
        while True:
            while len(running) < _PROCESSES and time.monotonic() < until:
                try:
                    job = next(rest)
                except StopIteration:
                    break
                running[pool.submit(do, job)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future.result()


def do_all(
    work: Work, numbers: Iterable[int], progress: Progress, what: str, keep: KeptPickles | None
) -> list[Any]:
    """Results of jobs by number, in their order.

    Processes inherit the work: models hold views that cannot be sent.

    Args:
        work: gives the result of a job. numbers: of the jobs.
        progress: see :data:`Progress`. what: its name there.
        keep: results found in it are taken from there, all others put into it; None for neither.
    """
    wanted = list(numbers)
    advance = progress(what, len(wanted))
    found = {n: keep.find(n) for n in wanted} if keep is not None else {}
    done = {n: result for n, result in found.items() if result is not None}
    advance(len(done))
    missing = [n for n in wanted if n not in done]
    for number, result in finished(_do, missing, "fork", _inherit, work, keep):
        done[number] = result
        advance(1)
    return [done[n] for n in wanted]


def _inherit(work: Work, keep: KeptPickles | None) -> None:
    global _work, _keep
    _work, _keep = work, keep


def _do(number: int) -> Any:
    assert _work is not None
    result = _work(number)
    if _keep is not None:
        _keep.put(number, result)
    return result
