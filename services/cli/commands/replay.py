"""`slopewise replay`: play recorded drives through a running service, as a robot tells them."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any, TypeVar

import numpy as np
import zenoh
from rich.console import Console
from rich.table import Table

from slopewise.models.errors import InputError
from slopewise.services.cli.arguments.robot import ReplayOptions
from slopewise.services.cli.screen import progress_bar
from slopewise.services.io.drive_log import DriveLog, read_logs
from slopewise.services.report.plan_labels import plural
from slopewise.services.wire import codec
from slopewise.services.wire.codec import Format
from slopewise.services.wire.connect import client_session
from slopewise.services.wire.observations import (
    DRIVE_COLUMNS,
    MORE_COLUMNS,
    DriveSamples,
    ObservationAck,
)
from slopewise.services.wire.parameter_messages import ParameterGroup, ParameterReply

_Answer = TypeVar("_Answer", ObservationAck, ParameterReply)

_BATCH = 0.25
"""Samples of that long travel together [s]; less than an observation may be late."""

_MOST_TOGETHER = 1000
_LARGEST_REPLY = 64_000_000


@dataclass(frozen=True, slots=True)
class ReplayResult:
    """What came of it.

    Attributes:
        samples: sent.
        driven, took: length of the log and of playing it [s].
        receipts: how many batches had which status and reason.
        before, after: parameters by group.
    """

    samples: int
    driven: float
    took: float
    receipts: Counter[tuple[str, str]]
    before: dict[str, ParameterGroup]
    after: dict[str, ParameterGroup]
    version: tuple[int, int] = field(default=(0, 0))


def run(job: ReplayOptions, *, quiet: bool = False) -> ReplayResult:
    """Play the log.

    Raises:
        InputError: the log or an option cannot be used, or nobody answers.
    """
    if not job.speed_up > 0.0:
        raise InputError("--speed-up", "", f"expected a factor > 0, got {job.speed_up:g}")
    log = read_logs(job.logs, job.topics, job.columns)
    with client_session(job.connect, job.zenoh_file) as session:
        service = _Service(session, job.namespace, job.timeout)
        before = service.parameters()
        receipts: Counter[tuple[str, str]] = Counter()
        begun = time.monotonic()
        with progress_bar("playing", len(log.columns["t"]), quiet=quiet) as advance:
            for part, source in zip(log.runs, _sources(log), strict=True):
                _play(log, part, source, job.speed_up, service, receipts, advance)
        took = time.monotonic() - begun
        after = service.parameters()
    t = log.columns["t"]
    return ReplayResult(
        samples=len(t),
        driven=float(sum(t[part.stop - 1] - t[part.start] for part in log.runs)),
        took=took,
        receipts=receipts,
        before={group.group: group for group in before.groups},
        after={group.group: group for group in after.groups},
        version=(before.version, after.version),
    )


def _sources(log: DriveLog) -> list[str]:
    """A sender a run; one for all where the time of all runs goes on."""
    name = f"replay-{os.getpid()}-{time.time_ns()}"
    return [name if log.one_clock else f"{name}-{i}" for i in range(len(log.runs))]


def _play(
    log: DriveLog,
    part: slice,
    source: str,
    speed_up: float,
    service: _Service,
    receipts: Counter[tuple[str, str]],
    advance: Callable[[int], None],
) -> None:
    t = log.columns["t"]
    begun, first = time.monotonic(), float(t[part.start])
    for rows in _batches(t, part):
        due = begun + (float(t[rows.stop - 1]) - first) / speed_up
        time.sleep(max(due - time.monotonic(), 0.0))
        receipt = service.observe(source, log, rows)
        receipts[receipt.status, receipt.reason] += 1
        advance(rows.stop - rows.start)


def _batches(t: np.ndarray, part: slice) -> Iterator[slice]:
    """Samples of a run that travel together."""
    begin = part.start
    while begin < part.stop:
        # Times grow within a run only.
        later = np.searchsorted(t[begin : part.stop], t[begin] + _BATCH, side="right")
        end = begin + min(max(int(later), 1), _MOST_TOGETHER)
        yield slice(begin, end)
        begin = end


class _Service:
    """A running service, as a sender of samples sees it."""

    def __init__(self, session: zenoh.Session, namespace: str, timeout: float) -> None:
        self._session, self._namespace, self._timeout = session, namespace, timeout
        self._sequence = 0

    def observe(self, source: str, log: DriveLog, rows: slice) -> ObservationAck:
        """Send samples, wait until the service took them: nothing is lost by playing too fast."""
        columns = {name: log.columns[name][rows] for name in DRIVE_COLUMNS}
        for name in MORE_COLUMNS:
            values = log.columns.get(name)
            if values is not None and np.isfinite(values[rows]).all():
                columns[name] = values[rows]
        self._sequence += 1
        sent = DriveSamples(
            source=source,
            sequence=self._sequence,
            time=time.monotonic(),
            columns=list(columns),
            values=np.stack(list(columns.values())),
            surface=_surface(log, rows),
        )
        return self._ask(ObservationAck, "obs/drive", sent)

    def parameters(self) -> ParameterReply:
        """All groups as they are now."""
        return self._ask(ParameterReply, "params", None)

    def _ask(self, kind: type[_Answer], name: str, message: DriveSamples | None) -> _Answer:
        key = f"{self._namespace}/v1/{name}"
        written = Format.MESSAGEPACK
        if message is None:
            replies = self._session.get(key, timeout=self._timeout)
        else:
            replies = self._session.get(
                key,
                payload=codec.encode(message, written),
                timeout=self._timeout,
                encoding=codec.encoding_of(type(message), written),
            )
        for reply in replies:
            if reply.ok is not None:
                told = str(reply.ok.encoding)
                return codec.decode(kind, reply.ok.payload, told, key, _LARGEST_REPLY)
        words = f"expected an answer within {self._timeout:g} s, got none"
        raise InputError(key, "", words)


def _surface(log: DriveLog, rows: slice) -> str:
    terrain = log.columns.get("terrain")
    return "" if terrain is None else str(terrain[rows.start])


def as_json(result: ReplayResult) -> dict[str, Any]:
    """Summary for machines."""
    return {
        "samples": result.samples,
        "driven": result.driven,
        "took": result.took,
        "receipts": [
            {"status": status, "reason": reason, "batches": count}
            for (status, reason), count in sorted(result.receipts.items())
        ],
        "version": {"before": result.version[0], "after": result.version[1]},
        "learned": {
            name: {
                "valid": group.valid,
                "cause": group.cause,
                "before": getattr(result.before.get(name), "values", {}),
                "after": group.values,
                "stds": group.stds,
            }
            for name, group in result.after.items()
        },
    }


def show(result: ReplayResult, console: Console) -> None:
    """A row a parameter that changed, and what became of the samples."""
    pace = result.driven / max(result.took, 1e-9)
    console.print(
        f"{plural(result.samples, 'sample')}, {result.driven:.0f} s of driving in "
        f"{result.took:.1f} s "
        f"({pace:.0f}-fold); version {result.version[0]} → {result.version[1]}"
    )
    table = Table(title="what was learned")
    for title in ("group", "parameter", "before", "after", "± std", "valid"):
        table.add_column(title, justify="left" if title in ("group", "parameter") else "right")
    for name, group in result.after.items():
        known = result.before.get(name)
        for parameter, value in group.values.items():
            before = known.values.get(parameter) if known else None
            if before == value:
                continue
            std = group.stds.get(parameter)
            table.add_row(
                name,
                parameter,
                "–" if before is None else f"{before:.4g}",
                f"{value:.4g}",
                "–" if std is None else f"{std:.2g}",
                "yes" if group.valid else "no",
            )
    console.print(table if table.row_count else "nothing was learned that changes parameters")
    odd = Counter({key: n for key, n in result.receipts.items() if key[0] != "taken"})
    for (status, reason), count in odd.most_common(10):
        console.print(f"{plural(count, 'batch')} {status}: {reason}")
