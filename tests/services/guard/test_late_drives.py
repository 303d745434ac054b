"""Drives toward a wall behind the guard, with messages that arrive late."""

from __future__ import annotations

import itertools
from collections import Counter

import pytest

from tests.services.guard.late_drives import CONTACT, Outcome, Scene, drive, scenes

SENSITIVE = (17, 18, 21, 25, 28, 29, 33, 40, 42, 45, 61, 71, 78, 85, 92, 93, 95, 103, 119, 130, 131)
"""Drives of the first 136 that end in the wall where the guard neglects the delay (14 of them), the
stamps (11) or the declared latency (3)."""


def collisions(drives: list[Scene]) -> tuple[list[str], dict[tuple[str, str], list[Outcome]]]:
    """Drives that ended in the wall at speed, and all outcomes by clock and delay."""
    outcomes: dict[tuple[str, str], list[Outcome]] = {}
    ended = []
    for scene in drives:
        outcome = drive(scene)
        outcomes.setdefault((scene.clock, scene.kind), []).append(outcome)
        if outcome.contact > CONTACT:
            ended.append(f"{scene.seed} {scene.clock} {scene.kind}: {outcome.contact:.2f} m/s")
    return ended, outcomes


def test_late_messages_end_no_drive_in_the_wall() -> None:
    """Constant, growing and jittering delay, frozen sensors, set clocks, lost odometry."""
    drives = scenes(136)
    ended, outcomes = collisions([*drives[:17], *(drives[n] for n in SENSITIVE)])
    assert not ended
    for (clock, kind), group in outcomes.items():
        moved = sum(outcome.distance > 1.0 for outcome in group)
        assert moved >= len(group) // 2, (clock, kind)  # a guard that never passes proves nothing
    flags = {key: set().union(*(o.flags for o in group)) for key, group in outcomes.items()}
    assert "stamps of odometry are repeated" in flags["unknown", "repeated"]
    assert "the clock that stamps odometry was set" in flags["unknown", "step"]
    assert any("s late" in flag for flag in flags["unknown", "growing"])
    assert any("has no stamps" in flag for flag in flags["none", "constant"])


@pytest.mark.nightly
def test_late_messages_end_none_of_a_thousand_drives_in_the_wall() -> None:
    ended, outcomes = collisions(scenes(1000))
    drives = list(itertools.chain.from_iterable(outcomes.values()))
    actions = Counter(itertools.chain.from_iterable(outcome.actions for outcome in drives))
    print(f"{len(ended)} collisions in {len(drives)} drives, {dict(actions)}")
    assert not ended


def test_planner_that_brakes_in_time_is_not_delayed_by_the_declared_latency() -> None:
    """Without delay, in the default settings: the mean speed with the latency and without it."""
    speeds = []
    for latency in (0.0, 0.2):
        outcomes = [
            drive(Scene(n, "unknown", "constant", no_delay=True, slows=True, max_latency=latency))
            for n in range(6)
        ]
        speeds.append(sum(o.distance for o in outcomes) / sum(o.moving_time for o in outcomes))
    assert speeds[1] > 0.99 * speeds[0]
