"""What can be known, what is sealed, and what is counted."""

from __future__ import annotations

import hashlib
import pickle
from dataclasses import fields, replace

import numpy as np
import pytest

from benchmarks.discovery import (
    catalogue,
    designs,
    metrics,
    model_tables,
    peer,
    physics,
    sealed,
    worth,
)
from benchmarks.discovery.hidden import FIELDS
from benchmarks.discovery.score import score

BASE = physics.Physics(m_m=0.0, b_m=-0.2, m_b=0.005, b_b=0.45, dead_time=0.25)


def scene(count: int, seed: int = 3, design: str = "mixed") -> physics.Stops:
    return designs.draw(design, count, 0.02, np.random.default_rng(seed))


def test_what_the_base_takes_up_is_worth_nothing() -> None:
    other = BASE._replace(b_b=0.47, m_m=0.01, dead_time=0.28)
    assert worth.worth(other, BASE, scene(60), 0.03, 0.02, ()).gap < 0.1
    up = scene(60)._replace(grade=np.linspace(0.05, 0.2, 60))
    bent = BASE._replace(asymmetry=0.4)
    assert worth.worth(bent, BASE, up, 0.03, 0.02, ("grade_asymmetry",)).gap < 1.0
    seen = worth.worth(bent, BASE, scene(60), 0.03, 0.02, ("grade_asymmetry",))
    assert seen.seen
    # Many more stops and less scatter say proportionally more.
    sure = worth.worth(bent, BASE, scene(60), 0.03, 0.005, ("grade_asymmetry",))
    assert sure.gap > 3.0 * seen.gap


def test_expected_chi_square_is_that_of_drawn_noise() -> None:
    """With noise drawn, the truth fits better than the base by its expected χ² and what a fit of
    one more parameter gains by chance."""
    truth, stops = BASE._replace(drag=0.03), scene(40)
    expected = worth.worth(truth, BASE, stops, 0.03, 0.02, ("aerodynamic_drag",)).gap
    even = stops._replace(friction=np.ones(40), delay=np.zeros(40))
    judged = worth._Scene(truth, even, 0.03, 0.02)
    fitted, left = worth._fit(judged, BASE)
    q = np.linalg.qr(judged.tangents(fitted).T)[0]
    gains = []
    for seed in range(30):
        drawn = np.random.default_rng(seed).standard_normal(left.size)
        without = left + drawn
        gains.append(without @ without - (q.T @ without) @ (q.T @ without) - drawn @ drawn)
    spread = 2.0 * np.sqrt(expected) / np.sqrt(30.0)
    assert np.mean(gains) == pytest.approx(expected - q.shape[1], abs=4.0 * spread)


def test_headwind_from_one_side_is_told_from_nothing_but_itself() -> None:
    windy = BASE._replace(wind_drag=0.01, wind=6.0, wind_direction=0.4)
    found = worth.worth(windy, BASE, scene(60, design="one-way"), 0.03, 0.005, ("headwind",))
    around = worth.worth(windy, BASE, scene(60), 0.03, 0.005, ("headwind",))
    assert found.nearest == "viscous_resistance"
    assert found.apart < 0.5 * found.gap
    assert around.named


def test_nothing_of_the_truth_travels() -> None:
    assert [f.name for f in fields(sealed.SealedLog)] == ["columns", "model"]
    order = catalogue.Order("single", ("aerodynamic_drag",), "large", 11)
    hidden = catalogue.make(order)
    job = sealed.SealedLog(hidden.columns, model_tables.tables_of(hidden.configured))
    sent = pickle.dumps(job)
    for word in (b"drag", b"single", b"large", b"truth", b"seed"):
        assert word not in sent
    assert set(job.columns) == {
        "run",
        "t",
        "v",
        "v_cmd",
        "pitch",
        "roll",
        "yaw",
        "yaw_rate",
        "x",
        "y",
        "ambient",
    }
    assert np.isfinite(hidden.columns["v"]).all()


def test_a_seal_binds_the_truth() -> None:
    promise = sealed.seal([{"name": "brake_lag"}])
    digest = hashlib.sha256((promise.nonce + promise.truths).encode()).hexdigest()
    assert digest == promise.digest
    assert sealed.seal([{"name": "brake_fade"}]).digest != promise.digest


