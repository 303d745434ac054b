"""The line along which a vehicle follows a given polyline: its mean over the vehicle's own scale.

At its corners a polyline is curved without end, elsewhere it is straight. A body as long as a
wheelbase cannot drive that; it drives arcs through places up to half a wheelbase away
(core/path/given_path.hpp). A smooth curve is planned on where it is as curved as these arcs:
then its speeds suit who follows the polyline itself as well.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.compiled_core import core
from slopewise.planner.path_deviation import too_far_error
from slopewise.planner.planning_limits import planning_limits
from slopewise.planner.raw_polyline import arc, is_on_grid, noise, without_noise

_HALF = 0.5
"""Half width of the mean in wheelbases [1]: it is the arc that fits best from axle to axle."""

_HALF_IN_NOISE = 0.8
"""The same along noisy points at most [1]: no vehicle steers at noise shorter than itself."""

_NO_SIZE = 2.0  # half width without a vehicle, in distances of stations [1]
_FELT, _LIMITING = 0.1, 0.6
"""Shares of the curvature that limits the highest speed on even ground, from which on curvature is
compared [1]: on any bank a tenth of the lateral limit is left; beyond more than half it is
compared exactly."""

_COARSEST = 0.25  # of the half width [1]: noise of shorter steps is averaged
_SHORT = 0.5  # of the half width [1]: longer steps are not averaged by the mean
_NOISY, _LITTLE = 0.015, 0.05
"""Shares of the curvature that limits the highest speed [1]: standard deviations from noise up to
which the mean is not widened for it, and up to which a smooth curve is as good as the mean."""
_THRUST_SHARE = 0.8  # of the drive's force for a turn [1]: the rest is for grades
_NARROWER, _WIDER = 0.7, 1.1  # half widths that are tried in turn [1]
_SHARPER = 1.03  # of a line's own bends [1] from which on others count
_ON_A_BANK, _MIN_ON_A_BANK = 0.5, 0.1
"""Shares of the lateral limit for turns sharper than the line [1]: the remainder is for a bank that
falls away from the turn, for ``_BANK`` at least, as long as a tenth is left."""
_BANK = 0.07  # sine of 4° [1]: steeper ground is rarely driven across stairs of a grid
_NARROWEST = 0.02  # [m] half width
_PLANNED = 0.85  # of that half width [1], planned on: stations cut the peaks of curvature
_PLANNED_ON_GRID = 0.7  # the same where bends swing from step to step [1]
_STATIONS = 0.25  # of the half width from one to the next [1]: its curvature rises within it
MIN_STATIONS = 3  # stations that curvature needs [1]
MAX_STATIONS = 200_000
"""Stations of one candidate: 20 km at 0.1 m. More is a mistake in units."""


class LineLimits(NamedTuple):
    """Limits of a line along a given polyline.

    Attributes:
        deviation: largest distance from the polyline [m].
        wheelbase: 0 for a vehicle without size [m].
        max_curvature: sharpest turn of its steering, or for which its drive has the force [1/m].
        lateral_accel: limit in turns [m/s²]. speed: highest one [m/s].
        overhang: largest distance by which the body extends beyond an axle [m].
    """

    deviation: float = np.inf
    wheelbase: float = 0.0
    max_curvature: float = np.inf
    lateral_accel: float = np.inf
    speed: float = np.inf
    overhang: float = 0.0

    @property
    def gentlest(self) -> float:
        """Turn that the highest speed just allows on even ground [1/m]."""
        return self.lateral_accel / self.speed**2


def line_limits(model: Model) -> LineLimits:
    """Of a model's vehicle."""
    sharpest, limits = model.steering_geometry.max_curvature, model.limits
    shape = model.vehicle.shape
    if model.vehicle.drive == "skid_steer":
        # On level ground the wheels have force for that turn, by the law of the bound `traction`:
        # motion resistance and turning resistance together.
        scalars = planning_limits(model)
        force = _THRUST_SHARE * scalars.specific_force - scalars.resistance
        sharpest = min(sharpest, max(force, 0.0) / max(scalars.turning_drag, 1e-9))
    return LineLimits(
        model.max_path_deviation,
        model.vehicle.wheelbase,
        sharpest,
        limits.lateral_accel,
        limits.speed,
        max(max(shape.front, shape.rear) - 0.5 * model.vehicle.wheelbase, 0.0),
    )


class LaidLine(NamedTuple):
    """Stations laid along a polyline.

    Attributes:
        points: (N, 2) even stations [m]. place: (N,) of each, as a share of the polyline [1].
        deviation: (N,) largest distance between both around each [m].
        speed_limit: (N,) for who follows the polyline itself [m/s], None where the line suits them.
    """

    points: Floats
    place: Floats
    deviation: Floats
    speed_limit: Floats | None = None


