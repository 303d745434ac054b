"""Prediction of speeds under a hypothesis, with build-up and fade of the brakes."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.discrepancy.model.brakes import brought_force
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import demanded_force, predict, simulate
from slopewise.models.parameters import Effect
from slopewise.models.quantity import GRAVITY
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.world.formulas import SAMPLES
from tests.world.logs import table
from tests.world.vehicles import BASE

LIKE_THE_SIMULATION = [
    name
    for name in SAMPLES
    if name
    not in ("turning_resistance", "crest_unloading", "brake_fade", "surface_patch", "step_change")
]
"""Effects that have all they depend on in the table of stops."""


def _track(stops, i: int) -> GroundTrack:
    curvature = stops.yaw_rate[i] / np.maximum(stops.speed[i], 0.3)
    return GroundTrack(
        stops.station[i],
        stops.grade[i],
        stops.roll[i],
        stops.yaw[i],
        curvature,
        stops.x[i],
        stops.y[i],
    )


@pytest.mark.parametrize("name", LIKE_THE_SIMULATION)
def test_a_stop_is_that_of_the_simulation(name: str) -> None:
    stops = table("clean").take([0, 5, 11])
    effect = Effect(name=name, parameters=SAMPLES[name])
    time = np.linspace(0.0, 1.0, 401) * (1.3 * stops.standstill_time)[:, None]
    speed, way = simulate(
        stops, replace(Hypothesis.configured(BASE), added=(effect,)), stops.held, time
    )
    for i in range(len(stops)):
        reference = simulate_stop(
            replace(BASE, effect=(effect,)),
            _track(stops, i),
            float(stops.held[i]),
            session_time=float(stops.clock[i]),
        )
        assert np.max(np.abs(speed[i] - reference.speed_at(time[i]))) < 0.004
        assert way[i, -1] == pytest.approx(reference.distance, abs=0.004)


def test_a_stop_over_a_crest_is_that_of_the_simulation() -> None:
    stops = table("crests").take([0, 5, 11, 20])
    effect = Effect(name="crest_unloading", parameters={"k": 2.0})
    hypothesis = replace(Hypothesis.configured(BASE), added=(effect,))
    time = np.linspace(0.0, 1.0, 401) * (1.3 * stops.standstill_time)[:, None]
    speed, way = simulate(stops, hypothesis, stops.held, time)
    plain, _ = simulate(stops, Hypothesis.configured(BASE), stops.held, time)
    assert np.max(speed - plain) > 0.05
    for i in range(len(stops)):
        track = replace(_track(stops, i), grade_change=stops.vertical_curvature[i])
        reference = simulate_stop(replace(BASE, effect=(effect,)), track, float(stops.held[i]))
        assert np.max(np.abs(speed[i] - reference.speed_at(time[i]))) < 0.004
        assert way[i, -1] == pytest.approx(reference.distance, abs=0.004)


def test_a_step_change_holds_from_its_run_on() -> None:
    stops = table("clean")
    effect = Effect(name="step_change", parameters={"scale": 0.8, "run": 20.0})
    base = Hypothesis.configured(BASE)
    error = predict(stops, replace(base, added=(effect,)))[:, -1] - predict(stops, base)[:, -1]
    assert np.all(error[stops.run < 20] == 0.0)
    assert np.all(error[stops.run >= 20] < 0.0)


BASIS = Hypothesis.configured(BASE)
FADE = Effect(name="brake_fade", parameters={"k": 0.03, "tau": 60.0})


def test_brakes_fade_as_by_an_integrator_within_a_stop() -> None:
    stops = replace(table("clean"), warmed=np.empty((len(table("clean")), 2, 0)))
    hypothesis = replace(BASIS, added=(FADE,))
    demanded = demanded_force(stops, hypothesis, stops)
    k, tau = FADE.parameters["k"], FADE.parameters["tau"]
    onset = hypothesis.dead_time
    given = []
    for i in range(len(stops)):

        def slope(t: float, q: np.ndarray, i: int = i) -> float:
            force = np.interp(t, stops.time[i], demanded[i]) / (1.0 + k * q[0])
            return GRAVITY * force * np.interp(t, stops.time[i], stops.speed[i]) - q[0] / tau

        after = stops.time[i] > onset
        q = solve_ivp(
            slope, (onset, stops.time[i, -1]), [0.0], t_eval=stops.time[i, after], max_step=0.01
        ).y[0]
        given.append(demanded[i, after] / (1.0 + k * q))
    # The force is the stop's own, here that of the integrator, and even within it.
    stops = replace(stops, force=np.array([float(np.mean(g)) for g in given]))
    delivered = brought_force(stops, hypothesis, demanded, stops.speed, stops, stops.time).given
    for i, true in enumerate(given):
        lost = 1.0 - true[-1] / demanded[i, -1]
        assert lost > 0.005
        error = np.abs(delivered[i, stops.time[i] > onset] - true)
        assert np.max(error) < 0.04 * lost * demanded[i].max()
