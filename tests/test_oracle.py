"""The judge of plans judged: against closed forms, and with plans that break one rule each."""

from __future__ import annotations

import ast
import copy
import csv
import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.optimize import brentq

from tests import oracle
from tests.oracle import G, emergency_stop, emergency_stops_rk4, verify

MODEL: dict[str, Any] = {
    "name": "atv",
    "vehicle": {
        "mass": 500.0,
        "wheelbase": 1.2,
        "track_width": 1.0,
        "cg_x": 0.6,
        "cg_z": 0.55,
        "wheel_radius": 0.28,
        "drive": "skid_steer",
        "max_wheel_speed": 6.0,
        "max_drive_force": 2500.0,
        "max_drive_power": 6000.0,
    },
    "braking": {
        "m_m": -0.03,
        "b_m": -0.35,
        "m_b": 0.015,
        "b_b": 0.40,
        "dead_time": 0.30,
        "distance_offset": 0.20,
        "speed_range": [1.0, 4.0],
        "grade_range": [-0.26, 0.26],
    },
    "terrain": {"motion_resistance": 0.13, "lateral_resistance": 0.20, "slip_track": 1.15},
    "limits": {
        "speed": 4.0,
        "accel": 1.0,
        "decel": 1.5,
        "jerk": 2.0,
        "lateral_accel": 2.0,
        "min_load": 0.10,
    },
}
Plan = dict[str, np.ndarray]


def model_with(*effects: tuple[str, dict[str, float]], **changes: dict[str, Any]) -> dict[str, Any]:
    """The model with some keys changed, by table, and with effects."""
    model = copy.deepcopy(MODEL)
    for table, values in changes.items():
        model[table].update(values)
    if effects:
        model["effect"] = [{"name": name, "parameters": values} for name, values in effects]
    return model


def ground(
    length: float = 30.0,
    step: float = 0.5,
    grade: float | np.ndarray = 0.0,
    roll: float = 0.0,
    curvature: float = 0.0,
) -> Plan:
    """The ground of a plan: a plane or a hill on a straight or a circle, as a polyline."""
    n = round(length / step) + 1
    along = np.linspace(0.0, length, n)
    theta = np.broadcast_to(np.asarray(grade, float), (n,)).copy()
    middle = 0.5 * (theta[1:] + theta[:-1])
    level = np.concatenate([[0.0], np.cumsum(np.diff(along) * np.cos(middle))])
    z = np.concatenate([[0.0], np.cumsum(np.diff(along) * np.sin(middle))])
    if curvature:
        x, y = np.sin(curvature * level) / curvature, (1.0 - np.cos(curvature * level)) / curvature
    else:
        x, y = level, np.zeros(n)
    chords = np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2 + np.diff(z) ** 2)
    return {
        "station": np.concatenate([[0.0], np.cumsum(chords)]),
        "x": x,
        "y": y,
        "z": z,
        "grade": theta,
        "roll": np.full(n, roll),
        "curvature": np.full(n, curvature),
    }


def plan(columns: Plan, speed: np.ndarray, model: Mapping[str, Any], status: str = "ok") -> Plan:
    """A plan over that ground with those speeds; all bookkeeping is right."""
    s, n = columns["station"], len(columns["station"])
    ds = np.diff(s)
    accel = np.append(np.diff(speed**2) / (2.0 * ds), 0.0)
    mean = 0.5 * (speed[1:] + speed[:-1])
    spent = np.divide(ds, mean, out=np.zeros(n - 1), where=mean > 0.0)
    stops = emergency_stops_rk4(s, speed, columns, model)
    return {
        **columns,
        "candidate": np.full(n, "a", dtype=object),
        "speed": speed,
        "accel": accel,
        "time": np.concatenate([[0.0], np.cumsum(spent)]),
        "speed_bound": speed + 0.1,
        "limiting": np.full(n, "speed_limit", dtype=object),
        "stop_distance": np.where(np.isfinite(stops.distance), stops.distance, 1e3),
        "clear_distance": np.full(n, s[-1]),
        "rear_load": stops.rear_load,
        "status": np.full(n, status, dtype=object),
        "reason": np.full(n, "", dtype=object),
    }


def trapezoid(station: np.ndarray, top: float = 2.0, accel: float = 0.5, spare: float = 2.0):
    """Speeds from rest to rest, with a stop `spare` metres before the end."""
    left = np.maximum(station[-1] - spare - station, 0.0)
    return np.sqrt(np.minimum(np.minimum(2.0 * accel * station, 2.0 * accel * left), top**2))


def slow(model: Mapping[str, Any] = MODEL, top: float = 2.0, **of_ground: Any) -> Plan:
    columns = ground(**of_ground)
    return plan(columns, trapezoid(columns["station"], top), model)


