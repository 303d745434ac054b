"""One decision of the guard from Python, without its processes."""

from __future__ import annotations

import math
from collections.abc import Sequence

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.models.recent import Recent
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion, decide
from slopewise.services.guard.guard_model import GuardModel, GuardScene, guard_model
from slopewise.services.guard.settings import GuardJudgement, GuardTiming  # words: ok, key
from slopewise.services.guard.stop_courses import Pose2d

_models: Recent[GuardModel] = Recent(2)


def guard_decision(
    model: Model,
    elevation_map: ElevationMap,
    pose: tuple[float, float, float],
    speed: float,
    command: tuple[float, float],
    *,
    clear: float = math.inf,
    age: float = 0.0,
    before: Sequence[tuple[float, float]] = (),
) -> GuardDecision:
    """Decide on a velocity command as the running guard does: pass it, limit it, or stop.

    Args:
        model: vehicle, braking, ground and limits.
        elevation_map: ground as known now.
        pose: x, y of the middle of the wheelbase [m] and heading [rad] on the map.
        speed: speed along the heading, negative in reverse [m/s].
        command: speed [m/s] and yaw rate [rad/s], left positive; (0, rate) turns on the spot.
        clear: distance to which the path of the middle of the wheelbase is known to be free [m].
        age: time since pose and speed were measured, with the transport to the base [s].
        before: commands that the base may still follow, the newest first.

    Returns:
        ``action`` (`pass`, `slow` or `stop`), the ``command`` that the base may receive, ``brake``,
        ``reason``, and ``where`` on the map the limiting place is (x, y) [m], None without one.
        Values that are not finite are a stop.

    Raises:
        ParameterError: a pose or command of another length, a negative age or clear distance.
    """
    for name, values, count in (("pose", pose, 3), ("command", command, 2)):
        if len(values) != count:
            raise ParameterError(name, f"{count} numbers, got {len(values)}")
    for name, value in (("age", age), ("clear", clear)):
        if not value >= 0.0:
            raise ParameterError(name, f"at least 0, got {value!r}")
    worst = _models.get(lambda: guard_model(model), model)
    fastest = max((speed, *(c[0] for c in before)), key=abs)
    return decide(
        GuardScene(worst, elevation_map, clear),
        VehicleMotion(Pose2d(*pose), speed),
        BaseCommand(*command),
        hold_time=GuardTiming().stands,
        late=age,
        load=GuardJudgement().load,
        reached=fastest,
        before=tuple(BaseCommand(*c) for c in before),
    )
