"""No exported stop is shorter, and no exported speed higher, than the model and its plans allow."""

from __future__ import annotations

import math
import shutil
import subprocess
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise import plan
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.effects import registry
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking
from slopewise.services.export.c_code import write_c
from slopewise.services.export.functions import ModelFunction, functions_of
from slopewise.services.io.model_file import find_model, read_model
from tests.world.ground import ground_map

SHIPPED = [read_model(find_model(name)) for name in ("atv", "husky", "ugv")]
EXACT, RELATIVE = 1e-3, 1e-6  # [m], [1]
POINTS = 5
"""Speeds and grades of one model: other models show more than more points of one."""

Draw = Callable[[float, float], float]
EFFECTS: dict[str, Callable[[Draw], dict[str, float]]] = {
    "aerodynamic_drag": lambda u: {"c": u(0.0, 0.05)},
    "headwind": lambda u: {"c": u(0, 0.02), "wind": u(-15, 15), "direction": u(-3, 3)},
    "viscous_resistance": lambda u: {"c": u(0.0, 0.04)},
    "brake_lag": lambda u: {"tau": u(0.02, 0.6)},
    "brake_fade": lambda u: {"k": u(0.0, 0.03), "tau": u(20.0, 300.0)},
    "wheel_lockup": lambda u: {"mu": u(0.3, 0.7)},
    "grade_asymmetry": lambda u: {"k": u(-0.3, 0.3)},
    "grade_nonlinearity": lambda u: {"k": u(-1.0, 1.0)},
    "crest_unloading": lambda u: {"k": u(0.0, 1.0)},
    "cross_slope": lambda u: {"k": u(-0.3, 0.3)},
    "turning_resistance": lambda u: {"k": u(0.0, 0.1)},
    "surface_patch": lambda u: {"delta": u(-0.1, 0.1), "x": 0.0, "y": 0.0, "radius": 1e4},
    "directional_surface": lambda u: {"k": u(-0.05, 0.05), "direction": u(-3.0, 3.0)},
    "step_change": lambda u: {"scale": u(0.7, 1.2), "delta": u(-0.05, 0.05)},
    "session_drift": lambda u: {"k": u(-1e-5, 1e-5)},
}


def drawn_model(rng: np.random.Generator, number: int) -> Model:
    """A shipped vehicle with an effect, or several, and keys of `[braking]` that change a stop."""

    def u(low: float, high: float) -> float:
        return float(rng.uniform(low, high))

    names = list(EFFECTS)
    chosen = {names[number % len(names)]} if number % 2 else set(rng.choice(names, number % 4))
    model = SHIPPED[rng.integers(3)]
    keys: dict[str, Any] = {
        "drive_in_dead_time": ("held", "cut", "either")[rng.integers(3)],
        "dead_time": u(0.0, 0.6),
        "distance_offset": u(0.0, 0.3),
        "time_offset": u(0.0, 0.3),
        "force_std": 0.02,
        "force_scatter": 0.02,
        "dead_time_std": 0.02,
    }
    if rng.random() < 0.3:
        keys["uphill"] = UphillBraking(m_m=u(-0.05, 0.05), b_m=u(-0.4, 0.2))
    if rng.random() < 0.3:
        keys |= {"level": 0.8, "dead_band": 0.1}
    if rng.random() < 0.3:
        keys["sliding_friction"] = u(0.3, 0.7)
    effects = tuple(Effect(name=name, parameters=EFFECTS[name](u)) for name in sorted(chosen))
    return replace(model, braking=replace(model.braking, **keys), effect=effects)


def driven(model: Model, on: Braking, speed: float, grade: float, time: float) -> float:
    """The longer of two simulated stops, the speed held or the drive cut in the dead time [m]."""
    track, bare = GroundTrack.of_grade(grade), replace(on, dead_time=0.0)
    held = speed * on.dead_time
    ways = [(speed, held)]
    pull = -math.sin(grade) - model.terrain.motion_resistance
    if on.drive_in_dead_time != "held" and pull > 0.0:
        gain = GRAVITY * pull * on.dead_time
        ways.append((speed + gain, held + 0.5 * gain * on.dead_time))
    at_once = replace(model, braking=bare)
    stops = [
        gone + simulate_stop(at_once, track, onset, session_time=time).distance
        for onset, gone in ways
    ]
    return max(stops) + on.distance_offset


def named(model: Model) -> dict[str, ModelFunction]:
    return {function.name: function for function in functions_of(model)}


def exported(model: Model, name: str, first: float, grade: float, time: float = 0.0) -> float:
    """A function of one surface, straight along x at the origin."""
    functions, (kind, *surface) = named(model), name.split(":")
    end = f"_{surface[0]}" if surface else ""
    return value_of(functions, kind, end, first, grade, time)


