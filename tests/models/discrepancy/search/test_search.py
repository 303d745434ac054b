"""Effect columns of the search, and refinement of their numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.noise import Noise, whitener
from slopewise.models.discrepancy.model.prediction import predict, simulate
from slopewise.models.discrepancy.search.candidates import EffectColumn
from slopewise.models.discrepancy.search.refine import as_output, fit, jacobian, own_friction
from slopewise.models.effects.registry import validate
from slopewise.models.parameters import Effect
from tests.world.logs import table
from tests.world.vehicles import BASE


@pytest.mark.parametrize(("strength", "scale"), [(-0.3, 0.7), (-1.1, 0.0), (0.2, 1.2)])
def test_brakes_never_push(strength: float, scale: float) -> None:
    """A line through the stops may ask for less than no force; there is no such effect."""
    effect = EffectColumn("step_change", {"delta": 0.0, "run": 3.0}).effect(strength)
    assert validate(effect)["scale"] == pytest.approx(scale)


BASIS = Hypothesis.configured(BASE)
HIDDEN = {
    "nothing": (),
    "lag": (Effect(name="brake_lag", parameters={"tau": 0.15}),),
    "cap": (Effect(name="wheel_lockup", parameters={"mu": 0.42}),),
    "fade": (Effect(name="brake_fade", parameters={"k": 0.004, "tau": 120.0}),),
    "step": (Effect(name="step_change", parameters={"scale": 0.8, "run": 20.0}),),
}


@pytest.mark.parametrize("name", HIDDEN)
def test_slopes_are_those_of_differences(name: str) -> None:
    stops = table("clean")
    hypothesis = replace(BASIS, added=HIDDEN[name])
    slopes = jacobian(stops, hypothesis)
    for i in (0, 1, 2, 3, 4):
        step = 1e-4 * hypothesis.scales[i]
        free = hypothesis.free.copy()
        free[i] += step
        error = (predict(stops, hypothesis.moved(free)) - predict(stops, hypothesis)) / step
        assert np.max(np.abs(slopes[:, :, i] - error)) < 0.01 * np.max(np.abs(error))


def test_fits_to_the_output_let_stops_keep_their_own_friction() -> None:
    rng = np.random.default_rng(4)
    stops = table("clean")
    drag = BASIS.plus(Effect(name="aerodynamic_drag", parameters={"c": 0.05}))
    share = -np.abs(0.06 * rng.standard_normal(len(stops)))  # all roll until the table ends
    speed, _ = simulate(stops, drag, stops.held, stops.time, share[:, None])
    driven = replace(stops, speed=speed, binned=np.einsum("skm,sm->sk", stops.average, speed))
    noise = Noise(0.003, 0.0, 0.02, 0.002, 0.06 * float(np.median(stops.force)))
    refined = fit(driven, drag, whitener(driven, noise, drag), passes=0)
    friction = own_friction(refined) / float(np.median(stops.force))
    np.testing.assert_allclose(friction, share, atol=0.004)
    reference, _ = simulate(stops, drag, stops.held, stops.time)
    error = np.abs(as_output(driven, refined).speed - speed)
    assert np.max(error) < 0.15 * np.max(np.abs(reference - speed))
