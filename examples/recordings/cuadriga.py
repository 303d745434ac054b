"""Cuadriga, a skid-steered rover on slopes of ±15°, as a drive log.

Text files at 10 Hz without a header: linear and angular reference, two encoders, two currents,
roll, pitch, yaw [deg], latitude, longitude, an unknown one, course [deg], GPS speed, GPS accuracy,
time of day. What has to be known:

- the encoders hold each value for seconds and −1000 stands for none, so that they cannot show a
  stop; the speed is that of the GPS, which comes in knots;
- a reference of 75 is about 0.5 m/s;
- the attitude sensor is mounted about 13.7° askew in pitch, nose up positive.

Run it: ``python -m examples.recordings.cuadriga FOLDER out.csv``; then
``slopewise calibrate out.csv --model ugv``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from examples.recordings.drive_log_table import Columns, joined, main

_KNOT = 0.514444  # [m/s]
_SPEED_OF_REFERENCE = 0.5 / 75.0  # [m/s]
_MOUNT = np.deg2rad(-13.7)
_METRES_PER_DEGREE = 111_195.0
_COLUMNS = 16


def read(folder: Path) -> Columns:
    """All recordings in a folder and below it, one run each, in the order of their names."""
    files = sorted(folder.rglob("*.txt"))
    if not files:
        raise FileNotFoundError(f"no recording (*.txt) in {folder}")
    return joined([_run(path) for path in files])


def _run(path: Path) -> Columns:
    rows = [line.split() for line in path.read_text().splitlines()]
    rows = [row for row in rows if len(row) == _COLUMNS]
    values = np.array([[float(cell) for cell in row[:-1]] for row in rows])
    time = np.array([_seconds(row[-1]) for row in rows])
    later = np.concatenate(([True], np.diff(np.maximum.accumulate(time)) > 0.0))
    values, time = values[later], time[later]
    reference, speed = values[:, 0] * _SPEED_OF_REFERENCE, values[:, 13] * _KNOT
    backwards = np.where(reference < 0.0, -1.0, 1.0)
    latitude, longitude = values[:, 9], values[:, 10]
    east = _METRES_PER_DEGREE * np.cos(np.deg2rad(latitude[0]))
    return {
        "run": np.full(len(time), f"{path.parent.name}/{path.stem}"),
        "t": time,
        "v": speed * backwards,
        "v_cmd": reference,
        "pitch": -(np.deg2rad(values[:, 7]) - _MOUNT),
        "roll": np.deg2rad(values[:, 6]),
        "yaw": np.unwrap(np.deg2rad(90.0 - values[:, 8])),
        "x": (longitude - longitude[0]) * east,
        "y": (latitude - latitude[0]) * _METRES_PER_DEGREE,
        "encoder_left": values[:, 2],
        "encoder_right": values[:, 3],
    }


def _seconds(clock: str) -> float:
    hours, minutes, seconds = clock.split(":")
    return 3600.0 * int(hours) + 60.0 * int(minutes) + float(seconds)


if __name__ == "__main__":
    main(read, "FOLDER holds the recordings of Cuadriga, *.txt")
