"""Noisy maps, compared with the same maps without noise: false stops, speed, obstacles."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from rich.console import Console
from scipy import ndimage

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.models.smallest_seen import smallest_seen
from slopewise.models.vehicle import Vehicle
from slopewise.planner.ground.uncertainty import QUANTILE, Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.scene import shipped
from ..common.text_tables import print_rows
from ..common.timing import machine
from ..obstacles.cases import FAR, Block, Slope, height_of

Random = np.random.Generator
GROUNDS = ("flat", "swell", "rolling")
SIZED = ("step", "drop", "ditch", "log", "rock", "hole", "post")
KINDS = (*SIZED, "cliff", "edge")  # those without a size are always far above the limits

LEVELS = ((0.01, 0.0), (0.02, 0.0), (0.03, 0.0), (0.02, 0.3))
"""Standard deviations of noise, lengths over which it is correlated [m]."""

LOW = ((0.0, 0.0), (0.005, 0.0), (0.01, 0.0))  # the same
CELLS = (0.05, 0.1, 0.25)  # edges [m]; a quick run has the second one only
COUNTS = (11, 15)  # paths of a map; obstacles of a kind on one vehicle, cell size and noise [1]
LARGE, SMALL = 1.1, 0.9  # heights of obstacles where the noise is low, over the limit [1]
MISSTATED = (0.7, 1.3)  # stated over true standard deviation [1]
_CHECKED, _SEED = 4, 31  # plans of a map that are checked, which takes a second each [1]
_LARGEST = {"atv": 0.03, "husky": 0.02, "ugv": 0.03}  # noise of vehicles [m]


def noise(shape: tuple[int, ...], cell: float, std: float, length: float, rng: Random) -> Floats:
    """Errors of cells [m], correlated over a length if it is not 0."""
    errors: Floats = rng.standard_normal(shape)
    if length > 0.0:  # Two such kernels in a row have the correlation of the map's definition.
        errors = ndimage.gaussian_filter(errors, length / cell / np.sqrt(2.0), mode="wrap")
        errors /= errors.std()
    return std * errors


def long_ground(kind: str, cell: float, rng: Random) -> ElevationMap:
    """Exact map for paths of 40 m."""
    x, y = np.meshgrid(np.arange(-6.0, 46.0, cell), np.arange(-8.0, 8.0, cell))
    z = _relief(kind, x, y, rng)
    return ElevationMap(elevation=z, resolution=cell, origin=(-6.0, -8.0))


def _relief(kind: str, x: Floats, y: Floats, rng: Random) -> Floats:
    z: Floats = np.zeros_like(x)
    if kind == "swell":
        z = 0.125 * np.sin(2.0 * np.pi * x / 25.0 + rng.uniform(0.0, 6.0)) * np.cos(y / 5.0)
    for _ in range(6 if kind == "rolling" else 0):
        heading, wave = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(14.0, 30.0)
        phase = 2.0 * np.pi * (x * np.cos(heading) + y * np.sin(heading)) / wave
        z = z + rng.uniform(0.1, 0.25) * wave / 25.0 * np.sin(phase + rng.uniform(0.0, 6.0))
    return z


def long_path(number: int, rng: Random) -> CandidatePath:
    """Path of 40 m: a straight line, an arc, a slalom in turn."""
    x = np.linspace(0.0, 40.0, 81)
    arc = rng.uniform(-2.0, 2.0) * (x / 40.0) ** 2
    slalom = rng.uniform(0.3, 1.2) * np.sin(2.0 * np.pi * x / rng.uniform(18.0, 35.0))
    y = rng.uniform(-2.0, 2.0) + (0.0 * x, arc, slalom)[number % 3]
    return CandidatePath(f"{number}", np.stack([x, y], axis=1))


def obstacle_map(
    kind: str, height: float, cell: float, vehicle: Vehicle, rng: Random
) -> tuple[ElevationMap, CandidatePath]:
    """Exact map with an obstacle in its middle, and a path over it, turned and shifted."""
    heading, slope = rng.uniform(-np.pi, np.pi), Slope(*rng.uniform(-0.08, 0.08, 2))
    c, s = np.cos(heading), np.sin(heading)
    along = np.arange(-8.0, 8.0, cell) + rng.uniform(0.0, cell)
    east, north = np.meshgrid(along, along + rng.uniform(0.0, cell))
    x, y = c * east + s * north, c * north - s * east
    block = _block(kind, height, cell, vehicle, rng)
    z = height_of(block, slope, x, y) + _relief("swell", x, y, rng)
    if kind == "post":
        z[np.unravel_index(np.hypot(x - block.x, y - block.y).argmin(), z.shape)] += height
    if kind == "edge":
        z[block.contains(x, y)] = np.nan
    ground = ElevationMap(elevation=z, resolution=cell, origin=(east[0, 0], north[0, 0]))
    return ground, CandidatePath(kind, np.array([[-5.0], [4.0]]) * [c, s])


def _block(kind: str, height: float, cell: float, vehicle: Vehicle, rng: Random) -> Block:
    yaw, turn, radius = rng.uniform(-0.5, 0.5), rng.uniform(-np.pi, np.pi), vehicle.wheel_radius
    wheel = 0.5 * vehicle.track_width + rng.uniform(-0.3, 0.3) * vehicle.shape.wheel_width
    hole, log = max(0.2, radius), 0.5 * max(radius, 0.2, 2.0 * cell)
    blocks = {
        "post": Block(0.0, wheel, 0.0, 0.0, 0.0, 0.0),
        "rock": Block(0.0, wheel, turn, 0.15, 0.15, height),
        "hole": Block(0.0, wheel, turn, hole, hole, -height),
        "ditch": Block(0.0, 0.0, yaw, hole, FAR, -height),  # Tyres bridge shorter ones.
        "log": Block(0.0, 0.0, yaw, log, FAR, height),
    }
    rise = {"step": height, "drop": -height, "cliff": -1.0}.get(kind, 0.0)
    beyond = Block(FAR * np.cos(yaw), FAR * np.sin(yaw), yaw, FAR, 2.0 * FAR, rise)
    return blocks.get(kind, beyond)


class Setting(NamedTuple):
    """A row of a table."""

    vehicle: str
    cell: float  # [m]
    std: float  # of the noise [m]
    length: float  # over which it is correlated [m]
    stated: float = 1.0  # standard deviation that the map states, over the true one [1]
    size: float | None = None  # height of obstacles over the limit; None: the lowest detected


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Plan over paths and obstacles on exact and noisy maps."""
    paths, obstacles = (3, 1) if request.quick else COUNTS
    cells = CELLS[1:2] if request.quick else CELLS
    noisy, low = _settings(LEVELS, cells), _settings(LOW, cells)
    exact = [s._replace(size=LARGE) for s in low if s.std == 0.0]
    wrong = [s._replace(stated=share) for share in MISSTATED for s in noisy]
    tables = (
        ("paths", path_row, noisy, paths),
        ("obstacles", obstacle_row, noisy + exact, obstacles),
        ("small obstacles", obstacle_row, [s._replace(size=SMALL) for s in low], obstacles),
        ("paths, error misstated", path_row, wrong, max(paths // 4, 1)),
        ("obstacles, error misstated", obstacle_row, wrong, max(obstacles // 7, 1)),
    )
    planned = {
        title: [
            s._asdict() | row(s, shipped(s.vehicle), count, np.random.default_rng(_SEED))
            for s in tracked(progress, title, settings)
        ]
        for title, row, settings, count in tables
    }
    return {"quick": request.quick, "machine": machine(), "planned": planned}


def _settings(levels: tuple[tuple[float, float], ...], cells: tuple[float, ...]) -> list[Setting]:
    every = (Setting(v, c, *e) for v in _LARGEST for c in cells for e in levels)
    return [s for s in every if s.std <= _LARGEST[s.vehicle]]


def _noisy(exact: ElevationMap, s: Setting, rng: Random) -> ElevationMap:
    z = exact.elevation + noise(exact.elevation.shape, s.cell, s.std, s.length, rng)
    return replace(exact, elevation=z, height_std=s.stated * s.std, correlation_length=s.length)


def path_row(s: Setting, model: Model, count: int, rng: Random) -> Result:
    """Counts of paths that only noise blocks and of violations, mean speeds of the others [m/s]."""
    row: Result = dict.fromkeys(("paths", "blocked", "checked", "violations"), 0)
    planner, speeds = CandidatePlanner(model, uncertainty=Uncertainty(quantile=QUANTILE)), []
    for ground in GROUNDS:
        exact = long_ground(ground, s.cell, rng)
        noisy = _noisy(exact, s, rng)
        paths = [long_path(n, rng) for n in range(count)]
        plans = planner.plan(noisy, paths)
        for plan in plans[: _CHECKED if s.stated == 1.0 else 0]:
            given = plan_of_columns(plan.columns())
            row["checked"] += 1
            row["violations"] += not check_plan_on_map(given, model, noisy, quantile=QUANTILE).valid
        for pair in zip(planner.plan(exact, paths), plans, strict=True):
            is_ok, is_noisy_ok = (plan.status.value == "ok" for plan in pair)
            row["paths"] += is_ok
            row["blocked"] += is_ok and not is_noisy_ok
            if is_ok and is_noisy_ok:
                speeds.append([plan.progress / plan.travel_time for plan in pair])
    exact_speed, speed = np.sum(speeds, axis=0) / len(speeds) if speeds else (0.0, 0.0)
    return {**row, "exact_speed": round(exact_speed, 3), "speed": round(speed, 3)}


def obstacle_row(s: Setting, model: Model, count: int, rng: Random) -> Result:
    """Counts of obstacles: planned, blocked without noise, and of these also with noise."""
    planner = CandidatePlanner(model, uncertainty=Uncertainty(quantile=QUANTILE))
    vehicle, row = model.vehicle, Result(cases=0, only_noisy=0)
    flat = ElevationMap(elevation=np.zeros((4, 4)), resolution=s.cell, origin=(0.0, 0.0))
    sizes = None if s.size else smallest_seen(_noisy(flat, s._replace(stated=1.0), rng), vehicle)
    for kind in SIZED if s.size else KINDS:
        height = (s.size or LARGE) * vehicle.shape.max_step
        if sizes is not None:
            height = getattr(sizes, {"hole": "rock"}.get(kind, kind), sizes.step)
        blocked = detected = 0
        for _ in range(count):
            exact, path = obstacle_map(kind, height, s.cell, vehicle, rng)
            noisy = _noisy(exact, s, rng)
            truth, plan = (planner.plan(m, [path])[0] for m in (exact, noisy))
            # A wheel that is already on the obstacle is too late.
            late = plan.clear_distance - truth.clear_distance > max(vehicle.wheel_radius, s.cell)
            is_blocked, is_stopped = (p.status.value != "ok" for p in (truth, plan))
            blocked += is_blocked
            detected += is_blocked and is_stopped and not late
            row["only_noisy"] += is_stopped and not is_blocked
        row["cases"] += count
        row[kind] = [detected, blocked]
    return row


def show(result: Result, console: Console) -> None:
    """Print a table of each part; obstacles: detected of those blocked without noise."""
    first = "vehicle, cell, noise, length [m], × stated"
    for title, rows in result["planned"].items():
        shown = [{k: v for k, v in row.items() if k != "size"} for row in rows]
        print_rows(console, title, shown, *Setting._fields[:5], first=first)
