"""Speeds of all stops that a hypothesis gives, on the grid of a stop table.

Nothing is differentiated: v(t) = v_i − ∫ a dt from the onset on. In integral form the speed in the
terms of motion is the measured one, so that what is linear stays linear; as output the speed is the
prediction's own, found by repeating the integral until it stays (:func:`simulate`).

Source: Braking (2), (7), (8) with the effects of :mod:`models.effects`.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from models import braking, effects, wheel_lockup
from models.discrepancy.hypothesis import Hypothesis
from models.discrepancy.stop_table import StopTable
from models.quantity import GRAVITY

Floats = NDArray[np.float64]

_SWEEPS = 12
_SAME = 1e-5  # [m/s]
_LEAST_SPEED = 0.3  # [m/s] slower than that a curvature means nothing
_LEAST_COOLING = 0.5  # [s]
_LATEST_CLOCK = 1e6  # [s] clocks beyond count from some epoch, not from the session's beginning


class Ground(NamedTuple):
    """What the vehicle meets along its way, (S, M) each."""

    grade: Floats
    roll: Floats
    yaw: Floats
    turning: Floats
    x: Floats
    y: Floats


def ground_of(table: StopTable) -> Ground:
    """As it was met by the measured vehicle."""
    return Ground(table.grade, table.roll, table.yaw, table.yaw_rate, table.x, table.y)


def session_time(table: StopTable) -> Floats:
    """(S,) since the session began [s]: the log's clock, or since its first stop."""
    late = float(table.clock[0]) > _LATEST_CLOCK
    return table.clock - table.clock[0] if late else table.clock


def predict(
    table: StopTable, hypothesis: Hypothesis, speed: Floats | None = None,
    ground: Ground | None = None, time: Floats | None = None,
) -> Floats:  # fmt: skip
    """(S, M) fall of the speed since the command [m/s], 0 before the onset.

    Args:
        table: stops. hypothesis: what to believe.
        speed, ground, time: (S, M) in place of those measured.
    """
    v = table.speed if speed is None else np.maximum(speed, 0.0)
    t = table.time if time is None else time
    place = ground_of(table) if ground is None else ground
    terms = effects.motion(
        (*hypothesis.model.effect, *hypothesis.added), hypothesis.model.braking.sliding_friction
    )
    wanted = wanted_force(table, hypothesis, place)
    step = t[:, 1:2] - t[:, :1]
    since = np.maximum(t - hypothesis.dead_time, 0.0)
    force = lagged(wanted, since, terms.lag) if terms.lag > 0.0 else wanted
    given = force
    if terms.fade > 0.0:
        given = given / (1.0 + terms.fade * heat(table, terms.fade_tau, v, t, hypothesis.dead_time))
    if math.isfinite(terms.friction):
        given = np.minimum(
            given, wheel_lockup.friction_cap(place.grade, place.roll, terms.friction)
        )
    rest = np.sin(place.grade) + given - force
    if terms.drag or terms.viscous or terms.turning or terms.wind_drag:
        curvature = np.abs(place.turning) / np.maximum(v, _LEAST_SPEED)
        rest = rest + effects.motion_deceleration(v, curvature, place.yaw, terms) / GRAVITY
    fall = _since_onset(wanted + rest, step, t, hypothesis.dead_time)
    if terms.lag > 0.0:  # ∫f = ∫F − τ f, from τ df/dt = F − f
        fall = fall - terms.lag * force
    return GRAVITY * fall


