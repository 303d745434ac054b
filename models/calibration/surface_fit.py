"""Coefficients and margins of each surface, out of its measured stops.

The margins of a surface come from predictions of stops that the fit had not seen. Every stop that
was measured counts in them: those that the fit left out are in the tail of the scatter, or in a
weaker state of the brakes if several are alike. A surface with too few stops of its own is part of
the base; a base without stops is the weakest surface. Source: Braking Sec. 4.1, 4.2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Container, Sequence
from dataclasses import dataclass, field

import numpy as np

from slopewise.models.arrays import Bools, Floats
from slopewise.models.calibration.brake_states import WeakerState, weaker_members, weaker_state
from slopewise.models.calibration.force_fit import (
    ForceFit,
    design,
    fit_force,
    fit_two_stages,
    with_mount,
)
from slopewise.models.calibration.hull import Corner, extrapolated_corners, speed_by_grade
from slopewise.models.calibration.margins import FEWEST_STOPS as FEWEST_MEASURED
from slopewise.models.calibration.margins import offset_for
from slopewise.models.calibration.stop_margins import (
    Margins,
    MeasuredStops,
    bounds,
    dead_time_scatter,
    force_scatter,
    normal_width,
    own_distance,
    unseen_residuals,
    what_is_left,
)
from slopewise.models.calibration.stopping import stopping_distance, stopping_time
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.quantity import Matrix
from slopewise.models.stop_logs.find_stops import StopSettings
from slopewise.models.stop_logs.measure import Measured
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.random_effects import Bounds
from slopewise.models.stop_logs.stop_record import StopRecord

FEWEST_STOPS = 8
"""Stops of a surface from which its own force is fitted [1]: twice its four coefficients."""
_LEAST_FORCE = 0.02  # [1] below which a share of the force says nothing
_PASSES = 3
"""Alternations of fit and scatter [1]: a fixed count keeps results reproducible."""
_PAD = 0.0087  # [rad] half a degree: a plane is level to no less than that


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """How to learn.

    Attributes:
        coverage: quantile of the stops that margins have to cover; that of plans.
        fewest_per_surface: stops that a named surface needs to be told from the base.
        stops: what counts as a stop.
    """

    coverage: float = 0.999
    fewest_per_surface: int = 12
    stops: StopSettings = field(default_factory=lambda: StopSettings(partial=True))

    def __post_init__(self) -> None:
        if not 0.5 <= self.coverage <= 0.9999:
            raise ParameterError("coverage", f"a share in [0.5, 0.9999], got {self.coverage:g}")


@dataclass(frozen=True, slots=True)
class SurfaceFit:
    """What was learned on one surface.

    Attributes:
        name: of the surface, "" for the base.
        fit: coefficients with covariance. records: its stops with predictions by fits without them.
        margins: scatter of force and dead time that plans give up. state: a weaker one, if stops
            showed it.
        distance_offset, time_offset: what is left of the distance, and the margin of the time, for
            the wanted coverage [m], [s].
        speed_range, grade_range: of the stops that the fit rests on [m/s], [rad].
        two_stages: (4,) the paper's own estimator, None where it cannot be formed.
    """

    name: str
    fit: ForceFit
    records: tuple[StopRecord, ...]
    margins: Margins
    state: WeakerState | None
    distance_offset: float
    time_offset: float
    speed_range: tuple[float, float]
    grade_range: tuple[float, float]
    two_stages: Floats | None

    @property
    def corners(self) -> tuple[Corner, ...]:
        """Corners of the trained rectangle that no stop was near."""
        return extrapolated_corners(*self._driven(), self.fit)

    @property
    def speed_by_grade(self) -> Matrix | None:
        """Highest speeds driven by grade, where a fast corner was not."""
        return speed_by_grade(*self._driven(), self.speed_range, self.grade_range, self.corners)

    def _driven(self) -> tuple[Floats, Floats]:
        kept = [r for r in self.records if r.kept]
        return np.array([r.onset_speed for r in kept]), np.array([r.grade for r in kept])


def fit_records(records: Sequence[StopRecord], measured: Measured, known: Braking) -> ForceFit:
    """Joint fit of some of the measured stops, near ``known`` where they say nothing."""
    index = {id(r): i for i, r in enumerate(measured.records)}
    rows = [index[id(r)] for r in records]
    return fit_force(
        np.array([r.onset_speed for r in records]),
        np.array([r.grade for r in records]),
        np.array([r.force_ratio for r in records]),
        np.array([r.force_std for r in records]),
        np.array([known.m_m, known.b_m, known.m_b, known.b_b]),
        common=(measured.by_dead_time[rows], measured.dead_time.std),
        bounds=_bounds(measured, {r.samples.terrain for r in records}),
    )


def _bounds(measured: Measured, surfaces: Container[str]) -> Bounds | None:
    """Stops of some surfaces that were cut short."""
    short = [r for r in measured.bounds if r.samples.terrain in surfaces]
    if not short:
        return None
    force, noise, speed, grade = np.array(
        [(r.force_ratio, r.force_std, r.onset_speed, r.grade) for r in short]
    ).T
    return Bounds(design(speed, grade), force, noise)


def fit_surfaces(
    measured: Measured, known: Braking, mount: Mount, settings: CalibrationSettings
) -> tuple[list[SurfaceFit], list[str]]:
    """The base, then every named surface with stops enough."""
    names = sorted({r.samples.terrain for r in measured.records} - {""})
    groups = {n: [r for r in measured.records if r.samples.terrain == n] for n in names}
    enough = {n: g for n, g in groups.items() if len(g) >= settings.fewest_per_surface}
    rest = [r for r in measured.records if r.samples.terrain not in enough]
    warnings = []
    own = [_surface(n, g, measured, known, mount, settings) for n, g in enough.items()]
    if len(enough) == 1 and not rest:
        base, own = dataclasses.replace(own[0], name=""), []
    elif len(rest) >= settings.fewest_per_surface or not own:
        base = _surface("", rest, measured, known, mount, settings)
    else:
        weakest = min(own, key=_level_force)
        base = dataclasses.replace(weakest, name="")
        warnings.append(
            f"too few stops on ground without a name: it is taken to brake like {weakest.name}, "
            "the weakest surface of the log"
        )
    return [base, *own], warnings


def _level_force(surface: SurfaceFit) -> float:
    speed = 0.5 * sum(surface.speed_range)
    return float(surface.fit.force_ratio(speed, 0.0))


def _surface(
    name: str,
    records: Sequence[StopRecord],
    measured: Measured,
    known: Braking,
    mount: Mount,
    settings: CalibrationSettings,
) -> SurfaceFit:
    on = known.on(name) if name else known
    mount_std = mount.std if records[0].samples.grade is None else 0.0
    late = float(
        np.hypot(dead_time_scatter(records, measured.dead_time).planned, measured.dead_time.std)
    )
    weak = _weak(records, measured, on)
    for _ in range(_PASSES):
        rest = [r for r, out in zip(records, weak.tolist(), strict=True) if not out]
        fit = fit_records(rest, measured, on)
        residual, force = unseen_residuals(fit, rest)
        scatter = force_scatter(residual, np.array([r.force_std for r in rest]), force)
        beyond = residual < -normal_width(settings.coverage) * scatter.std(force)
        beyond &= ~fit.regression.kept
        if not beyond.any():
            break
        # Not alike enough for a law of their own, too far for the tail of the others.
        weak[np.flatnonzero(~weak)[beyond]] = True
    margins = Margins(scatter, late, with_mount(fit, mount_std).covariance)
    state = _state(records, fit, weak, margins) if weak.any() else None
    seen = _predicted(records, fit, weak, measured.dead_time.value)
    offset, seen = _bounded(seen, fit, margins, state, measured.dead_time.value, settings)
    time = np.array([r.samples.standstill_time - r.predicted_time for r in seen])
    speeds = [r.onset_speed for r in seen if r.kept]
    grades = [r.grade for r in seen if r.kept]
    forces = np.array([r.force_ratio for r in seen if r.kept])
    return SurfaceFit(
        name,
        with_mount(fit, mount_std),
        tuple(seen),
        margins,
        state,
        offset,
        offset_for(settings.coverage, time[np.isfinite(time)]),
        (float(min(speeds)), float(max(speeds))),
        (float(min(grades)) - _PAD, float(max(grades)) + _PAD),
        fit_two_stages(np.array(speeds), np.array(grades), forces),
    )


def _weak(records: Sequence[StopRecord], measured: Measured, known: Braking) -> Bools:
    """(n,) stops of a weaker state; the fit that tells them apart does not rest on them."""
    weak = np.zeros(len(records), np.bool_)
    for _ in range(_PASSES):
        rest = [r for r, out in zip(records, weak.tolist(), strict=True) if not out]
        fit = fit_records(rest, measured, known)
        share, noise = _shares(records, fit)
        again = weaker_members(share, noise)
        if (again == weak).all():
            break
        weak = again
    return weak


def _shares(records: Sequence[StopRecord], fit: ForceFit) -> tuple[Floats, Floats]:
    """(n,) force of each stop as a share of the predicted one, minus one, and its noise."""
    speed, grade = (np.array([getattr(r, n) for r in records]) for n in ("onset_speed", "grade"))
    force = np.maximum(fit.force_ratio(speed, grade), _LEAST_FORCE)
    measured = np.array([r.force_ratio for r in records])
    return measured / force - 1.0, np.array([r.force_std for r in records]) / force


def _state(
    records: Sequence[StopRecord], fit: ForceFit, weak: Bools, margins: Margins
) -> WeakerState:
    share, noise = _shares(records, fit)
    usual = margins.force.law.typical
    if margins.force.relative > 0.0:
        usual *= 1.0 + float(np.mean(share[weak]))
    else:
        force = [r.force_ratio for r, out in zip(records, weak.tolist(), strict=True) if not out]
        usual /= max(float(np.median(force)), _LEAST_FORCE)
    return weaker_state(share, noise, weak, usual)


def _predicted(
    records: Sequence[StopRecord], fit: ForceFit, weak: Bools, dead_time: float
) -> list[StopRecord]:
    """Each stop with the prediction of a fit that has not seen it (leave one out, closed form)."""
    seen = []
    regression = fit.regression
    row = np.cumsum(~weak) - 1
    for i, record in enumerate(records):
        without, kept = fit.coefficients, False
        if not weak[i]:
            gain = regression.gain[:, row[i]]
            x = design(np.array([record.onset_speed]), np.array([record.grade]))[0]
            leverage = min(float(x @ gain), 0.99)
            without = without - gain * (float(regression.residuals[row[i]]) / (1.0 - leverage))
            kept = bool(regression.kept[row[i]])
        held = record.samples.window.held_speed
        own = record.at_level(without)
        distance = stopping_distance(held, dead_time, own, *record.path) + record.by_effects
        seen.append(
            dataclasses.replace(
                record,
                kept=kept,
                in_weaker_state=bool(weak[i]),
                predicted_distance=distance,
                predicted_time=stopping_time(held, dead_time, distance),
                without=without,
            )
        )
    return seen


def _bounded(
    records: Sequence[StopRecord],
    fit: ForceFit,
    margins: Margins,
    state: WeakerState | None,
    dead_time: float,
    settings: CalibrationSettings,
) -> tuple[float, list[StopRecord]]:
    """The constant beside all other margins, and the stops with what a plan allows for them.

    Raises:
        ParameterError: too few stops whose prediction ends.
    """
    finite = int(np.isfinite([r.predicted_distance for r in records]).sum())
    if finite < FEWEST_MEASURED:
        words = f"at least {FEWEST_MEASURED} stops that the fit can explain, got {finite}"
        raise ParameterError("stops", words)
    width = normal_width(settings.coverage)
    without = np.array([r.without for r in records])
    bound = bounds(records, without, dead_time, margins, width)
    if state is not None:
        weaker = state_margins(margins, state, fit.coefficients)
        bound = np.maximum(bound, bounds(records, state.ratio * without, dead_time, weaker, width))
    offset = what_is_left(_columns(records, fit, bound), margins, width)
    return offset, [
        dataclasses.replace(r, bound_distance=b + offset)
        for r, b in zip(records, bound.tolist(), strict=True)
    ]


def _columns(records: Sequence[StopRecord], fit: ForceFit, bound: Floats) -> MeasuredStops:
    m_m, b_m = (float(c) for c in fit.coefficients[:2])
    speed, grade, force = (
        np.array([getattr(r, n) for r in records])
        for n in ("onset_speed", "grade", "force_at_level")
    )
    distance = np.array([r.samples.distance for r in records])
    own = np.array([own_distance(r, r.applied * (m_m * r.onset_speed + b_m)) for r in records])
    return MeasuredStops(speed, grade, force, distance - own, distance - bound)


def state_margins(margins: Margins, state: WeakerState, coefficients: Floats) -> Margins:
    """Those of a weaker state: its own scatter, and what is not known of its share."""
    covariance = state.ratio**2 * margins.covariance
    covariance = covariance + state.ratio_std**2 * np.outer(coefficients, coefficients)
    force = margins.force._replace(absolute=0.0, relative=state.scatter)
    return margins._replace(force=force, covariance=covariance)
