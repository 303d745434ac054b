"""A braking model out of stops driven in the loop, from the robot's own log and map alone.

Onset and deceleration follow from how stopping time and distance go together. Then each stop has
a force ratio, gravity taken out, and one joint least squares over [v θ, θ, v, 1] a surface gives
the four coefficients (Braking (9)–(10), the gravity-free form). One more column, the size of the
roll, is the effect `cross_slope`: tyres that hold a vehicle sideways brake less; another, the load
that crests take, is the effect `crest_unloading`. The grade is the map's: the body dives under
braking, and its pitch would make the ground look steeper downhill than it is.

What the stops then go beyond the model is covered in two parts: by a share of the force, for what
grows with the square of the speed, and by the safety offset (Braking (12)), for what does not.
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

_FEWEST = 20  # stops on one surface
_FAST = 1.2  # [m/s] slower stops say little on the dead time
_BEYOND = 1.25  # the worst of a few hundred stops is not the worst of all
_MOST = 0.1  # share of the weight that may be given up


def fit(samples: list[StopSample], name: str) -> Model:
    """The model that the planner uses.

    Raises:
        ParameterError: too few stops on a surface.
    """
    surfaces = sorted({s.surface for s in samples})
    groups = [[s for s in samples if s.surface == surface] for surface in surfaces]
    for surface, own in zip(surfaces, groups, strict=True):
        if len(own) < _FEWEST:
            raise ParameterError("samples", f">= {_FEWEST} stops on {surface}, got {len(own)}")
    ordered = [s for own in groups for s in own]
    dead_time = dead_time_of(samples)
    rows, force, weight = _regression(ordered, dead_time)
    columns = np.hstack(
        [
            np.where([[s.surface == surface] for s in ordered], rows[:, :4], 0.0)
            for surface in surfaces
        ]
        + [rows[:, 4:]]
    )
    found, _, _, _ = np.linalg.lstsq(columns * weight[:, None], force * weight, rcond=None)
    left = force - columns @ found
    # Stops on even slopes say nothing on crests: then nothing is said.
    bread = np.linalg.pinv(columns.T @ (weight[:, None] ** 2 * columns), hermitian=True)
    # Stops scatter by their force, whatever their weight: the sandwich form.
    meat = columns.T @ ((weight**2 * left)[:, None] ** 2 * columns)
    covariance = bread @ meat @ bread
    # Neither may help: a cross slope and a crest only take away.
    lean, crest = min(float(found[-2]), 0.0), max(float(found[-1]), 0.0)
    tables = {}
    for i, (surface, own) in enumerate(zip(surfaces, groups, strict=True)):
        four = slice(4 * i, 4 * i + 4)
        coefficients = np.asarray(found[four], np.float64)
        b = _braking(own, dead_time, coefficients, np.asarray(covariance[four, four], np.float64))
        moved = weight[[s.surface == surface for s in ordered]]
        fastest = b.speed_range[1]
        level = fastest**2 / (2.0 * GRAVITY * b.level_force(fastest) ** 2)
        margin, offset = _cover(residuals(own, b, lean, crest), moved, level)
        tables[surface] = replace(b, b_b=b.b_b - margin, distance_offset=offset)
    # On ground of no known surface the weakest of all holds.
    weakest = min(tables.values(), key=lambda b: b.level_force(2.0))
    keys = (
        "m_m",
        "b_m",
        "m_b",
        "b_b",
        "distance_offset",
        "covariance",
        "speed_range",
        "grade_range",
    )
    base = replace(
        weakest,
        distance_offset=max(b.distance_offset for b in tables.values()),
        terrain={
            surface: SurfaceBraking(**{key: getattr(b, key) for key in keys})
            for surface, b in tables.items()
        },
    )
    return _model(name, base, lean, crest)


def dead_time_of(samples: list[StopSample]) -> float:
    """From stop command to onset of an evenly braked stop that is as long in time and way [s].

    v t_delay + v (t_f − t_delay)/2 = s, so t_delay = 2 s/v − t_f: half of a gradual build-up counts
    as dead time, the rest as weaker braking. The median over stops fast enough to tell.
    """
    each = [2.0 * s.distance / s.speed - s.stop_time for s in samples if s.speed > _FAST]
    return float(np.median(each))


def _regression(samples: list[StopSample], dead_time: float) -> tuple[Floats, Floats, Floats]:
    """Columns [v θ, θ, v, 1, |φ|, −crest F_b/W], F_b/W, and how far stops move with it [m]."""
    speed = np.array([s.speed for s in samples])
    # What a stop lasts tells the force on average over its time, so the ground counts by time too.
    sine = np.array([np.mean(np.sin(s.while_braking(s.track.grade, dead_time))) for s in samples])
    grade = np.arcsin(sine)
    lean = np.array([s.lean for s in samples])
    crest = np.array([s.crest(dead_time) for s in samples])
    time = np.array([s.stop_time for s in samples])
    slowing = braking.mean_deceleration(speed, dead_time, np.maximum(time, 1.5 * dead_time))
    force = braking.force_ratio_of_deceleration(slowing, grade)
    weight = GRAVITY * speed**2 / (2.0 * slowing**2) * (time > 1.5 * dead_time)
    columns = np.column_stack(
        (speed * grade, grade, speed, np.ones_like(speed), lean, -crest * force)
    )
    return columns, force, weight


def _braking(
    samples: list[StopSample], dead_time: float, four: Floats, covariance: Floats
) -> Braking:
    speed, grade = [s.speed for s in samples], [s.grade for s in samples]
    even = 0.5 * (covariance + covariance.T)
    return Braking(
        m_m=float(four[0]),
        b_m=float(four[1]),
        m_b=float(four[2]),
        b_b=float(four[3]),
        dead_time=dead_time,
        covariance=tuple(tuple(float(c) for c in row) for row in even),
        speed_range=(float(np.quantile(speed, 0.02)), max(speed)),
        grade_range=(min(grade), max(grade)),
    )


def _cover(beyond: Floats, weight: Floats, level: float) -> tuple[float, float]:
    """Share of the weight to give up, and safety offset [m], that cover the stops.

    A linear program: the least that a stop on level ground pays for it, so that every stop that was
    seen would have been covered if it had gone a quarter farther beyond the model. Scatter of the
    force counts most downhill and from high speed; covered by the offset alone, all other stops
    would pay for those.

    Args:
        beyond: (n,) how much farther stops went than the model says [m].
        weight: (n,) how far they move with their force [m]; level: the same on level ground.
    """
    answer = linprog(
        (level, 1.0),
        A_ub=-np.column_stack((weight, np.ones_like(weight))),
        b_ub=-_BEYOND * np.maximum(beyond, 0.0),
        bounds=((0.0, _MOST), (0.0, None)),
    )
    if answer.status != 0:
        raise RuntimeError(f"no margin found: {answer.message}")
    return float(answer.x[0]), float(answer.x[1])


def residuals(samples: list[StopSample], b: Braking, lean: float, crest: float) -> Floats:
    """How much farther each stop went than the model says, without its offset, (n,) [m]."""
    model = _model("fit", b, lean, crest)
    beyond = [s.distance - simulate_stop(model, s.track, s.speed).distance for s in samples]
    return np.array(beyond)


def _model(name: str, b: Braking, lean: float, crest: float) -> Model:
    effects = tuple(
        Effect(name=effect, parameters={"k": k}, source="stops of the closed loop")
        for effect, k in (("cross_slope", lean), ("crest_unloading", crest))
    )
    return Model(name=name, vehicle=QUAD, braking=b, terrain=ROLLING, limits=LIMITS, effect=effects)