def wanted_force(table: StopTable, hypothesis: Hypothesis, place: Ground) -> Floats:
    """(S, M) F_b/W before lag, fade and friction cap."""
    model = hypothesis.model
    onset = np.maximum(table.held, model.braking.speed_range[0])[:, None]
    shift_m, shift_b = _lines(hypothesis.shift, onset)
    force = np.empty_like(place.grade)
    names = np.array(table.terrain)
    for name in set(table.terrain):
        rows = names == name
        on = model.braking.on(name) if name else model.braking
        m, b = _lines(np.array([on.m_m, on.b_m, on.m_b, on.b_b]), onset[rows])
        here = place.grade[rows]
        if on.uphill is not None:
            up, _ = _lines(np.array([on.uphill.m_m, on.uphill.b_m, 0.0, 0.0]), onset[rows])
            m = np.where(here > 0.0, up, m)
        force[rows] = braking.force_ratio_at_level(
            (m + shift_m[rows]) * here + b + shift_b[rows], model.terrain.motion_resistance,
            on.level,
        )  # fmt: skip
    clock = session_time(table)[:, None]
    force = force * effects.force_scale(model.effect)
    lasting = [e for e in hypothesis.added if e.name == "step_change"]
    everywhere = (*model.effect, *(e for e in hypothesis.added if e.name != "step_change"))
    passing = [e for e in everywhere if e.name != "surface_patch"]
    for effect in lasting:
        changed = (table.run >= effect.parameters["run"])[:, None]
        values = effects.validate(effect)
        force = np.where(changed, force * values["scale"] + values["delta"], force)
    for effect in everywhere:
        if effect.name == "surface_patch":
            p = effects.validate(effect)
            force = force + p["delta"] * inside_patch(place, p["x"], p["y"], p["radius"])
    result: Floats = force + effects.ground_term(
        passing, place.grade, place.roll, place.x, place.y, place.yaw, clock
    )
    return result


def inside_patch(place: Ground, x: float, y: float, radius: float) -> Floats:
    """(S, M) share of the way around each grid time that lies inside a patch.

    A grid time next to the edge counts in part, so that it does not matter where grids lie.
    """
    away = np.hypot(place.x - x, place.y - y)
    step = np.maximum(np.abs(np.gradient(away, axis=1)), 1e-6)
    inside: Floats = np.clip((radius - away) / step + 0.5, 0.0, 1.0)
    return inside


def _lines(c: Floats, speed: Floats) -> tuple[Floats, Floats]:
    """Slope and level force at onset speeds. Source: Braking (7), (8)."""
    return c[0] * speed + c[1], c[2] * speed + c[3]


def lagged(wanted: Floats, since: Floats, lag: float) -> Floats:
    """First-order build-up from 0 at the onset along axis 1, exact for an even force in a step."""
    force = np.zeros_like(wanted)
    keep = np.exp(-np.diff(since, axis=1) / lag)
    middle = 0.5 * (wanted[:, 1:] + wanted[:, :-1]) * (1.0 - keep)
    for k in range(keep.shape[1]):
        force[:, k + 1] = force[:, k] * keep[:, k] + middle[:, k]
    return force


def _since_onset(values: Floats, step: Floats, t: Floats, onset: float) -> Floats:
    """(S, M) integral over time from the onset on, smooth in the onset."""
    total = np.zeros_like(values)
    np.cumsum(0.5 * (values[:, 1:] + values[:, :-1]) * step, axis=1, out=total[:, 1:])
    at_onset = at_time(total, t, onset)[:, None]
    result: Floats = np.where(t > onset, total - at_onset, 0.0)
    return result


def integral(
    table: StopTable, hypothesis: Hypothesis, shares: Floats, forces: NDArray[np.bool_]
) -> Floats:
    """(S, M, Q) fall of speed by shares of the weight that act from the onset on.

    Args:
        shares: (S, M, Q). forces: (Q,) those that the brakes bring, which build up with the lag.
    """
    step = (table.time[:, 1:2] - table.time[:, :1])[:, :, None]
    total = np.zeros_like(shares)
    np.cumsum(0.5 * (shares[:, 1:] + shares[:, :-1]) * step, axis=1, out=total[:, 1:])
    place = np.clip((hypothesis.dead_time - table.time[:, 0]) / step[:, 0, 0], 0.0, None)
    left = np.minimum(place.astype(np.int64), shares.shape[1] - 2)
    share = (place - left)[:, None]
    rows = np.arange(len(left))
    at_onset = (1.0 - share) * total[rows, left] + share * total[rows, left + 1]
    after = (table.time > hypothesis.dead_time)[:, :, None]
    result: Floats = np.where(after, total - at_onset[:, None, :], 0.0)
    lag = lag_of(hypothesis)
    if lag > 0.0 and forces.any():
        since = np.maximum(table.time - hypothesis.dead_time, 0.0)[:, :, None]
        result[:, :, forces] -= lag * lagged(shares[:, :, forces], since, lag)
    return GRAVITY * result


def lag_of(hypothesis: Hypothesis) -> float:
    """Time constant with which the force builds up [s], 0 without."""
    return effects.motion((*hypothesis.model.effect, *hypothesis.added)).lag


