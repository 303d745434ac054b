"""The workflow in a process of its own that gets the log and a model, and nothing else.

It is started afresh, not forked, so it holds no memory of its parent's; a :class:`SealedLog` has
no field in which a truth, a family or a seed could travel, and jobs come in shuffled order. What is
true is committed to beforehand by a digest and written to a file only after the last finding is in.
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


@dataclass(frozen=True, slots=True)
class SealedLog:
    """All that the workflow is told: columns of a drive log, and tables of a model file."""

    columns: Columns
    model: dict[str, Any]


@dataclass(frozen=True, slots=True)
class InquiryFinding:
    """What came back.

    Attributes:
        verdict: one word, ``fault`` if the workflow failed.
        effects: [{name, parameters: {name: (value, std)}, confidence, alternatives}].
        located: [(axis, p value)], the strongest first.
        closed: the workflow's own figure, None where it gives none.
        braking: coefficients and dead time of the model to plan with from now on.
        added: [(name, parameters)] of its effects.
        design: stops proposed next, a dict each. repeats: how often the whole of them.
        seconds: of processor time that it took. stops: that it used.
        text: what it says, or of the fault.
        worse: by how many standard errors stops held out are predicted worse by what was found
            than by new coefficients, in speed or distance, whichever is more.
        resolvable: change of a stop from which each effect would have shown [m].
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
        """Of the effects it puts forward, the leading one first."""
        return tuple(str(effect["name"]) for effect in self.effects)


@dataclass(frozen=True, slots=True)
class Seal:
    """A promise of what is true: SHA-256 of the nonce and the truths as JSON."""

    truths: str
    nonce: str
    digest: str


def seal(truths: Sequence[Any]) -> Seal:
    """Commit to truths before anything is asked."""
    text = json.dumps(truths, sort_keys=True)
    nonce = secrets.token_hex(16)
    return Seal(text, nonce, hashlib.sha256((nonce + text).encode()).hexdigest())


class Inquiry:
    """The process that investigates; a context manager."""

    def __init__(self) -> None:
        self._folder = tempfile.TemporaryDirectory(prefix="slopewise-inquiry-")
        self._pool = ProcessPoolExecutor(
            1, multiprocessing.get_context("spawn"), _settle, (self._folder.name,)
        )

    def __enter__(self) -> Inquiry:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End the process."""
        self._pool.shutdown()
        self._folder.cleanup()

    def ask(self, job: SealedLog) -> InquiryFinding:
        """Have one log investigated."""
        return self._pool.submit(investigate_job, job).result()


def _settle(folder: str) -> None:
    """An empty folder to be in, and one thread: times are of one core."""
    os.chdir(folder)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"):
        os.environ[name] = "1"
    from threadpoolctl import threadpool_limits

    threadpool_limits(1)


def investigate_job(job: SealedLog) -> InquiryFinding:
    """Run the workflow on a log; a fault of it is a finding, too."""
    from slopewise.models.discrepancy.workflow import investigate

    begun = time.process_time()
    try:
        model = model_of(job.model)
        found = investigate(job.columns, runs_of(job.columns), model)
    except Exception:  # noqa: BLE001 whatever goes wrong counts against it
        spent = time.process_time() - begun
        return InquiryFinding("fault", text=traceback.format_exc(limit=-4), seconds=spent)
    effects = tuple(
        {
            "name": effect.name,
            "parameters": {k: (p.value, p.std) for k, p in effect.parameters.items()},
            "confidence": effect.confidence,
            "alternatives": list(effect.alternatives),
        }
        for effect in found.effects
    )
    on = found.model.braking
    keys = ("m_m", "b_m", "m_b", "b_b", "dead_time")
    return InquiryFinding(
        found.verdict.value,
        effects,
        tuple((axis.axis, axis.p_value) for axis in found.located),
        found.gap.closed,
        {key: float(getattr(on, key)) for key in keys},
        tuple((effect.name, dict(effect.parameters)) for effect in found.model.effect),
        tuple(_planned(stop) for stop in found.next_experiment.stops),
        found.next_experiment.repeats,
        time.process_time() - begun,
        found.stops,
        f"{found.summary} {' '.join(found.notes)}".strip(),
        float(max(found.gap.worse, found.stop_distance.worse)),
        dict(found.resolvable),
    )


def _planned(stop: Any) -> dict[str, float | None]:
    names = ("speed", "grade", "heading", "roll", "yaw_rate", "pause", "x", "y")
    return {name: getattr(stop, name) for name in names}


def runs_of(columns: Columns) -> list[slice]:
    """Samples of each run."""
    run = columns["run"]
    edges = np.flatnonzero(run[1:] != run[:-1]) + 1
    return [slice(a, b) for a, b in zip([0, *edges], [*edges, len(run)], strict=True)]


def model_of(tables: dict[str, Any]) -> Any:
    """A model out of the tables of its file."""
    from slopewise.models.parameters import Braking, Limits, Model, Terrain
    from slopewise.models.vehicle import Vehicle

    return Model(
        name=tables["name"],
        vehicle=Vehicle(**tables["vehicle"]),
        braking=Braking(**tables["braking"]),
        terrain=Terrain(**tables["terrain"]),
        limits=Limits(**tables["limits"]),
    )
