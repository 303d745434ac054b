"""`slopewise replay`: recorded drives, played to a running service."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import typer

from slopewise.services.cli.command import command, print_result
from slopewise.services.cli.options import (
    AsJson,
    Columns,
    Connect,
    LogFiles,
    Namespace,
    Topics,
    ZenohFile,
)
from slopewise.services.cli.tables import line, table
from slopewise.services.report.plural import plural

if TYPE_CHECKING:
    import zenoh

    from slopewise.models.arrays import Floats
    from slopewise.services.io.drive_log import DriveLog
    from slopewise.services.wire.observations import DriveSamples
    from slopewise.services.wire.parameter_messages import ParameterReply

_BATCH = 0.25
"""Duration of the samples that are sent together [s]; an observation may be later than that."""

_MAX_BATCH = 1000
"""Samples that are sent together at most; a log at 4 kHz has as many in a batch."""


@dataclass(frozen=True, slots=True)
class ReplayOptions:
    """Options of `slopewise replay`."""

    logs: LogFiles
    connect: Connect = "tcp/127.0.0.1:7447"
    namespace: Namespace = "slopewise/robot"
    speed_up: Annotated[
        float,
        typer.Option(metavar="X", help="Seconds of the log per second; inf: as fast as possible."),
    ] = 1.0
    topics: Topics = None
    columns: Columns = ""
    timeout: Annotated[float, typer.Option(metavar="SECONDS", help="For each reply.")] = 5.0
    zenoh_file: ZenohFile = ""
    as_json: AsJson = False


@command()
def replay(options: ReplayOptions) -> None:
    """Play recorded drives to a running service, and report what it learned from them.

    Samples are sent as a robot sends them, each batch after the reply to the one before, so that
    nothing is lost at any speed. Stops that come faster than the vehicle can make them do not make
    plans faster, unless the service's settings allow it (stops_at_once).

    [bold]Example[/]  slopewise replay drive.csv --speed-up 20
    """
    from slopewise.models.errors import InputError
    from slopewise.services.cli.ask import ask
    from slopewise.services.io.drive_log import read_logs
    from slopewise.services.wire.connect import client_session
    from slopewise.services.wire.parameter_messages import ParameterReply

    if not options.speed_up > 0.0:
        raise InputError("--speed-up", "", f"expected a factor > 0, got {options.speed_up:g}")
    log = read_logs(options.logs, options.topics, options.columns)
    key = f"{options.namespace}/v1/params"
    with client_session(options.connect, options.zenoh_file) as session:
        before = ask(session, key, ParameterReply, None, options.timeout, key)
        begin = time.monotonic()
        receipts = _play(log, session, options)
        took = time.monotonic() - begin
        after = ask(session, key, ParameterReply, None, options.timeout, key)
    summary = _summary(log, took, receipts, before, after)
    print_result(options.as_json, summary, _tables(summary))


def _play(
    log: DriveLog, session: zenoh.Session, options: ReplayOptions
) -> Counter[tuple[str, str]]:
    """Send all samples; number of batches by status and reason of their receipts."""
    from slopewise.services.cli.ask import ask
    from slopewise.services.jobs.progress import progress_bar
    from slopewise.services.wire.observations import ObservationAck

    receipts: Counter[tuple[str, str]] = Counter()
    t, key = log.columns["t"], f"{options.namespace}/v1/obs/drive"
    # One sender per run, unless the clock of all runs is the same.
    name, sequence = f"replay-{os.getpid()}-{time.time_ns()}", 0
    with progress_bar("playing", len(t), quiet=options.as_json) as advance:
        for number, part in enumerate(log.runs):
            source = name if log.one_clock else f"{name}-{number}"
            begin, first = time.monotonic(), float(t[part.start])
            for rows in _batches(t, part):
                due = begin + (float(t[rows.stop - 1]) - first) / options.speed_up
                time.sleep(max(due - time.monotonic(), 0.0))
                sequence += 1
                samples = _samples(log, rows, source, sequence)
                receipt = ask(session, key, ObservationAck, samples, options.timeout, key)
                receipts[receipt.status, receipt.reason] += 1
                advance(rows.stop - rows.start)
    return receipts


def _batches(t: Floats, part: slice) -> Iterator[slice]:
    """Samples of a run that are sent together."""
    import numpy as np

    begin = part.start
    while begin < part.stop:
        # Times grow within a run only.
        later = np.searchsorted(t[begin : part.stop], t[begin] + _BATCH, side="right")
        end = begin + min(max(int(later), 1), _MAX_BATCH)
        yield slice(begin, end)
        begin = end


def _samples(log: DriveLog, rows: slice, source: str, sequence: int) -> DriveSamples:
    import numpy as np

    from slopewise.services.wire.observations import DRIVE_COLUMNS, MORE_COLUMNS, DriveSamples

    columns = {name: log.columns[name][rows] for name in DRIVE_COLUMNS}
    for name in MORE_COLUMNS:
        values = log.columns.get(name)
        if values is not None and np.isfinite(values[rows]).all():
            columns[name] = values[rows]
    terrain = log.columns.get("terrain")
    return DriveSamples(
        source=source,
        sequence=sequence,
        time=time.monotonic(),
        columns=list(columns),
        values=np.stack(list(columns.values())),
        surface="" if terrain is None else str(terrain[rows.start]),
    )


def _summary(
    log: DriveLog,
    took: float,
    receipts: Counter[tuple[str, str]],
    before: ParameterReply,
    after: ParameterReply,
) -> dict[str, Any]:
    t = log.columns["t"]
    earlier = {group.group: group.values for group in before.groups}
    return {
        "samples": len(t),
        "driven": float(sum(t[part.stop - 1] - t[part.start] for part in log.runs)),
        "took": took,
        "receipts": [
            {"status": status, "reason": reason, "batches": count}
            for (status, reason), count in sorted(receipts.items())
        ],
        "version": {"before": before.version, "after": after.version},
        "learned": {
            group.group: {
                "valid": group.valid,
                "cause": group.cause,
                "before": earlier.get(group.group, {}),
                "after": group.values,
                "stds": group.stds,
            }
            for group in after.groups
        },
    }


def _tables(summary: dict[str, Any]) -> Iterator[Any]:
    """One row per parameter that changed, and the receipts of rejected samples."""
    factor = summary["driven"] / max(summary["took"], 1e-9)
    version = summary["version"]
    yield (
        f"{plural(summary['samples'], 'sample')}, {summary['driven']:.0f} s of driving in "
        f"{summary['took']:.1f} s ({factor:.0f}-fold); "
        f"version {version['before']} → {version['after']}"
    )
    rows = [
        (
            name,
            parameter,
            f"{group['before'][parameter]:.4g}" if parameter in group["before"] else None,
            f"{value:.4g}",
            f"{group['stds'][parameter]:.2g}" if parameter in group["stds"] else None,
            "yes" if group["valid"] else "no",
        )
        for name, group in summary["learned"].items()
        for parameter, value in group["after"].items()
        if group["before"].get(parameter) != value
    ]
    columns = ("group", "parameter", "before", "after", "± std", "valid")
    if rows:
        yield from table(
            columns, rows, title="what was learned", left=("parameter",), limit=len(rows)
        )
    else:
        yield "no parameter was changed"
    for receipt in summary["receipts"]:
        if receipt["status"] != "taken":
            count = plural(receipt["batches"], "batch")
            yield line(f"{count} {receipt['status']}: {receipt['reason']}")
