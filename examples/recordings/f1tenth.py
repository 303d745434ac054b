"""A 1/10 car that was driven by hand with hard stops, as a drive log.

One folder per session, with commandData.csv and odomData.csv: seconds and nanoseconds, then command
or speed. What has to be known:

- commands and speeds have clocks of different rates: the command is the last one before the sample;
- the driver often releases the brakes before the car stands;
- in one session the wheels never follow the command: no stop is lost, none is gained;
- the attitude is in degrees although its description says SI, and the floor is level: pitch is 0.

Run it: ``python -m examples.recordings.f1tenth FOLDER out.csv``.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from examples.recordings.drive_log_table import Columns, joined, main


def read(folder: Path) -> Columns:
    """All sessions in a folder, one run each."""
    sessions = sorted(path.parent for path in folder.glob("*/commandData.csv"))
    if not sessions:
        raise FileNotFoundError(f"no session (*/commandData.csv) in {folder}")
    return joined([_run(session) for session in sessions])


def _run(session: Path) -> Columns:
    command = np.genfromtxt(session / "commandData.csv", delimiter=",", skip_header=1)
    odometry = np.genfromtxt(session / "odomData.csv", delimiter=",", skip_header=1)
    begin = odometry[0, 1]
    time = (odometry[:, 1] - begin) + 1e-9 * odometry[:, 2]
    sent = (command[:, 1] - begin) + 1e-9 * command[:, 2]
    last = np.clip(np.searchsorted(sent, time, side="right") - 1, 0, None)
    return {
        "run": np.full(len(time), session.name),
        "t": time,
        "v": odometry[:, 3],
        "v_cmd": command[last, 3],
        "pitch": np.zeros(len(time)),
    }


if __name__ == "__main__":
    main(read, "FOLDER holds the sessions, each with commandData.csv and odomData.csv")
