"""Prediction of speeds under a hypothesis, with build-up and fade of the brakes.

Sliding wheels, compared with a block on a plane that scipy integrates in two dimensions.
"""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.arrays import Floats
from slopewise.models.discrepancy.data.stop_ground import ground_of
from slopewise.models.discrepancy.data.stop_ground import ground_of as place_of
from slopewise.models.discrepancy.data.stop_table import StopTable
from slopewise.models.discrepancy.model.brakes import brought_force
from slopewise.models.discrepancy.model.hypothesis import Hypothesis
from slopewise.models.discrepancy.model.prediction import predict, simulate, wanted_force
from slopewise.models.discrepancy.search.candidates import candidates
from slopewise.models.discrepancy.search.refine import fit_base, fit_either_way, fit_other_forms
from slopewise.models.parameters import Effect
from slopewise.models.quantity import GRAVITY
from slopewise.models.quantity import GRAVITY as G
from slopewise.models.stops.simulation import GroundTrack, simulate_stop
from tests.world.formulas import SAMPLES
from tests.world.logs import table
from tests.world.vehicles import BASE

LIKE_THE_SIMULATION = [
    name
    for name in SAMPLES
    if name
    not in ("turning_resistance", "crest_unloading", "brake_fade", "surface_patch", "step_change")
]
"""Effects that have all they depend on in the table of stops."""


def _track(stops, i: int) -> GroundTrack:
    curvature = stops.yaw_rate[i] / np.maximum(stops.speed[i], 0.3)
    return GroundTrack(
        stops.station[i],
        stops.grade[i],
        stops.roll[i],
        stops.yaw[i],
        curvature,
        stops.x[i],
        stops.y[i],
    )


@pytest.mark.parametrize("name", LIKE_THE_SIMULATION)
def test_a_stop_is_that_of_the_simulation(name: str) -> None:
    stops = table("clean").take([0, 5, 11])
    effect = Effect(name=name, parameters=SAMPLES[name])
    time = np.linspace(0.0, 1.0, 401) * (1.3 * stops.standstill_time)[:, None]
    speed, way = simulate(stops, Hypothesis.configured(BASE).plus(effect), stops.held, time)
    for i in range(len(stops)):
        reference = simulate_stop(
            replace(BASE, effect=(effect,)),
            _track(stops, i),
            float(stops.held[i]),
            session_time=float(stops.clock[i]),
        )
        assert np.max(np.abs(speed[i] - reference.speed_at(time[i]))) < 0.004
        assert way[i, -1] == pytest.approx(reference.distance, abs=0.004)


def test_a_stop_over_a_crest_is_that_of_the_simulation() -> None:
    stops = table("crests").take([0, 5, 11, 20])
    effect = Effect(name="crest_unloading", parameters={"k": 2.0})
    hypothesis = Hypothesis.configured(BASE).plus(effect)
    time = np.linspace(0.0, 1.0, 401) * (1.3 * stops.standstill_time)[:, None]
    speed, way = simulate(stops, hypothesis, stops.held, time)
    plain, _ = simulate(stops, Hypothesis.configured(BASE), stops.held, time)
    assert np.max(speed - plain) > 0.05
    for i in range(len(stops)):
        track = replace(_track(stops, i), grade_change=stops.vertical_curvature[i])
        reference = simulate_stop(replace(BASE, effect=(effect,)), track, float(stops.held[i]))
        assert np.max(np.abs(speed[i] - reference.speed_at(time[i]))) < 0.004
        assert way[i, -1] == pytest.approx(reference.distance, abs=0.004)


def test_a_step_change_holds_from_its_run_on() -> None:
    stops = table("clean")
    effect = Effect(name="step_change", parameters={"scale": 0.8, "run": 20.0})
    base = Hypothesis.configured(BASE)
    error = predict(stops, base.plus(effect))[:, -1] - predict(stops, base)[:, -1]
    assert np.all(error[stops.run < 20] == 0.0)
    assert np.all(error[stops.run >= 20] < 0.0)


BASIS = Hypothesis.configured(BASE)
LAG = Effect(name="brake_lag", parameters={"tau": 0.15})
CAP = Effect(name="wheel_lockup", parameters={"mu": 0.42})
FADE = Effect(name="brake_fade", parameters={"k": 0.03, "tau": 60.0})


def test_brakes_that_fade_within_a_stop_heat_less_from_then_on() -> None:
    stops = replace(table("clean"), warmed=((),) * len(table("clean")))
    hypothesis = BASIS.plus(FADE)
    demanded = wanted_force(stops, hypothesis, place_of(stops))
    k, tau = FADE.parameters["k"], FADE.parameters["tau"]
    onset = hypothesis.dead_time
    given = []
    for i in range(len(stops)):

        def slope(t: float, q: np.ndarray, i: int = i) -> float:
            force = np.interp(t, stops.time[i], demanded[i]) / (1.0 + k * q[0])
            return GRAVITY * force * np.interp(t, stops.time[i], stops.speed[i]) - q[0] / tau

        after = stops.time[i] > onset
        q = solve_ivp(
            slope, (onset, stops.time[i, -1]), [0.0], t_eval=stops.time[i, after], max_step=0.01
        ).y[0]
        given.append(demanded[i, after] / (1.0 + k * q))
    # The mean force is the stop's own, here that of the integrator.
    stops = replace(stops, force=np.array([float(np.mean(g)) for g in given]))
    met = place_of(stops)
    delivered = brought_force(stops, hypothesis, demanded, stops.speed, met, stops.time).given
    for i, true in enumerate(given):
        lost = 1.0 - true[-1] / demanded[i, -1]
        assert lost > 0.005
        error = np.abs(delivered[i, stops.time[i] > onset] - true)
        assert np.max(error) < 0.03 * lost * demanded[i].max()


