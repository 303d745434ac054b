"""The base's own shape along a stop: a nuisance that is small, and no effect."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.data.prepare import prepare
from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.model.base_shape import shape_column
from slopewise.models.discrepancy.model.hypothesis import BASE as FIRST_OF_EFFECTS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.search.refine import fit_base, jacobian, residual, start_of
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from tests.models.discrepancy.logs import table
from tests.models.discrepancy.plant import World, drive
from tests.models.models_for_tests import BASE

G = 9.80665
FADING = World(effects={"brake_fade": {"k": 0.012, "tau": 60.0}}, noise=0.005, scatter=0.0075)
SHAPE = 0.012  # of the weight


def shaped(world: World, stops: int, seed: int) -> tuple[dict[str, np.ndarray], list[slice]]:
    """A log of a vehicle that brakes harder while it is fast, and less towards standstill."""
    columns, runs = drive(world, stops, seed)
    v = columns["v"].copy()
    for run in runs:
        t, stop_command = columns["t"][run], columns["v_cmd"][run] <= 0.0
        onset = t[np.argmax(stop_command)] + world.dead_time
        held = v[run][t <= onset].mean()
        braking = (t > onset) & (columns["v"][run] > 0.05)
        share = np.where(braking, columns["v"][run] / held - 0.5, 0.0)
        v[run] -= G * SHAPE * np.cumsum(share) * float(np.median(np.diff(t))) * braking
    return columns | {"v": v}, runs


def test_its_column_is_its_derivative() -> None:
    stops = table("clean")
    there = replace(Hypothesis.configured(BASE), bends=True)
    columns = jacobian(stops, there)[:, :, FIRST_OF_EFFECTS - 1]
    np.testing.assert_array_equal(columns, shape_column(stops, there.dead_time))
    moved = residual(stops, replace(there, bend=0.01)) - residual(stops, there)
    changed = np.einsum("skm,sm->sk", stops.average, 0.01 * columns)
    used = stops.spread > 0.0
    np.testing.assert_allclose(moved[used], changed[used], atol=1e-12)


def test_a_force_that_is_even_has_no_shape() -> None:
    """Half of the stop is faster than its middle, half slower: no speed is lost on the whole."""
    stops = table("clean")
    at_rest = shape_column(stops, BASE.braking.dead_time)[:, -1]
    assert np.abs(np.median(at_rest)) < 0.15


def test_without_leave_it_is_zero() -> None:
    stops, _ = prepare(*shaped(FADING, 24, 1), BASE, None, DiscrepancySettings())
    assert fit_base(stops, start_of(stops, BASE)).hypothesis.bend == 0.0


@pytest.mark.parametrize("seed", [3, pytest.param(5, marks=pytest.mark.nightly)])
def test_together_with_an_effect_it_has_no_name(seed: int) -> None:
    findings = investigate(*shaped(FADING, 60, seed), BASE)
    assert findings.verdict is Verdict.MISSING_EFFECT
    assert [effect.name for effect in findings.effects] == ["brake_fade"]
