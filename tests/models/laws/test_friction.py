"""Friction: ellipse, locked wheels, holding and a sideways slide."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import assume, given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from slopewise.models.laws import braking, holding, wheel_lockup
from slopewise.models.laws import friction_ellipse as ellipse
from slopewise.models.laws.sideways_slide import share_along
from slopewise.models.laws.wheel_loads import front_load_share, rear_load_share
from tests.models.parity import G, check_outside, check_parity

# ------------------------------------------------------------------------ friction ellipse


GRADE, ROLL, MU = (-0.3, 0.3), (-0.25, 0.25), (0.4, 0.9)
CURVATURE, CREST = (0.02, 0.3), (-0.2, -0.01)


def test_a_side_slope_leaves_less_for_the_brakes() -> None:
    """15° and 0.35: of 0.338 W 0.217 W remain along the path."""
    roll = math.radians(15.0)
    side = ellipse.side_force_ratio(0.0, roll, 0.0, 0.0)
    normal = ellipse.normal_ratio(0.0, roll, 0.0, 0.0)
    assert side == pytest.approx(0.2588, abs=1e-4)
    left = ellipse.braking_left(0.35, normal, side)
    assert left == pytest.approx(math.sqrt((0.35 * 0.96593) ** 2 - 0.25882**2), abs=1e-4)
    assert ellipse.braking_left(0.2, normal, side) == 0.0


def test_a_crest_carries_what_the_circle_leaves() -> None:
    assert ellipse.normal_ratio(0.0, 0.0, -0.25, 4.0) == pytest.approx(1.0 - 1.0 / G)
    assert ellipse.normal_ratio(0.0, 0.0, -0.25, 4.0 * G + 1.0) == 0.0


@given(
    st.floats(*GRADE), st.floats(*ROLL), st.floats(-0.3, 0.3), st.floats(-0.2, 0.2), st.floats(*MU)
)
def test_at_the_returned_speed_a_turn_uses_its_share(
    grade: float, roll: float, curvature: float, crest: float, friction: float
) -> None:
    along = 0.3 * friction
    speed_sq = ellipse.lateral_speed_sq(grade, roll, curvature, crest, friction, along)
    upright = math.cos(grade) * math.cos(roll)
    bank = math.sin(roll) * math.cos(grade)
    taken = abs(bank) / upright
    # Halfway between the longitudinal demand and all of the friction remains for it.
    share = min(0.8 * friction + 0.2 * taken, friction * math.sqrt(1.0 - 0.65**2))
    share = max(share, taken)
    if speed_sq == 0.0:
        assert share * upright <= math.copysign(bank, bank * curvature) + 1e-12
        return
    if speed_sq > 1e6:
        assert abs(curvature) < 1e-3
        return
    normal = upright + min(crest, 0.0) * speed_sq / G
    outward = (
        abs(curvature) * speed_sq / G + (math.copysign(1.0, curvature) if curvature else 0.0) * bank
    )
    assert outward <= share * normal + 1e-9
    if crest >= 0.0:
        assert outward == pytest.approx(share * normal, abs=1e-9)
    assert 0.475 * friction * upright <= 0.65 * friction * normal + 1e-9


def test_parity_of_the_ellipse() -> None:
    check_parity(
        ellipse.side_force_ratio, grade=GRADE, roll=ROLL, curvature=CURVATURE, speed_sq=(1.0, 16.0)
    )
    check_parity(
        ellipse.normal_ratio,
        grade=GRADE,
        roll=ROLL,
        vertical_curvature=CREST,
        speed_sq=(1.0, 16.0),
    )
    check_parity(ellipse.braking_left, friction=MU, normal=(0.6, 1.0), side_force=(-0.2, 0.2))
    check_parity(
        ellipse.lateral_speed_sq,
        grade=GRADE,
        roll=(0.02, 0.2),
        curvature=CURVATURE,
        vertical_curvature=CREST,
        friction=MU,
        along=(0.0, 0.2),
    )


def test_ground_without_friction_below_none() -> None:
    check_outside(ellipse.braking_left, {"friction": -0.5, "normal": 1.0, "side_force": 0.1})
    check_outside(
        ellipse.lateral_speed_sq,
        {
            "grade": 0.0,
            "roll": 0.1,
            "curvature": 0.1,
            "vertical_curvature": 0.0,
            "friction": -0.5,
            "along": 0.1,
        },
    )


# ---------------------------------------------------------------------------- wheel lockup


LEVEL = {"grade": 0.0, "roll": 0.0}
angles = st.floats(-0.6, 0.6)
splits = st.floats(0.0, 1.0)
frictions = st.floats(0.1, 1.2)
wheelbases = st.floats(0.5, 4.0)
positions = st.floats(0.1, 0.9)  # cg_x / L
heights = st.floats(0.05, 1.0)


def test_lockup_by_hand():
    # L = 1, cg_x = 0.5, cg_z = 0.25, μ = 0.8, μ cg_z = 0.2
    vehicle = {"sliding_friction": 0.8, "wheelbase": 1.0, "cg_x": 0.5, "cg_z": 0.25, **LEVEL}
    # half the force in front: front 0.4/0.3 = 1.3333, rear 0.4/0.7 = 0.5714
    ratios = wheel_lockup.lockup_force_ratios(front_brake_share=0.5, **vehicle)
    assert ratios == pytest.approx((4.0 / 3.0, 4.0 / 7.0))
    # all of it in front: the front locks at 0.4/0.8
    front, rear = wheel_lockup.lockup_force_ratios(front_brake_share=1.0, **vehicle)
    assert front == pytest.approx(0.5)
    assert front < rear


def test_ideal_share_uses_all_friction():
    # (cg_x + μ cg_z)/L = 0.7, the ideal distribution of brake textbooks: both axles lock at μ
    vehicle = {"sliding_friction": 0.8, "wheelbase": 1.0, "cg_x": 0.5, "cg_z": 0.25, **LEVEL}
    ratios = wheel_lockup.lockup_force_ratios(front_brake_share=0.7, **vehicle)
    assert ratios == pytest.approx((0.8, 0.8))


@given(angles, angles, splits, frictions, wheelbases, positions, heights)
def test_at_lockup_the_axle_force_equals_its_friction(
    grade, roll, split, friction, wheelbase, position, cg_z
):
    assume(abs(split * wheelbase - friction * cg_z) > 1e-3)
    cg_x = position * wheelbase
    arguments = (grade, roll, split, friction, wheelbase, cg_x, cg_z)
    front, rear = wheel_lockup.lockup_force_ratios(*arguments)
    axle = (wheelbase, cg_x, cg_z)
    load = rear_load_share(grade, roll, braking.deceleration(rear, grade), *axle) * (1 - position)
    assert (1.0 - split) * rear == pytest.approx(friction * load, abs=1e-9)

    if split * wheelbase > friction * cg_z:
        load = front_load_share(grade, roll, braking.deceleration(front, grade), *axle) * position
        assert split * front == pytest.approx(friction * load, rel=1e-9, abs=1e-9)
    else:
        assert front > 1e6


@given(angles, angles, splits, frictions, wheelbases, positions, heights)
def test_lockup_is_never_above_the_cap(grade, roll, split, friction, wheelbase, position, cg_z):
    cg_x = position * wheelbase
    cap = wheel_lockup.friction_cap(grade, roll, friction)
    axle = (wheelbase, cg_x, cg_z)
    first = min(wheel_lockup.lockup_force_ratios(grade, roll, split, friction, *axle))
    assert first <= cap * (1.0 + 1e-12)
    ideal = (cg_x + friction * cg_z) / wheelbase
    if ideal <= 1.0:
        first = min(wheel_lockup.lockup_force_ratios(grade, roll, ideal, friction, *axle))
        assert first == pytest.approx(cap)


def test_friction_cap_by_hand():
    # cos θ = 0.8, cos φ = 0.6, μ = 0.5
    ratios = wheel_lockup.friction_cap(math.asin(-0.6), math.asin(0.8), 0.5)
    assert ratios == pytest.approx(0.24)


RANGES = {
    "grade": (-0.4, 0.4),
    "roll": (-0.4, 0.4),
    "front_brake_share": (0.5, 0.9),
    "sliding_friction": (0.3, 0.8),
    "wheelbase": (1.0, 2.0),
    "cg_x": (0.3, 0.6),
    "cg_z": (0.2, 0.4),
}


def test_parity_of_the_lockup():
    check_parity(wheel_lockup.lockup_force_ratios, **RANGES)


def test_parity_of_the_cap():
    names = ("grade", "roll", "sliding_friction")
    check_parity(wheel_lockup.friction_cap, **{name: RANGES[name] for name in names})


INSIDE = {name: 0.5 * (low + high) for name, (low, high) in RANGES.items()}


@pytest.mark.parametrize(
    "changes",
    [{"sliding_friction": -0.1}, {"front_brake_share": -0.1}, {"front_brake_share": 1.3}],
)
def test_outside_the_domain_there_is_no_lockup(changes):
    check_outside(wheel_lockup.lockup_force_ratios, {**INSIDE, **changes})


def test_no_friction_is_a_cap_and_less_is_none():
    ground = {"grade": 0.1, "roll": 0.0}
    check_outside(wheel_lockup.friction_cap, {**ground, "sliding_friction": 0.0}, 0.0)
    check_outside(wheel_lockup.friction_cap, {**ground, "sliding_friction": -0.3})


@pytest.mark.parametrize("share", [0.0, 1.0])
def test_one_axle_may_brake_alone(share):
    ratios = wheel_lockup.lockup_force_ratios(**{**INSIDE, "front_brake_share": share})
    assert min(ratios) > 0.0


# --------------------------------------------------------------------------------- holding


def test_brakes_hold_uphill_as_downhill() -> None:
    assert holding.brakes_hold(0.4, math.radians(30.0)) == pytest.approx(-0.1)
    assert holding.brakes_hold(0.4, math.radians(-20.0)) == pytest.approx(0.4 - 0.34202, abs=1e-5)


def test_friction_holds_up_to_its_angle_along_and_across() -> None:
    limit = math.atan(0.5)
    assert holding.friction_holds(0.5, limit, 0.0) == pytest.approx(0.0, abs=1e-12)
    assert holding.friction_holds(0.5, 0.0, -limit) == pytest.approx(0.0, abs=1e-12)


@given(st.floats(0.1, 1.0), st.floats(-0.5, 0.5), st.floats(-0.5, 0.5))
def test_the_slope_is_that_of_the_plane(friction: float, grade: float, roll: float) -> None:
    """Of the plane's normal only the angle to the vertical counts."""
    steepest = math.acos(math.cos(grade) * math.cos(roll))
    expected = friction * math.cos(steepest) - math.sin(steepest)
    assert holding.friction_holds(friction, grade, roll) == pytest.approx(expected, abs=1e-9)


