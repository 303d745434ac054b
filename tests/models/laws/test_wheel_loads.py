import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from slopewise.models.laws import wheel_loads as loads
from tests.models.parity import G, check_outside, check_parity

angles = st.floats(-0.7, 0.7)
accels = st.floats(-8.0, 8.0)
wheelbases = st.floats(0.3, 4.0)
widths = st.floats(0.3, 3.0)
heights = st.floats(0.05, 1.5)
positions = st.floats(0.1, 0.9)  # cg_x / L


def axle_free_body(grade, deceleration, wheelbase, cg_x, cg_z):
    """Loads (front, rear)/W by forces and moments about the centre of gravity, side view.

    x along the ground in the direction of travel, z normal to it. Gravity is W (−sin θ, −cos θ).
    Unknown: normal loads N_f, N_r and the sum F of the ground's forces along x.
    Σ F_x: F − sin θ = −a_x/g;  Σ F_z: N_f + N_r − cos θ = 0
    Σ M_y about the cg, M_y = z F_x − x F_z: front at (L − cg_x, −cg_z), rear at (−cg_x, −cg_z).
    """
    matrix = np.array(
        [
            [0.0, 0.0, 1.0],
            [1.0, 1.0, 0.0],
            [-(wheelbase - cg_x), cg_x, -cg_z],
        ]
    )
    right = np.array([np.sin(grade) - deceleration / G, np.cos(grade), 0.0])
    front, rear, _ = np.linalg.solve(matrix, right)
    return front, rear


def wheel_free_body(pitch, roll, accel, wheelbase, track_width, cg_x, cg_z):
    """Wheel loads/W from six-component vectors: gravity through Slip (14), r x F about the cg."""
    c, s = np.cos, np.sin
    body_to_world = np.array(
        [[c(pitch), 0, s(pitch)], [0, 1, 0], [-s(pitch), 0, c(pitch)]]
    ) @ np.array([[1, 0, 0], [0, c(roll), -s(roll)], [0, s(roll), c(roll)]])
    gravity = body_to_world.T @ np.array([0.0, 0.0, -1.0])
    ground = np.array([accel[0], accel[1], 0.0]) / G - gravity  # sum of the contact forces over W
    half = 0.5 * track_width
    contacts = np.array(
        [
            [wheelbase - cg_x, half, -cg_z],
            [-cg_x, half, -cg_z],
            [wheelbase - cg_x, -half, -cg_z],
            [-cg_x, -half, -cg_z],
        ]
    )
    tangential = np.cross([0.0, 0.0, -cg_z], [ground[0], ground[1], 0.0])  # all at one height
    normals = np.cross(contacts, [0.0, 0.0, 1.0])
    ahead = cg_x / wheelbase
    matrix = np.array(
        [
            np.ones(4),
            normals[:, 0],
            normals[:, 1],
            [1.0 - ahead, -ahead, -(1.0 - ahead), ahead],  # lateral transfer as the static split
        ]
    )
    return np.linalg.solve(matrix, [ground[2], -tangential[0], -tangential[1], 0.0])


@given(angles, accels, wheelbases, positions, heights)
def test_axles_match_the_free_body(grade, deceleration, wheelbase, position, cg_z):
    cg_x = position * wheelbase
    front, rear = axle_free_body(grade, deceleration, wheelbase, cg_x, cg_z)
    share = loads.front_load_share(grade, 0.0, deceleration, wheelbase, cg_x, cg_z)
    assert share * cg_x / wheelbase == pytest.approx(front, abs=1e-9)
    share = loads.rear_load_share(grade, 0.0, deceleration, wheelbase, cg_x, cg_z)
    assert share * (1.0 - position) == pytest.approx(rear, abs=1e-9)


def test_axle_shares_by_hand():
    # L = 1, cg_x = 0.4, cg_z = 0.3, sin θ = -0.6, cos θ = 0.8, a_x = g/10:
    # W_f = 0.4*0.8 + 0.3*(0.1 + 0.6) = 0.53, W_r = 0.6*0.8 - 0.21 = 0.27; static 0.4 and 0.6
    grade = -np.arcsin(0.6)
    front = loads.front_load_share(grade, 0.0, 0.1 * G, 1.0, 0.4, 0.3)
    rear = loads.rear_load_share(grade, 0.0, 0.1 * G, 1.0, 0.4, 0.3)
    assert front == pytest.approx(1.325, abs=1e-12)
    assert rear == pytest.approx(0.45, abs=1e-12)


