"""Emergency stops from plans at a quantile, with drawn force, dead time, speed and map error.

Every stop is integrated here, along the true ground, by lines that share nothing with the
planner: force and dead time scatter from stop to stop, the coefficients are drawn from their
covariance, the speed misses its set point, the drive is held or cut during the dead time, and the
heights that the planner was given differ from the ground. Shared with the planner: the form of the
braking law, that all errors are normal, and that heights err independently from cell to cell.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from scipy.stats import beta

from slopewise.models.arrays import Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Braking, Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.planner.settings import PlannerSettings
from slopewise.services.io.files import shipped_files
from slopewise.services.io.model_file import read_model

G = 9.80665  # [m/s²]
_STEP = 0.02  # [m] of the integration, along the ground
_MAX_STOP = 40.0  # [m] after which a stop counts as endless
_FORCE_STD, _DEAD_TIME_STD, _SPEED_ERROR = 0.03, 0.03, 0.05  # [1], [s], [m/s] of good brakes
_HEIGHT_STD = 0.02  # [m] of a lidar map


@dataclass(frozen=True, slots=True)
class QuantileResult:
    """Outcome of the drawn stops.

    Attributes:
        stops: count of the stops.
        beyond: count of those that ended beyond the clear distance.
        upper: 95 % bound of their share (Clopper–Pearson) [1].
        worst: longest distance beyond [m].
        mean_speed_share: mean speed at the quantile, over that of plans without uncertainty [1].
    """

    stops: int
    beyond: int
    upper: float
    worst: float
    mean_speed_share: float

    @property
    def share(self) -> float:
        """Share of the stops that ended beyond [1]."""
        return self.beyond / self.stops


def scattering_model(path: Path | None = None) -> Model:
    """The quad with scatter, no constant offset to hide behind, and a covariance."""
    model = read_model(path or shipped_files("vehicles")["atv"])
    braking = replace(
        model.braking,
        distance_offset=0.0,
        force_std=_FORCE_STD,
        dead_time_std=_DEAD_TIME_STD,
        speed_error=_SPEED_ERROR,
    )
    return replace(model, braking=braking)


def hills(rng: np.random.Generator, size: float = 60.0, resolution: float = 0.25) -> ElevationMap:
    """Ground of a few long waves, up to the trained grades."""
    n = int(size / resolution)
    x, y = np.meshgrid(resolution * np.arange(n), resolution * np.arange(n))
    z = np.zeros_like(x)
    for _ in range(4):
        length, course = rng.uniform(14.0, 40.0), rng.uniform(0.0, np.pi)
        height = 0.16 / (2.0 * np.pi / length) / 2.0
        along = x * np.cos(course) + y * np.sin(course)
        z += height * np.sin(2.0 * np.pi * along / length + rng.uniform(0.0, 2.0 * np.pi))
    return ElevationMap(elevation=z, resolution=resolution, origin=(0.0, 0.0))


def measured(ground: ElevationMap, rng: np.random.Generator) -> ElevationMap:
    """Noisy map of the ground, for the planner."""
    noise = rng.normal(0.0, _HEIGHT_STD, ground.elevation.shape)
    return replace(ground, elevation=ground.elevation + noise, height_std=_HEIGHT_STD)


def run(stops: int = 100_000, quantile: float = 0.999, seed: int = 1) -> QuantileResult:
    """Plan on many grounds, draw stops from every plan, count those that end too late."""
    rng = np.random.default_rng(seed)
    model, uncertainty = scattering_model(), Uncertainty(quantile=quantile)
    exact = replace(model.braking, speed_error=0.0, drive_in_dead_time="held")
    planner = CandidatePlanner(model, PlannerSettings(), uncertainty)
    exact_planner = CandidatePlanner(replace(model, braking=exact), PlannerSettings())
    count, beyond, worst = 0, 0, -np.inf
    shares: list[float] = []
    while count < stops:
        ground = hills(rng)
        noisy_map = measured(ground, rng)
        paths = [_path(rng, i) for i in range(20)]
        clear = rng.uniform(5.0, 18.0, len(paths))
        plans = planner.plan(noisy_map, paths, clear=clear)
        references = exact_planner.plan(ground, paths, clear=clear)
        for plan, reference in zip(plans, references, strict=True):
            moving = np.flatnonzero(plan.speed > 0.0)
            if len(moving) == 0:
                continue
            if plan.progress > 0.9 * reference.progress > 0.0:
                mean_speed = reference.progress / reference.travel_time
                shares.append((plan.progress / plan.travel_time) / mean_speed)
            onsets = rng.choice(moving, min(250, stops - count))
            over = _overruns(plan, onsets, ground, model, rng)
            count += len(onsets)
            beyond += int(np.sum(over > 0.0))
            worst = max(worst, float(over.max(initial=-np.inf)))
    upper = float(beta.ppf(0.95, beyond + 1, count - beyond)) if beyond < count else 1.0
    return QuantileResult(count, beyond, upper, worst, sum(shares) / max(len(shares), 1))


def _path(rng: np.random.Generator, index: int) -> CandidatePath:
    course, start = rng.uniform(-np.pi, np.pi), rng.uniform(22.0, 38.0, 2)
    s = np.linspace(0.0, 18.0, 37)
    heading = course + rng.uniform(-0.03, 0.03) * s
    step = s[1] - s[0]
    x = start[0] + np.concatenate([[0.0], np.cumsum(step * np.cos(heading[:-1]))])
    y = start[1] + np.concatenate([[0.0], np.cumsum(step * np.sin(heading[:-1]))])
    return CandidatePath(f"p{index}", np.column_stack([x, y]))


def _overruns(
    plan: SpeedPlan,
    onsets: np.ndarray,
    ground: ElevationMap,
    model: Model,
    rng: np.random.Generator,
) -> Floats:
    """Distance of stops from these stations beyond the clear distance, shape (K,) [m]."""
    b = model.braking
    fine = np.arange(0.0, plan.station[-1] + _MAX_STOP, _STEP)
    sine = _true_sine(plan, ground, model, fine)
    s = plan.station[onsets].astype(np.float64)
    v = np.maximum(plan.speed[onsets] + rng.normal(0.0, b.speed_error, len(onsets)), 1e-3)
    dead = np.maximum(rng.normal(b.dead_time, b.dead_time_std, len(onsets)), 0.0)
    cut = rng.random(len(onsets)) < 0.5
    coefficients = _coefficients(b, rng, len(onsets))
    scatter = rng.normal(0.0, b.force_std, len(onsets))
    speed_sq, left = v * v, dead.copy()
    onset = np.full(len(onsets), np.nan)
    resting = np.zeros(len(onsets), np.bool_)
    while not resting.all() and float(s[~resting].max()) < fine[-1] - 1.0:
        at = np.clip((s / _STEP).astype(int), 0, len(fine) - 1)
        speed = np.sqrt(np.maximum(speed_sq, 0.0))
        driving = left > 0.0
        onset = np.where(~driving & np.isnan(onset), np.maximum(speed, b.speed_range[0]), onset)
        grade = np.arcsin(sine[at])
        m_m, b_m, m_b, b_b = coefficients
        force = (m_m * onset + b_m) * grade + m_b * onset + b_b + scatter
        rolling = np.where(cut, np.minimum(model.terrain.motion_resistance + sine[at], 0.0), 0.0)
        slowing = G * np.where(driving, rolling, np.nan_to_num(force) + sine[at])
        before = speed_sq
        speed_sq = speed_sq - 2.0 * slowing * _STEP
        stops = (speed_sq <= 0.0) & ~resting & ~driving
        part = np.where(stops, before / np.maximum(before - speed_sq, 1e-12), 1.0)
        s = s + np.where(resting, 0.0, part * _STEP)
        left = left - _STEP / np.maximum(speed, 1e-3)
        resting |= stops
    over: Floats = np.where(resting, s, np.inf) - plan.clear_distance
    return over


def _coefficients(b: Braking, rng: np.random.Generator, count: int) -> Floats:
    mean = np.array([b.m_m, b.b_m, b.m_b, b.b_b])
    if b.covariance is None:
        return np.tile(mean[:, None], (1, count))
    coefficients: Floats = rng.multivariate_normal(mean, np.array(b.covariance), count).T
    return coefficients


def _true_sine(plan: SpeedPlan, ground: ElevationMap, model: Model, fine: Floats) -> Floats:
    """Sine of the true grade under the wheels, along the plan's own stations."""
    half_l, half_w = 0.5 * model.vehicle.wheelbase, 0.5 * model.vehicle.track_width
    x, y = np.interp(fine, plan.station, plan.x), np.interp(fine, plan.station, plan.y)
    hx, hy = np.gradient(plan.x), np.gradient(plan.y)
    norm = np.hypot(hx, hy)
    hx, hy = (np.interp(fine, plan.station, h / norm) for h in (hx, hy))

    def height(x_body: float, y_body: float) -> Floats:
        u = (x + x_body * hx - y_body * hy) / ground.resolution
        w = (y + x_body * hy + y_body * hx) / ground.resolution
        j = np.clip(u.astype(int), 0, ground.elevation.shape[1] - 2)
        i = np.clip(w.astype(int), 0, ground.elevation.shape[0] - 2)
        a, c, z = u - j, w - i, ground.elevation
        low = z[i, j] * (1.0 - a) + z[i, j + 1] * a
        high = z[i + 1, j] * (1.0 - a) + z[i + 1, j + 1] * a
        between: Floats = low * (1.0 - c) + high * c
        return between

    front = 0.5 * (height(half_l, half_w) + height(half_l, -half_w))
    rear = 0.5 * (height(-half_l, half_w) + height(-half_l, -half_w))
    tangent = (front - rear) / (2.0 * half_l)
    sine: Floats = tangent / np.hypot(1.0, tangent)
    return sine
