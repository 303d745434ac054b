"""A vehicle to calibrate, made of nothing that the project computes with.

Stops are integrated in small steps on ground whose slope varies along the path; the body dives and
rocks back, sensors are noisy and mounted askew. All stops of a log are integrated side by side.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.stats import norm

from slopewise.models.parameters import Braking
from slopewise.models.stop_promise import promised_braking

G = 9.80665
STEP = 0.005  # [s]


@dataclass(frozen=True)
class Plant:
    """True values. Angles in rad, speed noise in m/s, dive in rad s²/m."""

    m_m: float = -0.03
    b_m: float = -0.35
    m_b: float = 0.015
    b_b: float = 0.40
    dead_time: float = 0.3
    speed_noise: float = 0.03
    pitch_noise: float = np.deg2rad(0.3)
    scatter: float = 0.004
    dive: float = 0.0
    settling: float = 0.08
    mount: float = 0.0
    undulation: float = np.deg2rad(1.5)
    outliers: float = 0.0
    uphill: float = 0.0
    hz: float = 100.0

    @property
    def coefficients(self) -> np.ndarray:
        return np.array([self.m_m, self.b_m, self.m_b, self.b_b])

    def force(self, grade: np.ndarray | float, onset_speed: np.ndarray | float) -> np.ndarray:
        m, b = self.m_m * onset_speed + self.b_m, self.m_b * onset_speed + self.b_b
        return np.asarray(m * grade + b + self.uphill * np.maximum(grade, 0.0))


FREE_ROLLING = Plant(m_m=0.0, b_m=-1.0, m_b=0.0, b_b=0.016, scatter=0.0)
"""Brakes with less force than a model file may have; longest stops take 30 s."""


@dataclass(frozen=True)
class Truth:
    """True values, (stops,): speed at the command, mean grade, distance and time to rest.

    ``ahead`` is the grade at every centimetre from the stop command on, (ways, stops).
    """

    speed: np.ndarray
    grade: np.ndarray
    distance: np.ndarray
    time: np.ndarray
    ahead: np.ndarray


def drive(
    plant: Plant,
    stops: int,
    seed: int,
    *,
    grades: tuple[float, float] = (-0.25, 0.25),
    speeds: tuple[float, float] = (1.0, 4.0),
    level: bool = False,
    terrain: str | None = None,
    out_and_back: bool = False,
) -> tuple[dict[str, np.ndarray], list[slice], Truth]:
    """A drive log of some stops, one run a stop, and the truth behind it.

    ``out_and_back`` adds x, y, yaw: every place is driven in both directions.
    """
    rng = np.random.default_rng(seed)
    speed = rng.uniform(*speeds, stops)
    base = np.zeros(stops) if level else rng.uniform(*grades, stops)
    heading, half = np.zeros(stops), (stops + 1) // 2
    if out_and_back:
        base = np.concatenate((base[:half], base[:half]))[:stops]
        heading = np.where(np.arange(stops) < half, 0.0, np.pi)
    amplitude = 0.0 if level else plant.undulation
    phase, wave = rng.uniform(0, 2 * np.pi, stops), rng.uniform(8.0, 16.0, stops)
    error = plant.scatter * rng.standard_normal(stops)
    wild = rng.random(stops) < plant.outliers
    gross = np.where(wild, rng.choice([0.6, 1.7], stops), 1.0)  # of the deceleration

    if out_and_back:
        phase = np.concatenate((phase[:half], phase[:half]))[:stops]
        wave = np.concatenate((wave[:half], wave[:half]))[:stops]
    back, zero = heading > 1.0, np.where(heading > 1.0, 10.0, 0.0)
    way_sign = np.where(back, -1.0, 1.0)

    def ground(s: np.ndarray) -> np.ndarray:
        along = zero + way_sign * s
        return way_sign * (base + amplitude * np.sin(2 * np.pi * along / wave + phase))

    lead, tail = 1.5, 1.6
    v, s = speed.copy(), np.zeros(stops)
    done, way, dive = np.full(stops, np.nan), np.full(stops, np.nan), np.zeros(stops)
    mean, count = np.zeros(stops), np.zeros(stops)
    samples: list[tuple[np.ndarray, ...]] = []
    every = round(1.0 / (plant.hz * STEP))
    k, t = 0, -lead
    while True:
        share = min(max((t + STEP - plant.dead_time) / STEP, 0.0), 1.0)  # of this step
        drives = np.isnan(done)
        braking = share * drives
        theta = ground(s)
        sine = np.sin(theta)
        a = braking * gross * G * (plant.force(theta, speed) + error + sine)
        if k % every == 0:
            since = np.where(drives, 0.0, t - done)
            rock = np.where(drives, 0.0, -0.06 * np.exp(-since / 0.1) * np.sin(since / 0.05))
            samples.append((np.full(stops, t), v + rock, theta, dive, s.copy()))
        if not drives.any() and t > np.max(done) + tail:
            break
        assert t < 60.0, "the plant does not stop"
        dive = dive + STEP / plant.settling * (plant.dive * (a - G * sine) - dive)
        k, t = k + 1, t + STEP
        if not drives.any():
            continue
        middle = np.maximum(v - 0.5 * STEP * a, 0.0)
        theta_mid = ground(s + 0.5 * STEP * v)
        a_mid = braking * gross * G * (plant.force(theta_mid, speed) + error + np.sin(theta_mid))
        arrived = (braking > 0.0) & (v - STEP * a_mid <= 0.0)
        last = np.where(arrived, v / np.maximum(a_mid, 1e-9), STEP)
        s = s + np.where(drives, np.where(arrived, 0.5 * v * last, STEP * middle), 0.0)
        mean, count = mean + braking * theta, count + braking
        done = np.where(arrived, t - STEP + last, done)
        way = np.where(arrived, s, way)
        v = np.where(arrived, 0.0, np.where(drives, v - STEP * a_mid, v))

    times, speeds_, thetas, dives, ways = (np.array(c).T for c in zip(*samples, strict=True))
    at = speed * lead
    columns: dict[str, list[np.ndarray]] = {}
    runs, begin, clock = [], 0, 0.0
    for i in range(stops):
        n = int(np.searchsorted(times[i], done[i] + tail))
        part = slice(0, n)
        noise = np.random.default_rng([seed, i]).standard_normal((2, n))
        x = 1000.0 * (i % half) + np.cos(heading[i]) * (ways[i, part] - 5.0)
        row = {
            "run": np.full(n, str(i)),
            "t": clock + lead + times[i, part],
            "v": speeds_[i, part] + plant.speed_noise * noise[0],
            "v_cmd": np.where(times[i, part] < -1e-9, speed[i], 0.0),
            "pitch": -thetas[i, part] + plant.mount + dives[i, part] + plant.pitch_noise * noise[1],
        }
        if out_and_back:
            row |= {"x": x, "y": np.zeros(n), "yaw": np.full(n, heading[i])}
        if terrain is not None:
            row["terrain"] = np.full(n, terrain)
        for name, values in row.items():
            columns.setdefault(name, []).append(values)
        runs.append(slice(begin, begin + n))
        begin, clock = begin + n, clock + float(times[i, n - 1]) + 5.0
    log = {name: np.concatenate(parts) for name, parts in columns.items()}
    ahead = at + np.arange(0.0, 1.2 * np.max(way - at) + 2.0, 0.01)[:, None]
    return log, runs, Truth(speed, mean / count, way - at, done, ground(ahead))


def predicted(
    coefficients: np.ndarray, dead_time: float, truth: Truth, margin: np.ndarray | None = None
) -> np.ndarray:
    """(stops,) way to rest by these coefficients along the ground ahead, inf if it never ends.

    The force is lowered by √(φᵀ S φ), φ = (v θ, θ, v, 1), for a margin S, (4, 4).
    """
    v = np.broadcast_to(truth.speed, truth.ahead.shape)
    theta = truth.ahead
    phi = np.stack((v * theta, theta, v, np.ones_like(v)), axis=-1)
    force = phi @ coefficients
    if margin is not None:
        force -= np.sqrt(np.einsum("...i,ij,...j->...", phi, margin, phi))
    a = G * (force + np.sin(theta))
    station = 0.01 * np.arange(len(theta))[:, None]
    work = np.cumsum(np.where(station >= dead_time * v, 0.01 * a, 0.0), axis=0)
    spent = work >= 0.5 * v * v
    return np.where(spent.any(axis=0), 0.01 * (np.argmax(spent, axis=0) + 0.5), np.inf)


def allowed(
    b: Braking, truth: Truth, quantile: float = 0.999, *, states: bool = True
) -> np.ndarray:
    """(stops,) way to rest that a plan at a quantile allows for, the worst of the states."""
    z = norm.ppf(quantile)
    b = promised_braking(b, 0.0, quantile)
    ways = []
    for name in ("", *(n for n, t in b.terrain.items() if states and t.state_of == "")):
        on = b.on(name) if name else b
        vector = np.array([on.m_m, on.b_m, on.m_b, on.b_b])
        margin = np.zeros((4, 4)) if on.covariance is None else np.array(on.covariance)
        margin = margin + on.force_scatter**2 * np.outer(vector, vector)
        margin[3, 3] += on.force_std**2
        late = on.dead_time + z * on.dead_time_std
        ways.append(predicted(vector, late, truth, z * z * margin) + on.distance_offset)
    return np.max(ways, axis=0)
