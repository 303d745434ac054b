"""From residuals to quantiles: the next stop's share is even, and what is planned with holds."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from slopewise.models.calibration.scatter import QUANTILES, scatter_of


@pytest.mark.parametrize("freedom", [0.0, 4.0])
@pytest.mark.parametrize("n", [20, 100])
def test_the_next_stop_falls_evenly_into_what_is_predicted(n: int, freedom: float) -> None:
    """The histogram of the probability integral transform is flat (chi square of ten bins)."""
    rng = np.random.default_rng([n, int(freedom)])

    def draw(size: int) -> np.ndarray:
        return rng.standard_t(freedom, size) if freedom else rng.standard_normal(size)

    share = []
    for _ in range(120):
        bound = scatter_of(0.03 * draw(n), np.full(n, 1e-3))
        share.append(bound.below(0.03 * draw(50)))
    counts = np.histogram(np.concatenate(share), bins=10, range=(0.0, 1.0))[0]
    expected = 120 * 50 / 10
    # Stops that share a log are not independent: the log's own scale moves all 50 of them.
    assert np.all(np.abs(counts - expected) < 0.15 * expected)
    assert abs(np.mean(np.concatenate(share)) - 0.5) < 0.02


@pytest.mark.parametrize(("n", "noise"), [(15, 0.0), (60, 0.0), (60, 0.02), (300, 0.0)])
def test_the_quantile_planned_with_holds_and_few_stops_make_it_wider(n: int, noise: float) -> None:
    rng = np.random.default_rng(n)
    planned, typical = [], []
    for _ in range(60):
        residual = 0.03 * rng.standard_normal(n) + noise * rng.standard_normal(n)
        bound = scatter_of(residual, np.full(n, max(noise, 1e-6)))
        planned.append(bound.planned)
        typical.append(bound.typical)
    for q in QUANTILES:
        beyond = stats.norm.cdf(-np.array(planned) * stats.norm.ppf(q) / 0.03)
        assert np.mean(beyond) < 1.0 - q
    assert np.median(typical) == pytest.approx(0.03, rel=0.15)
    assert 1.0 < np.median(planned) / 0.03 < (2.2 if n < 20 else 1.6)


def test_tails_count_on_the_dangerous_side_only() -> None:
    rng = np.random.default_rng(1)
    plain = 0.02 * rng.standard_normal(80)
    noise = np.full(80, 1e-3)
    long, short = plain.copy(), plain.copy()
    long[:3], short[:3] = -0.12, 0.12
    bound = scatter_of(plain, noise).planned
    assert scatter_of(long, noise).planned > 1.5 * bound
    assert scatter_of(short, noise).planned < 1.25 * bound


def test_no_stop_no_scatter() -> None:
    with pytest.raises(ValueError, match="at least one stop"):
        scatter_of(np.empty(0), np.empty(0))
