"""Drive logs from BorealTC, a public recording of a Husky A200 on asphalt, ice, loam and snow.

    python examples/borealtc.py path/to/borealtc out/
    slopewise terrain out/*.csv --model examples/borealtc.toml --learn classes.toml

Wheel speeds and currents come at 6.5 Hz, the inertial measurement unit at 100 Hz on a clock of its
own. The offset of the clocks is found by correlating the yaw rate with the difference of the
wheels; where a run never turns it stays 0 and does not matter. The wheel speeds are set points, the
currents magnitudes. Pitch and roll are those of gravity in the accelerations.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slopewise.models.errors import InputError
from slopewise.services.io.table import read_csv, write_csv

TERRAINS = {"ASPHALT": "asphalt", "ICE": "ice", "SANDY_LOAM": "sandy_loam", "SNOW": "snow"}

Floats = NDArray[np.float64]
Columns = dict[str, Floats | list[str]]

_LARGEST_OFFSET, _STEP = 2.0, 0.02  # [s]
_TURNS = 0.03  # [m/s] spread of the difference of the wheels that shows the offset
_GRAVITY_OVER = 2.0  # [s] accelerations are averaged for


def skipped(folder: Path) -> list[tuple[str, str]]:
    """Folders or files that give no drive log, each with the reason."""
    if not folder.is_dir():
        return [(str(folder), "no such folder")]
    rejected = []
    for directory in sorted(path for path in folder.iterdir() if path.is_dir()):
        if directory.name not in TERRAINS:
            rejected.append((directory.name, f"expected one of {', '.join(TERRAINS)}"))
            continue
        wheels = {path.name[4:] for path in directory.glob("pro_*.csv")}
        inertial = {path.name[4:] for path in directory.glob("imu_*.csv")}
        for name in sorted(wheels ^ inertial):
            kind, counterpart = ("pro", "imu") if name in wheels else ("imu", "pro")
            rejected.append(
                (f"{directory.name}/{kind}_{name}", f"there is no {counterpart}_{name}")
            )
    missing = [name for name in TERRAINS if not (folder / name).is_dir()]
    return rejected + [(name, "no such folder here") for name in missing]


def runs(folder: Path) -> list[tuple[str, str, Path, Path]]:
    """(name, terrain, wheels, inertial) of each run that has both files."""
    complete = []
    for directory, terrain in TERRAINS.items():
        for wheels in sorted((folder / directory).glob("pro_*.csv")):
            inertial = wheels.with_name(wheels.name.replace("pro_", "imu_"))
            if inertial.exists():
                name = f"{directory.lower()}_{wheels.stem[-2:]}"
                complete.append((name, terrain, wheels, inertial))
    return complete


def read_run(name: str, terrain: str, wheels: Path, inertial: Path) -> Columns:
    """One run as columns of a drive log, one row per inertial sample."""
    slow = _numbers(wheels, ("time", "curL", "curR", "velL", "velR"))
    fast = _numbers(inertial, ("time", "wx", "wy", "wz", "ax", "ay", "az"))
    t = fast["time"]
    offset = clock_offset(t, fast["wz"], slow["time"], slow["velR"] - slow["velL"])
    latest = np.searchsorted(slow["time"] + offset, t, side="right") - 1
    inside = (latest >= 0) & (t <= slow["time"][-1] + offset + 0.2)
    held = {key: values[latest[inside]] for key, values in slow.items()}
    gravity = {key: _averaged(fast[key], _GRAVITY_OVER)[inside] for key in ("ax", "ay", "az")}
    v = 0.5 * (held["velL"] + held["velR"])
    rows = int(inside.sum())
    return {
        "run": [name] * rows,
        "t": t[inside],
        "v": v,
        "v_cmd": v,
        # the sensor measures minus gravity: nose down makes it point backward
        "pitch": np.arctan2(-gravity["ax"], np.hypot(gravity["ay"], gravity["az"])),
        "roll": np.arctan2(gravity["ay"], gravity["az"]),
        "yaw_rate": fast["wz"][inside],
        "v_left": held["velL"],
        "v_right": held["velR"],
        "current_left": held["curL"],
        "current_right": held["curR"],
        "roll_rate": fast["wx"][inside],
        "pitch_rate": fast["wy"][inside],
        "accel_x": fast["ax"][inside],
        "accel_y": fast["ay"][inside],
        "accel_z": fast["az"][inside],
        "terrain": [terrain] * rows,
    }


def clock_offset(t: Floats, yaw_rate: Floats, slow: Floats, difference: Floats) -> float:
    """Seconds to add to the slow clock so that yaw rate and difference of the wheels agree."""
    if float(np.std(difference)) < _TURNS:
        return 0.0
    smooth = _averaged(yaw_rate, 0.15)
    offsets = np.arange(-_LARGEST_OFFSET, _LARGEST_OFFSET + _STEP, _STEP)
    agree = [np.corrcoef(np.interp(t, slow + o, difference), smooth)[0, 1] for o in offsets]
    return float(offsets[int(np.argmax(agree))])


def _averaged(values: Floats, seconds: float) -> Floats:
    """Moving average of samples at 100 Hz, of what there is at the ends."""
    width = round(100 * seconds) | 1
    kernel = np.ones(min(width, len(values) | 1))
    count = np.convolve(np.ones_like(values), kernel, mode="same")[: len(values)]
    return np.asarray(np.convolve(values, kernel, mode="same")[: len(values)] / count)


def _numbers(path: Path, names: tuple[str, ...]) -> dict[str, Floats]:
    table = read_csv(path)
    table.require(names)
    return {name: table.numbers(name, "SI") for name in names}


def main(folder: str, out: str) -> None:
    """Write a drive log for each run, and report which runs are excluded, with the reason."""
    for source, reason in skipped(Path(folder)):
        print(f"skipped {source}: {reason}")
    written = 0
    Path(out).mkdir(parents=True, exist_ok=True)
    for name, terrain, wheels, inertial in runs(Path(folder)):
        path = Path(out) / f"{name}.csv"
        try:
            columns = read_run(name, terrain, wheels, inertial)
        except InputError as error:
            print(f"skipped {name}: {error}")
            continue
        if not len(columns["t"]):
            print(f"skipped {name}: wheels and inertial unit have no time in common")
            continue
        write_csv(columns, path)
        written += 1
        print(f"wrote {path}")
    if not written:
        sys.exit(
            f"nothing written: expected folders {', '.join(TERRAINS)} with pro_*.csv and "
            f"imu_*.csv in {folder}"
        )


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    main(*sys.argv[1:])