def hills(n: int = 100, step: float = 0.4, seed: int = 7) -> Plan:
    """Rough ground, only good for stops: its columns need not fit each other."""
    rng = np.random.default_rng(seed)

    def walk(size: float) -> np.ndarray:
        steps = np.cumsum(rng.normal(size=n))
        steps -= steps.mean()
        return size * steps / np.abs(steps).max()

    s = np.arange(n) * step
    return {
        "station": s,
        "x": s.copy(),
        "y": np.sin(s / 5.0),
        "grade": walk(0.2),
        "roll": walk(0.15),
        "curvature": walk(0.2),
    }


def kinds(violations: list[oracle.Violation]) -> set[str]:
    return {violation.kind for violation in violations}


# ------------------------------------------------------------------------- closed forms: stops


@pytest.fixture(params=["ivp", "rk4"])
def stop(request: pytest.FixtureRequest) -> Callable[..., oracle.Stop]:
    def run(station: float, speed: float, *args: Any, **options: Any) -> oracle.Stop:
        if request.param == "ivp":
            return emergency_stop(station, speed, *args, **options)
        many = emergency_stops_rk4(np.array([station]), np.array([speed]), *args, **options)
        return many[0]

    return run


def test_level_ground(stop):
    v = 3.0
    a = G * (0.015 * v + 0.40)
    got = stop(1.0, v, ground(), MODEL)
    assert got.stopped
    assert got.distance == pytest.approx(v**2 / (2 * a) + 0.3 * v + 0.2, abs=1e-8)
    assert got.stop_station == pytest.approx(1.0 + got.distance - 0.2, abs=1e-12)


def test_below_the_trained_speed_its_coefficients_hold(stop):
    v = 0.4
    a = G * (0.015 * 1.0 + 0.40)
    got = stop(1.0, v, ground(), MODEL)
    assert got.distance == pytest.approx(v**2 / (2 * a) + 0.3 * v + 0.2, abs=1e-8)


def test_standing_needs_no_distance(stop):
    got = stop(1.0, 0.0, ground(grade=-0.2), MODEL)
    assert (got.distance, got.stop_station, got.stopped) == (0.0, 1.0, True)
    assert got.rear_load == pytest.approx(math.cos(0.2) - 0.55 / 0.6 * math.sin(0.2))


@pytest.mark.parametrize("grade", [-0.2, 0.15])
def test_constant_slope(stop, grade):
    v = 2.5
    a = G * ((-0.03 * v - 0.35) * grade + 0.015 * v + 0.40 + math.sin(grade))
    got = stop(2.0, v, ground(grade=grade), MODEL)
    assert got.distance == pytest.approx(v**2 / (2 * a) + 0.3 * v + 0.2, abs=1e-8)


def test_grade_linear_in_station(stop):
    """Energy: v²/2 is the integral of the deceleration over station."""
    v, rate = 3.0, -0.01
    columns = ground()
    columns["grade"] = rate * columns["station"]
    m, b = -0.03 * v - 0.35, 0.015 * v + 0.40
    onset = 2.0 + 0.3 * v

    def energy(s: float) -> float:
        return (m * rate * s**2 / 2 + b * s - math.cos(rate * s) / rate) * G

    rest = brentq(lambda s: energy(s) - energy(onset) - v**2 / 2, onset, 20.0, xtol=1e-12)
    assert stop(2.0, v, columns, MODEL).stop_station == pytest.approx(rest, abs=1e-8)


def test_brake_level_uphill_and_friction(stop):
    v, grade, roll = 2.0, 0.1, 0.2

    def of(force: float) -> float:
        return v**2 / (2 * G * (force + math.sin(grade))) + 0.3 * v + 0.2

    def got(**braking: Any) -> float:
        columns = ground(grade=grade, roll=roll)
        return stop(1.0, v, columns, model_with(braking=braking)).distance

    full = (-0.03 * v - 0.35) * grade + 0.015 * v + 0.40
    assert got() == pytest.approx(of(full), abs=1e-8)
    assert got(level=0.4) == pytest.approx(of(0.13 + 0.4 * (full - 0.13)), abs=1e-8)
    uphill = (0.02 * v - 0.1) * grade + 0.015 * v + 0.40
    assert got(uphill={"m_m": 0.02, "b_m": -0.1}) == pytest.approx(of(uphill), abs=1e-8)
    cap = 0.3 * math.cos(grade) * math.cos(roll)
    assert got(sliding_friction=0.3) == pytest.approx(of(cap), abs=1e-8)
    assert stop(1.0, v, ground(grade=-0.1), model_with()).distance == pytest.approx(
        stop(
            1.0, v, ground(grade=-0.1), model_with(braking={"uphill": {"m_m": 9.0, "b_m": 9.0}})
        ).distance
    )


EFFECT_SPEED = 3.0
BASE = 0.015 * EFFECT_SPEED + 0.40


def _constant(force: float) -> float:
    return EFFECT_SPEED**2 / (2 * G * force)


def _linear(a: float, k: float) -> float:
    """Distance under a deceleration a + k v."""
    return EFFECT_SPEED / k - a / k**2 * math.log1p(k * EFFECT_SPEED / a)


