import math

import pytest
from hypothesis import assume, given
from hypothesis import strategies as st

from slopewise.models.laws import braking, wheel_lockup
from slopewise.models.laws.wheel_loads import front_load_share, rear_load_share
from tests.models.parity import check_outside, check_parity

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


def test_parity():
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
