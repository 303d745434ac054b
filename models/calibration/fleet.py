"""Braking models of a whole fleet: each vehicle's own, pooled where its stops say little.

Surface by surface the stops of all vehicles make one hierarchy (:mod:`.hierarchy`). Dead times are
pooled likewise. The safety offset of a vehicle covers the shortfalls of the whole fleet, each stop
predicted without itself, beyond the margins of force and dead time: these scatter as the whole
fleet's do, and what a vehicle's own coefficients leave open is in their covariance.

Validity: vehicles of one kind, speeds and grades inside those of the fleet's stops.
Source: Braking (8), (11), (12); pooling is not in the paper.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats, Ints
from slopewise.models.calibration import hierarchy
from slopewise.models.calibration.force_fit import NAMES, design
from slopewise.models.calibration.hierarchy import Hierarchy
from slopewise.models.calibration.margins import offset_for
from slopewise.models.calibration.scatter import scatter_of
from slopewise.models.calibration.stop_margins import (
    Margins,
    MeasuredStops,
    force_scatter,
    normal_width,
    own_distance,
    what_is_left,
)
from slopewise.models.calibration.stopping import stopping_distance, stopping_time
from slopewise.models.calibration.surface_fit import CalibrationSettings
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_logs import random_effects
from slopewise.models.stop_logs.dead_time import DeadTime
from slopewise.models.stop_logs.measured_log import MeasuredLog
from slopewise.models.surface_braking import SurfaceBraking

FEWEST = 2
"""Stops of its own without which a vehicle gets the fleet's mean."""

_PAD = 0.0087  # [rad] half a degree: a plane is level to no less than that
_NO_STOPS = 2.0  # standard deviations by which the dead time of a vehicle without stops is longer
_LEAST_STD = 1e-4  # [s] of a dead time


@dataclass(frozen=True, slots=True)
class FleetStop:
    """What is left of a stop once it is measured; SI, see :class:`.stop_record.StopRecord`.

    ``left`` is its distance beyond that of its own force and onset, ``late`` its onset after the
    dead time of its vehicle, ``late_std`` the noise of that, ``by_effects`` what named effects add.
    """

    surface: str
    held_speed: float
    onset_speed: float
    grade: float
    force_ratio: float
    force_std: float
    distance: float
    standstill_time: float
    station: Floats
    ground: Floats
    left: float
    late: float
    late_std: float
    by_effects: float = 0.0


@dataclass(frozen=True, slots=True)
class VehicleStops:
    """The stops of one vehicle.

    Attributes:
        name: of the vehicle. stops: measured. dead_time: of its brakes, None without stops.
        common_std: of F_b/W, what its dead time leaves open in all its stops alike.
        mount_std: of its pitch sensor's mount [rad], 0 where the ground is from a map.
        note: why there are none, empty if there are.
    """

    name: str
    stops: tuple[FleetStop, ...] = ()
    dead_time: DeadTime | None = None
    common_std: float = 0.0
    mount_std: float = 0.0
    note: str = ""


@dataclass(frozen=True, slots=True)
class FleetCalibration:
    """What a fleet's stops told.

    Attributes:
        braking: by vehicle, ready for its model file.
        surfaces: hierarchy of each surface, "" for the base.
        dead_time: of the fleet [s]; its scatter is the difference from vehicle to vehicle.
    """

    braking: dict[str, Braking]
    surfaces: dict[str, Hierarchy]
    dead_time: DeadTime


def vehicle_stops(name: str, log: MeasuredLog, mapped: bool) -> VehicleStops:
    """The stops of a measured log; ``mapped`` says that the ground is known from a map."""
    m = log.measured
    stops = []
    for r in m.records:
        s = r.samples
        station, ground = r.path
        stops.append(
            FleetStop(
                s.terrain,
                s.window.held_speed,
                r.onset_speed,
                r.grade,
                r.force_ratio,
                r.force_std,
                s.distance,
                s.standstill_time,
                station,
                ground,
                s.distance - own_distance(r, 0.0),
                r.knee.onset_time - r.onset_shift - m.dead_time.value,
                float(r.noise * np.sqrt(r.knee.covariance[1, 1])),
                r.by_effects,
            )
        )
    common = abs(float(np.mean(m.by_dead_time))) * m.dead_time.std if stops else 0.0
    mount_std = 0.0 if mapped else log.mount.std
    return VehicleStops(name, tuple(stops), m.dead_time, common, mount_std)


