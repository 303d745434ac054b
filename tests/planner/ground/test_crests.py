"""Crests: forces that the law takes away, and plans that an independent judge drives through."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from planner.ground.braking_ground import BrakingGround, ground_along
from planner.ground.elevation_map import ElevationMap
from planner.ground.terrain_profile import TerrainProfile, terrain_profile
from planner.path import batch
from planner.settings import PlannerSettings
from tests.planner.generated import between
from tests.planner.scenes import (
    Tables,
    assert_sound,
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


def along(tables: Tables, ground: ElevationMap) -> tuple[TerrainProfile, BrakingGround]:
    path, model = batch([straight(18.0)], 0.25), model_of(tables)
    v = model.vehicle
    profile = terrain_profile(ground, path.x, path.y, path.count, v.wheelbase, v.track_width)
    return profile, ground_along(profile, model, ground.class_names)


def lost(profile: TerrainProfile, v: float) -> np.ndarray:
    """v² |dθ/ds|/g of the worse of the segments on both sides of each inner station."""
    theta, s = profile.grade[:, 0], profile.station[:, 0]
    slope = np.minimum(np.diff(theta) / np.diff(s), 0.0)
    return -np.minimum(slope[:-1], slope[1:]) * v * v / G


@pytest.mark.parametrize("k", [0.5, 1.0, 1.4])
def test_forces_are_the_law_at_both_ends_of_the_trained_speeds(k: float) -> None:
    profile, plain = along(tables_with(), hill())
    _, crested = along(tables_with(("crest_unloading", {"k": k})), hill())
    lever = 0.55 / 0.6
    inner = slice(1, -1)
    assert lost(profile, 4.0).max() > 0.1
    for v in (1.0, 4.0):
        force = (v * plain.lower_slope + plain.lower_intercept)[inner, 0]
        kept = (v * crested.lower_slope + crested.lower_intercept)[inner, 0]
        wanted = force * (1.0 - k * lost(profile, v))
        falls = plain.lower_slope[inner, 0] < 0.0
        assert kept[~falls] == pytest.approx(wanted[~falls], abs=1e-12)
        assert np.all(kept <= wanted + 1e-12)
        assert np.all(kept >= wanted - 0.02)
        heavier = (crested.upper_slope - plain.upper_slope)[inner, 0] * v
        heavier += (crested.upper_intercept - plain.upper_intercept)[inner, 0]
        assert heavier == pytest.approx(lost(profile, v) / lever, abs=1e-12)


@given(
    k=between(0.0, 2.0), v=between(1.0, 4.0), height=between(-1.5, 1.5), m_b=between(-0.05, 0.05)
)
@settings(max_examples=40)
def test_forces_are_on_the_safe_side_between(k: float, v: float, height: float, m_b: float) -> None:
    braking = {"m_b": m_b}
    profile, plain = along(tables_with(braking=braking), hill(height))
    _, crested = along(tables_with(("crest_unloading", {"k": k}), braking=braking), hill(height))
    force = (v * plain.lower_slope + plain.lower_intercept)[1:-1, 0]
    kept = (v * crested.lower_slope + crested.lower_intercept)[1:-1, 0]
    assert np.all(kept <= force * np.maximum(1.0 - k * lost(profile, v), 0.0) + 1e-12)


def test_even_slopes_and_hollows_lose_nothing() -> None:
    for ground in (plane(rise=0.1), ground_map(lambda x, y: 0.01 * (x - 9.0) ** 2)):
        _, plain = along(tables_with(), ground)
        _, crested = along(tables_with(CREST), ground)
        for name in ("lower_slope", "lower_intercept", "upper_slope", "upper_intercept"):
            assert getattr(crested, name) == pytest.approx(getattr(plain, name), abs=1e-9)


def test_where_the_ground_is_unknown_there_is_no_crest() -> None:
    slope = {"rise": 0.2, "unknown": lambda x, y: x > 10.0}
    _, plain = along(tables_with(), plane(**slope))
    _, crested = along(tables_with(CREST), plane(**slope))
    assert crested.lower_intercept == pytest.approx(plain.lower_intercept, abs=1e-9)


def test_a_lag_counts_with_the_worst_crest_of_the_path() -> None:
    lag = ("brake_lag", {"tau": 0.2})
    _, plain = along(tables_with(lag), hill())
    profile, crested = along(tables_with(lag, CREST), hill())
    force = 4.0 * plain.lower_slope + plain.lower_intercept
    kept = 4.0 * crested.lower_slope + crested.lower_intercept
    assert np.all(kept <= force * (1.0 - lost(profile, 4.0).max()) + 1e-9)


def test_a_crest_costs_speed_where_one_has_to_stop_on_it() -> None:
    options: dict[str, Any] = {"clear": 12.0}
    rough = PlannerSettings(smooth=False)
    plain = plan_one(tables_with(limits=EAGER), hill(), straight(18.0), rough, **options)
    crested = plan_one(tables_with(CREST, limits=EAGER), hill(), straight(18.0), rough, **options)
    assert np.all(crested.speed <= plain.speed + 1e-9)
    assert np.max(plain.speed - crested.speed) > 0.05


HILLS = st.tuples(between(-1.2, 1.2), between(5.0, 14.0), between(2.5, 6.0))


@settings(max_examples=25)
@given(
    HILLS, HILLS, between(0.0, 1.5), between(6.0, 17.0), between(0.55, 0.75), st.booleans(),
    st.sampled_from([(), (("brake_lag", {"tau": 0.2}),), (("brake_fade", {"k": 0.02, "tau": 9.0}),),
                     (("wheel_lockup", {"mu": 0.35}),), (("aerodynamic_drag", {"c": 0.02}),)]),
)  # fmt: skip
def test_an_independent_judge_stops_from_everywhere(
    one: tuple[float, float, float], other: tuple[float, float, float], k: float, clear: float,
    cg_z: float, smooth: bool, effects: tuple[Any, ...],
) -> None:  # fmt: skip
    def height(x: np.ndarray, y: np.ndarray) -> np.ndarray:
        return sum(h * np.exp(-(((x - at) / w) ** 2)) for h, at, w in (one, other)) + 0.0 * y

    tables = tables_with(
        ("crest_unloading", {"k": k}), *effects, limits=EAGER, vehicle={"cg_z": cg_z}
    )
    plan = plan_one(
        tables, ground_map(height), straight(18.0), PlannerSettings(smooth=smooth), clear=clear
    )
    assert_sound(plan, tables, exact=False)