def test_downhill_and_braking_unload_the_rear_and_load_the_front():
    vehicle = {"wheelbase": 1.0, "cg_x": 0.5, "cg_z": 0.4}
    for case in ({"grade": -0.2, "deceleration": 0.0}, {"grade": 0.0, "deceleration": 2.0}):
        assert loads.rear_load_share(roll=0.0, **case, **vehicle) < 0.9
        assert loads.front_load_share(roll=0.0, **case, **vehicle) > 1.1
    assert loads.rear_load_share(0.2, 0.0, 0.0, **vehicle) > 1.1
    assert loads.front_load_share(0.2, 0.0, 0.0, **vehicle) < 0.9


def test_raised_left_side_and_left_turn_unload_the_left():
    vehicle = {"track_width": 1.0, "cg_z": 0.4}
    for case in ({"roll": 0.2, "lateral_accel": 0.0}, {"roll": 0.0, "lateral_accel": 2.0}):
        assert loads.left_load_share(0.0, **case, **vehicle) < 0.9
        assert loads.right_load_share(0.0, **case, **vehicle) > 1.1


def test_side_shares_by_hand():
    # B = 1, h = 0.4, sin φ = 0.6, cos φ = 0.8, level along, a_y = -g/10:
    # transfer 0.6 - 0.1 = 0.5; left 0.8 - 0.8*0.5 = 0.4, right 1.2
    roll = np.arcsin(0.6)
    assert loads.left_load_share(0.0, roll, -0.1 * G, 1.0, 0.4) == pytest.approx(0.4)
    assert loads.right_load_share(0.0, roll, -0.1 * G, 1.0, 0.4) == pytest.approx(1.2)


def test_print_of_4_is_for_a_centre_of_gravity_measured_from_the_front():
    # nearer the rear axle, the rear carries more: cg_x = L/4, rear 3/4 W
    front, rear = axle_free_body(0.0, 0.0, 1.0, 0.25, 0.3)
    printed_front, printed_rear = (1.0 - 0.25) / 1.0, 0.25 / 1.0
    assert (front, rear) == pytest.approx((printed_rear, printed_front))
    assert front == pytest.approx(loads.front_load_share(0, 0, 0, 1.0, 0.25, 0.3) * 0.25)


@pytest.mark.parametrize("grade", [-0.25, 0.25])
def test_print_of_3_and_5_contradicts_the_free_body(grade):
    wheelbase, x, z, a = 1.2, 0.5, 0.4, 2.0
    front, rear = axle_free_body(grade, a, wheelbase, x, z)
    sine, cosine = np.sin(grade), np.cos(grade)
    # (3) solved for W_r: wrong by 2 z sin θ / L
    printed_rear = ((wheelbase - x) * cosine - z * a / G - z * sine) / wheelbase
    assert rear - printed_rear == pytest.approx(2.0 * z * sine / wheelbase)
    # (5): the front's slope term makes the sum W (cos θ + (x + z)/L sin θ)
    printed_front = (x * cosine + x * sine + z * a / G) / wheelbase
    rear_of_5 = ((wheelbase - x) * cosine - z * np.sin(-grade) - z * a / G) / wheelbase
    assert rear_of_5 == pytest.approx(rear)
    assert front + rear == pytest.approx(cosine)
    assert printed_front + rear_of_5 - cosine == pytest.approx((x + z) / wheelbase * sine)


