"""Effects that no plan knows of: formulas for how much each is, with a size that is assumed.

`examples/not_modelled.py` makes tables of them.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

from slopewise.models.laws import braking
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY

AIR, WIND = 1.2, 8.0  # [kg/m³], [m/s]
ROTATING = 0.05  # of the mass: wheels, gears and motors, as if they moved along
SHIFT = 0.05  # [m] of the centre of gravity
CREST = 0.1  # [1/m]
LATERAL_SLIP = 0.05  # sideways over forward speed of a tyre that carries a cross slope [1]


class Stop(NamedTuple):
    """A vehicle in a full stop from its highest speed, on even ground."""

    model: Model
    grade: float

    @property
    def speed(self) -> float:
        """Highest planned speed that was trained [m/s]."""
        return min(self.model.limits.speed, self.model.braking.speed_range[1])

    @property
    def force(self) -> float:
        """F_b/W."""
        b = self.model.braking
        return float(braking.force_ratio(self.grade, self.speed, b.m_m, b.b_m, b.m_b, b.b_b))

    @property
    def net(self) -> float:
        """Remainder of it besides gravity, a_x/g."""
        return self.force + math.sin(self.grade)

    @property
    def turn(self) -> float:
        """Sharpest curvature at that speed [1/m]."""
        return self.model.limits.lateral_accel / self.speed**2

    @property
    def seconds(self) -> float:
        """From the command to standstill."""
        return self.model.braking.dead_time + self.speed / (GRAVITY * self.net)

    def longer(self, *, force: float = 0.0, speed: float = 0.0, dead_time: float = 0.0) -> float:
        """Change of the distance with some more force [1], speed [m/s], dead time [s]."""
        return self.distance(force, speed, dead_time) - self.distance()

    def distance(self, force: float = 0.0, speed: float = 0.0, dead_time: float = 0.0) -> float:
        """Of the whole stop, without offset [m]; inf if it does not stop. Arguments add to it."""
        net = self.net + force
        if net <= 0.0:
            return math.inf
        known = self.model.braking.dead_time
        v = self.speed + speed
        return float(braking.stopping_distance(v, GRAVITY * net, known + dead_time, 0.0))


class Row(NamedTuple):
    """One effect: what it is, of what size, by which formula, what it does and what covers it."""

    name: str
    size: str
    formula: str
    value: Callable[[Stop], float]
    does: str
    covered: str


def _air(stop: Stop, speed: float) -> float:
    """Force of the air at a speed of the air, over the weight; front of width times 2 cg_z."""
    vehicle = stop.model.vehicle
    area = vehicle.shape.width * 2.0 * vehicle.cg_z
    return 0.5 * AIR * area * speed**2 / (vehicle.mass * GRAVITY)


def _ride(stop: Stop) -> float:
    return (2.0 * math.pi * stop.model.vehicle.ride_frequency) ** 2


def _corner(stop: Stop) -> float:
    """Distance by which a front corner leaves the path [m]."""
    vehicle = stop.model.vehicle
    return vehicle.shape.front * math.sin(math.atan(0.1 * vehicle.wheelbase * stop.turn))


def _behind(stop: Stop) -> float:
    vehicle = stop.model.vehicle
    return vehicle.wheelbase - vehicle.cg_x


METRES = (
    Row(
        "obstacles that move",
        "1.5 m/s towards it",
        "v_o t_s",
        lambda s: 1.5 * s.seconds,
        "room is lost",
        "nothing: `--clear` has to be what will still be free",
    ),
    Row(
        "a map that is 0.5 s old where things move",
        "1.5 m/s towards it",
        "v_o t",
        lambda s: 0.75,
        "room is lost",
        "nothing: take it off `--clear`",
    ),
    Row(
        "position along the path",
        "0.10 m",
        "δ",
        lambda s: 0.10,
        "either",
        "`[tracking] along_track_std`",
    ),
    Row(
        "a trailer without brakes",
        "20 % of the mass",
        "F → F/1.2",
        lambda s: s.longer(force=s.force * (1.0 / 1.2 - 1.0)),
        "longer",
        "nothing: calibrate with it",
    ),
    Row(
        "age of the pose",
        "50 ms",
        "v t",
        lambda s: 0.05 * s.speed,
        "longer",
        "`[tracking] latency`",
    ),
    Row(
        "slow build-up of the force",
        "τ = 0.1 s",
        "v τ",
        lambda s: s.longer(dead_time=0.1),
        "longer",
        "dead time, if learned from stops; effect `brake_lag`",
    ),
    Row(
        "hot brakes",
        "10 % less force",
        "F → 0.9 F",
        lambda s: s.longer(force=-0.1 * s.force),
        "longer",
        "effect `brake_fade`; else `force_std`",
    ),
    Row(
        "tyre pressure, wear, soft ground",
        "f_r less by 0.02",
        "F → F − 0.02",
        lambda s: s.longer(force=-0.02),
        "longer",
        "`force_std`, `covariance`; tables of surfaces",
    ),
    Row(
        "sinkage",
        "f_r more by 0.05",
        "F → F + 0.05",
        lambda s: s.longer(force=0.05),
        "shorter; a rut may hold the wheels",
        "nothing needed; no way out is planned",
    ),
    Row(
        "tyre radius of the speed sensor",
        "1 %",
        "v → 1.01 v",
        lambda s: s.longer(speed=0.01 * s.speed),
        "longer, if the tyre is larger than thought",
        "`distance_offset`, if learned with these tyres; `speed_error`",
    ),
    Row(
        "tail wind",
        f"{WIND:.0f} m/s",
        "F → F − ½ ρ A w²/W",
        lambda s: s.longer(force=-_air(s, WIND)),
        "longer",
        "effect `headwind`; else `force_std`",
    ),
    Row(
        "drag of the air",
        "still air",
        "F → F + ½ ρ A (v²/2)/W",
        lambda s: s.longer(force=_air(s, s.speed / math.sqrt(2.0))),
        "shorter",
        "nothing needed",
    ),
    Row(
        "inertia of wheels and motors",
        "5 % of the mass",
        "sin θ → sin θ/1.05 with a learned F",
        lambda s: s.longer(force=math.sin(s.grade) * (1.0 / (1.0 + ROTATING) - 1.0)),
        "longer uphill, shorter downhill",
        "`b_m`, if learned on slopes",
    ),
    Row(
        "slope that changes within the wheelbase",
        "κ_v = 0.1/m",
        "κ_v L²/8 / (a/g)",
        lambda s: CREST * s.model.vehicle.wheelbase**2 / 8.0 / s.net,
        "either",
        "`height_std` of the map",
    ),
    Row(
        "side slip in a turn",
        "pole of turning 0.1 L ahead",
        "front · sin atan(0.1 L κ)",
        _corner,
        "a corner leaves the path sideways",
        "`[tracking] cross_track_per_curvature`",
    ),
    Row(
        "crab on a cross slope",
        "5 % lateral slip",
        "front · sin atan 0.05",
        lambda s: s.model.front * math.sin(math.atan(LATERAL_SLIP)),
        "a corner leaves the path sideways",
        "`[tracking] heading_std`, if learned on such slopes",
    ),
)

LOADS = (
    Row(
        "payload farther to the front",
        "5 cm",
        "rear: δ cos θ/(L − x_c)",
        lambda s: SHIFT * math.cos(s.grade) / _behind(s),
        "rear is lighter",
        "`min_load`, as far as it goes",
    ),
    Row(
        "payload higher",
        "5 cm",
        "rear: δ F/(L − x_c)",
        lambda s: SHIFT * s.force / _behind(s),
        "rear is lighter",
        "`min_load`, as far as it goes",
    ),
    Row(
        "payload to one side",
        "5 cm",
        "side: 2 δ/B",
        lambda s: 2.0 * SHIFT / s.model.vehicle.track_width,
        "a side is lighter",
        "`min_load`, as far as it goes",
    ),
    Row(
        "dive of the body",
        "as `ride_frequency`",
        "rear: 4 a z_c²/(ω² L² (L − x_c))",
        lambda s: (
            4.0
            * GRAVITY
            * s.net
            * s.model.vehicle.cg_z**2
            / (_ride(s) * s.model.vehicle.wheelbase**2 * _behind(s))
        ),
        "rear is lighter",
        "`min_load`",
    ),
    Row(
        "roll of the body",
        "as `ride_frequency`",
        "side: 8 a_y z_c²/(ω² B³)",
        lambda s: (
            8.0
            * s.model.limits.lateral_accel
            * s.model.vehicle.cg_z**2
            / (_ride(s) * s.model.vehicle.track_width**3)
        ),
        "the inner side is lighter",
        "`min_load`",
    ),
    Row(
        "twist of the ground under the wheels",
        "1 cm",
        "wheel: ω² w/(4 g)",
        lambda s: _ride(s) * 0.01 / (4.0 * GRAVITY),
        "one diagonal is lighter; axles and sides keep their sums",
        "`wheel_travel`, `max_step`",
    ),
    Row(
        "gyroscopes in the wheels",
        "5 % of the mass",
        "side: 0.1 r a_y/(B g)",
        lambda s: (
            2.0
            * ROTATING
            * s.model.vehicle.wheel_radius
            * s.model.limits.lateral_accel
            / (s.model.vehicle.track_width * GRAVITY)
        ),
        "the inner side is lighter",
        "`min_load`",
    ),
)

FURTHER = (
    Row(
        "cos² θ of a path drawn in plan view",
        "steepest grade",
        "1 − cos² θ of a_y",
        lambda s: math.sin(s.grade) ** 2,
        "turns are slower than they need be",
        "nothing needed",
    ),
    Row(
        "losses between motor and wheel",
        "15 %",
        "of the power that climbs",
        lambda s: 0.15,
        "climbs are slower than planned",
        "`max_drive_power` at the wheels",
    ),
)
