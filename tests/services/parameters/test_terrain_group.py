"""Terrain parameters in the service: towards faster on ground of a known class only."""

from __future__ import annotations

import pytest

from slopewise.services.parameters.terrain_group import TerrainGroup
from slopewise.services.settings.learning_settings import Learning
from tests.models.terrain.test_monitor import MODEL


def values(group: TerrainGroup) -> tuple[float, ...]:
    terrain = group.apply(MODEL).terrain
    return (terrain.motion_resistance, terrain.lateral_resistance, terrain.slip_track)


def test_unknown_ground_never_makes_a_plan_faster() -> None:
    prior = MODEL.terrain
    before = (prior.motion_resistance, prior.lateral_resistance, prior.slip_track)
    easy = ((0.01, 0.01), (0.01, 0.01), (MODEL.vehicle.track_width, 0.0))
    group = TerrainGroup(MODEL, Learning())
    assert not group.learn(easy, valid=False)
    assert values(group) == pytest.approx(before)
    assert group.learn(easy, valid=True)
    assert values(group)[0] < before[0]


def test_unknown_ground_makes_it_slower_at_once_and_not_faster_again() -> None:
    group = TerrainGroup(MODEL, Learning())
    track = 3.0 * MODEL.vehicle.track_width
    assert group.learn(((0.5, 0.01), (0.6, 0.01), (track, 0.1)), valid=False)
    slow = values(group)
    assert slow == pytest.approx((0.51, 0.61, track + 0.1), rel=1e-3)
    assert not group.learn(((0.1, 0.01), (0.1, 0.01), (track / 2, 0.1)), valid=False)
    assert values(group) == pytest.approx(slow, rel=1e-3)
