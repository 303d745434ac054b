"""Evidence against a dense normal density, columns of the onset against integrated motion."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.stats import multivariate_normal

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.likelihood import prior
from slopewise.models.discrepancy.likelihood.dictionary import Candidate
from slopewise.models.discrepancy.likelihood.gaussian import Grams, solved
from slopewise.models.discrepancy.likelihood.marginal import by_noise
from slopewise.models.discrepancy.likelihood.onset import Integrated, Moment, Onset, Samples
from slopewise.models.discrepancy.likelihood.search import conditioned, gains_of
from slopewise.models.discrepancy.likelihood.trace import EARLY_PLACES, trace_of
from slopewise.models.quantity import GRAVITY
from tests.world.logs import table
from tests.world.vehicles import BASE

STOPS, BINS, COLUMNS, RANDOM = 4, 9, 3, 2
NOISE, VARIANCE = 0.3, np.array([0.5, 2.0])
CALIBRATED = np.array([0.01, 0.03, 0.004, 0.008])
STD, CENTRE = np.array([0.7, 1.5, 0.4]), np.array([0.0, 0.3, -0.2])


def _sample() -> tuple[Floats, Floats, Floats, Floats]:
    rng = np.random.default_rng(3)
    columns = rng.standard_normal((STOPS, BINS, COLUMNS))
    random = rng.standard_normal((STOPS, BINS, RANDOM))
    spread = rng.uniform(0.3, 1.0, (STOPS, BINS))
    spread[1, 6:] = 0.0  # bins that do not exist
    seen = rng.standard_normal((STOPS, BINS))
    return columns, random, spread, seen


def _dense(columns: Floats, std: Floats, centre: Floats) -> float:
    """Log density of all bins, all columns and random effects in a single covariance."""
    _, random, spread, seen = _sample()
    used = spread.ravel() > 0.0
    flat = columns.reshape(-1, columns.shape[2])
    covariance = np.diag(NOISE**2 * spread.ravel()) + (flat * std**2) @ flat.T
    for i in range(STOPS):
        rows = np.zeros((STOPS, BINS, RANDOM))
        rows[i] = random[i]
        first_candidate = rows.reshape(-1, RANDOM)
        covariance += (first_candidate * VARIANCE) @ first_candidate.T
    keep = np.ix_(used, used)
    mean = (flat @ centre)[used]
    count = int(used.sum())
    density = multivariate_normal(mean, covariance[keep]).logpdf(seen.ravel()[used])
    return float(density) + 0.5 * count * np.log(2.0 * np.pi)


def test_the_evidence_is_that_of_one_normal_density() -> None:
    columns, random, spread, seen = _sample()
    grams = Grams.of(np.concatenate([columns, seen[:, :, None]], axis=2), random, spread)
    solution = solved(*grams.whitened(NOISE, VARIANCE)[:2], STD, CENTRE)
    assert solution.evidence == pytest.approx(_dense(columns, STD, CENTRE), rel=1e-9)


def test_a_candidate_gains_what_the_density_gains() -> None:
    columns, random, spread, seen = _sample()
    grams = Grams.of(np.concatenate([columns, seen[:, :, None]], axis=2), random, spread)
    base = solved(*grams.whitened(NOISE, VARIANCE)[:2], STD[:1], CENTRE[:1])
    first_candidate, second_candidate = (
        Candidate(str(i), True, i, 1, STD[i + 1 : i + 2], float(CENTRE[i + 1])) for i in range(2)
    )
    plain, first, together = (_dense(columns[:, :, :n], STD[:n], CENTRE[:n]) for n in (1, 2, 3))
    (gain, _), _ = gains_of(base.left, base.pull, [first_candidate, second_candidate])
    assert gain == pytest.approx(first - plain, rel=1e-8)
    left, pull = conditioned(base.left, base.pull, [first_candidate])
    (gain,), _ = gains_of(left, pull, [second_candidate])
    assert gain == pytest.approx(together - first, rel=1e-8)


def test_small_versions_of_one_shape_are_together_as_large_as_one() -> None:
    stops = table("clean")
    v, roll = (c[:, :, None] for c in (stops.speed, np.abs(stops.roll)))
    for count, share in ((1, 1.0), (2, 0.5)):
        level = np.ones_like(v)  # what coefficients can do takes nothing of others
        shapes = np.concatenate([v] * count + [roll, level], axis=2)
        trace = trace_of(stops, BASE, (shapes, np.zeros(count + 2, np.bool_)))
        variance = (trace.always_std[-count - 2 :] / (prior.SPIKE * trace.force)) ** 2
        np.testing.assert_allclose(variance, [share] * count + [1.0] * 2, rtol=0.1)


def test_a_shape_along_an_axis_joins_no_effect_along_it() -> None:
    names = {"viscous_resistance": True, "aerodynamic_drag": True, "speed": False, "roll": False}
    viscous, drag, speed, roll = (
        Candidate(name, named, 0, 1, STD[:1]) for name, named in names.items()
    )
    assert not viscous.can_join(viscous)
    assert not viscous.can_join(speed)
    assert not speed.can_join(drag)
    assert viscous.can_join(drag)
    assert viscous.can_join(roll)
    assert speed.can_join(roll)


def test_derivatives_by_the_noise_are_those_of_the_evidence() -> None:
    rng = np.random.default_rng(5)
    places = EARLY_PLACES.stop + 3
    columns = rng.standard_normal((6, 40, places + 1))
    grams = Grams.of(columns, rng.standard_normal((6, 40, 7)), np.full((6, 40), 0.2))
    std, centre = rng.uniform(0.3, 2.0, places), np.zeros(places)
    centre[-1] = 0.8
    log_noise = np.log([0.9, 0.3, 0.4, 0.5, 0.2, 0.6])

    def evidence(x: Floats) -> float:
        return by_noise(grams, std, np.exp(x), CALIBRATED, centre)[0]

    _, slope = by_noise(grams, std, np.exp(log_noise), CALIBRATED, centre)
    steps = 1e-5 * np.eye(6)
    expected = [(evidence(log_noise + h) - evidence(log_noise - h)) / 2e-5 for h in steps]
    np.testing.assert_allclose(slope, expected, rtol=1e-5, atol=1e-5)


@pytest.mark.parametrize("build_up", [0.01, 0.08])
def test_columns_are_integrated_motion(build_up: float) -> None:
    stops = table("clean")
    onset = Onset(0.3137, build_up)
    samples = Samples.of(stops)
    moment = Moment.of(samples, onset)
    share = 0.4 + 0.05 * stops.time
    columns = Integrated.of(stops, np.stack([share, share], axis=2), np.array([True, False]))
    fall = columns.fallen(stops, onset, moment)
    for i in (0, len(stops) - 1):
        u = np.maximum(stops.time[i, -1] - onset.dead_time, 0.0)
        for j, brakes in enumerate((True, False)):

            def slope(at: float, _: Floats, brakes: bool = brakes) -> list[float]:
                built = -np.expm1(-at / build_up) if brakes else 1.0
                return [GRAVITY * (0.4 + 0.05 * (at + onset.dead_time)) * built]

            truth = solve_ivp(slope, (0.0, u), [0.0], rtol=1e-9, dense_output=True)
            last = int(np.flatnonzero(stops.spread[i] > 0.0)[-1])
            late = np.maximum(samples.time[i] - onset.dead_time, 0.0)
            lost = truth.sol(np.minimum(late, u).ravel())[0].reshape(late.shape)
            exact = np.sum(lost * samples.weight[i], axis=1)
            np.testing.assert_allclose(fall[i, : last + 1, j], exact[: last + 1], atol=5e-3)


def test_the_swing_follows_its_equation_of_motion() -> None:
    onset = Onset(0.0, 0.03, 2.2, 0.25)
    u = np.linspace(0.0, 1.5, 151)
    pulse = 2.0 * np.pi * onset.oscillation

    def motion(at: float, y: Floats) -> list[float]:
        built = -np.expm1(-at / onset.build_up)
        pull = pulse**2 * (built - y[0]) - 2.0 * onset.damping * pulse * y[1]
        return [y[1], pull, built - y[0]]

    truth = solve_ivp(motion, (0.0, 1.5), [0.0, 0.0, 0.0], t_eval=u, rtol=1e-9).y
    rate, _, behind = onset.oscillated(u)
    np.testing.assert_allclose(rate, truth[1], atol=0.03 * np.abs(truth[1]).max())
    np.testing.assert_allclose(behind, truth[2], atol=0.05 * np.abs(truth[2]).max())