@given(angles, angles, accels, accels, wheelbases, widths, positions, heights)
def test_wheels_match_the_free_body_and_the_shares(
    pitch, roll, accel_x, accel_y, wheelbase, track_width, position, cg_z
):
    weight = 500.0
    cg_x = position * wheelbase
    result = np.array(
        loads.wheel_loads(weight, pitch, roll, accel_x, accel_y, wheelbase, track_width, cg_x, cg_z)
    )
    expected = wheel_free_body(pitch, roll, (accel_x, accel_y), wheelbase, track_width, cg_x, cg_z)
    np.testing.assert_allclose(result, weight * expected, rtol=1e-8, atol=1e-6)
    total = weight * np.cos(roll) * np.cos(pitch)
    assert result.sum() == pytest.approx(total)
    sums = [
        result[0] + result[2],
        result[1] + result[3],
        result[0] + result[1],
        result[2] + result[3],
    ]
    axle = (-pitch, roll, -accel_x, wheelbase, cg_x, cg_z)
    side = (-pitch, roll, accel_y, track_width, cg_z)
    shares = [
        loads.front_load_share(*axle) * position,
        loads.rear_load_share(*axle) * (1.0 - position),
        loads.left_load_share(*side) / 2.0,
        loads.right_load_share(*side) / 2.0,
    ]
    np.testing.assert_allclose(sums, weight * np.array(shares), rtol=1e-9, atol=1e-6)


@given(angles, angles, wheelbases, widths, heights)
def test_at_rest_with_central_gravity_these_are_slip_18_to_21(pitch, roll, L, B, h):
    W = 294.3
    level = W / 4 * np.cos(roll) * np.cos(pitch)
    fore = W / 2 * np.sin(pitch) * h / L
    side = W / 2 * np.cos(pitch) * np.sin(roll) * h / B
    expected = [level + fore - side, level - fore - side, level + fore + side, level - fore + side]
    result = loads.wheel_loads(W, pitch, roll, 0.0, 0.0, L, B, L / 2, h)
    np.testing.assert_allclose(result, expected, rtol=1e-9, atol=1e-9)
    # print repeats the left side's sign for wheel 4: then the loads miss the weight by 2 side
    printed = [*expected[:3], level - fore - side]
    missing = W * np.cos(roll) * np.cos(pitch) - sum(printed)
    assert missing == pytest.approx(2.0 * side, abs=1e-9)


def test_wheel_loads_by_hand():
    # nose down with sin = 0.6 at rest, W = 100, L = B = 1, cg_x = 0.5, h = 0.5:
    # front axle 50*0.8 + 100*0.5*0.6 = 70, rear 40 - 30 = 10
    result = loads.wheel_loads(100.0, np.arcsin(0.6), 0.0, 0.0, 0.0, 1.0, 1.0, 0.5, 0.5)
    assert result == pytest.approx((35.0, 5.0, 35.0, 5.0))
    # level left turn with g/10, cg_x = 0.75: transfer 100*0.5*0.1 = 5, 3/4 of it in front
    result = loads.wheel_loads(100.0, 0.0, 0.0, 0.0, 0.1 * G, 1.0, 1.0, 0.75, 0.5)
    assert result == pytest.approx((33.75, 11.25, 41.25, 13.75))


ANGLE, ACCEL, LENGTH, HEIGHT, CG_X = (-0.4, 0.4), (-4.0, 4.0), (0.8, 2.0), (0.2, 0.6), (0.3, 0.6)
AXLE = {
    "grade": ANGLE,
    "roll": ANGLE,
    "deceleration": ACCEL,
    "wheelbase": LENGTH,
    "cg_x": CG_X,
    "cg_z": HEIGHT,
}
SIDE = {
    "grade": ANGLE,
    "roll": ANGLE,
    "lateral_accel": ACCEL,
    "track_width": LENGTH,
    "cg_z": HEIGHT,
}
WHEELS = {
    "weight": (100.0, 900.0),
    "pitch": ANGLE,
    "roll": ANGLE,
    "accel_x": ACCEL,
    "accel_y": ACCEL,
    "wheelbase": LENGTH,
    "track_width": LENGTH,
    "cg_x": CG_X,
    "cg_z": HEIGHT,
}


@pytest.mark.parametrize(
    ("law", "ranges"),
    [
        (loads.front_load_share, AXLE),
        (loads.rear_load_share, AXLE),
        (loads.left_load_share, SIDE),
        (loads.right_load_share, SIDE),
        (loads.wheel_loads, WHEELS),
    ],
)
def test_parity(law, ranges):
    check_parity(law, **ranges)


def test_no_rear_axle_ahead_of_the_load():
    check_outside(
        loads.rear_load_share,
        {
            "grade": 0.0,
            "roll": 0.0,
            "deceleration": 3.0,
            "wheelbase": 1.0,
            "cg_x": 1.2,
            "cg_z": 0.5,
        },
    )
