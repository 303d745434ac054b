"""Braking models of a whole fleet: each vehicle's own, pooled where its stops say little.

Surface by surface the stops of all vehicles make one hierarchy (:mod:`.hierarchy`). Dead times are
pooled likewise. The distances of all stops beyond the prediction by their vehicle's law are one
distribution with vehicles as its sessions (:mod:`.distance_model`); the residual of a vehicle's law
is scatter of its force.

Validity: vehicles of one kind, speeds and grades inside those of the fleet's stops.
Source: Braking (8), (11), (12); pooling is not in the paper.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration import hierarchy
from slopewise.models.calibration.coverage import allowed_distance
from slopewise.models.calibration.distance_table import (
    Stops,
    SurfaceLaw,
    learn_distance,
    promise_keys,
)
from slopewise.models.calibration.force_fit import NAMES, by_mount
from slopewise.models.calibration.hierarchy import Hierarchy
from slopewise.models.calibration.margins import offset_for
from slopewise.models.calibration.notes import SurfaceStops, lost_samples, objections
from slopewise.models.calibration.stopping import stopping_time
from slopewise.models.calibration.surface_fit import (
    CalibrationSettings,
    predicted_distance,
    slope_at_middle,
    trained_ranges,
)
from slopewise.models.errors import ParameterError
from slopewise.models.force_design import design
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.dead_time import DeadTime
from slopewise.models.stop_logs.measured_log import MeasuredLog
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.models.surface_braking import SurfaceBraking

MIN_VEHICLE_STOPS = 2
"""Stops of a vehicle below which it gets the fleet's mean."""

_NO_STOPS = 2.0  # standard deviations by which the dead time of a vehicle without stops is longer
_MIN_STD = 1e-4  # [s] of a dead time


@dataclass(frozen=True, slots=True)
class VehicleStops:
    """The stops of one vehicle.

    Attributes:
        name: vehicle. stops: measured, with the brakes applied in full.
        dead_time: dead time of the brakes, None without stops.
        common_std: F_b/W by the error of its dead time, the same in all its stops [1].
        mount_std: pitch sensor's mount [rad], 0 where the ground is from a map.
        note: reason without any, empty with stops.
        objections: reasons to reject the log, as sentences.
    """

    name: str
    stops: tuple[StopRecord, ...] = ()
    dead_time: DeadTime | None = None
    common_std: float = 0.0
    mount_std: float = 0.0
    note: str = ""
    objections: tuple[str, ...] = ()


@dataclass(frozen=True, slots=True)
class FleetCalibration:
    """Braking of a fleet.

    Attributes:
        braking: by vehicle, ready for its model file.
        surfaces: hierarchy of each surface, "" for the base.
        dead_time: fleet's mean [s]; its scatter is the difference from vehicle to vehicle.
        objections: by vehicle, reasons to reject its log; none of a vehicle without any.
    """

    braking: dict[str, Braking]
    surfaces: dict[str, Hierarchy]
    dead_time: DeadTime
    objections: dict[str, tuple[str, ...]]


def vehicle_stops(name: str, log: MeasuredLog, mapped: bool) -> VehicleStops:
    """The stops of a measured log; ``mapped`` says that the ground is known from a map."""
    m = log.measured
    common = abs(float(np.mean(m.by_dead_time))) * m.dead_time.std if m.records else 0.0
    mount_std = 0.0 if mapped else log.mount.std
    return VehicleStops(
        name, tuple(m.records), m.dead_time, common, mount_std, objections=lost_samples(log)
    )


def learn_fleet(
    vehicles: Sequence[VehicleStops], known: Braking, settings: CalibrationSettings | None = None
) -> FleetCalibration:
    """Braking models of all vehicles.

    Args:
        vehicles: some may have no stops; at least two have some.
        known: used where no stop was. settings: coverage, stops that a surface needs.

    Raises:
        ParameterError: too few stops in the whole fleet.
    """
    chosen = settings or CalibrationSettings()
    fleet_dead, dead = _dead_times(vehicles)
    names = sorted({s.samples.terrain for v in vehicles for s in v.stops} - {""})
    enough = [n for n in names if _enough(vehicles, [n], chosen)]
    rest = ["", *(n for n in names if n not in enough)]
    fits: dict[str, tuple[Hierarchy, list[dict[str, Any]]]] = {
        n: _surface(vehicles, [n], dead, chosen) for n in enough
    }
    if not enough or _enough(vehicles, rest, chosen):
        base = _surface(vehicles, rest, dead, chosen)
    else:  # ground without a name brakes like the weakest that has one
        base = min((fits[n] for n in enough), key=lambda f: float(f[0].mean @ (0.0, 0.0, 1.0, 1.0)))
    braking, rejected = {}, {}
    for i, vehicle in enumerate(vehicles):
        tables = dict(known.terrain)
        for name in enough:
            values = fits[name][1][i]
            before = tables.get(name, SurfaceBraking())
            tables[name] = dataclasses.replace(before, **values)
        braking[vehicle.name] = dataclasses.replace(
            known, uphill=None, dead_time=float(dead[i]), terrain=tables, **base[1][i]
        )
        of_surfaces = [
            _with_bounds(vehicle, braking[vehicle.name], group, chosen.coverage)
            for group in (rest, *([n] for n in enough))
        ]
        dead_time = 0.0 if vehicle.dead_time is None else vehicle.dead_time.value
        reasons = objections(filter(None, of_surfaces), dead_time) + vehicle.objections
        if reasons:
            rejected[vehicle.name] = reasons
    surfaces = {"": base[0], **{n: fits[n][0] for n in enough}}
    return FleetCalibration(braking, surfaces, fleet_dead, rejected)


