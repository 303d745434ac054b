"""A speed that contradicts the positions is named, with its size; slip while braking is not."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.calibration.learn import measure_log
from tests.models.calibration.plant import Plant, drive
from tests.world.vehicles import BASE

_STEP = 0.05  # [s] between rows
_AHEAD = 120  # rows that each run is driven before its stop


def notes(scale: float, *, position_noise: float = 0.0, turn: float = 0.0) -> list[str]:
    """Notes on v of a log whose speed is ``scale`` times that of its positions.

    The vehicle drives on circles of curvature ``turn`` [1/m], and its wheels slip by 40 % in stops.
    """
    columns, runs, _ = drive(Plant(hz=1.0 / _STEP, speed_noise=0.02), 20, 3)
    rng, parts = np.random.default_rng(1), []
    for run in runs:
        log = {name: values[run] for name, values in columns.items()}
        log = {k: np.concatenate((np.full(_AHEAD, v[0]), v)) for k, v in log.items()}
        log["t"] = log["t"][0] + _STEP * np.arange(len(log["t"]))
        true = log["v"] / scale * np.where(log["v_cmd"] == 0.0, 1.4, 1.0)
        way = np.cumsum(_STEP * true)
        log["x"] = np.sin(turn * way) / turn if turn else way
        log["y"] = (1.0 - np.cos(turn * way)) / turn if turn else 0.0 * way
        for name in ("x", "y"):
            log[name] = log[name] + position_noise * rng.standard_normal(len(way))
        parts.append(log)
    joined = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    ends = np.cumsum([len(part["t"]) for part in parts])
    cut = [slice(int(b) - len(p["t"]), int(b)) for b, p in zip(ends, parts, strict=True)]
    every = measure_log(joined, cut, BASE.braking, min_stops=0).notes
    return [note for note in every if "x, y" in note]


@pytest.mark.parametrize("scale", [0.75, 1.25])
@pytest.mark.parametrize("position_noise", [0.0, 0.1])
def test_a_speed_that_is_off_by_a_quarter_is_named(scale: float, position_noise: float) -> None:
    (note,) = notes(scale, position_noise=position_noise)
    assert float(note.split("travels ")[1].split(" ")[0]) == pytest.approx(scale, abs=0.02)


@pytest.mark.parametrize(
    ("scale", "position_noise", "turn"),
    [(1.0, 0.0, 0.0), (1.0, 0.3, 0.0), (1.0, 0.0, 0.3), (1.05, 0.1, 0.1), (0.95, 0.1, 0.0)],
)
def test_a_speed_that_agrees_is_not(scale: float, position_noise: float, turn: float) -> None:
    assert not notes(scale, position_noise=position_noise, turn=turn)
