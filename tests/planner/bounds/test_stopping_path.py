"""Stopping paths, and bounds of a batch as Python knows them."""

from __future__ import annotations

import dataclasses
import re
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.planner.bounds.speed_bounds import STOP_GUARD, speed_bounds
from slopewise.planner.ground.terrain_profile import TerrainProfile
from slopewise.planner.limiting import Limiting
from tests.world.compilers import CORE
from tests.world.ground import ground_map, plane, straight
from tests.world.stages import bounds_of
from tests.world.vehicles import BASE, G, Tables, model_of, tables_with

NO_LIMITS = {"speed": 8.0, "min_load": 0.01}
FULL_ON_CRESTS = ("crest_unloading", {"k": 0.0})
"""Brakes whose force does not depend on the wheel loads."""

FAST = {"speed_range": [0.0, 8.0], "grade_range": [-0.5, 0.5]}


def hills(x: Any, y: Any) -> Any:
    return 0.8 * np.sin(x / 4.0) + 0.1 * np.sin(x / 1.1)


def stop_by_scipy(
    profile: TerrainProfile, tables: Tables, k: int, v: float, *, crests: bool = False
) -> float:
    """Station at which the vehicle rests: v' = −g (F_b/W + sin θ) with θ linear in station.

    With crests the force is that share of itself which still presses on the ground.
    """
    b = tables["braking"]
    station, grade = profile.station[:, 0], profile.grade[:, 0]
    v_i = max(v, b["speed_range"][0])

    def rates(_: float, y: np.ndarray) -> list[float]:
        theta = np.interp(y[0], station, grade)
        force = (b["m_m"] * v_i + b["b_m"]) * theta + b["m_b"] * v_i + b["b_b"]
        if crests:
            i = min(int(np.searchsorted(station, y[0], "right")) - 1, len(station) - 2)
            falls = (grade[i + 1] - grade[i]) / (station[i + 1] - station[i])
            force *= 1.0 + min(falls, 0.0) * y[1] ** 2 / (G * np.cos(theta))
        return [y[1], -G * (force + np.sin(theta))]

    def at_rest(_: float, y: np.ndarray) -> float:
        return y[1]

    at_rest.terminal = True
    run = solve_ivp(
        rates,
        (0.0, 60.0),
        [station[k] + v * b["dead_time"], v],
        events=[at_rest],
        rtol=1e-10,
        atol=1e-12,
        max_step=0.02,
    )
    assert len(run.t_events[0]) == 1
    return float(run.y_events[0][0, 0])


