"""Drives behind the guard that ended in obstacles when it checked seven points of the body."""

from __future__ import annotations

import pytest

from benchmarks.guard.guard_benchmark import scenes
from benchmarks.guard.guard_scenes import drive
from slopewise.services.io.model_file import read_model, shipped_models

ATV = read_model(shipped_models()["atv"])
STRONGEST = {"forest": (9, 28, 39), "pivot": (2, 5, 7, 8, 24, 27, 30), "swerve": (9, 10, 16, 31)}


@pytest.mark.parametrize("kind", STRONGEST)
def test_no_drive_ends_in_an_obstacle(kind: str) -> None:
    cases = scenes(kind, max(STRONGEST[kind]) + 1)
    drives = [drive(cases[seed], ATV) for seed in STRONGEST[kind]]
    assert [d.what for d in drives] == [""] * len(drives)
    # A guard that never passes proves nothing.
    assert sum(d.actions["pass"] + d.actions["slow"] for d in drives) > 10 * len(drives)
