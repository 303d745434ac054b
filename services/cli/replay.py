"""`slopewise replay`: recorded drives, played to a running service, or through plan and guard."""

from __future__ import annotations

import os
import time
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.models.errors import InputError
from slopewise.services.cli import options
from slopewise.services.cli.command import print_result, schema_of
from slopewise.services.cli.options import option
from slopewise.services.cli.tables import line, number, table
from slopewise.services.jobs.plural import plural

if TYPE_CHECKING:
    import zenoh

    from slopewise.models.arrays import Floats
    from slopewise.services.io.drive_log import DriveLog
    from slopewise.services.jobs.played_log import PlayedLog
    from slopewise.services.wire.observations import DriveSamples

_BATCH = 0.25
"""Duration of the samples that are sent together [s]; an observation may be later than that."""

_MAX_BATCH = 1000
"""Samples that are sent together at most; a log at 4 kHz has as many in a batch."""


def replay(
    logs: options.LogFiles,
    connect: options.Connect = "tcp/127.0.0.1:7447",
    namespace: options.Namespace = "slopewise/robot",
    speed_up: Annotated[
        float, option("Seconds of the log per second; inf: as fast as possible.", "X")
    ] = 1.0,
    topics: options.Topics = None,
    columns: options.Columns = "",
    timeout: Annotated[float, option("Longest wait for each reply.", "SECONDS")] = 5.0,
    zenoh_file: options.ZenohFile = "",
    plan: Annotated[
        bool, option("Plan along a recording instead; needs --model.", None, "--plan")
    ] = False,
    model: Annotated[str, option("Model file, with --plan.", "M.toml", "--model", "-m")] = "",
    report: options.Report = None,
    as_json: options.AsJson = False,
    json_schema: Annotated[
        bool, schema_of("jobs.played_log.PlayedLog", "jobs.replay_summary.ReplaySummary")
    ] = False,
) -> None:
    """Play recorded drives to a running service, and report what it learned from them.

    Samples are sent as a robot sends them, each batch after the reply to the one before, so that
    nothing is lost at any speed. Stops that come faster than the vehicle can make them do not make
    plans faster, unless the service's settings allow it (stops_at_once).

    With --plan no service is needed: maps, odometry and paths of one recording go through the
    moving horizon and the guard at the rate of the recording, and the command reports latencies,
    statuses by cause, and where the driver would have been slowed.

    [bold]Example[/]  slopewise replay drive.csv --speed-up 20
    [bold]Example[/]  slopewise replay drive.mcap --plan --model atv --report drive.html
    """
    from slopewise.services.cli.ask import ask
    from slopewise.services.io.drive_log import read_logs
    from slopewise.services.jobs.played_log import played_log
    from slopewise.services.wire.connect import client_session
    from slopewise.services.wire.parameter_messages import ParameterReply

    if not speed_up > 0.0:
        raise InputError("--speed-up", "", f"expected a factor > 0, got {speed_up:g}")
    if plan:
        _replay_plan(logs, model, topics, speed_up, report, as_json=as_json)
        return
    if model or report is not None:
        expected = "expected --plan as well: model and page are those of plans along a recording"
        raise InputError("--model" if model else "--report", "", expected)
    log = read_logs(logs, topics, columns)
    key = f"{namespace}/v1/params"
    with client_session(connect, zenoh_file) as session:
        before = ask(session, key, ParameterReply, None, timeout, key)
        begin = time.monotonic()
        receipts = _play(log, session, namespace, speed_up, timeout)
        took = time.monotonic() - begin
        after = ask(session, key, ParameterReply, None, timeout, key)
    played = played_log(log, took, receipts, before, after)
    print_result(as_json, played, _tables(played))


def _replay_plan(
    logs: list[Path],
    model: str,
    topics: Path | None,
    speed_up: float,
    report: Path | None,
    *,
    as_json: bool,
) -> None:
    """Plan along one recording."""
    from slopewise.services.guard.decide import guard_decision
    from slopewise.services.io.bags import is_bag
    from slopewise.services.jobs.replay_plan import replay_plan
    from slopewise.services.jobs.replay_summary import summarise
    from slopewise.services.report import replay_page as page

    if not model:
        raise InputError("--plan", "", "expected --model as well, a file or a shipped vehicle")
    if len(logs) != 1 or not is_bag(logs[0]):
        raise InputError(str(logs[0]), "", "expected one recording (.mcap, .db3) with --plan")
    bag = logs[0]
    result = replay_plan(bag, model, guard_decision, topics=topics, speed_up=speed_up)
    summary = summarise(result)
    if report is not None:
        page.write_replay_page(report, result, summary, bag=bag.name, model=model)
    rows = page.cause_cells(summary.statuses) + page.cause_cells(summary.guard, "guard: ")
    tables: list[Any] = [page.verdict(summary), *map(line, summary.notices)]
    head = ("status", "reason, the first time", "cycles", "first, s")
    tables += table(head, rows, left=("reason, the first time",))
    columns = ("from, s", "to, s", "x, y, m", "driven, m/s", "planned, m/s", "reason")
    if summary.slowed:
        tables += table(columns, page.slowed_cells(summary), title="slowed", left=("reason",))
    print_result(as_json, summary, tables, report)


def _play(
    log: DriveLog, session: zenoh.Session, namespace: str, speed_up: float, timeout: float
) -> Counter[tuple[str, str]]:
    """Send all samples; number of batches by status and reason of their receipts."""
    from slopewise.services.cli.ask import ask
    from slopewise.services.jobs.progress import progress_bar
    from slopewise.services.wire.observations import ObservationAck

    receipts: Counter[tuple[str, str]] = Counter()
    t, key = log.columns["t"], f"{namespace}/v1/obs/drive"
    # One sender per run, unless the clock of all runs is the same.
    name, sequence = f"replay-{os.getpid()}-{time.time_ns()}", 0
    with progress_bar("playing", len(t)) as advance:
        for number, part in enumerate(log.runs):
            source = name if log.one_clock else f"{name}-{number}"
            begin, first = time.monotonic(), float(t[part.start])
            for rows in _batches(t, part):
                due = begin + (float(t[rows.stop - 1]) - first) / speed_up
                time.sleep(max(due - time.monotonic(), 0.0))
                sequence += 1
                samples = _samples(log, rows, source, sequence)
                receipt = ask(session, key, ObservationAck, samples, timeout, key)
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


def _tables(played: PlayedLog) -> Iterator[Any]:
    """One row per parameter that changed, and the receipts of rejected samples."""
    factor = played.driven / max(played.took, 1e-9)
    yield (
        f"{plural(played.samples, 'sample')}, {played.driven:.0f} s of driving in "
        f"{played.took:.1f} s ({factor:.0f}-fold); "
        f"version {played.version.before} → {played.version.after}"
    )
    rows = []
    for name, group in played.learned.items():
        for parameter, value in group.after.items():
            if group.before.get(parameter) != value:
                earlier = number(group.before.get(parameter), ".4g")
                std = number(group.stds.get(parameter), ".2g")
                valid = "yes" if group.valid else "no"
                rows.append((name, parameter, earlier, f"{value:.4g}", std, valid))
    if rows:
        head = ("group", "parameter", "before", "after", "± std", "valid")
        yield from table(head, rows, title="what was learned", left=("parameter",))
    else:
        yield "no parameter was changed"
    for receipt in played.receipts:
        if receipt.status != "taken":
            yield line(f"{plural(receipt.batches, 'batch')} {receipt.status}: {receipt.reason}")
