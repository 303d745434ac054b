"""Effects of the library on a grid of their inner numbers, as changes of the fall of speed.

Each candidate is one column: what one unit of its strength adds to v_i − v(t), at the forces of the
fit so far. Numbers inside an effect (a time constant, a direction, a place) are tried on a grid;
the refit makes them exact afterwards. Nothing is differentiated.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field

import numpy as np

from models.arrays import Floats
from models.discrepancy.data.stop_table import StopTable
from models.discrepancy.model.brakes import brought_force, heat
from models.discrepancy.model.hypothesis import Hypothesis
from models.discrepancy.model.prediction import (
    ground_of,
    inside_patch,
    integral,
    session_time,
    wanted_force,
)  # fmt: skip
from models.parameters import Effect
from models.quantity import GRAVITY

_LAGS = (0.02, 0.04, 0.07, 0.11, 0.17, 0.26, 0.4)  # [s]
_COOLING = (20.0, 40.0, 100.0, 300.0, 1000.0)  # [s]
_WINDS = (2.0, 5.0, 10.0)  # [m/s]
_HEADINGS = 12
_CAPS = (0.4, 0.6, 0.75, 0.87, 0.95)  # quantiles of the force
_LEAST_FRICTION = 0.02
_LATTICE = 9
_RADII = (0.07, 0.14, 0.25)  # of the field
_TRIES = 48  # patches near another one
_FEWEST = 3  # stops on each side of a change, or in a patch
_STRAIGHT = 0.15  # [rad] spread of headings that shows a direction
_BUILT_UP = frozenset(
    ("grade_asymmetry", "grade_nonlinearity", "cross_slope", "surface_patch",
     "directional_surface", "step_change", "session_drift")
)  # fmt: skip
_OF_BUILT_FORCE = frozenset(("brake_lag", "brake_fade"))
_ONCE = frozenset(("headwind", "brake_lag", "brake_fade", "wheel_lockup"))


@dataclass(frozen=True, slots=True)
class Candidate:
    """One effect at one point of the grid of its inner numbers.

    Attributes:
        name: of the effect. strength: parameter that the column is multiplied with.
        inner: other parameters. one_sided: the strength cannot be negative.
        offset: strength without effect.
    """

    name: str
    strength: str
    one_sided: bool
    inner: dict[str, float] = field(default_factory=dict)
    offset: float = 0.0

    def effect(self, strength: float) -> Effect:
        """The effect with a strength."""
        if self.name == "brake_lag":  # its column is that of the whole effect
            return Effect(name=self.name, parameters=dict(self.inner))
        if self.name == "wheel_lockup":
            return Effect(name=self.name, parameters=dict(self.inner))
        values = {self.strength: self.offset + strength, **self.inner}
        return Effect(name=self.name, parameters=values)


def candidates(table: StopTable, hypothesis: Hypothesis) -> tuple[list[Candidate], Floats]:
    """Every candidate that the log has channels for, and (S, M, Q) its column.

    Args:
        table: stops. hypothesis: fitted so far; its forces are what lag, fade and friction act on.
    """
    found: list[Candidate] = []
    columns: list[Floats] = []
    taken = {e.name for e in (*hypothesis.model.effect, *hypothesis.added)} & _ONCE
    library = _Library(table, hypothesis)
    for candidate, share in library.all():
        if candidate.name not in taken:
            found.append(candidate)
            built = candidate.name in _OF_BUILT_FORCE
            columns.append(share * library.brought.passes if built else share)
    forces = np.array([c.name in _BUILT_UP for c in found])
    return found, integral(table, hypothesis, np.stack(columns, axis=2), forces)


def finer_patches(
    table: StopTable, hypothesis: Hypothesis, around: Candidate, closer: float, draw: int = 0
) -> tuple[list[Candidate], Floats]:
    """Patches near one of them, moved by a share of its radius; none that hold too few stops."""
    place = ground_of(table)
    inner = around.inner
    rng = np.random.default_rng((_TRIES, draw))
    found, shares = [], []
    for dx, dy, grown in closer * rng.standard_normal((_TRIES, 3)):
        at = {
            "x": inner["x"] + dx * inner["radius"],
            "y": inner["y"] + dy * inner["radius"],
            "radius": inner["radius"] * float(np.exp(grown)),
        }
        inside = inside_patch(place, at["x"], at["y"], at["radius"])
        if _some(inside):
            found.append(Candidate("surface_patch", "delta", False, at))
            shares.append(inside)
    if not found:
        return [], np.empty((*table.time.shape, 0))
    forces = np.ones(len(found), np.bool_)
    return found, integral(table, hypothesis, np.stack(shares, axis=2), forces)


class _Library:
    """Shares of the weight along each stop, (S, M), by candidate."""

    def __init__(self, table: StopTable, hypothesis: Hypothesis) -> None:
        self.table, self.place = table, ground_of(table)
        self.hypothesis = hypothesis
        self.wanted = wanted_force(table, hypothesis, self.place)
        self.since = np.maximum(table.time - hypothesis.dead_time, 0.0)
        self.brought = brought_force(
            table, hypothesis, self.wanted, table.speed, table.grade, table.roll, table.time
        )
        self.speed = table.speed

    def all(self) -> Iterator[tuple[Candidate, Floats]]:
        """Those that the channels allow."""
        logged = self.table.logged
        yield from self._motion()
        yield from self._states()
        yield from self._slopes()
        if "yaw" in logged:
            yield from self._directions()
        if {"x", "y"} <= logged:
            yield from self._patches()
        yield from self._session()

    def _motion(self) -> Iterator[tuple[Candidate, Floats]]:
        v = self.speed
        yield Candidate("aerodynamic_drag", "c", True), v * v / GRAVITY
        yield Candidate("viscous_resistance", "c", True), v
        if "yaw_rate" in self.table.logged:
            yield Candidate("turning_resistance", "k", True), np.abs(self.place.turning)

    def _states(self) -> Iterator[tuple[Candidate, Floats]]:
        for tau in _LAGS:
            missing = -self.brought.force * np.exp(-self.since / tau)
            yield Candidate("brake_lag", "tau", True, {"tau": tau}), missing
        for tau in _COOLING:
            q = heat(self.table, tau, self.speed, self.table.time, self.hypothesis.dead_time)
            yield Candidate("brake_fade", "k", True, {"tau": tau}), -self.brought.force * q
        upright = np.cos(self.place.grade) * np.cos(self.place.roll)
        for mu in np.maximum(np.quantile(self.brought.given / upright, _CAPS), _LEAST_FRICTION):
            over = np.maximum(self.brought.given - mu * upright, 0.0)
            yield Candidate("wheel_lockup", "mu", True, {"mu": float(mu)}), -over

    def _slopes(self) -> Iterator[tuple[Candidate, Floats]]:
        grade = self.place.grade
        yield Candidate("grade_asymmetry", "k", False), np.maximum(grade, 0.0)
        yield Candidate("grade_nonlinearity", "k", False), grade * np.abs(grade)
        if "roll" in self.table.logged:
            yield Candidate("cross_slope", "k", False), np.abs(self.place.roll)

    def _directions(self) -> Iterator[tuple[Candidate, Floats]]:
        v, yaw = self.speed, self.place.yaw
        for i in range(_HEADINGS):
            direction = 2.0 * np.pi * i / _HEADINGS
            for wind in _WINDS:
                u = v + wind * np.cos(yaw - direction)
                inner = {"wind": wind, "direction": direction}
                yield Candidate("headwind", "c", True, inner), (np.abs(u) * u - v * v) / GRAVITY
            along = np.cos(2.0 * yaw - direction)
            inner = {"direction": 0.5 * direction}
            yield Candidate("directional_surface", "k", True, inner), along

    def _patches(self) -> Iterator[tuple[Candidate, Floats]]:
        x, y = self.place.x, self.place.y
        size = float(max(np.ptp(x), np.ptp(y)))
        if size <= 0.0:
            return
        count_x = max(int(np.ceil(_LATTICE * np.ptp(x) / size)), 1)
        count_y = max(int(np.ceil(_LATTICE * np.ptp(y) / size)), 1)
        for cx in _middles(x, count_x):
            for cy in _middles(y, count_y):
                for share in _RADII:
                    inside = inside_patch(self.place, cx, cy, share * size)
                    if _some(inside):
                        inner = {"x": float(cx), "y": float(cy), "radius": share * size}
                        yield Candidate("surface_patch", "delta", False, inner), inside

    def _session(self) -> Iterator[tuple[Candidate, Floats]]:
        clock = session_time(self.table)[:, None] * np.ones_like(self.wanted)
        yield Candidate("session_drift", "k", False), clock
        runs = self.table.run
        for first in np.unique(runs)[1:]:
            later = runs >= first
            if min(int(later.sum()), int((~later).sum())) >= _FEWEST:
                share = self.wanted * later[:, None]
                yield Candidate("step_change", "scale", False, {"run": float(first)}, 1.0), share


def patch_column(table: StopTable, hypothesis: Hypothesis, patch: Candidate) -> Floats:
    """(S, M, 1) column of a patch."""
    p = patch.inner
    inside = inside_patch(ground_of(table), p["x"], p["y"], p["radius"])[:, :, None]
    return integral(table, hypothesis, inside, np.ones(1, np.bool_))


def _some(inside: Floats) -> bool:
    touched = int((inside > 0.0).any(axis=1).sum())
    return touched >= _FEWEST and bool((inside < 1.0).any())


def _middles(values: Floats, count: int) -> Floats:
    low, high = float(values.min()), float(values.max())
    return low + (high - low) * (np.arange(count) + 0.5) / count