def value_of(
    functions: dict[str, ModelFunction],
    kind: str,
    end: str,
    first: float,
    grade: float,
    time: float,
) -> float:
    ground = functions[f"ground_force{end}"]
    place = (grade, 0.0, 0.0, 0.0, 0.0, time)[: len(ground.inputs)]
    return float(functions[f"{kind}{end}"].function(first, grade, float(ground.function(*place))))


def check_stops(models: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    for number in range(models):
        model = drawn_model(rng, number)
        surfaces = ["", *model.braking.terrain]
        surface = surfaces[rng.integers(len(surfaces))]
        on, end = model.braking.on(surface), f"_{surface}" if surface else ""
        functions = named(model)
        for _ in range(POINTS):
            speed = float(rng.uniform(0.05, on.speed_range[1]))
            grade, time = float(rng.uniform(*on.grade_range)), float(rng.uniform(0.0, 3600.0))
            value = value_of(functions, "stopping_distance", end, speed, grade, time)
            real = driven(model, on, speed, grade, time)
            where = (model.name, model.effect, surface, speed, grade)
            assert value >= real - EXACT - RELATIVE * real or value == math.inf, where


def test_there_is_a_drawing_for_each_effect() -> None:
    assert set(EFFECTS) == set(registry.LAWS)


def test_no_exported_stop_is_shorter_than_the_simulated_one() -> None:
    check_stops(2 * len(EFFECTS), 4)  # each effect alone, and as many with several


@pytest.mark.nightly
def test_no_exported_stop_is_shorter_at_ten_thousand_points() -> None:
    check_stops(2000, 5)


def test_where_only_brakes_and_grade_act_the_stop_is_exact() -> None:
    rng = np.random.default_rng(6)
    for model in SHIPPED[:2]:  # the third has friction, with which an axle locks first
        held = replace(model, braking=replace(model.braking, drive_in_dead_time="held"))
        functions = named(held)
        for _ in range(20):
            speed = float(rng.uniform(0.2, held.braking.speed_range[1]))
            grade = float(rng.uniform(-0.15, 0.15))
            value = value_of(functions, "stopping_distance", "", speed, grade, 0.0)
            real = driven(held, held.braking, speed, grade, 0.0)
            assert value == pytest.approx(real, abs=1e-6)


@pytest.mark.parametrize(("lag", "drag", "excess"), [(0.3, 0.0, 0.03), (0.4, 0.03, 0.08)])
def test_stop_with_lag_and_drag_exceeds_the_simulated_one_by_centimetres(
    lag: float, drag: float, excess: float
) -> None:
    effects = [Effect(name="brake_lag", parameters={"tau": lag})]
    if drag:
        effects.append(Effect(name="viscous_resistance", parameters={"c": drag}))
    atv = SHIPPED[0]
    model = replace(
        atv, braking=replace(atv.braking, drive_in_dead_time="held"), effect=tuple(effects)
    )
    functions = named(model)
    for speed in (1.0, 2.5, 4.0):
        for grade in (-0.2, 0.0, 0.2):
            value = value_of(functions, "stopping_distance", "", speed, grade, 0.0)
            real = driven(model, model.braking, speed, grade, 0.0)
            assert -EXACT <= value - real <= excess


@pytest.mark.parametrize("grade", [-0.25, -0.1, 0.1])
@pytest.mark.parametrize("model", SHIPPED, ids=lambda model: model.name)
def test_no_exported_stop_is_shorter_than_that_of_a_plan(model: Model, grade: float) -> None:
    """Lag, and the drive cut downhill: half a metre was missing at −14°."""
    lag = replace(model, effect=(Effect(name="brake_lag", parameters={"tau": 0.3}),))
    x = np.arange(0.0, 40.0, 0.25)
    ground = ground_map(lambda east, _: np.tan(grade) * east)
    path = CandidatePath(name="straight", points=np.column_stack((x, 0.0 * x)))
    (speed_plan,) = plan(lag, ground, [path], clear=12.0, quantile=None)
    functions, clear = named(lag), float(speed_plan.clear_distance)
    assert clear > 5.0
    rest = clear - speed_plan.station
    for k in range(0, len(rest), 4):
        speed = float(speed_plan.speed[k])
        if speed > 0.0:
            value = value_of(functions, "stopping_distance", "", speed, grade, 0.0)
            assert value >= float(speed_plan.stop_distance[k]) - EXACT
        if 2.0 < rest[k] < clear - 2.0:  # where a plan speeds up or stands other limits count
            value = value_of(functions, "speed_bound", "", float(rest[k]), grade, 0.0)
            assert value <= float(speed_plan.speed_bound[k]) + 0.02


def test_speeds_are_no_higher_than_what_was_trained() -> None:
    atv = SHIPPED[0]
    for keys, limits, highest in (
        ({}, {}, 4.0),
        ({"speed_range": (1.0, 3.0)}, {}, 3.0),
        ({}, {"speed": 2.0}, 2.0),
        ({"speed_by_grade": ((-0.2, 1.0), (0.2, 3.0))}, {}, 2.0),
    ):
        model = replace(
            atv, braking=replace(atv.braking, **keys), limits=replace(atv.limits, **limits)
        )
        assert exported(model, "speed_bound", 1e3, 0.0) == pytest.approx(highest, abs=1e-12)
    slow = replace(atv, vehicle=replace(atv.vehicle, max_wheel_speed=1.5))
    assert exported(slow, "speed_bound", 1e3, 0.0) == 1.5


def test_on_grades_that_were_not_trained_nothing_drives() -> None:
    atv = SHIPPED[0]
    for grade in (-0.27, 0.27):
        assert exported(atv, "speed_bound", 50.0, grade) == 0.0
        assert exported(atv, "stopping_distance", 1.0, grade) == math.inf
        assert exported(atv, "force_ratio", 1.0, grade) == 0.0
    # Where the model may extrapolate less force counts, by its margin, and for the loads more.
    free = replace(atv, braking=replace(atv.braking, extrapolate=True))
    inside = replace(free, braking=replace(free.braking, grade_range=(-0.5, 0.5)))
    for kind, more in (("speed_bound", -1), ("force_ratio", -1), ("max_deceleration", 1)):
        beyond, trained = (exported(each, kind, 2.0, -0.27) for each in (free, inside))
        assert more * (beyond - trained) > 0.0
        assert beyond > 0.0


def test_a_state_that_nobody_foresees_counts() -> None:
    atv = SHIPPED[0]
    wet = SurfaceBraking(b_b=0.25, dead_time=0.4, state_of="")
    model = replace(atv, braking=replace(atv.braking, terrain={"wet": wet}))
    for kind in ("stopping_distance", "speed_bound", "force_ratio"):
        assert exported(model, kind, 3.0, -0.1) == exported(model, f"{kind}:wet", 3.0, -0.1)
    dry = exported(atv, "max_deceleration", 3.0, -0.1)
    assert exported(model, "max_deceleration", 3.0, -0.1) == dry


def test_brakes_that_do_not_hold_bar_the_slope() -> None:
    atv = SHIPPED[0]
    weak = replace(atv.braking, m_m=0.0, b_m=0.0, m_b=0.0, b_b=0.2, grade_range=(-0.3, 0.3))
    model = replace(atv, braking=weak)
    assert exported(model, "speed_bound", 20.0, 0.19) > 0.0
    assert exported(model, "speed_bound", 20.0, 0.21) == 0.0
    assert exported(model, "stopping_distance", 1.0, -0.21) == math.inf


def test_what_changes_with_the_session_asks_for_its_time() -> None:
    drift = Effect(name="session_drift", parameters={"k": -1e-5})
    functions = named(replace(SHIPPED[0], effect=(drift,)))
    ground = functions["ground_force"]
    assert ground.inputs[-1][0] == "session_time"
    assert float(ground.function(0.0, 0.0, 0.0, 0.0, 0.0, 3600.0)) == pytest.approx(-0.036)
    assert "session_time" not in dict(named(SHIPPED[0])["ground_force"].inputs)


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_c_code_is_infinite_where_no_stop_is_known(tmp_path: Path) -> None:
    atv = SHIPPED[0]
    narrow = replace(atv, braking=replace(atv.braking, grade_range=(-0.05, 0.05)))
    source, _, header = write_c(narrow, functions_of(narrow), tmp_path / "c")
    assert "INFINITY" in header.read_text()
    check = tmp_path / "check.c"
    check.write_text(
        f'#include "{header.name}"\n'
        "int stopping_distance(const double** arg, double** res, long long* iw, double* w, int m);"
        "\nint speed_bound(const double** arg, double** res, long long* iw, double* w, int m);\n"
        "int main(void) { double v = 20.0, grade = -0.06, extra = 0.0, far, fast;\n"
        "  const double* in[3] = {&v, &grade, &extra};\n"
        "  double *a[1] = {&far}, *b[1] = {&fast};\n"
        "  stopping_distance(in, a, 0, 0, 0); speed_bound(in, b, 0, 0, 0);\n"
        "  grade = 0.0; double most; b[0] = &most; speed_bound(in, b, 0, 0, 0);\n"
        "  int known = !isinf(far) || fast != 0.0 || most != 4.0;\n"
        "  v = NAN; stopping_distance(in, a, 0, 0, 0); known |= !isinf(far);\n"
        "  v = -1.0; stopping_distance(in, a, 0, 0, 0); known |= !isinf(far);\n"
        "  return known; }\n"
    )
    out = tmp_path / "check"
    files = [str(check), str(source), f"-I{header.parent}", "-lm", "-o", str(out)]
    subprocess.run(["gcc", "-O0", *files], check=True)
    assert subprocess.run([str(out)], check=False).returncode == 0
