"""The chain from controller over smoother to base: do its limits fit each other and the brakes?"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.services.doctor.facts import Facts, Misfit, MisfitSeverity, Nav2Facts

_DECELERATIONS = ("ax_min", "decel_lim_x", "max_linear_decel", "max_decel_x")
_SPEEDS = ("vx_max", "max_vel_x", "desired_linear_vel", "max_linear_vel")
_BASES = (
    "diff_drive_controller",
    "diffdrive_controller",
    "platform_velocity_controller",
    "ackermann_steering_controller",
    "base_controller",
)
_SLOPPY = 1.02


class Link(NamedTuple):
    """One that limits the deceleration: who, by which parameter, to how much [m/s²], > 0."""

    who: str
    parameter: str
    deceleration: float


def first(value: Any) -> float | None:
    """A number, or the first of some."""
    if isinstance(value, list) and value:
        value = value[0]
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else None


def links(nav2: Nav2Facts) -> list[Link]:
    """Along the way of a command: controllers, then the smoother, then the base."""
    found = []
    for name, table in nav2.controllers().items():
        for key in _DECELERATIONS:
            value = first(table.get(key))
            if value:
                found.append(Link(f"controller {name}", key, abs(value)))
                break
    value = first(nav2.of("velocity_smoother").get("max_decel"))
    if value:
        found.append(Link("velocity_smoother", "max_decel", abs(value)))
    for base in _BASES:
        limit = nav2.of(base).get("linear", {})
        table = limit.get("x", {}) if isinstance(limit, Mapping) else {}
        for key in ("max_deceleration", "min_acceleration"):
            value = first(table.get(key))
            if value and table.get("has_acceleration_limits", True):
                found.append(Link(base, f"linear.x.{key}", abs(value)))
                break
    return found


def brakes_on_level(model: Model) -> float:
    """The least emergency deceleration on level ground that was learned, of all surfaces [m/s²]."""
    tables = [model.braking.on(name) for name in ("", *model.braking.terrain)]
    return GRAVITY * min(t.level_force(v) for t in tables for v in t.speed_range)


def check_chain(facts: Facts) -> Iterator[Misfit]:
    """Decelerations along the chain, and against the brakes."""
    if facts.nav2 is None:
        return
    chain = links(facts.nav2)
    for k, (before, after) in enumerate(itertools.pairwise(chain)):
        if before.who.startswith("controller") and after.who.startswith("controller"):
            after = next((n for n in chain[k + 1 :] if not n.who.startswith("controller")), after)
            if after.who.startswith("controller"):
                continue
        if before.deceleration > _SLOPPY * after.deceleration:
            yield Misfit(
                "deceleration along the chain",
                MisfitSeverity.ERROR,
                f"{before.who} counts on {before.deceleration:g} m/s² ({before.parameter}), and "
                f"{after.who} lets {after.deceleration:g} m/s² through ({after.parameter}): the "
                "vehicle stops later than the controller thinks",
                f"set {after.parameter} of {after.who} to {before.deceleration:g}, or the "
                "controller's to less",
            )
    if facts.model is None:
        return
    able, wanted = brakes_on_level(facts.model), facts.model.limits.decel
    for link in chain:
        if link.deceleration > _SLOPPY * able:
            yield Misfit(
                "deceleration against the brakes",
                MisfitSeverity.ERROR,
                f"{link.who} counts on {link.deceleration:g} m/s² ({link.parameter}), the brakes "
                f"were learned to reach {able:.2f} m/s² on level ground at least",
                f"set it below {able:.1f}",
            )
        if link.deceleration * _SLOPPY < wanted:
            yield Misfit(
                "deceleration against the plan",
                MisfitSeverity.ERROR,
                f"plans brake with up to {wanted:g} m/s² (limits.decel), {link.who} lets "
                f"{link.deceleration:g} m/s² through ({link.parameter})",
                f"set limits.decel of the model to {link.deceleration:g}, or let more through",
            )


def check_smoother(facts: Facts) -> Iterator[Misfit]:
    """Signs and speeds of the velocity smoother."""
    if facts.nav2 is None:
        return
    smoother = facts.nav2.of("velocity_smoother")
    decel, most = first(smoother.get("max_decel")), first(smoother.get("max_velocity"))
    if decel is not None and decel > 0.0:
        yield Misfit(
            "sign of a deceleration",
            MisfitSeverity.ERROR,
            f"velocity_smoother has max_decel {decel:g}: it has to be negative",
            f"set it to {-decel:g}",
        )
    for name, table in facts.nav2.controllers().items():
        fastest = next((v for key in _SPEEDS if (v := first(table.get(key))) is not None), None)
        if fastest is None:
            continue
        if most is not None and fastest > _SLOPPY * most:
            yield Misfit(
                "speed along the chain",
                MisfitSeverity.WARNING,
                f"controller {name} drives up to {fastest:g} m/s, velocity_smoother lets {most:g} "
                "through: curvature is kept, progress is not what the controller thinks",
                "give both the same speed",
            )
        if facts.model is not None and fastest > _SLOPPY * facts.model.limits.speed:
            yield Misfit(
                "speed against the model",
                MisfitSeverity.WARNING,
                f"controller {name} drives up to {fastest:g} m/s where no limit is heard; the "
                f"model allows {facts.model.limits.speed:g}",
                "set the controller's highest speed to that of the model",
            )


def check_speed_limit(facts: Facts) -> Iterator[Misfit]:
    """Whether a limit gets to the controller, and whether nothing else speaks there."""
    if facts.nav2 is None:
        return
    server = facts.nav2.of("controller_server")
    listens = str(server.get("speed_limit_topic", "speed_limit")).lstrip("/")
    ours = "speed_limit" if facts.edge is None else facts.edge.topics.speed_limit.lstrip("/")
    if server and listens != ours:
        yield Misfit(
            "topic of the limit",
            MisfitSeverity.ERROR,
            f"the controller listens to {listens}, limits are said on {ours}",
            f"set speed_limit_topic: {ours}",
        )
    for node, table in facts.nav2.nodes.items():
        if not node.endswith("costmap"):
            continue
        for name, plugin in table.items():
            if not isinstance(plugin, Mapping) or "SpeedFilter" not in str(plugin.get("plugin")):
                continue
            if str(plugin.get("speed_limit_topic", "speed_limit")).lstrip("/") == listens:
                yield Misfit(
                    "two who limit",
                    MisfitSeverity.ERROR,
                    f"{node}: {name} speaks on {listens} as well: the last one to speak wins",
                    "give the filter another topic, and put its limits into the model",
                )
    yield from _lock(facts)


def _lock(facts: Facts) -> Iterator[Misfit]:
    assert facts.nav2 is not None
    mux = facts.nav2.of("twist_mux")
    if not mux:
        return
    stop = "speed_stop" if facts.edge is None else facts.edge.topics.stop
    locks = mux.get("locks", {})
    ours = [
        lock
        for lock in (locks.values() if isinstance(locks, Mapping) else ())
        if isinstance(lock, Mapping) and str(lock.get("topic")).lstrip("/") == stop.lstrip("/")
    ]
    if not ours:
        yield Misfit(
            "lock",
            MisfitSeverity.ERROR,
            f"twist_mux has no lock on {stop}: a limit alone lets the vehicle creep on",
            f"locks: slopewise: {{topic: {stop}, timeout: 0.5, priority: 255}}",
        )
    for lock in ours:
        timeout = first(lock.get("timeout")) or 0.0
        if not 0.0 < timeout <= 1.0:
            yield Misfit(
                "lock",
                MisfitSeverity.ERROR,
                f"the lock of twist_mux on {stop} has timeout {timeout:g} s: it does not close "
                "in time, or at all, when nobody speaks any more",
                "set it to 0.5",
            )
