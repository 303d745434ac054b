"""The power benchmark counts what it says."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.discovery.catalogue import Order, SetConditions, make
from benchmarks.discovery.plant import GRAVITY
from benchmarks.discovery.power import (
    COUNTS,
    EFFECTS,
    FACTORS,
    SIZES,
    PowerCase,
    PowerOutcome,
    by_ratio,
    by_stops,
    cases,
    outcome,
)
from benchmarks.discovery.worth import change_beyond_base


def told(name: str, *, right: bool, change: float, stops: int = 60) -> PowerOutcome:
    case = PowerCase(name, "small" if name else "", stops, 3, 0)
    verdict = "missing_effect" if right and name else "none"
    return PowerOutcome(case, True, right, right and bool(name), False, verdict, change, 0.02)


def test_every_kind_is_asked_once_a_seed() -> None:
    wanted = cases(2)
    assert len(wanted) == 2 * len(COUNTS) * len(FACTORS) * (1 + len(EFFECTS) * len(SIZES))
    assert len({case.seed for case in wanted}) == len(wanted)
    assert sum(not case.name for case in wanted) == 2 * len(COUNTS) * len(FACTORS)


def test_tables_count() -> None:
    done = [
        told("step_change", right=True, change=0.05),
        told("step_change", right=False, change=0.015),
        told("", right=True, change=0.0),
    ]
    (line,) = [line for line in by_stops(done[:3]) if line.split()[:3] == ["60", "×", "3"]]
    assert line.split() == ["60", "×", "3", "2/2", "1", "1/2", "0", "1/1", "2.0"]
    rows = [line.split() for line in by_ratio(done)[1:]]
    assert [row[-4:] for row in rows] == [
        ["0", "0", "0", "0"],
        ["1", "0", "0", "0"],
        ["0", "0", "0", "0"],
        ["1", "1", "1", "0"],
    ]


def test_what_coefficients_cannot_do_is_what_is_left() -> None:
    """A step in the middle: half of it on either side, by the closed form of level stops."""
    order = Order("faint", ("step_change",), "medium", 3)
    conditions = SetConditions(designs=("mixed",), counts=(60,), noises=(0.01,), scatters=(0.005,))
    made = make(order, conditions)
    base = made.truth._replace(step_scale=1.0, step_run=0.0)
    change = change_beyond_base(made.truth, base, made.stops, 0.01, 0.005)
    half = 0.5 * abs(made.truth.step_scale - 1.0)
    pull = base.b_b + np.sin(made.stops.grade) + base.b_m * made.stops.grade
    longest = np.sort(made.stops.speed**2 / (2.0 * GRAVITY * pull) * base.b_b * half / pull)[-3]
    assert change == pytest.approx(longest, rel=0.5)
    nothing = change_beyond_base(base, base, made.stops, 0.01, 0.005)
    assert nothing < 1e-6


def test_an_effect_that_is_large_beside_the_noise_is_named() -> None:
    found = outcome(PowerCase("aerodynamic_drag", "medium", 30, 1, 5))
    assert found.known
    assert found.right
    assert found.ratio > 2.0
