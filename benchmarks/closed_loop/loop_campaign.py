"""The closed-loop benchmark: learn from stops, then let every policy drive the same scenes."""

from __future__ import annotations

import hashlib
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

from slopewise.models.parameters import Model

from ..common.campaign import BenchmarkRequest, Progress, run_numbered
from ..common.result_cache import PickleCache, digest_of_sources
from .drive_loop import run_drive
from .learning_drives import stops_of_drive
from .loop_calibration import COEFFICIENTS, fit
from .loop_metrics import Result, show, summary, targets
from .moving_horizon import MovingHorizon
from .policies import CurvatureOnly, FixedSpeed, LevelStop, Planned, Policy, oracle_policy
from .records import DrivenScene
from .scenes import dem_folder, scene
from .stop_sample import StopSample

__all__ = ["run", "show"]

SLOPEWISE, PERFECT = "slopewise", "perfect knowledge"

_EXACT = 10_000  # number of the first drive to learn from without noise
_SOURCES = ("benchmarks/closed_loop", "models", "planner")
_IGNORED_SOURCES = ("loop_campaign.py", "loop_metrics.py")
_LIBRARIES = ("mujoco", "numpy", "scipy")


@dataclass(frozen=True, slots=True)
class DriveCounts:
    """Number of drives by slopewise and perfect knowledge, by each other policy, to learn from."""

    drives: int
    baseline_drives: int
    calibration: int
    exact_calibration: int


FULL = DriveCounts(drives=330, baseline_drives=45, calibration=180, exact_calibration=120)
QUICK = DriveCounts(drives=12, baseline_drives=6, calibration=75, exact_calibration=45)


def policies(model: Model, perfect: Model) -> dict[str, Callable[[], Policy]]:
    """Makers of all policies by name; another planner joins by one more line."""
    makers: list[Callable[[], Policy]] = [
        partial(MovingHorizon, model),
        partial(Planned, model),
        partial(oracle_policy, perfect),
        partial(FixedSpeed, model, 2.0),
        partial(FixedSpeed, model, 3.5),
        partial(LevelStop, model),
        partial(CurvatureOnly, model),
    ]
    return {make().name: make for make in makers}


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Learn and drive; results in the folder of the request are not computed again."""
    start = time.perf_counter()
    size = QUICK if request.quick else FULL
    dem = dem_folder()

    def run_all(
        work: Callable[[int], Any], numbers: Iterable[int], title: str, *origins: object
    ) -> list[Any]:
        folder = None if request.out is None else request.out / "runs"
        stored = None if folder is None else drive_cache(folder, title, *origins)
        return run_numbered(work, numbers, progress, title, stored)

    noisy = partial(stops_of_drive, exact=False)
    samples = _flat(run_all(noisy, range(size.calibration), "learning"))
    exact_numbers = range(_EXACT, _EXACT + size.exact_calibration)
    exact = _flat(run_all(partial(stops_of_drive, exact=True), exact_numbers, "learning perfectly"))
    model, perfect = fit(samples, SLOPEWISE), fit(exact, PERFECT)
    drives = {}
    for name, make in policies(model, perfect).items():
        count = size.drives if name in (SLOPEWISE, PERFECT) else size.baseline_drives
        origin = perfect if name == PERFECT else model
        drives[name] = run_all(_Driver(make, dem), range(count), f"driving: {name}", origin)
    results = {name: summary(of, drives[PERFECT][: len(of)]) for name, of in drives.items()}
    stop_keys = ("speed", "grade", "surface", "actual", "predicted", "left", "forced")
    return {
        "ground": "public elevation models and hills" if dem else "generated hills",
        "learned": {SLOPEWISE: _learned(model, samples), PERFECT: _learned(perfect, exact)},
        "policies": results,
        "targets": targets(results, SLOPEWISE, PERFECT),
        "stops": [
            {key: getattr(s, key) for key in stop_keys} for d in drives[SLOPEWISE] for s in d.stops
        ],
        "seconds": time.perf_counter() - start,
    }


class _Driver:
    """One policy over scenes by number."""

    def __init__(self, make: Callable[[], Policy], dem: Path | None) -> None:
        self._make, self._dem = make, dem

    def __call__(self, number: int) -> DrivenScene:
        terrain, route, course = scene(number, self._dem)
        return run_drive(terrain, route, course, self._make(), number)


def _flat(lists: list[list[StopSample]]) -> list[StopSample]:
    return [stop for stops in lists for stop in stops]


def _learned(model: Model, samples: list[StopSample]) -> Result:
    keys = (*COEFFICIENTS, "distance_offset", "speed_range", "grade_range")
    braking = model.braking
    return {
        "stops": len(samples),
        "dead_time": braking.dead_time,
        "surfaces": {
            name: {key: getattr(braking.on(name), key) for key in keys} for name in braking.terrain
        },
    }


def drive_cache(folder: Path, title: str, *origins: object) -> PickleCache:
    """Cache of the results of one kind of work.

    Args:
        folder: folder of the whole campaign.
        title: name of the work.
        origins: dependencies that are neither sources nor data, by their representation.
    """
    digest = hashlib.sha256(repr((_source_digest(), *origins)).encode())
    name = "".join(c if c.isalnum() else "_" for c in title)
    return PickleCache(folder / f"{name}-{digest.hexdigest()[:16]}")


@cache
def _source_digest() -> str:
    """Digest of sources, libraries and elevation models."""
    dem = dem_folder()
    models = sorted(dem.glob("*.tif")) if dem is not None else []
    return digest_of_sources(
        _SOURCES,
        _IGNORED_SOURCES,
        *(version(name) for name in _LIBRARIES),
        *(f"{file.name} {file.stat().st_size}" for file in models),
    )
