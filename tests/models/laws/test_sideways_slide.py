"""A mass that slides on a plane, by scipy in two dimensions, against the law in one."""

import math

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from slopewise.models.laws.sideways_slide import share_along
from slopewise.models.quantity import GRAVITY as G


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