def test_parity_of_holding() -> None:
    check_parity(holding.brakes_hold, force_ratio=(0.1, 0.6), grade=(-0.3, 0.3))
    check_parity(holding.friction_holds, friction=(0.2, 0.9), grade=(-0.3, 0.3), roll=(-0.3, 0.3))


# -------------------------------------------------------------------------- sideways slide


def sliding(v: float, grade: float, roll: float, mu: float) -> tuple[np.ndarray, np.ndarray]:
    """Time, and speed along the path, of a block with even friction, down to 5 % of it."""
    normal = math.cos(grade) * math.cos(roll)

    def rates(_: float, state: np.ndarray) -> list[float]:
        along, across = state
        grip = G * mu * normal / math.hypot(along, across)
        return [-G * math.sin(grade) - grip * along, G * math.sin(roll) - grip * across]

    def slow(_: float, state: np.ndarray) -> float:
        return float(state[0] - 0.05 * v)

    slow.terminal = True  # type: ignore[attr-defined]
    solution = solve_ivp(rates, (0.0, 60.0), [v, 0.0], events=slow, rtol=1e-9, max_step=0.01)
    assert solution.status == 1
    return solution.t, solution.y[0]


def by_the_law(time: np.ndarray, v: float, grade: float, roll: float, mu: float) -> np.ndarray:
    def rates(_: float, state: np.ndarray) -> list[float]:
        share = float(share_along(state[0] / v, grade, roll, mu))
        cap = mu * math.cos(grade) * math.cos(roll)
        return [-G * (math.sin(grade) + cap * share)]

    end = float(time[-1])
    solution = solve_ivp(rates, (0.0, end), [v], t_eval=time, rtol=1e-9, max_step=0.01)
    return np.asarray(solution.y[0])


