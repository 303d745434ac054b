"""Checks of the chain from controller over smoother to base, and of its limits."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import NamedTuple

from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.doctor.robot_facts import (
    ConfigIssue,
    Nav2Facts,
    RobotFacts,
    error,
    first_number,
    table_of,
    warning,
)
from slopewise.services.io.files import shown

_DECELERATIONS = ("ax_min", "decel_lim_x", "max_linear_decel", "max_decel_x")
_BASE_DECELERATIONS = ("max_deceleration", "min_acceleration")
_SPEEDS = ("vx_max", "max_vel_x", "desired_linear_vel", "max_linear_vel")
_BASES = (
    "diff_drive_controller",
    "diffdrive_controller",
    "platform_velocity_controller",
    "ackermann_steering_controller",
    "base_controller",
)

_TOLERANCE = 1.02  # Ratio up to which two values are the same: rounding in files [1]

_MAX_LOCK_TIMEOUT = 1.0
"""Longest time after which a lock closes: a vehicle at 2 m/s drives 2 m meanwhile [s]."""


class Link(NamedTuple):
    """Component that limits the deceleration, by a parameter, to a value > 0 [m/s²]."""

    name: str
    parameter: str
    deceleration: float

    @property
    def is_controller(self) -> bool:
        """Return True for a path-following plugin, of which one is active at a time."""
        return self.name.startswith("controller")


def links(nav2: Nav2Facts) -> list[Link]:
    """Links in the order of a command: controllers, then the smoother, then the base."""
    chain = []
    for name, table in nav2.controllers().items():
        values = ((key, first_number(table.get(key))) for key in _DECELERATIONS)
        chain += [Link(f"controller {name}", key, abs(v)) for key, v in values if v][:1]
    if value := first_number(nav2.of("velocity_smoother").get("max_decel")):
        chain.append(Link("velocity_smoother", "max_decel", abs(value)))
    for base in _BASES:
        table = table_of(nav2.of(base), "linear", "x")
        values = ((key, first_number(table.get(key))) for key in _BASE_DECELERATIONS)
        if table.get("has_acceleration_limits", True):
            chain += [Link(base, f"linear.x.{key}", abs(v)) for key, v in values if v][:1]
    return chain


def check_numbers(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Parameters of the chain that are no numbers: no other check sees them."""
    for name, table, keys in _numbers_of(facts.nav2):
        for key in keys:
            if key in table and first_number(table[key]) is None:
                yield warning(
                    "a parameter that is no number",
                    f"{name} has {key} {shown(table[key])}: nothing can be checked by it",
                    "write a number without quotes; in place of a launch file's $(var …) its value",
                )


def _numbers_of(nav2: Nav2Facts) -> Iterator[tuple[str, Mapping[str, object], tuple[str, ...]]]:
    """Components, their parameters, and which of these have to be numbers."""
    yield "controller_server", nav2.of("controller_server"), ("controller_frequency",)
    for name, table in nav2.controllers().items():
        yield f"controller {name}", table, _DECELERATIONS + _SPEEDS
    yield "velocity_smoother", nav2.of("velocity_smoother"), ("max_decel", "max_velocity")
    for base in _BASES:
        yield base, table_of(nav2.of(base), "linear", "x"), _BASE_DECELERATIONS


def brakes_on_level(model: Model) -> float:
    """Lowest learned emergency deceleration on level ground, of all surfaces [m/s²]."""
    tables = [model.braking.on(name) for name in ("", *model.braking.terrain)]
    return GRAVITY * min(t.level_force(v) for t in tables for v in t.speed_range)


