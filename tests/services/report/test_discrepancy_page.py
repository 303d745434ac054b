"""Cells of a named effect, as page and command show them."""

from __future__ import annotations

import pytest

from slopewise.models.discrepancy.findings import Estimate, NamedEffect
from slopewise.services.report.discrepancy_page import effect_cells


@pytest.mark.parametrize(
    ("confidence", "alternatives", "text"),
    [
        (0.62, (), "another or a further one: 38%"),
        (0.62, ("brake_fade", "viscous_resistance"), "brake_fade, viscous_resistance"),
        (0.93, (), "–"),
    ],
)
def test_a_name_that_is_not_certain_is_never_alone(
    confidence: float, alternatives: tuple[str, ...], text: str
) -> None:
    tau = {"tau": Estimate(0.3, 0.01, "s")}
    effect = NamedEffect("brake_lag", tau, confidence, alternatives, "everywhere")
    cells = effect_cells(effect)
    assert cells == ("brake_lag", "tau = 0.3 ± 0.01 s", f"{confidence:.0%}", text, "everywhere")
