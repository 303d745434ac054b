"""Residual shapes that are no effect: base shape and oscillation of the body."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from slopewise.models.discrepancy.data.prepare import prepare
from slopewise.models.discrepancy.findings import Findings, Verdict
from slopewise.models.discrepancy.model.base_shape import shape_column
from slopewise.models.discrepancy.model.hypothesis import BASE as FIRST_OF_EFFECTS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.search.refine import fit_base, jacobian, residual, start_of
from slopewise.models.discrepancy.settings import DiscrepancySettings
from slopewise.models.discrepancy.workflow import investigate
from tests.world.logs import WORLDS, log, table
from tests.world.plant import World, drive
from tests.world.vehicles import BASE

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


def test_without_leave_it_is_zero() -> None:
    stops, _ = prepare(*shaped(FADING, 24, 1), BASE, None, DiscrepancySettings())
    assert fit_base(stops, start_of(stops, BASE)).hypothesis.bend == 0.0


@pytest.mark.nightly
@pytest.mark.parametrize("seed", [3, 5])
def test_together_with_an_effect_it_has_no_name(seed: int) -> None:
    findings = investigate(*shaped(FADING, 60, seed), BASE)
    assert findings.verdict is Verdict.MISSING_EFFECT
    assert [effect.name for effect in findings.effects] == ["brake_fade"]


ROCKING = 0.03  # [m/s]


def rocking(name: str) -> Findings:
    """A log of which the speed is read on a body that rocks, one period in a quarter second."""
    columns, runs = log(name)
    columns = dict(columns)
    v = columns["v"].copy()
    for run in runs:
        t, stop_command = columns["t"][run], columns["v_cmd"][run] <= 0.0
        since = t - t[np.argmax(stop_command)] - WORLDS[name].dead_time
        moving = v[run] > 0.3
        rocks = np.exp(-since / 0.12) * np.sin(2.0 * np.pi * since / 0.25)
        v[run] += ROCKING * np.where((since > 0.0) & moving, rocks, 0.0)
    return investigate(columns | {"v": v}, runs, BASE)


def test_rocking_is_no_effect() -> None:
    assert rocking("clean").verdict in (Verdict.NONE, Verdict.PARAMETER_DRIFT)


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "effect"), [("drag", "aerodynamic_drag"), ("lag", "brake_lag")])
def test_an_effect_is_named_although_the_body_rocks(name: str, effect: str) -> None:
    f = rocking(name)
    assert f.verdict is Verdict.MISSING_EFFECT
    assert [e.name for e in f.effects] == [effect]
    for parameter, value in f.effects[0].parameters.items():
        truth = WORLDS[name].effects[effect][parameter]
        assert abs(value.value - truth) < 4.0 * value.std