@pytest.mark.parametrize("mu", [0.3, 0.45, 0.8])
@pytest.mark.parametrize("grade", [-0.14, -0.03, 0.0, 0.1, 0.2])
@pytest.mark.parametrize("roll", [0.03, -0.09])
def test_the_speed_is_that_of_a_block_on_a_plane(grade: float, roll: float, mu: float) -> None:
    v = 4.0
    time, speed = sliding(v, grade, roll, mu)
    upright = G * (math.sin(grade) + mu * math.cos(grade) * math.cos(roll))
    unaware = v - upright * time
    difference = np.abs(by_the_law(time, v, grade, roll, mu) - speed)
    # The difference is small compared with the change by the slide.
    assert difference.max() <= 0.1 * np.abs(unaware - speed).max() + 1e-3


def test_without_a_cross_slope_or_at_once_nothing_is_lost() -> None:
    assert share_along(0.2, -0.1, 0.0, 0.4) == 1.0
    assert share_along(1.0, -0.1, 0.1, 0.4) == 1.0


def test_of_the_share_by_hand() -> None:
    # Level ground, μ = 0.5, half of the speed: r = φ/μ ln 2 = 0.1/0.5 · 0.6931, cos φ aside.
    solution = share_along(0.5, 0.0, 0.1, 0.5)
    assert solution == pytest.approx(1.0 / math.sqrt(1.0 + (0.2 * math.log(2.0)) ** 2), rel=2e-4)


def test_it_is_the_same_to_either_side_and_shrinks_towards_standstill() -> None:
    slowed = np.linspace(0.02, 1.0, 50)
    left, right = (share_along(slowed, -0.1, roll, 0.4) for roll in (0.08, -0.08))
    assert np.array_equal(left, right)
    assert np.all(np.diff(left) > 0.0)
