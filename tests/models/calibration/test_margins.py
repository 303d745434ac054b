from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from slopewise.models.calibration.margins import normal_bound, offset_for


@pytest.mark.parametrize("n", [12, 40, 150])
@pytest.mark.parametrize("kind", ["normal", "heavy"])
def test_the_requested_share_of_future_stops_is_covered(n: int, kind: str) -> None:
    rng = np.random.default_rng(n)
    covered = []
    for _ in range(400):
        draw = rng.standard_normal(n) if kind == "normal" else rng.standard_t(5, n)
        bound = offset_for(0.995, 0.1 * draw) / 0.1
        covered.append(stats.norm.cdf(bound) if kind == "normal" else stats.t.cdf(bound, 5))
    assert np.mean(covered) > (0.995 if kind == "normal" else 0.99)
    if kind == "normal":
        assert np.mean(np.array(covered) >= 0.995) > 0.93


def test_the_tolerance_factor_is_the_tabulated_one() -> None:
    # k for n = 10, 95 % confidence, 95 % of the population, one-sided: 2.911 (NIST handbook).
    data = np.array([-1.0, 1.0] * 5)
    assert normal_bound(0.95, data) / np.std(data, ddof=1) == pytest.approx(2.911, abs=2e-3)


def test_large_logs_pass_smoothly_into_the_approximation() -> None:
    rng = np.random.default_rng(0)
    data = rng.standard_normal(101)
    unit = (data - data.mean()) / data.std(ddof=1)
    exact = unit[:100] - unit[:100].mean()
    exact /= exact.std(ddof=1)
    assert normal_bound(0.995, unit) == pytest.approx(normal_bound(0.995, exact), rel=0.01)
    assert np.isfinite(normal_bound(0.995, rng.standard_normal(5000)))


def test_the_longest_shortfall_counts_and_offsets_are_not_negative() -> None:
    shortfall = np.concatenate((np.full(30, -0.5), [0.8]))
    assert offset_for(0.995, shortfall) >= 0.8
    assert offset_for(0.995, np.linspace(-1.0, -0.9, 50)) == 0.0


def test_a_few_stops_are_not_enough() -> None:
    with pytest.raises(ValueError, match="at least 5 stops"):
        offset_for(0.9, np.zeros(4))
