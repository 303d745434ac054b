"""Coefficients and margins of each surface, out of its measured stops.

The margin of a surface comes from predictions of stops that the fit had not seen. A surface with
too few stops of its own is part of the base; a base without stops is the weakest surface.
Source: Braking Sec. 4.1, 4.2.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy import stats

from models.arrays import Floats
from models.calibration.force_fit import (
    ForceFit,
    design,
    fit_force,
    fit_two_stages,
    with_mount,
)
from models.calibration.margins import FEWEST_STOPS as FEWEST_MEASURED
from models.calibration.margins import offset_for
from models.calibration.stopping import stopping_distance, stopping_time
from models.errors import ParameterError
from models.parameters import Braking
from models.quantity import GRAVITY
from models.stop_logs.find_stops import StopSettings
from models.stop_logs.measure import Measured
from models.stop_logs.mount_offset import Mount
from models.stop_logs.stop_record import StopRecord

FEWEST_STOPS = 8
_LONG, _COSTLY = 0.97, 0.9  # quantiles of stops that count as long, as costly
_SENSOR = 0.01  # [m] what any measured distance is off
_LEAST_PULL = 0.02  # [1] of the weight, net of gravity
_PAD = 0.0087  # [rad] half a degree: a plane is level to no less than that


@dataclass(frozen=True, slots=True, kw_only=True)
class CalibrationSettings:
    """How to learn.

    Attributes:
        coverage: share of future stops that predictions with their offset have to cover.
        fewest_per_surface: stops that a named surface needs to be told from the base.
        stops: what counts as a stop.
    """

    coverage: float = 0.995
    fewest_per_surface: int = 12
    stops: StopSettings = field(default_factory=StopSettings)

    def __post_init__(self) -> None:
        if not 0.5 <= self.coverage < 1.0:
            raise ParameterError("coverage", f"a share in [0.5, 1), got {self.coverage:g}")


@dataclass(frozen=True, slots=True)
class SurfaceFit:
    """What was learned on one surface.

    Attributes:
        name: of the surface, "" for the base.
        fit: coefficients with covariance. records: its stops with predictions by fits without them.
        distance_offset, time_offset: margins for the wanted coverage [m], [s].
        speed_range, grade_range: of the stops that the fit rests on [m/s], [rad].
        two_stages: (4,) the paper's own estimator, None where it cannot be formed.
    """

    name: str
    fit: ForceFit
    records: tuple[StopRecord, ...]
    distance_offset: float
    time_offset: float
    speed_range: tuple[float, float]
    grade_range: tuple[float, float]
    two_stages: Floats | None


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
    )


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
    name: str, records: Sequence[StopRecord], measured: Measured, known: Braking, mount: Mount,
    settings: CalibrationSettings,
) -> SurfaceFit:  # fmt: skip
    on = known.on(name) if name else known
    from_pitch = records[0].samples.grade is None
    fit = fit_records(records, measured, on)
    seen = _predicted(records, fit, measured.dead_time.value)
    kept = [r for r in seen if r.kept]
    time = np.array([r.samples.standstill_time - r.predicted_time for r in kept])
    time = time[np.isfinite(time)]
    mount_std = mount.std if from_pitch else 0.0
    speeds = [r.onset_speed for r in kept]
    grades = [r.grade for r in kept]
    return SurfaceFit(
        name,
        with_mount(fit, mount_std),
        tuple(seen),
        _distance_offset(kept, fit, settings.coverage, mount_std),
        offset_for(settings.coverage, time),
        (float(min(speeds)), float(max(speeds))),
        (float(min(grades)) - _PAD, float(max(grades)) + _PAD),
        fit_two_stages(np.array(speeds), np.array(grades), np.array([r.force_ratio for r in kept])),
    )


def _predicted(records: Sequence[StopRecord], fit: ForceFit, dead_time: float) -> list[StopRecord]:
    """Each stop with the prediction of a fit that has not seen it (leave one out, closed form)."""
    regression = fit.regression
    x = design(np.array([r.onset_speed for r in records]), np.array([r.grade for r in records]))
    seen = []
    for i, record in enumerate(records):
        gain = regression.gain[:, i]
        leverage = min(float(x[i] @ gain), 0.99)
        without = fit.coefficients - gain * (float(regression.residuals[i]) / (1.0 - leverage))
        held = record.samples.window.held_speed
        distance = stopping_distance(held, dead_time, without, *record.path)
        seen.append(
            dataclasses.replace(
                record,
                kept=bool(regression.kept[i]),
                predicted_distance=distance,
                predicted_time=stopping_time(held, dead_time, distance),
            )
        )
    return seen


def _distance_offset(
    records: Sequence[StopRecord], fit: ForceFit, coverage: float, mount_std: float
) -> float:
    """Margin [m] for the stops as they were, for longer ones of their kind, and for the mount.

    What a stop scatters grows with its length, so a margin for all stops may be short for fast ones
    downhill. It is therefore at least what a normal scatter of the force asks for where stops are
    long. On top comes what a mount off by two standard deviations would cost: not a scatter that
    evens out, but an error of every stop alike. Where brakes barely hold the slope no constant
    suffices; the covariance, which has the mount in it, says how much is open there.
    """
    speed = np.array([r.onset_speed for r in records])
    grade = np.array([r.grade for r in records])
    return offset_of(
        np.array([r.samples.distance - r.predicted_distance for r in records]), speed, grade,
        np.array([r.force_ratio for r in records]), fit.coefficients,
        np.hypot(fit.scatter, fit.force_std(speed, grade)), coverage, mount_std,
    )  # fmt: skip


def offset_of(
    shortfall: Floats, speed: Floats, grade: Floats, force_ratio: Floats, coefficients: Floats,
    force_std: Floats, coverage: float, mount_std: float,
) -> float:  # fmt: skip
    """The same from columns, (n,) each.

    Args:
        shortfall: measured minus predicted distance [m]. speed: at onset [m/s]. grade: [rad].
        force_ratio: F_b/W as measured. coefficients: (4,).
        force_std: of F_b/W, from stop to stop and by the coefficients.
        coverage: share of future stops. mount_std: of the pitch sensor's mount [rad].

    Raises:
        ParameterError: too few stops whose prediction ends.
    """
    finite = np.isfinite(shortfall)
    if int(finite.sum()) < FEWEST_MEASURED:
        words = (
            f"at least {FEWEST_MEASURED} stops that the fit can explain, got {int(finite.sum())}"
        )
        raise ParameterError("stops", words)
    pull = np.maximum(force_ratio + np.sin(grade), _LEAST_PULL)
    per_force = speed**2 / (2.0 * GRAVITY * pull**2)  # [m] by which less force makes it longer
    scatter = np.hypot(per_force * force_std, _SENSOR)
    usual = float(stats.norm.ppf(coverage))
    slope = coefficients[0] * speed + coefficients[1]
    lost = np.minimum(2.0 * mount_std * np.abs(1.0 + slope), pull - _LEAST_PULL)
    askew = lost * per_force * pull / (pull - lost)
    long, costly = float(np.quantile(scatter, _LONG)), float(np.quantile(askew, _COSTLY))
    return max(offset_for(coverage, shortfall[finite]), usual * long) + costly
