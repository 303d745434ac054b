"""What a set can tell at all: expected χ² of its hidden effect, judged without the workflow.

The plant itself is bent to the truth: base coefficients and dead time are fitted to noise-free
stops (Gauss–Newton on finite differences of the plant), then the base with each rival. What is
left, weighed with the noise of the speed and the scatter from stop to stop, is the expected χ² by
which truth and rival differ. Where that is small nobody can name the effect, and nobody should.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.linalg import solve_triangular, toeplitz

from .hidden import FIELDS
from .physics import Floats, Physics, Stops
from .plant import drive, speeds
from .rivals import (
    FREE,
    NOT_NEGATIVE,
    ONE_SIGN,
    Doses,
    amplified,
    small_doses,
)
from .sensing import CORRELATED, MEMORY, QUANTUM, RATE

SEEN = 30.0
"""Expected χ² from which an effect counts as identifiable: found in 19 of 20 sets although the
largest of a library's worth of chance effects has to be exceeded (about 13)."""

TOLD_APART = 20.0
"""Expected χ² to the nearest rival from which the name counts as identifiable."""

SHAPED = 40.0
"""Expected χ² to every named effect from which a shape without a name counts as identifiable: it
has to be found among half a dozen freedoms on each of some fifteen axes."""

_BASE = {"m_m": 1e-3, "b_m": 1e-3, "m_b": 1e-4, "b_b": 1e-4, "dead_time": 1e-3}
_STEP = 0.01  # [s] of the integration; differences do not see the rest
_JITTER = 0.008  # [s] of the onset, with the phase of the sampling
_LONGEST = 9.0  # [s] of a stop
_HELD_SAMPLES = 20.0  # from which the speed at the command is known
_ROLLING = 0.15  # [m/s]
_FITTED_OUT = 2  # nearest rivals


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

    @property
    def shaped(self) -> bool:
        """It can be found, and no name will do."""
        return self.apart >= SHAPED


def worth(
    truth: Physics,
    base: Physics,
    stops: Stops,
    noise: float,
    scatter: float,
    own: Iterable[str],
    weighed: int = 40,
) -> Worth:
    """Judge one set.

    Args:
        truth: world with its effects. base: the same without them.
        stops: as driven; their friction and delay are left out.
        noise, scatter: as of the sensing and the design, one standard deviation.
        own: names of the hidden effects; a single one is no rival of its own, of two each is.
        weighed: stops that are looked at, spread evenly; the others count as much.
    """
    even = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    names = tuple(own)
    scene = _Scene(truth, even, noise, scatter, weighed)
    fitted, residual = _fit(scene, base)
    gap = float(residual @ residual)
    if gap < SEEN:
        return Worth(gap, "", 0.0)
    if len(names) == 1:
        return Worth(gap, *_nearest(scene, fitted, residual, {}, names))
    # Of several, each may be alone, or be accompanied by a wrong one.
    best = ("", gap)
    for kept in names:
        start = fitted._replace(**{key: getattr(truth, key) for key in FIELDS[kept].values()})
        alone, left = _fit(scene, start, FREE[kept])
        found = [(kept, float(left @ left)), _nearest(scene, alone, left, FREE[kept], names)]
        best = min((best, *found), key=lambda rival: rival[1])
    return Worth(gap, *best)


def change_beyond_base(
    truth: Physics, base: Physics, stops: Stops, noise: float, scatter: float, rank: int = 3
) -> float:
    """By how much an effect changes stops, beyond what the base bent to them can do [m].

    Args:
        truth, base, stops, noise, scatter: as of :func:`worth`. rank: of the stops that it changes
            most, whose change is told.
    """
    even = stops._replace(friction=np.ones_like(stops.speed), delay=np.zeros_like(stops.speed))
    fitted, _ = _fit(_Scene(truth, even, noise, scatter), base)
    way = [drive(p, even, np.zeros(1), _STEP).distance for p in (truth, fitted)]
    change = np.abs(way[0] - way[1])
    known = np.sort(change[np.isfinite(change)])
    return float(known[-min(rank, len(known))])


