"""Separate process that compares a model with stored stops.

Run as `python -m slopewise.services.discovery.investigation_process`.

It has the lowest priority, ends when its time is over or when the service that started it is gone,
reads a job from a folder and writes its outcome there.
"""

from __future__ import annotations

import contextlib
import hashlib
import os
import signal
import sys
import threading
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from numpy.typing import NDArray

from slopewise.services.discovery.stop_store import StoredStop, read_stops
from slopewise.services.wire.model_proposal import ModelProposal
from slopewise.services.wire.plan_messages import Message

JOB, OUTCOME = "job.json", "outcome.json"
_CONCLUSIVE = ("missing_effect", "parameter_drift")
_LOWEST_PRIORITY = 19  # niceness of the process: the lowest priority of POSIX
_PAUSE = 60.0
"""Assumed time between stops where no clock shows it [s]: longer than any effect of one stop on
the next, shorter than brakes take to cool."""


class InvestigationJob(Message, frozen=True):
    """Stops to examine."""

    store: str  # folder of the stops
    names: list[str]  # their files, oldest first
    vehicle: str  # fingerprint of the vehicle
    cause: str  # operator or schedule
    limit: float  # time limit [s]
    # tables of the model file, of the model that stops are compared with, and of that planned with
    file: dict[str, Any]
    basis: dict[str, Any]
    active: dict[str, Any]


class InvestigationOutcome(Message, frozen=True):
    """Result of one investigation; ``offer`` is None where it failed, with its ``reason``."""

    reason: str
    damaged: list[str]
    offer: ModelProposal | None = None


def main(folder: Path) -> None:
    """Run the job in a folder."""
    job = msgspec.json.decode((folder / JOB).read_bytes(), type=InvestigationJob)
    _lower_priority(job.limit)
    from slopewise.services.io.files import write_atomic

    write_atomic(folder / OUTCOME, msgspec.json.encode(_investigate(job)))


def _lower_priority(limit: float) -> None:
    # Where a service manager forbids to change priorities, its shares of the processor apply.
    with contextlib.suppress(OSError):
        os.nice(_LOWEST_PRIORITY)
    signal.setitimer(signal.ITIMER_REAL, limit)

    def exit_with_service() -> None:
        os.read(0, 1)
        os._exit(1)

    threading.Thread(target=exit_with_service, daemon=True).start()


def _investigate(job: InvestigationJob) -> InvestigationOutcome:
    from slopewise.models.discrepancy.workflow import investigate
    from slopewise.models.errors import ParameterError
    from slopewise.services.discovery.model_comparison import cautious, compare_stops
    from slopewise.services.io.findings_file import findings_as_json
    from slopewise.services.io.model_file import model_from_dict, model_to_dict

    stored, damaged, data = read_stops(Path(job.store), job.names)
    stops = [stop for stop in stored if stop.vehicle == job.vehicle]
    if not stops:
        return InvestigationOutcome(
            reason="expected stored stops of this vehicle, got none", damaged=damaged
        )
    file, basis, active = (model_from_dict(t, JOB) for t in (job.file, job.basis, job.active))
    columns, runs, ground = as_log(stops)
    source = f"slopewise service, {len(stops)} stops {data}; {job.cause}"
    try:
        findings = investigate(columns, runs, basis, ground=ground, source=source)
    except ParameterError as error:
        return InvestigationOutcome(reason=str(error), damaged=damaged)
    report = findings_as_json(findings)
    adopted = cautious(findings.model, file)
    offer = ModelProposal(
        id=hashlib.sha256(f"{data}{basis}".encode()).hexdigest()[:12],
        at=time.time(),
        cause=job.cause,
        verdict=report["verdict"],
        summary=report["summary"],
        findings=report,
        data=data,
        stops=findings.stops,
        beside_file=compare_stops(adopted, file),
        beside_use=compare_stops(adopted, active),
        valid=is_valid(report),
        changes=findings.model != basis,
        notes=list(findings.notes),
        model=model_to_dict(findings.model),
    )
    return InvestigationOutcome(reason="", damaged=damaged, offer=offer)


def is_valid(findings: dict[str, Any]) -> bool:
    """Return True if findings may be used for more than slower plans."""
    interval = findings["gap"]["ci95"]
    return findings["verdict"] in _CONCLUSIVE and interval is not None and interval[0] > 0.0


def as_log(
    stops: Sequence[StoredStop],
) -> tuple[dict[str, NDArray[np.generic]], list[slice], NDArray[np.float64] | None]:
    """Stored stops as a drive log, one run per stop: columns, runs, and the grade by a map.

    Clocks of senders begin anywhere and restart. The time between stops is that of the sender's
    clock where it continues, else of the wall clock, and a minute where that was set back.
    """
    names = sorted({name for stop in stops for name in stop.columns})
    parts: dict[str, list[NDArray[np.generic]]] = {n: [] for n in (*names, "run", "terrain")}
    runs: list[slice] = []
    begin, shift, end = 0, 0.0, 0.0
    before: StoredStop | None = None
    for number, stop in enumerate(stops):
        given = dict(zip(stop.columns, stop.values, strict=True))
        t, size = given["t"], len(given["t"])
        if before is None:
            shift = -float(t[0])
        elif stop.source != before.source or t[0] + shift <= end:
            pause = stop.at - before.at - float(t[-1] - t[0])
            shift = end + (pause if pause > 0.0 else _PAUSE) - float(t[0])
        for name in names:
            parts[name].append(given.get(name, np.full(size, np.nan)))
        parts["t"][-1] = t + shift
        parts["run"].append(np.full(size, f"{number}"))
        parts["terrain"].append(np.full(size, stop.surface))
        runs.append(slice(begin, begin + size))
        begin, end, before = begin + size, float(t[-1]) + shift, stop
    columns = {name: np.concatenate(values) for name, values in parts.items()}
    grade = columns.pop("grade", None)
    return columns, runs, None if grade is None else np.asarray(grade, np.float64)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
