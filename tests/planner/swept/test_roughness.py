"""Roughness, and drops next to a path and across it."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.linalg import expm

import slopewise
from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.planner.swept.hazards import swept_hazards
from slopewise.services.io.model_file import find_model, read_model
from tests.world.ground import straight
from tests.world.hazards import MODELS
from tests.world.stages import profile_of

RATIO = 0.7
"""Of a speed that is tried to the next."""


def mean_squares(path: Floats, dt: float, frequency: float, damping: float, start: int) -> Floats:
    """Running mean square of the vertical acceleration at each station, (N,) [m²/s⁴]."""
    w, z, keep = frequency, damping, math.exp(-0.5 * frequency * dt * 3.0 / math.pi)
    # State y, y' - 2 ζ ω h, h, and the rise of h over a step.
    change = np.zeros((4, 4))
    change[0, 1:3] = 1.0, 2.0 * z * w
    change[1, :3] = -w * w, -2.0 * z * w, w * w * (1.0 - 4.0 * z * z)
    change[2, 3] = 1.0 / dt
    step = expm(change * dt)
    rate = (path[start] - path[0]) / (start * dt)
    state = np.array([path[0], rate - 2.0 * z * w * path[0], 0.0, 0.0])
    mean, out = 0.0, np.zeros(len(path))
    for k in range(1, len(path)):
        rise = path[k] - path[k - 1]
        state[2:] = path[k - 1], rise
        following = step @ state
        accel = (following[1] - state[1] + 2.0 * z * w * rise) / dt
        mean = accel**2 + keep * (mean - accel**2)
        state, out[k] = following, mean
    return out


def defined_speeds(model: Model, grounds: list[Floats], spacing: float, stations: int) -> Floats:
    """Highest speeds at the last N stations, (N,); ground under the left and right wheels."""
    vehicle, radius = model.vehicle, model.vehicle.wheel_radius
    count, places = len(grounds[0]), np.arange(len(grounds[0]))
    reach = math.sqrt(radius**2 - max(radius - vehicle.shape.max_step, 0.0) ** 2)
    patch = int(0.25 * radius / spacing)
    rear, ahead = math.ceil(vehicle.wheelbase / spacing), max(math.ceil(radius / spacing), 1)
    levels = [model.limits.speed * RATIO**n for n in (3, 2, 1, 0)]
    felt = np.zeros((4, count))
    for ground in grounds:
        padded = np.pad(ground, count, mode="edge")
        rolled = ground.copy()
        for n in range(1, int(reach / spacing) + 1):
            drop = radius - math.sqrt(radius**2 - (n * spacing) ** 2)
            sides = np.maximum(padded[count - n :][:count], padded[count + n :][:count])
            rolled = np.maximum(rolled, sides - drop)
        evened = np.convolve(
            np.pad(rolled, patch, mode="edge"), np.full(2 * patch + 1, 1 / (2 * patch + 1)), "valid"
        )
        path = evened - 0.125 * np.diff(np.pad(evened, 1, mode="edge"), 2)
        for level, speed in enumerate(levels):
            bounce = (2.0 * math.pi * vehicle.ride_frequency, vehicle.ride_damping)
            mean = mean_squares(path, spacing / speed, *bounce, min(count - 1, rear + ahead))
            felt[level] = np.maximum(felt[level], mean)
    limit, reached = 0.5 * model.limits.vertical_accel**2, np.full(count, np.inf)
    for k in places:
        level = int(np.argmax(felt[:, k] > limit))
        if felt[level, k] > limit:
            at, below = felt[level, k], felt[level - 1, k]
            between = RATIO**2 + (1.0 - RATIO**2) * (limit - below) / (at - below)
            reached[k] = levels[level] * math.sqrt(limit / at if level == 0 else between)
    windows = (reached[max(k - rear, 0) : k + ahead + 1].min() for k in places[-stations:])
    return np.array(list(windows))


@pytest.mark.parametrize("spacing", [0.03, 0.1, 0.25])
@pytest.mark.parametrize("candidates", [1, 9, 70])
def test_roughness_speeds_are_as_defined(spacing: float, candidates: int) -> None:
    rng, model = np.random.default_rng(candidates), MODELS[0]
    model = replace(model, limits=replace(model.limits, vertical_accel=1.5))
    across, width = np.arange(0.0, 4.1, 0.1), 0.5 * model.vehicle.track_width
    heights = np.cumsum(0.012 * rng.standard_normal((len(across), 260)), axis=1)
    scene = ElevationMap(elevation=heights, resolution=0.1, origin=(-10.0, -2.0))
    path: CandidatePath = straight(8.0)
    profile = profile_of(model, scene, *[path] * candidates, spacing=spacing)
    computed = swept_hazards(scene, profile, model).rough_speed
    step = float(np.hypot(*(np.diff(row[:3, 0]) for row in (profile.x, profile.y))).max())
    before = math.ceil(2.0 * model.vehicle.wheelbase / step)
    x = np.concatenate([profile.x[0, 0] - step * np.arange(before, 0, -1), profile.x[:, 0]])
    x_cells = np.arange(heights.shape[1]) * 0.1 - 10.0
    row = np.round((np.array([width, -width]) + 2.0) / 0.1).astype(int)
    ahead = x + 0.5 * model.vehicle.wheelbase
    grounds = [np.interp(ahead, x_cells, heights[r]) - profile.z[0, 0] for r in row]
    expected = defined_speeds(model, grounds, step, len(profile.x))
    assert np.isfinite(expected).any()
    for j in range(candidates):
        # Between two speeds that are tried, float32 counts by the difference of their squares.
        np.testing.assert_allclose(computed[:, j], expected, rtol=3e-4)


SHIPPED = read_model(find_model("atv"))


def line(*points: tuple[float, float]) -> CandidatePath:
    return CandidatePath("line", np.array(points))


def crest_speed(cell: float, heights: Floats, model: Model, std: float = 0.0) -> float:
    """Lowest speed over the middle of a profile of heights at cells along the path."""
    ground = ElevationMap(
        elevation=np.tile(heights, (round(12.0 / cell) + 2, 1)),
        resolution=cell,
        origin=(0.0, -6.0),
        height_std=std,
    )
    (plan,) = slopewise.plan(model, ground, [line((1.0, 0.0), (28.0, 0.0))])
    return float(np.min(plan.speed[(plan.x > 13.0) & (plan.x < 18.0)]))


def test_a_kink_is_as_sharp_on_coarse_cells_as_on_fine_ones() -> None:
    model = SHIPPED

    def edge(cell: float) -> Floats:
        x = cell * np.arange(round(30.0 / cell) + 2)
        return -math.tan(math.radians(14.0)) * np.maximum(x - 15.0, 0.0)

    fine = crest_speed(0.25, edge(0.25), model)
    assert fine < 0.6 * model.limits.speed
    for cell in (0.5, 1.0):
        assert crest_speed(cell, edge(cell), model) == pytest.approx(fine, rel=0.03)
    assert crest_speed(1.0, edge(1.0), model, std=0.06) > 1.3 * fine


def test_noise_of_coarse_cells_is_no_roughness() -> None:
    model, rng = SHIPPED, np.random.default_rng(5)
    paths = [line((5.0, 5.0 + 1.5 * i), (45.0, 15.0 + 0.9 * i)) for i in range(20)]
    for cell in (0.5, 1.0):
        noise = rng.normal(0.0, 0.03, (round(60.0 / cell),) * 2)
        speeds = [
            np.mean([plan.speed.mean() for plan in slopewise.plan(model, ground, paths)])
            for ground in (
                ElevationMap(elevation=0.0 * noise, resolution=cell, origin=(0.0, 0.0)),
                ElevationMap(elevation=noise, resolution=cell, origin=(0.0, 0.0), height_std=0.03),
            )
        ]
        assert speeds[1] > 0.95 * speeds[0]


LENGTH = 26.0  # of the square map [m]


def ground_with_drop(cell: float) -> tuple[slopewise.ElevationMap, float]:
    """Level ground, 1 m lower beyond the cells whose middle is at the returned y [m]."""
    cells = round(LENGTH / cell)
    y = np.tile(cell * np.arange(cells)[:, None], (1, cells))
    edge = cell * (cells // 2)
    heights = np.where(y < edge - 1e-9, -1.0, 0.0)
    return slopewise.ElevationMap(elevation=heights, resolution=cell, origin=(0.0, 0.0)), edge


@pytest.mark.parametrize("cell", [pytest.param(0.05, marks=pytest.mark.nightly), 0.1])
@pytest.mark.parametrize("name", ["atv", "husky", "ugv"])
def test_wheels_stop_before_a_drop_at_any_angle(name: str, cell: float) -> None:
    model = slopewise.read_model(name)
    vehicle, (ground, edge) = model.vehicle, ground_with_drop(cell)
    corners = 0.5 * np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    driven = 0
    for degrees in (2.0, 7.0, 20.0, 45.0, 90.0):
        turned = np.radians(-degrees)
        begin = 8.0, edge + 0.5 * vehicle.track_width + 0.05 + 6.0 * np.sin(-turned)
        way = np.linspace(0.0, 12.0, 60)[:, None] * (np.cos(turned), np.sin(turned))
        path = slopewise.CandidatePath("p", begin + way)
        (plan,) = slopewise.plan(model, ground, [path], start_speed=0.0)
        if not plan.speed.any():  # the map is too coarse for this vehicle to drive there
            continue
        driven += 1
        assert plan.status.value == "blocked"
        assert slopewise.check_plan(plan, model, ground).valid, degrees
        end = (plan.station + plan.stop_distance)[plan.speed > 0.0].max()
        y = np.interp(end, plan.station, plan.y)
        wheels = corners @ (
            vehicle.wheelbase * np.sin(turned),
            vehicle.track_width * np.cos(turned),
        )
        assert (y + wheels).min() >= edge - 0.01, degrees
        assert (y + wheels).min() <= edge + 1.5, degrees
    assert driven >= 3


@pytest.mark.parametrize("cell", [0.25, 0.5, 1.0])
@pytest.mark.parametrize("degrees", [0.0, 30.0, 57.0])
def test_a_map_ends_where_unknown_cells_would_begin(cell: float, degrees: float) -> None:
    """A front overhang is over known ground at rest; a ring of unknown cells changes nothing."""
    model = slopewise.read_model("ugv")
    cells = round(40.0 / cell)
    level, half = np.zeros((cells, cells // 2)), 0.5 * cell
    turned, last = np.radians(degrees), (cells // 2 - 1) * cell
    begin = np.array([last - 10.0 * np.cos(turned), 20.0 - 10.0 * np.sin(turned)])
    way = np.linspace(0.0, 20.0, 60)[:, None] * (np.cos(turned), np.sin(turned))
    path = slopewise.CandidatePath("p", begin + way)
    ends = []
    for ring in (0, 2):
        ground = slopewise.ElevationMap(
            elevation=np.pad(level, ring, constant_values=np.nan),
            resolution=cell,
            origin=(-ring * cell, -ring * cell),
        )
        (plan,) = slopewise.plan(model, ground, [path], start_speed=0.0)
        ends.append(plan.clear_distance)
        front, side = model.front, 0.5 * model.vehicle.shape.width
        x = np.interp(plan.clear_distance, plan.station, plan.x)
        assert x + front * np.cos(turned) + side * np.sin(turned) <= last + half + 0.01
    assert ends[0] == pytest.approx(ends[1])
