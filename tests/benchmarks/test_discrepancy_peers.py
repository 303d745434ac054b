"""The other methods on small logs whose truth is plain, and how they are counted."""

from __future__ import annotations

import io

import numpy as np
import pytest
from rich.console import Console

from benchmarks.discovery import (
    catalogue,
    designs,
    gls_scan,
    peer_base,
    peer_regressors,
    peers,
    physics,
    regime_rows,
    regime_tests,
    worth,
)
from benchmarks.discovery.peers import PeerAnswer
from benchmarks.discovery.sensing import Columns
from benchmarks.discovery.tables import tables
from benchmarks.discovery.world_outcomes import WorldOutcome

BASE = physics.Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)
CONFIGURED = {"m_m": 0.001, "b_m": -0.21, "m_b": 0.004, "b_b": 0.46, "dead_time": 0.24}


def logged(truth: physics.Physics, count: int = 50, seed: int = 3) -> Columns:
    """Stops of a plant, measured with 1 cm/s of noise."""
    stops = designs.draw("mixed", count, 0.01, np.random.default_rng(seed))
    order = catalogue.Order("single", (), "", seed)
    unseen = worth.Worth(0.0, "", 0.0)
    one = catalogue.HiddenSet(order, "mixed", 0.01, 0.01, {}, {}, truth, (), stops, unseen)
    return catalogue.measured(one, np.random.default_rng(seed)).columns


METHODS = pytest.mark.parametrize("method", [gls_scan, regime_tests])


@METHODS
def test_a_plain_drag_is_named(method: object) -> None:
    truth = BASE._replace(drag=0.05)
    assert method.name_effects(logged(truth), CONFIGURED) == ("aerodynamic_drag",)  # type: ignore[attr-defined]


@METHODS
def test_a_log_without_an_effect_has_no_name(method: object) -> None:
    assert method.name_effects(logged(BASE), CONFIGURED) == ()  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("truth", "name"),
    [
        (BASE._replace(step_scale=0.8, step_run=24.0), "step_change"),
        (BASE._replace(lag=0.15), "brake_lag"),
        (BASE._replace(furrow=0.05, furrow_direction=0.7), "directional_surface"),
    ],
)
def test_the_scan_names_what_differs_between_stops_and_within_them(
    truth: physics.Physics, name: str
) -> None:
    assert gls_scan.name_effects(logged(truth), CONFIGURED) == (name,)


def test_the_base_is_fitted_with_its_dead_time_and_scatter() -> None:
    found = peer_base.fit_base(logged(BASE, count=80), CONFIGURED)
    # The log shows commands half a sample late on average; sensing has 1 cm/s, the stops 1 %.
    t = found.traces
    level = np.abs(t.grade) < 0.02
    wanted = BASE.m_b * t.v_i[:, None] + BASE.b_b + (BASE.m_m * t.v_i[:, None] + BASE.b_m) * t.grade
    assert np.max(np.abs(found.force - wanted)[level]) < 0.015
    assert found.scatter.sample == pytest.approx(0.01, rel=0.5)
    assert found.scatter.friction == pytest.approx(0.01, rel=0.6)


@pytest.mark.parametrize(
    ("name", "fields", "size"),
    [
        ("aerodynamic_drag", {"drag": 0.03}, 0.03),
        ("viscous_resistance", {"viscous": 0.02}, 0.02),
        ("cross_slope", {"cross_slope": 0.5}, 0.5),
        ("turning_resistance", {"turning": 0.3}, 0.3),
        ("grade_asymmetry", {"asymmetry": 0.5}, 0.5),
        ("grade_nonlinearity", {"nonlinearity": 2.5}, 2.5),
        ("brake_lag", {"lag": 0.13}, 1.0),
        ("headwind", {"wind_drag": 0.02, "wind": 6.0, "wind_direction": 0.0}, 0.02),
        ("wheel_lockup", {"friction": 0.42}, 1.0),
        ("brake_fade", {"fade": 3e-3, "fade_tau": 110.0}, 3.0),
    ],
)
def test_columns_are_the_speed_that_a_unit_of_an_effect_takes(
    name: str, fields: dict[str, float], size: float
) -> None:
    """Fitted to stops of the plant, which has each effect from its formula, too."""
    found = peer_base.fit_base(logged(BASE._replace(**fields), count=80), CONFIGURED)
    own = [one for one in peer_regressors.candidates(found) if one.name == name]
    best = own[int(np.argmax(gls_scan.gains(found, found.base, own)))]
    columns = np.concatenate((found.base, best.columns), axis=2)
    refitted = found._replace(**peer_base.likeliest(found, columns)._asdict())
    rows, wanted = peer_base.whitened(refitted, columns, refitted.scatter)
    strength = np.linalg.lstsq(rows, wanted, rcond=None)[0][-1]
    assert strength == pytest.approx(size, rel=0.3)


def test_exact_tests_hold_their_level() -> None:
    rng = np.random.default_rng(2)
    stop = np.repeat(np.arange(20), 6)
    below = 0
    for _ in range(400):
        base, wanted = rng.standard_normal((120, 3)), rng.standard_normal(120)
        rows = regime_rows.Rows(base, wanted, stop)
        inside = np.arange(20) < 8
        below += regime_rows.energy_p_value(rows, ~inside, inside) < 0.1
        term = rng.standard_normal((120, 1))
        below += regime_rows.term_p_value(rows, term, np.ones(20, bool), inside) < 0.1
    assert 0.07 < below / 800 < 0.13


def test_faults_are_told_and_shares_counted_for_each_method() -> None:
    short = {name: values[:300] for name, values in logged(BASE, count=8).items()}
    answers = peers.ask(short, CONFIGURED)
    assert "eight" in answers["gls_scan"].fault
    assert answers["regime_tests"].named == ()

    def outcome(what: str, right: bool, wrong: bool) -> WorldOutcome:
        said = "missing_effect" if right or wrong else "none"
        return WorldOutcome(
            what, 1, 0.01, 0.02, said, (), right, wrong, 0.2, 0.1, 0.05, None, None, 1.0, ""
        )

    own = [
        outcome("air", True, False),
        outcome("air", False, False),
        outcome("clean", False, False),
    ]
    given = [
        {"gls_scan": PeerAnswer(("drag",), 1.0)},
        {"gls_scan": PeerAnswer(("wind", "drag"), 1.0)},
        {"gls_scan": PeerAnswer((), 1.0)},
    ]
    rows = peers.world_summary(given, own, {"air": (("drag",),)})
    assert rows is not None
    counted = [
        (row["gls_scan"]["hits"], row["slopewise"]["hits"], row["slopewise"]["of"]) for row in rows
    ]
    assert counted == [(1, 1, 2), (1, 0, 2), (0, 0, 1)]
    screen = Console(file=io.StringIO(), width=160)
    for table in tables({"multibody_peer": rows}):
        screen.print(table)
    assert "GLS scan" in screen.file.getvalue()  # type: ignore[attr-defined]
    assert peers.world_summary([{}], own[:1], {}) is None
