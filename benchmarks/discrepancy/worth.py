"""What a set can tell at all: expected χ² of its hidden effect, judged without the workflow.

The plant itself is bent to the truth: base coefficients and dead time are fitted to noise-free
stops (Gauss–Newton on finite differences of the plant), then the base with each rival. What is
left, weighed with the noise of the speed and the scatter from stop to stop, is the expected χ² by
which truth and rival differ. Where that is small nobody can name the effect, and nobody should.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular, toeplitz

from benchmarks.discrepancy.designs import FIELD
from benchmarks.discrepancy.physics import Floats, Physics, Stops
from benchmarks.discrepancy.plant import drive, speeds
from benchmarks.discrepancy.sensing import CORRELATED, MEMORY, QUANTUM, RATE

SEEN = 30.0
"""Expected χ² from which an effect counts as identifiable: found in 19 of 20 sets although the
largest of a library's worth of chance effects has to be exceeded (about 13)."""

TOLD_APART = 20.0
"""Expected χ² to the nearest rival from which the name counts as identifiable."""

_BASE = {"m_m": 1e-3, "b_m": 1e-3, "m_b": 1e-4, "b_b": 1e-4, "dead_time": 1e-3}
_STEP = 0.005  # [s] of the integration; differences do not see the rest
_WEIGHED = 60  # stops that are looked at; the others count as much
_JITTER = 0.008  # [s] of the onset, with the phase of the sampling
_LONGEST = 9.0  # [s] of a stop
_HELD_SAMPLES = 20.0  # from which the speed at the command is known
_ROLLING = 0.15  # [m/s]
_ONE_SIGN = {
    "aerodynamic_drag", "viscous_resistance", "brake_lag", "turning_resistance", "headwind",
    "brake_fade", "wheel_lockup",
}  # fmt: skip


@dataclass(frozen=True, slots=True)
class Worth:
    """Expected χ² of a set.

    Attributes:
        gap: of the truth against the base refitted.
        nearest: the best rival's name. apart: of the truth against that rival refitted.
    """

    gap: float
    nearest: str
    apart: float

    @property
    def seen(self) -> bool:
        """The effect can be found."""
        return self.gap >= SEEN

    @property
    def named(self) -> bool:
        """The effect can be found and told from all others."""
        return self.seen and self.apart >= TOLD_APART


def worth(
    truth: Physics, base: Physics, stops: Stops, noise: float, scatter: float, own: Iterable[str]
) -> Worth:
    """Judge one set.

    Args:
        truth: world with its effects. base: the same without them.
        stops: as driven; their friction and delay are left out.
        noise, scatter: as of the sensing and the design, one standard deviation.
        own: names of the hidden effects; a single one is no rival of its own, of two each is.
    """
    even = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    names = tuple(own)
    scene = _Scene(truth, even, noise, scatter)
    fitted, residual = _fit(scene, base)
    gap = float(residual @ residual)
    if gap < SEEN:
        return Worth(gap, "", 0.0)
    tangents = scene.tangents(fitted)
    nearest, apart = "", gap
    for name, columns in scene.rivals(fitted).items():
        if name in names and len(names) == 1:
            continue
        left = _left(residual, tangents, columns, one_sign=name in _ONE_SIGN)
        if left < apart:
            nearest, apart = name, left
    return Worth(gap, nearest, apart)


class _Scene:
    """The truth's stops, and how to weigh differences from them."""

    def __init__(self, truth: Physics, stops: Stops, noise: float, scatter: float) -> None:
        self.stops = stops
        longest = drive(truth, stops, np.zeros(1), _STEP).rest
        end = min(float(np.max(longest, where=np.isfinite(longest), initial=1.0)), _LONGEST)
        self.time = np.arange(0, round(end * RATE)) / RATE
        self.measured = speeds(truth, stops, self.time, _STEP)
        self.rolling = self.measured > _ROLLING
        eps = 1e-3
        by_friction = self.speed(truth, friction=stops.friction + eps) / eps
        by_delay = self.speed(truth, delay=stops.delay + eps) / eps
        by_speed = self.speed(truth, speed=stops.speed + eps) / eps
        random = np.stack(
            [
                scatter * by_friction,
                _JITTER * by_delay,
                noise / np.sqrt(_HELD_SAMPLES) * by_speed,
            ]
        )
        lags = np.exp(-self.time / MEMORY) * CORRELATED * noise**2
        lags[0] = noise**2 + QUANTUM**2 / 12.0
        whole = toeplitz(lags)
        self.roots = []
        count = len(stops.speed)
        seen = np.unique(np.linspace(0, count - 1, min(_WEIGHED, count)).astype(int))
        self._each = float(np.sqrt(count / len(seen)))
        for i in seen:
            w = np.flatnonzero(self.rolling[i])
            u = random[:, i, w]
            self.roots.append((i, w, np.linalg.cholesky(whole[np.ix_(w, w)] + u.T @ u)))

    def speed(self, physics: Physics, **changed: Floats) -> Floats:
        """Difference of a world's speeds to the measured ones, (n, samples) [m/s]."""
        stops = self.stops._replace(**changed)
        return speeds(physics, stops, self.time, _STEP) - self.measured

    def whiten(self, *differences: Floats) -> Floats:
        """Weighed differences, (k, all samples)."""
        stacked = np.stack(differences)
        parts = [
            solve_triangular(root, stacked[:, i, w].T, lower=True, check_finite=False)
            for i, w, root in self.roots
        ]
        weighed: Floats = self._each * np.concatenate(parts).T
        return weighed

    def tangents(self, physics: Physics) -> Floats:
        """By the base's coefficients and dead time, whitened, (5, all samples)."""
        here = self.speed(physics)
        return self.whiten(
            *(
                (self.speed(physics._replace(**{key: getattr(physics, key) + eps})) - here) / eps
                for key, eps in _BASE.items()
            )
        )

    def rivals(self, physics: Physics) -> dict[str, list[Floats]]:
        """Per effect, alternatives of one or two whitened columns, (k, all samples) each."""
        here = self.speed(physics)
        trials = _trials(physics, self.stops)
        flat = [(name, fields) for name, options in trials.items() for fields in options]
        found: dict[str, list[Floats]] = {name: [] for name in trials}
        for name, options in flat:
            found[name].append(
                self.whiten(*(self.speed(physics._replace(**f)) - here for f in options))
            )
        return found


