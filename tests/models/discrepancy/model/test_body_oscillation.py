"""A body that rocks when the brakes take hold is nothing that the brakes lack."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.discrepancy.findings import Findings, Verdict
from slopewise.models.discrepancy.workflow import investigate
from tests.models.discrepancy.logs import WORLDS, log
from tests.models.models_for_tests import BASE

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


@pytest.mark.parametrize(("name", "effect"), [("drag", "aerodynamic_drag"), ("lag", "brake_lag")])
def test_an_effect_is_named_although_the_body_rocks(name: str, effect: str) -> None:
    f = rocking(name)
    assert f.verdict is Verdict.MISSING_EFFECT
    assert [e.name for e in f.effects] == [effect]
    for parameter, value in f.effects[0].parameters.items():
        truth = WORLDS[name].effects[effect][parameter]
        assert abs(value.value - truth) < 4.0 * value.std
