"""Braking models of a whole fleet: each vehicle's own, pooled where its stops say little.

Surface by surface the stops of all vehicles make one hierarchy (:mod:`.hierarchy`). Dead times are
pooled likewise. The distances of all stops beyond the prediction by their vehicle's law are one
distribution with vehicles as its sessions (:mod:`.distance_model`); the residual of a vehicle's law
is scatter of its force. Where the stops of one vehicle were longer than that promises, rejected
ones included, its promise is longer in proportion. A vehicle that contradicts the others is named.

Validity: vehicles of one kind, speeds and grades inside those of the fleet's stops.
Source: Braking (8), (11), (12); pooling is not in the paper.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from slopewise.models.arrays import Bools, Floats
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
from slopewise.models.stop_distance import MAX_FACTOR, StopDistance
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.dead_time import DeadTime
from slopewise.models.stop_logs.measured_log import MeasuredLog
from slopewise.models.stop_logs.stop_record import StopRecord
from slopewise.models.surface_braking import SurfaceBraking

MIN_VEHICLE_STOPS = 2
"""Stops of a vehicle below which it gets the fleet's mean."""

_NO_STOPS = 2.0  # standard deviations by which the dead time of a vehicle without stops is longer
_MIN_STD = 1e-4  # [s] of a dead time
_NOTABLY_LONGER = 1.1  # factor of promised distances that is worth a sentence [1]


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
        notes: by vehicle, where its stops contradict the others or each other, as sentences.
    """

    braking: dict[str, Braking]
    surfaces: dict[str, Hierarchy]
    dead_time: DeadTime
    objections: dict[str, tuple[str, ...]]
    notes: dict[str, tuple[str, ...]]


class _Surface(NamedTuple):
    """A surface of the fleet; for each of m vehicles the keys of its table, and its notes."""

    fit: Hierarchy
    keys: list[dict[str, Any]]
    notes: list[tuple[str, ...]]


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
    fits = {n: _surface(vehicles, [n], dead, chosen) for n in enough}
    if not enough or _enough(vehicles, rest, chosen):
        base = _surface(vehicles, rest, dead, chosen)
    else:  # ground without a name brakes like the weakest that has one
        base = min(fits.values(), key=lambda f: float(f.fit.mean @ (0.0, 0.0, 1.0, 1.0)))
    braking, rejected, notes = {}, {}, {}
    distinct = list({id(f): f for f in (base, *fits.values())}.values())
    for i, vehicle in enumerate(vehicles):
        tables = dict(known.terrain)
        for name in enough:
            values = fits[name].keys[i]
            before = tables.get(name, SurfaceBraking())
            tables[name] = dataclasses.replace(before, **values)
        braking[vehicle.name] = dataclasses.replace(
            known, uphill=None, dead_time=float(dead[i]), terrain=tables, **base.keys[i]
        )
        of_surfaces = [
            _with_bounds(vehicle, braking[vehicle.name], group, chosen.coverage)
            for group in (rest, *([n] for n in enough))
        ]
        dead_time = 0.0 if vehicle.dead_time is None else vehicle.dead_time.value
        reasons = objections(filter(None, of_surfaces), dead_time) + vehicle.objections
        if reasons:
            rejected[vehicle.name] = reasons
        if texts := tuple(text for f in distinct for text in f.notes[i]):
            notes[vehicle.name] = texts
    surfaces = {"": base.fit, **{n: fits[n].fit for n in enough}}
    return FleetCalibration(braking, surfaces, fleet_dead, rejected, notes)


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
    fit = random_effects.fit_mean(value, std, float(np.median(value)), 1.0)
    mean, between = float(fit.coefficients[0]), fit.scatter
    each = np.full(len(vehicles), mean + _NO_STOPS * between)
    known = np.array([v.dead_time is not None for v in vehicles])
    pooled = mean + between**2 / (between**2 + std**2) * (value - mean)
    # One that contradicts the others was rejected: a longer one is how its brakes answer.
    each[known] = np.where(~fit.kept & (value > mean), value, pooled)
    return DeadTime(mean, float(np.sqrt(fit.covariance[0, 0])), between), np.maximum(each, 0.0)


def _surface(
    vehicles: Sequence[VehicleStops],
    surfaces: Sequence[str],
    dead: Floats,
    settings: CalibrationSettings,
) -> _Surface:
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
    pooled = fit.contradiction[owner] <= 0.0
    law = SurfaceLaw(fit.mean, float(np.mean(dead)))
    table = learn_distance(stops.of(pooled), law, ranges).table
    short = (time - stopping_time(held, dead[owner], predicted))[pooled]
    common = {
        "speed_range": ranges[0],
        "grade_range": ranges[1],
        "speed_by_grade": None,
        "time_offset": offset_for(settings.coverage, short[np.isfinite(short)]),
    }
    keys: list[dict[str, Any]] = []
    notes: list[tuple[str, ...]] = []
    for i, vehicle in enumerate(vehicles):
        mine = owner == i
        promise, factor = _covering(table, stops.of(mine))
        keys.append(_force_keys(fit, i, vehicle, ranges) | promise_keys(promise) | common)
        notes.append(_notes(float(fit.contradiction[i]), force[mine], fit.inliers[mine], factor))
    return _Surface(fit, keys, notes)


def _force_keys(
    fit: Hierarchy,
    i: int,
    vehicle: VehicleStops,
    ranges: tuple[tuple[float, float], tuple[float, float]],
) -> dict[str, Any]:
    """Coefficients of vehicle i and what is not known of them; ranges: speeds, grades."""
    coefficients = fit.coefficients[i]
    covariance = fit.covariance[i] + np.diag([0.0, 0.0, 0.0, vehicle.common_std**2])
    covariance = covariance + by_mount(coefficients, vehicle.mount_std)
    middle = design(np.array([np.mean(ranges[0])]), np.array([np.mean(ranges[1])]))[0]
    return dict(zip(NAMES, coefficients.tolist(), strict=True)) | {
        "force_std": float(np.sqrt(middle @ covariance @ middle)),
        "covariance": tuple(map(tuple, covariance.tolist())),
    }


def _covering(table: StopDistance, stops: Stops) -> tuple[StopDistance, float]:
    """The table of one vehicle, raised where its stops were longer, and by which factor at most.

    At each quantile q no less than the stop of rank q (n + 1) of its n took, the longest beyond.
    """
    ends = np.isfinite(stops.predicted)
    if not ends.any():
        return table, 1.0
    speed, grade, _, actual, predicted, _ = stops.of(ends)
    rows = np.array(table.stop_factor).reshape(len(table.quantiles), -1, len(table.speeds))
    raised = np.ones(len(rows))
    for k, quantile in enumerate(table.quantiles):
        ratio = np.sort(actual / predicted / table.at(quantile, 1.0, speed, grade))
        rank = min(math.ceil(quantile * (len(ratio) + 1)), len(ratio))
        raised[k] = max(float(ratio[rank - 1]), 1.0)
    # Rounded up to the digits of a model file.
    rows = np.ceil(rows * raised[:, None, None] * 1e5 - 1e-6) / 1e5
    rows = np.maximum.accumulate(np.minimum(rows, MAX_FACTOR), axis=0)
    return table.with_factors(rows.reshape(-1, rows.shape[2])), float(raised.max())


def _notes(contradiction: float, force: Floats, inliers: Bools, factor: float) -> tuple[str, ...]:
    """Sentences on one vehicle.

    Args:
        contradiction: difference of its F_b/W from that of the fleet [1], 0 where it is ordinary.
        force: (n,) F_b/W of its stops [1]. inliers: (n,) stops that its coefficients rest on.
        factor: ratio of the promised distances to those of the fleet's table [1].
    """
    texts = []
    if contradiction != 0.0:
        reference = max(float(force.mean()) - contradiction, 1e-3)
        size = f"{abs(contradiction):.2f} of the weight ({abs(contradiction) / reference:.0%})"
        way, plans = "less", "it is planned by its stops"
        if contradiction > 0.0:
            way = "more"
            plans = "v may be misread, so it is planned as a vehicle without stops; "
            plans += "`slopewise calibrate` learns it alone"
        texts.append(
            f"its stops show {size} {way} braking force than the rest of the fleet: {plans}"
        )
    if contradiction <= 0.0 and not inliers.all():
        texts.append(f"{int(np.sum(~inliers))} of its {len(inliers)} stops fit no other")
    if factor > _NOTABLY_LONGER:
        texts.append(f"its longest stops need distances {factor:.2f} times those of the fleet")
    return tuple(texts)
