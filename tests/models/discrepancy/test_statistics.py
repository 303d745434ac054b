"""Statistics of the search: noise, whitening, permutations, thresholds and progress."""

from __future__ import annotations

import ast
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from slopewise.models import discrepancy
from slopewise.models.discrepancy import thresholds
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.hypothesis import BASE as BASE_NUMBERS
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.noise import Noise, shapes, whitener
from slopewise.models.discrepancy.model.prediction import predict
from slopewise.models.discrepancy.progress import Progress, Stage
from slopewise.models.discrepancy.search.locate import follow, part_of_axis
from slopewise.models.discrepancy.search.refine import fit_with_noise
from slopewise.models.discrepancy.thresholds import Basis
from slopewise.models.parameters import Effect
from tests.world.logs import investigated, table
from tests.world.vehicles import BASE

BASIS = Hypothesis.configured(BASE)
NOISE = Noise(0.03, 0.0, 0.05, 0.004, 0.02)


def sampled(hypothesis: Hypothesis, noise: Noise, seed: int) -> StopTable:
    """The stops of a log with speeds drawn from a hypothesis and a noise."""
    stops = table("clean")
    rng = np.random.default_rng(seed)
    z = shapes(stops, hypothesis)
    stds = np.array([0.0, noise.creep, noise.dead_time_std, noise.scatter])
    effects = rng.standard_normal((len(stops), 4)) * stds
    white = noise.speed * np.sqrt(stops.spread) * rng.standard_normal(stops.binned.shape)
    fall = np.einsum("skm,sm->sk", stops.average, predict(stops, hypothesis))
    level = stops.held[:, None] * (stops.spread > 0.0)
    return replace(stops, binned=level - fall + np.einsum("skp,sp->sk", z, effects) + white)


def test_whitened_residuals_are_independent_with_variance_one() -> None:
    stops = table("clean")
    white = whitener(stops, NOISE, BASIS)
    rows = []
    for seed in range(30):
        stds = sampled(BASIS, NOISE, seed)
        fall = np.einsum("skm,sm->sk", stops.average, predict(stops, BASIS))
        left = np.where(stops.spread > 0.0, stds.binned - stops.held[:, None] + fall, 0.0)
        between, within = white.split(white.bins @ left[:, :, None])
        rows.append(between[:, 0] / np.sqrt(1.0 + NOISE.scatter**2 * white.power))
        used = (stops.spread > 0.0).sum(axis=1)
        # The level is free, so one number per stop carries no information; friction is separate.
        assert np.mean(within**2) * within[:, :, 0].size / (used.sum() - 2 * len(used)) < 1.2
    assert np.var(rows) == pytest.approx(1.0, abs=0.1)


def test_the_noise_is_estimated() -> None:
    noise = fit_with_noise(sampled(BASIS, NOISE, 5), BASIS).noise
    assert noise.speed == pytest.approx(NOISE.speed, rel=0.1)
    assert noise.scatter == pytest.approx(NOISE.scatter, rel=0.35)


def test_intervals_of_a_lag_cover() -> None:
    truth = BASIS.plus(Effect(name="brake_lag", parameters={"tau": 0.15}))
    inside = 0
    for seed in range(20):
        noise = fit_with_noise(sampled(truth, NOISE, 100 + seed), truth)
        error = noise.hypothesis.free[BASE_NUMBERS] - 0.15
        inside += bool(abs(error) < 1.96 * np.sqrt(noise.covariance[BASE_NUMBERS, BASE_NUMBERS]))
    assert inside >= 16  # 95 % of 20 is 19; fewer than 16 has a chance of 1 in 300


def test_a_permuted_axis_is_followed_only_where_it_matters() -> None:
    clean = follow(table("clean"), fit_with_noise(table("clean"), BASIS), 1)
    assert clean[0].p_value > 0.02
    pattern = follow(table("cross"), fit_with_noise(table("cross"), BASIS), 1)
    assert pattern[0].axis.name == "roll"
    assert pattern[0].p_value < 1e-3
    low, high = part_of_axis(pattern[0])
    assert low < high


PACKAGE = Path(discrepancy.__file__).parent
MODULES = sorted(p for p in PACKAGE.rglob("*.py") if p.name not in ("thresholds.py", "settings.py"))


def test_every_threshold_has_its_fields():
    rows = thresholds.table()
    assert len(rows) > 50
    assert len({row.name for row in rows}) == len(rows)
    for row in rows:
        assert isinstance(row.basis, Basis), row.name
        assert row.unit, row.name
        assert len(row.moves) > 10, row.name


def test_every_constant_of_the_table_is_a_row():
    constants = {name for name in vars(thresholds) if name.isupper() and not name.startswith("_")}
    assert constants == {row.name for row in thresholds.table()}


def test_every_threshold_is_read():
    read = {
        alias.name
        for path in MODULES
        for node in ast.walk(ast.parse(path.read_text()))
        if isinstance(node, ast.ImportFrom) and node.module == thresholds.__name__
        for alias in node.names
    }
    assert {row.name for row in thresholds.table()} == read


def test_each_hundredth_is_reported_once() -> None:
    reported = investigated("clean")[2]
    assert min(reported) > 0
    assert sum(reported) == Stage.FINDINGS == 100


def test_progress_of_the_search_only_grows() -> None:
    reported: list[int] = []
    progress = Progress(reported.append)
    for share in (0.3, 0.6, 0.5, 1.0):
        progress.search(share)
    assert sum(reported) == Stage.SEARCH
    progress.reach(Stage.BASE)
    assert sum(reported) == Stage.SEARCH
