"""What the robot was seen to do: are limits obeyed, do times, frames and rates fit?"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from slopewise.services.doctor.facts import Facts, Misfit, MisfitSeverity, Seen
from slopewise.services.guard.overspeed_monitor import OverspeedMonitor
from slopewise.services.ros.settings import Topics

_OBEYS = 0.25  # [m/s] faster than the limit that does not count
_LATE = 0.5  # [s] between stamp and reception
_SLOW_ODOMETRY, _SLOW_LIMITS = 10.0, 2.0  # [Hz]
_OLD_MAP = 10.0  # [s]
_MOVES = 5.0  # [m] over which odometry is held against its own speed
_SCALE = 0.12
_ODOMETRY, _GRID_MAP, _PATH = (
    "nav_msgs/msg/Odometry",
    "grid_map_msgs/msg/GridMap",
    "nav_msgs/msg/Path",
)


def check_obedience(facts: Facts) -> Iterator[Misfit]:
    """Odometry against the limits that were said."""
    seen = facts.seen
    if seen is None or not seen.limits or not seen.odometry:
        return
    model = facts.model
    dead = 0.5 if model is None else model.braking.dead_time + 0.3
    decel = 0.5 if model is None else 0.5 * model.limits.decel
    watched = OverspeedMonitor(dead, decel, _OBEYS)
    said = sorted([(t, 1, limit) for t, limit, percentage in seen.limits if not percentage])
    drove = [(t, 0, abs(v)) for t, _, _, v in seen.odometry]
    worst, at, too_fast = 0.0, 0.0, 0
    for t, is_limit, value in sorted(said + drove):
        if is_limit:
            # In nav2_msgs/SpeedLimit 0.0 is no limit.
            watched.set_limit(value if value > 0.0 else np.inf, t)
            continue
        over = watched.overspeed(value, t)
        too_fast += over > 0.0
        if over > worst:
            worst, at = over, t - seen.odometry[0][0]
    if too_fast > 2:
        yield Misfit(
            "limits are not obeyed",
            MisfitSeverity.ERROR,
            f"the vehicle was up to {worst + _OBEYS:.2f} m/s faster than the limit, after its "
            f"brakes had their time (first {at:.1f} s in)",
            "several releases of MPPI ignore speed limits: update it, take another controller, or "
            "put slopewise guard before the base",
        )


def check_limits(facts: Facts) -> Iterator[Misfit]:
    """Limits that are none."""
    seen = facts.seen
    if seen is None:
        return
    if any(limit == 0.0 for _, limit, _ in seen.limits):
        yield Misfit(
            "a limit of 0",
            MisfitSeverity.ERROR,
            "somebody says a speed limit of 0.0, which lifts all limits",
            "find who it is (ros2 topic info -v), and let it say another topic",
        )
    if any(percentage for _, _, percentage in seen.limits):
        yield Misfit(
            "a limit in percent",
            MisfitSeverity.ERROR,
            "somebody says speed limits as a percentage on the same topic",
            "give it another topic: the last one to speak wins",
        )


def check_rates(facts: Facts) -> Iterator[Misfit]:
    """How often messages come."""
    seen, topics = facts.seen, _topics(facts)
    if seen is None:
        return
    wanted = [(topics.odometry, _SLOW_ODOMETRY, "its speed is known too late")]
    wanted.append((topics.speed_limit, _SLOW_LIMITS, "a limit would have to look far ahead"))
    for name, least, why in wanted:
        topic = seen.topics.get(_full(facts, name))
        if topic is not None and len(topic.at) > 4 and topic.rate < least:
            yield Misfit(
                "rate",
                MisfitSeverity.ERROR,
                f"{name} comes {topic.rate:.1f} times a second: {why}",
                f"{least:g} Hz or more",
            )


def check_clock(facts: Facts) -> Iterator[Misfit]:
    """Stamps against reception."""
    if facts.seen is None:
        return
    for name, topic in sorted(facts.seen.topics.items()):
        stamps = np.array(topic.stamps)
        if len(stamps) < 3 or topic.kind in (_PATH, _GRID_MAP):
            continue
        if not stamps.any() or np.mean(np.diff(stamps) == 0.0) > 0.5:
            if topic.kind == _ODOMETRY:
                state = "are repeated" if stamps.any() else "are not filled in"
                yield Misfit(
                    "stamps",
                    MisfitSeverity.ERROR,
                    f"stamps of {name} {state}: a delay that grows cannot be seen",
                    "stamp each message when it is measured; else declare timing.max_latency",
                )
            continue
        late = np.array(topic.at[-len(stamps) :]) - stamps
        if abs(float(np.median(late))) > _LATE:
            yield Misfit(
                "clock",
                MisfitSeverity.ERROR,
                f"stamps of {name} are {np.median(late):.1f} s behind their reception",
                "synchronise the clocks (chrony), or let all nodes use simulated time",
            )
        elif np.any(np.diff(stamps) < -1e-3):
            yield Misfit(
                "clock",
                MisfitSeverity.ERROR,
                f"stamps of {name} go back",
                "there are two who publish it, or its clock is set while it runs",
            )


def check_map(facts: Facts) -> Iterator[Misfit]:
    """How old the map is."""
    seen = facts.seen
    if seen is None:
        return
    name = _full(facts, _topics(facts).map)
    topic = seen.topics.get(name)
    if topic is None:
        if facts.edge is not None and seen.span > _OLD_MAP:
            yield Misfit(
                "map",
                MisfitSeverity.ERROR,
                f"no map came on {name} in {seen.span:.0f} s",
                "set topics.map, and see that the map is published again and again",
            )
        return
    if topic.stamps and topic.at:
        age = float(np.median(np.array(topic.at[-len(topic.stamps) :]) - topic.stamps))
        if age > _OLD_MAP:
            yield Misfit(
                "map",
                MisfitSeverity.ERROR,
                f"maps on {name} are {age:.0f} s old when they come",
                "publish what is seen now; plans stop before ground that is old",
            )


def check_frames(facts: Facts) -> Iterator[Misfit]:
    """Whether the vehicle can be placed on the map."""
    seen, topics = facts.seen, _topics(facts)
    if seen is None:
        return
    ground = seen.topics.get(_full(facts, topics.map))
    odometry = seen.topics.get(_full(facts, topics.odometry))
    for name in topics.paths:
        path = seen.topics.get(_full(facts, name))
        if ground and path and ground.frames and path.frames and not ground.frames & path.frames:
            yield Misfit(
                "frames",
                MisfitSeverity.ERROR,
                f"map and {name} are in {_one(ground.frames)} and {_one(path.frames)}: they have "
                "to be in one frame",
                "publish both in one frame",
            )
    if ground and odometry and ground.frames and odometry.frames:
        wanted, own = _one(ground.frames), _one(odometry.frames)
        if not _above(seen, own) & _above(seen, wanted):
            yield Misfit(
                "frames",
                MisfitSeverity.ERROR,
                f"odometry is in {own}, the map in {wanted}, and /tf does not connect them",
                "publish the transform, or take odometry in the frame of the map",
            )


def check_odometry(facts: Facts) -> Iterator[Misfit]:
    """Odometry's speed against its own places."""
    if facts.seen is None or len(facts.seen.odometry) < 10:
        return
    t, x, y, v = np.array(facts.seen.odometry).T
    along = float(np.hypot(np.diff(x), np.diff(y)).sum())
    counted = float(np.sum(0.5 * (np.abs(v[1:]) + np.abs(v[:-1])) * np.diff(t)))
    if along > _MOVES and abs(counted / along - 1.0) > _SCALE:
        yield Misfit(
            "odometry against itself",
            MisfitSeverity.ERROR,
            f"its speed adds up to {counted:.1f} m, its places are {along:.1f} m apart: the speed "
            "is off by as much, and so is every stop",
            "correct wheel radius or units of the speed",
        )


def check_silence(facts: Facts) -> Iterator[Misfit]:
    """What nobody hears, or says."""
    for words in () if facts.seen is None else facts.seen.silence:
        yield Misfit(
            "connections", MisfitSeverity.ERROR, words, "see docs/nav2.md, Nobody hears us"
        )


def _topics(facts: Facts) -> Topics:
    return Topics() if facts.edge is None else facts.edge.topics


def _full(facts: Facts, name: str) -> str:
    space = "" if facts.edge is None else facts.edge.ros.namespace.rstrip("/")
    return name if name.startswith("/") else f"{space}/{name}"


def _one(frames: set[str]) -> str:
    return min(frames).lstrip("/")


def _above(seen: Seen, frame: str) -> set[str]:
    found = {frame}
    while (parent := seen.links.get(frame)) is not None and parent not in found:
        found.add(parent)
        frame = parent
    return found
