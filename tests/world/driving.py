"""A vehicle that drives what the moving horizon answers: cycle by cycle, exactly or with noise.

It knows plans as columns only, and moves along them with separate arithmetic.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from hypothesis import strategies as st
from scipy.interpolate import RegularGridInterpolator

from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import CycleAnswer, PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch, batch
from slopewise.planner.plan import SpeedPlan, Status
from slopewise.planner.settings import PlannerSettings
from tests.world import generated
from tests.world.ground import arc, ground_map, straight
from tests.world.vehicles import Tables, model_of

PERIOD = 0.1
PATIENT = HorizonSettings(budget=60.0, smoothed=2)
"""Time enough for all smoothing, on any machine."""

SAFE = (Status.OK, Status.BLOCKED)


@dataclass
class Drive:
    """A vehicle, its planner, and its drive over some ground."""

    tables: Tables
    ground: ElevationMap
    paths: PathBatch | list[CandidatePath]
    clear: Any = np.inf
    settings: HorizonSettings = PATIENT
    uncertainty: Uncertainty = field(default_factory=lambda: Uncertainty(quantile=0.5))
    x: float = 0.0
    y: float = 0.0
    heading: float = 0.0
    speed: float = 0.0
    noise: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        self.horizon = Horizon(
            model_of(self.tables), self.settings, PlannerSettings(), self.uncertainty
        )
        self.rng = np.random.default_rng(self.seed)
        self.answers: list[CycleAnswer] = []

    @property
    def front(self) -> float:
        """Distance that has to be free beyond the clear distance of the stations [m]."""
        return model_of(self.tables).vehicle.shape.front

    def state(self) -> PlanarState:
        """Measured state: errors up to the noise in speed, and half as many metres sideways."""
        distance, sideways = self.rng.uniform(-1.0, 1.0, 2) * self.noise
        return PlanarState(
            x=self.x - 0.5 * sideways * np.sin(self.heading),
            y=self.y + 0.5 * sideways * np.cos(self.heading),
            heading=self.heading,
            speed=max(self.speed + distance, 0.0),
        )

    def cycle(self) -> CycleAnswer:
        """Ask once, and drive for one period."""
        answer = self.horizon.step(
            self.state(), self.paths, self.ground, clear=self.clear + self.front
        )
        self.answers.append(answer)
        self.move(answer)
        return answer

    def move(self, answer: CycleAnswer) -> None:
        """One period on along the chosen plan; noise makes the way a little shorter or longer.

        Speed is that of the plan where the vehicle gets to: near rest a few millimetres matter.
        """
        plan = answer.chosen
        if plan is None or answer.command.stop:
            self.brake(plan)
            return
        station = nearest_station(plan, self.x, self.y)
        later, self.speed = after(plan, station, PERIOD)
        if self.speed > 0.0:
            later += self.rng.uniform(-0.5, 0.5) * self.noise * PERIOD
            self.speed = speed_at(plan, min(max(later, station), float(plan.station[-1])))
        self.put(plan, max(later, station))

    def brake(self, plan: SpeedPlan | None, deceleration: float = 3.0) -> None:
        """Full braking, along the plan if there is one."""
        way = max(self.speed - 0.5 * deceleration * PERIOD, 0.0) * PERIOD
        self.speed = max(self.speed - deceleration * PERIOD, 0.0)
        if plan is None:
            self.x += way * np.cos(self.heading)
            self.y += way * np.sin(self.heading)
        else:
            self.put(plan, nearest_station(plan, self.x, self.y) + way)

    def put(self, plan: SpeedPlan, station: float) -> None:
        """The vehicle on a station of a plan."""
        self.x = float(np.interp(station, plan.station, plan.x))
        self.y = float(np.interp(station, plan.station, plan.y))
        k = int(np.clip(np.searchsorted(plan.station, station, "right") - 1, 0, len(plan.x) - 2))
        self.heading = float(np.arctan2(plan.y[k + 1] - plan.y[k], plan.x[k + 1] - plan.x[k]))


def nearest_station(plan: SpeedPlan, x: float, y: float) -> float:
    """Where a place is on the first dozen segments of a plan."""
    best, nearest = np.inf, 0.0
    for k in range(min(12, len(plan.station) - 1)):
        begin = np.array([plan.x[k], plan.y[k]])
        step = np.array([plan.x[k + 1], plan.y[k + 1]]) - begin
        share = float(np.clip(step @ (np.array([x, y]) - begin) / (step @ step), 0.0, 1.0))
        distance = float(np.hypot(*(begin + share * step - (x, y))))
        if distance < best:
            best = distance
            nearest = plan.station[k] + share * (plan.station[k + 1] - plan.station[k])
    return float(nearest)


def really_free(drive: Drive, plan: SpeedPlan) -> float:
    """How far it is free from a plan's first station on, along the given candidate."""
    j = drive.paths.names.index(plan.candidate)
    x, y = (a[: drive.paths.count[j], j] for a in (drive.paths.x, drive.paths.y))
    rows, columns = drive.ground.elevation.shape
    north, east = (
        start + drive.ground.resolution * np.arange(n)
        for start, n in zip(drive.ground.origin[::-1], (rows, columns), strict=True)
    )
    known = np.nan_to_num(drive.ground.elevation)
    z = RegularGridInterpolator((north, east), known)(np.stack([y, x], axis=1))
    station = np.concatenate(
        ([0.0], np.cumsum(np.sqrt(np.diff(x) ** 2 + np.diff(y) ** 2 + np.diff(z) ** 2)))
    )
    dx, dy = np.diff(x), np.diff(y)
    share = ((plan.x[0] - x[:-1]) * dx + (plan.y[0] - y[:-1]) * dy) / (dx**2 + dy**2)
    share = np.clip(share, 0.0, 1.0)
    distance = np.hypot(x[:-1] + share * dx - plan.x[0], y[:-1] + share * dy - plan.y[0])
    k = int(np.argmin(distance))
    begin = station[k] + share[k] * (station[k + 1] - station[k])
    return float(
        min(np.broadcast_to(drive.clear, (len(drive.paths.names),))[j], station[-1]) - begin
    )


