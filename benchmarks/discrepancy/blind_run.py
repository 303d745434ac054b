"""The workflow in a separate process that receives the log and a model, and no truth.

The process is spawned, not forked, so it holds no memory of its parent; a :class:`SealedLog` has no
field for a truth, a family or a seed, and jobs come in shuffled order. The truth is committed to by
a digest before the log is sent, and written to a file only after the finding is in.
"""

from __future__ import annotations

import hashlib
import json
import multiprocessing
import os
import secrets
import tempfile
import time
import traceback
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .sensing import Columns

COEFFICIENTS = ("m_m", "b_m", "m_b", "b_b", "dead_time")

_PLANT: dict[str, Any] = {
    "mass": 500.0,
    "wheelbase": 1.2,
    "track_width": 1.0,
    "cg_x": 0.6,
    "cg_z": 0.55,
    "wheel_radius": 0.28,
    "drive": "skid_steer",
    "max_wheel_speed": 7.0,
    "max_drive_force": 2500.0,
    "max_drive_power": 6000.0,
}
"""Vehicle table of the plant."""

_SLIP_TRACK = 1.15  # over the track width


@dataclass(frozen=True, slots=True)
class SealedLog:
    """All that the workflow receives: columns of a drive log, and tables of a model file."""

    columns: Columns
    model: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Finding:
    """Result of the workflow on one log.

    Attributes:
        verdict: one word, ``fault`` if the workflow failed.
        effects: [{name, parameters: {name: (value, std)}, confidence, alternatives}].
        located: [(axis, p value)], the strongest first.
        closed: the workflow's own share of the closed gap, None without one.
        braking: coefficients and dead time of the model to plan with.
        added: [(name, parameters)] of its effects.
        design: proposed stops, a dict each.
        repeats: proposed repetitions of the design.
        seconds: processor time [s].
        stops: number of compared stops.
        text: summary, or the fault.
        worse: standard errors by which the finding predicts held-out stops worse than new
            coefficients do, in speed or distance, the larger one.
        resolvable: change of a stop from which each effect would have been detected [m].
    """

    verdict: str
    effects: tuple[dict[str, Any], ...] = ()
    located: tuple[tuple[str, float], ...] = ()
    closed: float | None = None
    braking: dict[str, float] | None = None
    added: tuple[tuple[str, dict[str, float]], ...] = ()
    design: tuple[dict[str, float | None], ...] = ()
    repeats: int = 0
    seconds: float = 0.0
    stops: int = 0
    text: str = ""
    worse: float = 0.0
    resolvable: dict[str, float] = field(default_factory=dict)

    @property
    def names(self) -> tuple[str, ...]:
        """Proposed effects, the leading one first."""
        return tuple(str(effect["name"]) for effect in self.effects)

    @property
    def is_confident(self) -> bool:
        """Whether names are given without reservation."""
        return self.verdict == "missing_effect"


@dataclass(frozen=True, slots=True)
class TruthCommitment:
    """Digest of a truth: SHA-256 of the nonce and the truths as JSON."""

    truths: str
    nonce: str
    digest: str


def commit(truths: Sequence[Any]) -> TruthCommitment:
    """Commit to truths before the log is sent."""
    text = json.dumps(truths, sort_keys=True)
    nonce = secrets.token_hex(16)
    return TruthCommitment(text, nonce, hashlib.sha256((nonce + text).encode()).hexdigest())


class BlindRun:
    """The process that investigates; a context manager.

    Attributes:
        pool: its executor.
    """

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="slopewise-blind-")
        self.pool = ProcessPoolExecutor(
            1, multiprocessing.get_context("spawn"), _prepare, (self._folder.name,)
        )

    def __enter__(self) -> BlindRun:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self.pool.shutdown()
        self._folder.cleanup()

    def investigate(self, log: SealedLog) -> Finding:
        """Investigate one log in the process."""
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

    start = time.process_time()
    try:
        report = investigate(log.columns, runs_of(log.columns), _model_of(log.model))
    except Exception:  # noqa: BLE001 every fault is a result of the benchmark
        seconds = time.process_time() - start
        return Finding("fault", text=traceback.format_exc(limit=-4), seconds=seconds)
    effects = tuple(
        {
            "name": effect.name,
            "parameters": {k: (p.value, p.std) for k, p in effect.parameters.items()},
            "confidence": effect.confidence,
            "alternatives": list(effect.alternatives),
        }
        for effect in report.effects
    )
    stop_fields = ("speed", "grade", "heading", "roll", "yaw_rate", "pause", "x", "y")
    return Finding(
        report.verdict.value,
        effects,
        tuple((axis.axis, axis.p_value) for axis in report.located),
        report.gap.closed,
        {key: float(getattr(report.model.braking, key)) for key in COEFFICIENTS},
        tuple((effect.name, dict(effect.parameters)) for effect in report.model.effect),
        tuple({k: getattr(s, k) for k in stop_fields} for s in report.next_experiment.stops),
        report.next_experiment.repeats,
        time.process_time() - start,
        report.stops,
        f"{report.summary} {' '.join(report.notes)}".strip(),
        float(max(report.gap.worse, report.stop_distance.worse)),
        dict(report.resolvable),
    )


def runs_of(columns: Columns) -> list[slice]:
    """Samples of each run."""
    run = columns["run"]
    edges = np.flatnonzero(run[1:] != run[:-1]) + 1
    return [slice(a, b) for a, b in zip([0, *edges], [*edges, len(run)], strict=True)]


def tables_of(braking: dict[str, float], vehicle: dict[str, Any] | None = None) -> dict[str, Any]:
    """Tables of the model file for a log.

    Args:
        braking: coefficients and dead time of an earlier calibration.
        vehicle: vehicle table; default: the plant's.
    """
    vehicle = vehicle or _PLANT
    return {
        "name": "hidden",
        "vehicle": vehicle,
        "braking": braking | {"speed_range": (0.5, 6.5), "grade_range": (-0.28, 0.30)},
        "terrain": {
            "motion_resistance": 0.10,
            "lateral_resistance": 0.2,
            "slip_track": _SLIP_TRACK * vehicle["track_width"],
        },
        "limits": {
            "speed": 6.0,
            "accel": 1.0,
            "decel": 1.5,
            "jerk": 2.0,
            "lateral_accel": 2.0,
            "min_load": 0.10,
        },
    }


def _model_of(tables: dict[str, Any]) -> Any:
    """Build a model from the tables of its file."""
    from slopewise.models.parameters import Braking, Limits, Model, Terrain
    from slopewise.models.vehicle import Vehicle

    return Model(
        name=tables["name"],
        vehicle=Vehicle(**tables["vehicle"]),
        braking=Braking(**tables["braking"]),
        terrain=Terrain(**tables["terrain"]),
        limits=Limits(**tables["limits"]),
    )
