"""The paper's Fig. 6 on engines' vehicles: `python -m benchmarks.calibration.engine_stops`

A log of one vehicle is calibrated as `slopewise calibrate` does; fresh stops of the same vehicle,
driven in the same physics, are held against what the model predicts and what a plan allows at a
quantile. Two engines: MuJoCo's four wheels, and the multi-body car of PyPI
`commonroad-vehicle-models`. Nothing hidden acts in either. The figure's stops begin at 1 to 4 m/s
and no scatter of the brakes is added to its engine; `--fastest` and `--scatter` ask for more.

The allowance is integrated over time on the ground that each fresh stop really met, by formulas of
its own; from the model file it takes the force lower by √(φᵀ S φ), the longer dead time and the
constant. Logs have the pitch of a body that dives; with ``ground`` calibration is given the ground
under it, too, as a map would.
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

from benchmarks.discovery import engine_sets, multibody_sets, worlds
from benchmarks.discovery.physics import Stops
from benchmarks.discovery.plant import DrivenStops
from benchmarks.discovery.sealed import runs_of
from benchmarks.discovery.sensing import Columns, log
from benchmarks.discovery.world_outcomes import WorldOrder
from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import learn
from slopewise.models.parameters import Braking
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.uncertainty import Uncertainty

WORLDS: dict[str, worlds.World[Any]] = {
    "MuJoCo, four wheels": engine_sets.ENGINE,
    "multi-body car": multibody_sets.MULTIBODY,
}
_NOISE = 0.02  # [m/s] of the logged speed
_MAP = 0.005  # [rad] error of a map's grade
_STEP, _LONGEST = 0.005, 30.0  # [s]
_DRAWS = 50
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
class Question:
    """What is driven and asked.

    Attributes:
        stops: in the log. fresh: held against it. scatter: of the force from stop to stop [1].
        fastest: speed at which stops begin, 1 m/s being the slowest [m/s]. quantile: one-sided.
    """

    stops: int = 100
    fresh: int = 200
    scatter: float = 0.0
    fastest: float = 4.0
    quantile: float = 0.999


@dataclass(frozen=True, slots=True)
class HeldStops:
    """Fresh stops of one vehicle beside their predictions.

    Attributes:
        off: mean of measured less predicted by the model's mean [m].
        beyond: stops that are longer than allowed. nearest: least of allowed less measured [m].
        excess: mean of allowed less measured [m]; share: of the measured distance.
        offset: constant of the model [m]. objections: why calibration would refuse the log.
    """

    world: str
    ground: bool
    seed: int
    asked: Question
    off: float
    beyond: int
    nearest: float
    excess: float
    share: float
    offset: float
    objections: tuple[str, ...]


def hold(name: str, seed: int, asked: Question, *, ground: bool = False) -> HeldStops:
    """Calibrate one log, with or without the ground of a map, and hold fresh stops against it."""
    world = WORLDS[name]
    rng = np.random.default_rng([seed, 6])
    scene = _scene(world, asked.stops, asked, rng)
    nature = world.nature(WorldOrder("", seed), scene, rng)
    driven = world.drive(nature, scene)
    columns = log(driven, scene, _NOISE, rng)
    by_map = _mapped(columns, driven, scene, rng) if ground else None
    learned = learn(columns, runs_of(columns), _KNOWN, ground=by_map)
    drawn = _scene(world, asked.fresh, asked, rng)
    actual = world.drive(nature, drawn)
    b = learned.braking
    met = _ground(drawn, actual.station)
    mean = allowed(b, actual, met, 0.5) - b.distance_offset
    most = allowed(b, actual, met, asked.quantile)
    spare = most - actual.distance
    return HeldStops(
        name,
        ground,
        seed,
        asked,
        float(np.mean(actual.distance - mean)),
        int(np.sum(spare < 0.0)),
        float(spare.min()),
        float(spare.mean()),
        float(np.mean(spare / actual.distance)),
        b.distance_offset,
        learned.objections,
    )


def _scene(
    world: worlds.World[Any], count: int, asked: Question, rng: np.random.Generator
) -> Stops:
    """So many stops that do not begin faster than asked."""
    drawn: Stops = world.scene(count, asked.scatter, rng)
    clock, kept = drawn.clock, Stops(*(column[:0] for column in drawn))
    for _ in range(_DRAWS):
        slow = drawn.speed <= asked.fastest
        pairs = zip(kept, drawn, strict=True)
        kept = Stops(*(np.concatenate((column, more[slow])) for column, more in pairs))
        if len(kept.speed) >= count:
            # The clock of a stop tells its run, and goes on from stop to stop.
            return Stops(*(column[:count] for column in kept))._replace(clock=clock)
        drawn = world.scene(count, asked.scatter, rng)
    raise ValueError(f"too few stops begin at {asked.fastest:g} m/s or slower")


def _ground(stops: Stops, station: Floats) -> Floats:
    """(n, samples) grade of the ground at stations since the command [rad]."""
    phase = stops.wave_phase[:, None] + 2.0 * np.pi * station / stops.wave_length[:, None]
    grade: Floats = stops.grade[:, None] + stops.wave[:, None] * np.sin(phase)
    return grade


def _mapped(
    columns: Columns, driven: DrivenStops, stops: Stops, rng: np.random.Generator
) -> Floats:
    """(samples,) grade by a map at each row of a log."""
    grade = _ground(stops, driven.station)
    rows = []
    for i, run in enumerate(runs_of(columns)):
        since = columns["t"][run] - stops.clock[i]
        rows.append(np.interp(since, driven.time, grade[i]))
    true = np.concatenate(rows)
    return true + _MAP * rng.standard_normal(len(true))


def allowed(braking: Braking, driven: DrivenStops, grade: Floats, quantile: float) -> Floats:
    """(n,) how far stops may go by a model file at a quantile [m], the worst of its states.

    Args:
        braking: of the model file. driven: stops. grade: (n, samples) of the ground [rad].
        quantile: one-sided.
    """
    told = Uncertainty(quantile=quantile)
    command = int(np.searchsorted(driven.time, 0.0))
    speed = driven.speed[:, command]
    station = driven.station[:, command:] - driven.station[:, command, None]
    grade = grade[:, command:]
    worst = np.zeros_like(speed)
    for name in ("", *braking.states_of("")):
        on = braking.on(name) if name else braking
        beta = np.array([on.m_m, on.b_m, on.m_b, on.b_b])
        matrix = told.force_matrix(on)

        def force_on(theta: Floats, beta: Floats = beta, matrix: Floats = matrix) -> Floats:
            x = np.column_stack((speed * theta, theta, speed, np.ones_like(speed)))
            lower: Floats = x @ beta - np.sqrt(np.einsum("ni,ij,nj->n", x, matrix, x))
            return lower

        way = _stop(speed, told.dead_time(on), station, grade, force_on)
        worst = np.maximum(worst, way + on.distance_offset)
    return worst


def _stop(
    speed: Floats,
    dead_time: float,
    station: Floats,
    grade: Floats,
    force_on: Callable[[Floats], Floats],
) -> Floats:
    """(n,) way until rest [m]; inf where a stop does not end."""
    way, v = speed * dead_time, speed.copy()

    def deceleration(s: Floats) -> Floats:
        theta = np.array([np.interp(*one) for one in zip(s, station, grade, strict=True)])
        found: Floats = GRAVITY * (force_on(theta) + np.sin(theta))
        return found

    for _ in range(round(_LONGEST / _STEP)):
        middle = way + 0.5 * _STEP * v
        slower = v - _STEP * deceleration(middle)
        rests = slower <= 0.0
        part = np.where(rests, v / np.maximum(v - slower, 1e-12), 1.0)
        way = way + 0.5 * _STEP * part * (v + np.maximum(slower, 0.0))
        v = np.maximum(slower, 0.0)
        if not v.any():
            return way
    return np.where(v > 0.0, np.inf, way)


def main() -> None:
    """Measure, print a table, write JSON where asked."""
    usual = Question()
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="logs of each vehicle")
    parser.add_argument("--stops", type=int, default=usual.stops, help="in each log")
    parser.add_argument("--fresh", type=int, default=usual.fresh, help="held against each")
    parser.add_argument("--scatter", type=float, default=usual.scatter, help="of the force [1]")
    parser.add_argument("--fastest", type=float, default=usual.fastest, help="onset, up to 5 m/s")
    parser.add_argument("--quantile", type=float, default=usual.quantile)
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    asked = Question(given.stops, given.fresh, given.scatter, given.fastest, given.quantile)
    rows = []
    names = ("grade by", "log", "off m", "beyond", "nearest m", "excess m", "share", "offset m")
    print(f"{'world':22}" + "".join(f"{name:>10}" for name in names))
    for name in WORLDS:
        for ground, seed in itertools.product((False, True), range(given.seeds)):
            held = hold(name, seed, asked, ground=ground)
            rows.append(held)
            told = (
                "map" if ground else "pitch",
                str(seed),
                f"{held.off:.3f}",
                str(held.beyond),
                f"{held.nearest:.3f}",
                f"{held.excess:.3f}",
                f"{held.share:.1%}",
                f"{held.offset:.3f}",
            )
            print(f"{name:22}" + "".join(f"{value:>10}" for value in told), flush=True)
            for words in held.objections:
                print(f"  refused: {words}")
    if given.json:
        given.json.write_text(json.dumps([asdict(row) for row in rows], indent=1))


if __name__ == "__main__":
    main()
