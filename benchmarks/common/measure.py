"""Times that can be compared: what is measured together takes turns, so that noise meets all.

In its turn each action runs once uncounted: what it needs is then in the cache, as for the others.
"""

from __future__ import annotations

import gc
import os
import platform
import resource
import time
from collections.abc import Callable, Mapping, Sequence
from importlib import metadata
from typing import Any

import numpy as np

Action = Callable[[], object]


def take_turns(actions: Mapping[str, Action], rounds: int) -> dict[str, list[float]]:
    """Seconds of each action, one for each round."""
    seconds: dict[str, list[float]] = {name: [] for name in actions}
    for action in actions.values():
        action()
    gc.collect()
    gc.disable()
    try:
        for _ in range(rounds):
            for name, action in actions.items():
                action()
                begun = time.perf_counter()
                action()
                seconds[name].append(time.perf_counter() - begun)
    finally:
        gc.enable()
    return seconds


def timed(action: Callable[[], Any]) -> tuple[float, Any]:
    """Seconds of one call, and what it returned."""
    begun = time.perf_counter()
    result = action()
    return time.perf_counter() - begun, result


def summary(seconds: Sequence[float]) -> dict[str, float]:
    """Median, least and most [s]."""
    values = np.asarray(seconds)
    return {
        "median": float(np.median(values)),
        "min": float(values.min()),
        "max": float(values.max()),
    }


def peak_memory() -> float:
    """Most memory this process has held [bytes]."""
    unit = 1 if platform.system() == "Darwin" else 1024
    return float(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit)


def machine() -> dict[str, Any]:
    """Where and with what the figures were found."""
    names = (
        "numpy",
        "numba",
        "osqp",
        "casadi",
        "toppra",
        "trajectory-planning-helpers",
        "piqp",
        "clarabel",
    )
    return {
        "processor": _processor(),
        "cores": os.cpu_count(),
        "system": platform.platform(),
        "python": platform.python_version(),
        "packages": {name: _version(name) for name in names},
    }


def _processor() -> str:
    try:
        with open("/proc/cpuinfo", encoding="utf-8") as lines:
            return next(line.split(":")[1].strip() for line in lines if "model name" in line)
    except (OSError, StopIteration):
        return platform.processor() or "unknown"


def _version(name: str) -> str:
    try:
        return metadata.version(name)
    except metadata.PackageNotFoundError:
        return "not installed"
