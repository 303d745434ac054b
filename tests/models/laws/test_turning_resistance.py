import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import turning_resistance as turning
from tests.models.parity import check_parity

# Slip, Table 1: B = 0.6 m, L = 0.55 m, W = 294.3 N; Table 2, asphalt: f_r = 0.03, μ_t = 0.26
HUSKY = {"weight": 294.3, "wheelbase": 0.55, "track_width": 0.6}
LEVEL = {"left_load": 147.15, "right_load": 147.15}
ASPHALT = {"motion_resistance": 0.03, "lateral_resistance": 0.26}


def printed_27(thrusts, motion_resistance, weight, wheelbase, track_width):
    return track_width / wheelbase * (sum(thrusts) / weight - motion_resistance)


def test_moment_and_thrusts_of_the_papers_vehicle_by_hand():
    # M_r = 0.26*294.3*0.55/2 = 21.04245 N m; rolling 0.03*147.15 = 4.4145 N a side;
    # M_r/B = 35.07075 N: on the spot 39.48525 N each, in a turn -30.65625 and 39.48525 N
    assert turning.turning_moment(0.26, 294.3, 0.55) == pytest.approx(21.04245)
    result = turning.side_thrusts(1.0, **ASPHALT, **LEVEL, **HUSKY)
    assert result == pytest.approx((39.48525, 39.48525))
    result = turning.side_thrusts(-1.0, **ASPHALT, **LEVEL, **HUSKY)
    assert result == pytest.approx((-30.65625, 39.48525))


def test_lateral_resistance_of_the_papers_vehicle_by_hand():
    # (0.6/0.55)*(78.9705/294.3 - 0.03) = 0.26
    result = turning.lateral_resistance_on_the_spot(39.48525, 39.48525, 0.03, **LEVEL, **HUSKY)
    assert result == pytest.approx(0.26)
    result = turning.lateral_resistance_in_a_turn(-30.65625, 39.48525, 0.03, **LEVEL, **HUSKY)
    assert result == pytest.approx(0.26)


@given(
    st.floats(0.0, 0.5),
    st.floats(0.0, 1.0),
    st.floats(50.0, 400.0),
    st.floats(50.0, 400.0),
    st.floats(0.3, 3.0),
    st.floats(0.3, 3.0),
)
def test_each_form_recovers_the_lateral_resistance(f_r, mu_t, left_load, right_load, L, B):
    weight = 1.1 * (left_load + right_load)  # tilted: the loads sum to less than the weight
    vehicle = (left_load, right_load, weight, L, B)
    thrusts = turning.side_thrusts(1.0, f_r, mu_t, *vehicle)
    result = turning.lateral_resistance_on_the_spot(*thrusts, f_r, *vehicle)
    assert result == pytest.approx(mu_t, abs=1e-9)
    thrusts = turning.side_thrusts(-1.0, f_r, mu_t, *vehicle)
    result = turning.lateral_resistance_in_a_turn(*thrusts, f_r, *vehicle)
    assert result == pytest.approx(mu_t, abs=1e-9)


@given(st.sampled_from([-1.0, 1.0]), st.floats(0.0, 0.5))
def test_thrusts_balance_moment_and_rolling(sigma, f_r):
    # signed by the direction of rolling: the left wheels roll backward on the spot, else forward
    left, right = turning.side_thrusts(sigma, f_r, 0.2, 120.0, 170.0, 300.0, 0.5, 0.6)
    rolling_left, rolling_right = -sigma * f_r * 120.0, f_r * 170.0
    net_left, net_right = -sigma * left - rolling_left, right - rolling_right
    assert net_left + net_right == pytest.approx(0.0, abs=1e-9)
    moment = 0.5 * 0.6 * (net_right - net_left)
    assert moment == pytest.approx(turning.turning_moment(0.2, 300.0, 0.5))


@pytest.mark.parametrize("mu_t", [0.1, 0.3])
def test_print_of_27_holds_on_the_spot_only(mu_t):
    ground = {"motion_resistance": 0.1, "lateral_resistance": mu_t}
    thrusts = turning.side_thrusts(1.0, **ground, **LEVEL, **HUSKY)
    assert printed_27(thrusts, 0.1, **HUSKY) == pytest.approx(mu_t)
    # in any other turn it is 0 on all ground
    thrusts = turning.side_thrusts(-1.0, **ground, **LEVEL, **HUSKY)
    assert printed_27(thrusts, 0.1, **HUSKY) == pytest.approx(0.0, abs=1e-12)


def test_drag_by_hand():
    # μ_t L |κ|/2 = 0.26*0.55*0.5/2
    assert turning.equivalent_drag_ratio(0.5, 0.26, 0.55) == pytest.approx(0.03575)


@given(st.floats(-2.0, 2.0), st.floats(0.0, 1.0), st.floats(0.3, 3.0))
def test_drag_has_the_power_of_the_moment(curvature, mu_t, wheelbase):
    weight, speed = 300.0, 1.7
    drag = weight * turning.equivalent_drag_ratio(curvature, mu_t, wheelbase)
    power = turning.turning_moment(mu_t, weight, wheelbase) * np.abs(curvature * speed)
    assert drag * speed == pytest.approx(power, abs=1e-9)


VEHICLE = {
    "left_load": (100.0, 200.0),
    "right_load": (100.0, 200.0),
    "weight": (200.0, 400.0),
    "wheelbase": (0.4, 1.2),
    "track_width": (0.4, 1.2),
}
THRUSTS = {"left_thrust": (-40.0, 40.0), "right_thrust": (10.0, 60.0)}
F_R, MU_T = (0.02, 0.3), (0.1, 0.4)


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (
            turning.turning_moment,
            {"lateral_resistance": MU_T, "weight": (200.0, 400.0), "wheelbase": (0.4, 1.2)},
        ),
        (
            turning.side_thrusts,
            {
                "sigma": (-1.0, 1.0),
                "motion_resistance": F_R,
                "lateral_resistance": MU_T,
                **VEHICLE,
            },
        ),
        (
            turning.lateral_resistance_on_the_spot,
            {"motion_resistance": F_R, **THRUSTS, **VEHICLE},
        ),
        (turning.lateral_resistance_in_a_turn, {"motion_resistance": F_R, **THRUSTS, **VEHICLE}),
        (
            turning.equivalent_drag_ratio,
            {"curvature": (-1.0, 1.0), "lateral_resistance": MU_T, "wheelbase": (0.4, 1.2)},
        ),
    ],
)
def test_parity(law, ranges):
    check_parity(law, **ranges)