def check_chain(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Decelerations along the chain, and compared with the brakes."""
    chain = links(facts.nav2)
    for k, (before, after) in enumerate(itertools.pairwise(chain)):
        if before.is_controller and after.is_controller:
            after = next((n for n in chain[k + 1 :] if not n.is_controller), after)
            if after.is_controller:
                continue
        if before.deceleration > _TOLERANCE * after.deceleration:
            yield error(
                "deceleration along the chain",
                f"{before.name} counts on {before.deceleration:g} m/s² ({before.parameter}), and "
                f"{after.name} lets {after.deceleration:g} m/s² through ({after.parameter}): the "
                "vehicle stops later than the controller expects",
                f"set {after.parameter} of {after.name} to {before.deceleration:g}, or the "
                "controller's to less",
            )
    if facts.model is None:
        return
    able, planned = brakes_on_level(facts.model), facts.model.limits.decel
    for link in chain:
        if link.deceleration > _TOLERANCE * able:
            yield error(
                "deceleration against the brakes",
                f"{link.name} counts on {link.deceleration:g} m/s² ({link.parameter}), the brakes "
                f"were learned to reach {able:.2f} m/s² on level ground at least",
                f"set it below {able:.1f}",
            )
        if link.deceleration * _TOLERANCE < planned:
            yield error(
                "deceleration against the plan",
                f"plans brake with up to {planned:g} m/s² (limits.decel), {link.name} lets "
                f"{link.deceleration:g} m/s² through ({link.parameter})",
                f"set limits.decel of the model to {link.deceleration:g}, or let more through",
            )


def check_smoother(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Signs of decelerations, and speeds of the velocity smoother."""
    for name, table in facts.nav2.controllers().items():
        # DWB adds it to the speed where it slows down, so that the vehicle gets faster.
        if (slower := first_number(table.get("decel_lim_x"))) is not None and slower > 0.0:
            yield error(
                "sign of a deceleration",
                f"controller {name} has decel_lim_x {slower:g}: it has to be negative",
                f"set it to {-slower:g}",
            )
    smoother = facts.nav2.of("velocity_smoother")
    decel, passed = (first_number(smoother.get(key)) for key in ("max_decel", "max_velocity"))
    if decel is not None and decel > 0.0:
        yield error(
            "sign of a deceleration",
            f"velocity_smoother has max_decel {decel:g}: it has to be negative",
            f"set it to {-decel:g}",
        )
    for name, table in facts.nav2.controllers().items():
        speeds = (first_number(table.get(key)) for key in _SPEEDS)
        fastest = next((speed for speed in speeds if speed is not None), None)
        if fastest is None:
            continue
        if passed is not None and fastest > _TOLERANCE * passed:
            yield warning(
                "speed along the chain",
                f"controller {name} drives up to {fastest:g} m/s, velocity_smoother lets "
                f"{passed:g} through: curvature is kept, progress is not what the controller "
                "expects",
                "give both the same speed",
            )
        if facts.model is not None and fastest > _TOLERANCE * facts.model.limits.speed:
            yield warning(
                "speed against the model",
                f"controller {name} drives up to {fastest:g} m/s where no limit is received; the "
                f"model allows {facts.model.limits.speed:g}",
                "set the controller's highest speed to that of the model",
            )


def check_speed_limit(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Path of the limit to the controller, and other publishers on its topic."""
    server = facts.nav2.of("controller_server")
    received = str(server.get("speed_limit_topic", "speed_limit")).lstrip("/")
    ours = facts.topics.speed_limit.lstrip("/")
    is_there = "controller_server" in facts.nav2.nodes or "speed_limit_topic" in server
    if is_there and received != ours:
        yield error(
            "topic of the limit",
            f"the controller subscribes to {received}, limits are published on {ours}",
            f"set speed_limit_topic: {ours}",
        )
    for node, table in facts.nav2.nodes.items():
        for name, plugin in table.items() if node.endswith("costmap") else ():
            if not isinstance(plugin, Mapping) or "SpeedFilter" not in str(plugin.get("plugin")):
                continue
            if str(plugin.get("speed_limit_topic", "speed_limit")).lstrip("/") == received:
                yield error(
                    "two who limit",
                    f"{node}: {name} publishes on {received} as well: the last message wins",
                    "give the filter another topic, and put its limits into the model",
                )
    yield from _check_lock(facts, facts.nav2.of("twist_mux"))


def _check_lock(facts: RobotFacts, mux: Mapping[str, object]) -> Iterator[ConfigIssue]:
    if not {"topics", "locks"} & mux.keys() and "twist_mux" not in facts.nav2.nodes:
        return
    stop, locks = facts.topics.stop, mux.get("locks", {})
    tables = locks.values() if isinstance(locks, Mapping) else ()
    ours = [
        lock
        for lock in tables
        if isinstance(lock, Mapping) and str(lock.get("topic")).lstrip("/") == stop.lstrip("/")
    ]
    if not ours:
        yield error(
            "lock",
            f"twist_mux has no lock on {stop}: a limit alone lets the vehicle creep on",
            f"locks: slopewise: {{topic: {stop}, timeout: 0.5, priority: 255}}",
        )
    for lock in ours:
        timeout = first_number(lock.get("timeout")) or 0.0
        if not 0.0 < timeout <= _MAX_LOCK_TIMEOUT:
            yield error(
                "lock",
                f"the lock of twist_mux on {stop} has timeout {timeout:g} s: it does not close "
                "in time, or not at all, when messages end",
                "set it to 0.5",
            )
