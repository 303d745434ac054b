"""Other tools on the time-optimal problem: speed bounds along a path, limits of acceleration.

Each takes one candidate and returns v² at its stations. A tool that is not installed raises
ImportError when it is built; the benchmark reports that.
"""

from __future__ import annotations

import importlib
import importlib.util
import logging
import sys
import types
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats
from slopewise.planner.profile.reference import TimeOptimalProblem, TimeOptimalReference

_MIN_SPEED = 1e-3
"""Lowest speed bound that all tools accept [m/s]."""

_LATERAL_GRIP = 10.0
"""Grip of the trajectory-planning-helpers across the path [m/s²]: so much that the longitudinal
limits stay nearly whole."""


@dataclass(frozen=True, slots=True)
class BaselineTask:
    """One candidate up to the station where it must rest.

    Attributes:
        accel, decel: service limits [m/s²].
        problem: stations, bounds, brakes and drive as the planner knows them.
    """

    accel: float
    decel: float
    problem: TimeOptimalProblem

    @property
    def speed_max(self) -> Floats:
        """Positive bound of the speed, shape (N,) [m/s]."""
        return np.maximum(np.sqrt(self.problem.speed_sq_max), _MIN_SPEED)


Solver = Callable[[], Floats | None]


def toppra(task: BaselineTask) -> Solver:
    """Time-optimal path parameterisation by reachability analysis (TOPP-RA)."""
    logging.getLogger("toppra").setLevel(logging.ERROR)
    ta = importlib.import_module("toppra")
    constraint = importlib.import_module("toppra.constraint")
    algorithm = importlib.import_module("toppra.algorithm")
    station, speed = task.problem.station, task.speed_max

    def limits(s: float) -> Floats:
        top = float(np.interp(s, station, speed))
        return np.array([[-top, top]])

    path = ta.SplineInterpolator(station, station[:, None])
    constraints = [
        constraint.JointVelocityConstraintVarying(limits),
        constraint.JointAccelerationConstraint(np.array([[-task.decel, task.accel]])),
    ]
    instance = algorithm.TOPPRA(constraints, path, gridpoints=station, solver_wrapper="seidel")

    def solve() -> Floats | None:
        _, speeds, _ = instance.compute_parameterization(0.0, 0.0)
        return None if speeds is None else np.asarray(speeds) ** 2

    return solve


def planning_helpers(task: BaselineTask) -> Solver:
    """Forward–backward solver of the trajectory-planning-helpers.

    It derives speed bounds from curvature only and shares the grip between the directions, so the
    bounds are given to it as curvatures.
    """
    calculate = _submodule("trajectory_planning_helpers", "calc_vel_profile").calc_vel_profile
    speed = task.speed_max
    ds = np.diff(task.problem.station)
    grip = np.tile([task.decel, _LATERAL_GRIP], (len(speed), 1))
    machines = np.array([[0.0, task.accel], [2.0 * float(speed.max()), task.accel]])

    def solve() -> Floats | None:
        profile = calculate(
            ax_max_machines=machines,
            kappa=_LATERAL_GRIP / speed**2,
            el_lengths=ds,
            closed=False,
            drag_coeff=0.0,
            m_veh=1.0,
            loc_gg=grip,
            v_max=float(speed.max()),
            dyn_model_exp=2.0,
            v_start=0.1,
            v_end=0.0,
        )
        return np.asarray(profile) ** 2

    return solve


def ipopt(task: BaselineTask) -> Solver:
    """The exact discrete problem with the braking model, by CasADi and IPOPT."""
    reference = TimeOptimalReference(len(task.problem.station))
    return lambda: reference.solve(task.problem).speed_sq


BASELINES: dict[str, Callable[[BaselineTask], Solver]] = {
    "toppra": toppra,
    "trajectory-planning-helpers": planning_helpers,
    "CasADi + IPOPT": ipopt,
}
"""Builders of solvers; only the returned solver is timed."""


def _submodule(package: str, name: str) -> Any:
    """Import one module of a package without its ``__init__``, which loads unused solvers."""
    if package not in sys.modules:
        spec = importlib.util.find_spec(package)
        if spec is None:
            raise ImportError(package)
        bare = types.ModuleType(package)
        bare.__path__ = list(spec.submodule_search_locations or [])
        sys.modules[package] = bare
    return importlib.import_module(f"{package}.{name}")
