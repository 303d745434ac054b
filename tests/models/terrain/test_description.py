"""Two words for the ground, changes of them, and plans that use the surfaces they leave."""

from __future__ import annotations

import dataclasses
import itertools
import math

import numpy as np
import pytest

from slopewise.models.surface_braking import SurfaceBraking
from slopewise.models.terrain.classes import FeatureOfClass, TerrainClass, TerrainClasses
from slopewise.models.terrain.description import (
    UNDECIDED,
    GroundDescriber,
    GroundDescription,
    ThresholdSettings,
    open_surfaces,
)
from slopewise.models.terrain.surfaces import with_open_surfaces
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain.vehicles import MODEL, observation_of
from tests.world.ground import ground_map, straight

HUSKY = read_terrains(find_terrains("husky"))
THRESHOLDS = ThresholdSettings(soft_above=0.15, slippery_below=0.3)
NAN = math.nan


def described(*observations, thresholds=THRESHOLDS):
    describer = GroundDescriber(thresholds)
    changes = [c for o in observations for c in describer.add(o)]
    return describer, changes


def repeated(count, begin=0.0, **features):
    """Stretches of two seconds each."""
    f_r = features.pop("f_r", NAN)
    return [observation_of(f_r, end=begin + 2.0 * (i + 1), **features) for i in range(count)]


@pytest.mark.parametrize(
    ("f_r", "turning", "text"),
    [
        (0.12, NAN, "hard"),
        (0.19, NAN, "soft"),
        (0.15, NAN, UNDECIDED),
        (0.10, 0.2, "hard, slippery"),
        (NAN, 0.4, "gripping"),
    ],
)
def test_what_is_stated(f_r, turning, text):
    describer, _ = described(*repeated(3, f_r=f_r, turning=turning))
    assert str(describer.describe()) == text


def test_the_score_by_hand_and_the_two_levels():
    # ln(0.19/0.15) = 0.2364 over √(0.17² + 0.18²/3) = 0.1994
    describer, _ = described(*repeated(3, f_r=0.19, error=0.18))
    score = describer.describe().hardness_score
    assert score == pytest.approx(0.2364 / 0.1994, abs=1e-3)
    assert describer.describe().hardness == "soft"
    assert describer.describe(relied_on=True).hardness == UNDECIDED
    assert math.isnan(describer.describe().grip_score)
    # twice the speed: 0.20 ln 2 more
    fast = [dataclasses.replace(o, speed=0.6) for o in repeated(3, f_r=0.19, error=0.18)]
    more = described(*fast)[0].describe().hardness_score - score
    assert more == pytest.approx(0.2 * math.log(2.0) / 0.1994, abs=1e-3)
    turn = repeated(1, turning=0.36, error=0.12)
    slow, fast = turn, [dataclasses.replace(o, speed=0.6) for o in turn]
    scores = [described(*rows)[0].describe().grip_score for rows in (slow, fast)]
    spread = math.hypot(0.13, 0.12)
    assert scores[0] == pytest.approx(math.log(1.2) / spread)
    assert scores[1] == pytest.approx((math.log(1.2) + 0.06 * math.log(2.0)) / spread)


def test_evidence_is_forgotten_after_twelve_seconds():
    describer, _ = described(*repeated(3, f_r=0.3), *repeated(7, 6.0, turning=0.6))
    assert str(describer.describe()) == "gripping"


def test_without_a_threshold_nothing_is_stated():
    describer, _ = described(*repeated(3, f_r=0.9, turning=0.9), thresholds=ThresholdSettings())
    assert str(describer.describe()) == UNDECIDED


def test_a_change_is_a_description_turned_around():
    rows = [*repeated(4, f_r=0.08, turning=0.6), *repeated(4, 8.0, f_r=0.3, turning=0.6)]
    _, changes = described(*rows)
    (change,) = changes
    assert (change.before, change.now, change.again) == ("hard", "soft", False)
    assert 8.0 < change.time <= 14.0
    assert change.strength >= 1.0
    back = [*rows, *repeated(3, 16.0, f_r=0.08, turning=0.6)]
    assert [(c.now, c.again) for c in described(*back)[1]] == [("soft", False), ("hard", True)]
    # onto ice, seen in a turn; what was known of hardness begins again with it
    icy = [*repeated(4, turning=0.6), *repeated(4, 8.0, f_r=0.1, turning=0.12)]
    assert [(c.before, c.now) for c in described(*icy)[1]] == [("gripping", "slippery")]
    # to undecided ground is no change, and what was before is remembered
    _, changes = described(*rows[:4], *repeated(4, 8.0, f_r=0.15), *repeated(3, 16.0, f_r=0.3))
    assert [(c.before, c.now) for c in changes] == [("hard", "soft")]