def learn_fleet(
    vehicles: Sequence[VehicleStops], known: Braking, settings: CalibrationSettings | None = None
) -> FleetCalibration:
    """Braking models of all vehicles.

    Args:
        vehicles: some may have no stops; at least two have some.
        known: what no stop tells is kept of it. settings: coverage, stops that a surface needs.

    Raises:
        ParameterError: too few stops in the whole fleet.
    """
    wanted = settings or CalibrationSettings()
    fleet_dead, dead = _dead_times(vehicles)
    names = sorted({s.surface for v in vehicles for s in v.stops} - {""})
    own = [n for n in names if _enough(vehicles, [n], wanted)]
    rest = ["", *(n for n in names if n not in own)]
    fits: dict[str, tuple[Hierarchy, list[dict[str, Any]]]] = {
        n: _surface(vehicles, [n], dead, wanted) for n in own
    }
    if not own or _enough(vehicles, rest, wanted):
        base = _surface(vehicles, rest, dead, wanted)
    else:  # ground without a name brakes like the weakest that has one
        base = min((fits[n] for n in own), key=lambda f: float(f[0].mean @ (0.0, 0.0, 1.0, 1.0)))
    braking = {}
    for i, vehicle in enumerate(vehicles):
        tables = dict(known.terrain)
        for name in own:
            values = fits[name][1][i]
            before = tables.get(name, SurfaceBraking())
            tables[name] = dataclasses.replace(before, **values)
        braking[vehicle.name] = dataclasses.replace(
            known, uphill=None, dead_time=float(dead[i]), terrain=tables, **base[1][i]
        )
    return FleetCalibration(braking, {"": base[0], **{n: fits[n][0] for n in own}}, fleet_dead)


def _enough(
    vehicles: Sequence[VehicleStops], surfaces: Sequence[str], settings: CalibrationSettings
) -> bool:
    counts = [sum(s.surface in surfaces for s in v.stops) for v in vehicles]
    return sum(counts) >= settings.fewest_per_surface and sum(c > 0 for c in counts) > 1


def _dead_times(vehicles: Sequence[VehicleStops]) -> tuple[DeadTime, Floats]:
    """Of the fleet, and (m,) of each vehicle: its own and the fleet's, weighed."""
    told = [v.dead_time for v in vehicles if v.dead_time is not None]
    if not told:
        raise ParameterError("stops", "vehicles with stops, got none")
    value = np.array([d.value for d in told])
    std = np.maximum([d.std for d in told], _LEAST_STD)
    fit = random_effects.fit(
        np.ones((len(value), 1)), value, std, np.array([float(np.median(value))]), np.eye(1)
    )
    mean, between = float(fit.coefficients[0]), fit.scatter
    each = np.full(len(vehicles), mean + _NO_STOPS * between)
    for i, vehicle in enumerate(vehicles):
        if (d := vehicle.dead_time) is not None:
            weight = between**2 / (between**2 + max(d.std, _LEAST_STD) ** 2)
            each[i] = mean + weight * (d.value - mean)
    return DeadTime(mean, float(np.sqrt(fit.covariance[0, 0])), between), np.maximum(each, 0.0)


