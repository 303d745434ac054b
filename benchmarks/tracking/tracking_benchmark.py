"""Off-tracking along walls, passes with drawn tracking errors, gaps, speed and cost of the band."""

from __future__ import annotations

import math
from dataclasses import replace
from itertools import product

import numpy as np
from rich.console import Console
from scipy import ndimage

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking, input_errors, lateral_band
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import QUANTILE, Uncertainty
from slopewise.planner.path import PathBatch
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.pipeline.time_optimal_batch import time_optimal_batch

from ..common.campaign import BenchmarkRequest, Progress, Result
from ..common.scene import fan, shipped
from ..common.text_tables import duration, print_rows
from ..common.timing import Action, interleave, machine
from ..noisy_maps import noisy_map_benchmark as noisy_maps
from .passes import Poses, poses_on, steered, strikes, wheels_beyond

Random = np.random.Generator

TRACKING = Tracking(cross_track_std=0.08, heading_std=math.radians(2.0))
"""Errors of the passes [m], [rad]: those of a good outdoor tracker."""

LEVELS = (0.9, 0.99, QUANTILE)  # quantiles of plans [1]
KINDS = ("wall", "post", "cliff", "gap")
_CELL, _SEED, _WALL = 0.1, 17, 1.0  # cell edge [m], seed, height of walls [m]
_ARCS, _SCENES, _DRAWS = 110, 20, 420  # arcs; scenes of a kind and level; draws of a scene [1]
_LENGTH = 16.0  # of a path past an obstacle [m]
_BATCH = (100, 64)  # stations, candidates [1]
_SQUARE = 0.71 * _CELL  # by which the square of a cell is nearer than its middle at most [m]


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    """Drive planned lines past walls, posts, cliffs and through gaps."""
    atv = shipped("atv")
    arcs, scenes, draws = (22, 6, 60) if request.quick else (_ARCS, _SCENES, _DRAWS)
    rng, advance = np.random.default_rng(_SEED), progress("tracking", 3 + len(LEVELS))
    result: Result = {"quick": request.quick, "machine": machine()}
    result["arcs"] = arc_rows(steered(atv), arcs, rng)
    advance(1)
    result["passes"] = []
    for quantile in LEVELS:
        result["passes"] += [pass_row(k, quantile, atv, scenes, draws, rng) for k in KINDS]
        advance(1)
    count = 4 if request.quick else 15
    result["open ground"] = [open_row(g, atv, count, rng) for g in noisy_maps.GROUNDS]
    advance(1)
    result["batch"] = batch_rows(atv, 5 if request.quick else 31)
    advance(1)
    return result


def arc_rows(model: Model, count: int, rng: Random) -> list[Result]:
    """Arcs of 3 … 8 m along a wall: driven and struck; circles of 0.5 and 1 m: status."""
    planner = CandidatePlanner(model, uncertainty=Uncertainty(quantile=QUANTILE))
    driven = struck = 0
    for _ in range(count):
        path, ground = arc_scene(model, rng)
        plan = planner.plan(ground, [path])[0]
        stop = int(np.argmax(plan.station >= plan.progress)) + 1
        if plan.progress < 1.0:
            continue
        driven += 1
        poses = poses_on(plan.x[:stop], plan.y[:stop], model)
        struck += int(strikes(poses, model, ground).any())
    first = {"case": "arcs of 3 … 8 m", "planned": count, "driven": driven, "struck": struck}
    rows: list[Result] = [first]
    for radius in (0.5, 1.0):
        path, flat = circle(radius), _map(np.zeros((120, 120)), (-6.0, -6.0))
        plan = planner.plan(flat, [path])[0]
        rows.append({"case": f"circle of {radius} m", "status": plan.status.value})
    return rows


def circle(radius: float, angle: float = 2.0 * math.pi, lead: float = 0.0) -> CandidatePath:
    """A turn to the left from the origin, behind a straight of some length [m]."""
    turn = np.linspace(0.0, angle, max(int(angle * radius / 0.05), 40))
    before = np.arange(-lead, 0.0, 0.05)
    straight = np.column_stack([before, np.zeros_like(before)])
    arc = np.column_stack([radius * np.sin(turn), radius * (1.0 - np.cos(turn))])
    return CandidatePath("turn", np.concatenate([straight, arc]))


def arc_scene(model: Model, rng: Random) -> tuple[CandidatePath, ElevationMap]:
    """A turn with a wall inside or outside of it, about as near as the body's corners come."""
    radius, angle = rng.uniform(3.0, 8.0), rng.uniform(0.8, 2.5)
    path = circle(radius, angle, lead=3.0)
    y, x = np.mgrid[-4.0:18.0:_CELL, -6.0:10.0:_CELL]
    half = 0.5 * model.vehicle.shape.width
    away = np.hypot(x, y - radius)
    if rng.random() < 0.5:
        wall = (away < radius - half - rng.uniform(0.0, 0.4)) & (x > 0.0)
    else:
        wall = away > radius + half + rng.uniform(0.0, 0.6)
        wall &= (x > 0.0) | (y > radius)
    return path, _map(_WALL * wall, (-6.0, -4.0))


def _map(heights: np.ndarray, origin: tuple[float, float]) -> ElevationMap:
    return ElevationMap(elevation=heights.astype(np.float64), resolution=_CELL, origin=origin)


