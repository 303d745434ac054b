"""Crests: forces that the law takes away, and plans that an independent judge drives through."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.bounds.speed_bounds import SpeedBounds, speed_bounds
from slopewise.planner.ground.braking_ground import BrakingGround, ground_along
from slopewise.planner.ground.terrain_profile import TerrainProfile, terrain_profile
from slopewise.planner.path import batch
from slopewise.planner.settings import PlannerSettings
from tests.planner.scenes import (
    Tables,
    ground_map,
    model_of,
    plan_one,
    plane,
    straight,
    tables_with,
)

G = 9.80665
CREST = ("crest_unloading", {"k": 1.0})
EAGER = {"accel": 3.0, "decel": 5.0, "jerk": 40.0}


def hill(height: float = 1.0, x: float = 9.0, width: float = 4.0) -> ElevationMap:
    return ground_map(lambda e, n: height * np.exp(-(((e - x) / width) ** 2)))


def along(
    tables: Tables, ground: ElevationMap
) -> tuple[TerrainProfile, BrakingGround, SpeedBounds]:
    path, model = batch([straight(18.0)], 0.25), model_of(tables)
    v = model.vehicle
    profile = terrain_profile(ground, path.x, path.y, path.count, v.wheelbase, v.track_width)
    braked = ground_along(profile, model, ground.class_names)
    return profile, braked, speed_bounds(profile, braked, model, np.array([np.inf]))


def remaining(ground: BrakingGround, bounds: SpeedBounds) -> np.ndarray:
    """Share of the force that a crest leaves of inner stations."""
    share: np.ndarray = bounds.ground.lower_intercept[1:-1, 0] / ground.lower_intercept[1:-1, 0]
    return share


def lost(profile: TerrainProfile, v: float) -> np.ndarray:
    """v² |dθ/ds|/g of the worse of the segments on both sides of each inner station."""
    theta, s = profile.grade[:, 0], profile.station[:, 0]
    slope = np.minimum(np.diff(theta) / np.diff(s), 0.0)
    return -np.minimum(slope[:-1], slope[1:]) * v * v / G


def test_a_stop_never_counts_on_more_than_the_law_leaves_of_the_force() -> None:
    """At the speed that a stop may have: near its end a crest takes next to nothing."""
    profile, ground, bounds = along(tables_with(), hill())
    share = remaining(ground, bounds)
    # No stop passes a station faster than its bound and what a plan slows down in a dead time.
    upright = np.cos(profile.grade[1:-1, 0])
    fastest = 1.0 - lost(profile, 4.0 + 1.5 * 0.3) / upright
    assert lost(profile, 4.0).max() > 0.1
    assert np.all(share >= fastest - 1e-12)
    before = profile.station[1:-1, 0] < 8.0
    assert np.all(share[before] <= 1.0 - lost(profile, 3.5)[before])
    assert share[-3] > 0.99


def test_even_slopes_and_hollows_lose_nothing() -> None:
    for height in (plane(rise=0.1), ground_map(lambda x, y: 0.01 * (x - 9.0) ** 2)):
        _, ground, bounds = along(tables_with(), height)
        assert remaining(ground, bounds) == pytest.approx(1.0, abs=1e-9)


def test_where_the_ground_is_unknown_there_is_no_crest() -> None:
    _, ground, bounds = along(tables_with(), plane(rise=0.2, unknown=lambda x, y: x > 10.0))
    assert remaining(ground, bounds) == pytest.approx(1.0, abs=1e-9)


def test_a_lag_counts_with_the_worst_crest_of_the_path() -> None:
    profile, ground, bounds = along(tables_with(("brake_lag", {"tau": 0.2})), hill())
    assert np.all(remaining(ground, bounds) <= 1.0 - lost(profile, 3.5).max() + 1e-9)


def test_a_crest_costs_speed_where_one_has_to_stop_on_it() -> None:
    options: dict[str, Any] = {"clear": 12.0}
    rough = PlannerSettings(smooth=False)
    unaffected = tables_with(("crest_unloading", {"k": 0.0}), limits=EAGER)
    plain = plan_one(unaffected, hill(), straight(18.0), rough, **options)
    crested = plan_one(tables_with(CREST, limits=EAGER), hill(), straight(18.0), rough, **options)
    assert np.all(crested.speed <= plain.speed + 1e-9)
    assert np.max(plain.speed - crested.speed) > 0.05
