"""A drive log in which something is hidden, for the tutorial docs/tutorials/hidden-effect.md.

    python examples/hidden_effect.py out/hidden
    slopewise discrepancy out/hidden/drive.csv --model atv --out out/hidden/found

Ninety stops on a gentle hill, every sample with noise. Somewhere the grass is wet.
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from slopewise import Model, read_model
from slopewise.models.parameters import Effect
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from slopewise.services.io.table import write_csv

Floats = NDArray[np.float64]

STOPS = 90
SIDE = 60.0  # [m] of the field
WET = Effect(
    name="surface_patch", parameters={"delta": -0.12, "x": 38.0, "y": 26.0, "radius": 11.0}
)
_HZ = 50.0
_LEAD, _TAIL = 1.0, 0.8  # [s]
_NOISE, _PITCH_NOISE, _SCATTER = 0.02, 0.003, 0.02  # [m/s], [rad], share of the force


def height(x: Floats, y: Floats) -> Floats:
    """Of the ground [m]."""
    return 1.6 * np.sin(x / 11.0) * np.cos(y / 14.0)


def main(folder: Path) -> None:
    """Write drive.csv, map.npz and path.csv."""
    folder.mkdir(parents=True, exist_ok=True)
    model = read_model("atv")
    rng = np.random.default_rng(7)
    parts = []
    clock = 0.0
    for run in range(STOPS):
        part = _stop(replace(model, effect=(WET,)), run, clock, rng)
        clock = float(part["t"][-1]) + 20.0
        parts.append(part)
    columns = {n: np.concatenate([p[n] for p in parts]) for n in parts[0]}
    table = {n: list(v) if v.dtype.kind in "UO" else v for n, v in columns.items()}
    write_csv(table, folder / "drive.csv")
    grid = np.arange(0.0, SIDE + 0.25, 0.5)
    x, y = np.meshgrid(grid, grid)
    np.savez(
        folder / "map.npz", elevation=height(x, y), resolution=0.5, origin=np.array([0.0, 0.0])
    )
    line = np.linspace(31.0, SIDE - 4.0, 51)
    write_csv({"x": line, "y": np.full_like(line, 26.0)}, folder / "path.csv")
    print(f"wrote drive.csv, map.npz and path.csv to {folder}")


def _stop(model: Model, run: int, clock: float, rng: np.random.Generator) -> dict[str, Floats]:
    speed, yaw = rng.uniform(1.2, 3.9), rng.uniform(-np.pi, np.pi)
    x0, y0 = rng.uniform(12.0, SIDE - 12.0, 2)
    along = np.linspace(-5.0, 12.0, 171)
    x, y = x0 + along * np.cos(yaw), y0 + along * np.sin(yaw)
    grade = np.arctan(np.gradient(height(x, y), along))
    left = height(x - 0.1 * np.sin(yaw), y + 0.1 * np.cos(yaw)) - height(x, y)
    roll = np.arctan(left / 0.1)
    zero = np.zeros_like(along)
    friction = 1.0 + _SCATTER * rng.standard_normal()
    on = model.braking
    stronger = replace(on, b_b=on.b_b * friction, covariance=None)
    stop = simulate_stop(
        replace(model, braking=stronger),
        GroundTrack(along, grade, roll, zero + yaw, zero, x, y),
        speed,
    )
    t = np.arange(-_LEAD, stop.time[-1] + _TAIL, 1.0 / _HZ)
    v = np.where(t < 0.0, speed, stop.speed_at(np.maximum(t, 0.0)))
    station = np.where(t < 0.0, speed * t, np.interp(t, stop.time, stop.station))
    return {
        "run": np.full(len(t), str(run)),
        "t": clock + t + _LEAD,
        "v": v + _NOISE * rng.standard_normal(len(t)),
        "v_cmd": np.where(t < -1e-9, speed, 0.0),
        "pitch": -np.interp(station, along, grade) + _PITCH_NOISE * rng.standard_normal(len(t)),
        "roll": np.interp(station, along, roll) + _PITCH_NOISE * rng.standard_normal(len(t)),
        "yaw": np.full(len(t), yaw),
        "x": np.interp(station, along, x),
        "y": np.interp(station, along, y),
    }


if __name__ == "__main__":
    if len(sys.argv) != 2 or sys.argv[1].startswith("-"):
        sys.exit("usage: python examples/hidden_effect.py FOLDER")
    main(Path(sys.argv[1]))
