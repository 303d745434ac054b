"""Drives behind the guard that end in obstacles where it checks less."""

from __future__ import annotations

import pytest

from benchmarks.guard.guard_scenes import drive, scenes

STRONGEST = {"pivot": (5021,), "swerve": (5008, 5010, 5019, 5050)}
"""Drives that end in obstacles where the guard checks a narrower and shorter body (5021), neglects
ages and the commands before (5008), checks the arc of the command only (5010), or uses poses that
do not change (the others)."""


@pytest.mark.parametrize("kind", STRONGEST)
def test_no_drive_ends_in_an_obstacle(kind: str) -> None:
    drives = [drive(scenes(kind, 1, seed)[0]) for seed in STRONGEST[kind]]
    assert [d.fault for d in drives] == [""] * len(drives)
    # A guard that never passes proves nothing.
    assert sum(d.actions["pass"] + d.actions["slow"] for d in drives) > 10 * len(drives)
