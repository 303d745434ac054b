"""Heat within a stop, and what brakes let through, against an integrator and differences."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.discrepancy.data.stop_ground import ground_of as place_of
from slopewise.models.discrepancy.model.brakes import brought_force
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import predict, wanted_force
from slopewise.models.discrepancy.search.candidates import candidates
from slopewise.models.parameters import Effect
from slopewise.models.quantity import GRAVITY
from tests.models.discrepancy.logs import table
from tests.models.models_for_tests import BASE

BASIS = Hypothesis.configured(BASE)
LAG = Effect(name="brake_lag", parameters={"tau": 0.15})
CAP = Effect(name="wheel_lockup", parameters={"mu": 0.42})
FADE = Effect(name="brake_fade", parameters={"k": 0.03, "tau": 60.0})


def test_brakes_that_fade_within_a_stop_heat_less_from_then_on() -> None:
    stops = replace(table("clean"), warmed=((),) * len(table("clean")))
    hypothesis = BASIS.plus(FADE)
    demanded = wanted_force(stops, hypothesis, place_of(stops))
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
    # The mean force is the stop's own, here that of the integrator.
    stops = replace(stops, force=np.array([float(np.mean(g)) for g in given]))
    met = place_of(stops)
    delivered = brought_force(stops, hypothesis, demanded, stops.speed, met, stops.time).given
    for i, true in enumerate(given):
        lost = 1.0 - true[-1] / demanded[i, -1]
        assert lost > 0.005
        error = np.abs(delivered[i, stops.time[i] > onset] - true)
        assert np.max(error) < 0.03 * lost * demanded[i].max()


@pytest.mark.parametrize("brakes", [[], [LAG], [CAP], [FADE], [LAG, CAP]])
@pytest.mark.parametrize(
    ("name", "strength"),
    [("directional_surface", 1e-4), ("cross_slope", 1e-3), ("session_drift", 1e-8)],
)
def test_what_the_ground_adds_passes_through_the_brakes(
    brakes: list[Effect], name: str, strength: float
) -> None:
    stops, hypothesis = table("clean"), BASIS
    for effect in brakes:
        hypothesis = hypothesis.plus(effect)
    library, columns = candidates(stops, hypothesis)
    i = next(i for i, c in enumerate(library) if c.name == name)
    more = predict(stops, hypothesis.plus(library[i].effect(strength))) - predict(stops, hypothesis)
    size = float(np.max(np.abs(more)))
    assert size > 0.0
    # Beyond first order: where a cap begins, and how the heat shifts within a stop.
    assert np.max(np.abs(columns[:, :, i] * strength - more)) < 0.05 * size
    if brakes == [CAP]:  # stops that slide from start to end do not see the ground
        assert np.sum(np.max(np.abs(more), axis=1) < 1e-9) > 3
