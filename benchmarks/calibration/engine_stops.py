"""The paper's Fig. 6 on engines' vehicles: `python -m benchmarks.calibration.engine_stops`

A log of one vehicle is calibrated as `slopewise calibrate` does; fresh stops of the same vehicle,
in the same physics, are compared with the prediction and the allowed distance at a quantile. Two
engines: MuJoCo's four wheels, and the multi-body car of PyPI `commonroad-vehicle-models`; without
hidden effects. The figure's stops begin at 1 to 4 m/s without scatter of the brakes; `--fastest`
and `--scatter` change that.

The allowed distance is integrated over time on the true ground of each fresh stop, by formulas of
this module; from the model file it takes the force reduced by √(φᵀ S φ), the longer dead time and
the constant. Logs have the pitch of a body that dives; with ``ground``, calibration also receives
the grade of a map.
"""

from __future__ import annotations

import argparse
import itertools
import json
from collections.abc import Callable
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import learn
from slopewise.models.parameters import Braking
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.uncertainty import Uncertainty

from ..discrepancy import engine_sets, multibody_sets, worlds
from ..discrepancy.blind_run import runs_of
from ..discrepancy.effect_plant import DrivenStops
from ..discrepancy.plant_physics import Stops
from ..discrepancy.sensing import Columns, log
from ..discrepancy.world_outcomes import WorldSpec

WORLDS: dict[str, worlds.World[Any]] = {
    "MuJoCo, four wheels": engine_sets.ENGINE,
    "multi-body car": multibody_sets.MULTIBODY,
}
_NOISE = 0.02  # [m/s] of the logged speed
_MAP = 0.005  # [rad] error of a map's grade
_STEP, _MAX_STOP = 0.005, 30.0  # [s] of the integration
_MAX_DRAWS = 50  # of stops that are slow enough
# A rough model file, as before any calibration.
_KNOWN = Braking(
    m_m=0.0,
    b_m=0.0,
    m_b=0.0,
    b_b=0.4,
    dead_time=0.25,
    speed_range=(1.0, 4.0),
    grade_range=(-0.26, 0.26),
)


@dataclass(frozen=True, slots=True)
class StopQuery:
    """Conditions of a comparison.

    Attributes:
        stops: number of stops in the log.
        fresh: number of fresh stops.
        scatter: force scatter from stop to stop [1].
        fastest: highest speed at which stops begin; the lowest is 1 m/s [m/s].
        quantile: one-sided probability [1].
    """

    stops: int = 100
    fresh: int = 200
    scatter: float = 0.0
    fastest: float = 4.0
    quantile: float = 0.999


@dataclass(frozen=True, slots=True)
class ComparedStops:
    """Fresh stops of one vehicle compared with their predictions.

    Attributes:
        off: mean of measured less predicted by the model's mean [m].
        beyond: number of stops that are longer than allowed.
        nearest: minimum of allowed less measured [m].
        excess: mean of allowed less measured [m].
        share: excess over the measured distance [1].
        offset: constant of the model [m].
        objections: reasons for which calibration would reject the log.
    """  # words: ok, keys of its JSON

    world: str
    ground: bool
    seed: int
    asked: StopQuery
    off: float  # words: ok
    beyond: int
    nearest: float
    excess: float
    share: float
    offset: float
    objections: tuple[str, ...]


def check_stops(name: str, seed: int, asked: StopQuery, *, ground: bool = False) -> ComparedStops:
    """Calibrate one log, with or without the grade of a map, and compare fresh stops with it."""
    world = WORLDS[name]
    rng = np.random.default_rng([seed, 6])
    scene = _scene(world, asked.stops, asked, rng)
    nature = world.nature(WorldSpec("", seed), scene, rng)
    driven = world.drive(nature, scene)
    columns = log(driven, scene, _NOISE, rng)
    by_map = _mapped(columns, driven, scene, rng) if ground else None
    learned = learn(columns, runs_of(columns), _KNOWN, ground=by_map)
    fresh = _scene(world, asked.fresh, asked, rng)
    actual = world.drive(nature, fresh)
    b = learned.braking
    true_grade = _ground(fresh, actual.station)
    mean = allowed(b, actual, true_grade, 0.5) - b.distance_offset
    margin = allowed(b, actual, true_grade, asked.quantile) - actual.distance
    return ComparedStops(
        name,
        ground,
        seed,
        asked,
        float(np.mean(actual.distance - mean)),
        int(np.sum(margin < 0.0)),
        float(margin.min()),
        float(margin.mean()),
        float(np.mean(margin / actual.distance)),
        b.distance_offset,
        learned.objections,
    )


def _scene(
    world: worlds.World[Any], count: int, asked: StopQuery, rng: np.random.Generator
) -> Stops:
    """Draw stops up to the fastest speed."""
    candidates: Stops = world.scene(count, asked.scatter, rng)
    clock = candidates.clock
    slow_stops = Stops(*(column[:0] for column in candidates))
    for _ in range(_MAX_DRAWS):
        slow = candidates.speed <= asked.fastest
        pairs = zip(slow_stops, candidates, strict=True)
        slow_stops = Stops(*(np.concatenate((column, more[slow])) for column, more in pairs))
        if len(slow_stops.speed) >= count:
            # The clock must increase from stop to stop.
            return Stops(*(column[:count] for column in slow_stops))._replace(clock=clock)
        candidates = world.scene(count, asked.scatter, rng)
    raise ValueError(f"too few stops begin at {asked.fastest:g} m/s or slower")


