"""Checks of a robot's traffic: limits, times, frames, rates, and odometry."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.services.doctor.robot_facts import ConfigIssue, ObservedTraffic, RobotFacts, error
from slopewise.services.guard.overspeed_monitor import OverspeedMonitor
from slopewise.services.io.bags import GRID_MAP, PATH
from slopewise.services.ros.conversions import ODOMETRY

_OVERSPEED_TOLERANCE = 0.25  # Excess over a limit that is ignored, of a controller's noise [m/s]
_MIN_OVERSPEEDS = 3  # Odometry samples with an excess that are an issue: single ones are noise [1]

_DEAD_TIME, _DEAD_TIME_MARGIN, _DECEL = 0.5, 0.3, 0.5
"""Dead time without a model [s], delay of a limit [s], and deceleration of an
obedient robot: without a model in m/s², with one the share of its service deceleration."""

_MAX_DELAY = 0.5  # Median difference of stamp and reception from which clocks differ [s]

_RATE_TOLERANCE = 0.98  # Share of a rate that jitter and the rounding of times may take for it [1]
_MIN_ODOMETRY_RATE, _MIN_LIMIT_RATE = 10.0, 2.0
"""Rates below which the speed is known too late, and a limit has to hold for long [Hz]."""

_OLD_MAP = 10.0  # Age of maps on arrival, or time without one, that is an issue [s]

_MIN_DISTANCE, _SCALE_TOLERANCE = 5.0, 0.12
"""Distance over which odometry is compared with its own speed [m]; difference ignored [1]."""

_MIN_MESSAGES = 3  # Messages from which stamps are checked [1]


def check_speed_limit_obeyed(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Odometry compared with the limits."""
    seen, model = facts.seen, facts.model
    if not seen.odometry:
        return
    dead = _DEAD_TIME if model is None else model.braking.dead_time + _DEAD_TIME_MARGIN
    decel = _DECEL * (1.0 if model is None else model.limits.decel)
    monitor = OverspeedMonitor(dead, decel, _OVERSPEED_TOLERANCE)
    # At one time speeds come before limits.
    events = [(t, 1, limit) for t, limit, is_percentage in seen.limits if not is_percentage]
    events += [(t, 0, abs(v)) for t, _, _, v in seen.odometry]
    largest, at, count = 0.0, 0.0, 0
    for t, is_limit, value in sorted(events):
        if is_limit:
            # In nav2_msgs/SpeedLimit 0.0 is no limit.
            monitor.set_limit(value if value > 0.0 else np.inf, t)
            continue
        excess = monitor.overspeed(value, t)
        count += excess > 0.0
        if excess > largest:
            largest, at = excess, t - seen.odometry[0][0]
    if count >= _MIN_OVERSPEEDS:
        yield error(
            "limits are not obeyed",
            f"the vehicle was up to {largest + _OVERSPEED_TOLERANCE:.2f} m/s faster than the "
            f"limit, after its brakes had their time (first {at:.1f} s in)",
            "several releases of MPPI ignore speed limits: update it, take another controller, or "
            "put slopewise guard before the base",
        )


