"""Uncertainty makes plans slower, by as much as the quantile asks for, and never faster."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import norm

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Effect, Model
from slopewise.planner.ground.uncertainty import HOUR, Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.world import generated
from tests.world.formulas import SAMPLES, G
from tests.world.generated import between
from tests.world.ground import ground_map, plane, straight
from tests.world.stages import braking_ground_of
from tests.world.vehicles import Tables, model_of, tables_with

COVARIANCE = (
    (4e-5, 1e-5, 0.0, 0.0),
    (1e-5, 9e-4, 0.0, 2e-5),
    (0.0, 0.0, 2.5e-5, -4e-5),
    (0.0, 2e-5, -4e-5, 1.6e-4),
)
"""Of m_m, b_m, m_b, b_b: speed and level force are learned against each other."""

EAGER = {"accel": 3.0, "decel": 5.0, "min_load": 0.02}
"""Limits that leave it to the stopping path how fast a plan is."""

ROUGH = PlannerSettings(smooth=False)


def uncertain(**braking: Any) -> Model:
    """The quad with a covariance."""
    return model_of(tables_with(braking={"covariance": COVARIANCE, **braking}, limits=EAGER))


def waves() -> ElevationMap:
    return ground_map(lambda x, y: 0.35 * np.sin(x / 3.0) + 0.02 * y)


def plan_with(
    model: Model,
    uncertainty: Uncertainty | None,
    ground: ElevationMap | None = None,
    **options: Any,
) -> SpeedPlan:
    planner = CandidatePlanner(model, ROUGH, uncertainty)
    (plan,) = planner.plan(ground or waves(), [straight(20.0)], **{"clear": 7.0, **options})
    return plan


def forces(model: Model, uncertainty: Uncertainty | None, ground: ElevationMap) -> Any:
    cautious = model if uncertainty is None else uncertainty.cautious(model)
    return braking_ground_of(cautious, ground, uncertainty=uncertainty)


UNCERTAINTIES = st.fixed_dictionaries(
    {
        "quantile": between(0.5, 0.9999),
        "slope_std": between(0.0, 0.02),
        "age": between(0.0, 48.0 * HOUR),
        "drift": between(0.0, 0.02),
    }
)


@settings(max_examples=25)
@given(generated.tables(), generated.heights(), UNCERTAINTIES, between(3.0, 12.0), st.data())
def test_no_uncertainty_makes_a_plan_faster(
    tables: Tables, height: Any, sizes: dict[str, float], clear: float, data: st.DataObject
) -> None:
    scatter = {
        "force_std": data.draw(between(0.0, 0.03)),
        "dead_time_std": data.draw(between(0.0, 0.05)),
    }
    tables["braking"] |= {"covariance": COVARIANCE}
    ground = ground_map(height, x=(-4.0, 18.0))
    model, scattered = model_of(tables), model_of(tables | {"braking": tables["braking"] | scatter})
    less = {
        name: value * data.draw(st.sampled_from([0.0, 0.5, 1.0])) for name, value in sizes.items()
    }
    less["quantile"] = max(less["quantile"], 0.5)
    plans = [
        plan_with(m, u, ground, clear=clear)
        for m, u in ((model, None), (model, Uncertainty(**less)), (scattered, Uncertainty(**sizes)))
    ]
    for plan, uncertain_model in pairwise(plans):
        if Status.INFEASIBLE in (plan.status, uncertain_model.status):
            continue
        if uncertain_model.status is Status.DEGRADED or plan.status is Status.DEGRADED:
            assert uncertain_model.progress <= plan.progress + 1e-6
            continue
        # Speeds rather than v²: between stations v² is lowered by its second difference.
        assert np.all(uncertain_model.speed <= plan.speed + 0.02), np.max(
            uncertain_model.speed - plan.speed
        )
        assert uncertain_model.progress <= plan.progress + 1e-6


def margins(model: Model, uncertainty: Uncertainty, v: float) -> tuple[Any, Any, Any]:
    """Grade, and what is given up and added at an onset speed."""
    profile, exact = forces(model, None, waves())
    _, wide = forces(model, uncertainty, waves())
    weak = (exact.lower_slope - wide.lower_slope) * v + exact.lower_intercept - wide.lower_intercept
    strong = (
        (wide.upper_slope - exact.upper_slope) * v + wide.upper_intercept - exact.upper_intercept
    )
    return profile.grade[:, 0], weak[:, 0], strong[:, 0]


def expected(grade: np.ndarray, v: float, z: float) -> np.ndarray:
    """z √(φᵀ S φ), term by term."""
    phi = np.stack([grade * v, grade, np.full_like(grade, v), np.ones_like(grade)])
    return z * np.sqrt(np.einsum("ik,ij,jk->k", phi, np.array(COVARIANCE), phi))


@pytest.mark.parametrize("quantile", [0.9, 0.999])
def test_the_margin_is_the_quantile_at_the_ends_and_never_less_between(quantile: float) -> None:
    model, z = uncertain(), norm.ppf(quantile)
    for v in (1.0, 4.0):
        grade, weak, strong = margins(model, Uncertainty(quantile=quantile), v)
        assert weak == pytest.approx(expected(grade, v, z), abs=1e-12)
        assert strong == pytest.approx(weak, abs=1e-12)
    for v in (1.5, 2.0, 3.0, 3.9):
        grade, weak, _ = margins(model, Uncertainty(quantile=quantile), v)
        assert np.all(weak >= expected(grade, v, z) - 1e-12)
        assert np.all(weak <= 2.0 * expected(grade, v, z) + 1e-12)


def test_beyond_the_hull_of_driven_speeds_the_margin_is_that_of_all_trained_ones() -> None:
    hull = ((-0.06, 1.2), (0.0, 4.0), (0.06, 1.2))
    plain, held = (
        uncertain(grade_range=(-0.06, 0.06), **h) for h in ({}, {"speed_by_grade": hull})
    )
    for v in (1.0, 2.5):
        grade, weak, strong = margins(held, Uncertainty(), v)
        undriven = np.abs(grade) > 0.08
        assert undriven.any()
        for got, full in zip((weak, strong), margins(plain, Uncertainty(), v)[1:], strict=True):
            assert got[undriven] == pytest.approx(full[undriven], abs=1e-12)


def test_scatter_age_and_covariance_add_as_variances() -> None:
    model = uncertain(force_std=0.02)
    uncertainty = Uncertainty(age=9.0 * HOUR, drift=0.01)
    grade, weak, _ = margins(model, uncertainty, 1.0)
    z = norm.ppf(0.999)
    combined = np.sqrt(expected(grade, 1.0, z) ** 2 + (z * 0.02) ** 2 + (z * 0.01 * 3.0) ** 2)
    assert weak == pytest.approx(combined, abs=1e-12)


def test_an_error_of_the_slope_counts_as_force_and_as_weight() -> None:
    model = uncertain(covariance=None)
    _, weak, _ = margins(model, Uncertainty(slope_std=0.01), 4.0)
    z = norm.ppf(0.999)
    braking = model.braking
    wrong = z * 0.01 * abs(1.0 + braking.b_m + braking.m_m * 4.0)
    assert weak == pytest.approx(np.full_like(weak, wrong), abs=1e-12)
    uphill = uncertain(covariance=None, uphill={"m_m": 0.0, "b_m": 0.8})
    _, weak, _ = margins(uphill, Uncertainty(slope_std=0.01), 4.0)
    assert np.all(weak >= z * 0.01 * 1.8)


def test_loads_keep_more_than_any_slope_error_can_take() -> None:
    model = uncertain(covariance=None)
    uncertainty = Uncertainty(slope_std=0.01)
    required = uncertainty.cautious(model).limits.min_load
    assert required == model.limits.min_load + uncertainty.load_margin(model)
    v, error = model.vehicle, norm.ppf(0.999) * 0.01
    slopes = np.linspace(-0.6, 0.6, 500)
    for lever in (v.cg_x, v.wheelbase - v.cg_x, 0.5 * v.track_width):
        for sign in (-1.0, 1.0):
            share = np.cos(slopes) + sign * v.cg_z / lever * np.sin(slopes)
            tilted = np.cos(slopes + error) + sign * v.cg_z / lever * np.sin(slopes + error)
            assert np.all(np.abs(tilted - share) <= uncertainty.load_margin(model))


def test_the_dead_time_is_that_of_the_quantile() -> None:
    _, ground = forces(uncertain(dead_time_std=0.05), Uncertainty(quantile=0.99), plane())
    assert ground.dead_time == pytest.approx(0.30 + 0.05 * norm.ppf(0.99))


def stops(
    plan: SpeedPlan, k: int, m: np.ndarray, dead_time: np.ndarray, slope_error: np.ndarray
) -> np.ndarray:
    """Where stops from station k end, one for each row of coefficients: Euler with a fine step."""
    v_0 = float(plan.speed[k])
    onset = np.maximum(v_0, 1.0)
    s = plan.station[k] + v_0 * dead_time
    energy = np.full(len(m), 0.5 * v_0**2)
    ds = 0.004
    while np.any(energy > 0.0) and s.max() < plan.station[-1]:
        grade = np.interp(s + 0.5 * ds, plan.station, plan.grade) + slope_error
        force = (m[:, 0] * onset + m[:, 1]) * grade + m[:, 2] * onset + m[:, 3]
        needed = G * (force + np.sin(grade))
        way = np.minimum(ds, np.where(needed > 0.0, energy / np.maximum(needed, 1e-9), ds))
        s = s + np.where(energy > 0.0, way, 0.0)
        energy = np.where(energy > 0.0, energy - needed * way, 0.0)
        energy = np.where(energy < 1e-9, 0.0, energy)
    return s


@pytest.mark.parametrize("quantile", [0.9, 0.999])
def test_sampled_vehicles_stop_in_time_as_often_as_was_asked(quantile: float) -> None:
    model = uncertain(force_std=0.01, dead_time_std=0.02, distance_offset=0.0)
    uncertainty = Uncertainty(quantile=quantile, slope_std=0.004, age=2.0 * HOUR)
    plan = plan_with(model, uncertainty)
    rng = np.random.default_rng(7)
    samples = 4000
    b = model.braking
    mean = [b.m_m, b.b_m, b.m_b, b.b_b]
    samples_of_force = rng.multivariate_normal(mean, COVARIANCE, samples)
    samples_of_force[:, 3] += rng.normal(0.0, np.hypot(0.01, 0.01 * np.sqrt(2.0)), samples)
    dead = np.maximum(rng.normal(b.dead_time, 0.02, samples), 0.0)
    tilt = rng.normal(0.0, 0.004, samples)
    tight = plan.clear_distance - plan.station - plan.stop_distance
    moving = np.flatnonzero(plan.speed > 1.0)
    for k in moving[np.argsort(tight[moving])[:4]]:
        assert tight[k] < 0.2
        late = stops(plan, int(k), samples_of_force, dead, tilt) > plan.clear_distance
        assert late.mean() <= 1.0 - quantile


def striped(names: tuple[str, ...]) -> ElevationMap:
    return plane(classes=lambda x, y: (x > 3.0) & (x < 12.0), class_names=names)


def test_ground_that_was_never_braked_on_gets_the_prior() -> None:
    model = uncertain(covariance=None, terrain={"gravel": {"b_b": 0.3}})
    known, strange = striped(("", "gravel")), striped(("", "moss"))
    _, on_gravel = forces(model, Uncertainty(quantile=0.5), known)
    _, on_moss = forces(model, Uncertainty(quantile=0.5), strange)
    middle = 20
    assert on_gravel.lower_intercept[middle, 0] == pytest.approx(0.3)
    assert on_moss.lower_intercept[middle, 0] == pytest.approx(0.6 * 0.3)
    assert on_moss.upper_intercept[middle, 0] == pytest.approx(0.4)
    assert on_moss.lower_intercept[4, 0] == pytest.approx(0.4)
    gravel, moss = (plan_with(model, Uncertainty(), ground) for ground in (known, strange))
    assert moss.speed[middle] < gravel.speed[middle] - 0.1


@pytest.mark.parametrize(
    "name", [n for n in SAMPLES if n not in ("turning_resistance", "session_drift")]
)
def test_an_uncertain_effect_makes_no_plan_faster(name: str) -> None:
    parameters = SAMPLES[name]
    exact = model_of(tables_with((name, parameters), limits=EAGER))
    spread = np.diag([(0.2 * abs(p) + 1e-3) ** 2 for p in parameters.values()])
    vague = Effect(name=name, parameters=parameters, covariance=tuple(map(tuple, spread)))
    mean, margin = (
        plan_with(model, Uncertainty()) for model in (exact, replace(exact, effect=(vague,)))
    )
    assert np.all(margin.speed <= mean.speed + 1e-3)
    assert margin.travel_time > mean.travel_time or margin.progress == 0.0


def uncertain_effect(name: str, key: str, value: float, std: float, **tables: Any) -> Model:
    """The quad with one effect that is not known exactly."""
    effect = Effect(name=name, parameters={key: value}, covariance=((std**2,),))
    return replace(model_of(tables_with(**tables)), effect=(effect,))


def test_uncertain_friction_is_low_for_the_stop_and_high_for_the_rear_axle() -> None:
    model, z = uncertain_effect("wheel_lockup", "mu", 0.35, 0.01), norm.ppf(0.999)
    _, ground = forces(model, Uncertainty(), plane())
    assert ground.lower_intercept == pytest.approx(0.35 - z * 0.01)
    assert ground.upper_intercept == pytest.approx(0.35 + z * 0.01)
    assert not ground.lower_slope.any()
    assert not ground.upper_slope.any()
    _, exact = forces(model, None, plane())
    assert exact.lower_intercept == pytest.approx(0.35)
    assert exact.upper_intercept == pytest.approx(0.35)


@pytest.mark.parametrize(
    ("name", "key", "at_top"),
    [("aerodynamic_drag", "c", 16.0 / G), ("viscous_resistance", "c", 4.0)],
)
def test_uncertain_drag_counts_for_the_rear_axle_with_its_upper_end(
    name: str, key: str, at_top: float
) -> None:
    model, z = uncertain_effect(name, key, 0.02, 0.004, limits={"speed": 4.0}), norm.ppf(0.999)
    _, ground = forces(model, Uncertainty(), plane())
    _, exact = forces(model, None, plane())
    assert [v for v in ground.motion.values if v] == [pytest.approx(0.02 - z * 0.004)]
    assert ground.lower_intercept == pytest.approx(exact.lower_intercept)
    # What the motion now lacks to the upper end, at the highest speed that is planned.
    assert ground.upper_intercept - exact.upper_intercept == pytest.approx(2.0 * z * 0.004 * at_top)
