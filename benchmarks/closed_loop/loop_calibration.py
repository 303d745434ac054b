"""A braking model from stops driven in the loop, by the robot's own log and map alone.

Onset and deceleration follow from stopping time and distance. Each stop then has a force ratio
without gravity, and one joint least squares over [v θ, θ, v, 1] per surface gives the four
coefficients (Braking (9)–(10), the gravity-free form). One more column, the size of the roll, is
the effect `cross_slope`: tyres that hold a vehicle sideways brake less; another, the load lost on
crests, is the effect `crest_unloading`. The grade is that of the map: the body dives under braking,
and its pitch would overstate downhill grades.

The residual distance of the stops is covered by a share of the force, for the part that grows
with the square of the speed, and by the safety offset (Braking (12)), for the rest.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from scipy.optimize import linprog

from slopewise.models.arrays import Floats
from slopewise.models.errors import ParameterError
from slopewise.models.laws import braking
from slopewise.models.parameters import Braking, Effect, Model
from slopewise.models.quantity import GRAVITY
from slopewise.models.stops.simulation import simulate_stop
from slopewise.models.surface_braking import SurfaceBraking

from .quad import LIMITS, QUAD, ROLLING
from .stop_sample import StopSample

COEFFICIENTS = ("m_m", "b_m", "m_b", "b_b")

_MIN_STOPS = 20  # on one surface, for four coefficients and their scatter
_MIN_SPEED = 1.2  # [m/s] of stops that show the dead time
_FACTOR = 1.25  # on residuals: the worst of a few hundred stops is not the worst of all [1]
_MAX_FORCE_SHARE = 0.1  # of the weight that may be given up [1]


def fit(samples: list[StopSample], name: str) -> Model:
    """Fit the model of the planner.

    Raises:
        ParameterError: too few stops on a surface.
    """
    surfaces = sorted({s.surface for s in samples})
    groups = [[s for s in samples if s.surface == surface] for surface in surfaces]
    for surface, group in zip(surfaces, groups, strict=True):
        if len(group) < _MIN_STOPS:
            raise ParameterError("samples", f">= {_MIN_STOPS} stops on {surface}, got {len(group)}")
    ordered = [s for group in groups for s in group]
    dead_time = dead_time_of(samples)
    rows, force, weight = _regression(ordered, dead_time)
    columns = np.hstack(
        [
            np.where([[s.surface == surface] for s in ordered], rows[:, :4], 0.0)
            for surface in surfaces
        ]
        + [rows[:, 4:]]
    )
    solution, _, _, _ = np.linalg.lstsq(columns * weight[:, None], force * weight, rcond=None)
    residual = force - columns @ solution
    # The pseudo-inverse ignores the crest column where no stop crosses a crest.
    bread = np.linalg.pinv(columns.T @ (weight[:, None] ** 2 * columns), hermitian=True)
    # Stops scatter by their force, at any weight: the sandwich form.
    meat = columns.T @ ((weight**2 * residual)[:, None] ** 2 * columns)
    covariance = bread @ meat @ bread
    # Cross slopes and crests can only reduce the force.
    cross_slope, crest = min(float(solution[-2]), 0.0), max(float(solution[-1]), 0.0)
    tables = {}
    for i, (surface, group) in enumerate(zip(surfaces, groups, strict=True)):
        four = slice(4 * i, 4 * i + 4)
        coefficients = np.asarray(solution[four], np.float64)
        b = _braking(group, dead_time, coefficients, np.asarray(covariance[four, four], np.float64))
        moved = weight[[s.surface == surface for s in ordered]]
        fastest = b.speed_range[1]
        level = fastest**2 / (2.0 * GRAVITY * b.level_force(fastest) ** 2)
        margin, offset = _cover(residuals(group, b, cross_slope, crest), moved, level)
        tables[surface] = replace(b, b_b=b.b_b - margin, distance_offset=offset)
    # On unknown surfaces the weakest braking applies.
    weakest = min(tables.values(), key=lambda b: b.level_force(2.0))
    keys = (*COEFFICIENTS, "distance_offset", "covariance", "speed_range", "grade_range")
    base = replace(
        weakest,
        distance_offset=max(b.distance_offset for b in tables.values()),
        terrain={
            surface: SurfaceBraking(**{key: getattr(b, key) for key in keys})
            for surface, b in tables.items()
        },
    )
    return _model(name, base, cross_slope, crest)


def dead_time_of(samples: list[StopSample]) -> float:
    """Dead time of a stop at constant force with the same time and distance, median over stops [s].

    v t_delay + v (t_f − t_delay)/2 = s, so t_delay = 2 s/v − t_f: half of a gradual build-up is
    dead time, the rest weaker braking.
    """
    each = [2.0 * s.distance / s.speed - s.stop_time for s in samples if s.speed > _MIN_SPEED]
    return float(np.median(each))


def _regression(samples: list[StopSample], dead_time: float) -> tuple[Floats, Floats, Floats]:
    """Columns [v θ, θ, v, 1, |φ|, −crest F_b/W], F_b/W, and ∂(distance)/∂(F_b/W) of stops [m]."""
    speed = np.array([s.speed for s in samples])
    # The duration of a stop shows the mean force over its time, so the grade is averaged likewise.
    sine = np.array([np.mean(np.sin(s.while_braking(s.track.grade, dead_time))) for s in samples])
    grade = np.arcsin(sine)
    roll = np.array([s.abs_roll for s in samples])
    crest = np.array([s.crest(dead_time) for s in samples])
    time = np.array([s.stop_time for s in samples])
    decel = braking.mean_deceleration(speed, dead_time, np.maximum(time, 1.5 * dead_time))
    force = braking.force_ratio_of_deceleration(decel, grade)
    weight = GRAVITY * speed**2 / (2.0 * decel**2) * (time > 1.5 * dead_time)
    columns = np.column_stack(
        (speed * grade, grade, speed, np.ones_like(speed), roll, -crest * force)
    )
    return columns, force, weight


def _braking(
    samples: list[StopSample], dead_time: float, four: Floats, covariance: Floats
) -> Braking:
    speed, grade = [s.speed for s in samples], [s.grade for s in samples]
    symmetric = 0.5 * (covariance + covariance.T)
    return Braking(
        m_m=float(four[0]),
        b_m=float(four[1]),
        m_b=float(four[2]),
        b_b=float(four[3]),
        dead_time=dead_time,
        covariance=tuple(tuple(float(c) for c in row) for row in symmetric),
        speed_range=(float(np.quantile(speed, 0.02)), max(speed)),
        grade_range=(min(grade), max(grade)),
    )


def _cover(residual: Floats, weight: Floats, level: float) -> tuple[float, float]:
    """Reduction of F_b/W [1] and safety offset [m] that cover the stops.

    A linear program: the smallest distance of a stop on level ground for which every stop would be
    covered if its residual were a quarter larger. Scatter of the force matters downhill and from
    high speed; covered by the offset alone, all other stops would pay for those.

    Args:
        residual: distance of stops beyond the model, shape (n,) [m].
        weight: their ∂(distance)/∂(F_b/W), shape (n,) [m].
        level: the same on level ground [m].
    """
    solution = linprog(
        (level, 1.0),
        A_ub=-np.column_stack((weight, np.ones_like(weight))),
        b_ub=-_FACTOR * np.maximum(residual, 0.0),
        bounds=((0.0, _MAX_FORCE_SHARE), (0.0, None)),
    )
    if solution.status != 0:
        raise RuntimeError(f"no margin found: {solution.message}")
    return float(solution.x[0]), float(solution.x[1])


def residuals(samples: list[StopSample], b: Braking, cross_slope: float, crest: float) -> Floats:
    """Distance of each stop beyond the model without its offset, shape (n,) [m]."""
    model = _model("fit", b, cross_slope, crest)
    predicted = np.array([simulate_stop(model, s.track, s.speed).distance for s in samples])
    residual: Floats = np.array([s.distance for s in samples]) - predicted
    return residual


def _model(name: str, b: Braking, cross_slope: float, crest: float) -> Model:
    effects = tuple(
        Effect(name=effect, parameters={"k": k}, source="stops of the closed loop")
        for effect, k in (("cross_slope", cross_slope), ("crest_unloading", crest))
    )
    return Model(name=name, vehicle=QUAD, braking=b, terrain=ROLLING, limits=LIMITS, effect=effects)
