"""The moving horizon as a policy: smoothed plans, each of which continues the one before."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from slopewise.models.parameters import Model
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.horizon.answer import PlanarState
from slopewise.planner.horizon.horizon import Horizon, HorizonSettings
from slopewise.planner.path import PathBatch

from .policies import CYCLE, HORIZON, Planned, View, free_for_the_front, with_lead
from .tracking import DriveCommand

_STRIDE = 2  # points of the route from one station to the next
_BEHIND = 20  # points of the route behind the vehicle
_BUDGET = 0.05  # [s] other processes share the machine


class _Ahead(NamedTuple):
    """The route around the vehicle, on the same stations every time, and where it begins [m]."""

    paths: PathBatch
    begins: float


class MovingHorizon:
    """What a robot runs.

    The learned offset and force hold the scatter of stops already: no quantile is added to it.
    """

    exact = False

    def __init__(self, model: Model, *, name: str = "slopewise", reserve: float = 0.15) -> None:
        """Plan with a model; see :class:`Planned`."""
        self.name = name
        self._reserve = reserve
        self._stops = Planned(model)
        self._horizon = Horizon(
            model,
            HorizonSettings(period=CYCLE, budget=_BUDGET),
            uncertainty=Uncertainty(quantile=0.5),
        )

    def command(self, view: View) -> DriveCommand:
        """One cycle of the horizon."""
        seen = view.state
        state = PlanarState(x=seen.x, y=seen.y, heading=seen.yaw, speed=max(seen.speed, 0.0))
        ahead = _ahead(view)
        clear = free_for_the_front(view.station + view.clear - self._reserve - ahead.begins)
        answer = self._horizon.step(state, ahead.paths, view.elevation_map, clear=clear)
        wanted = answer.command
        if wanted.stop:
            self._horizon.forget()
            return DriveCommand(stop=True, reason=answer.reason)
        if answer.chosen is None:
            return DriveCommand(reason=answer.reason)
        speed, accel = with_lead(answer.chosen, answer.chosen.travel_time - wanted.valid_for)
        return DriveCommand(speed=speed, accel=accel, reason=answer.reason)

    def stopping_distance(self, view: View) -> float:
        """What the model says of full brakes from here; what was planned is void then."""
        self._horizon.forget()
        return self._stops.stopping_distance(view)


def _ahead(view: View) -> _Ahead:
    route = view.route
    here = int(np.searchsorted(route.station, view.station))
    first = max(here - _BEHIND, 0) // _STRIDE * _STRIDE
    last = int(np.searchsorted(route.station, view.station + HORIZON))
    x, y = (np.ascontiguousarray(c[first:last:_STRIDE, None]) for c in (route.x, route.y))
    paths = PathBatch(("route",), x, y, np.array([len(x)]), None)
    return _Ahead(paths, float(route.station[first]))
