"""Definitions of what the compiled core computes, in numpy, one candidate after the other.

They share no code with the planner.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import nnls

G = 9.80665
STANDSTILL_SQ, TANGENT_SPEED, TIGHTENING = 1e-6, 0.15, 1.5e-4


def braked(row: Any, ahead: Any, after: float) -> float:
    """Highest v² from which the weaker end of a segment slows down to ``after``."""
    ds = ahead.station - row.station
    slope = min(row.lower_slope, ahead.lower_slope)
    force = min(row.lower_intercept + row.sin_grade, ahead.lower_intercept + ahead.sin_grade)
    slowest = row.slowest

    def excess(v: float) -> float:
        onset = max(np.sqrt(after) if slope > 0.0 else v, slowest)
        return v * v - after - 2.0 * G * ds * (force + slope * onset)

    low, high = 0.0, 100.0
    if excess(low) > 0.0:
        return 0.0
    for _ in range(200):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if excess(middle) <= 0.0 else (low, middle)
    return low * low


def powered(row: Any, ahead: Any, before: float, top: float, specific_power: float) -> float:
    """v² that power reaches: four of Newton's steps from above, then one on the tangent over v²."""
    ds = ahead.station - row.station
    cost = 2.0 * ds * G * max(row.demand, ahead.demand) - before
    power = 2.0 * ds * G * specific_power
    if not (top + cost > 0.0 and (top + cost) ** 2 * top > power**2):
        return top
    v = np.sqrt(max(top, 1e-6))
    for _ in range(4):
        v = max(v - max(v**3 + cost * v - power, 0.0) / max(3.0 * v * v + cost, 1e-6), 1e-3)
    tangent = max(v * v + cost - power / v, 0.0) / (1.0 + 0.5 * power / v**3)
    return float(min(top, max(v * v - tangent, before)))


def time_optimal(rows: list[Any], start_sq: float, decel: float, power: float) -> np.ndarray:
    """v² of one candidate; rows are its stations, with the names of ProfileProblem."""
    v_sq = np.array([row.speed_sq_max for row in rows])
    v_sq[1:-1][np.maximum(v_sq[1:-1], v_sq[2:]) <= STANDSTILL_SQ] = 0.0
    for k in range(len(rows) - 2, -1, -1):
        reach = v_sq[k + 1] + 2.0 * (rows[k + 1].station - rows[k].station) * decel
        v_sq[k] = min(v_sq[k], reach, braked(rows[k], rows[k + 1], v_sq[k + 1]))
    v_sq[0] = min(v_sq[0], start_sq)
    for k in range(len(rows) - 1):
        row, ahead = rows[k], rows[k + 1]
        accel = min(row.accel_max, ahead.accel_max)
        step = 2.0 * (ahead.station - row.station)
        top = min(v_sq[k + 1], v_sq[k] + step * accel)
        # Where v² = before + step (lift − lost v²); it never slows down.
        lost = max(row.lift_per_speed_sq, ahead.lift_per_speed_sq)
        turned = np.linalg.solve(
            [[1.0 / step + lost]], [v_sq[k] / step + min(row.lift, ahead.lift)]
        )
        top = min(top, max(float(turned[0]), v_sq[k]))
        v_sq[k + 1] = powered(row, ahead, v_sq[k], top, power)
    creeps = np.flatnonzero(np.maximum(v_sq[:-1], v_sq[1:]) <= STANDSTILL_SQ)
    v_sq[max(creeps[0], 1) if len(creeps) else len(rows) :] = 0.0
    return v_sq


def program(
    ds: np.ndarray,
    top: np.ndarray,
    accel: np.ndarray,
    decel: np.ndarray,
    jerk: float,
    around: np.ndarray,
) -> tuple[np.ndarray, np.ndarray]:
    """Matrix and limits of smoothing without a start acceleration, a row for each constraint."""
    n, rows, limits = len(top), [], []
    unit = np.eye(n)
    slopes = (unit[1:] - unit[:-1]) / (2.0 * ds[:, None])
    is_standstill = top <= STANDSTILL_SQ
    for k in range(1, n):
        if not is_standstill[k]:
            rows += [unit[k], -unit[k]]
            limits += [max(top[k] - TIGHTENING, 0.0), 0.0]
    for k in range(n - 1):
        if not (is_standstill[k] and is_standstill[k + 1]):
            rows += [slopes[k], -slopes[k]]
            limits += [accel[k] - TIGHTENING, decel[k] - TIGHTENING]
    v = np.maximum(np.sqrt(np.maximum(around, 0.0)), TANGENT_SPEED)
    for k in range(n - 2):
        if (is_standstill[k] and is_standstill[k + 1]) or (
            is_standstill[k + 1] and is_standstill[k + 2]
        ):
            continue
        first, second = v[k] + v[k + 1], v[k + 1] + v[k + 2]
        gradient = np.zeros(n)
        gradient[k : k + 2] -= ds[k] / first**2
        gradient[k + 1 : k + 3] -= ds[k + 1] / second**2
        gradient *= 0.5 / v
        time = ds[k] / first + ds[k + 1] / second - gradient @ (v * v)
        for change in (slopes[k + 1] - slopes[k], slopes[k] - slopes[k + 1]):
            rows.append(change - jerk * gradient)
            limits.append(jerk * time - 2.0 * TIGHTENING)
    return np.array(rows), np.array(limits)


def shortest(matrix: np.ndarray, limit: np.ndarray) -> np.ndarray:
    """Shortest y with matrix · y <= limit.

    Source: C. Lawson, R. Hanson, Solving Least Squares Problems, chapter 23.
    """
    system = np.vstack([-matrix.T, -limit])
    unit = np.zeros(len(system))
    unit[-1] = 1.0
    weights, _ = nnls(system, unit)
    residual = system @ weights - unit
    answer: np.ndarray = -residual[:-1] / residual[-1]
    return answer
