"""The moving horizon as a policy: smoothed plans, each of which continues the previous one."""

from __future__ import annotations

import numpy as np

from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch

from .policies import CYCLE, HORIZON, RESERVE, Planned, View, clear_of_front, with_lead
from .tracking import DriveCommand

_STRIDE = 2  # points of the route from one station to the next
_BEHIND = 20  # points of the route behind the vehicle
_BUDGET = 0.05  # [s] of a cycle; other processes share the machine


class MovingHorizon:
    """The planner of a robot.

    The learned offset and force hold the scatter of stops already, so it plans at the median.
    """

    name, exact = "slopewise", False

    def __init__(self, model: Model) -> None:
        self._stops = Planned(model)
        self._horizon = Horizon(
            model,
            HorizonSettings(period=CYCLE, budget=_BUDGET),
            uncertainty=Uncertainty(quantile=0.5),
        )

    def command(self, view: View) -> DriveCommand:
        """Run one cycle of the horizon."""
        seen = view.state
        state = PlanarState(x=seen.x, y=seen.y, heading=seen.yaw, speed=max(seen.speed, 0.0))
        paths, first_station = _route_around(view)
        clear = clear_of_front(view.station + view.clear - RESERVE - first_station)
        answer = self._horizon.step(state, paths, view.elevation_map, clear=clear)
        command = answer.command
        if command.stop:
            self._horizon.forget()
            return DriveCommand(stop=True, reason=answer.reason)
        if answer.chosen is None:
            return DriveCommand(reason=answer.reason)
        speed, accel = with_lead(answer.chosen, answer.chosen.travel_time - command.valid_for)
        return DriveCommand(speed=speed, accel=accel, reason=answer.reason)

    def stopping_distance(self, view: View) -> float:
        """Stopping distance of the model; the current plan ends with the stop [m]."""
        self._horizon.forget()
        return self._stops.stopping_distance(view)


def _route_around(view: View) -> tuple[PathBatch, float]:
    """The route around the vehicle, always on the same stations, and its first station [m]."""
    route = view.route
    here = int(np.searchsorted(route.station, view.station))
    first = max(here - _BEHIND, 0) // _STRIDE * _STRIDE
    last = int(np.searchsorted(route.station, view.station + HORIZON))
    x, y = (np.ascontiguousarray(c[first:last:_STRIDE, None]) for c in (route.x, route.y))
    paths = PathBatch(("route",), x, y, np.array([len(x)]), None)
    return paths, float(route.station[first])
