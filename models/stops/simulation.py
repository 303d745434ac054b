"""Forward simulation of stops: the braking model with its effects, integrated in time.

The slow reference of the emergency stop: scipy's adaptive integrator in time, with the ground
looked up at every step. With the planner's bound (:mod:`slopewise.planner.bounds`), which
marches over distance, and with its verifier (:mod:`slopewise.planner.verify`) it shares the laws of
:mod:`slopewise.models.laws` and :mod:`slopewise.models.effects` and nothing else: neither
integration nor terrain nor the linear bounds of the force. It replays the stops of a drive log, so
that model and measurement can be compared.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from slopewise.models.arrays import Floats
from slopewise.models.effects import registry
from slopewise.models.effects.brake_fade import remaining_share
from slopewise.models.effects.effect_law import Place
from slopewise.models.laws import braking, crest, wheel_lockup
from slopewise.models.parameters import Braking, Model
from slopewise.models.quantity import GRAVITY

_PLACE = ("grade", "roll", "yaw", "curvature", "x", "y")

MAX_STOP_TIME = 120.0  # a vehicle that still rolls after that time does not stop [s]
_AVERAGED = 0.2  # time before the stop command over which the speed is averaged [s]
_MIN_SPEED = 0.05  # speed below which a stop command has nothing to stop [m/s]


@dataclass(frozen=True, slots=True)
class GroundTrack:
    """Ground along a path, linear between n points and constant beyond them.

    Attributes:
        station: (n,) increasing [m].
        grade, roll, yaw: (n,) [rad]. curvature: (n,) [1/m]. x, y: (n,) map coordinates [m].
        grade_change: (n,) change of the grade along the ground [1/m]; by default that of `grade`.
    """

    station: Floats
    grade: Floats
    roll: Floats
    yaw: Floats
    curvature: Floats
    x: Floats
    y: Floats
    grade_change: Floats | None = None

    @classmethod
    def of_grade(cls, grade: float) -> GroundTrack:
        """A straight path on an endless plane of one grade [rad]."""
        zero = np.zeros(1)
        return cls(zero, np.array([grade]), zero, zero, zero, zero, zero)

    def interpolator(self) -> Callable[[float], dict[str, float]]:
        """A function of the station [m] that interpolates grade, roll, yaw, curvature, x and y."""
        rows = np.column_stack([getattr(self, name) for name in _PLACE]).tolist()
        stations, last = self.station.tolist(), len(rows) - 1

        def at(station: float) -> dict[str, float]:
            i = bisect_right(stations, station) - 1
            if 0 <= i < last:
                beyond = station - stations[i]
                per = 1.0 / (stations[i + 1] - stations[i])
                row = [
                    a + (b - a) * per * beyond for a, b in zip(rows[i], rows[i + 1], strict=True)
                ]
            else:
                row = rows[min(max(i, 0), last)]
            return dict(zip(_PLACE, row, strict=True))

        return at

    def vertical_curvature(self, station: float) -> float:
        """Vertical curvature dθ/ds at a station, by default that of its segment [1/m]."""
        if self.grade_change is not None:
            return float(np.interp(station, self.station, self.grade_change))
        if len(self.station) < 2 or not self.station[0] <= station <= self.station[-1]:
            return 0.0
        i = int(np.searchsorted(self.station, station, "right")) - 1
        i = min(max(i, 0), len(self.station) - 2)
        rise = float(self.grade[i + 1] - self.grade[i])
        return rise / float(self.station[i + 1] - self.station[i])


@dataclass(frozen=True, slots=True)
class SimulatedStop:
    """One simulated stop, from the stop command on.

    Attributes:
        time: (n,) since the stop command [s]; station: (n,) [m]; speed: (n,) [m/s].
        stopped: False if it still rolled at the end of the integration.
        distance: from the command to standstill, without safety offset [m]; inf if it never stops.
        heat: brake heat per mass at the end [J/kg].
    """

    time: Floats
    station: Floats
    speed: Floats
    stopped: bool
    distance: float
    heat: float = 0.0

    def speed_at(self, time: Floats) -> Floats:
        """Speed at times since the command, 0 after standstill [m/s]."""
        right = 0.0 if self.stopped else float(self.speed[-1])
        return np.interp(time, self.time, self.speed, right=right)


def force_law(
    model: Model,
    on: Braking,
    onset_speed: float,
    session_time: float = 0.0,
    level: float | None = None,
) -> Callable[[dict[str, float]], float]:
    """F_b/W with surface, brake level and effects, of a place of :meth:`GroundTrack.interpolator`.

    Args:
        model: effects and motion resistance.
        on: braking model of the surface.
        onset_speed: v_i; below the trained range the coefficients at its lower end hold [m/s].
        session_time: [s]. level: share of full application, that of the model by default.
    """
    speed, share = max(onset_speed, on.speed_range[0]), on.share_at(level)
    rolling, scale = model.terrain.rolling_while_braking, registry.force_scale(model.effect)
    on_ground = list(filter(registry.has_ground_term, model.effect))

    def at(place: dict[str, float]) -> float:
        grade = place["grade"]
        slope = on.uphill if on.uphill is not None and grade > 0.0 else on
        force = braking.force_ratio(grade, speed, slope.m_m, slope.b_m, on.m_b, on.b_b)
        force = braking.force_ratio_at_level(force, rolling, share) * scale
        if on_ground:
            here = Place(grade, place["roll"], place["x"], place["y"], place["yaw"], session_time)
            force += registry.ground_term(on_ground, here)
        return float(force)

    return at


def simulate_stop(
    model: Model,
    track: GroundTrack,
    speed: float,
    *,
    station: float = 0.0,
    surface: str = "",
    session_time: float = 0.0,
    heat: float = 0.0,
    level: float | None = None,
) -> SimulatedStop:
    """Dead time at held speed, then braking with the coefficients of the speed at onset.

    Args:
        model: one model file.
        track: ground along the path.
        speed: at the stop command [m/s].
        station: station of the stop command [m].
        surface: named surface, "" for the base.
        session_time: since the session began [s]. heat: brake heat per mass now [J/kg].
        level: share of full brake application, that of the model by default.

    Source: Braking (2), (7), (8), (12) along a varying slope; effects as in
        `slopewise.models.effects.registry`.
    """
    on = model.braking.on(surface)
    motion = registry.motion(model.effect, on.sliding_friction, heat)
    onset = station + speed * on.dead_time
    crests = registry.crest_share(model.effect)
    ground_at = track.interpolator()
    force_at = force_law(model, on, speed, session_time, level)

    def rates(_: float, state: Floats) -> list[float]:
        s, v, f, q = state.tolist()
        place = ground_at(s)
        demanded = force_at(place)
        force = f if motion.lag > 0.0 else demanded
        force *= remaining_share(max(q, 0.0), motion.fade, motion.fade_tau)
        if math.isfinite(motion.friction):
            cap = wheel_lockup.friction_cap(place["grade"], place["roll"], motion.friction)
            force = min(force, float(cap))
        rolling = max(v, 0.0)
        if crests is not None:
            force *= float(crest.remaining_force(rolling, track.vertical_curvature(s), crests))
        decel = float(braking.deceleration(force, place["grade"]))
        if motion.moves:
            turn, yaw = place["curvature"], place["yaw"]
            decel += registry.motion_deceleration(rolling, turn, yaw, motion)
        growth = (demanded - f) / motion.lag if motion.lag > 0.0 else 0.0
        return [v, -decel, growth, GRAVITY * max(force, 0.0) * rolling - q / motion.fade_tau]

    def standstill(_: float, state: Floats) -> float:
        return float(state[1])

    standstill.terminal = True  # type: ignore[attr-defined]
    standstill.direction = -1.0  # type: ignore[attr-defined]
    result = solve_ivp(
        rates,
        (0.0, MAX_STOP_TIME),
        [onset, speed, 0.0, heat],
        events=standstill,
        rtol=1e-7,
        atol=1e-9,
        max_step=0.05,
    )
    stopped = result.status == 1
    time = np.concatenate(([0.0], result.t + on.dead_time))
    stations = np.concatenate(([station], result.y[0]))
    speeds = np.concatenate(([speed], np.maximum(result.y[1], 0.0)))
    distance = float(stations[-1] - station) if stopped else math.inf
    return SimulatedStop(time, stations, speeds, stopped, distance, float(result.y[3][-1]))


def stop_commands(time: Floats, speed: Floats, command: Floats) -> list[int]:
    """Samples at which a rolling vehicle receives a stop command.

    Args:
        time, speed, command: (n,) samples of one run [s], [m/s], [m/s]; command 0 means stop.
    """
    is_stop = command <= 0.0
    starts = np.flatnonzero(is_stop & ~np.concatenate(([False], is_stop[:-1])))
    return [int(i) for i in starts if _command_speed(time, speed, int(i)) > _MIN_SPEED]


def _command_speed(time: Floats, speed: Floats, i: int) -> float:
    """Mean speed just before a stop command at sample i [m/s]."""
    window = (time >= time[i] - _AVERAGED) & (time <= time[i])
    return float(np.mean(speed[window]))


@dataclass(frozen=True, slots=True, kw_only=True)
class RunChannels:
    """Channels of one run of a drive log, n samples; missing channels are None.

    Attributes:
        time: [s]. speed, command: measured and commanded [m/s]. pitch: nose down positive [rad].
        roll, yaw: [rad]. yaw_rate: [rad/s]. x, y: map coordinates [m]. brake: application, 0..1.
        vertical_curvature: change of grade along the ground [1/m]; by default that of the pitch.
    """

    time: Floats
    speed: Floats
    command: Floats
    pitch: Floats
    roll: Floats | None = None
    yaw: Floats | None = None
    yaw_rate: Floats | None = None
    x: Floats | None = None
    y: Floats | None = None
    brake: Floats | None = None
    vertical_curvature: Floats | None = None

    def track(self) -> GroundTrack:
        """The ground under the run; flat and straight where the channel is missing."""
        v, zero = self.speed, np.zeros_like(self.time)
        steps = 0.5 * np.maximum(v[1:] + v[:-1], 0.0) * np.diff(self.time)
        station = np.concatenate(([0.0], np.cumsum(steps)))
        optional = (self.roll, self.yaw, self.x, self.y, self.yaw_rate)
        roll, yaw, x, y, rate = (zero if values is None else values for values in optional)
        turn = np.divide(rate, v, out=np.zeros_like(rate), where=v > 0.3)
        return GroundTrack(station, -self.pitch, roll, yaw, turn, x, y, self.vertical_curvature)

    def level(self, begin: int, end: int) -> float | None:
        """Brake level that a stop was driven with; None where the log lacks it."""
        if self.brake is None:
            return None
        applied = self.brake[begin:end]
        applied = applied[applied > 0.0]
        return float(np.clip(np.median(applied), 0.05, 1.0)) if len(applied) else None


def replay(model: Model, run: RunChannels, surface: str = "") -> Floats:
    """Speed that the model gives for the commands of one run.

    From each stop command the model drives until the next command to move. In between it is
    undefined, and the simulation follows the measurement.

    Returns:
        (n,) simulated speed [m/s].

    The grade is −pitch of the body, which dives under braking: up to about 1° too steep downhill.
    """
    time, speed = run.time, run.speed
    track = run.track()
    simulated = speed.copy()
    moving = run.command > 0.0
    cooling = registry.motion(model.effect).fade_tau
    heat, cooled_since = 0.0, float(time[0])
    for i in stop_commands(time, speed, run.command):
        again = np.flatnonzero(moving[i:])
        end = i + int(again[0]) if len(again) else len(time)
        heat *= math.exp(-(float(time[i]) - cooled_since) / cooling)
        stop = simulate_stop(
            model,
            track,
            _command_speed(time, speed, i),
            station=float(track.station[i]),
            surface=surface,
            session_time=float(time[i]),
            heat=heat,
            level=run.level(i, end),
        )
        simulated[i:end] = stop.speed_at(time[i:end] - time[i])
        heat, cooled_since = stop.heat, float(time[i]) + float(stop.time[-1])
    return simulated
