"""Held-out sessions of real recordings. `python -m examples.recordings.sessions_left_out DATA`

Each session is predicted by a fit to all others, and by what an engineer would write in twenty
lines: a regression of ln d on ln v with the variance of sessions and Student's t. Stretched, these
bounds are longer by the factor with which they keep their promise on this recording. DATA holds the
recordings of examples/recordings in its folder `stops`.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np

from benchmarks.calibration.brake_kinds import StopLog
from benchmarks.calibration.margins import twenty_lines
from examples.recordings import cuadriga, f1tenth, husky_drive
from slopewise.models.arrays import Floats
from slopewise.models.calibration.coverage import allowed_distance
from slopewise.models.calibration.learn import learn
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.services.io.drive_log import DriveLog, read_drive_log
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv

QUANTILES = (0.9, 0.99)  # promised [1]
_SIXTHS = 6
"""Parts of the Husky's windows, which are one after the other and name no session."""
_MIN_STOPS = 6
"""Stops of other sessions from which the twenty lines are fitted."""


class HeldOut(NamedTuple):
    """Stops of sessions that the prediction had not seen, (n, Q) each [m].

    Attributes:
        excess: distance that plans allow minus the actual one. peer: the same of twenty lines.
        distance: (n,) actual. refused: sessions that the others could not predict.
    """

    excess: Floats
    peer: Floats
    distance: Floats
    refused: int


def main() -> None:
    """Print a table, one row per recording and share promised."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    data = parser.parse_args().data
    known = read_model(find_model("ugv")).braking
    print(
        f"{'recording':10}{'sessions':>9}{'refused':>8}{'stops':>6}{'mean stop m':>12}{'share':>7}"
        f"{'beyond':>8}{'excess m':>10}{'20 lines: beyond':>18}{'excess m':>10}{'stretched m':>13}"
    )
    for name, log, sessions in recordings(data):
        held = leave_sessions_out(log, sessions, known)
        for k, share in enumerate(QUANTILES):
            ours, peer = held.excess[:, k], held.peer[:, k]
            bound = peer + held.distance
            stretch = max(float(np.quantile(held.distance / bound, share)), 1.0)
            stretched = float(np.mean(stretch * bound - held.distance))
            print(
                f"{name:10}{len(sessions):9d}{held.refused:8d}{len(ours):6d}"
                f"{held.distance.mean():12.2f}{share:7.2f}{int(np.sum(ours < 0.0)):8d}"
                f"{ours.mean():10.2f}{int(np.sum(peer < 0.0)):18d}{peer.mean():10.2f}"
                f"{stretched:13.2f}"
            )


def recordings(data: Path) -> Iterator[tuple[str, DriveLog, list[list[slice]]]]:
    """Name, log, and the runs of each session."""
    warthog = read_drive_log([data / "stops/warthog_norlab/drive.csv"])
    days = np.array([str(warthog.columns["session"][run.start]) for run in warthog.runs])
    by_day = [
        [r for r, d in zip(warthog.runs, days, strict=True) if d == x] for x in sorted({*days})
    ]
    yield "Warthog", warthog, by_day
    husky = log_of(husky_drive.read(data / "stops/drive_norlab"))
    cuts = [len(husky.runs) * k // _SIXTHS for k in range(_SIXTHS + 1)]
    yield "Husky", husky, [list(husky.runs[a:b]) for a, b in itertools.pairwise(cuts)]
    for name, reader, folder in (
        ("Cuadriga", cuadriga, "stops/cuadriga"),
        ("F1TENTH", f1tenth, "stops/f1tenth_frictionmaps"),
    ):
        log = log_of(reader.read(data / folder))
        yield name, log, [[run] for run in log.runs]


def leave_sessions_out(
    log: DriveLog, sessions: Sequence[Sequence[slice]], known: Braking
) -> HeldOut:
    """Predict each session by all others; stops are measured as in the whole log."""
    columns = log.columns
    calibration = learn(columns, [run for runs in sessions for run in runs], known)
    records = [r for surface in calibration.surfaces for r in surface.records]
    owner = np.array([_session_of(r, sessions) for r in records])
    excess, peer, actual, refused = [], [], [], 0
    for k in range(len(sessions)):
        out = [r for r, o in zip(records, owner, strict=True) if o == k]
        if not out:
            continue
        rest = [run for k_other, more in enumerate(sessions) if k_other != k for run in more]
        try:
            learned = learn(columns, rest, known)
        except ParameterError:
            refused += 1
            continue
        rolling = 0.0 if learned.levels is None else learned.levels.resistance
        excess += [
            [
                allowed_distance(learned.braking, r, q, rolling) - r.samples.distance
                for q in QUANTILES
            ]
            for r in out
        ]
        bounds = _twenty_lines(
            [r for r, o in zip(records, owner, strict=True) if o != k], out, owner[owner != k]
        )
        actual += [r.samples.distance for r in out]
        peer += (bounds - np.array(actual[-len(out) :])[:, None]).tolist()
    shape = (-1, len(QUANTILES))
    return HeldOut(
        np.array(excess).reshape(shape), np.array(peer).reshape(shape), np.array(actual), refused
    )


def _session_of(record: StopRecord, sessions: Sequence[Sequence[slice]]) -> int:
    at = record.samples.window.command
    return next(
        k for k, runs in enumerate(sessions) if any(run.start <= at < run.stop for run in runs)
    )


def _twenty_lines(rest: list[StopRecord], out: list[StopRecord], owner: Any) -> Floats:
    """(n, Q) bounds [m]; infinite from too few stops."""
    if len(rest) < _MIN_STOPS:
        return np.full((len(out), len(QUANTILES)), np.inf)
    speed, grade, distance = _columns(rest)
    session = np.unique(owner, return_inverse=True)[1].astype(np.int64)
    log = StopLog({}, [], grade, speed, grade, distance, session)
    return np.column_stack([twenty_lines(log, *_columns(out)[:2], q) for q in QUANTILES])


def _columns(records: list[StopRecord]) -> tuple[Floats, Floats, Floats]:
    rows = [(r.samples.window.held_speed, r.mean_grade, r.samples.distance) for r in records]
    speed, grade, distance = np.array(rows).T
    return speed, grade, distance


def log_of(columns: dict[str, Any]) -> DriveLog:
    """The log of columns, as read from a file."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write_csv({n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}, path)
        return read_drive_log([path])


if __name__ == "__main__":
    main()
