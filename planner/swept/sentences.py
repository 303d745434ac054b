"""Hazards as text: what, where, how high, and against which limit."""

from __future__ import annotations

import math
from enum import IntEnum

from slopewise.models.arrays import Floats
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.smallest_seen import sight_notes
from slopewise.models.vehicle import Vehicle
from slopewise.planner.limiting import Limiting
from slopewise.planner.plan import Obstacle
from slopewise.planner.swept.sizes import SweptSizes


class Kind(IntEnum):
    """Kind of hazard; :data:`LIMITING_OF_KIND` lists the bound of each."""

    NOTHING = 0
    UNKNOWN = 1
    RISE = 2
    DROP = 3
    TWIST = 4
    UNDERSIDE = 5
    FRONT = 6
    REAR = 7
    SIDE = 8


LIMITING_OF_KIND: dict[Kind, Limiting] = {
    Kind.UNKNOWN: Limiting.UNKNOWN_TERRAIN,
    Kind.RISE: Limiting.STEP,
    Kind.DROP: Limiting.STEP,
    Kind.TWIST: Limiting.STEP,
    Kind.UNDERSIDE: Limiting.CLEARANCE,
    Kind.FRONT: Limiting.BODY,
    Kind.REAR: Limiting.BODY,
    Kind.SIDE: Limiting.BODY,
}


_WHAT = {
    Kind.RISE: "a step of {height:.2f} m up under the {wheel} wheel",
    Kind.DROP: "a drop of {height:.2f} m under the {wheel} wheel",
    Kind.TWIST: "the {wheel} wheel or the one across from it hangs {height:.2f} m in the air",
    Kind.UNDERSIDE: "ground {height:.2f} m high between the wheels",
    Kind.FRONT: "ground {height:.2f} m high under the front overhang",
    Kind.REAR: "ground {height:.2f} m high under the rear overhang",
    Kind.SIDE: "ground {height:.2f} m high beside the wheels on the {side}",
}


def obstacle_of(
    finding: Floats, pose: tuple[float, ...], sizes: SweptSizes, departure: str
) -> Obstacle:
    """Finding of the core that blocks a pose, as text.

    Args:
        finding: (4,) :class:`Kind`, height of what is met, and where, ahead and left of the pose
            [m].
        pose: middle of the wheelbase [m], unit vector of travel.
        sizes: vehicle sizes on this map.
        departure: where the vehicle comes from, empty where that did not matter.
    """
    (code, height, ahead, left), (at_x, at_y, heading_x, heading_y) = finding.tolist(), pose
    x = at_x + ahead * heading_x - left * heading_y
    y = at_y + ahead * heading_y + left * heading_x
    kind, where = Kind(int(code)), f"at x {x:.2f} m, y {y:.2f} m"
    text = f"unknown ground under the body {where}"
    if kind is not Kind.UNKNOWN:
        side = "left" if left > 0.0 else "right"
        wheel = f"{'front' if ahead > 0.0 else 'rear'} {side}"
        what = _WHAT[kind].format(height=height, wheel=wheel, side=side)
        text = f"{what} {where}, {_limit(kind, sizes)}"
    return Obstacle(LIMITING_OF_KIND[kind], x, y, height, text + departure)


def departure_sentence(offset: float, turned: float) -> str:
    """Sentence on the pose of a vehicle off its path: offset [m], heading [rad], left positive."""
    side = "left" if offset >= 0.0 else "right"
    return (
        f", on the way to the path from {abs(offset):.2f} m {side} of it, "
        f"{abs(math.degrees(turned)):.0f}° off its heading"
    )


def too_tight(x: float, y: float, curvature: float, max_curvature: float) -> str:
    """A turn that the steering cannot make; place [m], curvatures [1/m]."""
    return (
        f"at x {x:.2f} m, y {y:.2f} m the path turns tighter than the vehicle can: radius "
        f"{1.0 / abs(curvature):.2f} m, at least {1.0 / max_curvature:.2f} m is needed"
    )


def _limit(kind: Kind, sizes: SweptSizes) -> str:
    if kind in (Kind.RISE, Kind.DROP):
        return f"the limit is {sizes.max_step:.3g} m"
    if kind is Kind.TWIST:
        return f"its travel is {sizes.wheel_travel:.3g} m"
    return f"the clearance is {sizes.clearance:.3g} m"


def notes(vehicle: Vehicle, elevation_map: ElevationMap) -> tuple[str, ...]:
    """Warnings about the map and about sizes that the model lacks."""
    resolution, radius, shape = elevation_map.resolution, vehicle.wheel_radius, vehicle.shape
    warnings = list(sight_notes(elevation_map, vehicle))
    if resolution > radius:
        warnings.insert(
            0,
            f"cells of {resolution:g} m do not show steps, twist and roughness: nothing smaller "
            f"than {2.0 * resolution:g} m is judged, the wheels' radius is {radius:g} m",
        )
    if shape.assumed:
        warnings.append(
            f"assumed from the wheel radius: {', '.join(shape.assumed)} (clearance "
            f"{shape.clearance:.2g} m, step {shape.max_step:.2g} m, width {shape.width:.2g} m)"
        )
    return tuple(warnings)
