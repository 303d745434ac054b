"""What cannot be answered in time is not begun; a machine that was busy once turns nobody away."""

from __future__ import annotations

import pytest

from slopewise.services.planning.deadline_check import Costs, TooLateError


def test_what_takes_longer_than_is_left_is_given_up() -> None:
    costs = Costs()
    costs.learn(100, 0.5, named=False)
    costs.check(100, 0.4, named=False)
    with pytest.raises(TooLateError, match=r"200 candidates take about 0.7 s, 0.6 s are left"):
        costs.check(200, 0.6, named=False)
    with pytest.raises(TooLateError, match="0 s are left"):
        costs.check(100, -1.0, named=False)


def test_nothing_is_held_against_what_nobody_knows() -> None:
    """Few candidates, kinds of question that have not come yet, and a service that just began."""
    costs = Costs()
    costs.check(1000, 1e-6, named=True)
    costs.learn(19, 60.0, named=True)
    costs.check(1000, 1e-6, named=True)
    costs.learn(100, 60.0, named=True)
    costs.check(1000, 1e-6, named=False)
    costs.check(19, 1e-6, named=True)


def test_the_quickest_of_the_last_few_counts() -> None:
    costs = Costs()
    costs.learn(100, 0.1, named=False)
    for _ in range(7):
        costs.learn(100, 10.0, named=False)
        assert costs.expected(100, named=False) == pytest.approx(0.07)
    costs.learn(100, 10.0, named=False)
    assert costs.expected(100, named=False) == pytest.approx(7.0)
