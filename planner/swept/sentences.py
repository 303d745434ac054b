"""Hazards as text: what, where, how high, and against which limit."""

from __future__ import annotations

import math

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.smallest_seen import sight_notes
from slopewise.models.vehicle import Shape, Vehicle
from slopewise.planner.plan import Obstacle
from slopewise.planner.swept.findings import LIMITING_OF_KIND, Finding, Kind, Pose
from slopewise.planner.swept.sizes import SweptSizes, swept_sizes

_WHAT = {
    Kind.RISE: "a step of {height:.2f} m up under the {wheel} wheel",
    Kind.DROP: "a drop of {height:.2f} m under the {wheel} wheel",
    Kind.TWIST: "the {wheel} wheel or the one across from it hangs {height:.2f} m in the air",
    Kind.UNDERSIDE: "ground {height:.2f} m high between the wheels",
    Kind.FRONT: "ground {height:.2f} m high under the front overhang",
    Kind.REAR: "ground {height:.2f} m high under the rear overhang",
    Kind.SIDE: "ground {height:.2f} m high beside the wheels on the {side}",
}


def obstacle_of(finding: Finding, pose: Pose, sizes: SweptSizes, departure: str = "") -> Obstacle:
    """Finding that blocks a pose, as text. ``departure``: where the vehicle comes from."""
    x = pose.x + finding.ahead * pose.heading_x - finding.aside * pose.heading_y
    y = pose.y + finding.ahead * pose.heading_y + finding.aside * pose.heading_x
    kind = Kind(finding.kind)
    text = _sentence(finding, kind, (x, y), sizes) + departure
    return Obstacle(LIMITING_OF_KIND[kind], x, y, finding.height, text)


def departure_sentence(offset: float, turned: float) -> str:
    """Sentence on the pose of a vehicle off its path: offset [m], heading [rad], left positive."""
    side = "left" if offset >= 0.0 else "right"
    return (
        f", on the way to the path from {abs(offset):.2f} m {side} of it, "
        f"{abs(math.degrees(turned)):.0f}° off its heading"
    )


def _sentence(finding: Finding, kind: Kind, at: tuple[float, float], sizes: SweptSizes) -> str:
    where = f"at x {at[0]:.2f} m, y {at[1]:.2f} m"
    if kind is Kind.UNKNOWN:
        return f"unknown ground under the body {where}"
    side = "left" if finding.aside > 0.0 else "right"
    wheel = f"{'front' if finding.ahead > 0.0 else 'rear'} {side}"
    what = _WHAT[kind].format(height=finding.height, wheel=wheel, side=side)
    return f"{what} {where}, {_limit(kind, sizes)}"


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


def cannot_see(sizes: SweptSizes, resolution: float) -> str:
    """Hazards that a map of this resolution [m] does not show, empty where it shows all."""
    if sizes.fine:
        return ""
    return (
        f"cells of {resolution:g} m do not show steps, twist and roughness: nothing smaller than "
        f"{2.0 * resolution:g} m is judged, the wheels' radius is {sizes.radius:g} m"
    )


def notes(vehicle: Vehicle, elevation_map: ElevationMap) -> tuple[str, ...]:
    """Warnings about the map and about sizes."""
    resolution = elevation_map.resolution
    warnings = (
        cannot_see(swept_sizes(vehicle, resolution), resolution),
        *sight_notes(elevation_map, vehicle),
        assumed_sizes(vehicle.shape),
    )
    return tuple(note for note in warnings if note)


def assumed_sizes(shape: Shape) -> str:
    """Which sizes of the body the model lacks, empty where it has all."""
    if not shape.assumed:
        return ""
    return (
        f"assumed from the wheel radius: {', '.join(shape.assumed)} (clearance "
        f"{shape.clearance:.2g} m, step {shape.max_step:.2g} m, width {shape.width:.2g} m)"
    )
