"""Comparable times: actions are interleaved, so that noise meets all of them alike."""

from __future__ import annotations

import gc
import os
import platform
import resource
import socket
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import metadata
from multiprocessing import get_context, parent_process
from pathlib import Path
from typing import Any

import numpy as np

Action = Callable[[], object]


def interleave(actions: Mapping[str, Action], rounds: int) -> dict[str, list[float]]:
    """Seconds of each action, one a round; each runs once untimed before, to warm the cache."""
    seconds: dict[str, list[float]] = {name: [] for name in actions}
    for action in actions.values():
        action()
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, action in actions.items():
                action()
                seconds[name].append(timed(action)[0])
    finally:
        gc.enable()
    return seconds


def timed(action: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds and result of one call."""
    start = time.perf_counter()
    result = action()
    return time.perf_counter() - start, result


def summary(seconds: Sequence[float]) -> dict[str, float]:
    """Median, minimum and maximum [s]."""
    return {"median": float(np.median(seconds)), "min": min(seconds), "max": max(seconds)}


def peak_memory() -> float:
    """Peak resident memory of this process [bytes]."""
    unit = 1 if platform.system() == "Darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)


def resident_memory() -> float:
    """Resident memory of this process now [bytes]; its peak where the system has no /proc."""
    try:
        with open("/proc/self/statm", encoding="ascii") as file:
            return float(int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE"))
    except OSError:
        return peak_memory()


@contextmanager
def on_one_core() -> Iterator[int]:
    """Run on the last core only, where the system allows that; yields its number."""
    if not hasattr(os, "sched_setaffinity"):
        yield 0
        return
    before = os.sched_getaffinity(0)
    core = max(before)
    os.sched_setaffinity(0, {core})
    try:
        yield core
    finally:
        os.sched_setaffinity(0, before)


@contextmanager
def background_load(core_sets: list[set[int]]) -> Iterator[None]:
    """Keep one process busy on each set of cores."""
    context = get_context("spawn")
    processes = [context.Process(target=_burn, args=(cores,), daemon=True) for cores in core_sets]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.terminate()
            process.join()


def _burn(cores: set[int]) -> None:
    """Sort numbers until the benchmark ends: load on processor, caches and memory."""
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, cores)
    numbers = np.random.default_rng(0).random(500_000)
    # A benchmark that is killed does not end its processes.
    benchmark = parent_process()
    while benchmark is not None and benchmark.is_alive():
        np.sort(numbers)


def free_port() -> int:
    """Port of the loopback that nothing listens on."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])


def machine() -> dict[str, Any]:
    """Processor, system and package versions behind the figures."""
    names = ("numpy", "numba", "osqp", "casadi", "toppra", "trajectory-planning-helpers")
    installed = {d.metadata["Name"].lower(): d.version for d in metadata.distributions()}
    return {
        "processor": processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": {name: installed.get(name, "not installed") for name in names},
    }


def processor() -> str:
    file = Path("/proc/cpuinfo")
    lines = file.read_text().splitlines() if file.is_file() else []
    names = (line.partition(": ")[2] for line in lines if line.startswith("model name"))
    return next(names, platform.machine())
