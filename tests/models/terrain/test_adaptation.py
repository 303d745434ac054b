from __future__ import annotations

import sys

import numpy as np
import pytest

from slopewise.models.errors import ParameterError
from slopewise.models.terrain.adaptation import (
    AdaptationSettings,
    AdaptiveClassifier,
    class_of,
    classes_of,
)
from slopewise.models.terrain.classes import TerrainClasses
from slopewise.models.terrain.classifier import NONE, TerrainClassifier
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.models.terrain.paper import MEANS, STDS

HUSKY = read_terrains(find_terrains("husky")).classes
EXACT = (0.0, 0.0, 0.0)
NAN = float("nan")


def draws(mean, std, count, seed=0):
    rows = np.random.default_rng(seed).normal(mean, std, (count, 3))
    return [tuple(row) for row in rows.tolist()]


def test_unseen_ground_is_none_of_these_and_then_a_class_of_its_own():
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    memory = AdaptiveClassifier(HUSKY)
    ice = draws((0.02, 0.05, 0.85), (0.005, 0.01, 0.03), 30)
    answers = [memory.observe(row, EXACT).name for row in ice]
    assert "new_1" not in answers[:6]
    assert answers[-20:].count("new_1") >= 19
    memory.rename("new_1", "ice")
    assert memory.observe(ice[0], EXACT).name == "ice"
    learned = {known.name: known for known in memory.classes.terrain}["ice"]
    assert learned.lateral_resistance.mean == pytest.approx(0.05, abs=0.01)
    # the others are as good as before
    for name, mean in MEANS.items():
        rows = draws(mean, STDS[name], 200, seed=1)
        right = np.mean([memory.observe(row, EXACT).name == name for row in rows])
        assert right > 0.9, name


def test_scattered_unknown_signatures_make_no_class():
    pytest.importorskip("sklearn", reason="the learn extra is not installed")
    memory = AdaptiveClassifier(HUSKY)
    random = np.random.default_rng(2)
    for _ in range(8):
        memory.observe(tuple(random.uniform((0.5, 0.5, 2.5), (1.0, 1.0, 8.0)).tolist()), EXACT)
    assert {known.name for known in memory.classes.terrain} == {*MEANS}
    assert memory.aside


def test_a_gross_error_is_answered_but_not_learned():
    memory = AdaptiveClassifier(HUSKY)
    before = memory.classes
    assert memory.observe((0.91, 0.26, 0.90), EXACT).name == "asphalt"
    assert memory.classes is before
    assert memory.aside == [(0.91, 0.26, 0.90)]
    assert memory.observe((0.9, 0.9, 5.0), EXACT).name == NONE


def test_a_season_is_followed():
    # dirt road changes slowly into what is nothing that the old classes know
    memory, fixed = AdaptiveClassifier(HUSKY), TerrainClassifier(HUSKY)
    random = np.random.default_rng(3)
    start, end = np.array(MEANS["dirt_road"]), np.array((0.22, 0.30, 1.05))
    adaptive, static = [], []
    for share in np.linspace(0.0, 1.0, 300):
        row = random.normal(start + share * (end - start), np.array(STDS["dirt_road"]))
        adaptive.append(memory.observe(tuple(row.tolist()), EXACT).name == "dirt_road")
        static.append(fixed.classify(tuple(row.tolist())).name == "dirt_road")
    assert np.mean(adaptive[-50:]) > np.mean(static[-50:]) + 0.3


def test_confident_answers_do_not_narrow_a_class_away():
    memory = AdaptiveClassifier(HUSKY)
    for row in draws(MEANS["asphalt"], np.array(STDS["asphalt"]) * 0.05, 300):
        memory.observe(row, EXACT)
    asphalt = memory.classes.terrain[0]
    assert [f.std for f in asphalt.features] == pytest.approx(
        [0.7 * std for std in STDS["asphalt"]]
    )


def test_labels_train_another_vehicle():
    memory = AdaptiveClassifier(TerrainClasses(name="other"))
    for i, (name, mean) in enumerate(MEANS.items()):
        for row in draws(np.array(mean) * (2.0, 2.5, 0.7), np.array(STDS[name]), 20, seed=i):
            memory.learn(name, row)
    right = [
        memory.observe(row, EXACT).name == name
        for i, (name, mean) in enumerate(MEANS.items())
        for row in draws(np.array(mean) * (2.0, 2.5, 0.7), np.array(STDS[name]), 50, seed=9 + i)
    ]
    assert np.mean(right) > 0.95


def test_running_moments_are_the_moments():
    rows = draws((0.1, 0.2, 1.1), (0.02, 0.02, 0.05), 40)
    memory = AdaptiveClassifier(TerrainClasses(name="x"), AdaptationSettings(memory=1000.0))
    for row in rows:
        memory.learn("dirt", row)
    expected = class_of("dirt", np.array(rows))
    for ours, theirs in zip(memory.classes.terrain[0].features, expected.features, strict=True):
        assert ours.mean == pytest.approx(theirs.mean, rel=1e-9)
        assert ours.std == pytest.approx(theirs.std, rel=1e-9)
        assert ours.samples == 40.0


def test_features_that_were_never_measured_are_left_out():
    rows = np.array([(0.1, NAN, NAN), (0.12, NAN, 1.0), (0.11, 0.2, NAN)])
    learned = classes_of("x", ["a", "a", "a"], rows).terrain[0]
    assert learned.motion_resistance.samples == 3.0
    assert learned.lateral_resistance is None
    assert learned.slip_track is None


def test_without_scikit_learn_it_says_what_to_install(monkeypatch):
    monkeypatch.setitem(sys.modules, "sklearn.cluster", None)
    memory = AdaptiveClassifier(TerrainClasses(name="x"))
    *rows, last = draws((0.1, 0.2, 1.1), (0.02, 0.02, 0.05), 6)
    for row in rows:
        memory.observe(row, EXACT)
    with pytest.raises(ParameterError, match=r"pip install '.\[learn\]'"):
        memory.observe(last, EXACT)


def test_renaming_what_is_not_there():
    with pytest.raises(ParameterError, match="asphalt"):
        AdaptiveClassifier(HUSKY).rename("new_7", "ice")
