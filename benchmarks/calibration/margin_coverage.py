"""Do margins hold on fresh stops, and do they smother? `python -m benchmarks.calibration.margins`

A log of each vehicle is calibrated as it is. Then 40,000 fresh stops are held against what a plan
allows at a quantile: the force lower by √(φᵀ S φ) of the model file, the dead time longer, the
constant added, the worst of the states. The mean excess is over the stops' mean distances, beside
that of the true distribution's own quantile.
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

from .plant import PlantVehicle, conditions, distances, drive_log

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
QUANTILES = (0.99, 0.999)
FRESH, _TRUE = 40_000, 4_000
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
class Held:
    """What fresh stops say of one vehicle's margins at one quantile.

    Attributes:
        beyond: share of the stops. promised: at most. excess, true_excess: mean, over the mean
            distance at the same speed and grade [m]; endless bounds are left out and counted.
        endless: share of the stops that the bound gives no end.
    """

    vehicle: str
    seed: int
    stops: int
    quantile: float
    beyond: float
    promised: float
    excess: float
    true_excess: float
    endless: float
    state: bool


def bound(braking: Braking, speed: Floats, grade: Floats, quantile: float) -> Floats:
    """What a plan allows on even slopes [m]; the worst of the states."""
    told = Uncertainty(quantile=quantile)
    x = np.column_stack((speed * grade, grade, speed, np.ones_like(speed)))
    worst = np.zeros_like(speed)
    for name in ("", *braking.states_of("")):
        on = braking.on(name) if name else braking
        force = x @ np.array([on.m_m, on.b_m, on.m_b, on.b_b])
        force = force - np.sqrt(np.einsum("ni,ij,nj->n", x, told.force_matrix(on), x))
        late = np.full_like(speed, told.dead_time(on))
        worst = np.maximum(worst, distances(speed, grade, force, late) + on.distance_offset)
    return worst


def hold(vehicle: PlantVehicle, seed: int, fresh: int = FRESH) -> tuple[list[Held], Calibration]:
    """Calibrate one log of a vehicle and hold fresh stops against it."""
    rng = np.random.default_rng([seed, *vehicle.name.encode()])
    columns, runs, ground = drive_log(vehicle, rng)
    learned = learn(columns, runs, _KNOWN, ground=ground)
    speed, grade = conditions(fresh, rng)
    actual = distances(
        speed, grade, _forces(vehicle, speed, grade, rng), vehicle.delays(fresh, rng)
    )
    part = slice(0, 300)
    many = (_TRUE, 300)
    v, theta = (np.broadcast_to(a[part], many) for a in (speed, grade))
    drawn = distances(v, theta, _forces(vehicle, v, theta, rng), vehicle.delays(many, rng))
    middle = np.median(drawn, axis=0)
    held = []
    for q in QUANTILES:
        allowed = bound(learned.braking, speed, grade, q)
        true = np.quantile(drawn, q, axis=0)
        ends = np.isfinite(allowed[part]) & np.isfinite(true)
        held.append(
            Held(
                vehicle.name,
                seed,
                vehicle.stops,
                q,
                float(np.mean(actual > allowed)),
                1.0 - q,
                float(np.mean((allowed[part] - middle)[ends])),
                float(np.mean((true - middle)[ends])),
                float(np.mean(~np.isfinite(allowed))),
                learned.surfaces[0].state is not None,
            )
        )
    return held, learned


def _forces(
    vehicle: PlantVehicle, speed: Floats, grade: Floats, rng: np.random.Generator
) -> Floats:
    """Of stops of another session each."""
    day = 1.0 + vehicle.session * rng.standard_normal(np.shape(speed))
    return np.asarray(vehicle.forces(speed, grade, rng) * day)


def main() -> None:
    """Measure, print a table, write JSON where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=3, help="logs of each vehicle")
    parser.add_argument("--json", type=Path)
    given = parser.parse_args()
    rows: list[Held] = []
    print(
        f"{'vehicle':28}{'stops':>6}{'q':>7}{'beyond %':>10}{'of promised':>12}"
        f"{'worst log':>10}{'excess m':>10}{'true m':>8}{'times':>7}{'endless':>9}"
    )
    for vehicle in VEHICLES:
        own = [h for seed in range(given.seeds) for h in hold(vehicle, seed)[0]]
        rows += own
        for q in QUANTILES:
            at = [h for h in own if h.quantile == q]
            share = [h.beyond / h.promised for h in at]
            excess, true = (
                float(np.mean([getattr(h, n) for h in at])) for n in ("excess", "true_excess")
            )
            print(
                f"{vehicle.name:28}{vehicle.stops:6d}{q:7.3f}"
                f"{100 * np.mean([h.beyond for h in at]):10.3f}{np.mean(share):12.2f}"
                f"{max(share):10.2f}{excess:10.3f}{true:8.3f}{excess / max(true, 1e-9):7.2f}"
                f"{np.mean([h.endless for h in at]):9.3f}",
                flush=True,
            )
    for q in QUANTILES:
        mean = np.mean([h.beyond / h.promised for h in rows if h.quantile == q])
        print(f"all vehicles at {q}: {mean:.2f} of the promised share beyond")
    if given.json:
        given.json.write_text(json.dumps([asdict(h) for h in rows], indent=1))


if __name__ == "__main__":
    main()
