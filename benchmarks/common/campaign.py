"""Jobs on two processes; stored results are not computed again."""

from __future__ import annotations

import multiprocessing
import time
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, ProcessPoolExecutor, wait
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, TypeVar

from .result_cache import PickleCache

Progress = Callable[[str, int], Callable[[int], Any]]
"""Called with a title and a total; returns the function that advances the bar."""


@dataclass(frozen=True, slots=True)
class BenchmarkRequest:
    """Options of a run.

    Attributes:
        quick: fewer repetitions.
        out: folder for results of an interruptible campaign, or with space for large files.
        sets: maximum number of sets of hidden effects.
        minutes: time after which no further set is started [min].
        tuning_share: share of the multi-body car's tuning half, instead of all other sets.
    """

    quick: bool = False
    out: Path | None = None
    sets: int | None = None
    minutes: float = float("inf")
    tuning_share: float = 0.0


def no_progress(_title: str, _total: int) -> Callable[[int], Any]:
    """Report progress nowhere."""
    return lambda _: None


_PROCESSES = 2  # of the machines that results are compared on

Work = Callable[[int], Any]
Job = TypeVar("Job")

_work: Work | None = None
_cache: PickleCache | None = None


def run_jobs(
    work: Callable[[Job], Any],
    jobs: Iterable[Job],
    start: Literal["fork", "spawn"],
    prepare: Callable[..., None],
    *arguments: Any,
    until: float = float("inf"),
) -> Iterator[tuple[Job, Any]]:
    """Yield jobs with their results as they complete.

    Args:
        work: returns the result of a job.
        jobs: started in their order.
        start: start method; forked ones inherit what cannot be sent.
        prepare: called with ``arguments`` in each process.
        until: time of the monotonic clock after which no further job is started [s].
    """
    remaining = iter(jobs)
    context = multiprocessing.get_context(start)
    with ProcessPoolExecutor(_PROCESSES, context, prepare, arguments) as pool:
        running: dict[Any, Job] = {}
        while True:
            while len(running) < _PROCESSES and time.monotonic() < until:
                try:
                    job = next(remaining)
                except StopIteration:
                    break
                running[pool.submit(work, job)] = job
            if not running:
                return
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                yield running.pop(future), future.result()


def run_numbered(
    work: Work, numbers: Iterable[int], progress: Progress, title: str, cache: PickleCache | None
) -> list[Any]:
    """Results of numbered jobs, in their order.

    Processes are forked: models hold views that cannot be sent.

    Args:
        work: returns the result of a job.
        numbers: job numbers.
        progress: see :data:`Progress`.
        title: shown at the bar.
        cache: holds results of earlier runs and receives new ones.
    """
    jobs = list(numbers)
    advance = progress(title, len(jobs))
    stored = {n: cache.find(n) for n in jobs} if cache is not None else {}
    results = {n: result for n, result in stored.items() if result is not None}
    advance(len(results))
    missing = [n for n in jobs if n not in results]
    for number, result in run_jobs(_run, missing, "fork", _inherit, work, cache):
        results[number] = result
        advance(1)
    return [results[n] for n in jobs]


def _inherit(work: Work, cache: PickleCache | None) -> None:
    global _work, _cache
    _work, _cache = work, cache


def _run(number: int) -> Any:
    assert _work is not None
    result = _work(number)
    if _cache is not None:
        _cache.put(number, result)
    return result