@pytest.mark.parametrize("brakes", [[], [LAG], [CAP], [FADE], [LAG, CAP]])
@pytest.mark.parametrize(
    ("name", "strength"),
    [("directional_surface", 1e-4), ("cross_slope", 1e-3), ("session_drift", 1e-8)],
)
def test_what_the_ground_adds_passes_through_the_brakes(
    brakes: list[Effect], name: str, strength: float
) -> None:
    stops, hypothesis = table("clean"), BASIS
    for effect in brakes:
        hypothesis = hypothesis.plus(effect)
    library, columns = candidates(stops, hypothesis)
    i = next(i for i, c in enumerate(library) if c.name == name)
    more = predict(stops, hypothesis.plus(library[i].effect(strength))) - predict(stops, hypothesis)
    size = float(np.max(np.abs(more)))
    assert size > 0.0
    # Beyond first order: where a cap begins, and how the heat shifts within a stop.
    assert np.max(np.abs(columns[:, :, i] * strength - more)) < 0.05 * size
    if brakes == [CAP]:  # stops that slide from start to end do not see the ground
        assert np.sum(np.max(np.abs(more), axis=1) < 1e-9) > 3


MU = 0.25


def tilted(grade: float, roll: float) -> StopTable:
    """Stops of a log, on a plane that leans."""
    stops = table("clean").take([0, 5, 11, 20])
    even = np.ones_like(stops.grade)
    return replace(stops, grade=grade * even, roll=roll * even)


def block(v: float, grade: float, roll: float, time: Floats) -> Floats:
    """Speed along the path of a block that slides from the onset on."""
    grip = G * MU * math.cos(grade) * math.cos(roll)
    onset = BASE.braking.dead_time

    def rates(_: float, state: Floats) -> list[float]:
        along, across = state
        share = grip / max(math.hypot(along, across), 1e-9)
        return [-G * math.sin(grade) - share * along, G * math.sin(roll) - share * across]

    end = max(float(time[-1]) - onset, 1e-3)
    solution = solve_ivp(rates, (0.0, end), [v, 0.0], dense_output=True, rtol=1e-8, max_step=0.02)
    after = np.clip(time - onset, 0.0, end)
    return np.where(time < onset, v, solution.sol(after)[0])


@pytest.mark.parametrize("form", ["everywhere", "in one place"])
@pytest.mark.parametrize(("grade", "roll"), [(-0.08, 0.07), (-0.05, -0.09)])
def test_locked_wheels_drift_as_a_block_does(form: str, grade: float, roll: float) -> None:
    stops = tilted(grade, roll)
    hypothesis = Hypothesis.configured(BASE)
    if form == "everywhere":
        hypothesis = hypothesis.plus(Effect(name="wheel_lockup", parameters={"mu": MU}))
    else:
        level = BASE.braking.level_force(float(stops.held[0]))
        place = {"delta": MU - level, "x": 0.0, "y": 0.0, "radius": 1e6}
        hypothesis = replace(
            hypothesis.plus(Effect(name="surface_patch", parameters=place)), slips=True
        )
        stops = stops.take([0])
    time = np.linspace(0.0, 1.0, 401) * (2.0 * stops.standstill_time)[:, None]
    drifting, _ = simulate(stops, replace(hypothesis, drifts=True), stops.held, time)
    straight, _ = simulate(stops, hypothesis, stops.held, time)
    for i, held in enumerate(stops.held.tolist()):
        true = block(held, grade, roll, time[i])
        fast = true > 0.1 * held
        error = np.abs(drifting[i] - true)[fast].max()
        unaware = np.abs(straight[i] - true)[fast].max()
        assert error < 0.2 * unaware
        assert unaware > 0.005


def test_brakes_below_the_friction_of_a_place_feel_nothing_of_it() -> None:
    stops = table("clean")
    hypothesis = Hypothesis.configured(BASE)
    place = {"delta": 0.0, "x": 0.0, "y": 0.0, "radius": 1e6}
    patch = Effect(name="surface_patch", parameters=place)
    there = wanted_force(stops, replace(hypothesis.plus(patch), slips=True), ground_of(stops))
    elsewhere = wanted_force(stops, hypothesis, ground_of(stops))
    upright = np.cos(stops.grade) * np.cos(stops.roll)
    level = BASE.braking.m_b * stops.held[:, None] + BASE.braking.b_b
    np.testing.assert_allclose(there, np.minimum(elsewhere, level * upright), atol=1e-12)
    assert 0.1 < np.mean(there < elsewhere) < 0.9


@pytest.mark.parametrize("drifts", [True, False])
def test_likelihood_shows_whether_sliding_wheels_drift(*, drifts: bool) -> None:
    stops = table("clean")
    rng = np.random.default_rng(1)
    stops = replace(stops, roll=stops.roll + 0.12 * rng.uniform(-1.0, 1.0, (len(stops), 1)))
    lock = Effect(name="wheel_lockup", parameters={"mu": MU})
    true = replace(Hypothesis.configured(BASE).plus(lock), drifts=drifts)
    speed, _ = simulate(stops, true, stops.held, stops.time)
    noise = fit_base(stops, Hypothesis.configured(BASE)).noise
    averaged = np.einsum("skm,sm->sk", stops.average, speed)
    measured = replace(stops, speed=speed, binned=averaged)
    wrong = fit_either_way(measured, replace(true, drifts=not drifts), noise)
    solution = fit_other_forms(measured, wrong)
    assert solution.hypothesis.drifts is drifts
    assert solution.hypothesis.added[0].parameters["mu"] == pytest.approx(MU, abs=0.01)
