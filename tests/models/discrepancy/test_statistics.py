"""Statistics of a refit: whitening, intervals, the design of stops, and progress."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.refit import effect_of, improved
from slopewise.models.discrepancy.likelihood.trace import columns_at, trace_of
from slopewise.models.discrepancy.likelihood.whitener import Whitener
from slopewise.models.discrepancy.model.hypothesis import BASE as BASE_NUMBERS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.workflow import HUNDREDTHS
from slopewise.models.effects.registry import validate
from slopewise.models.parameters import Effect
from tests.world.logs import findings_of, investigated, known_little, refit_of, table, whitener_of
from tests.world.vehicles import BASE

BASIS = Hypothesis.configured(BASE)
LAG = Effect(name="brake_lag", parameters={"tau": 0.15})


def sampled(stops: StopTable, hypothesis: Hypothesis, white: Whitener, seed: int) -> StopTable:
    """The stops with speeds speeds from a hypothesis and the noise of a whitener."""
    rng = np.random.default_rng(seed)
    trace = trace_of(stops, BASE, _no_spikes(stops))
    effects = columns_at(trace, white.onset)[1]
    std = np.sqrt(prior.own_variance(white.noise, effects.shape[2]))
    std[0] = 0.5  # a level of 10 m/s would only round
    random = np.einsum("skr,sr->sk", effects, rng.standard_normal((len(stops), len(std))) * std)
    alone = white.noise[0] * np.sqrt(stops.spread) * rng.standard_normal(stops.binned.shape)
    fall = np.einsum("skm,sm->sk", stops.average, predict(stops, hypothesis))
    return replace(stops, binned=stops.held[:, None] - fall + random + alone)


def _no_spikes(stops: StopTable) -> tuple[Floats, Floats]:
    return np.zeros((*stops.time.shape, 1)), np.zeros(1)


def test_whitened_residuals_are_independent_with_variance_one() -> None:
    stops = table("clean")
    white = whitener_of(stops, lagging=True)
    fall = np.einsum("skm,sm->sk", stops.average, predict(stops, BASIS))
    rows = []
    for seed in range(20):
        speeds = sampled(stops, BASIS, white, seed)
        left = speeds.binned - speeds.held[:, None] + fall
        rows.append(np.einsum("skj,sj->sk", white.root, left))
    used = np.array(rows)[:, stops.spread > 0.0]
    assert np.var(used) == pytest.approx(1.0, abs=0.05)
    neighbours = np.array(rows)[:, :, 1:] * np.array(rows)[:, :, :-1]
    assert abs(np.mean(neighbours)) < 0.02


def test_intervals_of_a_lag_cover() -> None:
    stops, truth = table("clean"), replace(BASIS, added=(LAG,))
    white = whitener_of(stops, build_up=0.15, lagging=True)
    inside = 0
    for seed in range(20):
        fit = improved(sampled(stops, truth, white, 100 + seed), truth, white, known_little(truth))
        error = fit.hypothesis.free[BASE_NUMBERS] - 0.15
        inside += bool(abs(error) < 1.96 * np.sqrt(fit.covariance[BASE_NUMBERS, BASE_NUMBERS]))
    assert inside >= 16  # 95 % of 20 is 19; fewer than 16 has a chance of 1 in 300


def test_nothing_that_all_stops_share_at_the_onset_is_left() -> None:
    stops = table("clean")
    white = whitener_of(stops)
    shared = white.nuisances.reshape(-1, white.nuisances.shape[2])
    left = shared - white.basis[: len(shared)] @ (white.basis[: len(shared)].T @ shared)
    # What the prior of a nuisance allows is as large as its prior says, not zero.
    assert np.all(np.linalg.norm(left, axis=0) <= 1.0 + 1e-9)


@pytest.mark.parametrize(("strength", "scale"), [(-0.3, 0.7), (-1.1, 0.0), (0.2, 1.2)])
def test_brakes_never_push(strength: float, scale: float) -> None:
    """A line through the stops may ask for less than no force; there is no such effect."""
    effect = effect_of("step_change", {"delta": 0.0, "run": 3.0}, np.array([strength]))
    assert validate(effect)["scale"] == pytest.approx(scale)


def test_a_fit_leaves_a_patch_where_it_is() -> None:
    """Derivatives by its edge would be those of the few stops that cross it."""
    place = {"x": 20.5, "y": 19.0, "radius": 11.5}
    patch = Effect(name="surface_patch", parameters={"delta": -0.02, **place})
    fitted = refit_of(table("patch"), patch).hypothesis.added[0].parameters
    assert {name: fitted[name] for name in place} == place
    assert fitted["delta"] == pytest.approx(-0.1, abs=0.03)


def test_an_axis_is_followed_only_where_it_matters() -> None:
    assert findings_of("clean").located == ()
    pattern = findings_of("cross").evidence.axes[0]
    assert pattern.name == "roll"
    assert pattern.p_value < 1e-3


def test_each_hundredth_is_reported_once() -> None:
    reported = investigated("clean")[1]
    assert min(reported) > 0
    assert sum(reported) == HUNDREDTHS == 100
