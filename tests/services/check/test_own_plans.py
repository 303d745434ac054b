"""Plans of ours are not refused, on ground that was generated for other plans."""

from __future__ import annotations

import numpy as np
import pytest

import slopewise
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from tests.services.check.own_plans import checked, scene
from tests.services.check.sound_plans import vehicle

SEEDS = range(10_000, 10_200)
"""Scenes of three plans by night; what is worth keeping has a scene by day."""


@pytest.mark.parametrize("seed", [2123, 2307])
def test_plans_that_were_refused_are_not(seed: int) -> None:
    texts = [text for _, text in checked(scene(seed))]
    assert texts == [[]] * len(texts) != []


@pytest.mark.nightly
@pytest.mark.timeout(3600)
def test_few_of_many_plans_are_refused() -> None:
    """Edges that a band only just reaches, and slopes in tight turns, remain open."""
    verdicts = [(seed, *verdict) for seed in SEEDS for verdict in checked(scene(seed))]
    refusals = [(seed, plan.candidate, texts[0]) for seed, plan, texts in verdicts if texts]
    assert len(verdicts) > 400
    assert len(refusals) <= 4, refusals


def test_surface_that_wheels_touch_between_two_rows() -> None:
    """A corner of firm ground under a front wheel for some centimetres: plans see that of rows."""
    model = vehicle("ugv")
    heading, cell = np.array([np.cos(0.6), np.sin(0.6)]), 0.25
    points = np.array([3.0, 3.0]) + np.linspace(0.0, 14.0, 57)[:, None] * heading
    left = 0.5 * model.vehicle.track_width * np.array([-heading[1], heading[0]])
    for along in np.arange(6.0, 6.8, 0.1):
        column, row = np.floor((np.array([3.0, 3.0]) + along * heading + left) / cell).astype(int)
        classes = np.ones((80, 80), np.int64)
        classes[row + 2, column] = 0
        ground = ElevationMap(
            elevation=np.zeros((80, 80)),
            resolution=cell,
            origin=(0.0, 0.0),
            terrain_class=classes,
            class_names=("", "wet_grass"),
        )
        (plan,) = slopewise.plan(model, ground, [CandidatePath(name="a", points=points)])
        report = slopewise.check_plan(plan, model, ground)
        assert not report.violations, along
