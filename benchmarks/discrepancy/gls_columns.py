"""Every named effect as columns of a linear regression, written again from its formula.

A column is the speed that a stop loses by one unit of an effect, in bins since the onset. Inner
numbers that enter nonlinearly (time constants, circles, runs) lie on a grid, one column each.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from .effect_plant import GRAVITY
from .gls_base import BaseFit
from .plant_physics import Floats
from .stop_traces import Traces


class Candidate(NamedTuple):
    """One effect at one point of its grid.

    Attributes:
        name: effect.
        columns: speed lost per unit, shape (n, BINS, k) [m/s].
        numbers: count of fitted and of grid parameters.
        positive: whether the coefficient cannot be below 0.
    """

    name: str
    columns: Floats
    numbers: int
    positive: bool = False


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