def _lagged(a: float, tau: float) -> float:
    v = EFFECT_SPEED

    def speed(t: float) -> float:
        return v - a * (t - tau * (1 - math.exp(-t / tau)))

    t = brentq(speed, 0.0, 20.0, xtol=1e-14)
    return v * t - a * (t**2 / 2 - tau * t + tau**2 * (1 - math.exp(-t / tau)))


def _faded(k: float) -> float:
    """On the level all energy goes into the brakes, q = (v_i² − v²)/2, if they do not cool."""
    q = EFFECT_SPEED**2 / 2
    return (q + k * q**2 / 2) / (G * BASE)


@pytest.mark.parametrize(
    ("name", "parameters", "expected"),
    [
        (
            "aerodynamic_drag",
            {"c": 0.1},
            math.log1p(0.1 * EFFECT_SPEED**2 / (G * BASE)) / (2 * 0.1),
        ),
        ("viscous_resistance", {"c": 0.05}, _linear(G * BASE, G * 0.05)),
        (
            "headwind",
            {"c": 0.05, "wind": 2.0, "direction": 0.0},
            _linear(G * BASE + 0.05 * 2.0**2, 0.05 * 2 * 2.0),
        ),
        (
            "headwind",
            {"c": 0.05, "wind": 4.0, "direction": math.pi / 3},
            _linear(G * BASE + 0.05 * 2.0**2, 0.05 * 2 * 2.0),
        ),
        ("brake_lag", {"tau": 0.25}, _lagged(G * BASE, 0.25)),
        ("brake_fade", {"k": 0.1, "tau": 1e12}, _faded(0.1)),
        ("wheel_lockup", {"mu": 0.3}, _constant(0.3)),
        ("directional_surface", {"k": 0.1, "direction": math.pi / 6}, _constant(BASE + 0.05)),
        ("step_change", {"scale": 0.8}, _constant(0.8 * BASE)),
        ("step_change", {"delta": -0.1, "run": 12.0}, _constant(BASE - 0.1)),
    ],
)
def test_effects_on_level_ground(stop, name, parameters, expected):
    got = stop(1.0, EFFECT_SPEED, ground(), model_with((name, parameters)))
    assert got.distance - 0.2 - 0.3 * EFFECT_SPEED == pytest.approx(expected, abs=2e-7)
    without = stop(1.0, EFFECT_SPEED, ground(), model_with((name, parameters)), effects=False)
    assert without == stop(1.0, EFFECT_SPEED, ground(), MODEL)
    assert abs(got.distance - without.distance) > 1e-3


@pytest.mark.parametrize(
    ("name", "k", "grade", "roll", "more"),
    [
        ("grade_asymmetry", 0.5, 0.1, 0.0, 0.05),
        ("grade_asymmetry", 0.5, -0.1, 0.0, 0.0),
        ("grade_nonlinearity", 2.0, 0.1, 0.0, 0.02),
        ("grade_nonlinearity", 2.0, -0.1, 0.0, -0.02),
        ("cross_slope", 0.5, 0.0, -0.1, 0.05),
    ],
)
def test_effects_of_the_slope(stop, name, k, grade, roll, more):
    v = EFFECT_SPEED
    force = (-0.03 * v - 0.35) * grade + BASE + more
    expected = _constant(force + math.sin(grade)) + 0.3 * v + 0.2
    got = stop(1.0, v, ground(grade=grade, roll=roll), model_with((name, {"k": k})))
    assert got.distance == pytest.approx(expected, abs=1e-8)


def test_turning_resistance(stop):
    curvature, k = -0.1, 0.5
    got = stop(
        1.0, EFFECT_SPEED, ground(curvature=curvature), model_with(("turning_resistance", {"k": k}))
    )
    expected = _linear(G * BASE, G * k * abs(curvature)) + 0.3 * EFFECT_SPEED + 0.2
    assert got.distance == pytest.approx(expected, abs=1e-7)


def test_heading_comes_from_the_path(stop):
    """Furrows across a circle: the force swings with twice the heading."""
    columns = ground(length=15.0, step=0.1, curvature=0.1)
    got = stop(
        0.0,
        EFFECT_SPEED,
        columns,
        model_with(("directional_surface", {"k": 0.2, "direction": 0.0})),
    )

    def energy(s: float) -> float:
        return G * (BASE * s + 0.2 * math.sin(2 * 0.1 * s) / (2 * 0.1))

    onset = 0.3 * EFFECT_SPEED
    rest = brentq(lambda s: energy(s) - energy(onset) - EFFECT_SPEED**2 / 2, onset, 14.0)
    assert got.stop_station == pytest.approx(rest, abs=1e-3)


def test_a_patch_begins_and_ends_at_its_edge(stop):
    v = EFFECT_SPEED
    patch = {"delta": -0.3, "x": 2.7, "y": 0.3, "radius": 0.5}
    got = stop(1.0, v, ground(), model_with(("surface_patch", patch)))
    inside = 2 * 0.4  # on the chord of the circle; the brakes set in at 1.9, before it
    left = v**2 / 2 - G * (BASE * (2.7 - 0.4 - 1.9) + (BASE - 0.3) * inside)
    assert got.stop_station == pytest.approx(2.7 + 0.4 + left / (G * BASE), abs=1e-5)