def at_time(values: Floats, t: Floats, when: float) -> Floats:
    """(S,) values on an even grid, linear in between."""
    step = t[:, 1] - t[:, 0]
    place = np.clip((when - t[:, 0]) / step, 0.0, t.shape[1] - 1.000001)
    left = place.astype(np.int64)
    share = place - left
    rows = np.arange(len(t))
    result: Floats = (1.0 - share) * values[rows, left] + share * values[rows, left + 1]
    return result


def heat(table: StopTable, tau: float, speed: Floats, time: Floats, onset: float) -> Floats:
    """(S, M) brake heat per mass q [J/kg]: power of the braking force less cooling.

    The power is that which each stop shows by itself, so that q does not depend on what it does.
    """
    tau = max(tau, _LEAST_COOLING)
    step = time[:, 1:2] - time[:, :1]
    power = GRAVITY * np.maximum(table.force, 0.0)[:, None] * speed * (time > onset)
    # q' = power − q/τ solved with its factor e^(t/τ); stops are short beside τ.
    factor = np.exp((time - time[:, :1]) / tau)
    driven = power * factor
    within = np.zeros_like(power)
    np.cumsum(0.5 * (driven[:, 1:] + driven[:, :-1]) * step, axis=1, out=within[:, 1:])
    within /= factor
    before = _heat_before(table, tau, time[:, -1], within[:, -1])
    return before[:, None] * np.exp(-np.maximum(time, 0.0) / tau) + within


def _heat_before(table: StopTable, tau: float, end: Floats, within: Floats) -> Floats:
    """(S,) heat at each stop command by the stops before it [J/kg].

    Args:
        end: (S,) of each stop since its command [s]. within: (S,) heat that it brings itself.
    """
    if table.warmed is not None:
        return np.array([sum(e * math.exp(-ago / tau) for ago, e in w) for w in table.warmed])
    events = [(float(c), i) for i, c in enumerate(table.clock)]
    events += [(clock, -1 - j) for j, (clock, _) in enumerate(table.cooled)]
    before = np.zeros(len(table))
    q, since = 0.0, -math.inf
    for clock, i in sorted(events):
        q *= math.exp(-min(max(clock - since, 0.0) / tau, 700.0))
        since = clock
        if i < 0:
            q += table.cooled[-1 - i][1]
            continue
        before[i] = q
        rest = max(float(end[i]), 0.0)
        q, since = q * math.exp(-rest / tau) + float(within[i]), clock + rest
    return before


def simulate(
    table: StopTable, hypothesis: Hypothesis, speed: Floats, time: Floats
) -> tuple[Floats, Floats]:
    """Speed and way by the hypothesis alone, on the ground that lies along the measured way.

    Args:
        table: stops. hypothesis: what to believe.
        speed: (S,) at the command [m/s], held before it. time: (S, M) even steps since it [s].

    Returns:
        (S, M) speed, not below 0 [m/s]; (S, M) station since the command [m].
    """
    step = time[:, 1:2] - time[:, :1]
    v = np.repeat(speed[:, None], time.shape[1], axis=1)

    def way_of(v: Floats) -> Floats:
        way = np.zeros_like(v)
        np.cumsum(0.5 * (v[:, 1:] + v[:, :-1]) * step, axis=1, out=way[:, 1:])
        return way + speed[:, None] * np.minimum(time[:, :1], 0.0)

    for _ in range(_SWEEPS):
        way = way_of(v)
        fall = predict(table, hypothesis, v, _along(table, way), time)
        again = np.maximum(speed[:, None] - fall, 0.0)
        same = float(np.max(np.abs(again - v))) < _SAME
        v = again
        if same:
            break
    v = np.where(np.minimum.accumulate(v, axis=1) > 0.0, v, 0.0)
    return v, way_of(v)


def as_output(table: StopTable, hypothesis: Hypothesis) -> StopTable:
    """The table with the speeds that the hypothesis gives, for a fit to its output."""
    speed, _ = simulate(table, hypothesis, table.held, table.time)
    return replace(table, speed=speed)


def _along(table: StopTable, way: Floats) -> Ground:
    """Ground at stations; beyond the last one known it goes on as it was."""

    def at_stations(channel: Floats) -> Floats:
        rows = zip(way, table.station, channel, strict=True)
        return np.stack([np.interp(w, s, c) for w, s, c in rows])

    return Ground(*map(at_stations, ground_of(table)))
