"""The plant of hidden effects obeys its formulas, by closed forms and by scipy."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from benchmarks.discrepancy import effect_plant, hidden_effects, plant_physics, sensing
from tests.benchmarks.driven_stops import G, stops

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
