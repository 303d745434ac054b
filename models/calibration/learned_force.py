"""Force and promise learned on one surface, as stored over a restart, and the model to plan with.

Source: none; the braking model is Braking (7), (8).
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.recursive import at_least_both
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import corner_design, design
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix, validate_covariance
from slopewise.models.stop_distance import StopDistance
from slopewise.models.surface_braking import SurfaceBraking

_LARGEST = 100.0
"""No coefficient of any vehicle is anywhere near it [s/m, 1, s/m, 1]."""

PRIOR_SURFACE = "model file"
"""Name of the surface that keeps the prior's base where stops replaced it."""

_NO_CLASS = 1_000_000
"""Learned surfaces go by name; numbers in maps, which count places of tables, do not reach them."""


@dataclass(frozen=True, slots=True)
class LearnedForce:
    """An estimate of m_m, b_m, m_b, b_b, and the coefficients published with it.

    Attributes:
        estimate: (4,) of the stops. covariance: (4, 4) of it.
        published: (4,) as may be planned with: down immediately, up slowly.
        valid: the estimate may be trusted. accepted, gated: stops accepted and rejected.
        last: whether each of the last stops was rejected.
        row: stops rejected in a row up to now, > 0: stronger ones, < 0: weaker ones.
        session: (n, 3) onset speed [m/s], grade [rad], distance [m] of the stops of this session.
        distance: the promise as this session has it; None without a promise.
        dead_time: with which that was found [s].
    """

    estimate: tuple[float, ...]
    covariance: Matrix
    published: tuple[float, ...]
    valid: bool
    accepted: int
    gated: int
    last: tuple[bool, ...] = ()
    row: int = 0
    session: tuple[tuple[float, float, float], ...] = ()
    distance: StopDistance | None = None
    dead_time: float = 0.0

    def __post_init__(self) -> None:
        for name, values in (("estimate", self.estimate), ("published", self.published)):
            if len(values) != 4 or not all(abs(v) <= _LARGEST for v in values):
                expected = f"four finite numbers of at most {_LARGEST:g}, got {values}"
                raise ParameterError(name, expected)
        matrix = np.array(self.covariance, np.float64)
        if matrix.shape != (4, 4) or not np.all(np.abs(matrix) <= _LARGEST**2):
            raise ParameterError("covariance", "4 x 4 finite numbers")
        validate_covariance("covariance", self.covariance, 4)
        stops = np.array(self.session or ((1.0, 0.0, 1.0),))
        if not np.isfinite(stops).all() or np.any(stops[:, 0] <= 0.0) or np.any(stops[:, 2] < 0.0):
            raise ParameterError("session", "finite stops with speeds above 0")
        if not 0.0 <= self.dead_time <= _LARGEST:
            raise ParameterError("dead_time", f"0 … {_LARGEST:g} s")
        if self.accepted < 0 or self.gated < 0:
            raise ParameterError("accepted", "counts >= 0")


def braking_in_use(
    prior: Braking, learned: Mapping[str, LearnedForce], older: Mapping[str, float] | None = None
) -> Braking:
    """The braking model to plan with: the prior, and over it the force learned on each surface.

    As long as an estimate is not valid it may lower the force at the corners of the trained
    rectangle and raise it nowhere, and neither covariance may be undercut, so that a larger
    uncertainty never makes a plan faster.

    Args:
        prior: braking model of the model file, with its surfaces.
        learned: by surface, "" is the base; what is missing is as in the prior.
        older: by surface, error of F_b/W that its age adds, standard deviation [1].

    Raises:
        ParameterError: brakes that would not slow the vehicle on level ground.
    """
    tables = dict(prior.terrain)
    base: dict[str, object] = {}
    for name, state in learned.items():
        known = prior.on(name)
        more = 0.0 if older is None else older.get(name, 0.0)
        if known.distance is not None:
            # The offset of a session includes the error of the force, stop by stop.
            more = math.hypot(more, _added_std(known, state) / (1.0 + len(state.session)))
        changes = {**_coefficients(known, state), "force_std": math.hypot(known.force_std, more)}
        if state.distance is not None:
            changes["distance"] = state.distance
            changes["dead_time"] = max(known.dead_time, state.dead_time)
        if name:
            given = tables.get(name, SurfaceBraking(class_id=_NO_CLASS + len(tables)))
            tables[name] = dataclasses.replace(given, **changes)  # type: ignore[arg-type]
        else:
            base = changes
    if base:
        # What the base was stays among what ground of no known name may turn out to be.
        tables[PRIOR_SURFACE] = SurfaceBraking(class_id=_NO_CLASS - 1)
        _pin(prior, tables, base)
    return dataclasses.replace(prior, terrain=tables, **base)  # type: ignore[arg-type]


def _added_std(known: Braking, state: LearnedForce) -> float:
    """Standard deviation of F_b/W beyond that of the prior, which the promise contains [1]."""
    speed, grade = 0.5 * sum(known.speed_range), 0.5 * sum(known.grade_range)
    phi = design(np.array([speed]), np.array([grade]))[0]
    variance = float(phi @ np.array(state.covariance) @ phi)
    if known.covariance is not None:
        variance -= float(phi @ np.array(known.covariance) @ phi)
    return math.sqrt(max(variance, 0.0))


def _coefficients(known: Braking, state: LearnedForce) -> dict[str, object]:
    published = np.array(state.published)
    covariance = np.array(state.covariance)
    if not state.valid:
        corners = corner_design(known.speed_range, known.grade_range)
        default = np.array(known.coefficients)
        lower = np.minimum(corners @ published, corners @ default)
        published = np.linalg.solve(corners, lower)
        if known.covariance is not None:
            covariance = at_least_both(covariance, np.array(known.covariance))
    values = (float(value) for value in published)
    matrix = tuple(tuple(float(c) for c in row) for row in 0.5 * (covariance + covariance.T))
    return {**dict(zip(NAMES, values, strict=True)), "covariance": matrix}


def _pin(prior: Braking, tables: dict[str, SurfaceBraking], base: Mapping[str, object]) -> None:
    """Surfaces of the file keep the file's base where they omit a key, not the new one."""
    for name, table in tables.items():
        reused = {
            key: getattr(prior, key)
            for key in base
            if getattr(table, key) is None and getattr(prior, key) is not None
        }
        tables[name] = dataclasses.replace(table, **reused)