def _ground(stops: Stops, station: Floats) -> Floats:
    """Grade of the ground at stations since the command, shape (n, samples) [rad]."""
    phase = stops.wave_phase[:, None] + 2.0 * np.pi * station / stops.wave_length[:, None]
    grade: Floats = stops.grade[:, None] + stops.wave[:, None] * np.sin(phase)
    return grade


def _mapped(
    columns: Columns, driven: DrivenStops, stops: Stops, rng: np.random.Generator
) -> Floats:
    """Grade of a map at each row of a log, shape (samples,) [rad]."""
    grade = _ground(stops, driven.station)
    rows = []
    for i, run in enumerate(runs_of(columns)):
        since = columns["t"][run] - stops.clock[i]
        rows.append(np.interp(since, driven.time, grade[i]))
    true = np.concatenate(rows)
    return true + _MAP * rng.standard_normal(len(true))


def allowed(braking: Braking, driven: DrivenStops, grade: Floats, quantile: float) -> Floats:
    """Allowed distance of stops at a quantile, the worst of the model's states, shape (n,) [m].

    Args:
        braking: braking model.
        driven: driven stops.
        grade: grade of the ground, shape (n, samples) [rad].
        quantile: one-sided probability [1].
    """
    uncertainty = Uncertainty(quantile=quantile)
    command = int(np.searchsorted(driven.time, 0.0))
    speed = driven.speed[:, command]
    station = driven.station[:, command:] - driven.station[:, command, None]
    grade = grade[:, command:]
    worst = np.zeros_like(speed)
    for name in ("", *braking.states_of("")):
        on = braking.on(name) if name else braking
        beta = np.array([on.m_m, on.b_m, on.m_b, on.b_b])
        matrix = uncertainty.force_matrix(on)

        def force_on(theta: Floats, beta: Floats = beta, matrix: Floats = matrix) -> Floats:
            x = np.column_stack((speed * theta, theta, speed, np.ones_like(speed)))
            lower: Floats = x @ beta - np.sqrt(np.einsum("ni,ij,nj->n", x, matrix, x))
            return lower

        distance = _stop(speed, uncertainty.dead_time(on), station, grade, force_on)
        worst = np.maximum(worst, distance + on.distance_offset)
    return worst


def _stop(
    speed: Floats,
    dead_time: float,
    station: Floats,
    grade: Floats,
    force_on: Callable[[Floats], Floats],
) -> Floats:
    """Stopping distance, shape (n,) [m]; inf without standstill."""
    distance, v = speed * dead_time, speed.copy()

    def deceleration(s: Floats) -> Floats:
        theta = np.array([np.interp(*row) for row in zip(s, station, grade, strict=True)])
        decel: Floats = GRAVITY * (force_on(theta) + np.sin(theta))
        return decel

    for _ in range(round(_MAX_STOP / _STEP)):
        middle = distance + 0.5 * _STEP * v
        slower = v - _STEP * deceleration(middle)
        stopped = slower <= 0.0
        part = np.where(stopped, v / np.maximum(v - slower, 1e-12), 1.0)
        distance = distance + 0.5 * _STEP * part * (v + np.maximum(slower, 0.0))
        v = np.maximum(slower, 0.0)
        if not v.any():
            return distance
    return np.where(v > 0.0, np.inf, distance)


def main() -> None:
    """Measure, print a table, write JSON on request."""
    default = StopQuery()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="logs of each vehicle")
    parser.add_argument("--stops", type=int, default=default.stops, help="in each log")
    parser.add_argument("--fresh", type=int, default=default.fresh, help="compared with each")
    parser.add_argument("--scatter", type=float, default=default.scatter, help="of the force [1]")
    parser.add_argument("--fastest", type=float, default=default.fastest, help="onset, up to 5 m/s")
    parser.add_argument("--quantile", type=float, default=default.quantile)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    asked = StopQuery(given.stops, given.fresh, given.scatter, given.fastest, given.quantile)
    rows = []
    names = ("grade by", "log", "off m", "beyond", "nearest m", "excess m", "share", "offset m")
    print(f"{'world':22}" + "".join(f"{name:>10}" for name in names))
    for name in WORLDS:
        for ground, seed in itertools.product((False, True), range(given.seeds)):
            row = check_stops(name, seed, asked, ground=ground)
            rows.append(row)
            cells = (
                "map" if ground else "pitch",
                str(seed),
                f"{row.off:.3f}",
                str(row.beyond),
                f"{row.nearest:.3f}",
                f"{row.excess:.3f}",
                f"{row.share:.1%}",
                f"{row.offset:.3f}",
            )
            print(f"{name:22}" + "".join(f"{value:>10}" for value in cells), flush=True)
            for reason in row.objections:
                print(f"  rejected: {reason}")
    if given.json:
        given.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()