def speed_at(plan: SpeedPlan, station: float) -> float:
    """v² is linear in station."""
    return float(np.sqrt(np.interp(station, plan.station, plan.speed**2)))


def accel_at(plan: SpeedPlan, station: float) -> float:
    """Constant from station to station."""
    k = int(np.searchsorted(plan.station, station + 1e-6, "right")) - 1
    return float(plan.accel[min(max(k, 0), len(plan.accel) - 1)])


def after(plan: SpeedPlan, station: float, period: float) -> tuple[float, float]:
    """Station and speed a period later, of constant acceleration from station to station."""
    grid = np.union1d(plan.station[plan.station > station], [station])
    speed = np.sqrt(np.interp(grid, plan.station, plan.speed**2))
    with np.errstate(divide="ignore"):
        time = np.concatenate(([0.0], np.cumsum(2.0 * np.diff(grid) / (speed[1:] + speed[:-1]))))
    k = int(np.searchsorted(time, period, "right")) - 1
    if k >= len(grid) - 1 or not np.isfinite(time[k + 1]):
        return float(grid[min(k, len(grid) - 1)]), 0.0
    rest, accel = period - time[k], (speed[k + 1] - speed[k]) / (time[k + 1] - time[k])
    return float(grid[k] + speed[k] * rest + 0.5 * accel * rest**2), float(speed[k] + accel * rest)


@st.composite
def drives(draw: st.DrawFn, noise: float = 0.0, longest: float = 20.0) -> Drive:
    """A vehicle at the beginning of a few paths over ground that it can mostly drive on."""
    tables = draw(generated.tables())
    tables["braking"]["grade_range"] = [-0.4, 0.4]
    tables["limits"]["min_load"] = min(tables["limits"]["min_load"], 0.2)
    height = draw(generated.heights())
    share = draw(st.sampled_from([0.3, 0.6, 1.0]))
    hole = draw(
        generated.maybe(3, st.tuples(generated.between(6.0, 18.0), generated.between(-3.0, 3.0)))
    )
    ground = ground_map(
        lambda x, y: share * height(x, y),
        x=(-4.0, 26.0),
        y=(-16.0, 16.0),
        resolution=draw(st.sampled_from([0.25, 0.5])),
        unknown=(lambda x, y: np.hypot(x - hole[0], y - hole[1]) < 0.8) if hole else None,
    )
    curvatures = draw(st.lists(generated.between(-0.12, 0.12), min_size=1, max_size=3, unique=True))
    length = draw(generated.between(8.0, longest))
    fan = [
        arc(length, k, name=f"{i}") if abs(k) > 1e-3 else straight(length, name=f"{i}")
        for i, k in enumerate(curvatures)
    ]
    return Drive(
        tables,
        ground,
        batch(fan, 0.25),
        clear=draw(st.one_of(st.just(np.inf), generated.between(4.0, longest))),
        uncertainty=draw(
            st.sampled_from([Uncertainty(quantile=0.5), Uncertainty(slope_std=0.005, age=7200.0)])
        ),
        noise=noise,
        seed=draw(st.integers(0, 1000)),
    )