SURFACES = {
    "asphalt": (0.08, 0.40, 0.42),
    "ice": (0.11, 0.08, 0.12),
    "loam": (0.20, 0.60, 0.30),
    "snow": (0.30, 0.30, 0.20),
}
"""f_r, μ_t and the b_b of a table of braking."""
DESCRIPTIONS = [
    GroundDescription(*texts)
    for texts in itertools.product(("hard", "soft", UNDECIDED), ("gripping", "slippery", UNDECIDED))
]
CLASSES = TerrainClasses(
    name="x",
    terrain=tuple(
        TerrainClass(
            name=name,
            motion_resistance=FeatureOfClass(mean=f_r, std=0.01, samples=6),
            lateral_resistance=FeatureOfClass(mean=mu_t, std=0.01, samples=6),
        )
        for name, (f_r, mu_t, _) in SURFACES.items()
    ),
)
TABLES = {
    **{name: SurfaceBraking(b_b=b_b) for name, (_, _, b_b) in SURFACES.items()},
    "wet": SurfaceBraking(b_b=0.15, state_of="loam"),
}
SURFACED = dataclasses.replace(MODEL, braking=dataclasses.replace(MODEL.braking, terrain=TABLES))


def opened(description):
    names = open_surfaces(CLASSES, THRESHOLDS, SURFACED.vehicle, description)
    return names, with_open_surfaces(SURFACED, names)


def test_surfaces_that_a_description_leaves_open():
    def names(hardness, grip):
        return opened(GroundDescription(hardness, grip))[0]

    assert names("hard", "gripping") == ("asphalt",)
    assert names("hard", UNDECIDED) == ("asphalt", "ice")
    assert names(UNDECIDED, "gripping") == ("asphalt", "loam", "snow")
    assert names("soft", "slippery") == ()
    assert names(UNDECIDED, UNDECIDED) == tuple(SURFACES)


@pytest.mark.parametrize("description", DESCRIPTIONS, ids=str)
@pytest.mark.parametrize("surface", ["", *SURFACES])
def test_no_description_makes_a_plan_faster_on_any_surface(description, surface):
    """Right or wrong: on ground with or without a name a plan with it is nowhere faster."""
    here = ground_map(lambda x, y: 0.0 * x, x=(-2.0, 8.0), y=(-2.0, 2.0), resolution=0.5)
    if surface:
        numbers = np.zeros(here.elevation.shape, np.int64)
        here = dataclasses.replace(here, terrain_class=numbers, class_names=(surface,))
    names, model = opened(description)
    fastest = PlannerSettings(smooth=False)  # smoothing ends within 1e-4 m/s of its optimum
    (before,) = CandidatePlanner(SURFACED, fastest).plan(here, [straight(6.0)])
    (after,) = CandidatePlanner(model, fastest).plan(here, [straight(6.0)])
    assert np.all(after.speed <= before.speed + 1e-9)
    if surface:
        assert np.array_equal(after.speed, before.speed)
    weakest = [model.braking.on(name).b_b for name in ("", *model.braking.states_of(""))]
    assert min(weakest) <= min([SURFACES[name][2] for name in names], default=0.25)
    assert ("loam" not in names) or min(weakest) <= 0.15  # its state counts as well


def test_undecided_is_never_faster_than_any_decision():
    """The weakest of what is open: the less is stated, the weaker."""

    def weakest(description):
        braking = opened(description)[1].braking
        return min(braking.on(name).b_b for name in ("", *braking.states_of("")))

    for hardness, grip in itertools.product(("hard", "soft"), ("gripping", "slippery")):
        exact = weakest(GroundDescription(hardness, grip))
        for vague in (
            GroundDescription(hardness),
            GroundDescription(grip=grip),
            GroundDescription(),
        ):
            assert weakest(vague) <= exact