def test_an_effect_without_a_law_is_refused():
    with pytest.raises(ValueError, match="periodic_surface"):
        emergency_stop(0.0, 1.0, ground(), model_with(("periodic_surface", {})))


def test_surfaces_change_somewhere_between_stations(stop):
    v = 3.0
    columns = ground()
    model = model_with(
        braking={"terrain": {"ice": {"b_b": 0.2, "dead_time": 0.5}, "rock": {"b_b": 0.6}}}
    )
    n = len(columns["station"])
    force = 0.015 * v
    # The brakes set in at 1.9; the surface changes in [2, 2.5], where the smaller force counts.
    names = ["rock" if s <= 2.0 else "ice" for s in columns["station"]]
    left = v**2 / 2 - G * (force + 0.6) * 0.1
    got = stop(1.0, v, columns, model, surface=names)
    assert got.stop_station == pytest.approx(2.0 + left / (G * (force + 0.2)), abs=1e-5)
    # The larger force counts for the load, wherever it may still hold.
    assert got.rear_load == pytest.approx(1.0 - 0.55 / 0.6 * (force + 0.6), abs=1e-9)
    names = ["ice" if s <= 2.0 else "rock" for s in columns["station"]]
    onset = 1.0 + 0.5 * v  # past the change, with the dead time of where it began
    got = stop(1.0, v, columns, model, surface=names)
    assert got.stop_station == pytest.approx(onset + v**2 / (2 * G * (force + 0.6)), abs=1e-5)
    unknown = stop(1.0, v, columns, model, surface=["sand"] * n)
    assert unknown == stop(1.0, v, columns, model)


def test_no_stop_is_an_infinite_distance(stop):
    steep = stop(1.0, 2.0, ground(grade=-0.26), model_with(braking={"b_b": 0.1}))
    assert (steep.stopped, steep.distance) == (False, math.inf)
    late = stop(29.0, 4.0, ground(), MODEL)
    assert (late.stopped, late.distance) == (False, math.inf)
    off = stop(29.9, 4.0, ground(), MODEL)
    assert (off.stopped, off.distance) == (False, math.inf)


def test_ground_ends_where_it_is_unknown(stop):
    columns = ground()
    known = stop(1.0, 3.0, columns, MODEL)
    columns["grade"][8:] = np.nan
    assert stop(1.0, 3.0, columns, MODEL) == known
    columns["grade"][6:] = np.nan  # the last known station is now at 2.5
    assert known.stop_station > 2.5
    assert not stop(1.0, 3.0, columns, MODEL).stopped


# ------------------------------------------------------------------------- closed forms: loads


def test_loads_by_hand(stop):
    """500 kg on 5°, L = 1.2, cg 0.6 / 0.55: moments about the contact points, in newtons."""
    v, grade, weight = 2.0, -math.radians(5.0), 500.0 * G
    a = G * ((-0.06 - 0.35) * grade + 0.03 + 0.40 + math.sin(grade))
    rear = (
        (1.2 - 0.6) * weight * math.cos(grade) - 0.55 * 500.0 * a + 0.55 * weight * math.sin(grade)
    ) / 1.2
    front = (0.6 * weight * math.cos(grade) + 0.55 * weight * -math.sin(grade)) / 1.2
    got = stop(1.0, v, ground(grade=grade), MODEL)
    assert got.rear_load == pytest.approx(rear / (weight / 2), abs=1e-9)
    # The front is lightest while the speed is still held.
    assert got.front_load == pytest.approx(front / (weight / 2), abs=1e-9)


