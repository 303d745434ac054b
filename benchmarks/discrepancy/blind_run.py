"""The workflow in a separate process that receives the log and a model, and no truth.

The process is spawned, not forked, so it holds no memory of its parent; a :class:`SealedLog` has no
field for a truth, a family or a seed, and jobs come in shuffled order.
"""

from __future__ import annotations

import multiprocessing
import os
import tempfile
import time
import traceback
from collections.abc import Mapping
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from typing import Any

import numpy as np

from .sensing import Columns

COEFFICIENTS = ("m_m", "b_m", "m_b", "b_b", "dead_time")
_UNCALIBRATED = (0.0, 0.0, 0.0, 0.42, 0.25)  # the same before any stop [SI]

# Vehicle table of the plant.
_PLANT: dict[str, Any] = {"mass": 500.0, "wheelbase": 1.2, "track_width": 1.0}
_PLANT |= {"cg_x": 0.6, "cg_z": 0.55, "wheel_radius": 0.28, "drive": "skid_steer"}
_PLANT |= {"max_wheel_speed": 7.0, "max_drive_force": 2500.0, "max_drive_power": 6000.0}
_LIMITS = {"speed": 6.0, "accel": 1.0, "decel": 1.5, "jerk": 2.0}
_LIMITS |= {"lateral_accel": 2.0, "min_load": 0.10}
_SLIP_TRACK = 1.15  # over the track width


@dataclass(frozen=True, slots=True)
class SealedLog:
    """All that the workflow receives: columns of a drive log, and tables of a model file."""

    columns: Columns
    model: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of the workflow on one log."""

    verdict: str  # one word, ``fault`` if the workflow failed
    # [{name, parameters: {name: (value, std)}, confidence}]
    effects: tuple[dict[str, Any], ...] = ()
    located: tuple[tuple[str, float], ...] = ()  # [(axis, p value)], the strongest first
    braking: dict[str, float] | None = None  # coefficients and dead time of the model to plan with
    added: tuple[tuple[str, dict[str, float]], ...] = ()  # [(name, parameters)] of its effects
    seconds: float = 0.0  # processor time [s]
    text: str = ""  # summary, or the fault
    # of stops held out, by the configured model, the refitted base, the finding, a perfect one [m]
    gap: tuple[float, float, float, float] = (0.0, 0.0, 0.0, 0.0)

    @property
    def names(self) -> tuple[str, ...]:
        """Proposed effects, the leading one first."""
        return tuple(str(effect["name"]) for effect in self.effects)

    @property
    def is_confident(self) -> bool:
        """Whether names are given without reservation."""
        return self.verdict == "missing_effect"


class BlindRun:
    """The process that investigates; a context manager."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="slopewise-blind-")
        spawn = multiprocessing.get_context("spawn")
        self.pool = ProcessPoolExecutor(1, spawn, _prepare, (self._folder.name,))

    def __enter__(self) -> BlindRun:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self.pool.shutdown()
        self._folder.cleanup()

    def investigate(self, log: SealedLog) -> Finding:
        return self.pool.submit(investigate_log, log).result()


def _prepare(folder: str) -> None:
    """Enter an empty folder, and use one thread: times are of one core."""
    os.chdir(folder)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def investigate_log(log: SealedLog) -> Finding:
    """Run the workflow on a log; its fault is a finding, too."""
    from slopewise.models.discrepancy.workflow import investigate
    from slopewise.services.io.model_file import model_from_dict

    start = time.process_time()
    try:
        report = investigate(log.columns, runs_of(log.columns), model_from_dict(log.model, "log"))
    except Exception:  # noqa: BLE001 every fault is a result of the benchmark
        seconds = time.process_time() - start
        return Finding("fault", text=traceback.format_exc(limit=-4), seconds=seconds)
    gap = report.stop_distance
    effects = tuple(
        {
            "name": effect.name,
            "parameters": {k: (p.value, p.std) for k, p in effect.parameters.items()},
            "confidence": effect.confidence,
        }
        for effect in report.effects
    )
    return Finding(
        report.verdict.value,
        effects,
        tuple((axis.axis, axis.p_value) for axis in report.located),
        {key: float(getattr(report.model.braking, key)) for key in COEFFICIENTS},
        tuple((effect.name, dict(effect.parameters)) for effect in report.model.effect),
        time.process_time() - start,
        f"{report.summary} {' '.join(report.notes)}".strip(),
        (gap.before, gap.refit, gap.after, gap.noise_floor),
    )


def calibrated_braking(columns: Columns) -> dict[str, Any]:
    """Braking table that `slopewise calibrate` writes after a log; it receives no truth either."""
    from slopewise.models.calibration.learn import learn, with_learned
    from slopewise.services.io.model_file import model_from_dict, model_to_dict

    uncalibrated = dict(zip(COEFFICIENTS, _UNCALIBRATED, strict=True))
    before = model_from_dict(tables_of(uncalibrated), "before")
    learned = learn(columns, runs_of(columns), before.braking, effects_model=before)
    table: dict[str, Any] = model_to_dict(with_learned(before, learned))["braking"]
    return table


def runs_of(columns: Columns) -> list[slice]:
    """Samples of each run."""
    run = columns["run"]
    edges = np.flatnonzero(run[1:] != run[:-1]) + 1
    return [slice(a, b) for a, b in zip([0, *edges], [*edges, len(run)], strict=True)]


def tables_of(
    braking: Mapping[str, Any], vehicle: Mapping[str, Any] | None = None
) -> dict[str, Any]:
    """Tables of the model file: coefficients of an earlier calibration, the plant's vehicle."""
    vehicle = vehicle or _PLANT
    terrain = {"motion_resistance": 0.10, "lateral_resistance": 0.2}
    return {
        "name": "hidden",
        "vehicle": vehicle,
        "braking": {"speed_range": (0.5, 6.5), "grade_range": (-0.28, 0.30)} | dict(braking),
        "terrain": terrain | {"slip_track": _SLIP_TRACK * vehicle["track_width"]},
        "limits": _LIMITS,
    }