def pass_row(
    kind: str, quantile: float, model: Model, scenes: int, draws: int, rng: Random
) -> Result:
    """Passes that plans drive, with drawn errors: the share that touches, and gaps driven."""
    tracked = replace(model, tracking=TRACKING)
    planner = CandidatePlanner(tracked, uncertainty=Uncertainty(quantile=quantile))
    errors = input_errors(TRACKING, quantile)
    band = lateral_band(errors, max(model.vehicle.shape.front, model.vehicle.shape.rear))
    driven = touched = wide = wide_driven = 0
    for _ in range(scenes):
        # Half of the free widths are near the band, where touching is likeliest.
        spare = band + rng.choice([rng.uniform(-0.1, 0.1), rng.uniform(0.0, 0.5)])
        path, ground = pass_scene(kind, model, float(spare), rng)
        plan = planner.plan(ground, [path])[0]
        passed = plan.status.value == "ok"
        fits = bool(spare > band + _SQUARE)
        wide, wide_driven = wide + fits, wide_driven + (fits and passed)
        if not passed:
            continue
        std = [TRACKING.cross_track_std, TRACKING.heading_std]
        pass_errors = rng.standard_normal((draws, 2)) * std
        poses = _near(poses_on(plan.x, plan.y, model))
        contact = wheels_beyond if kind == "cliff" else strikes
        driven += draws
        touched += int(contact(poses, model, ground, pass_errors).sum())
    shares = {"share": round(touched / max(driven, 1), 5), "promised": round(1.0 - quantile, 4)}
    row = {"obstacle": kind, "quantile": quantile, "passes": driven, "touched": touched}
    return row | shares | {"wide enough": wide, "of these driven": wide_driven}


def _near(poses: Poses) -> Poses:
    """Every other pose of the middle third, where the obstacle is."""
    third = len(poses.x) // 3
    return Poses(*(part[third : 2 * third : 2] for part in poses))


def pass_scene(
    kind: str, model: Model, spare: float, rng: Random
) -> tuple[CandidatePath, ElevationMap]:
    """A straight or gentle turn past an obstacle at a distance from the planned body [m]."""
    half = 0.5 * model.vehicle.shape.width
    if kind == "cliff":  # A wheel falls, the body may be beyond.
        half = 0.5 * model.vehicle.track_width
    heading, shift = rng.uniform(-np.pi, np.pi), rng.uniform(0.0, _CELL, 2)
    y, x = np.mgrid[-11.0:11.0:_CELL, -11.0:11.0:_CELL] + shift[:, None, None]
    c, s = math.cos(heading), math.sin(heading)
    u, v = c * x + s * y, c * y - s * x
    left, start = np.abs(v) if kind == "gap" else v, half + spare
    high = (left > start) & (left < start + {"post": 0.2, "cliff": 3.0}.get(kind, 0.5))
    high &= np.abs(u) < (0.1 if kind == "post" else 1.5)
    height = np.where(high, -_WALL if kind == "cliff" else _WALL, 0.0)
    ground = _map(height, (-11.0 + shift[1], -11.0 + shift[0]))
    along = np.linspace(-0.5 * _LENGTH, 0.5 * _LENGTH, 33)
    return CandidatePath(kind, np.column_stack([c * along, s * along])), ground


def open_row(kind: str, model: Model, count: int, rng: Random) -> Result:
    """Mean speeds on ground without obstacles, with and without the errors of tracking."""
    ground = noisy_maps.long_ground(kind, _CELL, rng)
    paths = [noisy_maps.long_path(n, rng) for n in range(count)]
    late = replace(TRACKING, along_track_std=0.05, latency=0.1, latency_std=0.02)
    row: Result = {"ground": kind, "paths": count}
    for name, tracking in (("exact", None), ("band", TRACKING), ("band and delay", late)):
        uncertainty = Uncertainty(quantile=QUANTILE)
        planner = CandidatePlanner(replace(model, tracking=tracking), uncertainty=uncertainty)
        plans = planner.plan(ground, paths)
        seconds = sum(max(plan.travel_time, 1e-9) for plan in plans)
        row[name] = round(sum(plan.progress for plan in plans) / seconds, 3)
        row[f"{name}, ok"] = sum(plan.status.value == "ok" for plan in plans)
    return row


def batch_rows(model: Model, repetitions: int) -> list[Result]:
    """Times of a batch of 64 x 100 with and without the band, in turn, and their ratio."""
    scene = fan(*_BATCH)
    names = tuple(str(j) for j in range(len(scene.count)))
    paths = PathBatch.of_stations(names, scene.x, scene.y, scene.count)
    uncertainty = Uncertainty(quantile=QUANTILE)

    def action(tracking: Tracking | None, terrain: ElevationMap, *, is_new: bool) -> Action:
        tracked = replace(model, tracking=tracking)

        def plan() -> object:
            ground = replace(terrain) if is_new else terrain
            return time_optimal_batch(ground, paths, tracked, uncertainty=uncertainty)

        return plan

    rough = scene.elevation_map
    heights = ndimage.gaussian_filter(np.nan_to_num(rough.elevation), 2.0)
    rows = []
    grounds = {"1 cm of noise": rough, "smooth": replace(rough, elevation=heights)}
    for (ground, terrain), is_new in product(grounds.items(), (False, True)):
        trackings = {"exact": None, "band": TRACKING}
        actions = {name: action(t, terrain, is_new=is_new) for name, t in trackings.items()}
        times = interleave(actions, repetitions)
        exact, band = (float(np.median(times[name])) for name in trackings)
        name = f"{_BATCH[1]} x {_BATCH[0]}, {ground}, {'new' if is_new else 'same'} map"
        row = {"batch": name, "exact": duration(exact), "band": duration(band)}
        rows.append(row | {"ratio": round(band / exact, 2)})
    return rows


def show(result: Result, console: Console) -> None:
    for title in ("arcs", "passes", "open ground", "batch"):
        print_rows(console, title, result[title])
