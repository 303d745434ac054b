"""An independent judge of finished speed plans.

It answers one question: can the vehicle, from every station of a plan, always still stop before the
clear distance, on known ground, without tipping? It shares no code with the planner: it knows only
the columns of a plan, the tables of a model file and the free body, and it integrates the emergency
stops in time where the planner works in stations.

Conventions: SI and radians; grade uphill positive; roll left-side-up positive; curvature positive
to the left; a deceleration is positive while slowing.
"""

from __future__ import annotations

import csv
import math
import tomllib
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.integrate import solve_ivp

G = 9.80665
TEXT_COLUMNS = ("candidate", "limiting", "status", "reason")
NUMBER_COLUMNS = (
    *("station", "x", "y", "z", "grade", "roll", "curvature", "speed", "accel", "time"),
    *("speed_bound", "stop_distance", "clear_distance", "rear_load"),
)
STATUSES = ("ok", "blocked", "infeasible", "degraded")
END_SLACK = 0.05  # m past the last station that is still integrated, on the last values
GIVE_UP = 60.0  # s after which a stop that creeps on counts as none
DISTANCE_AGREES = 2e-3  # m between the reported and the own stopping distance
CREST_AGREES = 1e-1  # by so much a reported share may be lower, for the crests between stations
LOAD_AGREES = 1e-3  # between the reported and the own rear load share

Columns = Mapping[str, np.ndarray]
Values = Any  # a float or an array of floats: the laws below are elementwise


@dataclass(frozen=True)
class Violation:
    """One broken rule: where, which, by how much (in the rule's own unit) and in words."""

    candidate: str
    station: float
    kind: str
    amount: float
    text: str


@dataclass(frozen=True)
class Stop:
    """One emergency stop. Loads are least shares of the level static load along the stop."""

    stop_station: float  # where the vehicle comes to rest, without the distance offset
    distance: float  # with the distance offset; inf if it does not come to rest
    rear_load: float
    side_load: float
    front_load: float
    stopped: bool  # at rest before the end of the plan's stations


@dataclass(frozen=True)
class Stops:
    """Many emergency stops: the fields of :class:`Stop` as arrays (M,)."""

    stop_station: np.ndarray
    distance: np.ndarray
    rear_load: np.ndarray
    side_load: np.ndarray
    front_load: np.ndarray
    stopped: np.ndarray

    def __getitem__(self, i: int) -> Stop:
        return Stop(*(getattr(self, f.name)[i].item() for f in fields(self)))


def read_plan(path: str | Path) -> dict[str, dict[str, np.ndarray]]:
    """The columns of every candidate of a plan CSV; an empty number is NaN."""
    rows: dict[str, list[dict[str, str]]] = {}
    with open(path, newline="", encoding="utf-8") as file:
        reader = csv.DictReader(file)
        missing = {*TEXT_COLUMNS, *NUMBER_COLUMNS} - set(reader.fieldnames or ())
        if missing:
            raise ValueError(f"{path}: no column {', '.join(sorted(missing))}")
        for row in reader:
            rows.setdefault(row["candidate"], []).append(row)

    def column(name: str, of: list[dict[str, str]]) -> np.ndarray:
        if name in TEXT_COLUMNS:
            return np.array([row[name] for row in of], dtype=object)
        return np.array([float(row[name] or "nan") for row in of])

    names = (*TEXT_COLUMNS, *NUMBER_COLUMNS)
    return {key: {name: column(name, of) for name in names} for key, of in rows.items()}


def read_model(path: str | Path) -> dict[str, Any]:
    """A model file as plain tables."""
    with open(path, "rb") as file:
        return tomllib.load(file)


# ------------------------------------------------------------------------------- the ground


class Here(NamedTuple):
    """The ground at one place or at many, linear in station between the plan's rows."""

    grade: Values
    roll: Values
    curvature: Values
    heading: Values
    x: Values
    y: Values
    segment: Values


