"""From a drive log to the braking part of a model file.

Stops are found, measured on their ground and fitted jointly; what their distances leave is one
distribution; surfaces with stops enough get separate coefficients.

Source: Braking Sec. 2, 4.1 and 4.2.
"""

from __future__ import annotations

import dataclasses
import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import NDArray

from slopewise.models.arrays import Floats
from slopewise.models.calibration.brake_levels import BrakeLevels, at_full_level, identifies_levels
from slopewise.models.calibration.coverage import allowed_distance
from slopewise.models.calibration.distance_table import MIN_STOPS, promise_keys
from slopewise.models.calibration.effects_in_force import identifies_turns, net_of_effects
from slopewise.models.calibration.force_fit import NAMES
from slopewise.models.calibration.notes import lost_samples, notes, objections
from slopewise.models.calibration.speed_error import SpeedError, speed_error
from slopewise.models.calibration.surface_fit import (
    CalibrationSettings,
    SurfaceFit,
    fit_records,
    fit_surfaces,
)
from slopewise.models.calibration.uphill import Asymmetry, clear_asymmetry, net_of_uphill
from slopewise.models.parameters import Braking, Model
from slopewise.models.stop_logs.dead_time import DeadTime
from slopewise.models.stop_logs.drive_quality import Suspect, usable
from slopewise.models.stop_logs.find_stops import StopWindow
from slopewise.models.stop_logs.ground_grade import Dive
from slopewise.models.stop_logs.measure import Measured, Slope
from slopewise.models.stop_logs.measured_log import MeasuredLog, measure_stops
from slopewise.models.stop_logs.mount_offset import Mount
from slopewise.models.stop_logs.sinking_commands import sinking_commands
from slopewise.models.surface_braking import SurfaceBraking, UphillBraking


@dataclass(frozen=True, slots=True)
class Calibration:
    """Braking learned from a drive log.

    Attributes:
        braking: ready for a model file.
        surfaces: the base first, then each named surface that was distinguished.
        windows: every stop of the log, usable or not. suspects: stretches excluded.
        dead_time, dive, mount: what all stops share.
        speed_error: how well speeds are driven; None where the log does not show it.
        warnings: what a user has to know before trusting it, in sentences.
        objections: reasons to reject the log, as sentences; empty without any.
        levels: how the force grows with the application; None where the log does not show it.
    """

    braking: Braking
    surfaces: tuple[SurfaceFit, ...]
    windows: tuple[StopWindow, ...]
    suspects: tuple[Suspect, ...]
    dead_time: DeadTime
    dive: Dive
    mount: Mount
    speed_error: SpeedError | None
    warnings: tuple[str, ...]
    objections: tuple[str, ...] = ()
    levels: BrakeLevels | None = None

    @property
    def verdicts(self) -> dict[str, int]:
        """Stops by verdict."""
        return dict(Counter(w.verdict.name.lower() for w in self.windows))


def learn(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    known: Braking,
    *,
    ground: Floats | None = None,
    settings: CalibrationSettings | None = None,
    effects_model: Model | None = None,
) -> Calibration:
    """Learn the braking model from a log.

    Args:
        columns: channels of a drive log, (n,): ``t``, ``v``, ``v_cmd``, ``pitch`` and what else it
            has. runs: samples of each run.
        known: braking model so far; it decides only what the log does not show.
        ground: (n,) grade of the ground from a map [rad], NaN where unknown; without it the grade
            comes from the body's pitch, with dive and mount removed as far as the log shows them.
        settings: coverage and criteria of a stop.
        effects_model: model whose named effects stay in force; what they explain is not learned
            again. One that knows what turning costs makes stops in curves usable, if yaw rate is
            logged.

    Raises:
        ParameterError: too few usable stops; says how many were found and what was wrong with them.
    """
    chosen = _with_curves(settings or CalibrationSettings(), effects_model, columns)
    log = measure_log(columns, runs, known, ground=ground, settings=chosen)
    if not identifies_levels(log.measured) and any(
        r.samples.window.level < chosen.stops.full_brake for r in log.measured.records
    ):
        stops = dataclasses.replace(chosen.stops, partial=False)
        chosen = dataclasses.replace(chosen, stops=stops)
        log = measure_log(columns, runs, known, ground=ground, settings=chosen)
    measured, mount = log.measured, log.mount
    if effects_model is not None:
        measured = net_of_effects(measured, effects_model, columns)
    rolling = 0.0 if effects_model is None else effects_model.terrain.rolling_while_braking
    measured, levels = at_full_level(measured, known, rolling)
    surfaces, warnings = fit_surfaces(measured, known, mount, chosen, levels)
    uneven = None if levels is not None else clear_asymmetry(surfaces[0], effects_model)
    if uneven is not None:
        measured = net_of_uphill(measured, uneven.value, known)
        surfaces, warnings = fit_surfaces(measured, known, mount, chosen, levels)
    warnings += notes(surfaces[0], mount, known, uneven)
    warnings += (*sinking_commands(columns, log.windows), *log.notes)
    usable_samples = usable(len(columns["t"]), log.suspects, ["v", "v_cmd"])
    driven = speed_error(columns, runs, usable_samples)
    braking = _braking(known, surfaces, measured.dead_time, uneven)
    if driven is not None:
        braking = dataclasses.replace(braking, speed_error=driven.value)
    if levels is not None:
        braking = dataclasses.replace(
            braking, dead_band=levels.dead_band, saturation=levels.saturation
        )
    resistance = rolling if levels is None else levels.resistance
    allowed = tuple(_with_bounds(s, braking, resistance, chosen.coverage) for s in surfaces)
    return Calibration(
        braking,
        allowed,
        log.windows,
        log.suspects,
        measured.dead_time,
        measured.dive,
        mount,
        driven,
        tuple(warnings),
        (*objections(allowed, measured.dead_time.value), *lost_samples(log)),
        levels,
    )