def test_the_centre_of_gravity_need_not_be_in_the_middle(stop):
    model = model_with(vehicle={"cg_x": 0.4})
    force = 0.015 * 2.0 + 0.40
    got = stop(1.0, 2.0, ground(), model)
    assert got.rear_load == pytest.approx(1.0 - 0.55 / 0.8 * force, abs=1e-9)
    uphill = stop(1.0, 2.0, ground(grade=0.1), model)
    assert uphill.front_load == pytest.approx(math.cos(0.1) - 0.55 / 0.4 * math.sin(0.1), abs=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_side_loads(stop, sign):
    v, roll, curvature = 2.0, 0.1, 0.1

    def got(roll: float, curvature: float) -> float:
        return stop(1.0, v, ground(roll=roll, curvature=curvature), MODEL).side_load

    slope = 2 * 0.55 / 1.0 * math.sin(roll)
    turn = 2 * 0.55 / 1.0 * v**2 * curvature / math.cos(roll) / G
    # Left side up in a left turn: both take load off the left. In a right turn they compensate.
    assert got(sign * roll, sign * curvature) == pytest.approx(math.cos(roll) - slope - turn)
    assert got(sign * roll, -sign * curvature) == pytest.approx(math.cos(roll) - slope)  # at rest
    assert got(sign * roll, 0.0) == pytest.approx(math.cos(roll) - slope)


def test_loads_see_a_ridge_between_the_steps_of_the_integration(stop):
    """A grade that peaks at one station; the rear is lightest right there."""
    columns = ground(step=0.1)
    columns["grade"][18] = -0.2  # at 1.8, after the brakes have set in at 1.6
    force = (-0.06 - 0.35) * -0.2 + 0.03 + 0.40
    # Beyond it the ground falls away with 0.2 rad in 0.1 m, at the v² that is left there.
    decel = G * (0.03 + 0.40)
    crest = (4.0 - 2.0 * decel * 0.1) * 2.0 / G
    expected = math.cos(0.2) - 0.55 / 0.6 * force - crest
    assert stop(1.0, 2.0, columns, MODEL).rear_load == pytest.approx(expected, abs=0.2)


ALL_EFFECTS = (
    ("aerodynamic_drag", {"c": 0.02}),
    ("headwind", {"c": 0.01, "wind": 3.0, "direction": 0.4}),
    ("viscous_resistance", {"c": 0.02}),
    ("brake_lag", {"tau": 0.15}),
    ("brake_fade", {"k": 0.05, "tau": 20.0}),
    ("wheel_lockup", {"mu": 0.45}),
    ("grade_asymmetry", {"k": 0.2}),
    ("grade_nonlinearity", {"k": 0.3}),
    ("cross_slope", {"k": 0.2}),
    ("turning_resistance", {"k": 0.3}),
    ("surface_patch", {"delta": -0.15, "x": 15.0, "y": 0.0, "radius": 2.0}),
    ("directional_surface", {"k": 0.05, "direction": 1.0}),
    ("step_change", {"scale": 0.9}),
)


@pytest.mark.parametrize("effects", [(), ALL_EFFECTS], ids=["base", "all effects"])
def test_fixed_steps_agree_with_error_control(effects):
    columns = hills()
    model = model_with(*effects, braking={"uphill": {"m_m": -0.02, "b_m": -0.2}, "level": 0.95})
    rng = np.random.default_rng(3)
    stations, speeds = rng.uniform(0.0, 39.0, 40), rng.uniform(0.0, 4.0, 40)
    fast = emergency_stops_rk4(stations, speeds, columns, model)
    assert 30 < fast.stopped.sum() < 40
    for i, (station, speed) in enumerate(zip(stations, speeds, strict=True)):
        sure = emergency_stop(station, speed, columns, model)
        assert sure.stopped == fast.stopped[i]
        if sure.stopped:
            assert sure.distance == pytest.approx(fast.distance[i], abs=1e-5)
            assert sure.rear_load == pytest.approx(fast.rear_load[i], abs=2e-5)
            assert sure.side_load == pytest.approx(fast.side_load[i], abs=2e-5)
            assert sure.front_load == pytest.approx(fast.front_load[i], abs=2e-5)


# ---------------------------------------------------------------------------------- good plans


@pytest.mark.parametrize("method", ["rk4", "ivp"])
def test_a_slow_plan_is_clean(method):
    every = 4 if method == "ivp" else 1
    options = {"method": method, "every": every, "interior": 2, "jerk": True}
    columns = ground(length=20.0)
    s = columns["station"]
    speed = 0.8 * np.sin(np.pi * np.clip(s / 18.0, 0.0, 1.0)) ** 2
    speed[speed < 1e-9] = 0.0
    good = plan(columns, speed, MODEL)
    assert verify(good, model_with(limits={"jerk": 5.0}), **options) == []


@pytest.mark.parametrize("effects", [(), ALL_EFFECTS], ids=["base", "all effects"])
def test_a_slow_plan_over_a_hill_is_clean(effects):
    model = model_with(*effects)
    grade = 0.1 * np.sin(np.arange(61) / 8.0)
    good = slow(model, top=1.5, grade=grade, roll=0.05, curvature=0.05)
    assert verify(good, model) == []
    assert verify({**good, "candidate": good["candidate"]}, model, interior=0) == []


def test_a_blocked_plan_may_have_rows_that_are_not_reached():
    columns = ground()
    s = columns["station"]
    speed = trapezoid(s, spare=10.0)
    blocked = plan(columns, speed, MODEL, status="blocked")
    blocked["clear_distance"][:] = 22.0
    assert verify(blocked, MODEL) == []


def test_a_stop_in_between_is_no_end():
    columns = ground()
    s = columns["station"]
    speed = np.sqrt(0.5 * np.minimum(np.abs(s - 12.0), np.minimum(s, 28.0 - s).clip(0.0)))
    assert speed[24] == 0.0
    assert speed[25] > 0.0
    assert verify(plan(columns, speed, MODEL), MODEL) == []


def test_infeasible_plans_are_only_checked_for_bookkeeping():
    columns = ground()
    speed = np.full(len(columns["station"]), 3.0)
    bad = plan(columns, speed, MODEL, status="infeasible")
    assert verify(bad, model_with(limits={"speed": 1.0})) == []
    bad["stop_distance"][-1] = np.inf
    assert verify(bad, MODEL) == []
    bad["stop_distance"][0] += 0.01
    assert kinds(verify(bad, MODEL)) == {"bookkeeping"}


# ---------------------------------------------------------------------- plans that break a rule


def test_overrun_between_stations():
    """At its stations the plan can stop, but in the middle of the last, long segment not."""
    columns = ground(length=34.0, step=2.0)
    speed = np.where(columns["station"] < 30.0, 2.5, 0.0)
    speed[0] = 0.0
    model = model_with(limits={"decel": 5.0, "accel": 5.0}, braking={"distance_offset": 0.0})
    bad = plan(columns, speed, model)
    bad["clear_distance"][:] = 30.02
    assert bad["station"][14] + bad["stop_distance"][14] < 30.0
    found = verify(bad, model)
    assert kinds(found) == {"overrun"}
    assert all(28.0 < violation.station < 30.0 for violation in found)
    assert verify(bad, model, interior=0) == []


@pytest.mark.parametrize("method", ["rk4", "ivp"])
def test_overrun_at_stations(method):
    bad = slow()
    # The stop from 20.0 m at 2 m/s ends at 21.3 m with its offset.
    bad["clear_distance"][:] = 21.0
    found = verify(bad, MODEL, interior=0, method=method)
    assert kinds(found) >= {"overrun", "bookkeeping"}
    a = G * (0.015 * 2.0 + 0.40)
    distance = 4.0 / (2 * a) + 0.6 + 0.2
    [there] = [v for v in found if v.kind == "overrun" and v.station == 20.0]
    assert there.amount == pytest.approx(20.0 + distance - 21.0, abs=1e-7)
    assert there.candidate == "a"


def test_overrun_of_a_stop_that_never_ends():
    model = model_with(braking={"b_b": 0.1, "grade_range": [-0.4, 0.4]})
    columns = ground(grade=-0.25)
    speed = trapezoid(columns["station"], accel=0.01)
    bad = plan(columns, speed, model)
    worst = max(verify(bad, model), key=lambda violation: violation.amount)
    assert (worst.kind, worst.amount) == ("overrun", math.inf)


def _curved(**options: Any) -> Plan:
    return slow(curvature=0.3, step=0.2, **options)


PLANTED: dict[str, tuple[str, dict[str, dict[str, Any]], Callable[[dict[str, Any]], Plan]]] = {
    "rear axle": ("rear_load", {"limits": {"min_load": 0.7}}, slow),
    "rear axle downhill": (
        "rear_load",
        {"limits": {"min_load": 0.55}, "braking": {"b_b": 0.41}},
        lambda m: slow(m, grade=-0.15),
    ),
    "side": (
        "side_load",
        {"limits": {"min_load": 0.7}, "vehicle": {"wheelbase": 3.0, "cg_x": 1.5}},
        lambda m: slow(m, roll=0.3),
    ),
    "front axle": (
        "front_load",
        {"limits": {"min_load": 0.65}, "vehicle": {"cg_x": 0.3}},
        lambda m: slow(m, grade=0.2),
    ),
    "speed limit": ("speed_limit", {"limits": {"speed": 1.9}}, slow),
    "trained speed": ("speed_range", {"braking": {"speed_range": [1.0, 1.9]}}, slow),
    "lateral": (
        "lateral",
        {"limits": {"lateral_accel": 1.1}},
        lambda m: slow(m, curvature=0.3, step=0.2),
    ),
    "wheel speed": ("wheel_speed", {"vehicle": {"max_wheel_speed": 1.9}}, slow),
    "wheel speed in a turn": (
        "wheel_speed",
        {"vehicle": {"max_wheel_speed": 2.32}},
        lambda m: slow(m, curvature=0.3, step=0.2),
    ),
    "acceleration": ("accel", {"limits": {"accel": 0.4}}, slow),
    "deceleration": ("decel", {"limits": {"decel": 0.4}}, slow),
    "drive force": ("drive", {"vehicle": {"max_drive_force": 880.0}}, slow),
    "drive power": ("drive", {"vehicle": {"max_drive_power": 1500.0}}, slow),
    "drive in a turn": (
        "drive",
        {"vehicle": {"max_drive_force": 900.0, "mass": 500.0}},
        lambda m: slow(m, curvature=0.3, step=0.2),
    ),
    "trained grade": (
        "grade_range",
        {"braking": {"grade_range": [-0.05, 0.26]}},
        lambda m: slow(m, grade=-0.1),
    ),
}


@pytest.mark.parametrize("name", PLANTED)
def test_a_plan_that_breaks_exactly_one_rule(name):
    kind, changes, make = PLANTED[name]
    model = model_with(**changes)
    bad = make(model)
    found = verify(bad, model, interior=2)
    assert kinds(found) == {kind}
    assert all(violation.amount > 0.0 for violation in found)
    assert kind in oracle.describe(found)


def test_the_same_turns_pass_where_the_limit_is_just_above():
    """The other side of the planted cases: the rule bites at the limit, not before."""
    assert verify(_curved(), model_with(limits={"lateral_accel": 1.21})) == []
    rim = 2.0 * (1.0 + 0.3 * 1.15 / 2.0)
    assert verify(_curved(), model_with(vehicle={"max_wheel_speed": rim + 1e-4})) == []
    tight = {"max_wheel_speed": 2.0 * (1.0 + 0.3 * 1.0 / 2.0) + 1e-4}
    assert verify(_curved(), model_with(vehicle={**tight, "drive": "ackermann"})) == []
    assert kinds(verify(_curved(), model_with(vehicle=tight))) == {"wheel_speed"}
    straight = 500.0 * (0.5 + G * 0.13)
    assert verify(slow(), model_with(vehicle={"max_drive_force": straight + 0.1})) == []
    turning = straight + 500.0 * G * 0.2 * 1.2 * 0.3 / 2.0
    assert verify(_curved(), model_with(vehicle={"max_drive_force": turning + 0.1})) == []
    short = model_with(vehicle={"max_drive_force": turning - 0.1})
    assert kinds(verify(_curved(), short)) == {"drive"}
    extrapolating = {"grade_range": [-0.05, 0.26], "extrapolate": True}
    model = model_with(braking=extrapolating)
    assert verify(slow(model, grade=-0.1), model) == []


def test_the_front_must_keep_its_load_while_driving():
    """Uphill on the throttle the front is lighter than in any stop."""
    model = model_with(vehicle={"cg_x": 0.3})
    good = slow(model, grade=0.2)
    light = math.cos(0.2) - 0.55 / 0.3 * (math.sin(0.2) + 0.5 / G)
    assert verify(good, model_with(vehicle={"cg_x": 0.3}, limits={"min_load": light - 1e-3})) == []
    found = verify(good, model_with(vehicle={"cg_x": 0.3}, limits={"min_load": light + 1e-3}))
    assert kinds(found) == {"front_load"}
    assert all("driving" in violation.text for violation in found)


def test_the_brakes_must_give_the_planned_deceleration():
    model = model_with(braking={"b_b": 0.03, "m_b": 0.0})
    columns = ground(length=40.0)
    s = columns["station"]
    speed = np.sqrt(np.clip(0.2 * np.minimum(s, 40.0 - s - 8.0), 0.0, 1.2))
    assert verify(plan(columns, speed, model), model) == []
    speed[30:] = np.minimum(speed[30:], np.sqrt(0.8))  # 0.4 m/s² where the brakes give 0.29
    found = verify(plan(columns, speed, model), model)
    assert kinds(found) == {"decel"}
    assert {violation.station for violation in found} <= set(np.arange(14.5, 15.01, 0.1).round(9))


def test_jerk():
    columns = ground()
    s = columns["station"]
    bad = plan(columns, trapezoid(s), MODEL)
    *step, halt = np.flatnonzero(np.abs(np.diff(bad["accel"])) > 0.4)
    step = np.array(step)
    assert len(step) == 2
    assert bad["speed"][halt + 1] == 0.0
    span = (bad["time"][step + 2] - bad["time"][step]) / 2.0
    jerks = 0.5 / span
    assert verify(bad, model_with(limits={"jerk": jerks.max() + 1e-6}), jerk=True) == []
    model = model_with(limits={"jerk": 0.97 * jerks.min()})
    assert verify(bad, model) == []
    found = verify(bad, model, jerk=True)
    assert [violation.kind for violation in found] == ["jerk", "jerk"]
    assert [violation.station for violation in found] == s[step + 1].tolist()


def test_steep_ground_ahead_counts_with_the_stop_that_meets_it():
    """The plan itself ends before the steep ground, but a stop from it does not."""
    columns = ground()
    s = columns["station"]
    columns["grade"][s >= 22.5] = 0.1  # rising from 22.0 m; too steep from 22.25 m on
    model = model_with(braking={"grade_range": [-0.26, 0.05]}, limits={"decel": 5.0})

    def found(top: float) -> list[oracle.Violation]:
        speed = np.where(s < 21.9, np.minimum(np.sqrt(s), top), 0.0)
        return verify(plan(columns, speed, model), model, interior=0)

    def rest(v: float) -> float:
        return 21.5 + v**2 / (2 * G * (0.015 * v + 0.40)) + 0.3 * v + 0.2

    assert rest(1.2) < 22.25 < rest(1.3)
    assert found(1.2) == []
    [bad] = found(1.3)
    assert (bad.kind, bad.station) == ("grade_range", 21.5)


def _set(name: str, row: int | slice, change: Callable[[Any], Any]) -> Callable[[Plan], None]:
    def apply(columns: Plan) -> None:
        columns[name] = columns[name].copy()
        columns[name][row] = change(columns[name][row])

    return apply


BOOKKEEPING: dict[str, Callable[[Plan], None]] = {
    "acceleration does not fit the speeds": _set("accel", 10, lambda a: a + 1e-3),
    "time does not fit the speeds": _set("time", slice(20, None), lambda t: t + 1e-3),
    "speed above its bound": _set("speed_bound", 10, lambda v: v - 0.11),
    "stations are not the length of the path": _set("z", 30, lambda z: z + 0.01),
    "stations decrease": _set("station", 30, lambda s: s - 1.0),
    "stopping distance is too short": _set("stop_distance", 20, lambda d: d - 3e-3),
    "stopping distance is too long": _set("stop_distance", 20, lambda d: d + 3e-3),
    "stopping distance at rest": _set("stop_distance", -1, lambda d: d - 0.2),
    "rear load": _set("rear_load", 20, lambda share: share + 2e-3),
    "not a number": _set("speed_bound", 3, lambda v: np.nan),
    "speed is not finite": _set("speed", 3, lambda v: np.inf),
    "speed is negative": _set("speed", 0, lambda v: -0.1),
    "ground is not finite": _set("grade", -1, lambda g: np.nan),
    "no such status": _set("status", slice(None), lambda s: "fine"),
    "two statuses": _set("status", 0, lambda s: "blocked"),
    "no such column": lambda columns: columns.__delitem__("rear_load"),
    "columns of different length": lambda columns: columns.update(z=columns["z"][:-1]),
}


@pytest.mark.parametrize("name", BOOKKEEPING)
def test_bookkeeping(name):
    bad = slow()
    assert verify(bad, MODEL) == []
    BOOKKEEPING[name](bad)
    assert kinds(verify(bad, MODEL)) == {"bookkeeping"}


def test_the_reported_stop_must_end_before_the_clear_distance_too():
    bad = slow()
    own = bad["stop_distance"][20]
    bad["clear_distance"][20] = bad["station"][20] + own + 1e-3
    assert verify(bad, MODEL, interior=0) == []
    bad["stop_distance"][20] = own + 1.5e-3
    [found] = verify(bad, MODEL, interior=0)
    assert (found.kind, found.station) == ("bookkeeping", bad["station"][20])
    assert found.amount == pytest.approx(0.5e-3)


def test_reports_may_be_on_the_safe_side_where_asked():
    careful = slow()
    careful["stop_distance"] = careful["stop_distance"] + np.where(careful["speed"] > 0.0, 0.1, 0.0)
    careful["rear_load"] = careful["rear_load"] - 0.05
    assert kinds(verify(careful, MODEL)) == {"bookkeeping"}
    assert verify(careful, MODEL, exact=False) == []
    rash = slow()
    rash["stop_distance"] = rash["stop_distance"] - np.where(rash["speed"] > 0.0, 0.1, 0.0)
    assert kinds(verify(rash, MODEL, exact=False)) == {"bookkeeping"}


def test_moving_on_beyond_a_standstill():
    bad = slow()
    bad["speed"] = bad["speed"].copy()
    bad["speed"][-1] = 1.0
    bad["accel"] = bad["accel"].copy()
    bad["accel"][-2] = 1.0
    bad["time"] = bad["time"].copy()
    bad["time"][-1] += 1.0
    bad["speed_bound"] = bad["speed_bound"] + 1.0
    assert "bookkeeping" in kinds(verify(bad, MODEL))


def test_weaker_surfaces_are_found_out():
    model = model_with(braking={"terrain": {"ice": {"b_b": 0.005}}})
    good = slow(model)
    assert verify(good, model) == []
    names = ["ice" if s > 26.0 else "grass" for s in good["station"]]
    found = verify(good, model, surface=names)
    assert "overrun" in kinds(found)
    assert min(violation.station for violation in found) > 20.0


# -------------------------------------------------------------------------------- files, itself


def test_read_plan(tmp_path: Path):
    one, two = slow(), slow(length=20.0)
    two["candidate"] = np.full(len(two["station"]), "b", dtype=object)
    names = list(one)
    path = tmp_path / "plan.csv"
    with open(path, "w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        for columns in (one, two):
            writer.writerows(zip(*(columns[name].tolist() for name in names), strict=True))
    read = oracle.read_plan(path)
    assert list(read) == ["a", "b"]
    for columns, again in zip((one, two), read.values(), strict=True):
        assert all(np.array_equal(columns[name], again[name]) for name in names)
    assert verify(read["a"], MODEL) == []
    path.write_text("candidate,station\na,0\n", encoding="utf-8")
    with pytest.raises(ValueError, match="clear_distance"):
        oracle.read_plan(path)


def test_read_model(tmp_path: Path):
    path = tmp_path / "model.toml"
    path.write_text('name = "atv"\n[braking]\nspeed_range = [1.0, 4.0]\n', encoding="utf-8")
    assert oracle.read_model(path)["braking"]["speed_range"] == [1.0, 4.0]


def test_only_two_methods():
    with pytest.raises(ValueError, match="euler"):
        verify(slow(), MODEL, method="euler")


def test_the_oracle_shares_no_code():
    tree = ast.parse(Path(oracle.__file__).read_text(encoding="utf-8"))
    imported = {
        name.split(".")[0]
        for node in ast.walk(tree)
        if isinstance(node, ast.Import | ast.ImportFrom)
        for name in (
            [node.module or ""]
            if isinstance(node, ast.ImportFrom)
            else [alias.name for alias in node.names]
        )
    }
    assert imported <= {"numpy", "scipy", *sys.stdlib_module_names}
