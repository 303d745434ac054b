"""Terrain of public recordings: what examples/borealtc_figures.py prints, held to its figures."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.terrain.phases import Phase
from slopewise.models.terrain.vehicle_check import VehicleCheck
from slopewise.services.io.model_file import find_model, read_model
from slopewise.services.io.terrain_file import find_terrains, read_terrains
from tests.services.faults import real_data

_EXAMPLES = Path(__file__).parents[3] / "examples"


def example(name):
    spec = importlib.util.spec_from_file_location(name, _EXAMPLES / f"{name}.py")
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module


@pytest.fixture(scope="module")
def reader():
    return example("borealtc")


@pytest.fixture(scope="module")
def figures(reader):
    return example("borealtc_figures")


@pytest.fixture(scope="module")
def runs(figures):
    return figures.load(real_data("borealtc"))


def run_of(runs, name):
    return next(run for run in runs if run.name == name)


def medians_of(runs):
    columns = np.array([o.measured.values for run in runs for o in run.ground]).T
    names = ("f_r", "mu_t", "b_s")
    known = {n: c[np.isfinite(c)] for n, c in zip(names, columns, strict=True)}
    return {name: float(np.median(values)) for name, values in known.items() if len(values)}


def test_ice_and_loam_turned_on_the_spot(runs):
    ice, loam = (medians_of([run_of(runs, name)]) for name in ("ice_08", "sandy_loam_04"))
    # by hand from the means of the recording: 0.30 m/s over 0.38 rad/s, 0.30 over 0.32
    assert ice["b_s"] == pytest.approx(0.79, abs=0.03)
    assert loam["b_s"] == pytest.approx(0.93, abs=0.06)
    assert ice["mu_t"] < 0.12
    assert loam["mu_t"] > 0.5


def test_grounds_differ_as_they_should(runs):
    values = {
        name: medians_of([r for r in runs if r.terrain == name])
        for name in ("asphalt", "ice", "sandy_loam", "snow")
    }
    f_r, mu_t, b_s = ({n: v[key] for n, v in values.items()} for key in ("f_r", "mu_t", "b_s"))
    assert f_r["asphalt"] < f_r["ice"] < f_r["sandy_loam"] < f_r["snow"]
    assert min(mu_t, key=mu_t.get) == "ice"
    assert max(b_s["asphalt"], b_s["ice"]) < b_s["sandy_loam"] < b_s["snow"]


def test_digging_in_is_stuck_from_standstill_on(runs):
    run = run_of(runs, "snow_05")
    stuck = [o for o in run.observations if o.phase is Phase.STUCK]
    # the yaw rate falls to nothing between the 6th and 7th second, the wheels turn until the 42nd
    assert stuck[0].begin == pytest.approx(6.0, abs=1.5)
    assert max(o.end for o in stuck if o.begin < 42.0) == pytest.approx(42.0, abs=1.0)
    slip_tracks = np.array([o.measured.slip_track.value for o in run.ground])
    assert np.nanmax(slip_tracks) < 5.0


def test_clocks_are_brought_together(reader):
    t = np.arange(0.0, 60.0, 0.01)
    slow = np.arange(0.0, 60.0, 1 / 6.5)
    turns = 0.3 * np.sign(np.sin(slow / 3.0))
    for offset in (-1.2, 0.0, 0.9):
        yaw = np.interp(t, slow + offset, turns) + 0.02 * np.random.default_rng(1).normal(size=6000)
        assert reader.clock_offset(t, yaw, slow, turns) == pytest.approx(offset, abs=0.06)
    assert reader.clock_offset(t, 0 * t, slow, 0 * slow) == 0.0


@pytest.mark.parametrize("by_class", [False, True], ids=["runs", "class"])
def test_descriptions_of_ground_that_was_held_out(figures, runs, by_class):
    counts = figures.held_out(runs, by_class=by_class)
    for axis in ("hardness", "grip"):
        stated = sum(c[f"{axis} stated"] for c in counts.values())
        assert stated >= (0.5 if by_class else 0.6) * sum(
            c[f"{axis} windows"] for c in counts.values()
        )
        for name, count in counts.items():
            assert count[f"{axis} wrong"] <= 0.05 * count[f"{axis} stated"], (axis, name)
    # the ground that took no part agrees with one class as well: so names need days
    if by_class:
        assert sum(c["single wrong"] for c in counts.values()) > 30
    else:
        assert min(c["agrees"] / c["windows"] for c in counts.values()) > 0.8


def test_changes_of_a_description(figures, runs):
    assert np.mean(list(figures.joined(runs).values())) >= 0.45
    count, minutes = figures.false_changes(runs)
    assert 10.0 * count / minutes <= 1.5


def test_intervals_hold_for_the_other_half_of_a_run(figures, runs):
    for name, (share, count) in figures.coverage(runs).items():
        assert count > 250
        assert share > 0.9, name


def test_the_shipped_file_is_that_of_the_recording(figures, runs):
    classes, thresholds = figures.learn(runs)
    shipped = read_terrains(find_terrains("borealtc"))
    assert shipped.thresholds.soft_above == pytest.approx(thresholds.soft_above, abs=0.002)
    assert shipped.thresholds.slippery_below == pytest.approx(thresholds.slippery_below, abs=0.002)
    for known, learned in zip(shipped.terrain, classes.terrain, strict=True):
        for a, b in zip(known.features, learned.features, strict=True):
            assert (a.mean, a.std, a.samples) == pytest.approx((b.mean, b.std, b.samples), abs=2e-3)


def test_the_paper_s_husky_cannot_be_the_vehicle_of_these_logs(figures, reader, runs):
    """30 kg and 0.13 m for 70 kg and 0.165 m: three times the thrust of the weight."""

    def messages(model, observed):
        checks = {name: VehicleCheck(model.vehicle) for name in figures.TRUTH}
        for terrain, observations in observed:
            for observation in (o for o in observations if o.phase is not Phase.STUCK):
                checks[terrain].add(observation)
        return {name: check.message() for name, check in checks.items()}

    husky = read_model(find_model("husky"))
    few = [run for run in reader.runs(real_data("borealtc")) if run[0][-2:] < "05"]
    wrong = messages(husky, [(r[1], figures.observe(reader.read_run(*r), husky)) for r in few])
    assert all(wrong[name] for name in ("asphalt", "sandy_loam", "snow")), wrong
    assert not any(messages(figures.MODEL, [(r.terrain, r.observations) for r in runs]).values())