def _with_curves(
    settings: CalibrationSettings, effects_model: Model | None, columns: Mapping[str, NDArray[Any]]
) -> CalibrationSettings:
    """Stops in curves count where it is known what turning costs, unless a user says otherwise."""
    stops = settings.stops
    if (
        stops.turn_rate is not None
        or effects_model is None
        or not identifies_turns(effects_model, columns)
    ):
        return settings
    stops = dataclasses.replace(stops, turn_rate=math.inf)
    return dataclasses.replace(settings, stops=stops)


def _with_bounds(
    surface: SurfaceFit, braking: Braking, rolling: float, quantile: float
) -> SurfaceFit:
    """The surface with what plans allow for each of its stops."""
    records = tuple(
        dataclasses.replace(r, bound_distance=allowed_distance(braking, r, quantile, rolling))
        for r in surface.records
    )
    return dataclasses.replace(surface, records=records)


def with_learned(model: Model, learned: Calibration) -> Model:
    """The model with what was learned; the rolling resistance of partial stops is the terrain's."""
    terrain = model.terrain
    if learned.levels is not None:
        terrain = dataclasses.replace(terrain, braking_resistance=learned.levels.resistance)
    return dataclasses.replace(model, braking=learned.braking, terrain=terrain)


def measure_log(
    columns: Mapping[str, NDArray[Any]],
    runs: Sequence[slice],
    known: Braking,
    *,
    ground: Floats | None = None,
    settings: CalibrationSettings | None = None,
    min_stops: int = MIN_STOPS,
) -> MeasuredLog:
    """Find and measure the stops of a log; arguments as those of :func:`learn`.

    Args:
        min_stops: stops without which there is nothing to learn; those of a vehicle in a fleet
            may be fewer than those of a vehicle alone.

    Raises:
        ParameterError: too few usable stops; says how many were found and what was wrong with them.
    """

    def plausible_mount(first: Measured, mount: Mount) -> tuple[Mount, Slope]:
        """The mount that the log shows, and the slope coefficient of the stops themselves."""
        m_m, b_m = (float(c) for c in fit_records(first.records, first, known).coefficients[:2])
        return mount, lambda v: m_m * v + b_m

    return measure_stops(
        columns,
        runs,
        lambda v: known.m_m * v + known.b_m,
        plausible_mount,
        ground=ground,
        settings=None if settings is None else settings.stops,
        min_count=min_stops,
    )


def _braking(
    known: Braking, surfaces: Sequence[SurfaceFit], dead: DeadTime, uneven: Asymmetry | None
) -> Braking:
    base, *on_surfaces = (_values(s, uneven) for s in surfaces)
    speed_low, speed_high = base["speed_range"]
    base["speed_range"] = (speed_low, max(speed_high, speed_low + 1e-3))
    # What the stops of this log show takes the place of states.
    tables = {name: table for name, table in known.terrain.items() if table.state_of is None}
    for surface, values in zip(surfaces[1:], on_surfaces, strict=True):
        before = tables.get(surface.name, SurfaceBraking())
        tables[surface.name] = dataclasses.replace(before, **values)
    return dataclasses.replace(known, dead_time=dead.value, terrain=tables, **base)


def _values(surface: SurfaceFit, uneven: Asymmetry | None) -> dict[str, Any]:
    """Keys of a surface in a model file."""
    values, matrix = surface.fit.coefficients, surface.fit.covariance
    covariance = 0.5 * (matrix + matrix.T)
    uphill = None
    if uneven is not None:
        # What is not known of the change counts both ways: the file has one matrix for them.
        covariance[1, 1] += uneven.std**2
        uphill = UphillBraking(m_m=float(values[0]), b_m=float(values[1]) + uneven.value)
    return {
        **dict(zip(NAMES, (float(c) for c in values), strict=True)),
        "uphill": uphill,
        "covariance": tuple(tuple(float(c) for c in row) for row in covariance),
        **promise_keys(surface.distance.table),
        # A grade that is off shifts force and gravity together in every stop of the log.
        "force_std": surface.mount_std * abs(1.0 + float(surface.fit.coefficients[1])),
        "time_offset": surface.time_offset,
        "speed_range": surface.speed_range,
        "grade_range": surface.grade_range,
        "speed_by_grade": surface.speed_by_grade,
    }
