"""Plans of our planner on generated ground: relief, obstacles, unknown patches, noise, bands."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from scipy import ndimage

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking
from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.services.check.check_report import CheckReport
from slopewise.services.check.external_plan import plan_of_columns
from slopewise.services.check.plan_checker import check_plan_on_map
from slopewise.services.io.plan_file import driven
from tests.services.check.sound_plans import vehicle

Random = np.random.Generator
HALF_SIZE = 9.0
"""Half the edge of a map [m]."""


@dataclass(frozen=True)
class Scene:
    """One vehicle on one map with a few candidates."""

    model: Model
    ground: ElevationMap
    paths: list[CandidatePath]
    clear: float
    start_speed: float
    quantile: float

    def plans(self) -> list[SpeedPlan]:
        planner = CandidatePlanner(self.model, uncertainty=Uncertainty(quantile=self.quantile))
        options = {"clear": self.clear, "start_speed": self.start_speed}
        return planner.plan(self.ground, self.paths, **options)

    def verdict(self, plan: SpeedPlan) -> CheckReport:
        given = plan_of_columns(driven(plan))
        options = {"clear": self.clear, "quantile": self.quantile}
        return check_plan_on_map(given, self.model, self.ground, **options)


def scene(seed: int) -> Scene:
    """Of every seed another, the same on every machine."""
    rng = np.random.default_rng(seed)
    model = vehicle(str(rng.choice(["atv", "husky", "ugv", "car"])))
    if rng.random() < 0.3:
        model = replace(
            model,
            tracking=Tracking(
                cross_track_std=float(rng.uniform(0.0, 0.1)),
                heading_std=float(rng.uniform(0.0, 0.03)),
                along_track_std=float(rng.uniform(0.0, 0.1)),
                latency=float(rng.uniform(0.0, 0.2)),
                latency_std=float(rng.uniform(0.0, 0.05)),
            ),
        )
    start_speed = float(rng.uniform(0.0, 0.6) * model.limits.speed) if rng.random() < 0.4 else 0.0
    return Scene(
        model=model,
        ground=_map(model, rng),
        paths=[_path(n, rng) for n in range(3)],
        clear=float(rng.uniform(3.0, 12.0)) if rng.random() < 0.3 else np.inf,
        start_speed=start_speed,
        quantile=float(rng.choice([0.5, 0.95, 0.999])),
    )


def checked(scene: Scene) -> Iterator[tuple[SpeedPlan, list[str]]]:
    """Plans that may be driven, by their status, and what the checker has against each."""
    for plan in scene.plans():
        if plan.status is Status.INFEASIBLE:
            continue
        violations = scene.verdict(plan).violations
        yield plan, [f"{v.kind} at {v.station:.2f} m: {v.sentence}" for v in violations]


def _map(model: Model, rng: Random) -> ElevationMap:
    cell = float(rng.choice([0.05, 0.1, 0.25, 0.5], p=[0.15, 0.4, 0.35, 0.1]))
    along = np.arange(-HALF_SIZE, HALF_SIZE, cell)
    x, y = np.meshgrid(along, along)
    z = _waves(x, y, rng)
    for _ in range(rng.integers(0, 4)):
        z = _with_obstacle(z, x, y, model, rng)
    std = float(rng.choice([0.0, 0.005, 0.01, 0.02], p=[0.6, 0.15, 0.15, 0.1]))
    length = float(rng.choice([0.0, 0.3])) if std > 0.0 else 0.0
    errors = rng.standard_normal(z.shape)
    if length > 0.0:
        errors = ndimage.gaussian_filter(errors, length / cell / np.sqrt(2.0), mode="wrap")
        errors /= errors.std()
    for _ in range(rng.integers(0, 3)):
        place, size = rng.uniform(-HALF_SIZE, HALF_SIZE, 2), rng.uniform(0.2, 2.0, 2)
        z[(abs(x - place[0]) < size[0]) & (abs(y - place[1]) < size[1])] = np.nan
    return ElevationMap(
        elevation=z + std * errors,
        resolution=cell,
        origin=(-HALF_SIZE, -HALF_SIZE),
        height_std=std,
        correlation_length=length,
    )


def _waves(x: Floats, y: Floats, rng: Random) -> Floats:
    """From long swells to waves as short as a vehicle."""
    z = rng.uniform(-0.2, 0.2) * x + rng.uniform(-0.2, 0.2) * y
    for _ in range(rng.integers(0, 6)):
        length, course = rng.uniform(1.0, 20.0), rng.uniform(0.0, 2.0 * np.pi)
        steepness = rng.uniform(0.0, 0.25) * min(length / 5.0, 1.0)
        phase = 2.0 * np.pi * (x * np.cos(course) + y * np.sin(course)) / length
        z = z + steepness * length / (2.0 * np.pi) * np.sin(phase + rng.uniform(0.0, 6.0))
    return z


def _with_obstacle(z: Floats, x: Floats, y: Floats, model: Model, rng: Random) -> Floats:
    """Rocks, holes, logs, ditches, steps and cliffs around what the vehicle climbs."""
    radius = model.vehicle.wheel_radius
    height = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.1, 1.5) * radius)
    if rng.random() < 0.15:
        height = -1.5
    place, turn = rng.uniform(-6.0, 6.0, 2), rng.uniform(0.0, np.pi)
    along = (x - place[0]) * np.cos(turn) + (y - place[1]) * np.sin(turn)
    across = (y - place[1]) * np.cos(turn) - (x - place[0]) * np.sin(turn)
    length, width = rng.choice([0.3, 1.0, 30.0]), rng.choice([0.1, 0.3, 1.0, 30.0])
    return np.where((abs(along) < length) & (across > 0.0) & (across < width), z + height, z)


def _path(number: int, rng: Random) -> CandidatePath:
    """Curves of changing curvature, a few of them with a corner."""
    spacing = float(rng.uniform(0.1, 0.6))
    count = int(rng.uniform(4.0, 14.0) / spacing)
    turning = rng.uniform(-0.3, 0.3) + rng.uniform(0.0, 0.3) * np.sin(
        np.arange(count) * spacing * rng.uniform(0.3, 1.2)
    )
    if rng.random() < 0.2:
        turning[rng.integers(0, count)] += rng.uniform(-1.0, 1.0) / spacing
    heading = rng.uniform(0.0, 2.0 * np.pi) + np.cumsum(turning) * spacing
    steps = spacing * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    start = rng.uniform(-5.0, 5.0, 2)
    return CandidatePath(f"{number}", start + np.concatenate([[[0.0, 0.0]], np.cumsum(steps, 0)]))
