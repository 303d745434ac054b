"""Pictures show the model that is written."""

from __future__ import annotations

import numpy as np
import pytest

from slopewise.models.discrepancy.findings import Verdict
from slopewise.models.discrepancy.report.evidence import Evidence
from slopewise.models.discrepancy.workflow import investigate_with_evidence
from tests.models.discrepancy.logs import log
from tests.models.models_for_tests import BASE


def evidence(name: str) -> tuple[Verdict, Evidence]:
    findings, shown = investigate_with_evidence(*log(name), BASE)
    return findings.verdict, shown


@pytest.mark.parametrize("name", ["clean", "noisy"])
def test_a_model_that_stays_is_shown_as_it_is(name: str) -> None:
    verdict, shown = evidence(name)
    assert verdict in (Verdict.NONE, Verdict.TOO_NOISY)
    np.testing.assert_array_equal(shown.found, shown.configured)
    np.testing.assert_array_equal(shown.speed_after, shown.speed_before)
    assert not shown.changed


def test_new_coefficients_are_shown_by_the_stop_with_the_largest_change() -> None:
    verdict, shown = evidence("drift")
    assert verdict is Verdict.PARAMETER_DRIFT
    assert shown.changed
    change = np.abs(shown.found - shown.configured)
    largest = int(np.argmax(change))
    start_speed = shown.speed[shown.time <= 0.1].mean()
    assert shown.speed_before[-1] != shown.speed_after[-1]
    assert change[largest] > 0.05
    assert start_speed > 0.5
