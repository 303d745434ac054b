"""Hidden effects are found by a process that receives a log only; truths stay sealed."""

from __future__ import annotations

import hashlib
import os
import pickle
from collections.abc import Iterator
from dataclasses import fields, replace

import numpy as np
import pytest

from benchmarks.discrepancy import blind_run, catalogue, discrepancy_metrics
from benchmarks.discrepancy.blind_run import BlindRun, Finding, SealedLog, tables_of
from benchmarks.discrepancy.catalogue import HiddenSet, SetConditions, SetSpec
from benchmarks.discrepancy.hidden_effects import FIELDS
from benchmarks.discrepancy.power import PowerCase, PowerOutcome, by_ratio, by_stops
from benchmarks.discrepancy.score import SetOutcome, score

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


@pytest.mark.parametrize(
    ("names", "seed"),
    [
        ("brake_lag", 1),
        ("aerodynamic_drag", 2),
        ("cross_slope", 3),
        ("step_change", 4),
        ("surface_patch", 5),
        ("directional_surface", 6),
        ("brake_lag+cross_slope", 11),
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


@pytest.mark.parametrize("seed", [21, 22, 23])
def test_clean_logs_get_no_name(process: BlindRun, seed: int) -> None:
    assert investigated(process, "clean", "", "", seed).verdict in ("none", "parameter_drift")


def test_other_coefficients_are_drift(process: BlindRun) -> None:
    outcome = investigated(process, "drift", "", "", 31)
    assert outcome.verdict == "parameter_drift"
    assert outcome.closing.share is not None
    assert outcome.closing.share > 0.9


@pytest.mark.parametrize(("name", "seed"), [("grab", 41), ("bump", 42)])
def test_effects_off_the_library_get_their_axis_and_no_name(
    process: BlindRun, name: str, seed: int
) -> None:
    outcome = investigated(process, "off", name, "large", seed)
    assert outcome.verdict not in ("missing_effect", "ambiguous"), outcome.named
    assert outcome.axis_right, outcome.located


@pytest.mark.parametrize("name", catalogue.CONFOUNDED)
def test_confounded_effects_get_no_name(process: BlindRun, name: str) -> None:
    assert investigated(process, "absorbed", name, "medium", 51).verdict != "missing_effect"


def test_process_has_no_memory_and_no_folder_of_the_truth(process: BlindRun) -> None:
    assert process.pool.submit(os.getppid).result() == os.getpid()
    assert process.pool.submit(os.listdir).result() == []
    modules = process.pool.submit(eval, "sorted(__import__('sys').modules)").result()
    for name in ("catalogue", "hidden_effects", "discrepancy_campaign", "tasks", "score"):
        assert f"benchmarks.discrepancy.{name}" not in modules


def test_sealed_log_carries_no_truth() -> None:
    assert [f.name for f in fields(SealedLog)] == ["columns", "model"]
    hidden = catalogue.make(SetSpec("single", ("aerodynamic_drag",), "large", 11))
    log = SealedLog(hidden.columns, tables_of(hidden.configured))
    sent = pickle.dumps(log)
    for text in (b"drag", b"single", b"large", b"truth", b"seed"):
        assert text not in sent
    columns = "run t v v_cmd pitch roll yaw yaw_rate x y ambient"
    assert set(log.columns) == set(columns.split())
    assert np.isfinite(hidden.columns["v"]).all()


def test_commitment_binds_the_truth() -> None:
    promise = blind_run.commit([{"name": "brake_lag"}])
    digest = hashlib.sha256((promise.nonce + promise.truths).encode()).hexdigest()
    assert digest == promise.digest
    assert blind_run.commit([{"name": "brake_fade"}]).digest != promise.digest


def test_sets_repeat_from_their_seed_and_cover_every_kind() -> None:
    specs = catalogue.specs(0.01)
    kinds = {"clean", "drift", "single", "pair", "absorbed", "off", "faint"}
    assert {s.kind for s in specs} == kinds
    spec = next(s for s in specs if s.kind == "drift")
    first, again = catalogue.make(spec), catalogue.make(spec)
    np.testing.assert_array_equal(first.columns["v"], again.columns["v"])
    every = catalogue.specs(1.0)
    counts = {kind: len({s.names for s in every if s.kind == kind}) for kind in kinds}
    assert counts["pair"] >= 12
    assert counts["absorbed"] == 4
    for end in (100, 250, 500):
        for kind in ("clean", "drift", "single"):
            expected = end / len(every) * sum(s.kind == kind for s in every)
            assert sum(s.kind == kind for s in every[:end]) == pytest.approx(expected, abs=9.0)


def true_finding(hidden: HiddenSet) -> Finding:
    """A finding that states the truth."""
    late = hidden.truth.dead_time - 0.01
    coefficients = {key: getattr(hidden.truth, key) for key in ("m_m", "b_m", "m_b", "b_b")}
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
    braking = coefficients | {"dead_time": late}
    return Finding("missing_effect", effects, (("speed", 1e-6),), 0.9, braking, added)


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
    assert false.wrong
    assert not false.right
    ambiguous = score(hidden, replace(truth, verdict="ambiguous", effects=(claim,)))
    assert not ambiguous.wrong
    assert set(ambiguous.truth) <= {*ambiguous.named, *ambiguous.alternatives}


def test_shares_have_wilson_intervals() -> None:
    # Published: Newcombe 1998, table I: 81 of 263 and 1 of 29 by Wilson's score.
    assert discrepancy_metrics.wilson(81, 263) == pytest.approx((0.2553, 0.3662), abs=1e-4)
    assert discrepancy_metrics.wilson(1, 29) == pytest.approx((0.0061, 0.1718), abs=1e-4)
    metric = discrepancy_metrics.share("x", ">=", 0.9, [True] * 9 + [False])
    assert metric.passed
    assert metric.hits == 9
    assert discrepancy_metrics.share("x", "in", (0.92, 0.97), [True] * 10).passed is False
    assert discrepancy_metrics.share("x", ">=", 0.9, []).passed is None


def test_power_tables_count() -> None:
    def result(name: str, right: bool, change: float) -> PowerOutcome:
        case = PowerCase(name, "small" if name else "", 60, 3, 0)
        verdict = "missing_effect" if right and name else "none"
        return PowerOutcome(case, True, right, right and bool(name), False, verdict, change, 0.02)

    results = [
        result("step_change", True, 0.05),
        result("step_change", False, 0.015),
        result("", True, 0.0),
    ]
    (line,) = [r for r in by_stops(results) if r.split()[:3] == ["60", "×", "3"]]
    assert line.split() == ["60", "×", "3", "2/2", "1", "1/2", "0", "1/1", "2.0"]
    counts = [row.split()[-4:] for row in by_ratio(results)[1:]]
    assert [row[0] for row in counts] == ["0", "1", "0", "1"]
    assert counts[3] == ["1", "1", "1", "0"]
