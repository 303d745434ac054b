import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import slip_track as slip
from tests.models.parity import check_parity

curvatures = st.floats(-2.0, 2.0)
tracks = st.floats(0.3, 3.0)


def test_slip_track_by_hand():
    # Slip, Table 2: beach sand 1.62 m; 45 deg/s on the spot needs 1.62*π/4 = 1.272345 m/s between
    # the sides
    left, right = slip.wheel_speeds(0.0, math.pi / 4, 1.62)
    assert right - left == pytest.approx(1.2723450247038663)
    assert (left, right) == pytest.approx((-0.6361725123519332, 0.6361725123519332))
    assert slip.slip_track(0.6361725123519332, -0.6361725123519332, math.pi / 4) == pytest.approx(
        1.62
    )


def test_left_turn_speeds_up_the_right_side():
    # 2 m/s, 0.5 rad/s, 1.2 m: 2 ∓ 0.3
    assert slip.wheel_speeds(2.0, 0.5, 1.2) == pytest.approx((1.7, 2.3))


@given(st.floats(-4.0, 4.0), curvatures.filter(lambda w: abs(w) > 1e-3), tracks)
def test_wheel_speeds_give_the_slip_track_back(speed, yaw_rate, track):
    left, right = slip.wheel_speeds(speed, yaw_rate, track)
    assert slip.slip_track(right, left, yaw_rate) == pytest.approx(track, rel=1e-9)
    assert slip.slip_track(left, right, -yaw_rate) == pytest.approx(track, rel=1e-9)
    assert 0.5 * (left + right) == pytest.approx(speed, abs=1e-12)


@given(st.floats(0.1, 4.0), curvatures, tracks)
def test_outer_ratio_is_that_of_the_faster_wheel(speed, curvature, track):
    fastest = max(slip.wheel_speeds(speed, curvature * speed, track))
    assert slip.outer_wheel_speed_ratio(curvature, track) == pytest.approx(fastest / speed)


def test_outer_ratio_by_hand():
    # radius 2 m, slip track 1 m: (2 + 0.5)/2
    assert slip.outer_wheel_speed_ratio(-0.5, 1.0) == pytest.approx(1.25)


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (slip.slip_track, {"v_right": (1.0, 2.0), "v_left": (-1.0, 0.5), "yaw_rate": (0.2, 1.0)}),
        (
            slip.wheel_speeds,
            {"speed": (0.0, 3.0), "yaw_rate": (-1.0, 1.0), "slip_track": (0.6, 1.8)},
        ),
        (slip.outer_wheel_speed_ratio, {"curvature": (-1.0, 1.0), "slip_track": (0.6, 1.8)}),
    ],
)
def test_parity(law, ranges):
    check_parity(law, **ranges)