class Ground:
    """The known ground along one candidate; it ends before the first row that is not finite."""

    def __init__(self, columns: Columns) -> None:
        station = np.asarray(columns["station"], float)
        zero = np.zeros_like(station)
        x, y = (np.asarray(columns.get(name, zero), float) for name in "xy")
        rows = [np.asarray(columns[name], float) for name in ("grade", "roll", "curvature")]
        known = np.isfinite(np.vstack([station, x, y, *rows])).all(axis=0)
        n = len(known) if known.all() else int(np.argmin(known))
        if n < 2:
            raise ValueError("a plan needs at least two known stations")
        station, x, y = station[:n], x[:n], y[:n]
        if np.any(np.diff(station) < 0.0):
            raise ValueError("stations decrease")
        self.station = station
        self.table = np.column_stack([*(row[:n] for row in rows), _heading(x, y), x, y])
        step = np.diff(station)[:, None]
        self.slope = np.divide(
            np.diff(self.table, axis=0), step, out=np.zeros((n - 1, 6)), where=step > 0.0
        )
        self.end = float(station[-1])
        self._both = np.hstack([self.table[:-1], self.slope])
        self._station, self._table = station.tolist(), self.table.tolist()
        self._slope = self.slope.tolist()

    def at(self, s: np.ndarray) -> Here:
        """The ground at many stations."""
        last = len(self.station) - 2
        k = np.minimum(np.maximum(self.station.searchsorted(s, "right") - 1, 0), last)
        inside = np.minimum(np.maximum(s, self._station[0]), self.end) - self.station.take(k)
        both = self._both.take(k, axis=0).T
        return Here(*(both[:6] + inside * both[6:]), k)

    def at_one(self, s: float) -> Here:
        """The ground at one station."""
        k = min(max(bisect_right(self._station, s) - 1, 0), len(self._station) - 2)
        inside = min(max(s, self._station[0]), self.end) - self._station[k]
        row, slope = self._table[k], self._slope[k]
        return Here(*[value + inside * m for value, m in zip(row, slope, strict=True)], k)

    def breaks(self, patches: Sequence[Mapping[str, float]], grades: Sequence[float]) -> np.ndarray:
        """Stations where a law may kink or jump: rows, changes of sign, edges of patches."""
        found = [self.station]
        for column, level in [(0, 0.0), (1, 0.0), (2, 0.0), *((0, grade) for grade in grades)]:
            slope = self.slope[:, column]
            inside = np.divide(
                level - self.table[:-1, column],
                slope,
                out=np.full_like(slope, -1.0),
                where=slope != 0.0,
            )
            found.append(self._within(inside))
        for patch in patches:
            place = self.table[:-1, 4:] - (patch["x"], patch["y"])
            along = self.slope[:, 4:]
            a, b = (along**2).sum(axis=1), (place * along).sum(axis=1)
            c = (place**2).sum(axis=1) - patch["radius"] ** 2
            root = np.sqrt(np.maximum(b**2 - a * c, 0.0))
            for sign in (-1.0, 1.0):
                inside = np.divide(
                    -b + sign * root,
                    a,
                    out=np.full_like(a, -1.0),
                    where=(a > 0.0) & (b**2 > a * c),
                )
                found.append(self._within(inside))
        return np.unique(np.concatenate(found))

    def _within(self, inside: np.ndarray) -> np.ndarray:
        hit = (inside > 0.0) & (inside < np.diff(self.station))
        return (self.station[:-1] + inside)[hit]


