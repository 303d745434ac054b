"""What a benchmark of time needs of the machine: one core, others at work, a look at memory."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from multiprocessing import get_context, parent_process

import numpy as np

from .measure import peak_memory


def resident_memory() -> float:
    """What this process holds now [bytes]; the most it held where the system tells no more."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return float(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
    except OSError:
        return peak_memory()


@contextmanager
def on_one_core() -> Iterator[int]:
    """Run on the last core only, where the system allows that."""
    if not hasattr(os, "sched_setaffinity"):
        yield 0
        return
    before = os.sched_getaffinity(0)
    own = max(before)
    os.sched_setaffinity(0, {own})
    try:
        yield own
    finally:
        os.sched_setaffinity(0, before)


@contextmanager
def working(cores: list[set[int]]) -> Iterator[None]:
    """As many processes as sets of cores, each at work on one of its set."""
    context = get_context("spawn")
    processes = [context.Process(target=_work, args=(own,), daemon=True) for own in cores]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _work(cores: set[int]) -> None:
    """Sort numbers while the benchmark lives: busy with processor, caches and memory."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores)
    numbers = np.random.default_rng(0).random(500_000)
    # A benchmark that is killed does not end its processes.
    benchmark = parent_process()
    while benchmark is not None and benchmark.is_alive():
        np.sort(numbers)
