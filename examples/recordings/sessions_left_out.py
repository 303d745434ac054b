"""Held-out sessions of real recordings. `python -m examples.recordings.sessions_left_out DATA`

Each session is predicted by a fit to all others; DATA holds the recordings of
examples/recordings in its folder `stops`.
"""

from __future__ import annotations

import argparse
import itertools
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from scipy.stats import beta

from examples.recordings import cuadriga, f1tenth, husky_drive
from slopewise.models.calibration.held_out import HeldOut, leave_sessions_out
from slopewise.models.calibration.learn import learn
from slopewise.services.io.drive_log import DriveLog, read_drive_log
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv

RECORDINGS: dict[str, tuple[Any, str]] = {
    "Husky": (husky_drive, "stops/drive_norlab"),
    "Cuadriga": (cuadriga, "stops/cuadriga"),
    "F1TENTH": (f1tenth, "stops/f1tenth_frictionmaps"),
}
_SIXTHS = 6
"""Parts of the Husky's windows, which are one after the other and name no session."""


def main() -> None:
    """Print a table, one row per recording and third of its speeds."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("data", type=Path)
    given = parser.parse_args()
    known = read_model(find_model("ugv")).braking
    print(
        f"{'recording':10}{'speeds m/s':>14}{'stops':>7}{'beyond':>8}{'upper 95 %':>12}"
        f"{'excess m':>10}{'of stop':>9}{'endless':>9}"
    )
    for name, (reader, folder) in RECORDINGS.items():
        log = _log(reader.read(given.data / folder))
        runs = list(log.runs)
        sessions = [[run] for run in runs]
        if name == "Husky":
            cuts = [len(runs) * k // _SIXTHS for k in range(_SIXTHS + 1)]
            sessions = [runs[a:b] for a, b in itertools.pairwise(cuts)]
        held = leave_sessions_out(log.columns, sessions, known)
        _rows(name, held)
        learned = learn(log.columns, log.runs, known)
        slow = [w for w in learned.windows if w.held_speed < 0.3]
        print(
            f"{'':10}found {learned.verdicts}, below 0.3 m/s {len(slow)}; "
            f"sessions that the others could not predict: {held.unpredicted}"
        )


def _rows(name: str, held: HeldOut) -> None:
    order = np.argsort(held.speed, kind="stable")
    for part in (order, *np.array_split(order, 3)):
        excess, distance = held.excess[part], held.distance[part]
        ends, beyond = np.isfinite(excess), int(np.sum(excess < 0.0))
        upper = float(beta.ppf(0.95, beyond + 1, len(part) - beyond)) if len(part) else 1.0
        speeds = f"{held.speed[part].min():.2f}–{held.speed[part].max():.2f}"
        print(
            f"{name:10}{speeds:>14}{len(part):7d}{beyond:8d}{upper:12.3f}"
            f"{excess[ends].mean():10.3f}{np.mean(excess[ends] / distance[ends]):9.0%}"
            f"{int((~ends).sum()):9d}"
        )


def _log(columns: dict[str, Any]) -> DriveLog:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "log.csv"
        write_csv({n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}, path)
        return read_drive_log([path])


if __name__ == "__main__":
    main()
