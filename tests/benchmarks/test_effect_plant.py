"""The plant of hidden effects, and what can be identified of them."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.discrepancy import effect_plant, gls_scan, hidden_effects, plant_physics, sensing
from benchmarks.discrepancy.identifiability import Identifiability, identifiability
from benchmarks.discrepancy.plant_physics import Physics, Stops, draw
from benchmarks.discrepancy.sensing import Columns
from tests.benchmarks.driven_stops import G, measured, stops

BASE = plant_physics.Physics(m_m=0.0, b_m=0.0, m_b=0.0, b_b=0.4, dead_time=0.3)
NOW = np.zeros(1)
V, A = 4.0, G * 0.4


def test_plants_import_no_product_code() -> None:
    for file in Path(effect_plant.__file__).parent.glob("*.py"):
        imports = file.name != "blind_run.py" and re.search(
            r"^ *(?:from|import) +(?:slopewise|models|planner|services)\b", file.read_text(), re.M
        )
        assert not imports, file


def test_constant_force_stops_by_the_closed_form() -> None:
    grade = -0.1
    p = BASE._replace(m_m=-0.02, b_m=-0.3, m_b=0.01)
    motion = effect_plant.drive(p, stops(grade=grade), NOW)
    a = G * ((p.m_m * V + p.b_m) * grade + p.m_b * V + p.b_b + np.sin(grade))
    np.testing.assert_allclose(motion.distance, V * 0.3 + V * V / (2.0 * a), rtol=1e-5)
    np.testing.assert_allclose(motion.rest, 0.3 + V / a, rtol=1e-5)


def test_all_effects_together_by_another_integrator() -> None:
    p = BASE._replace(b_m=-0.2, drag=0.02, viscous=0.01, wind_drag=0.01, wind=5.0, lag=0.08)
    p = p._replace(wind_direction=0.4, fade=0.01, fade_tau=100.0, friction=0.38, asymmetry=0.2)
    p = p._replace(nonlinearity=0.8, cross_slope=0.2, turning=0.1, furrow=0.02, drift=1e-5)
    p = p._replace(furrow_direction=0.3, step_scale=0.9, step_delta=0.01, step_run=1.0)
    scene = stops(2, grade=0.05, wave=0.02, wave_phase=0.5, roll=0.1, curvature=0.08, heading=0.2)
    driven = effect_plant.drive(p, scene, NOW)
    heat = ended = 0.0
    for run in range(2):
        clock = float(scene.clock[run])

        def rates(t: float, y: np.ndarray, run: int = run, clock: float = clock) -> list[float]:
            s, v, f, q = y
            grade = 0.05 + 0.02 * np.sin(2.0 * np.pi * s / 10.0 + 0.5)
            yaw = 0.2 + 0.08 * s
            force = -0.2 * grade + 0.4
            if run >= 1:
                force = 0.9 * force + 0.01
            force += 0.2 * max(grade, 0.0) + 0.8 * grade * abs(grade) + 0.2 * 0.1
            force += 0.02 * np.cos(2.0 * (yaw - 0.3)) + 1e-5 * (clock + 0.3 + t)
            acting = min(f / (1.0 + 0.01 * q), 0.38 * np.cos(grade) * np.cos(0.1))
            u = v + 5.0 * np.cos(yaw - 0.4)
            a = G * (acting + np.sin(grade) + 0.01 * v + 0.1 * 0.08 * v)
            a += 0.02 * v * v + 0.01 * (abs(u) * u - v * v)
            return [v, -a, (force - f) / 0.08, G * acting * v - q / 100.0]

        def standstill(_: float, y: np.ndarray) -> float:
            return float(y[1])

        standstill.terminal = True  # type: ignore[attr-defined]
        heat *= np.exp(-(clock + 0.3 - ended) / 100.0)
        options = {"events": standstill, "rtol": 1e-9, "atol": 1e-10, "max_step": 0.01}
        exact = solve_ivp(rates, (0.0, 10.0), [V * 0.3, V, 0.0, heat], **options)
        heat, ended = float(exact.y[3, -1]), clock + 0.3 + float(exact.t[-1])
        assert driven.distance[run] == pytest.approx(float(exact.y[0, -1]), abs=2e-3)


def test_log_has_noise_steps_and_a_body_that_rocks_back() -> None:
    rng = np.random.default_rng(1)
    scene = plant_physics.draw("mixed", 60, 0.02, rng)
    motion = effect_plant.drive(BASE, scene, sensing.sample_times(8.0))
    log = sensing.log(motion, scene, 0.03, rng)
    np.testing.assert_allclose(log["v"] / sensing.QUANTUM, np.round(log["v"] / sensing.QUANTUM))
    assert np.all(np.diff(log["t"]) > 0.0)
    before = log["v_cmd"] > 0.0
    assert np.std((log["v"] - log["v_cmd"])[before]) == pytest.approx(0.03, rel=0.1)
    quiet = sensing.log(motion, scene, 0.0, rng)
    assert -0.06 < float(quiet["v"].min()) < -0.01


@pytest.mark.parametrize("name", hidden_effects.FIELDS)
def test_larger_sizes_change_more(name: str) -> None:
    changes = []
    for size in hidden_effects.SIZES:
        rng = np.random.default_rng(5)
        scene = plant_physics.draw("mixed", 60, 0.0, rng)._replace(friction=np.ones(60))
        term = hidden_effects.draw_hidden(name, size, BASE, scene, rng)
        time = np.arange(0.0, 4.0, 0.02)
        changed = effect_plant.speeds(BASE._replace(**term.fields), scene, time)
        changes.append(float(np.abs(changed - effect_plant.speeds(BASE, scene, time)).max()))
    assert 0.0 < changes[0] < changes[1] < changes[2]


ABSORBING = Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
DRAG = ABSORBING._replace(drag=0.03)
UPHILL = ABSORBING._replace(asymmetry=0.4)


def scene(count: int, design: str = "mixed") -> Stops:
    return draw(design, count, 0.02, np.random.default_rng(3))


def known(truth: Physics, stops: Stops, name: str, scatter: float = 0.02) -> Identifiability:
    return identifiability(truth, ABSORBING, stops, 0.03, scatter, (name,) if name else ())


def test_effects_that_the_base_absorbs_have_no_gap() -> None:
    assert known(ABSORBING._replace(b_b=0.47, m_m=0.01, dead_time=0.28), scene(60), "").gap < 0.1
    only_up = scene(60)._replace(grade=np.linspace(0.05, 0.2, 60))
    assert known(UPHILL, only_up, "grade_asymmetry").gap < 1.0
    seen = known(UPHILL, scene(60), "grade_asymmetry")
    assert seen.is_detectable
    assert known(UPHILL, scene(60), "grade_asymmetry", scatter=0.005).gap > 3.0 * seen.gap


LAW = Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
CONFIGURED = {"m_m": 0.001, "b_m": -0.21, "m_b": 0.004, "b_b": 0.46, "dead_time": 0.24}


def logged(truth: Physics, count: int = 50, seed: int = 3) -> Columns:
    """Stops of a plant, measured with 1 cm/s of noise."""
    stops = draw("mixed", count, 0.01, np.random.default_rng(seed))
    return measured(truth, stops, 0.01, np.random.default_rng(seed))


@pytest.mark.parametrize(
    ("fields", "names"),
    [
        ({"step_scale": 0.8, "step_run": 24.0}, ("step_change",)),
        *(
            pytest.param(*case, marks=pytest.mark.nightly)
            for case in (
                ({}, ()),
                ({"drag": 0.05}, ("aerodynamic_drag",)),
                ({"lag": 0.15}, ("brake_lag",)),
                ({"furrow": 0.05, "furrow_direction": 0.7}, ("directional_surface",)),
                ({"cross_slope": 0.5}, ("cross_slope",)),
                ({"turning": 0.3}, ("turning_resistance",)),
                ({"asymmetry": 0.5}, ("grade_asymmetry",)),
            )
        ),
    ],
)
def test_scan_names_plain_effects(fields: dict[str, float], names: tuple[str, ...]) -> None:
    assert gls_scan.name_effects(logged(LAW._replace(**fields)), CONFIGURED) == names