class GivenPoints:
    """A polyline as a vehicle follows it."""

    def __init__(
        self, raw: Floats, points: Floats, along: Floats, spacing: float, limits: LineLimits
    ) -> None:
        """Find out how far its mean has to reach: ``half`` [m], ``planned`` of that share [1].

        A parabola of least squares over a length L, with a point in every step, has a curvature of
        σ √(720 step/L⁵) from noise σ of the points: where that is felt the mean is wider.

        Args:
            raw: (m, 2) points that were given [m]; what is planned must be close to them.
            points: (n, 2), n >= 3, those that are left of them; along: (n,) arc of them [m].
            spacing: of stations at most [m].
            limits: with the vehicle.
        """
        self._raw, self._points, self._spacing, self._limits = raw, points, spacing, limits
        self._means: dict[float, core.FollowedLine] = {}
        self.half, self.planned = _HALF * limits.wheelbase or _NO_SIZE * spacing, _PLANNED
        self._noise = 0.0
        step = core.usual_step(along)
        short = limits.wheelbase > 0.0 and step <= _SHORT * self.half
        curvature = noise(points) * math.sqrt(720.0 * step) if short else 0.0
        if curvature * (2.0 * self.half) ** -2.5 > _NOISY * limits.gentlest:
            if is_on_grid(points):
                self.planned = _PLANNED_ON_GRID
                return
            wide = 0.5 * (curvature / (_NOISY * limits.gentlest)) ** 0.4
            self.half = min(wide, _HALF_IN_NOISE * limits.wheelbase)
            curvature *= (2.0 * self.half) ** -2.5
            self._noise = curvature if curvature <= _LITTLE * limits.gentlest else 0.0
            # Noise of steps much shorter than the mean would only make them longer.
            self._points = without_noise(points, along, _COARSEST * self.half)[0]

    def speed_limit_on(self, even: Floats) -> Floats | None:
        """Speeds on a smooth curve for who follows the polyline itself, (N,) [m/s].

        None if the curve is not as curved as the mean of the polyline, where it matters. Bends that
        are sharper by less are left to the speed: banks are taken from it as from any other.

        Args:
            even: (N, 2) stations of the curve [m].
        """
        if self._limits.wheelbase == 0.0:
            return np.full(len(even), np.inf)
        felt, limiting = (share * self._limits.gentlest for share in (_FELT, _LIMITING))
        sharper = self.mean(self.half).sharper_than(even, felt, limiting, self._noise)
        if sharper is None:
            return None
        with np.errstate(divide="ignore"):
            return np.sqrt(self._limits.lateral_accel / sharper)

    def mean(self, half: float) -> core.FollowedLine:
        """The mean over a half width [m]."""
        if half not in self._means:
            self._means[half] = core.FollowedLine(self._points, half)
        return self._means[half]

    def line(self, half: float) -> LaidLine:
        """Even stations on the mean over a half width [m]."""
        mean = self.mean(half)
        count = int(np.ceil(mean.length / min(self._spacing, _STATIONS * half) - 1e-6)) + 1
        even, place = mean.stations(min(max(count, MIN_STATIONS), MAX_STATIONS))
        place = np.minimum(place / place[-1], 1.0)
        return LaidLine(even, place, core.deviation(self._raw, even))

    def followed(self) -> LaidLine:
        """Stations on the line of a vehicle that follows all points.

        It is as near as allowed; where the vehicle cannot turn as sharply, as wide as is allowed,
        and as slow as who follows it more closely has to be.

        Raises:
            ParameterError: no such line is close enough.
        """
        limits, half = self._limits, self.planned * self.half
        line = self.line(half)
        while line.deviation.max() > limits.deviation:
            half *= _NARROWER
            if half < _NARROWEST:
                raise too_far_error(self._raw, line.points, limits.deviation)
            line = self.line(half)
        near, length = half, arc(self._raw)[-1]
        while self.mean(half).sharpest > limits.max_curvature and half < length:
            gentler = self.line(half * _WIDER)
            if gentler.deviation.max() > limits.deviation:
                break
            line, half = gentler, half * _WIDER
        return line._replace(speed_limit=self._speed_limit(near, half, line.place))

    def _speed_limit(self, near: float, half: float, place: Floats) -> Floats | None:
        """Speeds for who follows the polyline more closely than a line does, (N,) [m/s].

        None if no such vehicle turns more sharply than that line.

        Args:
            near: least half width of the mean that is followed; half: that of the line [m].
            place: (N,) of the line's stations, as shares of the polyline [1].
        """
        if self._limits.wheelbase == 0.0:
            return None
        # On stairs the bends of means swing, of a wider one not always less.
        planned, nearer, typical = (self.mean(h).curvature(place) for h in (half, near, self.half))
        closer = np.maximum(nearer, typical)
        slow = closer > np.maximum(_SHARPER * planned, _FELT * self._limits.gentlest)
        if not slow.any():
            return None
        closer[~slow] = 0.0
        spare = self._limits.lateral_accel - GRAVITY * _BANK
        lateral = min(_ON_A_BANK * self._limits.lateral_accel, spare)
        lateral = max(lateral, _MIN_ON_A_BANK * self._limits.lateral_accel)
        return np.sqrt(lateral / np.maximum(closer, 1e-9))