def check_limits(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Limits that do not limit."""
    limits = facts.seen.limits
    if any(limit == 0.0 for _, limit, _ in limits):
        yield error(
            "a limit of 0",
            "a node publishes a speed limit of 0.0, which lifts all limits",
            "find it (ros2 topic info -v), and give it another topic",
        )
    if any(is_percentage for _, _, is_percentage in limits):
        yield error(
            "a limit in percent",
            "a node publishes speed limits as a percentage on the same topic",
            "give it another topic: the last message wins",
        )


def check_rates(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Rates of odometry and limits."""
    for name, min_rate, reason in (
        (facts.topics.odometry, _MIN_ODOMETRY_RATE, "its speed is known too late"),
        (facts.topics.speed_limit, _MIN_LIMIT_RATE, "a limit would have to hold for long"),
    ):
        topic = facts.traffic(name)
        if len(topic.at) > 4 and topic.rate < _RATE_TOLERANCE * min_rate:
            yield error(
                "rate",
                f"{name} comes {topic.rate:.1f} times a second: {reason}",
                f"{min_rate:g} Hz or more",
            )


def check_clock(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Stamps compared with reception."""
    for name, topic in sorted(facts.seen.topics.items()):
        stamps = np.array(topic.stamps)
        if len(stamps) < _MIN_MESSAGES or topic.kind in (PATH, GRID_MAP):
            continue
        if not stamps.any() or np.mean(np.diff(stamps) == 0.0) > 0.5:
            if topic.kind == ODOMETRY:
                state = "are repeated" if stamps.any() else "are not filled in"
                yield error(
                    "stamps",
                    f"stamps of {name} {state}: a delay that grows cannot be seen",
                    "stamp each message when it is measured; else declare timing.max_latency",
                )
            continue
        if abs(topic.delay) > _MAX_DELAY:
            yield error(
                "clock",
                f"stamps of {name} are {topic.delay:.1f} s behind their reception",
                "synchronise the clocks (chrony), or let all nodes use simulated time",
            )
        elif np.any(np.diff(stamps) < -1e-3):
            yield error(
                "clock",
                f"stamps of {name} go back",
                "two nodes publish it, or its clock is set while it runs",
            )


def check_map(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Age of the map."""
    seen, name = facts.seen, facts.full_name(facts.topics.map)
    topic = facts.traffic(name)
    if not topic.at:
        if facts.edge is not None and seen.span > _OLD_MAP:
            yield error(
                "map",
                f"no map came on {name} in {seen.span:.0f} s",
                "set topics.map, and see that the map is published again and again",
            )
    elif topic.stamps and topic.delay > _OLD_MAP:
        yield error(
            "map",
            f"maps on {name} are {topic.delay:.0f} s old when they come",
            "publish newer maps; plans stop before ground that is old",
        )


def check_frames(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Frames of map, paths and odometry."""
    topics, grounds = facts.topics, facts.traffic(facts.topics.map).frames
    ground = min(grounds, default="")
    for name in topics.paths:
        frames = facts.traffic(name).frames
        if grounds and frames and not grounds & frames:
            yield error(
                "frames",
                f"map and {name} are in {ground} and {min(frames)}: they have to be in one frame",
                "publish both in one frame",
            )
    odometry = min(facts.traffic(topics.odometry).frames, default="")
    if ground and odometry and not _above(facts.seen, odometry) & _above(facts.seen, ground):
        yield error(
            "frames",
            f"odometry is in {odometry}, the map in {ground}, and /tf does not connect them",
            "publish the transform, or take odometry in the frame of the map",
        )


def _above(seen: ObservedTraffic, frame: str) -> set[str]:
    frames = {frame}
    while (parent := seen.links.get(frame)) is not None and parent not in frames:
        frames.add(parent)
        frame = parent
    return frames


def check_odometry(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Odometry's speed compared with its positions."""
    if len(facts.seen.odometry) < 10:
        return
    t, x, y, v = np.array(facts.seen.odometry).T
    driven = float(np.hypot(np.diff(x), np.diff(y)).sum())
    summed = float(np.sum(0.5 * (np.abs(v[1:]) + np.abs(v[:-1])) * np.diff(t)))
    if driven > _MIN_DISTANCE and abs(summed / driven - 1.0) > _SCALE_TOLERANCE:
        yield error(
            "odometry against itself",
            f"its speed adds up to {summed:.1f} m, its places are {driven:.1f} m apart: the speed "
            "is off in the same ratio, and every stop with it",
            "correct wheel radius or units of the speed",
        )


def check_silence(facts: RobotFacts) -> Iterator[ConfigIssue]:
    """Topics without a counterpart."""
    for text in facts.seen.silence:
        yield error("connections", text, "see docs/nav2.md, When no node answers")
