"""Speeds of all stops that a hypothesis gives, on the grid of a stop table.

Nothing is differentiated: v(t) = v_i − ∫ a dt from the onset on. In integral form the speed in the
terms of motion is the measured one, so that what is linear stays linear; as output the speed is the
prediction's own, found by repeating the integral until it stays (:func:`simulate`).

Source: Braking (2), (7), (8) with the effects of :mod:`slopewise.models.effects.registry`.
"""

from __future__ import annotations

import numpy as np

from slopewise.models.arrays import Elementwise, Floats
from slopewise.models.discrepancy.data.stop_table import GROUND, StopGround, StopTable
from slopewise.models.discrepancy.model.brakes import brought_force, heat, motion_of
from slopewise.models.discrepancy.model.hypothesis import MAX_STEPS, Hypothesis
from slopewise.models.effects import registry
from slopewise.models.effects.effect_law import Enters, Place
from slopewise.models.effects.registry import LAWS
from slopewise.models.effects.stops_seen import StopsSeen
from slopewise.models.laws import braking
from slopewise.models.parameters import Effect
from slopewise.models.quantity import GRAVITY

_MIN_TURNING_SPEED = 0.3  # below which a yaw rate makes no larger curvature [m/s]
_SAME_SPEED = 1e-5  # change of a simulated speed that is negligible [m/s]


def predict(
    table: StopTable,
    hypothesis: Hypothesis,
    speed: Floats | None = None,
    ground: StopGround | None = None,
    time: Floats | None = None,
) -> Floats:
    """(S, M) fall of the speed since the command [m/s], 0 before the onset.

    Args:
        table: stops. hypothesis: model and effects.
        speed, ground, time: (S, M) in place of those measured.
    """
    v = table.speed if speed is None else np.maximum(speed, 0.0)
    t = table.time if time is None else time
    place: StopGround = table if ground is None else ground
    terms = motion_of(hypothesis)
    demanded = demanded_force(table, hypothesis, place)
    step = t[:, 1:2] - t[:, :1]
    brought = brought_force(table, hypothesis, demanded, v, place, t)
    rest = np.sin(place.grade) + brought.given - brought.force
    rest = rest + moved_share(v, place, terms)
    fall = _since_onset(demanded + rest, step, t, hypothesis.dead_time)
    if terms.lag > 0.0:  # ∫f = ∫F − τ f, from τ df/dt = F − f
        fall = fall - terms.lag * brought.force
    return GRAVITY * fall


def moved_share(speed: Floats, place: StopGround, terms: registry.MotionTerms) -> Elementwise:
    """Deceleration by terms of motion, share of the weight."""
    if not terms.moves:
        return 0.0
    curvature = np.abs(place.yaw_rate) / np.maximum(speed, _MIN_TURNING_SPEED)
    return registry.motion_deceleration(speed, curvature, place.yaw, terms) / GRAVITY


def demanded_force(table: StopTable, hypothesis: Hypothesis, place: StopGround) -> Floats:
    """(S, M) F_b/W before lag, fade and the friction cap of all ground."""
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
            (m + shift_m[rows]) * here + b + shift_b[rows],
            model.terrain.rolling_while_braking,
            on.share_at(),
        )
    force = force * registry.force_scale(model.effect)
    lasting = [e for e in hypothesis.added if LAWS[e.name].enters is Enters.LASTING]
    everywhere = (*model.effect, *(e for e in hypothesis.added if e not in lasting))
    for effect in lasting:
        values = registry.validate(effect)
        changed = (table.run >= values["run"])[:, None]
        force = np.where(changed, LAWS[effect.name].law(force, *values.values()), force)
    for effect in filter(registry.has_ground_term, everywhere):
        force = force + _force_of(table, effect, place)
    return force


def _force_of(table: StopTable, effect: Effect, place: StopGround) -> Floats:
    """(S, M) what an effect of the ground adds to the demanded F_b/W; 0 of others."""
    here = Place(place.grade, place.roll, place.x, place.y, place.yaw, table.session_time[:, None])
    along = LAWS[effect.name].along
    if along is not None:
        added: Floats = along(here, *registry.validate(effect).values())
        return added
    term: Floats = registry.ground_term([effect], here)
    return term


def _lines(c: Floats, speed: Floats) -> tuple[Floats, Floats]:
    """Slope and level force at onset speeds. Source: Braking (7), (8)."""
    return c[0] * speed + c[1], c[2] * speed + c[3]


def _since_onset(values: Floats, step: Floats, t: Floats, onset: float) -> Floats:
    """(S, M) integral over time from the onset on, smooth in the onset."""
    total = np.zeros_like(values)
    np.cumsum(0.5 * (values[:, 1:] + values[:, :-1]) * step, axis=1, out=total[:, 1:])
    at_onset = at_time(total, t, onset)[:, None]
    return np.where(t > onset, total - at_onset, 0.0)


def at_time(values: Floats, t: Floats, when: float) -> Floats:
    """(S, …) values (S, M, …) on an even grid, at a time of all stops [s]."""
    step = t[:, 1] - t[:, 0]
    place = np.clip((when - t[:, 0]) / step, 0.0, t.shape[1] - 1.000001)
    left = place.astype(np.int64)
    share = (place - left).reshape(-1, *(1,) * (values.ndim - 2))
    rows = np.arange(len(t))
    return (1.0 - share) * values[rows, left] + share * values[rows, left + 1]


def simulate(
    table: StopTable, hypothesis: Hypothesis, speed: Floats, time: Floats
) -> tuple[Floats, Floats]:
    """Speed and way by the hypothesis alone, on the ground that lies along the measured way.

    Args:
        table: stops. hypothesis: model and effects.
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

    for _ in range(MAX_STEPS):
        way = way_of(v)
        fall = predict(table, hypothesis, v, _along(table, way), time)
        again = np.maximum(speed[:, None] - fall, 0.0)
        same = float(np.max(np.abs(again - v))) < _SAME_SPEED
        v = again
        if same:
            break
    v = np.where(np.minimum.accumulate(v, axis=1) > 0.0, v, 0.0)
    return v, way_of(v)


def _along(table: StopTable, way: Floats) -> StopGround:
    """Ground at stations; constant beyond the last known one."""
    known = table.station
    rows = zip(known, way, strict=True)
    behind = np.stack([np.searchsorted(s, w, side="right") for s, w in rows]) - 1
    behind = np.clip(behind, 0, known.shape[1] - 2)
    start, end = (np.take_along_axis(known, behind + i, axis=1) for i in (0, 1))
    share = np.clip((way - start) / np.maximum(end - start, 1e-12), 0.0, 1.0)

    def at_stations(channel: Floats) -> Floats:
        first = np.take_along_axis(channel, behind, axis=1)
        there: Floats = first + share * (np.take_along_axis(channel, behind + 1, axis=1) - first)
        return there

    return StopGround(*(at_stations(getattr(table, name)) for name in GROUND))


def stops_seen(table: StopTable, hypothesis: Hypothesis) -> StopsSeen:
    """Stops as effects see them, at the forces of a hypothesis."""
    demanded = demanded_force(table, hypothesis, table)
    brought = brought_force(table, hypothesis, demanded, table.speed, table, table.time)

    def heat_of(tau: float) -> Floats:
        return heat(table, tau, table.speed, table.time, hypothesis.dead_time)

    return StopsSeen(
        speed=table.speed,
        **{name: getattr(table, name) for name in GROUND},
        clock=table.session_time,
        run=table.run,
        demanded=demanded,
        built=brought.force,
        given=brought.given,
        passes=brought.passes,
        heat=heat_of,
    )