def _fit(scene: _Scene, base: Physics) -> tuple[Physics, Floats]:
    """Base coefficients and dead time that come nearest to the truth, and what is left."""
    physics = base
    best = scene.whiten(-scene.speed(physics))[0]
    for _ in range(4):
        step, *_ = np.linalg.lstsq(scene.tangents(physics).T, best, rcond=None)
        for share in (1.0, 0.3):
            changed = {k: getattr(physics, k) + share * d for k, d in zip(_BASE, step, strict=True)}
            trial = physics._replace(**changed)
            left = scene.whiten(-scene.speed(trial))[0]
            if left @ left < best @ best:
                physics, best = trial, left
                break
        else:
            break
    return physics, best


def _left(residual: Floats, tangents: Floats, columns: list[Floats], *, one_sign: bool) -> float:
    """Least χ² over the alternatives of a rival, base refitted with it."""
    q = np.linalg.qr(tangents.T)[0]
    own = residual - q @ (q.T @ residual)
    best = float(own @ own)
    for column in columns:
        free = column.T - q @ (q.T @ column.T)
        solution, *_ = np.linalg.lstsq(free, own, rcond=None)
        if one_sign and np.any(solution < 0.0):
            continue
        left = own - free @ solution
        best = min(best, float(left @ left))
    return best


def _trials(p: Physics, stops: Stops) -> Mapping[str, list[list[dict[str, float]]]]:
    """Small doses of every named effect; columns in one list are fitted together."""
    force = (p.m_m * stops.speed + p.b_m) * stops.grade + p.m_b * stops.speed + p.b_b
    count = len(stops.speed)
    angles = np.arange(8) * np.pi / 4.0
    wind = [
        [{"wind_drag": 1e-3, "wind": w, "wind_direction": a}] for w in (3.0, 8.0) for a in angles
    ]
    patches = [
        [{"patch": 0.005, "patch_x": x, "patch_y": y, "patch_radius": r}]
        for r in (75.0, 105.0)
        for x in np.linspace(80.0, FIELD[0] - 80.0, 5)
        for y in np.linspace(80.0, FIELD[1] - 80.0, 3)
    ]
    furrows = [{"furrow": 0.005, "furrow_direction": a} for a in (0.0, np.pi / 4.0)]
    return {
        "aerodynamic_drag": [[{"drag": 1e-3}]],
        "viscous_resistance": [[{"viscous": 1e-3}]],
        "brake_lag": [[{"lag": tau}] for tau in (0.01, 0.1)],
        "grade_asymmetry": [[{"asymmetry": 0.01}]],
        "grade_nonlinearity": [[{"nonlinearity": 0.05}]],
        "cross_slope": [[{"cross_slope": 0.02}]],
        "turning_resistance": [[{"turning": 0.01}]],
        "headwind": wind,
        "brake_fade": [[{"fade": 0.02 / 50.0, "fade_tau": t}] for t in (50.0, 100.0, 200.0, 500.0)],
        "wheel_lockup": [[{"friction": q}] for q in np.quantile(force, (0.35, 0.55, 0.75, 0.9))],
        "surface_patch": patches,
        "directional_surface": [furrows],
        "step_change": [
            [{"step_scale": 0.99, "step_run": float(r)}]
            for r in np.unique(np.linspace(0.15, 0.85, 9) * count // 1)
        ],
        "session_drift": [[{"drift": 0.01 / float(np.ptp(stops.clock))}]],
    }
