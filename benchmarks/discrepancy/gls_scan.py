"""The baseline: a scan of the library by generalised least squares.

Base, dead time and scatter of the stops are fitted by maximum likelihood; each effect is then one
column more: the speed that a stop loses by one unit, in bins since the onset. Its gain is twice the
log likelihood, less log(stops) for each chosen number (Schwarz, 1978). The best effect is added if
it gains more than a threshold, set by clean logs, and so on. Numbers that enter nonlinearly lie on
a grid. An effect that changes stops by less than a practical size is not named.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .effect_plant import GRAVITY
from .gls_base import BaseFit, Traces, fit_base, fit_scatter, whitened
from .plant_physics import Floats
from .sensing import Columns


class Candidate(NamedTuple):
    """One effect at one point of its grid."""

    name: str  # effect
    columns: Floats  # speed lost per unit, shape (n, BINS, k) [m/s]
    numbers: int  # count of fitted and of grid parameters
    positive: bool = False  # whether the coefficient cannot be below 0


LAGS = (0.02, 0.04, 0.06, 0.09, 0.13, 0.19, 0.27)  # [s]
COOLING = (60.0, 110.0, 200.0, 350.0)  # [s]
WINDS = (3.0, 6.0, 9.0)  # [m/s]
HEADINGS = np.deg2rad(np.arange(0.0, 360.0, 22.5))  # [rad] of winds
_CAPPED = (0.3, 0.45, 0.6, 0.7, 0.8, 0.87, 0.92, 0.96)  # quantiles of the fitted force
_TILES = 9  # grid of circles in x and in y
_RADII = (0.12, 0.16, 0.20, 0.25, 0.30)  # of the extent of the place
_MIN_STOPS = 4  # on each side of an edge


def candidates(fit: BaseFit) -> Iterator[Candidate]:
    """Yield all candidates; each is added to the base alone."""
    t, force = fit.traces, fit.force

    def single(name: str, share: Floats, numbers: int = 1, *, positive: bool = False) -> Candidate:
        return Candidate(name, t.speed_lost(share)[:, :, None], numbers, positive)

    yield single("aerodynamic_drag", t.v**2 / GRAVITY, positive=True)
    yield single("viscous_resistance", t.v, positive=True)
    yield single("grade_asymmetry", np.maximum(t.grade, 0.0))
    yield single("grade_nonlinearity", t.grade * np.abs(t.grade))
    yield single("cross_slope", np.abs(t.roll))
    yield single("turning_resistance", np.abs(t.yaw_rate), positive=True)
    yield single("session_drift", t.clock - np.mean(t.clock))
    yield single(
        "crest_unloading",
        -force * np.maximum(-_vertical_curvature(t), 0.0) * t.v**2 / GRAVITY,
        positive=True,
    )
    furrows = (t.speed_lost(wave(2.0 * t.yaw)) for wave in (np.cos, np.sin))
    yield Candidate("directional_surface", np.stack(list(furrows), axis=2), 2)
    for wind in WINDS:
        for heading in HEADINGS:
            u = t.v + wind * np.cos(t.yaw - heading)
            yield single("headwind", (np.abs(u) * u - t.v**2) / GRAVITY, 3, positive=True)
    for lag in LAGS:
        yield Candidate("brake_lag", _lagged(fit, lag)[:, :, None], 2, True)
    for cooling in COOLING:
        yield single("brake_fade", -force * heat(fit, cooling), 2, positive=True)
    for cap in np.quantile(force[t.weight > 0.0], _CAPPED):
        load = np.cos(t.grade) * np.cos(t.roll)
        yield single("wheel_lockup", -np.maximum(force - cap * load, 0.0), 2, positive=True)
    for run in t.run[_MIN_STOPS : -_MIN_STOPS + 1]:
        yield single("step_change", force * (t.run >= run)[:, None], 2)
    yield from _patches(t)


def _patches(t: Traces) -> Iterator[Candidate]:
    x, y = t.x[:, :1], t.y[:, :1]
    wide = float(max(np.ptp(x), np.ptp(y)))
    if wide == 0.0:
        return  # no place was logged
    for radius in wide * np.array(_RADII):
        for middle_x in np.linspace(x.min(), x.max(), _TILES):
            for middle_y in np.linspace(y.min(), y.max(), _TILES):
                inside = np.hypot(t.x - middle_x, t.y - middle_y) <= radius
                stops = int(np.sum(inside[:, 0]))
                if _MIN_STOPS <= stops <= len(inside) - _MIN_STOPS:
                    share = inside.astype(float)
                    yield Candidate("surface_patch", t.speed_lost(share)[:, :, None], 4)


def _lagged(fit: BaseFit, lag: float) -> Floats:
    """First-order build-up that begins a time constant earlier, less the sudden force."""
    t = fit.traces
    late = np.maximum(t.since - 0.5 * t.step + lag, 0.0)
    after = np.divide(t.weight, t.step, out=np.zeros_like(t.step), where=t.step > 0.0)
    built = -np.expm1(-late / lag) - after
    rolling = np.clip((t.since + lag) / np.maximum(t.step, 1e-9), 0.0, 1.0) - after
    return t.speed_lost(fit.force * built + np.sin(t.grade) * rolling, early=True)


def heat(fit: BaseFit, cooling: float) -> Floats:
    """Heat of the brakes, dq/dt = braking power per mass − q/cooling, shape (n, m) [kJ/kg]."""
    t = fit.traces
    power = np.cumsum(GRAVITY * np.maximum(fit.force, 0.0) * t.v * t.weight, axis=1)
    heat, before, clock = np.zeros_like(power), 0.0, float(t.clock[0, 0])
    for i, gained in enumerate(power):
        before *= np.exp(-(t.clock[i, 0] - clock) / cooling)
        heat[i] = before + gained
        before, clock = float(heat[i, -1]), float(t.clock[i, -1])
    return 1e-3 * heat


def _vertical_curvature(t: Traces) -> Floats:
    """Change of the grade along each stop, by a straight line through it, shape (n, 1) [1/m]."""
    braking = t.weight > 0.0
    station = np.cumsum(t.v * t.weight, axis=1)
    many = np.maximum(np.sum(braking, axis=1, keepdims=True), 1)
    along = (station - np.sum(station * braking, axis=1, keepdims=True) / many) * braking
    total = np.sum(along**2, axis=1, keepdims=True)
    slope: Floats = np.sum(along * t.grade, axis=1, keepdims=True) / np.maximum(total, 1e-6)
    return slope


THRESHOLD = 25.0  # Gain from which an effect is added; chosen on 30 logs of the car's tuning half
_MAX_EFFECTS = 4  # twice as many as are ever hidden
_ANYWHERE = "surface_patch"  # may lie in several places
_REFITTED = 6  # best names, whose scatter is refitted in each step
_EVIDENT_GAIN = 100.0  # of a first term of motion, whose whole change then matters
MOTION = ("aerodynamic_drag", "viscous_resistance", "headwind")
SHARE, LENGTH, STOPS = 0.0125, 0.025, 3
"""Practical size: 3 stops change by 1.25 % of their length, or by 2.5 cm if that is more."""


@dataclass(frozen=True, slots=True, eq=False)
class FittedEffect:
    """An effect in the model, with its gain when it was added."""

    candidate: Candidate
    gain: float


def name_effects(columns: Columns, configured: dict[str, float]) -> tuple[str, ...]:
    """Names of the missing effects, in the order of their discovery."""
    fit = fit_base(columns, configured)
    effects = scan(fit)
    names = [effect.candidate.name for effect in effects if is_practical(fit, effect, effects)]
    return tuple(dict.fromkeys(names))


def scan(fit: BaseFit, threshold: float = THRESHOLD) -> list[FittedEffect]:
    """Add the best effect, move all on their grids, drop those no longer needed, and repeat."""
    library, effects = list(candidates(fit)), list[FittedEffect]()
    for _ in range(_MAX_EFFECTS):
        best = _best(fit, library, effects)
        if best is None or best.gain < threshold:
            break
        effects = [*effects, best]
        for i, effect in enumerate(effects[:-1]):
            effects[i] = _moved(fit, library, effect, effects)
        fit = fit_scatter(fit, _columns(fit, effects))
        effects = [e for e in effects if e is best or _loss(fit, e, effects) >= threshold]
    return effects


def _columns(
    fit: BaseFit, effects: list[FittedEffect], without: FittedEffect | None = None
) -> Floats:
    """Columns of the base and of effects, shape (n, BINS, k)."""
    added = (effect.candidate.columns for effect in effects if effect is not without)
    return np.concatenate([fit.base, *added], axis=2)


def _moved(
    fit: BaseFit, library: list[Candidate], effect: FittedEffect, effects: list[FittedEffect]
) -> FittedEffect:
    """The effect at the best point of its grid, given the others."""
    grid = [candidate for candidate in library if candidate.name == effect.candidate.name]
    best = int(np.argmax(gains(fit, _columns(fit, effects, effect), grid)))
    return FittedEffect(grid[best], effect.gain)


def _loss(fit: BaseFit, effect: FittedEffect, effects: list[FittedEffect]) -> float:
    """Loss of likelihood without the effect."""
    numbers = effect.candidate.numbers * float(np.log(len(fit.lost)))
    return fit_scatter(fit, _columns(fit, effects, effect), 60).fit - fit.fit - numbers


def _best(
    fit: BaseFit, library: list[Candidate], effects: list[FittedEffect]
) -> FittedEffect | None:
    """The effect of largest gain, given base and effects."""
    known = _columns(fit, effects)
    present = {effect.candidate.name for effect in effects} - {_ANYWHERE}
    library = [candidate for candidate in library if candidate.name not in present]
    by_name: dict[str, tuple[float, Candidate]] = {}
    for gain, candidate in zip(gains(fit, known, library), library, strict=True):
        if gain > by_name.get(candidate.name, (0.0, candidate))[0]:
            by_name[candidate.name] = (gain, candidate)
    ranked = sorted(by_name.values(), key=lambda first: -first[0])[:_REFITTED]
    log_stops = float(np.log(len(fit.lost)))
    refitted = []
    for _, candidate in ranked:
        likelihood = fit_scatter(fit, np.concatenate((known, candidate.columns), axis=2), 60).fit
        gain = fit.fit - likelihood - candidate.numbers * log_stops
        refitted.append(FittedEffect(candidate, gain))
    return max(refitted, key=lambda effect: effect.gain, default=None)


def gains(fit: BaseFit, known: Floats, library: list[Candidate]) -> Floats:
    """Fall of χ² by each candidate, given known columns and scatter, shape (len(library),)."""
    widths = [candidate.columns.shape[2] for candidate in library]
    stacked = np.concatenate([known, *(candidate.columns for candidate in library)], axis=2)
    rows, target = whitened(fit, stacked, fit.scatter)
    q, _ = np.linalg.qr(rows[:, : known.shape[2]])
    left = target - q @ (q.T @ target)
    free = rows[:, known.shape[2] :]
    free = free - q @ (q.T @ free)
    first = np.cumsum([0, *widths])
    result = np.zeros(len(library))
    for i, candidate in enumerate(library):
        columns = free[:, first[i] : first[i + 1]]
        gram, product = columns.T @ columns, columns.T @ left
        if np.min(np.linalg.eigvalsh(gram)) < 1e-9:
            continue  # the base has it already
        strength = np.linalg.solve(gram, product)
        if not (candidate.positive and strength[0] < 0.0):
            result[i] = float(product @ strength)
    return result


def is_practical(fit: BaseFit, effect: FittedEffect, effects: list[FittedEffect]) -> bool:
    """Whether it changes stops, beyond what the other columns absorb, by a practical size."""
    known, columns = _columns(fit, effects, effect), effect.candidate.columns
    rows, target = whitened(fit, np.concatenate((known, columns), axis=2), fit.scatter)
    strength = np.linalg.lstsq(rows, target, rcond=None)[0][-columns.shape[2] :]
    changed: Floats = columns @ strength
    evident = effect is effects[0] and effect.gain >= _EVIDENT_GAIN
    if not (evident and effect.candidate.name in MOTION):
        root = np.sqrt(fit.traces.samples.ravel())
        free = known.reshape(len(root), -1)
        absorbed = np.linalg.lstsq(free * root[:, None], changed.ravel() * root, rcond=None)[0]
        changed = changed - known @ absorbed
    t = fit.traces
    duration = t.binned(t.step) * t.samples
    length = np.sum(t.binned(t.v) * duration * (t.binned(t.since) > 0.0), axis=1)
    moved = np.abs(np.sum(changed * duration, axis=1)) / np.maximum(SHARE * length, LENGTH)
    return float(np.sort(moved)[-STOPS]) >= 1.0