def _surface(
    vehicles: Sequence[VehicleStops],
    surfaces: Sequence[str],
    dead: Floats,
    settings: CalibrationSettings,
) -> tuple[Hierarchy, list[dict[str, Any]]]:
    """The hierarchy of a surface, and for each vehicle the keys of its table."""
    pairs = [(i, s) for i, v in enumerate(vehicles) for s in v.stops if s.surface in surfaces]
    owner = np.array([i for i, _ in pairs], np.int64)
    speed, grade, force, noise = (
        np.array(
            [(s.onset_speed, s.grade, s.force_ratio, s.force_std) for _, s in pairs], np.float64
        )
        .reshape(-1, 4)
        .T
    )
    x = design(speed, grade)
    fit = hierarchy.fit(x, force, noise, owner, len(vehicles))
    residual, without = _unseen(fit, x, force, noise, owner)
    predicted = np.einsum("ni,ni->n", x, fit.coefficients[owner])
    width = normal_width(settings.coverage)
    scatter = force_scatter(residual, noise, predicted)
    late = scatter_of(
        -np.array([s.late for _, s in pairs]), np.array([s.late_std for _, s in pairs])
    )
    each = [
        Margins(scatter, _dead_time_std(v, late.planned), _doubt(v, fit.covariance[i]))
        for i, v in enumerate(vehicles)
    ]
    over, short = np.empty((2, len(pairs)))
    for j, (i, stop) in enumerate(pairs):
        way = stop.station, stop.ground
        reach = stopping_distance(
            stop.held_speed,
            dead[i] + width * each[i].dead_time,
            without[j],
            *way,
            each[i].matrix(without[j], width),
        )
        mean = stopping_distance(stop.held_speed, dead[i], without[j], *way)
        over[j] = stop.distance - reach - stop.by_effects
        short[j] = stop.standstill_time - stopping_time(
            stop.held_speed, dead[i], mean + stop.by_effects
        )
    stops = MeasuredStops(speed, grade, force, np.array([s.left for _, s in pairs]), over)
    time_offset = offset_for(settings.coverage, short[np.isfinite(short)])
    ranges: dict[str, Any] = {
        "speed_by_grade": None,
        "speed_range": (float(speed[fit.kept].min()), float(speed[fit.kept].max())),
        "grade_range": (float(grade[fit.kept].min()) - _PAD, float(grade[fit.kept].max()) + _PAD),
    }
    return fit, [
        dict(zip(NAMES, fit.coefficients[i].tolist(), strict=True))
        | ranges
        | {
            "distance_offset": what_is_left(stops, margins, width),
            "time_offset": time_offset,
            "force_std": scatter.absolute,
            "force_scatter": scatter.relative,
            "dead_time_std": margins.dead_time,
            "covariance": tuple(map(tuple, _tilted(vehicles[i], fit, i, margins).tolist())),
        }
        for i, margins in enumerate(each)
    ]


def _unseen(
    fit: Hierarchy, x: Floats, force: Floats, noise: Floats, owner: Ints
) -> tuple[Floats, Floats]:
    """Residuals as of stops not seen (n,), and the coefficients without each stop (n, 4).

    As if the fleet's mean and differences stayed. A stop that was left out was not seen at all.
    """
    variance = noise**2 + fit.scatter**2
    residual, without = np.empty(len(x)), np.empty(x.shape)
    for j, i in enumerate(owner.tolist()):
        gain = fit.covariance[i] @ x[j] / variance[j] * fit.kept[j]
        spare = 1.0 - min(float(x[j] @ gain), 0.99)
        off = force[j] - x[j] @ fit.coefficients[i]
        residual[j] = off / np.sqrt(spare)
        without[j] = fit.coefficients[i] - gain * off / spare
    return residual, without


def _dead_time_std(vehicle: VehicleStops, scatter: float) -> float:
    own = 0.0 if vehicle.dead_time is None else vehicle.dead_time.std
    return float(np.hypot(scatter, own))


def _doubt(vehicle: VehicleStops, covariance: Floats) -> Floats:
    """What a vehicle's own coefficients leave open, its dead time counted in."""
    common = np.array([0.0, 0.0, 0.0, vehicle.common_std])
    result: Floats = covariance + np.outer(common, common)
    return result


def _tilted(vehicle: VehicleStops, fit: Hierarchy, i: int, margins: Margins) -> Floats:
    """The covariance for the model file: with what the mount of the pitch sensor leaves open."""
    m_m, b_m = fit.coefficients[i][:2]
    tilt = vehicle.mount_std * np.array([0.0, 0.0, m_m, 1.0 + b_m])
    result: Floats = margins.covariance + np.outer(tilt, tilt)
    return result