def _nearest(
    scene: _Scene,
    fitted: Physics,
    residual: Floats,
    free: Mapping[str, float],
    names: Sequence[str],
) -> tuple[str, float]:
    """The rival that comes nearest beside what is fitted already, and the χ² it leaves."""
    tangents = scene.tangents(fitted, _BASE | dict(free))
    rivals = []
    doses = small_doses(fitted, scene.stops)
    for name, options in scene.columns(fitted, doses).items():
        if name in names:
            continue
        left, number, much = _left(residual, tangents, options, one_sign=name in ONE_SIGN)
        start = None if number < 0 else amplified(name, doses[name][number], much)
        rivals.append((left, name, start))
    rivals.sort(key=lambda rival: rival[0])
    nearest, apart = rivals[0][1], rivals[0][0]
    # Doses are small and effects are not: the nearest ones are fitted out.
    for _, name, start in rivals[:_FITTED_OUT]:
        if start is not None:
            out = _fit(scene, fitted._replace(**start), FREE[name] | dict(free))[1]
            if out @ out < apart:
                nearest, apart = name, float(out @ out)
    return nearest, apart


class _Scene:
    """The truth's stops, and how to weigh differences from them."""

    def __init__(
        self, truth: Physics, stops: Stops, noise: float, scatter: float, weighed: int = 40
    ) -> None:
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
        seen = np.unique(np.linspace(0, count - 1, min(weighed, count)).astype(int))
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

    def tangents(self, physics: Physics, steps: Mapping[str, float] | None = None) -> Floats:
        """By the base's coefficients and dead time, or by other fields, whitened."""
        here = self.speed(physics)
        return self.whiten(
            *(
                (self.speed(physics._replace(**{key: getattr(physics, key) + eps})) - here) / eps
                for key, eps in (steps or _BASE).items()
            )
        )

    def columns(self, physics: Physics, doses: Doses) -> dict[str, list[Floats]]:
        """Per effect, alternatives of one or two whitened columns, (k, all samples) each."""
        here = self.speed(physics)
        return {
            name: [
                self.whiten(*(self.speed(physics._replace(**fields)) - here for fields in together))
                for together in options
            ]
            for name, options in doses.items()
        }


def _fit(
    scene: _Scene, start: Physics, free: Mapping[str, float] | None = None
) -> tuple[Physics, Floats]:
    """Base, and further free fields with their steps, nearest to the truth; what is left."""
    steps = _BASE | dict(free or {})
    physics = start
    best = scene.whiten(-scene.speed(physics))[0]
    for _ in range(8):
        step, *_ = np.linalg.lstsq(scene.tangents(physics, steps).T, best, rcond=None)
        for share in (1.0, 0.3):
            changed = {k: getattr(physics, k) + share * d for k, d in zip(steps, step, strict=True)}
            if any(changed.get(k, 0.0) < 0.0 for k in NOT_NEGATIVE):
                continue
            trial = physics._replace(**changed)
            left = scene.whiten(-scene.speed(trial))[0]
            if left @ left < best @ best:
                physics, best = trial, left
                break
        else:
            break
    return physics, best


def _left(
    residual: Floats, tangents: Floats, options: Sequence[Floats], *, one_sign: bool
) -> tuple[float, int, Floats]:
    """Least χ² over alternatives of a rival, base refitted with it; which one, how much of it."""
    q = np.linalg.qr(tangents.T)[0]
    own = residual - q @ (q.T @ residual)
    best = (float(own @ own), -1, np.zeros(1))
    for number, columns in enumerate(options):
        free = columns.T - q @ (q.T @ columns.T)
        solution, *_ = np.linalg.lstsq(free, own, rcond=None)
        left = own - free @ solution
        if not (one_sign and np.any(solution < 0.0)) and left @ left < best[0]:
            best = (float(left @ left), number, np.asarray(solution, np.float64))
    return best
