"""Other tools on the time-optimal problem: speed bounds along a path, limits of acceleration.

Each takes one candidate and gives v² at its stations. A tool that is not installed raises
ImportError when it is built, which the benchmark reports as such.
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

_CREEP = 1e-3
"""Slowest speed bound that all tools take [m/s]."""


@dataclass(frozen=True, slots=True)
class PeerTask:
    """One candidate up to the station where it must rest; arrays are (N,).

    Attributes:
        station: [m]. speed_sq_max: [m²/s²].
        accel, decel: [m/s²].
        problem: the same candidate with brakes and drive as the planner knows them.
    """

    station: Floats
    speed_sq_max: Floats
    accel: float
    decel: float
    problem: TimeOptimalProblem

    @property
    def speed_max(self) -> Floats:
        """Bound of the speed, nowhere quite zero (N,) [m/s]."""
        return np.maximum(np.sqrt(self.speed_sq_max), _CREEP)


Solver = Callable[[], Floats | None]
Peer = Callable[[PeerTask], Solver]
"""Makes ready for a task all that need not be timed; the solver is what is timed."""


def toppra(task: PeerTask) -> Solver:
    """Time-optimal path parameterisation by reachability analysis (TOPP-RA)."""
    logging.getLogger("toppra").setLevel(logging.ERROR)
    ta = importlib.import_module("toppra")
    constraint = importlib.import_module("toppra.constraint")
    algorithm = importlib.import_module("toppra.algorithm")
    station, speed = task.station, task.speed_max

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


def planning_helpers(task: PeerTask) -> Solver:
    """Forward–backward solver of the trajectory-planning-helpers.

    It knows bounds of speed from curvature only, and shares the grip between the directions: where
    the bound holds, none is left to brake or accelerate with. The bounds are given to it as
    curvatures with so much grip sideways that the limits ahead and astern stay nearly whole.
    """
    calculate = _submodule("trajectory_planning_helpers", "calc_vel_profile").calc_vel_profile
    speed = task.speed_max
    ds = np.diff(task.station)
    sideways = 10.0
    grip = np.tile([task.decel, sideways], (len(speed), 1))
    machines = np.array([[0.0, task.accel], [2.0 * float(speed.max()), task.accel]])

    def solve() -> Floats | None:
        profile = calculate(
            ax_max_machines=machines,
            kappa=sideways / speed**2,
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


def ipopt(task: PeerTask) -> Solver:
    """The exact discrete problem with the braking model, by CasADi and IPOPT."""
    reference = TimeOptimalReference(len(task.station))
    return lambda: reference.solve(task.problem).speed_sq


PEERS: dict[str, Peer] = {
    "toppra": toppra,
    "trajectory-planning-helpers": planning_helpers,
    "CasADi + IPOPT": ipopt,
}


def _submodule(package: str, name: str) -> Any:
    """One module of a package whose ``__init__`` would load solvers that are not needed here."""
    if package not in sys.modules:
        spec = importlib.util.find_spec(package)
        if spec is None:
            raise ImportError(package)
        bare = types.ModuleType(package)
        bare.__path__ = list(spec.submodule_search_locations or [])
        sys.modules[package] = bare
    return importlib.import_module(f"{package}.{name}")
