"""The vehicle file against what others believe of the same vehicle, and the edge's own numbers."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import numpy as np

from slopewise.services.doctor.chain import brakes_on_level, first
from slopewise.services.doctor.facts import Facts, Misfit, MisfitSeverity

_OFF = 0.05  # [m] by which sizes may differ
_RADIUS = 0.03  # share by which wheel radii may differ


def check_footprint(facts: Facts) -> Iterator[Misfit]:
    """Costmaps that take the vehicle for smaller than it is."""
    if facts.nav2 is None or facts.model is None:
        return
    shape = facts.model.vehicle.shape
    length, width = shape.front + shape.rear, shape.width
    for node in ("local_costmap", "global_costmap"):
        table = facts.nav2.of(node)
        outline = _outline(table.get("footprint"))
        radius = first(table.get("robot_radius"))
        if outline is not None:
            sizes = outline.max(axis=0) - outline.min(axis=0)
            what = f"{sizes[0]:.2f} x {sizes[1]:.2f} m"
            small = sizes[0] < length - _OFF or sizes[1] < width - _OFF
        elif radius is not None:
            what = f"a circle of radius {radius:g} m"
            small = 2.0 * radius < max(length, width) - _OFF
        else:
            continue
        if small:
            yield Misfit(
                "footprint",
                MisfitSeverity.ERROR,
                f"{node} takes the vehicle for {what}, by the model file it is {length:.2f} x "
                f"{width:.2f} m",
                "correct the one that is wrong: width, front_overhang, rear_overhang, or footprint",
            )


def _outline(value: object) -> np.ndarray | None:
    try:
        points = np.array(ast.literal_eval(value) if isinstance(value, str) else value, float)
    except (ValueError, SyntaxError, TypeError):
        return None
    return points if points.ndim == 2 and points.shape[1] == 2 and len(points) > 2 else None


def check_edge(facts: Facts) -> Iterator[Misfit]:
    """The edge's own stop, wheels and times."""
    edge, model = facts.edge, facts.model
    if edge is None:
        return
    if model is not None:
        able = brakes_on_level(model)
        if edge.stop.deceleration > able:
            yield Misfit(
                "the edge's own stop",
                MisfitSeverity.ERROR,
                f"stop.deceleration is {edge.stop.deceleration:g} m/s², the brakes were learned to "
                f"reach {able:.2f} m/s² at least",
                f"set it to {0.8 * able:.1f} or less",
            )
        if edge.stop.dead_time < model.braking.dead_time:
            yield Misfit(
                "the edge's own stop",
                MisfitSeverity.ERROR,
                f"stop.dead_time is {edge.stop.dead_time:g} s, that of the model "
                f"{model.braking.dead_time:g} s",
                "set it to no less",
            )
        told, known = edge.wheels.radius, model.vehicle.wheel_radius
        if edge.wheels.left and abs(told - known) > _RADIUS * known:
            yield Misfit(
                "wheel radius",
                MisfitSeverity.ERROR,
                f"wheels.radius is {told:g} m, that of the model {known:g} m: ground is learned "
                "wrongly",
                "measure it with load, and set both",
            )
    if facts.nav2 is not None:
        rate = first(facts.nav2.of("controller_server").get("controller_frequency"))
        if rate and edge.timing.life < 2.0 / rate:
            yield Misfit(
                "life of a limit",
                MisfitSeverity.ERROR,
                f"a limit looks {edge.timing.life:g} s ahead, the controller takes one up every "
                f"{1.0 / rate:.2f} s",
                "set timing.life to twice that, or the controller's frequency higher",
            )


def check_times(facts: Facts) -> Iterator[Misfit]:
    """Clocks and frequencies in parameter files."""
    if facts.nav2 is None:
        return
    clocks = {
        node: bool(table["use_sim_time"])
        for node, table in facts.nav2.nodes.items()
        if "use_sim_time" in table
    }
    if len(set(clocks.values())) > 1:
        simulated = ", ".join(sorted(node for node, value in clocks.items() if value))
        yield Misfit(
            "clock",
            MisfitSeverity.ERROR,
            f"{simulated} run on simulated time, others do not",
            "give all nodes the same use_sim_time",
        )
    rate = first(facts.nav2.of("controller_server").get("controller_frequency"))
    if rate is not None and rate < 10.0:
        yield Misfit(
            "rate of the controller",
            MisfitSeverity.WARNING,
            f"controller_frequency is {rate:g} Hz: a limit counts up to {1.0 / rate:.2f} s later",
            "set it to 10 Hz or more",
        )