def _with_bounds(
    vehicle: VehicleStops, braking: Braking, surfaces: Sequence[str], quantile: float
) -> SurfaceStops | None:
    """Its stops on surfaces that are one, with what plans allow for each; None without any."""
    records = [
        dataclasses.replace(r, bound_distance=allowed_distance(braking, r, quantile))
        for r in vehicle.stops
        if r.samples.terrain in surfaces
    ]
    on = braking.on(surfaces[0])
    slope = slope_at_middle(np.array(on.coefficients), np.array(on.covariance), on.speed_range)
    return SurfaceStops(surfaces[0], records, slope) if records else None


def _enough(
    vehicles: Sequence[VehicleStops], surfaces: Sequence[str], settings: CalibrationSettings
) -> bool:
    counts = [sum(s.samples.terrain in surfaces for s in v.stops) for v in vehicles]
    return sum(counts) >= settings.min_stops_per_surface and sum(c > 0 for c in counts) > 1


def _dead_times(vehicles: Sequence[VehicleStops]) -> tuple[DeadTime, Floats]:
    """Of the fleet, and (m,) of each vehicle: its own and the fleet's, weighed."""
    dead_times = [v.dead_time for v in vehicles if v.dead_time is not None]
    if not dead_times:
        raise ParameterError("stops", "vehicles with stops, got none")
    value = np.array([d.value for d in dead_times])
    std = np.maximum([d.std for d in dead_times], _MIN_STD)
    fit = random_effects.fit(
        np.ones((len(value), 1)), value, std, np.array([float(np.median(value))]), np.eye(1)
    )
    mean, between = float(fit.coefficients[0]), fit.scatter
    each = np.full(len(vehicles), mean + _NO_STOPS * between)
    known = np.array([v.dead_time is not None for v in vehicles])
    each[known] = mean + between**2 / (between**2 + std**2) * (value - mean)
    return DeadTime(mean, float(np.sqrt(fit.covariance[0, 0])), between), np.maximum(each, 0.0)


def _surface(
    vehicles: Sequence[VehicleStops],
    surfaces: Sequence[str],
    dead: Floats,
    settings: CalibrationSettings,
) -> tuple[Hierarchy, list[dict[str, Any]]]:
    """The hierarchy of a surface, and for each vehicle the keys of its table."""
    pairs = [
        (i, s) for i, v in enumerate(vehicles) for s in v.stops if s.samples.terrain in surfaces
    ]
    owner = np.array([i for i, _ in pairs], np.int64)
    speed, grade, force, noise, held, actual, time = np.array(
        [
            (
                *(r.onset_speed, r.grade, r.force_ratio, r.force_std),
                *(r.samples.window.held_speed, r.samples.distance, r.samples.standstill_time),
            )
            for _, r in pairs
        ],
        np.float64,
    ).T
    fit = hierarchy.fit(design(speed, grade), force, noise, owner, len(vehicles))
    ranges = trained_ranges(speed[fit.inliers], grade[fit.inliers])
    predicted = np.array([predicted_distance(r, fit.coefficients[i], dead[i]) for i, r in pairs])
    names = np.array([v.name for v in vehicles])[owner]
    stops = Stops(held, grade, np.ones_like(held), actual, predicted, names)
    table = learn_distance(stops, SurfaceLaw(fit.mean, float(np.mean(dead))), ranges).table
    short = time - stopping_time(held, dead[owner], predicted)
    common = promise_keys(table) | {
        "speed_range": ranges[0],
        "grade_range": ranges[1],
        "speed_by_grade": None,
        "time_offset": offset_for(settings.coverage, short[np.isfinite(short)]),
    }
    middle = design(np.array([np.mean(ranges[0])]), np.array([np.mean(ranges[1])]))[0]
    keys: list[dict[str, Any]] = []
    for vehicle, coefficients, cov in zip(vehicles, fit.coefficients, fit.covariance, strict=True):
        covariance = cov + np.diag([0.0, 0.0, 0.0, vehicle.common_std**2])
        covariance = covariance + by_mount(coefficients, vehicle.mount_std)
        spread = {
            "force_std": float(np.sqrt(middle @ covariance @ middle)),
            "covariance": tuple(map(tuple, covariance.tolist())),
        }
        keys.append(dict(zip(NAMES, coefficients.tolist(), strict=True)) | common | spread)
    return fit, keys
