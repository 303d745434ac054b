"""Coefficients and stop distances of each surface, from its measured stops.

The coefficients are a joint fit of the forces; the distance that stops take beyond them is one
distribution (:mod:`.distance_model`). A surface with too few stops is part of the base;
a base without stops is the weakest surface. Source: Braking Sec. 4.1, 4.2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Sequence
from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.brake_levels import BrakeLevels
from slopewise.models.calibration.distance_table import (
    LearnedDistance,
    Stops,
    SurfaceLaw,
    learn_distance,
)
from slopewise.models.calibration.force_fit import ForceFit, by_mount, fit_force, fit_two_stages
from slopewise.models.calibration.hull import Corner, extrapolated_corners, speed_by_grade
from slopewise.models.calibration.margins import offset_for
from slopewise.models.calibration.promise import Promise, promise_of
from slopewise.models.calibration.stopping import stopping_distance, stopping_time
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import design
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix
from slopewise.models.stop_logs.find_stops import StopSettings
from slopewise.models.stop_logs.measure import Measured
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.random_effects import Bounds
from slopewise.models.stop_logs.stop_record import StopRecord, forces_of

_PAD = 0.0087  # [rad] half a degree: a plane is level to no less than that


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """How to learn.

    Attributes:
        coverage: quantile of the stops that margins have to cover; that of plans.
        min_stops_per_surface: stops that a named surface needs to be distinguished from the base.
        stops: criteria of a stop.
    """

    coverage: float = 0.999
    min_stops_per_surface: int = 12
    stops: StopSettings = field(default_factory=lambda: StopSettings(partial=True))

    def __post_init__(self) -> None:
        if not 0.5 <= self.coverage <= 0.9999:
            raise ParameterError("coverage", f"a share in [0.5, 0.9999], got {self.coverage:g}")


@dataclass(frozen=True, slots=True)
class SurfaceFit:
    """Braking learned on one surface.

    Attributes:
        name: surface, "" for the base.
        fit: coefficients with covariance. records: its stops with predictions by fits without them.
        distance: what stops take beyond the prediction. share: of stops, promised.
        mount_std: error of the grade that all stops share, which their distances do not show [rad].
        time_offset: margin of the stopping time for the required coverage [s].
        speed_range, grade_range: ranges of the stops that the fit rests on [m/s], [rad].
        two_stages: (4,) the paper's own estimator, None where it cannot be formed.
    """

    name: str
    fit: ForceFit
    records: tuple[StopRecord, ...]
    distance: LearnedDistance
    share: float
    mount_std: float
    time_offset: float
    speed_range: tuple[float, float]
    grade_range: tuple[float, float]
    two_stages: Floats | None

    @property
    def promise(self) -> Promise:
        """Promise that the stops support."""
        return promise_of(self.distance, self.share)

    @property
    def slope_at_middle(self) -> tuple[float, float]:
        """Slope coefficient at the middle of the speeds, and its standard deviation [1]."""
        return slope_at_middle(self.fit.coefficients, self.fit.covariance, self.speed_range)

    @property
    def corners(self) -> tuple[Corner, ...]:
        """Corners of the trained rectangle that no stop was near."""
        return extrapolated_corners(*self._driven(), self.fit)

    @property
    def speed_by_grade(self) -> Matrix | None:
        """Highest speeds driven by grade, where a fast corner was not."""
        return speed_by_grade(*self._driven(), self.speed_range, self.grade_range, self.corners)

    def _driven(self) -> tuple[Floats, Floats]:
        return forces_of([r for r in self.records if r.kept])[:2]


def fit_records(records: Sequence[StopRecord], measured: Measured, known: Braking) -> ForceFit:
    """Joint fit of some of the measured stops, near ``known`` where they carry no information."""
    index = {id(r): i for i, r in enumerate(measured.records)}
    rows = [index[id(r)] for r in records]
    return fit_force(
        *forces_of(records),
        np.array(known.coefficients),
        common=(measured.by_dead_time[rows], measured.dead_time.std),
        bounds=_bounds(measured, {r.samples.terrain for r in records}),
    )


def _bounds(measured: Measured, surfaces: Container[str]) -> Bounds | None:
    """Stops of some surfaces that were cut short."""
    short = [r for r in measured.bounds if r.samples.terrain in surfaces]
    if not short:
        return None
    speed, grade, force, noise = forces_of(short)
    return Bounds(design(speed, grade), force, noise)


def fit_surfaces(
    measured: Measured,
    known: Braking,
    mount: Mount,
    settings: CalibrationSettings,
    levels: BrakeLevels | None = None,
) -> tuple[list[SurfaceFit], list[str]]:
    """The base, then every named surface with stops enough."""
    names = sorted({r.samples.terrain for r in measured.records} - {""})
    groups = {n: [r for r in measured.records if r.samples.terrain == n] for n in names}
    enough = {n: g for n, g in groups.items() if len(g) >= settings.min_stops_per_surface}
    rest = [r for r in measured.records if r.samples.terrain not in enough]
    warnings = []
    fits = [_surface(n, g, measured, known, mount, settings, levels) for n, g in enough.items()]
    if len(enough) == 1 and not rest:
        base, fits = dataclasses.replace(fits[0], name=""), []
    elif len(rest) >= settings.min_stops_per_surface or not fits:
        base = _surface("", rest, measured, known, mount, settings, levels)
    else:
        # On level ground, from a speed in the middle.
        weakest = min(fits, key=lambda s: float(s.fit.force_ratio(0.5 * sum(s.speed_range), 0.0)))
        base = dataclasses.replace(weakest, name="")
        warnings.append(
            f"too few stops on ground without a name: it is taken to brake like {weakest.name}, "
            "the weakest surface of the log"
        )
    return [base, *fits], warnings


def _surface(
    name: str,
    records: Sequence[StopRecord],
    measured: Measured,
    known: Braking,
    mount: Mount,
    settings: CalibrationSettings,
    levels: BrakeLevels | None,
) -> SurfaceFit:
    on = known.on(name)
    mount_std = mount.std if records[0].samples.grade is None else 0.0
    fit = fit_records(records, measured, on)
    law = SurfaceLaw(fit.coefficients, measured.dead_time.value, levels)
    seen = _predicted(records, fit, law)
    inliers = [r for r in seen if r.kept]
    speeds, grades, forces, _ = forces_of(inliers)
    ranges = trained_ranges(speeds, grades)
    stops = Stops(
        np.array([r.samples.window.held_speed for r in seen]),
        np.array([r.mean_grade for r in seen]),
        np.array([r.samples.window.level for r in seen]),
        np.array([r.samples.distance for r in seen]),
        np.array([predicted_distance(r, fit.coefficients, law.dead_time) for r in seen]),
        np.array([r.samples.session or r.samples.run for r in seen]),
    )
    distance = learn_distance(stops, law, ranges)
    time = np.array([r.samples.standstill_time - r.predicted_time for r in seen])
    return SurfaceFit(
        name,
        dataclasses.replace(fit, covariance=fit.covariance + by_mount(fit.coefficients, mount_std)),
        tuple(seen),
        distance,
        settings.coverage,
        mount_std,
        offset_for(settings.coverage, time[np.isfinite(time)]),
        *ranges,
        fit_two_stages(speeds, grades, forces),
    )


def slope_at_middle(
    coefficients: Floats, covariance: Floats, speed_range: tuple[float, float]
) -> tuple[float, float]:
    """Slope coefficient at the middle of the speeds, and its standard deviation [1]."""
    x = np.array([0.5 * sum(speed_range), 1.0, 0.0, 0.0])
    return float(x @ coefficients), float(np.sqrt(x @ covariance @ x))


def trained_ranges(speed: Floats, grade: Floats) -> tuple[tuple[float, float], tuple[float, float]]:
    """Speeds [m/s] and grades [rad] that a model holds for, by those (n,) of its stops."""
    return (
        (float(speed.min()), float(speed.max())),
        (float(grade.min()) - _PAD, float(grade.max()) + _PAD),
    )


def _predicted(records: Sequence[StopRecord], fit: ForceFit, law: SurfaceLaw) -> list[StopRecord]:
    """Each stop with the prediction of a fit that has not seen it (leave one out, closed form)."""
    regression = fit.regression
    x = design(*forces_of(records)[:2])
    seen = []
    for i, record in enumerate(records):
        gain = regression.gain[:, i]
        leverage = min(float(x[i] @ gain), 0.99)
        without = fit.coefficients - gain * (float(regression.residuals[i]) / (1.0 - leverage))
        held = record.samples.window.held_speed
        distance = predicted_distance(record, without, law.dead_time)
        seen.append(
            dataclasses.replace(
                record,
                kept=bool(regression.kept[i]),
                predicted_distance=distance,
                predicted_time=float(stopping_time(held, law.dead_time, distance)),
            )
        )
    return seen


def predicted_distance(record: StopRecord, coefficients: Floats, dead_time: float) -> float:
    """Predicted distance of a stop along its ground, with all effects [m]; inf if it rolls on."""
    held = record.samples.window.held_speed
    at_level = record.at_level(coefficients)
    return stopping_distance(held, dead_time, at_level, *record.path) + record.by_effects
