"""Promised stop distances on vehicles whose brakes the law has no form for.

Fresh stops of new sessions are compared with what plans allow after a calibration, with a simple
regression (twenty lines), and with the true distribution's quantile.
"""

from __future__ import annotations

from functools import partial
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from scipy import stats

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import learn
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Braking
from slopewise.models.stop_promise import promised_line

from ..common.campaign import BenchmarkRequest, Progress, run_jobs
from ..common.text_tables import grouped, table_of
from .brake_kinds import KINDS, BrakeVehicle, StopLog, drive_log, fresh_stops, true_quantiles

QUANTILES = (0.9, 0.99, 0.999)  # promised [1]
STOPS, SESSIONS = (8, 15, 40, 150), (1, 3, 8)  # of the logs
_VEHICLES, _FRESH = 40, 100_000  # logs of each size, stops to compare
_QUICK = 8, 20_000  # the same in a short run
_FACTORS = np.concatenate((np.linspace(0.7, 1.6, 181), np.geomspace(1.61, 50.0, 100)))
"""Factors with which the bounds of the twenty lines are tried [1]; the 60th is 1."""

_BASE: dict[str, Any] = {"m_m": 0.0, "b_m": -0.1, "m_b": 0.0, "b_b": 0.4, "dead_time": 0.3}
ROUGH = Braking(**_BASE, speed_range=(1.0, 4.0), grade_range=(-0.2, 0.2))  # before calibration


class CaseResult(NamedTuple):
    """Shares beyond and mean excess over the mean distance, (Q,) each [1]."""

    kind: str
    stops: int
    sessions: int
    beyond: Floats
    excess: Floats
    peer_beyond: Floats  # of the twenty lines with each factor, (Q, F)
    peer_bound: Floats  # mean of their bounds over the mean distance
    true_excess: Floats
    refused: str


def run(request: BenchmarkRequest, progress: Progress) -> dict[str, Any]:
    """Calibrate, compare, pool."""
    vehicles, fresh = _QUICK if request.quick else (_VEHICLES, _FRESH)
    work = partial(check_case, fresh=fresh)
    by_vehicle = run_jobs(work, range(vehicles), progress, "calibrating generated vehicles")
    results = [row for rows in by_vehicle for row in rows]
    by_size = grouped(results, lambda row: f"{row.stops} stops, {row.sessions} sessions")
    by_kind = grouped(results, lambda row: row.kind)
    return {
        "quantiles": list(QUANTILES),
        "vehicles": vehicles,
        "fresh_stops": fresh,
        "refused": [row.refused for row in results if row.refused],
        "pooled": _pooled(results),
        "by_size": {name: _pooled(rows) for name, rows in by_size.items()},
        "by_kind": {name: _pooled(rows) for name, rows in by_kind.items()},
    }


def show(result: dict[str, Any], console: Console) -> None:
    """Print a row for each size of log and each kind of brakes."""
    columns = [f"beyond ÷ promised, {q:g}" for q in result["quantiles"]]
    columns += ["20 lines, 0.99", "excess ÷ true quantile, 0.99", "20 lines, stretched"]
    table = table_of("promised stop distances, new sessions", *columns)
    parts = {"all": result["pooled"]} | result["by_size"] | result["by_kind"]
    for name, part in parts.items():
        cells = [f"{share:.2f}" for share in part["beyond_over_promised"]]
        cells.append(f"{part['peer_beyond_over_promised'][1]:.2f}")
        cells += [f"{part[key][1]:.2f}" for key in ("excess_over_true", "peer_excess_over_true")]
        table.add_row(name, *cells)
    console.print(table)
    if result["refused"]:
        console.print(f"{len(result['refused'])} logs refused: {result['refused'][0]}")