def _heading(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Direction of travel at each point of a polyline, from differences of second order."""
    step = np.hypot(np.diff(x), np.diff(y))
    kept = np.concatenate([[True], step > 0.0])
    along = np.concatenate([[0.0], np.cumsum(step)])
    if kept.sum() < 2:
        return np.zeros_like(x)
    order = 2 if kept.sum() > 2 else 1
    dx, dy = (np.gradient(part[kept], along[kept], edge_order=order) for part in (x, y))
    return np.interp(along, along[kept], np.unwrap(np.arctan2(dy, dx)))


# ------------------------------------------------------------------------------ the effects

Term = Callable[[Mapping[str, float], Here, Values], Values]


def _headwind(p: Mapping[str, float], here: Here, v: Values) -> Values:
    u = v + p["wind"] * np.cos(here.heading - p["direction"])
    return p["c"] * (abs(u) * u - v * v)


FORCE_TERMS: dict[str, Term] = {  # added to F_b/W
    "grade_asymmetry": lambda p, here, v: p["k"] * 0.5 * (here.grade + abs(here.grade)),
    "grade_nonlinearity": lambda p, here, v: p["k"] * here.grade * abs(here.grade),
    "cross_slope": lambda p, here, v: p["k"] * abs(here.roll),
    "surface_patch": lambda p, here, v: (
        p["delta"] * ((here.x - p["x"]) ** 2 + (here.y - p["y"]) ** 2 <= p["radius"] ** 2)
    ),
    "directional_surface": lambda p, here, v: (
        p["k"] * np.cos(2.0 * (here.heading - p["direction"]))
    ),
    "step_change": lambda p, here, v: p.get("delta", 0.0),
}
DECELERATION_TERMS: dict[str, Term] = {  # added to the deceleration
    "aerodynamic_drag": lambda p, here, v: p["c"] * v * v,
    "headwind": _headwind,
    "viscous_resistance": lambda p, here, v: G * p["c"] * v,
    "turning_resistance": lambda p, here, v: G * p["k"] * abs(here.curvature) * v,
}
STATE_EFFECTS = (
    "brake_lag",
    "brake_fade",
    "wheel_lockup",
    "crest_unloading",
)  # change the force, one each


class Coefficients(NamedTuple):
    """The braking model on one surface."""

    m_m: Values
    b_m: Values
    up_m_m: Values
    up_b_m: Values
    m_b: Values
    b_b: Values
    friction: Values  # inf: no cap
    slowest: Values
    fastest: Values
    flattest: Values  # ends of the grade range
    steepest: Values
    dead_time: Values
    offset: Values


def _coefficients(braking: Mapping[str, Any], surface: str | None) -> Coefficients:
    table = {**braking, **braking.get("terrain", {}).get(surface, {})}
    uphill = table.get("uphill", {})
    return Coefficients(
        m_m=table["m_m"],
        b_m=table["b_m"],
        up_m_m=uphill.get("m_m", table["m_m"]),
        up_b_m=uphill.get("b_m", table["b_m"]),
        m_b=table["m_b"],
        b_b=table["b_b"],
        friction=table.get("sliding_friction", math.inf),
        slowest=table["speed_range"][0],
        fastest=table["speed_range"][1],
        flattest=table["grade_range"][0],
        steepest=table["grade_range"][1],
        dead_time=table["dead_time"],
        offset=table.get("distance_offset", 0.0),
    )


class Law:
    """How hard the vehicle brakes and what its wheels carry, on one candidate's ground."""

    def __init__(
        self,
        columns: Columns,
        model: Mapping[str, Any],
        surface: Sequence[str] | None = None,
        effects: bool = True,
    ) -> None:
        self.ground = Ground(columns)
        self.vehicle, self.limits = model["vehicle"], model["limits"]
        braking = model["braking"]
        self.resistance = model["terrain"]["motion_resistance"]
        self.level = braking.get("level", 1.0)
        self.extrapolate = bool(braking.get("extrapolate", False))
        self.margin = braking.get("extrapolation_margin", 0.0) if self.extrapolate else 0.0
        names = [None] * len(self.ground.station) if surface is None else list(surface)
        if len(names) < len(self.ground.station):
            raise ValueError("a surface for every station is needed")
        distinct = list(dict.fromkeys(names))
        self.code = np.array([distinct.index(name) for name in names])
        self.rows = [_coefficients(braking, name) for name in distinct]
        self.matrix = np.array(self.rows, float)
        self.uphill = any((c.up_m_m, c.up_b_m) != (c.m_m, c.b_m) for c in self.rows)
        self._take_effects(model.get("effect", ()) if effects else ())
        self.slips = math.isfinite(min(self.lockup, *(c.friction for c in self.rows)))
        grades = (*self.matrix[:, 9], *self.matrix[:, 10]) if self.margin else ()
        self.breaks = self.ground.breaks(self.patches, grades)

    def _take_effects(self, effects: Sequence[Mapping[str, Any]]) -> None:
        self.force_terms: list[tuple[Term, Mapping[str, float]]] = []
        self.deceleration_terms: list[tuple[Term, Mapping[str, float]]] = []
        self.patches: list[Mapping[str, float]] = []
        self.scale, self.lag, self.fade, self.lockup = 1.0, 0.0, 0.0, math.inf
        self.cooling = math.inf
        self.crests: list[float] = []
        for effect in effects:
            name, p = effect["name"], effect["parameters"]
            if name in FORCE_TERMS:
                self.force_terms.append((FORCE_TERMS[name], p))
            elif name in DECELERATION_TERMS:
                self.deceleration_terms.append((DECELERATION_TERMS[name], p))
            elif name not in STATE_EFFECTS:
                raise ValueError(f"no judgement on a model with the effect {name!r}")
            if name == "surface_patch":
                self.patches.append(p)
            elif name == "step_change":
                self.scale *= p.get("scale", 1.0)
            elif name == "brake_lag":
                self.lag = p["tau"]
            elif name == "brake_fade":
                self.fade, self.cooling = p["k"], p["tau"]
            elif name == "crest_unloading":
                self.crests.append(p["k"])
            elif name == "wheel_lockup":
                self.lockup = min(self.lockup, p["mu"])

    def sides(self, segment: Values) -> tuple[Coefficients, ...]:
        """The surfaces a segment may have: those of its two ends, once if they are the same."""
        if len(self.rows) == 1:
            return (self.rows[0],)
        if np.ndim(segment) == 0:
            a, b = self.code[segment], self.code[segment + 1]
            return (self.rows[a],) if a == b else (self.rows[a], self.rows[b])
        ends = (self.code[segment], self.code[segment + 1])
        return tuple(Coefficients(*self.matrix[end].T) for end in ends)

    def at_start(self, s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Dead time and distance offset of stops from there, the larger of a segment's two."""
        k = self.ground.at(s).segment
        left = self.matrix[self.code[k]][:, 11:]
        right = self.matrix[self.code[k + 1]][:, 11:]
        place = self.ground.station
        left = np.where((s >= place[k + 1])[:, None], right, left)
        right = np.where((s <= place[k])[:, None], left, right)
        worst = np.maximum(left, right)
        return worst[:, 0], worst[:, 1]

    def wanted(self, c: Coefficients, here: Here, v: Values, onset: Values) -> Values:
        """F_b/W of cold brakes, built up, without friction's cap. Source: Braking (7), (8)."""
        grade = here.grade
        v_i = np.maximum(onset, c.slowest)
        if self.uphill:
            up = grade > 0.0
            b_m = up * c.up_b_m + (1 - up) * c.b_m
            m_m = up * c.up_m_m + (1 - up) * c.m_m
        else:
            b_m, m_m = c.b_m, c.m_m
        force = (m_m * v_i + b_m) * grade + (c.m_b * v_i + c.b_b)
        if self.margin:
            force = force * (1.0 - self.margin * ((grade < c.flattest) | (grade > c.steepest)))
        force = self.scale * (self.resistance + self.level * (force - self.resistance))
        for term, parameters in self.force_terms:
            force = force + term(parameters, here, v)
        return force

    def forces(
        self,
        sides: Sequence[Coefficients],
        here: Here,
        v: Values,
        onset: Values,
        f: Values = None,
        q: Values = 0.0,
    ) -> tuple[Values, list[Values]]:
        """F_b/W that the brakes shall build up to, and those that act: one for each surface.

        The build-up f follows the smallest of the surfaces' forces; None is built up already.
        """
        wanted = [self.wanted(c, here, v, onset) for c in sides]
        least = wanted[0] if len(wanted) == 1 else np.min(wanted, axis=0)
        acting = []
        for c, force in zip(sides, wanted, strict=True):
            held = f + (force - least) if self.lag and f is not None else force
            if self.fade:
                held = held / (1.0 + self.fade * q)
            if self.slips:
                normal = np.cos(here.grade) * np.cos(here.roll)
                held = np.minimum(held, np.minimum(c.friction, self.lockup) * normal)
            if self.crests:
                kept = 1.0 - sum(self.crests) * self.lost_load(here, v)
                held = held * np.maximum(kept, 0.0)
            acting.append(held)
        return least, acting

    def lost_load(self, here: Here, v: Values) -> Values:
        """Share of the weight that a crest takes: the ground falls away with v² dθ/ds."""
        return v * v * np.maximum(-self.ground.slope[here.segment, 0], 0.0) / G

    def deceleration(self, here: Here, force: Values, v: Values) -> Values:
        """Deceleration under a braking force. Source: Braking (2), and the effects."""
        a = G * (force + np.sin(here.grade))
        for term, parameters in self.deceleration_terms:
            a = a + term(parameters, here, v)
        return a

    def derivatives(self, y: Sequence[Values], onset: Values, here: Here) -> tuple[Values, ...]:
        """Of station, speed, braking force and heat while braking, on the worse surface."""
        _, v, f, q = y
        return self._derivatives(
            y, here, *self.forces(self.sides(here.segment), here, v, onset, f, q)
        )

    def _derivatives(
        self, y: Sequence[Values], here: Here, target: Values, acting: Sequence[Values]
    ) -> tuple[Values, ...]:
        _, v, f, q = y
        force = acting[0] if len(acting) == 1 else np.min(acting, axis=0)
        build_up = (target - f) / self.lag if self.lag else 0.0 * f
        heat = G * force * v - q / self.cooling if self.fade else 0.0 * q
        return v, -self.deceleration(here, force, v), build_up, heat

    def loads(self, here: Here, a_x: Values, v: Values) -> np.ndarray:
        """Least shares (rear, side, front) at a deceleration a_x. Source: Braking (3), (5)."""
        length, width = self.vehicle["wheelbase"], self.vehicle["track_width"]
        x, z = self.vehicle["cg_x"], self.vehicle["cg_z"]
        cos_grade, cos_roll = np.cos(here.grade), np.cos(here.roll)
        weight = cos_grade * cos_roll
        shift = z * (a_x / G - np.sin(here.grade))
        a_y = v**2 * here.curvature / cos_roll
        aside = 2.0 * z / width * (cos_grade * np.sin(here.roll) + a_y / G)
        rear = ((length - x) * weight - shift) / (length - x)
        loads = np.array([rear, weight - abs(aside), (x * weight + shift) / x])
        loads -= self.lost_load(here, v)
        return loads

    def braking_loads(self, y: np.ndarray, onset: np.ndarray) -> np.ndarray:
        """Least shares (3, M) in the states y (4, M), of either surface where there may be two."""
        return self.rates_and_loads(y, onset)[1]

    def rates_and_loads(self, y: np.ndarray, onset: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Derivatives (4, M) and least shares (3, M), as above, of the same states (4, M)."""
        here = self.ground.at(y[0])
        target, acting = self.forces(self.sides(here.segment), here, y[1], onset, y[2], y[3])
        loads = [self.loads(here, self.deceleration(here, force, y[1]), y[1]) for force in acting]
        least = loads[0] if len(loads) == 1 else np.min(loads, axis=0)
        return np.array(self._derivatives(y, here, target, acting)), least

    def held_loads(self, start: np.ndarray, stop: np.ndarray, v: np.ndarray) -> np.ndarray:
        """Least shares (3, M) from start to stop at held speeds: every break and 16 places more."""
        least = np.full((3, len(start)), np.inf)
        stop = np.minimum(stop, self.ground.end)
        for share in np.linspace(0.0, 1.0, 17):
            here = self.ground.at(start + share * (stop - start))
            least = np.minimum(least, self.loads(here, 0.0, v))
        first = np.searchsorted(self.breaks, start, "right")
        last = np.searchsorted(self.breaks, stop, "left")
        for i in range(int(np.max(last - first, initial=0))):
            lanes = np.flatnonzero(first + i < last)
            here = self.ground.at(self.breaks[first[lanes] + i])
            least[:, lanes] = np.minimum(least[:, lanes], self.loads(here, 0.0, v[lanes]))
        return least


# ------------------------------------------------------------------------ the emergency stop


def emergency_stop(
    station: float,
    speed: float,
    columns: Columns,
    model: Mapping[str, Any],
    *,
    surface: Sequence[str] | None = None,
    effects: bool = True,
) -> Stop:
    """The emergency stop from one station, integrated in time with error control.

    The speed is held over the dead time; then v' = −a with the coefficients of the speed at onset.
    """
    law = Law(columns, model, surface, effects)
    return _stops_ivp(law, np.array([station], float), np.array([speed], float))[0]


def emergency_stops_rk4(
    stations: np.ndarray,
    speeds: np.ndarray,
    columns: Columns,
    model: Mapping[str, Any],
    *,
    surface: Sequence[str] | None = None,
    effects: bool = True,
    dt: float = 2e-3,
) -> Stops:
    """The same stops, all at once, with a classical Runge–Kutta step of at most dt."""
    law = Law(columns, model, surface, effects)
    return _stops_rk4(law, np.asarray(stations, float), np.asarray(speeds, float), dt)


def _finish(
    law: Law, start: np.ndarray, speed: np.ndarray, rest: np.ndarray, least: np.ndarray
) -> Stops:
    """Offsets, loads at rest and the verdict; rest is inf where the vehicle never stood."""
    stands = np.isfinite(rest)
    here = law.ground.at(np.where(stands, rest, law.ground.end))
    at_rest = law.loads(here, 0.0, np.zeros_like(rest))
    least = np.where(stands, np.minimum(least, at_rest), least)
    _, offset = law.at_start(start)
    distance = rest - start + np.where(speed > 0.0, offset, 0.0)
    return Stops(rest, distance, *least, rest <= law.ground.end + 1e-6)


def _onset(law: Law, start: np.ndarray, speed: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Where the brakes set in, and the least loads (3, M) until then."""
    dead_time, _ = law.at_start(start)
    onset = start + speed * dead_time
    return onset, law.held_loads(start, onset, speed)


def _stops_ivp(law: Law, start: np.ndarray, speed: np.ndarray) -> Stops:
    onset, least = _onset(law, start, speed)
    rest = np.where(speed > 0.0, np.inf, start)
    steps = np.diff(law.breaks)
    shortest = np.min(steps[steps > 1e-3], initial=1.0)
    for i in np.flatnonzero((speed > 0.0) & (onset <= law.ground.end)):
        rest[i], lane = _brake_ivp(law, float(onset[i]), float(speed[i]), shortest)
        least[:, i] = np.minimum(least[:, i], lane)
    return _finish(law, start, speed, rest, least)


def _brake_ivp(law: Law, s_0: float, v_0: float, shortest: float) -> tuple[float, np.ndarray]:
    """Where a vehicle braking from s_0 comes to rest (inf: nowhere), and its least loads (3,)."""
    end = law.ground.end + END_SLACK

    def rates(_: float, y: np.ndarray) -> tuple[float, ...]:
        state = y.tolist()
        return law.derivatives(state, v_0, law.ground.at_one(state[0]))

    def stands(_: float, y: np.ndarray) -> float:
        return y[1]

    def leaves(_: float, y: np.ndarray) -> float:
        return y[0] - end

    stands.terminal, stands.direction = True, -1.0
    leaves.terminal, leaves.direction = True, 1.0
    run = solve_ivp(
        rates,
        (0.0, GIVE_UP),
        [s_0, v_0, 0.0, 0.0],
        method="DOP853",
        rtol=1e-9,
        atol=1e-10,
        max_step=min(max(0.5 * shortest / v_0, 5e-3), 0.05),
        events=[stands, leaves],
        dense_output=True,
    )
    # Loads at the integrator's steps, in between, and on both sides of every kink of the ground.
    duration = run.t[-1]
    t = np.union1d(run.t, np.linspace(0.0, duration, 2 + int(duration / 5e-3)))
    y = run.sol(t)
    y[1] = np.maximum(y[1], 0.0)
    inside = law.breaks[(law.breaks > y[0, 0]) & (law.breaks < y[0, -1])]
    if len(inside):
        there = run.sol(np.interp(inside, y[0], t))[1:]
        y = np.column_stack([y, *(np.vstack([inside + side, there]) for side in (-1e-9, 1e-9))])
    least = law.braking_loads(y, np.full(y.shape[1], v_0)).min(axis=1)
    return (float(run.y[0, -1]) if len(run.t_events[0]) else math.inf), least


def _stops_rk4(law: Law, start: np.ndarray, speed: np.ndarray, dt: float) -> Stops:
    onset, least = _onset(law, start, speed)
    rest = np.where(speed > 0.0, np.inf, start)
    lanes = np.flatnonzero((speed > 0.0) & (onset <= law.ground.end))
    held = speed[lanes]
    y = np.array([onset[lanes], held, np.zeros_like(held), np.zeros_like(held)])
    elapsed = np.zeros_like(held)
    breaks = np.append(law.breaks, np.inf)

    def rates(y: np.ndarray, held: np.ndarray) -> np.ndarray:
        return np.array(law.derivatives(y, held, law.ground.at(y[0])))

    while len(lanes):
        k_1, shares = law.rates_and_loads(y, held)
        least[:, lanes] = np.minimum(least[:, lanes], shares)
        # No step crosses a kink of the ground by more than a hair.
        gap = breaks[breaks.searchsorted(y[0], "right")] - y[0]
        h = np.minimum(np.maximum(gap / (y[1] + np.maximum(k_1[1], 0.0) * dt), 1e-5), dt)
        k_2 = rates(y + 0.5 * h * k_1, held)
        k_3 = rates(y + 0.5 * h * k_2, held)
        k_4 = rates(y + h * k_3, held)
        new = y + h / 6.0 * (k_1 + 2.0 * k_2 + 2.0 * k_3 + k_4)
        elapsed = elapsed + h
        done = new[1] <= 0.0
        if done.any():  # v is quadratic in time over the last step
            v, slope, step = y[1, done], k_1[1, done], h[done]
            bend = (new[1, done] - v - slope * step) / step**2
            root = np.sqrt(np.maximum(slope**2 - 4.0 * bend * v, 0.0))
            last = np.minimum(2.0 * v / (root - slope), step)
            rest[lanes[done]] = y[0, done] + last * (v + last * (slope / 2.0 + last * bend / 3.0))
            state = y[2:, done] + last / step * (new[2:, done] - y[2:, done])
            final = np.vstack([rest[lanes[done]], np.zeros_like(v), state])
            shares = law.braking_loads(final, held[done])
            least[:, lanes[done]] = np.minimum(least[:, lanes[done]], shares)
        go = ~done & (new[0] <= law.ground.end + END_SLACK) & (elapsed < GIVE_UP)
        y, lanes, held, elapsed = new[:, go], lanes[go], held[go], elapsed[go]
    return _finish(law, start, speed, rest, least)


# ------------------------------------------------------------------------------- the verdict


class _Points(NamedTuple):
    """Places on a plan to be judged: every reached station and points inside segments, (P,)."""

    station: np.ndarray
    speed: np.ndarray
    accel: np.ndarray
    segment: np.ndarray
    stops: np.ndarray  # an emergency stop is tried from here
    first: np.ndarray  # a row of the plan, not a point inside


def verify(
    columns: Columns,
    model: Mapping[str, Any],
    *,
    effects: bool = True,
    jerk: bool = False,
    tolerance: float = 1e-6,
    interior: int = 4,
    surface: Sequence[str] | None = None,
    every: int = 1,
    method: str = "rk4",
    exact: bool = True,
) -> list[Violation]:
    """Every rule that a plan breaks; none for a good plan.

    Emergency stops are tried from every station and from `interior` points inside every segment,
    or every `every`-th one. `method` is "rk4" (fast) or "ivp" (error control). Reported stopping
    distances and rear loads have to be the own ones; without `exact`, or where `surface` leaves
    open which surface holds, they may err to the safe side. Of one kind only the worst point of a
    segment is told. Infeasible plans are only checked for bookkeeping.
    """
    if method not in ("rk4", "ivp"):
        raise ValueError(f"method is 'rk4' or 'ivp', not {method!r}")
    book = _Book(columns, tolerance)
    reached = _check_columns(book, columns)
    if reached is None:
        return book.entries
    infeasible = str(columns["status"][0]) == "infeasible"
    law = Law(columns, model, surface, effects)
    points = _points(columns, reached, 0 if infeasible else interior, every)
    tried = np.flatnonzero(points.stops)
    brake = _stops_rk4 if method == "rk4" else _stops_ivp
    options = (2e-3,) if method == "rk4" else ()
    stops = brake(law, points.station[tried], points.speed[tried], *options)
    ranges = _Range(law, tolerance)
    own = points.first[tried]
    rows = points.segment[tried[own]]
    exact = exact and surface is None
    _check_reported(book, columns, rows, stops, np.flatnonzero(own), ranges, exact)
    if infeasible:
        return book.entries
    _check_stops(book, columns, law, points, tried, stops, ranges)
    _check_driving(book, law, model, points)
    if jerk:
        _check_jerk(book, columns, model["limits"]["jerk"], reached)
    return book.entries


class _Book:
    """The violations found so far."""

    def __init__(self, columns: Columns, tolerance: float) -> None:
        names = columns.get("candidate", ())
        self.candidate = str(names[0]) if len(names) else ""
        self.tolerance = tolerance
        self.entries: list[Violation] = []

    def add(self, station: float, kind: str, amount: float, text: str) -> None:
        self.entries.append(Violation(self.candidate, float(station), kind, float(amount), text))

    def worst(
        self,
        kind: str,
        points: _Points,
        excess: np.ndarray,
        text: str,
        at: np.ndarray | None = None,
        scale: float = 1.0,
    ) -> None:
        """Enter the largest excess of every segment that is beyond the tolerance."""
        at = np.arange(len(points.station)) if at is None else at
        over = np.flatnonzero(~(excess <= self.tolerance * scale))
        best: dict[int, int] = {}
        for i in over.tolist():
            k = int(points.segment[at[i]])
            if k not in best or excess[i] > excess[best[k]]:
                best[k] = i
        for i in best.values():
            p = int(at[i])
            where = f"{text} by {excess[i]:.6g} at {points.speed[p]:.4f} m/s"
            self.add(points.station[p], kind, excess[i], where)


def _check_columns(book: _Book, columns: Columns) -> np.ndarray | None:
    """What the columns alone can tell; returns the rows reached, None if nothing more can be."""
    missing = [name for name in ("status", *NUMBER_COLUMNS) if name not in columns]
    if missing:
        book.add(0.0, "bookkeeping", len(missing), f"no column {', '.join(missing)}")
        return None
    number = {name: np.asarray(columns[name], float) for name in NUMBER_COLUMNS}
    s, v, a, t = (number[name] for name in ("station", "speed", "accel", "time"))
    lengths = {len(columns["status"]), *(len(column) for column in number.values())}
    if len(lengths) != 1 or len(s) < 2:
        book.add(0.0, "bookkeeping", len(s), "columns differ in length, or fewer than two rows")
        return None
    statuses = {str(status) for status in columns["status"]}
    if len(statuses) != 1 or not statuses <= set(STATUSES):
        book.add(s[0], "bookkeeping", len(statuses), f"status {sorted(statuses)}")
    infeasible = str(columns["status"][0]) == "infeasible"
    for name, column in number.items():
        lost = np.flatnonzero(~np.isfinite(column))
        if len(lost) and not (infeasible and name in ("stop_distance", "rear_load")):
            text = f"{name} is not finite in {len(lost)} rows"
            book.add(s[lost[0]], "bookkeeping", len(lost), text)
    if not all(np.isfinite(column).all() for column in (s, v, a, t)):
        return None
    ds = np.diff(s)
    if np.any(ds < 0.0):
        k = int(np.argmin(ds))
        book.add(s[k], "bookkeeping", -ds[k], "station decreases")
        return None
    ground = [number[name] for name in ("grade", "roll", "curvature", "x", "y")]
    if not all(np.isfinite(column[:2]).all() for column in ground):
        return None

    tolerance = book.tolerance

    def each(excess: np.ndarray, text: str, scale: Values = 1.0) -> None:
        for k in np.flatnonzero(excess > tolerance * scale):
            book.add(s[k], "bookkeeping", excess[k], f"{text} by {excess[k]:.6g}")

    each(-v, "speed is negative")
    if np.any(v < 0.0):
        return None
    length = np.sqrt(sum(np.diff(number[name]) ** 2 for name in "xyz"))
    astray = np.abs((s - s[0]) - np.concatenate([[0.0], np.cumsum(length)]))
    if np.max(astray, where=np.isfinite(astray), initial=0.0) > max(tolerance, 1e-6):
        k = int(np.nanargmax(astray))
        text = f"station is off the length of the polyline by {astray[k]:.6g}"
        book.add(s[k], "bookkeeping", astray[k], text)
    square = v**2
    miss = np.abs(square[1:] - square[:-1] - 2.0 * a[:-1] * ds)
    each(miss, "v² does not follow from accel", 1.0 + square[:-1])

    moving = v[:-1] + v[1:] > 0.0
    spent = np.diff(t)
    needed = np.divide(2.0 * ds, v[:-1] + v[1:], out=np.zeros_like(ds), where=moving)
    each(np.abs(spent - needed) * moving, "time does not follow from speed", 1.0 + needed)
    each(-spent, "time decreases")
    reached = np.concatenate([[True], np.logical_and.accumulate(moving | (ds == 0.0))])
    for k in np.flatnonzero(~reached & (v > tolerance)):
        book.add(s[k], "bookkeeping", v[k], "moves where it cannot get to, beyond a standstill")
    each(v - number["speed_bound"], "speed is above speed_bound")
    if not infeasible:
        past = s + number["stop_distance"] - number["clear_distance"]
        each(np.where(reached, past, 0.0), "station + stop_distance is past clear_distance")
    return reached


def _points(columns: Columns, reached: np.ndarray, interior: int, every: int) -> _Points:
    """Stations, points inside segments, and the ends of segments as seen from inside."""
    s, v, a = (np.asarray(columns[name], float) for name in ("station", "speed", "accel"))
    k = np.arange(len(s) - 1)
    k = k[reached[1:] & (v[:-1] + v[1:] > 0.0) & (np.diff(s) > 0.0)]
    rows = np.flatnonzero(reached)
    parts = [_Points(s[rows], v[rows], a[rows], rows, v[rows] > 0.0, np.full(len(rows), True))]
    last = rows == len(s) - 1  # the acceleration of the last row holds for nothing
    parts[0] = parts[0]._replace(accel=np.where(last, 0.0, parts[0].accel))
    for j in range(1, interior + 2):
        chosen = k if j == interior + 1 else k[k % max(every, 1) == 0]
        inside = j / (interior + 1) * (s[chosen + 1] - s[chosen])
        speed = np.sqrt(np.maximum(v[chosen] ** 2 + 2.0 * a[chosen] * inside, 0.0))
        tried = (speed > 0.0) & (j <= interior)
        row = np.full(len(chosen), False)
        parts.append(_Points(s[chosen] + inside, speed, a[chosen], chosen, tried, row))
    return _Points(*(np.concatenate(column) for column in zip(*parts, strict=True)))


class _Range:
    """Where the ground is steeper than the braking model was trained for."""

    def __init__(self, law: Law, tolerance: float) -> None:
        self.law, ground = law, law.ground
        n = len(ground.station)
        ends = law.matrix[law.code[:n]]
        self.flattest = np.maximum(ends[:-1, 9], ends[1:, 9]) - tolerance
        self.steepest = np.minimum(ends[:-1, 10], ends[1:, 10]) + tolerance
        grade, length = ground.table[:, 0], np.diff(ground.station)
        self.intervals: list[tuple[float, float]] = []
        for k in range(n - 1):
            g_0, g_1, low, high = grade[k], grade[k + 1], self.flattest[k], self.steepest[k]
            outside = [p for p, g in ((0.0, g_0), (1.0, g_1)) if not low <= g <= high]
            if outside:
                edges = [(edge - g_0) / (g_1 - g_0) for edge in (low, high) if g_0 != g_1]
                marks = [*outside, *(p for p in edges if 0.0 < p < 1.0)]
                if len(outside) == 2 and (g_0 > high) == (g_1 > high):
                    marks = [0.0, 1.0]
                first, last = (ground.station[k] + p * length[k] for p in (min(marks), max(marks)))
                self.intervals.append((first, last))
        self._ends = [last for _, last in self.intervals]

    def touched(self, start: np.ndarray, stop: np.ndarray) -> np.ndarray:
        """Whether the way from start to stop meets such ground."""
        i = np.array([bisect_right(self._ends, s) for s in start.tolist()], int)
        firsts = np.array([first for first, _ in self.intervals] + [np.inf])
        return firsts[i] < stop

    def excess(self, start: float, stop: float) -> float:
        """By how much the grade between two stations is outside, at worst."""
        ground = self.law.ground
        inside = ground.station[(ground.station > start) & (ground.station < stop)]
        here = ground.at(np.array([start, *inside, min(stop, ground.end)]))
        high, low = self.steepest[here.segment], self.flattest[here.segment]
        return float(np.max(np.maximum(here.grade - high, low - here.grade)))


def _check_reported(
    book: _Book,
    columns: Columns,
    rows: np.ndarray,
    stops: Stops,
    lanes: np.ndarray,
    ranges: _Range,
    exact: bool,
) -> None:
    """Reported stopping distances and rear loads against the own integration."""
    s, v, reported, rear = (
        np.asarray(columns[name], float)
        for name in ("station", "speed", "stop_distance", "rear_load")
    )
    for k in np.flatnonzero((v == 0.0) & ~(np.abs(reported) <= DISTANCE_AGREES)):
        if np.isfinite(reported[k]):
            text = f"stop_distance of {reported[k]:.4f} at standstill"
            book.add(s[k], "bookkeeping", abs(reported[k]), text)
    for k, i in zip(rows.tolist(), lanes.tolist(), strict=True):
        own, least = stops.distance[i], stops.rear_load[i]
        if not math.isfinite(own):
            continue
        # On ground steeper than trained a plan keeps a margin of its own.
        steep = ranges.law.extrapolate and bool(
            ranges.touched(s[k : k + 1], stops.stop_station[i : i + 1])[0]
        )
        off = own - reported[k]
        if exact and not steep:
            off = abs(off)
        if off > max(DISTANCE_AGREES, book.tolerance):
            text = f"stop_distance is {reported[k]:.4f}, not {own:.4f}"
            book.add(s[k], "bookkeeping", off, text)
        off = rear[k] - least
        if exact and not steep:
            # Between stations a plan counts the sharper crest of those on both sides.
            off = max(off, least - rear[k] - CREST_AGREES)
        if off > max(LOAD_AGREES, book.tolerance):
            text = f"rear_load is {rear[k]:.4f}, not {least:.4f}"
            book.add(s[k], "bookkeeping", off, text)


def _check_stops(
    book: _Book,
    columns: Columns,
    law: Law,
    points: _Points,
    tried: np.ndarray,
    stops: Stops,
    ranges: _Range,
) -> None:
    """The invariant: every emergency stop ends in time, on known ground, with its wheels down."""
    start = points.station[tried]
    clear = np.asarray(columns["clear_distance"], float)
    ahead = np.minimum(points.segment[tried] + 1, len(clear) - 1)
    ahead = np.where(points.first[tried], points.segment[tried], ahead)
    clear = np.minimum(clear[points.segment[tried]], clear[ahead])
    past = np.maximum(start + stops.distance - clear, stops.stop_station - law.ground.end)
    book.worst("overrun", points, past, "the stop is too long", tried)
    least = law.limits["min_load"]
    for kind in ("rear_load", "side_load", "front_load"):
        lack = least - getattr(stops, kind)
        book.worst(kind, points, lack, "a stop takes too much load off", tried)
    if law.extrapolate:
        return
    until = np.minimum(start + stops.distance, law.ground.end)
    touched = ranges.touched(start, until)
    excess = np.array(
        [
            ranges.excess(*way) if bad else 0.0
            for *way, bad in zip(start, until, touched, strict=True)
        ]
    )
    text = "the stop meets ground steeper than trained"
    book.worst("grade_range", points, np.where(touched, excess + book.tolerance, 0.0), text, tried)


def _check_driving(book: _Book, law: Law, model: Mapping[str, Any], points: _Points) -> None:
    """The limits of the planned motion itself."""
    vehicle, terrain, limits = model["vehicle"], model["terrain"], model["limits"]
    v, a = points.speed, points.accel
    here = law.ground.at(points.station)
    moving = v > 0.0
    sides = law.sides(points.segment.clip(max=len(law.ground.station) - 2))

    book.worst("speed_limit", points, v - limits["speed"], "speed is above its limit")
    fastest = np.min([np.broadcast_to(c.fastest, v.shape) for c in sides], axis=0)
    book.worst("speed_range", points, v - fastest, "speed is above the trained range")
    aside = v**2 * np.abs(here.curvature) / np.cos(here.roll) - limits["lateral_accel"]
    book.worst("lateral", points, aside, "lateral acceleration is too high")
    skid = vehicle["drive"] == "skid_steer"
    track = terrain["slip_track"] if skid else vehicle["track_width"]
    rim = v * (1.0 + np.abs(here.curvature) * track / 2.0) - vehicle["max_wheel_speed"]
    book.worst("wheel_speed", points, rim, "the outer wheels turn too fast")
    book.worst("accel", points, a - limits["accel"], "acceleration is above its limit")
    book.worst("decel", points, -a - limits["decel"], "deceleration is above its limit")
    force = np.min(law.forces(sides, here, v, v)[1], axis=0)
    spare = law.deceleration(here, force, v)
    short = np.where(moving & (a < 0.0), -a - spare, 0.0)
    book.worst("decel", points, short, "the brakes cannot slow that much")

    turning = terrain["lateral_resistance"] * vehicle["wheelbase"] / 2.0 if skid else 0.0
    resistance = terrain["motion_resistance"] + turning * np.abs(here.curvature)
    demand = vehicle["mass"] * (a + G * (np.sin(here.grade) + resistance * np.cos(here.grade)))
    power = np.divide(vehicle["max_drive_power"], v, out=np.full_like(v, np.inf), where=moving)
    lack = demand - np.minimum(vehicle["max_drive_force"], power)
    lack = np.where(moving & (demand > 0.0), lack, 0.0)
    book.worst("drive", points, lack, "the drive is too weak", scale=vehicle["mass"])

    shares = law.loads(here, -a, v)
    for kind, share in zip(("rear_load", "side_load", "front_load"), shares, strict=True):
        lack = np.where(moving, limits["min_load"] - share, 0.0)
        book.worst(kind, points, lack, "driving takes too much load off")


def _check_jerk(book: _Book, columns: Columns, limit: float, reached: np.ndarray) -> None:
    """Steps of the acceleration between segments, over the time from middle to middle."""
    s, v, a, t = (
        np.asarray(columns[name], float) for name in ("station", "speed", "accel", "time")
    )
    for k in range(len(s) - 2):
        span = (t[k + 2] - t[k]) / 2.0
        if reached[k + 2] and v[k + 1] > 0.0 and span > 0.0:
            excess = abs(a[k + 1] - a[k]) / span - limit
            if excess > 0.01 * limit + book.tolerance:
                text = f"acceleration changes too fast by {excess:.6g} m/s³"
                book.add(s[k + 1], "jerk", excess, text)


def describe(violations: Sequence[Violation], most: int = 10) -> str:
    """The worst of them in words, one a line, for the message of a failed check."""

    def lines() -> Iterator[str]:
        for v in sorted(violations, key=lambda v: -v.amount)[:most]:
            yield f"{v.candidate or '-'} at {v.station:.3f} m: {v.kind}: {v.text}"
        if len(violations) > most:
            yield f"and {len(violations) - most} more"

    return "\n".join(lines())
