"""Emergency stops integrated in time, for effects that act on the motion itself.

A fourth-order Runge–Kutta scheme on the laws of `models`, grade linear between stations: in time,
where the bound marches along the path. Thirty times slower than
:mod:`slopewise.planner.verify.stop_by_energy`, which it agrees with where nothing acts on the
motion.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.effects.registry import MotionTerms
from slopewise.models.laws import friction_ellipse, wheel_loads
from slopewise.models.quantity import GRAVITY
from slopewise.planner.kernels.compiled import inlined
from slopewise.planner.kernels.limits import PlanningLimits
from slopewise.planner.kernels.motion_laws import motion_deceleration
from slopewise.planner.verify.stop_by_energy import Shares, lesser
from slopewise.planner.verify.track import Body, StopCommand, Terms, Track, at, segment

_rear_share = inlined(wheel_loads.rear_load_share)
_front_share = inlined(wheel_loads.front_load_share)
_left_share = inlined(wheel_loads.left_load_share)
_right_share = inlined(wheel_loads.right_load_share)
_side_force = inlined(friction_ellipse.side_force_ratio)
_normal = inlined(friction_ellipse.normal_ratio)
_braking_left = inlined(friction_ellipse.braking_left)

_ROUNDING = 1e-9
"""Force above what friction leaves that is rounding [1]: bounds work with sines."""


@inlined
def _grip(
    track: Track, limits: PlanningLimits, place: tuple[int, float], mu: float, energy: float
) -> float:
    """F_b/W that bank, turn and crest leave of friction at v², until an axle locks; inf if unknown.

    A stop that was commanded before a turn is faster in it than the plan, for which the track has
    what friction leaves.
    """
    if mu == np.inf:
        return np.inf
    i, u = place
    grade, roll = at(track.grade, i, u), at(track.roll, i, u)
    normal = _normal(grade, roll, min(at(track.vertical_curvature, i, u), 0.0), energy)
    side = _side_force(grade, roll, at(track.curvature, i, u), energy)
    grip = _braking_left(mu, normal, side)
    if limits.brake_share < 0.0:
        return float(grip)
    lift = limits.high * grip / max(normal, 1e-9)
    rear = grip * (1.0 - limits.ahead) / (1.0 - limits.brake_share + lift)
    front = grip * limits.ahead / max(limits.brake_share - lift, 1e-9)
    return float(min(grip, min(rear, front)))


@inlined
def may_slide(track: Track, limits: PlanningLimits, k: int, fastest: float) -> bool:
    """Could a stop that is nowhere faster than this slide between the stations around k?

    What friction leaves is concave in v² and along a segment: where it does at rest and at the
    highest speed, and at both ends, it does everywhere.
    """
    last = track.station.shape[0] - 1
    i, before, ahead = min(k, last - 1), max(k - 1, 0), min(k + 1, last)
    mu = min(track.friction[k], min(track.friction[before], track.friction[ahead]))
    if mu == np.inf:
        return False
    place = (i, float(k - i))
    grip = _grip(track, limits, place, mu, fastest * fastest)
    grip = min(grip, _grip(track, limits, place, mu, 0.0))
    slow, part = track.slowest[k], track.lower_slope[k]
    force = track.lower_intercept[k] + max(slow * part, max(fastest, slow) * part)
    return not (force <= grip + _ROUNDING)


@inlined
def _rates(
    track: Track,
    terms: Terms,
    slips: bool,
    s: float,
    v: float,
    f: float,
    q: float,
    v_i: float,
    i: int,
) -> tuple[float, float, float]:
    """Deceleration, growth of the built-up force and of the heat; turns share friction if slips."""
    motion = terms.motion
    i = segment(track.station, s, i)
    # Beyond the last station the ground stays as it was there.
    u = min((s - track.station[i]) / (track.station[i + 1] - track.station[i]), 1.0)
    grade = at(track.grade, i, u)
    upright = np.cos(grade) * np.cos(at(track.roll, i, u))
    wanted = v_i * at(track.lower_slope, i, u) + at(track.lower_intercept, i, u)
    force = (f if motion.lag > 0.0 else wanted) / (1.0 + motion.fade * max(q, 0.0))
    force = min(force, motion.friction * upright)
    speed = max(v, 0.0)
    if slips:
        mu = min(track.friction[i], track.friction[i + 1])
        force = min(force, _grip(track, terms.limits, (i, u), mu, speed * speed))
    extra = motion_deceleration(speed, at(track.curvature, i, u), at(track.yaw, i, u), motion)
    growth = (wanted - f) / motion.lag if motion.lag > 0.0 else 0.0
    heating = GRAVITY * max(force, 0.0) * speed - q / motion.fade_tau
    return GRAVITY * (force + np.sin(grade)) + extra, growth, heating


@inlined
def _shares(
    track: Track,
    body: Body,
    motion: MotionTerms,
    s: float,
    v: float,
    v_i: float,
    i: int,
    braking: bool,
) -> Shares:
    """Shares of rear, lighter side and lightest wheel at s, braking or holding the speed."""
    i = segment(track.station, s, i)
    u = min((s - track.station[i]) / (track.station[i + 1] - track.station[i]), 1.0)
    grade, roll = at(track.grade, i, u), at(track.roll, i, u)
    bend = at(track.curvature, i, u)
    decel = 0.0
    if braking:
        upper = v_i * at(track.upper_slope, i, u) + at(track.upper_intercept, i, u)
        upper = min(upper, motion.friction * np.cos(grade) * np.cos(roll))
        decel = GRAVITY * (upper + np.sin(grade))
        decel += max(motion_deceleration(max(v, 0.0), bend, at(track.yaw, i, u), motion), 0.0)
    normal = max(-at(track.vertical_curvature, i, u), 0.0) * v * v / GRAVITY
    rear = _rear_share(grade, roll, decel, body.wheelbase, body.cg_x, body.cg_z) - normal
    front = _front_share(grade, roll, decel, body.wheelbase, body.cg_x, body.cg_z) - normal
    lateral = v * v * bend / np.cos(roll)
    left = _left_share(grade, roll, lateral, body.track_width, body.cg_z)
    right = _right_share(grade, roll, lateral, body.track_width, body.cg_z)
    side = min(left, right) - normal
    return rear, side, min(rear, front) + side - (0.5 * (left + right) - normal)


@inlined
def stop_in_time(
    track: Track, terms: Terms, command: StopCommand, i: int, ends: tuple[float, float, bool]
) -> tuple[float, Shares]:
    """Where any stop ends, and the least shares of rear axle, sides and wheels on its way.

    Args:
        track: the path, (N,) each.
        terms: vehicle, effects, time step.
        command: of the stop; i: the segment that it is in.
        ends: a stop that gets to the first is not followed further; by the second it may fall
            further than the track [m]; the third: turns, banks and crests take of its friction.
    """
    body, motion, h = terms.body, terms.motion, terms.time_step
    limit, height, slips = ends
    v = command.speed
    station = track.station
    v_i = max(v, command.slowest)
    onset = command.station + v * command.dead_time
    least = _shares(track, body, motion, command.station, v, v_i, i, False)
    while station[i + 1] < onset and i + 2 < station.shape[0]:
        i += 1
        least = lesser(least, _shares(track, body, motion, station[i], v, v_i, i, False))
    least = lesser(least, _shares(track, body, motion, onset, v, v_i, i, False))
    f, q = 0.0, motion.heat
    s = onset
    while s <= limit:
        least = lesser(least, _shares(track, body, motion, s, v, v_i, i, True))
        a1, f1, q1 = _rates(track, terms, slips, s, v, f, q, v_i, i)
        if v <= 0.0:
            break
        b = 0.5 * h
        v2 = v - b * a1
        a2, f2, q2 = _rates(track, terms, slips, s + b * v, v2, f + b * f1, q + b * q1, v_i, i)
        v3 = v - b * a2
        a3, f3, q3 = _rates(track, terms, slips, s + b * v2, v3, f + b * f2, q + b * q2, v_i, i)
        v4 = v - h * a3
        a4, f4, q4 = _rates(track, terms, slips, s + h * v3, v4, f + h * f3, q + h * q3, v_i, i)
        after = v - h * (a1 + 2.0 * a2 + 2.0 * a3 + a4) / 6.0
        if after <= 0.0:
            # Within the last step the deceleration is as good as constant.
            s += 0.5 * v * h * v / (v - after) + GRAVITY * height * h / (v - after)
        else:
            s += h * (v + 2.0 * v2 + 2.0 * v3 + v4) / 6.0
            f += h * (f1 + 2.0 * f2 + 2.0 * f3 + f4) / 6.0
            q += h * (q1 + 2.0 * q2 + 2.0 * q3 + q4) / 6.0
        while station[i + 1] < s and i + 2 < station.shape[0]:
            i += 1
            least = lesser(least, _shares(track, body, motion, station[i], v, v_i, i, True))
        v = after
        if v <= 0.0:
            least = lesser(least, _shares(track, body, motion, s, 0.0, v_i, i, True))
            break
    return s, least
