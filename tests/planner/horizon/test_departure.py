"""A vehicle off its line: it strikes nothing until it is back on it; late poses cost distance."""

from __future__ import annotations

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import CycleAnswer, HorizonSettings, PlanarState
from slopewise.planner.horizon.choice import SAFE
from slopewise.planner.horizon.horizon import Horizon
from slopewise.planner.horizon.path_projection import departure_of
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.world.ground import arc, plane, straight
from tests.world.vehicles import ATV, G, model_of

MODEL = replace(model_of(ATV), tracking=Tracking(lookahead=2.0))
SHAPE = MODEL.vehicle.shape
STEP = 0.02
"""Of the simulated way [m]."""

EDGE = 0.1  # of the cells [m]
MEAN = Uncertainty(quantile=0.5)


def answer(
    state: PlanarState, ground: ElevationMap, curvature: float = 0.0, clear: float = np.inf
) -> CycleAnswer:
    path = arc(14.0, curvature, name="line") if curvature else straight(14.0, name="line")
    horizon = Horizon(MODEL, HorizonSettings(budget=60.0), PlannerSettings(), MEAN)
    return horizon.step(state, [path], ground, clear=clear)


def line_at(s: float, curvature: float) -> tuple[float, float]:
    if curvature == 0.0:
        return s, 0.0
    return np.sin(curvature * s) / curvature, (1.0 - np.cos(curvature * s)) / curvature


def pursued(
    x: float,
    y: float,
    heading: float,
    lookahead: float,
    late: float,
    curvature: float,
    held: float = 0.0,
) -> tuple[np.ndarray, np.ndarray]:
    """Poses (n, 3) of a pure-pursuit tracker, and the stations of their feet: no linear law.

    It begins late [m], and holds a curvature till then [1/m].
    """
    along = np.arange(0.0, 14.0, 0.01)
    line = np.array([line_at(s, curvature) for s in along])
    poses, feet = [], []
    for n in range(int(10.0 / STEP)):
        away = np.hypot(*(line - (x, y)).T)
        foot = int(np.argmin(away))
        poses.append((x, y, heading))
        feet.append(along[foot])
        turn = held
        if n * STEP >= late:
            ahead = foot + int(np.argmax(away[foot:] >= lookahead))
            dx, dy = line[ahead] - (x, y)
            lateral = dy * np.cos(heading) - dx * np.sin(heading)
            turn = 2.0 * lateral / (dx * dx + dy * dy)
        heading += 0.5 * STEP * turn
        x, y = x + STEP * np.cos(heading), y + STEP * np.sin(heading)
        heading += 0.5 * STEP * turn
    return np.array(poses), np.array(feet)


def struck(poses: np.ndarray, at: tuple[float, float], half: float) -> np.ndarray:
    """Poses whose body covers a corner or the middle of a square, or the other way round."""
    ends = [(i * half, j * half) for i in (-1.0, 0.0, 1.0) for j in (-1.0, 0.0, 1.0)]
    x, y, heading = poses.T
    hit = np.zeros(len(poses), bool)
    for east, north in ends:
        dx, dy = at[0] + east - x, at[1] + north - y
        ahead = dx * np.cos(heading) + dy * np.sin(heading)
        left = dy * np.cos(heading) - dx * np.sin(heading)
        hit |= (ahead < SHAPE.front) & (ahead > -SHAPE.rear) & (np.abs(left) < 0.5 * SHAPE.width)
    return hit


def with_block(at: tuple[float, float], half: float) -> ElevationMap:
    flat = plane(x=(-4.0, 18.0), y=(-9.0, 9.0), resolution=EDGE)
    x = flat.origin[0] + EDGE * np.arange(flat.elevation.shape[1])
    y = flat.origin[1] + EDGE * np.arange(flat.elevation.shape[0])[:, None]
    inside = (np.abs(x - at[0]) <= half + 1e-9) & (np.abs(y - at[1]) <= half + 1e-9)
    return replace(flat, elevation=np.where(inside, 1.0, 0.0))


