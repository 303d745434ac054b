"""Sliding wheels, compared with a block on a plane that scipy integrates in two dimensions."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_ground import ground_of
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import simulate, wanted_force
from slopewise.models.discrepancy.search.refine import fit_base, fit_either_way, fit_other_forms
from slopewise.models.parameters import Effect
from slopewise.models.quantity import GRAVITY as G
from tests.world.logs import table
from tests.world.vehicles import BASE

MU = 0.25


def tilted(grade: float, roll: float) -> StopTable:
    """Stops of a log, on a plane that leans."""
    stops = table("clean").take([0, 5, 11, 20])
    even = np.ones_like(stops.grade)
    return replace(stops, grade=grade * even, roll=roll * even)


def block(v: float, grade: float, roll: float, time: Floats) -> Floats:
    """Speed along the path of a block that slides from the onset on."""
    grip = G * MU * math.cos(grade) * math.cos(roll)
    onset = BASE.braking.dead_time

    def rates(_: float, state: Floats) -> list[float]:
        along, across = state
        share = grip / max(math.hypot(along, across), 1e-9)
        return [-G * math.sin(grade) - share * along, G * math.sin(roll) - share * across]

    end = max(float(time[-1]) - onset, 1e-3)
    solution = solve_ivp(rates, (0.0, end), [v, 0.0], dense_output=True, rtol=1e-8, max_step=0.02)
    after = np.clip(time - onset, 0.0, end)
    return np.where(time < onset, v, solution.sol(after)[0])


@pytest.mark.parametrize("form", ["everywhere", "in one place"])
@pytest.mark.parametrize(("grade", "roll"), [(-0.08, 0.07), (-0.05, -0.09)])
def test_locked_wheels_drift_as_a_block_does(form: str, grade: float, roll: float) -> None:
    stops = tilted(grade, roll)
    hypothesis = Hypothesis.configured(BASE)
    if form == "everywhere":
        hypothesis = hypothesis.plus(Effect(name="wheel_lockup", parameters={"mu": MU}))
    else:
        level = BASE.braking.level_force(float(stops.held[0]))
        place = {"delta": MU - level, "x": 0.0, "y": 0.0, "radius": 1e6}
        hypothesis = replace(
            hypothesis.plus(Effect(name="surface_patch", parameters=place)), slips=True
        )
        stops = stops.take([0])
    time = np.linspace(0.0, 1.0, 401) * (2.0 * stops.standstill_time)[:, None]
    drifting, _ = simulate(stops, replace(hypothesis, drifts=True), stops.held, time)
    straight, _ = simulate(stops, hypothesis, stops.held, time)
    for i, held in enumerate(stops.held.tolist()):
        true = block(held, grade, roll, time[i])
        fast = true > 0.1 * held
        error = np.abs(drifting[i] - true)[fast].max()
        unaware = np.abs(straight[i] - true)[fast].max()
        assert error < 0.2 * unaware
        assert unaware > 0.005


def test_brakes_below_the_friction_of_a_place_feel_nothing_of_it() -> None:
    stops = table("clean")
    hypothesis = Hypothesis.configured(BASE)
    place = {"delta": 0.0, "x": 0.0, "y": 0.0, "radius": 1e6}
    patch = Effect(name="surface_patch", parameters=place)
    there = wanted_force(stops, replace(hypothesis.plus(patch), slips=True), ground_of(stops))
    elsewhere = wanted_force(stops, hypothesis, ground_of(stops))
    upright = np.cos(stops.grade) * np.cos(stops.roll)
    level = BASE.braking.m_b * stops.held[:, None] + BASE.braking.b_b
    np.testing.assert_allclose(there, np.minimum(elsewhere, level * upright), atol=1e-12)
    assert 0.1 < np.mean(there < elsewhere) < 0.9


@pytest.mark.parametrize("drifts", [True, False])
def test_likelihood_shows_whether_sliding_wheels_drift(*, drifts: bool) -> None:
    stops = table("clean")
    rng = np.random.default_rng(1)
    stops = replace(stops, roll=stops.roll + 0.12 * rng.uniform(-1.0, 1.0, (len(stops), 1)))
    lock = Effect(name="wheel_lockup", parameters={"mu": MU})
    true = replace(Hypothesis.configured(BASE).plus(lock), drifts=drifts)
    speed, _ = simulate(stops, true, stops.held, stops.time)
    noise = fit_base(stops, Hypothesis.configured(BASE)).noise
    averaged = np.einsum("skm,sm->sk", stops.average, speed)
    measured = replace(stops, speed=speed, binned=averaged)
    wrong = fit_either_way(measured, replace(true, drifts=not drifts), noise)
    solution = fit_other_forms(measured, wrong)
    assert solution.hypothesis.drifts is drifts
    assert solution.hypothesis.added[0].parameters["mu"] == pytest.approx(MU, abs=0.01)
