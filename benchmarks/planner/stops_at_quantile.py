"""Do plans at a quantile keep it? Emergency stops with drawn force, dead time, speed and map error.

Every stop is integrated here, along the ground as it is, by lines that share nothing with the
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

G = 9.80665
_STEP = 0.02
_LONGEST = 40.0
_FORCE_STD, _DEAD_TIME_STD, _SPEED_ERROR = 0.03, 0.03, 0.05
_HEIGHT_STD = 0.02


@dataclass(frozen=True, slots=True)
class QuantileResult:
    """What the drawn stops did.

    Attributes:
        stops, beyond: how many; how many ended beyond the clear distance.
        upper: 95 % bound of their share (Clopper–Pearson).
        worst: longest way beyond [m].
        mean_speed_share: of plans at the quantile, against plans that know everything exactly.
    """

    stops: int
    beyond: int
    upper: float
    worst: float
    mean_speed_share: float

    @property
    def share(self) -> float:
        """Of the stops that ended beyond."""
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
    """The map that the planner gets of it."""
    noise = rng.normal(0.0, _HEIGHT_STD, ground.elevation.shape)
    return replace(ground, elevation=ground.elevation + noise, height_std=_HEIGHT_STD)


def run(stops: int = 100_000, quantile: float = 0.999, seed: int = 1) -> QuantileResult:
    """Plan on many grounds, draw stops from every plan, count those that end too late."""
    rng = np.random.default_rng(seed)
    model, uncertainty = scattering_model(), Uncertainty(quantile=quantile)
    exact = replace(model.braking, speed_error=0.0, drive_in_dead_time="held")
    planner = CandidatePlanner(model, PlannerSettings(), uncertainty)
    knowing = CandidatePlanner(replace(model, braking=exact), PlannerSettings())
    done, beyond, worst, share, shares = 0, 0, -np.inf, 0.0, 0
    while done < stops:
        ground = hills(rng)
        seen = measured(ground, rng)
        paths = [_path(rng, i) for i in range(20)]
        clear = rng.uniform(5.0, 18.0, len(paths))
        plans = planner.plan(seen, paths, clear=clear)
        others = knowing.plan(ground, paths, clear=clear)
        for plan, other in zip(plans, others, strict=True):
            moving = np.flatnonzero(plan.speed > 0.0)
            if len(moving) == 0:
                continue
            if plan.progress > 0.9 * other.progress > 0.0:
                share += (plan.progress / plan.travel_time) / (other.progress / other.travel_time)
                shares += 1
            drawn = rng.choice(moving, min(250, stops - done))
            over = _overruns(plan, drawn, ground, model, rng)
            done += len(drawn)
            beyond += int(np.sum(over > 0.0))
            worst = max(worst, float(over.max(initial=-np.inf)))
    upper = float(beta.ppf(0.95, beyond + 1, done - beyond)) if beyond < done else 1.0
    return QuantileResult(done, beyond, upper, worst, share / max(shares, 1))


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
    drawn: np.ndarray,
    ground: ElevationMap,
    model: Model,
    rng: np.random.Generator,
) -> Floats:
    """By how much stops from the drawn stations end beyond the clear distance, (K,) [m]."""
    b = model.braking
    fine = np.arange(0.0, plan.station[-1] + _LONGEST, _STEP)
    sine = _true_sine(plan, ground, model, fine)
    s = plan.station[drawn].astype(np.float64)
    v = np.maximum(plan.speed[drawn] + rng.normal(0.0, b.speed_error, len(drawn)), 1e-3)
    dead = np.maximum(rng.normal(b.dead_time, b.dead_time_std, len(drawn)), 0.0)
    cut = rng.random(len(drawn)) < 0.5
    coefficients = _coefficients(b, rng, len(drawn))
    scatter = rng.normal(0.0, b.force_std, len(drawn))
    speed_sq, left = v * v, dead.copy()
    onset = np.full(len(drawn), np.nan)
    resting = np.zeros(len(drawn), np.bool_)
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
    drawn: Floats = rng.multivariate_normal(mean, np.array(b.covariance), count).T
    return drawn


def _true_sine(plan: SpeedPlan, ground: ElevationMap, model: Model, fine: Floats) -> Floats:
    """Sine of the grade under the wheels on the ground as it is, along the plan's own stations."""
    half_l, half_w = 0.5 * model.vehicle.wheelbase, 0.5 * model.vehicle.track_width
    x, y = np.interp(fine, plan.station, plan.x), np.interp(fine, plan.station, plan.y)
    hx, hy = np.gradient(plan.x), np.gradient(plan.y)
    norm = np.hypot(hx, hy)
    hx, hy = (np.interp(fine, plan.station, h / norm) for h in (hx, hy))

    def height(ahead: float, aside: float) -> Floats:
        u = (x + ahead * hx - aside * hy) / ground.resolution
        w = (y + ahead * hy + aside * hx) / ground.resolution
        j = np.clip(u.astype(int), 0, ground.elevation.shape[1] - 2)
        i = np.clip(w.astype(int), 0, ground.elevation.shape[0] - 2)
        a, c, z = u - j, w - i, ground.elevation
        low = z[i, j] * (1.0 - a) + z[i, j + 1] * a
        high = z[i + 1, j] * (1.0 - a) + z[i + 1, j + 1] * a
        met: Floats = low * (1.0 - c) + high * c
        return met

    front = 0.5 * (height(half_l, half_w) + height(half_l, -half_w))
    rear = 0.5 * (height(-half_l, half_w) + height(-half_l, -half_w))
    tangent = (front - rear) / (2.0 * half_l)
    sine: Floats = tangent / np.hypot(1.0, tangent)
    return sine
