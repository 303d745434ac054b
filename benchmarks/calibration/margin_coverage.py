"""Coverage and cost of margins: `python -m benchmarks.calibration.margin_coverage`

A log of each vehicle is calibrated. Then 40,000 fresh stops are compared with the allowed distance
at a quantile: force reduced by √(φᵀ S φ) of the model file, longer dead time, constant added, worst
of the states. The mean excess is over the median distance, next to that of the true distribution's
quantile.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.calibration.learn import Calibration, learn
from slopewise.models.parameters import Braking
from slopewise.planner.ground.uncertainty import Uncertainty

from .stop_plant import PlantVehicle, conditions, distances, drive_log

VEHICLES = (
    PlantVehicle(name="exact", stops=60, scatter=0.0),
    PlantVehicle(name="scatter 0.01", stops=60, scatter=0.01, late=0.01),
    PlantVehicle(name="scatter 0.03", stops=100, scatter=0.03, late=0.02),
    PlantVehicle(name="scatter 0.05", stops=150, scatter=0.05, late=0.03),
    PlantVehicle(name="scatter 0.06, late 40 ms", stops=300, scatter=0.06, late=0.04),
    PlantVehicle(
        name="scatter 0.02 of the weight", stops=100, scatter=0.02, shared=False, b_m=-0.6
    ),
    PlantVehicle(name="5 % weak by 30 %", stops=120, scatter=0.03, late=0.02, weak=0.05),
    PlantVehicle(name="10 % weak by 30 %", stops=100, scatter=0.03, late=0.02, weak=0.10),
    PlantVehicle(
        name="25 % weak by 40 %", stops=200, scatter=0.03, late=0.02, weak=0.25, ratio=0.6, b_b=0.6
    ),
    PlantVehicle(name="heavy tails, t5", stops=200, scatter=0.03, late=0.01, freedom=5.0),
    PlantVehicle(name="heavy tails, t3", stops=300, scatter=0.03, late=0.01, freedom=3.0),
    PlantVehicle(name="6 sessions", stops=120, scatter=0.02, late=0.02, session=0.03, sessions=6),
)
QUANTILES = (0.99, 0.999)  # one-sided, that plans are made with [1]
FRESH, _REPEATS = 40_000, 4_000  # stops; of each of the conditions below
_CONDITIONS = 300  # at which the true quantile is drawn
# A rough model file, as before any calibration.
_KNOWN = Braking(
    m_m=0.0,
    b_m=-0.1,
    m_b=0.0,
    b_b=0.5,
    dead_time=0.25,
    speed_range=(1.0, 4.0),
    grade_range=(-0.26, 0.26),
)


@dataclass(frozen=True, slots=True)
class MarginCoverage:
    """Margins of one vehicle at one quantile, on fresh stops."""  # words: ok, keys of its JSON

    vehicle: str
    seed: int
    stops: int
    quantile: float
    beyond: float  # share of the stops beyond the allowed distance [1]
    promised: float  # largest share that the quantile permits [1]
    # excess, true_excess: mean over the median distance at the same speed and grade [m]; unbounded
    # distances are excluded and counted
    excess: float
    true_excess: float
    # share of the stops without a bounded distance [1]
    endless: float  # words: ok, a key of its JSON
    state: bool  # whether a degraded state was learned


def allowed_distance(braking: Braking, speed: Floats, grade: Floats, quantile: float) -> Floats:
    """Allowed distance on uniform slopes, the worst of the states [m]."""
    uncertainty = Uncertainty(quantile=quantile)
    x = np.column_stack((speed * grade, grade, speed, np.ones_like(speed)))
    worst = np.zeros_like(speed)
    for name in ("", *braking.states_of("")):
        on = braking.on(name) if name else braking
        force = x @ np.array([on.m_m, on.b_m, on.m_b, on.b_b])
        force = force - np.sqrt(np.einsum("ni,ij,nj->n", x, uncertainty.force_matrix(on), x))
        late = np.full_like(speed, uncertainty.dead_time(on))
        worst = np.maximum(worst, distances(speed, grade, force, late) + on.distance_offset)
    return worst


def check_margins(
    vehicle: PlantVehicle, seed: int, fresh: int = FRESH
) -> tuple[list[MarginCoverage], Calibration]:
    """Calibrate one log of a vehicle and compare fresh stops with its margins."""
    rng = np.random.default_rng([seed, *vehicle.name.encode()])
    columns, runs, ground = drive_log(vehicle, rng)
    learned = learn(columns, runs, _KNOWN, ground=ground)
    speed, grade = conditions(fresh, rng)
    actual = distances(
        speed, grade, _forces(vehicle, speed, grade, rng), vehicle.delays(fresh, rng)
    )
    part = slice(0, _CONDITIONS)
    shape = (_REPEATS, _CONDITIONS)
    v, theta = (np.broadcast_to(a[part], shape) for a in (speed, grade))
    repeats = distances(v, theta, _forces(vehicle, v, theta, rng), vehicle.delays(shape, rng))
    middle = np.median(repeats, axis=0)
    coverage = []
    for q in QUANTILES:
        allowed = allowed_distance(learned.braking, speed, grade, q)
        true = np.quantile(repeats, q, axis=0)
        finite = np.isfinite(allowed[part]) & np.isfinite(true)
        coverage.append(
            MarginCoverage(
                vehicle.name,
                seed,
                vehicle.stops,
                q,
                float(np.mean(actual > allowed)),
                1.0 - q,
                float(np.mean((allowed[part] - middle)[finite])),
                float(np.mean((true - middle)[finite])),
                float(np.mean(~np.isfinite(allowed))),
                learned.surfaces[0].state is not None,
            )
        )
    return coverage, learned


def _forces(
    vehicle: PlantVehicle, speed: Floats, grade: Floats, rng: np.random.Generator
) -> Floats:
    """F_b/W of stops, each in another session."""
    day = 1.0 + vehicle.session * rng.standard_normal(np.shape(speed))
    return np.asarray(vehicle.forces(speed, grade, rng) * day)


def main() -> None:
    """Measure, print a table, write JSON on request."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="logs of each vehicle")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows: list[MarginCoverage] = []
    heads = ("stops", "q", "of promised", "worst log", "excess m", "true m", "times", "endless")
    print(f"{'vehicle':28}" + "".join(f"{head:>12}" for head in heads))
    for vehicle in VEHICLES:
        logs = [h for seed in range(given.seeds) for h in check_margins(vehicle, seed)[0]]
        rows += logs
        for q in QUANTILES:
            at = [h for h in logs if h.quantile == q]
            share = [h.beyond / h.promised for h in at]
            columns = [[getattr(h, n) for h in at] for n in ("excess", "true_excess", "endless")]
            excess, true, endless = (float(np.mean(column)) for column in columns)
            times = excess / max(true, 1e-9)
            figures = (np.mean(share), max(share), excess, true, times, endless)
            text = "".join(f"{figure:12.3f}" for figure in figures)
            print(f"{vehicle.name:28}{vehicle.stops:12d}{q:12.3f}{text}", flush=True)
    if given.json:
        given.json.write_text(json.dumps([asdict(h) for h in rows], indent=1))


if __name__ == "__main__":
    main()
