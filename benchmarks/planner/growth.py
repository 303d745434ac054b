"""How the cost of planning grows: exponents over candidates, stations, map, noise and surfaces.

One number is changed at a time, the others stay. An exponent is the slope of log(time) over
log(number), by least squares: 1 is in proportion, 0 does not grow. Times are least processor times
of one thread, so that a busy machine changes them little.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import count
from time import process_time
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.averaged_map import averaged_map
from slopewise.planner.path import EvenPath, side_by_side
from slopewise.planner.pipeline.candidates import finished
from slopewise.planner.pipeline.time_optimal_batch import TimeOptimalBatch, time_optimal_batch

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.scene import SPACING, atv
from ..common.text_tables import duration, table_of
from ..common.timing import machine

_CELL = 0.2  # [m] finer than a wheel, so that the swept footprint is checked in full
_EDGE, _CANDIDATES, _STATIONS = 40.0, 64, 60  # of what is not changed: map [m], paths of 15 m
_AREAS = (1600.0, 6400.0, 25600.0, 57600.0)  # of maps, up to 240 m along an edge [m²]
_LIMIT = 1.2  # exponent up to which a cost counts as in proportion [1]: caches of the processor end


class Case(NamedTuple):
    """One ground with its paths, and what is timed on it."""

    prepare: Callable[[], Any]  # called untimed before each action, of which it is the argument
    action: Callable[[Any], object]


class Cost(NamedTuple):
    """Action that is timed over one number: name, unit, values, the case of each."""

    name: str
    unit: str
    values: tuple[float, ...]
    case: Callable[[float], Case]


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Time all costs; the quick run takes some ten seconds."""
    rounds = 4 if request.quick else 15
    rows = []
    for cost in tracked(progress, "growth", tuple(_costs())):
        values = cost.values[:-1] if request.quick else cost.values
        seconds = [_min_time(cost.case(value), rounds) for value in values]
        exponent = float(np.polyfit(np.log(values), np.log(seconds), 1)[0])
        row = {"name": cost.name, "unit": cost.unit, "values": list(values)}
        rows.append(row | {"seconds": seconds, "exponent": exponent})
    return {"quick": request.quick, "machine": machine(), "growth": rows}


def show(result: Result, console: Console) -> None:
    title = "Growth of the cost: least processor times, one thread"
    table = table_of(title, "from … to", "time", "exponent")
    for row in result["growth"]:
        (first, *_, last), (begin, *_, end) = row["values"], row["seconds"]
        span = f"{first:g} … {last:g} {row['unit']}".strip()
        mark = "" if row["exponent"] <= _LIMIT else " [red]more than in proportion"
        times = f"{duration(begin)} … {duration(end)}"
        table.add_row(row["name"], span, times, f"{row['exponent']:.2f}{mark}")
    console.print(table)


def _min_time(case: Case, rounds: int) -> float:
    times = []
    for _ in range(rounds):
        argument = case.prepare()
        start = process_time()
        case.action(argument)
        times.append(process_time() - start)
    return min(times)


def _costs() -> Iterator[Cost]:
    model = atv()

    def known(candidates: int = _CANDIDATES, stations: int = _STATIONS, **ground: Any) -> Case:
        """A batch on a map that was planned on before."""
        batch = _batch(model, _ground(**ground), candidates, stations)
        return Case(lambda: batch(), lambda _: batch())

    def new(edge: float = _EDGE, noise: float = 0.0) -> Case:
        """The first batch on a new map, which differs from the last one everywhere."""
        seeds = count()

        def prepare() -> Callable[[], TimeOptimalBatch]:
            return _batch(model, _ground(edge, noise, next(seeds)), _CANDIDATES, _STATIONS)

        return Case(prepare, lambda batch: batch())

    def plan(stations: int) -> Case:
        """One plan of a batch, smoothed and verified."""
        solved = _batch(model, _ground(160.0), 4, stations)()
        return Case(lambda: None, lambda _: finished(solved, 1, "", smooth=True))

    def surfaces(surface_count: int) -> Case:
        names = tuple(f"ground {n}" for n in range(surface_count))
        tables = {name: SurfaceBraking(b_b=0.4 - 0.002 * n) for n, name in enumerate(names)}
        braking = replace(model.braking, terrain=tables)
        ground = _patches(("", *names))
        batch = _batch(replace(model, braking=braking), ground, _CANDIDATES, _STATIONS)
        return Case(lambda: batch(), lambda _: batch())

    yield Cost("batch, candidates", "", (32, 64, 128, 256, 512), lambda n: known(int(n)))

    def longer(stations: float) -> Case:
        return known(stations=int(stations), edge=max(_EDGE, 2.4 * SPACING * stations))

    yield Cost("batch, stations", "", (40, 80, 160, 320), longer)
    yield Cost("one plan, stations", "", (40, 80, 160, 300), lambda n: plan(int(n)))
    yield Cost("new map, area", "m²", _AREAS, lambda n: new(n**0.5))
    yield Cost("new map of 1 cm noise, area", "m²", _AREAS, lambda n: new(n**0.5, 0.01))
    yield Cost("new map, noise", "m", (0.003, 0.006, 0.012, 0.024), lambda n: new(noise=n))
    yield Cost("batch, surfaces", "", (1, 2, 4, 8, 16), lambda n: surfaces(int(n)))


def _batch(
    model: Model, ground: ElevationMap, candidates: int, stations: int
) -> Callable[[], TimeOptimalBatch]:
    """Candidates from the left edge of a map, to be solved."""
    edge = _CELL * ground.elevation.shape[0]
    turns = np.linspace(-0.02, 0.02, candidates)
    along = SPACING * np.arange(stations)
    paths = []
    for turn in turns:
        heading = turn * along
        x, y = (np.cumsum(SPACING * f(heading)) for f in (np.cos, np.sin))
        paths.append(EvenPath("", np.column_stack((4.0 + x, 0.5 * edge + y)), None))
    together = side_by_side(paths)
    radius = model.vehicle.wheel_radius
    return lambda: time_optimal_batch(averaged_map(ground, radius), together, model)


def _ground(edge: float = _EDGE, noise: float = 0.0, seed: int = 0) -> ElevationMap:
    """Gentle waves, with noise of the cells that the map states [m]."""
    along = np.arange(0.0, edge, _CELL)
    height = 0.3 * np.sin(0.4 * along) * np.cos(0.3 * along)[:, None]
    height += np.random.default_rng(seed).normal(0.0, 1.0, height.shape) * noise
    return ElevationMap(elevation=height, resolution=_CELL, origin=(0.0, 0.0), height_std=noise)


def _patches(names: tuple[str, ...]) -> ElevationMap:
    """The same in squares of 2 m of all surfaces."""
    ground = _ground()
    square = np.arange(ground.elevation.shape[0]) // 10
    classes = (square + 3 * square[:, None]) % len(names)
    return replace(ground, terrain_class=classes, class_names=names)