@pytest.mark.parametrize("draws", [25, pytest.param(300, marks=pytest.mark.nightly)])
def test_until_it_is_on_its_line_a_vehicle_strikes_nothing(draws: int) -> None:
    """Blocks that only a vehicle off the line strikes are seen; those far off are not."""
    rng, hidden, false, free = np.random.default_rng(8), 0, 0, 0
    for _ in range(draws):
        curvature = float(rng.choice([0.0, -0.1, 0.06]))
        offset, turned = rng.uniform(-0.45, 0.45), rng.uniform(-0.25, 0.25)
        state = PlanarState(x=0.0, y=offset, heading=turned, speed=rng.uniform(0.0, 1.0))
        state = replace(state, age=float(rng.choice([0.0, 0.3])))
        s, lateral = rng.uniform(1.5, 6.0), rng.uniform(0.5, 1.7) * rng.choice([-1.0, 1.0])
        x, y = line_at(s, curvature)
        at = x - lateral * np.sin(curvature * s), y + lateral * np.cos(curvature * s)
        ground = with_block((round(at[0], 1), round(at[1], 1)), EDGE)
        at = round(at[0], 1), round(at[1], 1)
        here, on_line = (
            answer(pose, ground, curvature)
            for pose in (state, PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0))
        )
        clear = 0.0 if here.chosen is None else here.chosen.clear_distance
        near = False
        for lookahead in (2.0, rng.uniform(2.0, 4.0), 4.0):
            late = state.age * state.speed * rng.uniform(0.0, 1.0)
            poses, feet = pursued(0.0, offset, turned, lookahead, late, curvature)
            hit = struck(poses, at, 0.5 * EDGE) & (feet > 0.0)
            if hit.any():
                assert clear <= feet[np.argmax(hit)] + 0.05, (offset, turned, at, here.reason)
                hidden += on_line.status is Status.OK
            near |= bool(struck(poses, at, 0.5 * EDGE + 0.3).any())
        if not near:
            free += 1
            false += here.status is not Status.OK and on_line.status is Status.OK
    assert hidden > 0.06 * draws  # 21 of 300
    assert free > 0.2 * draws
    assert false <= 0.15 * free, (false, free)


def test_on_the_course_of_an_earlier_command_it_strikes_nothing() -> None:
    """A vehicle that turns until the command for another line takes effect."""
    rng, hidden = np.random.default_rng(4), 0
    for _ in range(14):
        held, age = rng.uniform(0.08, 0.15) * rng.choice([-1.0, 1.0]), rng.uniform(0.4, 0.6)
        state = PlanarState(x=0.0, y=0.0, heading=0.0, speed=rng.uniform(2.0, 3.0), age=age)
        late = age * state.speed
        side = np.sign(held) * (0.5 * SHAPE.width + rng.uniform(0.05, 0.4))
        at = round(rng.uniform(3.0, 5.0), 1), round(side, 1)
        clear = []
        for first in (held, 0.0):
            horizon = Horizon(MODEL, HorizonSettings(budget=60.0), PlannerSettings(), MEAN)
            before = arc(14.0, first, name="before") if first else straight(14.0, name="before")
            horizon.step(state, [before], plane(x=(-4.0, 18.0), y=(-9.0, 9.0), resolution=EDGE))
            new = horizon.step(state, [straight(13.0, name="new")], with_block(at, EDGE)).chosen
            assert new is not None
            clear.append(new.clear_distance)
        for lookahead in (2.0, rng.uniform(2.0, 4.0), 4.0):
            poses, feet = pursued(0.0, 0.0, 0.0, lookahead, late, 0.0, held)
            hit = struck(poses, at, 0.5 * EDGE) & (feet > 0.0)
            if hit.any():
                assert clear[0] <= feet[np.argmax(hit)] + 0.05, (held, at)
                hidden += clear[1] > feet[np.argmax(hit)] + 0.05
    assert hidden > 4  # of 42