@pytest.mark.parametrize("integrated", [False, True])
@pytest.mark.parametrize(
    ("b_m", "m_m", "m_b", "dead_time", "slowest"),
    [
        (-0.35, -0.03, 0.015, 0.3, 0.0),
        (0.1, -0.01, -0.005, 0.0, 0.0),
        (0.0, 0.0, 0.0, 0.6, 0.0),
        (-0.5, 0.06, 0.03, 0.15, 2.5),
    ],
)
def test_stops_on_hills_end_just_before_the_end_of_the_way(
    b_m: float, m_m: float, m_b: float, dead_time: float, slowest: float, integrated: bool
) -> None:
    tables = tables_with(
        FULL_ON_CRESTS,
        limits=NO_LIMITS,
        braking=FAST
        | {
            "b_m": b_m,
            "m_m": m_m,
            "m_b": m_b,
            "dead_time": dead_time,
            "speed_range": [slowest, 8.0],
        },
    )
    profile, _, bounds = bounds_of(
        model_of(tables),
        ground_map(hills, resolution=0.1),
        straight(16.0),
        spacing=0.05,
        closed_form=not integrated,
    )
    limited = np.flatnonzero(bounds.limiting[:, 0] == Limiting.STOPPING_PATH)
    clear = bounds.clear_distance[0] - 0.2
    checked = 0
    for k in limited[:: max(len(limited) // 12, 1)]:
        v = float(np.sqrt(bounds.speed_sq_max[k, 0]))
        if v == 0.0 or clear - profile.station[k, 0] < 0.3:
            continue
        stop = stop_by_scipy(profile, tables, int(k), v)
        assert stop <= clear - 0.5 * STOP_GUARD
        # Tight: what is given up are the guard and the chords, millimetres.
        assert stop >= clear - STOP_GUARD - 0.015
        checked += 1
    assert checked >= 5


def test_what_crests_take_from_the_force_is_left_out_of_the_stop() -> None:
    """Never too little, and not much too much: the least force over a whole stop would be it."""
    tables = tables_with(limits=NO_LIMITS, braking=FAST)
    profile, _, bounds = bounds_of(
        model_of(tables), ground_map(hills, resolution=0.1), straight(16.0), spacing=0.05
    )
    limited = np.flatnonzero(bounds.limiting[:, 0] == Limiting.STOPPING_PATH)
    clear, left, ignored = bounds.clear_distance[0] - 0.2, [], []
    for k in limited[:: max(len(limited) // 12, 1)]:
        v = float(np.sqrt(bounds.speed_sq_max[k, 0]))
        if v == 0.0 or clear - profile.station[k, 0] < 0.3:
            continue
        left.append(clear - stop_by_scipy(profile, tables, int(k), v, crests=True))
        ignored.append(clear - stop_by_scipy(profile, tables, int(k), v))
    assert len(left) >= 5
    assert min(left) >= 0.5 * STOP_GUARD
    assert max(left) < 0.6 * max(ignored)


def test_the_bound_converges_with_the_spacing() -> None:
    """Distance given up shrinks at least with the square of the spacing."""
    tables = tables_with(FULL_ON_CRESTS, limits=NO_LIMITS, braking=FAST)
    model, ground, lost = model_of(tables), ground_map(hills, resolution=0.05), []
    for spacing in (0.4, 0.2, 0.1):
        profile, _, bounds = bounds_of(model, ground, straight(12.0), spacing=spacing)
        k = int(np.argmin(np.abs(profile.x[:, 0] - 6.0)))
        stop = stop_by_scipy(profile, tables, k, float(np.sqrt(bounds.speed_sq_max[k, 0])))
        lost.append(profile.station[-1, 0] - 0.2 - STOP_GUARD - stop)
    # Up to rounding never negative, or the guard is eaten.
    assert min(lost) > -0.5 * STOP_GUARD
    assert lost[2] < 0.35 * lost[0]


def test_a_tip_over_on_the_way_limits_the_speed_before_it() -> None:
    """Force grows with the speed at onset: fast stops unload the rear, slow ones do not."""
    tables = tables_with(
        vehicle={"cg_z": 0.72},
        braking={"m_b": 0.08, "b_b": 0.42, "m_m": 0.0, "b_m": 0.0, "speed_range": [0.5, 6.0]},
        limits={"min_load": 0.2, "speed": 6.0},
    )
    profile, _, bounds = bounds_of(model_of(tables), plane(rise=-0.2), straight(30.0), spacing=0.1)
    k = 10
    assert bounds.limiting[k, 0] == Limiting.TIP_OVER
    v = float(np.sqrt(bounds.speed_sq_max[k, 0]))
    # (L − cg_x) cos θ − cg_z (m_b v + b_b) = min_load (L − cg_x)
    theta = profile.grade[k, 0]
    exact = ((np.cos(theta) - 0.2) * 0.6 / 0.72 - 0.42) / 0.08
    assert exact - 0.01 < v <= exact
    # Uphill of the slope, on level ground, the stop may begin faster: it ends before the slope.
    brink = ground_map(lambda x, y: -0.2 * np.maximum(x - 15.0, 0.0))
    _, _, before = bounds_of(model_of(tables), brink, straight(30.0), spacing=0.1)
    assert before.speed_sq_max[2, 0] > bounds.speed_sq_max[k, 0]


def test_codes_of_bounds_are_those_of_python() -> None:
    codes = re.findall(r"Label (\w+) = (\d+);", (CORE / "bounds" / "limiting.hpp").read_text())
    assert len(codes) > 10
    assert {name.upper(): int(code) for name, code in codes}.items() <= {
        label.name: label.value for label in Limiting
    }.items()


def test_arrays_that_do_not_fit_are_named() -> None:
    profile, ground, _ = bounds_of(BASE, plane(0.0))
    with pytest.raises(ValueError, match="clear: expected 1 along axis 0, got 2"):
        speed_bounds(profile, ground, BASE, np.ones(2))
    short = dataclasses.replace(ground, fastest=ground.fastest[:-1])
    with pytest.raises(ValueError, match=r"fastest: expected \d+ along axis 0"):
        speed_bounds(profile, short, BASE, np.ones(1))
    strided = dataclasses.replace(profile, grade=np.repeat(profile.grade, 2, axis=1)[:, ::2])
    with pytest.raises(TypeError, match="grade: expected a contiguous"):
        speed_bounds(strided, ground, BASE, np.ones(1))
