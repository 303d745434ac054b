"""Jobs on two processes; stored results are not computed again.

The folder of stored results is named by everything that they depend on: the sources of benchmark,
planner and laws, and all else that the benchmark states. A changed source therefore never meets an
old result.
"""

from __future__ import annotations

import hashlib
import multiprocessing
import os
import pickle
import signal
import time
from collections.abc import Callable, Collection, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Future, ProcessPoolExecutor, wait
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, TypeVar

Progress = Callable[[str, int], Callable[[int], Any]]
"""Called with a title and a total; returns the function that advances the bar."""

Work = Callable[[Any], Any]
Result = dict[str, Any]
Item = TypeVar("Item")

_PROCESSES = 2  # of the machines that results are compared on
_ROOT = Path(__file__).resolve().parents[2]

_work: Work | None = None


@dataclass(frozen=True, slots=True)
class BenchmarkRequest:
    """Options of a run."""

    quick: bool = False  # fewer repetitions
    out: Path | None = None  # folder for stored results, or with space for large files
    sets: int | None = None  # maximum number of logs with hidden effects
    minutes: float = float("inf")  # time after which no further log is started [min]


def no_progress(_title: str, _total: int) -> Callable[[int], Any]:
    return lambda _: None


def tracked(progress: Progress, title: str, items: Sequence[Item]) -> Iterator[Item]:
    """Items in their order; the bar advances behind each."""
    advance = progress(title, len(items))
    for item in items:
        yield item
        advance(1)


@dataclass(frozen=True, slots=True)
class ResultCache:
    """Results by job, a file each. Files are unpickled: the folder must be trusted."""

    folder: Path  # created by the first result

    def find(self, job: object) -> Any | None:
        """Return the stored result of a job, None without one."""
        file = self._file(job)
        return pickle.loads(file.read_bytes()) if file.exists() else None

    def put(self, job: object, result: Any) -> None:
        """Store a result atomically."""
        file = self._file(job)
        file.parent.mkdir(parents=True, exist_ok=True)
        partial = file.with_suffix(f".{os.getpid()}")
        partial.write_bytes(pickle.dumps(result))
        partial.replace(file)

    def _file(self, job: object) -> Path:
        return self.folder / f"{hashlib.sha256(repr(job).encode()).hexdigest()[:16]}.pkl"


def run_jobs(
    work: Work,
    jobs: Sequence[Any],
    progress: Progress,
    title: str,
    stored: ResultCache | None = None,
    until: float = float("inf"),
) -> list[Any]:
    """Results of distinct jobs, in their order; without those not started in time.

    Processes are forked: models hold views that cannot be sent. After a time of the monotonic clock
    [s] no further job is started.
    """
    advance = progress(title, len(jobs))
    known = [None if stored is None else stored.find(job) for job in jobs]
    results = {n: result for n, result in enumerate(known) if result is not None}
    advance(len(results))
    missing = iter([n for n in range(len(jobs)) if n not in results])
    context = multiprocessing.get_context("fork")
    with ProcessPoolExecutor(_PROCESSES, context, _prepare, (work,)) as pool:
        running: dict[Future[Any], int] = {}
        while True:
            while len(running) < _PROCESSES and time.monotonic() < until:
                n = next(missing, None)
                if n is None:
                    break
                running[pool.submit(_run, jobs[n])] = n
            if not running:
                return [results[n] for n in sorted(results)]
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                n = running.pop(future)
                results[n] = future.result()
                if stored is not None:
                    stored.put(jobs[n], results[n])
                advance(1)


def _prepare(work: Work) -> None:
    """Inherit the work, use one thread, and leave interruptions to the parent."""
    global _work
    _work = work
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def _run(job: Any) -> Any:
    assert _work is not None
    return _work(job)


@cache
def digest_of_sources(parts: Sequence[str], ignored: Collection[str], *origins: str) -> str:
    """Digest of folders and files of benchmarks (``benchmarks/…``) and packages, and of origins.

    Files that only present results are ignored; origins are dependencies that are no sources.
    """
    from slopewise import models

    digest = hashlib.sha256(repr(origins).encode())
    packages = Path(models.__file__).resolve().parents[1]
    for part in parts:
        place = (_ROOT if part.startswith("benchmarks/") else packages) / part
        for file in sorted(place.rglob("*.py")) if place.is_dir() else [place]:
            if file.name not in ignored:
                digest.update(f"{part}/{file.relative_to(place)}".encode() + file.read_bytes())
    return digest.hexdigest()[:16]