def test_on_the_line_within_a_centimetre_no_bit_of_a_plan_changes() -> None:
    ground = with_block((5.0, 1.0), EDGE)
    exact, near = (
        answer(PlanarState(x=2.0, y=y, heading=turned, speed=0.8), ground).chosen
        for y, turned in ((0.0, 0.0), (0.004, -0.004))
    )
    assert exact is not None
    assert near is not None
    for name in ("x", "y", "speed", "accel", "speed_bound", "stop_distance", "limiting"):
        np.testing.assert_array_equal(getattr(exact, name), getattr(near, name), strict=True)


def test_a_block_before_the_line_is_reached_is_named_with_offset_and_heading() -> None:
    ground = with_block((2.6, 0.9), EDGE)
    assert answer(PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0), ground).status is Status.OK
    off_line = answer(PlanarState(x=0.0, y=0.4, heading=0.1, speed=0.0), ground)
    assert off_line.status is Status.BLOCKED
    assert "on the way to the path from 0.40 m left of it, 6° off its heading" in off_line.reason


@pytest.mark.parametrize("age", [0.0, 0.4])
def test_the_distance_driven_since_an_old_pose_stays_free(age: float) -> None:
    """On level ground the fastest plan ends its stops at the clear distance."""
    state = PlanarState(x=0.0, y=0.0, heading=0.0, speed=0.0, age=age)
    plan = answer(state, plane(), clear=9.0).chosen
    assert plan is not None
    braking = ATV["braking"]
    slow, fast = braking["speed_range"]
    v = plan.speed
    force = braking["m_b"] * np.clip(v, slow, fast) + braking["b_b"]
    way = v * (braking["dead_time"] + age) + v * v / (2.0 * G * force) + braking["distance_offset"]
    left = (plan.clear_distance - plan.station - way)[v > 0.0]
    assert left.min() >= -1e-6
    assert left.min() <= 0.1


@pytest.mark.parametrize("count", [3, 9])
def test_a_finished_candidate_knows_the_way_to_it_as_if_it_were_the_only_one(count: int) -> None:
    """All courses of few lines are swept, of many those to the best; blocked ones are no more."""
    rng, changed, after = np.random.default_rng(15), 0, 0
    settings = HorizonSettings(budget=60.0, smoothed=min(count, 4))

    def alone_with(state: PlanarState, line: list[CandidatePath]) -> list[SpeedPlan]:
        departs = partial(departure_of, state=state)
        planner = CandidatePlanner(MODEL, uncertainty=MEAN)
        return planner.plan(ground, line, start_speed=state.speed, departs=departs)

    for _ in range(20):
        ends = zip(np.linspace(-0.4, 0.4, count), rng.permutation(count), strict=True)
        lines = [CandidatePath(f"{y:g}", np.array([[0, y], [14.0 - 0.02 * n, y]])) for y, n in ends]
        ground = with_block((rng.uniform(1.8, 3.5), rng.uniform(-1.0, 1.0)), EDGE)
        turned, speed = rng.uniform(-0.25, 0.25), rng.uniform(0.0, 1.0)
        state = PlanarState(x=0.0, y=rng.uniform(-0.2, 0.2), heading=turned, speed=speed)
        horizon = Horizon(MODEL, settings, PlannerSettings(), MEAN)
        on_line = horizon.step(replace(state, y=0.0, heading=0.0), lines, ground)
        # With a plan that is driven already, and from scratch.
        for together in (horizon.step(state, lines, ground), horizon.step(state, lines, ground)):
            for plan in together.plans:
                line = [line for line in lines if line.name == plan.candidate]
                (alone,) = alone_with(state, line)
                assert plan.clear_distance <= alone.clear_distance + 1e-9, plan.candidate
                speed_bound = np.interp(plan.station, alone.station, alone.speed_bound)
                assert (plan.speed <= speed_bound + 1e-9).all() or plan.status not in SAFE
            after += len(together.plans)
            horizon.forget()
        changed += together.ranking[0].candidate != on_line.ranking[0].candidate
    assert changed > 1
    assert after > 60
