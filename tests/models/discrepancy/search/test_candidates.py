"""Candidates of the search begin where an effect can be."""

from __future__ import annotations

import pytest

from slopewise.models.discrepancy.search.candidates import EffectColumn
from slopewise.models.effects.registry import validate


@pytest.mark.parametrize(("strength", "scale"), [(-0.3, 0.7), (-1.1, 0.0), (0.2, 1.2)])
def test_brakes_never_push(strength: float, scale: float) -> None:
    """A line through the stops may ask for less than no force; there is no such effect."""
    effect = EffectColumn("step_change", {"delta": 0.0, "run": 3.0}).effect(strength)
    assert validate(effect)["scale"] == pytest.approx(scale)