def test_sets_come_again_from_their_seed_and_in_every_kind() -> None:
    wanted = catalogue.orders(0.01)
    assert {o.kind for o in wanted} == {
        "clean",
        "drift",
        "single",
        "pair",
        "absorbed",
        "off",
        "faint",
    }
    order = next(o for o in wanted if o.kind == "drift")
    one, two = catalogue.make(order), catalogue.make(order)
    np.testing.assert_array_equal(one.columns["v"], two.columns["v"])
    whole = catalogue.orders(1.0)
    assert sum(o.kind == "clean" for o in whole) >= 300
    assert len({o.names for o in whole if o.kind == "pair"}) >= 12
    assert len({o.names for o in whole if o.kind == "absorbed"}) == 4
    assert len({o.names for o in whole if o.kind == "off"}) >= 4


def test_every_first_part_of_the_order_is_a_fair_share() -> None:
    whole = catalogue.orders(1.0)
    for end in (100, 250, 500):
        for kind in ("clean", "drift", "single"):
            expected = end / len(whole) * sum(o.kind == kind for o in whole)
            assert sum(o.kind == kind for o in whole[:end]) == pytest.approx(expected, abs=9.0)


def truth_told(hidden: catalogue.HiddenSet) -> sealed.InquiryFinding:
    """A finding that says what is so."""
    late = hidden.truth.dead_time - 0.01
    on = {key: getattr(hidden.truth, key) for key in ("m_m", "b_m", "m_b", "b_b")}
    effects = tuple(
        {
            "name": h.name,
            "parameters": {k: (v, 0.1 * abs(v)) for k, v in h.parameters.items()},
            "confidence": 0.99,
            "alternatives": [],
        }
        for h in hidden.hidden
    )
    added = tuple((h.name, h.parameters) for h in hidden.hidden)
    return sealed.InquiryFinding(
        "missing_effect", effects, (("speed", 1e-6),), 0.9, on | {"dead_time": late}, added
    )


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_the_truth_scores_full_and_silence_nothing(name: str) -> None:
    order = catalogue.Order("single", (name,), "large", 4)
    rng = np.random.default_rng(4)
    hidden = catalogue.measured(catalogue.drawn(order, rng), rng)
    told = truth_told(hidden)
    outcome = score(hidden, told)
    assert outcome.right
    assert not outcome.wrong
    assert all(outcome.covered.values())
    assert outcome.closing.after == pytest.approx(outcome.closing.floor, rel=1e-6)
    silent = score(hidden, sealed.InquiryFinding("none"))
    assert not silent.right
    assert not silent.wrong
    assert not silent.covered
    assert silent.closing.after == silent.closing.before
    other = "brake_lag" if name != "brake_lag" else "cross_slope"
    claim = {"name": other, "parameters": {}, "confidence": 0.9, "alternatives": [name]}
    false = score(hidden, replace(told, effects=(claim,)))
    assert false.wrong
    assert not false.right
    unsure = score(hidden, replace(told, verdict="ambiguous", effects=(claim,)))
    assert not unsure.wrong
    assert set(unsure.truth) <= {*unsure.named, *unsure.alternatives}


def test_shares_come_with_wilson_intervals() -> None:
    # Published: Newcombe 1998, table I: 81 of 263 and 1 of 29 by Wilson's score.
    assert metrics.wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert metrics.wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=1e-4)
    found = metrics.share("x", ">=", 0.9, [True] * 9 + [False])
    assert found.passed
    assert found.hits == 9
    assert metrics.share("x", "in", (0.92, 0.97), [True] * 10).passed is False
    assert metrics.share("x", ">=", 0.9, []).passed is None


@pytest.mark.skipif(not peer.available(), reason="pysindy is not installed")
def test_the_other_method_finds_what_is_plain() -> None:
    order = catalogue.Order("single", ("turning_resistance",), "large", 4)
    stops = scene(150)
    truth = BASE._replace(turning=0.5)
    hidden = catalogue.HiddenSet(
        order,
        "mixed",
        0.01,
        0.005,
        {},
        {"dead_time": 0.25},
        truth,
        (),
        stops,
        worth.Worth(0.0, "", 0.0),
    )
    columns = catalogue.measured(hidden, np.random.default_rng(0)).columns
    named = peer.name_effects(columns, hidden.configured)
    assert named is not None
    assert named[0] == "turning_resistance"
