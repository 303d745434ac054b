"""The whole benchmark: learn from stops, then let every policy drive the same scenes."""

from __future__ import annotations

import dataclasses
import time
from collections.abc import Callable, Iterable
from functools import partial
from pathlib import Path
from typing import Any

from slopewise.models.parameters import Model

from ..common.jobs import Progress, do_all
from .calibration import stops_of_drive
from .drive import run_drive
from .kept import kept
from .learning import fit
from .metrics import Result, summary, targets
from .moving_horizon import MovingHorizon
from .policies import (
    CurvatureOnly,
    FixedSpeed,
    LevelStop,
    Planned,
    Policy,
    foresighted,
)
from .records import DrivenScene
from .scenes import dem_folder, scene
from .stop_sample import StopSample

OWN, PERFECT = "slopewise", "perfect knowledge"

_EXACT = 10_000  # number of the first drive to learn from perfectly


@dataclasses.dataclass(frozen=True, slots=True)
class DriveCounts:
    """How many drives: of slopewise and perfect knowledge, of each other policy, and to learn."""

    drives: int
    baseline_drives: int
    calibration: int
    exact_calibration: int


FULL = DriveCounts(drives=330, baseline_drives=45, calibration=180, exact_calibration=120)
QUICK = DriveCounts(drives=12, baseline_drives=6, calibration=75, exact_calibration=45)


@dataclasses.dataclass(frozen=True, slots=True)
class Campaign:
    """Everything that came of it.

    Attributes:
        result: for JSON. drives: of each policy. model: learned. dem: folder, if there is one.
    """

    result: Result
    drives: dict[str, list[DrivenScene]]
    model: Model
    dem: Path | None


def policies(model: Model, perfect: Model) -> dict[str, Callable[[], Policy]]:
    """Makers of all policies by name; another planner joins by one more line."""
    makers: list[Callable[[], Policy]] = [
        partial(MovingHorizon, model),
        partial(Planned, model),
        partial(foresighted, perfect),
        partial(FixedSpeed, model, 2.0),
        partial(FixedSpeed, model, 3.5),
        partial(LevelStop, model),
        partial(CurvatureOnly, model),
    ]
    return {make().name: make for make in makers}


def run(size: DriveCounts, progress: Progress, keep: Path | None = None) -> Campaign:
    """Learn and drive.

    Args:
        size: how much.
        progress: called with a name and a total, gives what advances the bar.
        keep: folder of results, see :mod:`benchmarks.closed_loop.kept`; what is in it already is
            not driven again.
    """
    began = time.perf_counter()
    dem = dem_folder()

    def drive_all(
        work: Callable[[int], Any], numbers: Iterable[int], what: str, *origins: object
    ) -> list[Any]:
        where = kept(keep, what, *origins) if keep is not None else None
        return do_all(work, numbers, progress, what, where)

    samples = drive_all(partial(stops_of_drive, exact=False), range(size.calibration), "learning")
    exact = drive_all(
        partial(stops_of_drive, exact=True),
        range(_EXACT, _EXACT + size.exact_calibration),
        "learning perfectly",
    )
    stops, exact_stops = _flat(samples), _flat(exact)
    model, perfect = fit(stops, OWN), fit(exact_stops, PERFECT)
    makers = policies(model, perfect)
    drives = {
        name: drive_all(
            _Driver(make, dem),
            range(size.drives if name in (OWN, PERFECT) else size.baseline_drives),
            f"driving: {name}",
            perfect if name == PERFECT else model,
        )
        for name, make in makers.items()
    }
    results = {name: summary(of, drives[PERFECT][: len(of)]) for name, of in drives.items()}
    result = {
        "ground": "public elevation models and hills" if dem else "generated hills",
        "learned": {OWN: _learned(model, stops), PERFECT: _learned(perfect, exact_stops)},
        "policies": results,
        "targets": targets(results, OWN, PERFECT),
        "stops": [
            {
                "speed": s.speed,
                "grade": s.grade,
                "surface": s.surface,
                "actual": s.actual,
                "predicted": s.predicted,
                "left": s.left,
                "forced": s.forced,
            }
            for drive in drives[OWN]
            for s in drive.stops
        ],
        "seconds": time.perf_counter() - began,
    }
    return Campaign(result, drives, model, dem)


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
    return {
        "stops": len(samples),
        "dead_time": model.braking.dead_time,
        "surfaces": {
            name: {
                key: getattr(model.braking.on(name), key)
                for key in (
                    "m_m",
                    "b_m",
                    "m_b",
                    "b_b",
                    "distance_offset",
                    "speed_range",
                    "grade_range",
                )
            }
            for name in model.braking.terrain
        },
    }
