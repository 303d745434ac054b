"""Hidden effects are found by a process that receives a log only, and findings are scored."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest

from benchmarks.discrepancy import catalogue
from benchmarks.discrepancy.blind_run import BlindRun, Finding, SealedLog, tables_of
from benchmarks.discrepancy.catalogue import HiddenSet, SetConditions, SetSpec
from benchmarks.discrepancy.discrepancy_metrics import share, wilson
from benchmarks.discrepancy.hidden_effects import FIELDS
from benchmarks.discrepancy.score import SetOutcome, score

ABSORBED = {"none", "parameter_drift", "unidentifiable"}
EASY = SetConditions(designs=("mixed",), counts=(40,), noises=(0.01, 0.03), scatters=(0.005, 0.02))


@pytest.fixture(scope="module")
def process() -> Iterator[BlindRun]:
    with BlindRun() as running:
        yield running


def investigated(process: BlindRun, kind: str, names: str, size: str, seed: int) -> SetOutcome:
    spec = SetSpec(kind, tuple(names.split("+")) if names else (), size, seed)
    hidden = catalogue.make(spec, EASY)
    log = SealedLog(hidden.columns, tables_of(hidden.configured))
    outcome = score(hidden, process.investigate(log))
    assert outcome.verdict != "fault", outcome.text
    return outcome


def by_night(*case: object) -> Any:
    """A set like one that tests/models/discrepancy investigates every day, without the process."""
    return pytest.param(*case, marks=pytest.mark.nightly)


@pytest.mark.parametrize(
    ("names", "seed"),
    [
        ("brake_lag+cross_slope", 11),
        by_night("brake_lag", 1),
        by_night("aerodynamic_drag", 2),
        by_night("cross_slope", 3),
        by_night("step_change", 4),
        by_night("surface_patch", 5),
        by_night("directional_surface", 6),
    ],
)
def test_large_effects_are_named_and_close_the_gap(
    process: BlindRun, names: str, seed: int
) -> None:
    pair = "+" in names
    outcome = investigated(process, "pair" if pair else "single", names, "large", seed)
    assert outcome.identifiable
    assert outcome.right, (outcome.verdict, outcome.named)
    if not pair:
        assert outcome.axis_right, outcome.located
        # The rim of a patch lies between the stops, and fresh ones fall there.
        smallest = 0.2 if names == "surface_patch" else 0.8
        assert outcome.closing.share is None or outcome.closing.share > smallest


@pytest.mark.parametrize(
    ("kind", "name", "size", "seed", "verdicts"),
    [
        by_night("clean", "", "", 21, {"none", "parameter_drift"}),
        ("drift", "", "", 31, {"parameter_drift"}),
        ("off", "grab", "large", 41, {"none", "parameter_drift", "unknown"}),
        ("absorbed", "grade_bias", "medium", 51, ABSORBED),
        *(
            by_night("absorbed", name, "medium", 51, ABSORBED)
            for name in catalogue.CONFOUNDED
            if name != "grade_bias"
        ),
    ],
)
def test_other_sets_get_no_name(
    process: BlindRun, kind: str, name: str, size: str, seed: int, verdicts: set[str]
) -> None:
    outcome = investigated(process, kind, name, size, seed)
    assert outcome.verdict in verdicts, outcome.named
    assert outcome.axis_right or kind != "off", outcome.located
    if kind == "drift":
        assert outcome.closing.share is not None
        assert outcome.closing.share > 0.9


def test_process_and_log_hold_no_truth(process: BlindRun) -> None:
    assert process.pool.submit(os.getppid).result() == os.getpid()
    assert process.pool.submit(os.listdir).result() == []
    modules = process.pool.submit(eval, "sorted(__import__('sys').modules)").result()
    for name in ("catalogue", "hidden_effects", "discrepancy_campaign", "score"):
        assert f"benchmarks.discrepancy.{name}" not in modules
    assert [f.name for f in fields(SealedLog)] == ["columns", "model"]
    hidden = catalogue.make(SetSpec("single", ("aerodynamic_drag",), "large", 11))
    sent = pickle.dumps(SealedLog(hidden.columns, tables_of(hidden.configured)))
    assert not [t for t in (b"drag", b"single", b"large", b"truth", b"seed") if t in sent]
    columns = "run t v v_cmd pitch roll yaw yaw_rate x y ambient"
    assert set(hidden.columns) == set(columns.split())


def test_sets_repeat_from_their_seed_and_cover_every_kind() -> None:
    kinds = {"clean", "drift", "single", "pair", "absorbed", "off", "faint"}
    specs = catalogue.specs(0.01)
    assert {s.kind for s in specs} == kinds
    spec = next(s for s in specs if s.kind == "drift")
    first, again = catalogue.make(spec), catalogue.make(spec)
    np.testing.assert_array_equal(first.columns["v"], again.columns["v"])
    every = catalogue.specs(1.0)
    for end in (100, 250, 500):
        for kind in ("clean", "drift", "single"):
            expected = end / len(every) * sum(s.kind == kind for s in every)
            assert sum(s.kind == kind for s in every[:end]) == pytest.approx(expected, abs=9.0)


def true_finding(hidden: HiddenSet) -> Finding:
    """A finding that states the truth."""
    effects = tuple(
        {
            "name": h.name,
            "parameters": {k: (v, 0.1 * abs(v)) for k, v in h.parameters.items()},
            "confidence": 0.99,
            "alternatives": [],
        }
        for h in hidden.hidden
    )
    braking = {key: getattr(hidden.truth, key) for key in ("m_m", "b_m", "m_b", "b_b")}
    braking["dead_time"] = hidden.truth.dead_time - 0.01
    added = tuple((h.name, h.parameters) for h in hidden.hidden)
    return Finding("missing_effect", effects, (("speed", 1e-6),), braking, added)


@pytest.mark.parametrize("name", sorted(FIELDS))
def test_truth_scores_in_full_and_silence_nothing(name: str) -> None:
    rng = np.random.default_rng(4)
    hidden = catalogue.measure(catalogue.draw_set(SetSpec("single", (name,), "large", 4), rng), rng)
    truth = true_finding(hidden)
    outcome = score(hidden, truth)
    assert outcome.right
    assert not outcome.wrong
    assert all(outcome.covered.values())
    assert outcome.closing.after == pytest.approx(outcome.closing.floor, rel=1e-6)
    silent = score(hidden, Finding("none"))
    assert (silent.right, silent.wrong, silent.covered) == (False, False, {})
    assert silent.closing.after == silent.closing.before
    false_name = "brake_lag" if name != "brake_lag" else "cross_slope"
    claim = {"name": false_name, "parameters": {}, "confidence": 0.9, "alternatives": [name]}
    false = score(hidden, replace(truth, effects=(claim,)))
    assert (false.right, false.wrong) == (False, True)
    assert not score(hidden, replace(truth, verdict="ambiguous", effects=(claim,))).wrong


def test_shares_have_wilson_intervals() -> None:
    # Published: Newcombe 1998, table I: 81 of 263 and 1 of 29 by Wilson's score.
    assert wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=1e-4)
    metric = share("x", ">=", 0.9, [True] * 9 + [False])
    assert (metric.passed, metric.hits) == (True, 9)
    assert share("x", "in", (0.92, 0.97), [True] * 10).passed is False
    assert share("x", ">=", 0.9, []).passed is None
