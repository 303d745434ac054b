"""Hidden effects are found by a process that receives a log only, and findings are judged."""

from __future__ import annotations

import os
import pickle
from collections.abc import Iterator
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

from benchmarks.discrepancy import plant_world
from benchmarks.discrepancy.blind_run import BlindRun, Finding, SealedLog, tables_of
from benchmarks.discrepancy.fresh_stops import closing, covered
from benchmarks.discrepancy.hidden_effects import FIELDS
from benchmarks.discrepancy.plant_world import HiddenSet, SetConditions, SetSpec
from tests.benchmarks.driven_stops import measured

EASY = SetConditions(designs=("mixed",), counts=(40,), noises=(0.01, 0.03), scatters=(0.005, 0.02))


@pytest.fixture(scope="module")
def process() -> Iterator[BlindRun]:
    with BlindRun() as running:
        yield running


def set_of(
    kind: str, names: str, size: str, seed: int
) -> tuple[HiddenSet, dict[str, Any], np.random.Generator]:
    rng = np.random.default_rng(seed)
    spec = SetSpec(kind, tuple(names.split("+")) if names else (), size, seed)
    hidden = plant_world.nameable_set(spec, rng, EASY)
    return hidden, measured(hidden.truth, hidden.stops, hidden.noise, rng), rng


def test_process_and_log_hold_no_truth(process: BlindRun) -> None:
    """It investigates too few stops here; test_car.py has a whole log by night."""
    assert process.pool.submit(os.getppid).result() == os.getpid()
    assert process.pool.submit(os.listdir).result() == []
    modules = process.pool.submit(eval, "sorted(__import__('sys').modules)").result()
    for name in ("plant_world", "hidden_effects", "naming_benchmark", "fresh_stops"):
        assert f"benchmarks.discrepancy.{name}" not in modules
    assert [f.name for f in fields(SealedLog)] == ["columns", "model"]
    hidden, logged, _ = set_of("single", "aerodynamic_drag", "large", 11)
    sent = pickle.dumps(SealedLog(logged, tables_of(hidden.configured)))
    assert not [t for t in (b"drag", b"single", b"large", b"truth", b"seed") if t in sent]
    columns = "run t v v_cmd pitch roll yaw yaw_rate x y ambient"
    assert set(logged) == set(columns.split())
    few = {name: values[:300] for name, values in logged.items()}
    finding = process.investigate(SealedLog(few, tables_of(hidden.configured)))
    assert (finding.verdict, "usable stops" in finding.text) == ("fault", True), finding.text


@pytest.mark.parametrize(
    "name",
    [
        pytest.param(n, marks=pytest.mark.nightly if k % 3 else ())
        for k, n in enumerate(sorted(FIELDS))
    ],
)
def test_truth_closes_the_gap_and_silence_nothing(name: str) -> None:
    rng = np.random.default_rng(4)
    hidden = plant_world.draw_set(SetSpec("single", (name,), "large", 4), rng, EASY)
    effects = tuple(
        {
            "name": h.name,
            "parameters": {k: (v, 0.1 * abs(v)) for k, v in h.parameters.items()},
            "confidence": 0.99,
        }
        for h in hidden.hidden
    )
    braking = {key: getattr(hidden.truth, key) for key in ("m_m", "b_m", "m_b", "b_b")}
    braking["dead_time"] = hidden.truth.dead_time - 0.01
    added = tuple((h.name, h.parameters) for h in hidden.hidden)
    truth = Finding("missing_effect", effects, (("speed", 1e-6),), braking, added)
    assert all(covered(hidden.hidden, truth).values())
    gap = closing(hidden, truth)
    assert gap.after == pytest.approx(gap.floor, rel=1e-6)
    silent = closing(hidden, Finding("none"))
    assert silent.after == silent.before
    assert covered(hidden.hidden, Finding("none")) == {}
