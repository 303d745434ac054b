"""The example readers on the public recordings: stops counted by eye, held-out sessions."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.stats import binom

from examples.recordings import cuadriga, f1tenth, husky_drive
from examples.recordings.sessions_left_out import QUANTILES, leave_sessions_out, recordings
from slopewise.models.calibration.learn import learn
from slopewise.models.calibration.speed_error import speed_error
from slopewise.models.stop_logs.drive_quality import find_suspects, usable
from slopewise.services.io.drive_log import DriveLog, read_drive_log
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.table import write_csv
from tests.services.faults import real_data

KNOWN = read_model(find_model("ugv")).braking


def log_of(columns: dict[str, np.ndarray], path: Path) -> DriveLog:
    write_csv({n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}, path)
    return read_drive_log([path])


# Counted by eye on plots of speed and command over time, commands to stop at 0.3 m/s or faster:
# Husky: changes of direction, or stops, from a plateau of at least 0.3 m/s: 72 or 73.
# Cuadriga, forward: 23, one of them at 0.25 m/s, seven that drove on or slowed down gradually.
# Car: 13, 4 and 4 in the first three sessions, and 141 in the fourth, most of them released early.
@pytest.mark.parametrize(
    ("reader", "folder", "by_eye", "min_usable"),
    [
        (husky_drive, "stops/drive_norlab", 73, 60),
        (cuadriga, "stops/cuadriga", 23, 13),
        (f1tenth, "stops/f1tenth_frictionmaps", 162, 12),
    ],
)
def test_stops_are_found_as_an_eye_finds_them(
    tmp_path: Path, reader: object, folder: str, by_eye: int, min_usable: int
) -> None:
    columns = reader.read(real_data(folder))  # type: ignore[attr-defined]
    log = log_of(columns, tmp_path / "log.csv")
    learned = learn(log.columns, log.runs, KNOWN)
    forward = [w for w in learned.windows if w.direction > 0]
    assert len(forward) == pytest.approx(by_eye, rel=0.1)
    assert learned.verdicts["usable"] >= min_usable
    assert 0.0 <= learned.dead_time.value < 0.8
    low, high = learned.braking.speed_range
    assert learned.braking.level_force(0.5 * (low + high)) > 0.03


@pytest.mark.parametrize("name", ["Warthog", pytest.param("Husky", marks=pytest.mark.nightly)])
def test_stops_of_sessions_left_out_keep_their_promise(name: str) -> None:
    """At most what a binomial count of the promised share exceeds once in a hundred recordings."""
    log, sessions = next(rest for n, *rest in recordings(real_data(".")) if n == name)
    held = leave_sessions_out(log, sessions, KNOWN)
    count = len(held.distance)
    assert count >= 60
    assert held.refused == 0
    for k, share in enumerate(QUANTILES):
        assert np.sum(held.excess[:, k] < 0.0) <= binom.ppf(0.99, count, 1.0 - share)
    assert held.excess[:, 1].mean() < 1.6 * held.peer[:, 1].mean()


def test_how_well_real_vehicles_hold_a_speed(tmp_path: Path) -> None:
    """Cuadriga drives long stretches at one command; the Husky's windows change it every 6 s."""
    log = log_of(cuadriga.read(real_data("stops/cuadriga")), tmp_path / "slopes.csv")
    usable_samples = usable(
        len(log.columns["t"]), find_suspects(log.columns, log.runs), ["v", "v_cmd"]
    )
    error = speed_error(log.columns, log.runs, usable_samples)
    assert 0.03 < error.value < 0.08
    assert abs(error.bias) < 0.01
    assert error.stretches > 30
    windows = log_of(husky_drive.read(real_data("stops/drive_norlab")), tmp_path / "windows.csv")
    assert (
        speed_error(windows.columns, windows.runs, np.ones(len(windows.columns["t"]), bool)) is None
    )


def test_folders_without_recordings_say_so(tmp_path: Path) -> None:
    for reader in (cuadriga, f1tenth):
        with pytest.raises(FileNotFoundError, match=str(tmp_path)):
            reader.read(tmp_path)
