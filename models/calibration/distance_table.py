"""From the measured stops of a surface to the table of factors of its stop distance.

The law is that of the surface: four coefficients, dead time, and what named effects add to each
stop. Its residuals are one distribution (:mod:`.distance_model`), and the table holds its quantiles
for a session that was not seen.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from slopewise.models.arrays import Bools, Floats, Ints
from slopewise.models.calibration.brake_levels import BrakeLevels
from slopewise.models.calibration.distance_model import DistanceModel, StopFeatures, fit_distance
from slopewise.models.errors import ParameterError
from slopewise.models.laws import braking as law
from slopewise.models.quantity import GRAVITY
from slopewise.models.stop_distance import MAX_FACTOR, MIN_DISTANCE, MIN_PULL, StopDistance

MIN_STOPS = 6
"""Stops from which a surface is learned [1]: two more than its force has coefficients."""
QUANTILES = (0.5, 0.9, 0.99, 0.999, 0.9999, 0.999999)
"""Of the table: those that plans may ask for, and enough in between for a straight line."""
_SPEEDS, _GRADES = 6, 3
"""Points of the axes of a table [1]: its logarithm bends by less than 1 % in between."""
_BELOW = 0.7
"""Share of the lowest onset speed at which a table begins [1]."""
_MIN_GRADES = 0.035
"""Spread of grades from which a table depends on them [rad]."""
_MIN_LEVELS = 0.02
"""Spread of levels likewise [1]."""
_MIN_SHARE = 0.03
"""Of the brakes, below which a stop carries no information on them [1]."""


class SurfaceLaw(NamedTuple):
    """The law of a surface: coefficients (4,), dead time [s], what the level of the brakes does.

    ``levels`` is None where every stop of the log counts as one at full brakes.
    """

    coefficients: Floats
    dead_time: float
    levels: BrakeLevels | None = None

    def features(
        self, speed: Floats, grade: Floats, level: Floats, predicted: Floats | None = None
    ) -> StopFeatures:
        """Features of stops (n,); distances on even ground where none are predicted."""
        force = law.force_ratio(grade, speed, *self.coefficients)
        share = np.ones_like(speed)
        if self.levels is not None:
            share = np.maximum(self.levels.share(level), _MIN_SHARE)
            force = self.levels.resistance + share * (force - self.levels.resistance)
        pull = np.maximum(force + np.sin(grade), MIN_PULL)
        late, distance = speed * self.dead_time, predicted
        if distance is None:
            distance = law.stopping_distance(speed, GRAVITY * pull, self.dead_time, 0.0)
        braked = np.maximum(1.0 - late / distance, 0.0)
        weaker, answer = -braked * force / pull, -braked * np.sin(grade) / pull
        return StopFeatures(speed, distance, 1.0 - braked, weaker, answer, share)


class Stops(NamedTuple):
    """Stops of a surface, (n,) each.

    Attributes:
        speed: at the command [m/s]. grade: mean over the stop [rad]. level: brake application [1].
        actual, predicted: distances [m], the latter by the law with all effects. session: names.
    """

    speed: Floats
    grade: Floats
    level: Floats
    actual: Floats
    predicted: Floats
    session: NDArray[np.str_]

    def of(self, members: Bools) -> Stops:
        """Those stops of which ``members`` (n,) is True."""
        speed, grade, level, actual, predicted = (column[members] for column in self[:5])
        return Stops(speed, grade, level, actual, predicted, self.session[members])


@dataclass(frozen=True, slots=True, eq=False)
class LearnedDistance:
    """The distance distribution of one surface.

    Attributes:
        at: features of its n stops. log_ratio: (n,) ln(actual / predicted).
        session: (n,) index of the session of each, 0 … m − 1. table: key of the model file.
    """

    at: StopFeatures
    log_ratio: Floats
    session: Ints
    table: StopDistance


def learn_distance(
    stops: Stops, law_of: SurfaceLaw, ranges: tuple[tuple[float, float], tuple[float, float]]
) -> LearnedDistance:
    """The distribution of the stops of a surface.

    Args:
        stops: measured; one whose prediction does not end is ignored. law_of: law by surface.
        ranges: speeds [m/s] and grades [rad] that the model file will hold for.

    Raises:
        ParameterError: too few stops whose prediction ends.
    """
    ends = np.isfinite(stops.predicted)
    if ends.sum() < MIN_STOPS:
        expected = f"at least {MIN_STOPS} stops that the fit can explain, got {ends.sum()}"
        raise ParameterError("stops", expected)
    speed, grade, level, actual, predicted, names = stops.of(ends)
    level = level if law_of.levels is not None else np.ones_like(level)
    at = law_of.features(speed, grade, level, predicted)
    session: Ints = np.unique(names, return_inverse=True)[1].astype(np.int64)
    log_ratio = np.log(np.maximum(actual, MIN_DISTANCE) / predicted)
    model = fit_distance(at, log_ratio, session)
    table = table_of(model, law_of, (*ranges, (float(level.min()), float(level.max()))))
    return LearnedDistance(at, log_ratio, session, table)


def promise_keys(table: StopDistance) -> dict[str, Any]:
    """Keys of a model file with a table: no other margin of force, dead time or distance is added.

    What all stops of a log have in common, so that none of them shows it, is `force_std`.
    """
    return {"distance": table, "distance_offset": 0.0, "force_scatter": 0.0, "dead_time_std": 0.0}


def table_of(
    model: DistanceModel,
    law_of: SurfaceLaw,
    ranges: tuple[tuple[float, float], tuple[float, float], tuple[float, float]],
) -> StopDistance:
    """The quantiles over speed, grade and level; the allowed distance grows with the speed."""
    (slow, fast), (down, up), (light, full) = ranges
    speeds = np.linspace(max(_BELOW * slow, 1e-3), max(fast, slow + 2e-3), _SPEEDS)
    grades = (
        np.linspace(down, up, _GRADES) if up - down > _MIN_GRADES else np.array([0.5 * (down + up)])
    )
    levels = np.linspace(light, full, 2) if full - light > _MIN_LEVELS else np.array([full])
    level, grade, speed = (a.ravel() for a in np.meshgrid(levels, grades, speeds, indexing="ij"))
    at = law_of.features(speed, grade, level)
    log_ratio = model.log_ratio(at, np.array(QUANTILES))
    shape = len(QUANTILES), len(levels), len(grades), len(speeds)
    allowed = (np.exp(log_ratio) * at.distance).reshape(shape)
    # From less speed the same brakes stop earlier: what bounds the faster stop bounds the slower.
    allowed = np.minimum.accumulate(allowed[..., ::-1], axis=3)[..., ::-1]
    factor = np.clip(allowed / at.distance.reshape(shape[1:]), 1e-3, MAX_FACTOR)
    factor = np.maximum.accumulate(factor, axis=0).reshape(-1, len(speeds))
    return StopDistance(
        quantiles=QUANTILES,
        speeds=tuple(speeds.tolist()),
        grades=tuple(grades.tolist()),
        levels=tuple(levels.tolist()),
        stop_factor=tuple(tuple(round(f, 5) for f in row) for row in factor.tolist()),
        session_std=min(round(model.between_sessions, 5), 1.0),
    )
