"""A process of its own that holds a model against stored stops.

Run as `python -m slopewise.services.discovery.investigate`.

It has the lowest priority, ends itself when its time is over or when the service that began it is
gone, reads a job from a folder and leaves its outcome there.
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

import msgspec
import numpy as np
from numpy.typing import NDArray

from slopewise.services.discovery.finding import InvestigationOutcome, is_valid
from slopewise.services.discovery.stop_store import StoredStop, read_stops
from slopewise.services.wire.model_proposal import ModelProposal, StopDistanceChange
from slopewise.services.wire.plan_messages import Message

JOB, OUTCOME = "job.json", "outcome.json"
FILE, BASE, IN_USE = "file.toml", "base.toml", "in_use.toml"
"""Models: of the model file, that the stops are held against, and planned with now."""

_LOWEST = 19
_PAUSE = 60.0  # [s] put between stops of which no clock tells how far apart they are


class InvestigationJob(Message, frozen=True):
    """What to look at.

    Attributes:
        store: folder of the stops. names: of their files, oldest first. vehicle: its fingerprint.
        cause: who asked. limit: time for it [s].
    """

    store: str
    names: list[str]
    vehicle: str
    cause: str
    limit: float


def main(folder: Path) -> None:
    """Do the job in a folder."""
    job = msgspec.json.decode((folder / JOB).read_bytes(), type=InvestigationJob)
    _be_humble(job.limit)
    from slopewise.services.io.files import write_atomic

    write_atomic(folder / OUTCOME, msgspec.json.encode(_look(job, folder)))


def _be_humble(limit: float) -> None:
    # Where a service manager forbids to change priorities, its own shares hold.
    with contextlib.suppress(OSError):
        os.nice(_LOWEST)
    signal.setitimer(signal.ITIMER_REAL, limit)

    def leave_with_the_service() -> None:
        os.read(0, 1)
        os._exit(1)

    threading.Thread(target=leave_with_the_service, daemon=True).start()


def _look(job: InvestigationJob, folder: Path) -> InvestigationOutcome:
    from slopewise.models.discrepancy.workflow import investigate
    from slopewise.models.errors import ParameterError
    from slopewise.services.discovery.stops_compared import cautious, compared
    from slopewise.services.io.findings_file import findings_as_json
    from slopewise.services.io.model_file import model_to_dict, read_model

    stops, damaged, data = read_stops(Path(job.store), job.names)
    own = [stop for stop in stops if stop.vehicle == job.vehicle]
    if not own:
        return InvestigationOutcome(
            reason="expected stored stops of this vehicle, got none", damaged=damaged
        )
    file, base, in_use = (read_model(folder / name) for name in (FILE, BASE, IN_USE))
    columns, runs, ground = as_log(own)
    source = f"slopewise service, {len(own)} stops {data}; {job.cause}"
    try:
        findings = investigate(columns, runs, base, ground=ground, source=source)
    except ParameterError as error:
        return InvestigationOutcome(reason=str(error), damaged=damaged)
    told = findings_as_json(findings)
    adopted = cautious(findings.model, file)
    shifts = [compared(adopted, other) for other in (file, in_use)]
    offer = ModelProposal(
        id=hashlib.sha256(f"{data}{base}".encode()).hexdigest()[:12],
        at=time.time(),
        cause=job.cause,
        verdict=told["verdict"],
        summary=told["summary"],
        findings=told,
        data=data,
        stops=findings.stops,
        beside_file=StopDistanceChange(
            least=shifts[0].least, most=shifts[0].most, where=shifts[0].where
        ),
        beside_use=StopDistanceChange(
            least=shifts[1].least, most=shifts[1].most, where=shifts[1].where
        ),
        valid=is_valid(told),
        changes=findings.model != base,
        notes=list(findings.notes),
        model=model_to_dict(findings.model),
    )
    return InvestigationOutcome(reason="", damaged=damaged, offer=offer)


def as_log(
    stops: Sequence[StoredStop],
) -> tuple[dict[str, NDArray[np.generic]], list[slice], NDArray[np.float64] | None]:
    """Stored stops as a drive log, one run a stop: columns, runs, and the grade by a map.

    Clocks of senders begin anywhere and begin anew. One that runs on tells how far stops are apart;
    else the clock of the day does, and where that went back, a minute.
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
            apart = stop.at - before.at - float(t[-1] - t[0])
            shift = end + (apart if apart > 0.0 else _PAUSE) - float(t[0])
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
