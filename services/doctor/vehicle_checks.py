"""Checks of the model file and the edge's settings, compared with the robot's parameters."""

from __future__ import annotations

import ast
from collections.abc import Iterator

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.services.doctor.command_chain_checks import brakes_on_level
from slopewise.services.doctor.robot_facts import (
    ConfigIssue,
    RobotFacts,
    error,
    first_number,
    warning,
)

_SIZE_TOLERANCE = 0.05  # Difference of sizes that is ignored, a cell of a costmap [m]

_RADIUS_TOLERANCE = 0.03
"""Relative difference of wheel radii that is ignored, that of tyre pressure [1]."""

_MIN_RATE = 10.0  # Frequency of a controller below which a limit is late [Hz]
_SAFE_SHARE = 0.8  # Share of the learned brakes that is proposed for a stop that must not fail [1]


def check_footprint(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Costmaps whose vehicle is smaller than that of the model file."""
    if facts.model is None:
        return
    shape = facts.model.vehicle.shape
    length, width = shape.front + shape.rear, shape.width
    for node in ("local_costmap", "global_costmap"):
        table = facts.nav2.of(node)
        outline, radius = _outline(table.get("footprint")), first_number(table.get("robot_radius"))
        if outline is not None:
            sizes = outline.max(axis=0) - outline.min(axis=0)
            text = f"{sizes[0]:.2f} x {sizes[1]:.2f} m"
            is_small = sizes[0] < length - _SIZE_TOLERANCE or sizes[1] < width - _SIZE_TOLERANCE
        elif radius is not None:
            text = f"a circle of radius {radius:g} m"
            is_small = 2.0 * radius < max(length, width) - _SIZE_TOLERANCE
        else:
            continue
        if is_small:
            yield error(
                "footprint",
                f"{node} takes the vehicle for {text}, by the model file it is {length:.2f} x "
                f"{width:.2f} m",
                "correct the one that is wrong: width, front_overhang, rear_overhang, or footprint",
            )


def _outline(value: object) -> Floats | None:
    try:
        points = np.array(ast.literal_eval(value) if isinstance(value, str) else value, float)
    except (ValueError, SyntaxError, TypeError):
        return None
    return points if points.ndim == 2 and points.shape[1] == 2 and len(points) > 2 else None


def check_edge(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """The edge's fallback stop, wheels and times."""
    edge, model = facts.edge, facts.model
    if edge is None:
        return
    if model is not None:
        able = brakes_on_level(model)
        if edge.stop.deceleration > able:
            yield error(
                "the edge's own stop",
                f"stop.deceleration is {edge.stop.deceleration:g} m/s², the brakes were learned to "
                f"reach {able:.2f} m/s² at least",
                f"set it to {_SAFE_SHARE * able:.1f} or less",
            )
        if edge.stop.dead_time < model.braking.dead_time:
            yield error(
                "the edge's own stop",
                f"stop.dead_time is {edge.stop.dead_time:g} s, that of the model "
                f"{model.braking.dead_time:g} s",
                "set it to no less",
            )
        radius, known = edge.wheels.radius, model.vehicle.wheel_radius
        if edge.wheels.left and abs(radius - known) > _RADIUS_TOLERANCE * known:
            yield error(
                "wheel radius",
                f"wheels.radius is {radius:g} m, that of the model {known:g} m: ground is learned "
                "wrongly",
                "measure it with load, and set both",
            )
    rate = facts.nav2.controller_rate()
    if rate and edge.timing.life < 2.0 / rate:
        yield error(
            "life of a limit",
            f"a limit holds for {edge.timing.life:g} s, the controller reads one every "
            f"{1.0 / rate:.2f} s",
            "set timing.life to twice that, or the controller's frequency higher",
        )


def check_times(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Clocks and frequencies in parameter files."""
    clocks = {
        node: bool(table["use_sim_time"])
        for node, table in facts.nav2.nodes.items()
        if "use_sim_time" in table
    }
    if len(set(clocks.values())) > 1:
        simulated = ", ".join(sorted(node for node, value in clocks.items() if value))
        yield error(
            "clock",
            f"{simulated} run on simulated time, others do not",
            "give all nodes the same use_sim_time",
        )
    rate = facts.nav2.controller_rate()
    if rate is not None and rate < _MIN_RATE:
        late = f"up to {1.0 / rate:.2f} s later" if rate > 0.0 else "never"
        yield warning(
            "rate of the controller",
            f"controller_frequency is {rate:g} Hz: a limit is used {late}",
            f"set it to {_MIN_RATE:g} Hz or more",
        )