def check_case(number: int, fresh: int) -> list[CaseResult]:
    """Calibrate logs of all sizes of a vehicle, and compare fresh stops with what plans allow."""
    vehicle, rng = BrakeVehicle.generate(number), np.random.default_rng([number, fresh])
    stops = fresh_stops(vehicle, fresh, rng)
    true = true_quantiles(vehicle, stops[0], stops[1], QUANTILES, rng)
    sizes = [(n, m) for n in STOPS for m in SESSIONS if m <= n // 2]
    return [_check_log(number, *size, stops, true) for size in sizes]


def _check_log(
    number: int, stops: int, sessions: int, fresh: tuple[Floats, Floats, Floats], true: Floats
) -> CaseResult:
    vehicle = BrakeVehicle.generate(number)
    log = drive_log(vehicle, stops, sessions, np.random.default_rng([number, stops, sessions]))
    nothing = np.full(len(QUANTILES), np.nan)
    try:
        braking = learn(log.columns, log.runs, ROUGH, ground=log.ground).braking
    except ParameterError as error:
        refused = f"{vehicle.kind}, {stops} stops: {error}"
        return CaseResult(vehicle.kind, stops, sessions, *(nothing,) * 5, refused)
    inside = is_inside(braking, *fresh[:2])
    speed, grade, actual = (column[inside] for column in fresh)
    known = inside[: true.shape[1]]
    sampled = fresh[2][: true.shape[1]][known]
    allowed = np.array([allowed_distance(braking, speed, grade, q) for q in QUANTILES])
    peer = np.array([twenty_lines(log, speed, grade, q) for q in QUANTILES])
    mean = float(actual.mean())
    within = np.array([np.searchsorted(np.sort(actual / b), _FACTORS, "right") for b in peer])
    beyond, excess = np.mean(actual > allowed, axis=1), np.mean(allowed - actual, axis=1) / mean
    by_peer = (1.0 - within / len(actual), np.mean(peer, axis=1) / mean)
    true_excess = np.mean(true[:, known] - sampled, axis=1) / float(sampled.mean())
    return CaseResult(vehicle.kind, stops, sessions, beyond, excess, *by_peer, true_excess, "")


def is_inside(braking: Braking, speed: Floats, grade: Floats) -> Any:
    """(n,) whether stops are within what was driven."""
    (slow, fast), (low, high) = braking.speed_range, braking.grade_range
    inside = (speed >= slow) & (speed <= fast) & (grade >= low) & (grade <= high)
    if braking.speed_by_grade is not None:
        corners = np.array(braking.speed_by_grade)
        inside &= speed <= np.interp(grade, corners[:, 0], corners[:, 1])
    return inside


def allowed_distance(
    braking: Braking, speed: Floats, grade: Floats, quantile: float, weaker: float = 0.0
) -> Floats:
    """Distance that plans allow on even slopes with brakes weaker by F_b/W; inf without an end."""
    line = promised_line(braking, 0.0, quantile)
    m_m, b_m, m_b, b_b = line.coefficients
    slope = m_m * speed + b_m
    if line.uphill is not None:
        slope = np.where(grade > 0.0, line.uphill[0] * speed + line.uphill[1], slope)
    pull = slope * grade + m_b * speed + b_b + np.sin(grade) - weaker
    braked = speed**2 / (2.0 * 9.80665 * np.where(pull > 0.0, pull, 1.0))
    return np.asarray(speed * line.dead_time + np.where(pull > 0.0, braked, np.inf) + line.constant)


def twenty_lines(log: StopLog, speed: Floats, grade: Floats, quantile: float) -> Floats:
    """Bounds by ln d over ln v, ln² v and grade, with the variance of sessions, Student's t [m]."""

    def design(v: Floats, theta: Floats) -> Floats:
        x = np.log(v)
        return np.column_stack((np.ones_like(x), x, x * x, np.sin(theta)))[:, :columns]

    columns = 4 if len(log.distance) > 10 else 2
    x, y = design(log.speed, log.grade), np.log(log.distance)
    beta = np.linalg.lstsq(x, y, rcond=None)[0]
    residual, n, m = y - x @ beta, len(y), int(log.session.max()) + 1
    within = float(residual @ residual) / max(n - columns, 1)
    between = 0.0
    if m > 1:
        size = np.bincount(log.session)
        means = np.bincount(log.session, residual) / size
        between = max(float(np.var(means, ddof=1)) - within * float(np.mean(1.0 / size)), 0.0)
    at = design(speed, grade)
    spread = np.einsum("ni,ij,nj->n", at, np.linalg.pinv(x.T @ x), at)
    width = np.sqrt(within * (1.0 + spread) + between)
    t = float(stats.t.ppf(quantile, n - columns))
    return np.asarray(np.exp(at @ beta + t * width))


def _pooled(rows: list[CaseResult]) -> dict[str, Any]:
    promised = 1.0 - np.array(QUANTILES)
    accepted = [row for row in rows if not row.refused]

    def mean(name: str) -> Floats:
        return np.asarray(np.mean([getattr(row, name) for row in accepted], axis=0))

    true = mean("true_excess")
    # One factor for all logs of the row, with which their bounds keep their promise together.
    peer = mean("peer_beyond")
    stretch = _FACTORS[np.argmax(peer <= promised[:, None], axis=1)]
    stretched = stretch * mean("peer_bound") - 1.0
    return {
        "calibrations": len(accepted),
        "beyond_over_promised": (mean("beyond") / promised).tolist(),
        "excess": mean("excess").tolist(),
        "excess_over_true": (mean("excess") / true).tolist(),
        "peer_beyond_over_promised": (peer[:, 60] / promised).tolist(),
        "peer_excess_over_true": (stretched / true).tolist(),
        "kinds": sorted({row.kind for row in accepted} & set(KINDS)),
    }
