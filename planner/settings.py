"""How the planner works, as opposed to what the vehicle can do; one place for every such number."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, get_args

from slopewise.models.errors import ParameterError
from slopewise.models.quantity import quantity, validate_quantities
from slopewise.models.vehicle import Vehicle

Solver = Literal["interior_point", "osqp", "ipopt"]
"""Who smooths: an interior-point method along the stations, OSQP, or IPOPT on the exact program."""


UnseenSteps = Literal["slow", "report"]
"""Where noise hides steps far beyond the vehicle's limit: drive carefully, or only report it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannerSettings:
    """Resolution of plans, weights of the ranking, and who smooths them."""

    spacing: float = quantity(
        "m",
        "Distance between stations; at most one cell of the map, and the radius of a wheel.",
        default=0.25,
        above=0.0,
    )
    smooth: bool = True
    solver: Solver = "interior_point"
    unseen_steps: UnseenSteps = "slow"
    horizon_penalty: float = quantity(
        "s/m",
        "Ranking: time charged for each metre of path not reached.",
        default=2.0,
        at_least=0.0,
    )
    margin_weight: float = quantity(
        "s/m",
        "Ranking: time that a metre of spare clear distance is worth.",
        default=0.0,
        at_least=0.0,
    )
    margin_enough: float = quantity(
        "m",
        "Ranking: spare clear distance beyond which more is worth nothing.",
        default=1.0,
        at_least=0.0,
    )

    def __post_init__(self) -> None:
        validate_quantities(self)
        for name, kinds in (("solver", get_args(Solver)), ("unseen_steps", get_args(UnseenSteps))):
            if (value := getattr(self, name)) not in kinds:
                raise ParameterError(name, f"one of {', '.join(kinds)}, got {value!r}")

    def spacing_on(self, resolution: float, vehicle: Vehicle) -> float:
        """Spacing on cells of that size, for the wheels of a vehicle [m].

        A wheel sees two cells abreast and steps over none even in a turn. What an overhang strikes
        is seen at a pose before the wheels have climbed it.
        """
        return min(self.spacing, resolution, vehicle.wheel_radius)
