"""A Husky whose wheel speeds were stepped to identify its drive, as a drive log.

One CSV at 20 Hz, windows of two seconds one after the other. What has to be known:

- commands and speeds are of the wheels, in rad/s; the vehicle's are their mean;
- speeds and commands differ by a factor: only the time of a stop command is used;
- commands step from one direction straight to the other. The way to standstill is the same as that
  of a stop, so a reversal is written as a stop, and driving backwards as driving forwards;
- most steps turn as well, so no yaw rate is written: straight stops alone would be too few;
- where a window does not continue the one before it, a new run begins.

Run it: ``python -m examples.recordings.husky_drive FOLDER out.csv``.
"""

from __future__ import annotations

import itertools
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from examples.recordings.drive_log_table import Columns, joined, main

_RADIUS = 0.165  # [m]
_STEP = 0.05  # [s]
_CONTINUES = 0.4  # [m/s] change from one window to the next
_BEFORE, _AFTER = 40, 80  # samples around a change of the command
_ROLLING = 0.3  # [m/s]


def read(folder: Path) -> Columns:
    """Every stop and reversal, one run each."""
    table = np.genfromtxt(folder / "husky_drive_windows.csv", delimiter=",", names=True)
    speed = 0.5 * _RADIUS * (table["left_wheel_vel"] + table["right_wheel_vel"])
    command = 0.5 * _RADIUS * (table["cmd_left"] + table["cmd_right"])
    pitch = table["init_icp_pitch"] + table["icp_pitch"]
    broken = np.flatnonzero(np.abs(np.diff(speed)) > _CONTINUES) + 1
    edges = np.concatenate(([0], broken, [len(speed)]))
    runs = []
    for begin, end in itertools.pairwise(edges):
        part = slice(begin, end)
        runs += _stops(speed[part], command[part], pitch[part], len(runs))
    return joined(runs, pause=5.0)


def _stops(
    speed: NDArray[np.float64], command: NDArray[np.float64], pitch: NDArray[np.float64], first: int
) -> list[Columns]:
    runs: list[Columns] = []
    for k in (np.flatnonzero(np.abs(np.diff(command)) > 1e-6) + 1).tolist():
        begin, end = max(k - _BEFORE, 0), min(k + _AFTER, len(speed))
        later = np.flatnonzero(np.abs(np.diff(command[k:end])) > 1e-6)
        end = k + int(later[0]) + 1 if len(later) else end
        direction = np.sign(speed[max(k - 4, 0) : k + 1].mean())
        rolling = np.abs(speed[max(k - 4, 0) : k + 1].mean()) >= _ROLLING
        if not rolling or command[k] * direction > 0.02 or k - begin < 4:
            continue
        commands = np.maximum(command[begin:end] * direction, 0.0)
        runs.append(
            {
                "run": np.full(end - begin, str(first + len(runs))),
                "t": _STEP * np.arange(end - begin),
                "v": speed[begin:end] * direction,
                "v_cmd": np.where(np.arange(begin, end) < k, np.maximum(commands, 0.05), 0.0),
                "pitch": pitch[begin:end] * direction,
            }
        )
    return runs


if __name__ == "__main__":
    main(read, "FOLDER holds husky_drive_windows.csv")
