"""A separate tracking controller that keeps the stopping path: CasADi and OSQP.

Twelve steps of 0.2 s; station, speed and acceleration. The model comes out of
`slopewise.services.export`, as `slopewise export --casadi` writes it: at each step, station plus
stopping distance has to end before what is known to be free. That constraint is linear around the
last solution, and solved three times over, because a stopping distance is convex. It is driven in
the closed-loop world of the benchmarks:

    python examples/tracking_mpc.py --drives 3
"""

from __future__ import annotations

import argparse
import math
from dataclasses import replace
from typing import Any

import casadi as ca
import numpy as np

from benchmarks.closed_loop.drive_loop import DrivenScene, run_drive, scene
from benchmarks.closed_loop.policies import CYCLE, View
from benchmarks.closed_loop.quad import learned_model
from benchmarks.closed_loop.tracking import DriveCommand
from slopewise.models.parameters import Model
from slopewise.services.export.functions import functions_of

STEPS, STEP = 12, 0.2  # [s]
PASSES = 3
RESERVE = 0.3  # [m] for errors of localisation and tracking
LOOKAHEAD = 10.0  # [m] over which the steepest way down counts
SLACK = 1e4


class TrackingMpc:
    """Follows a speed as well as stopping allows; a policy of the closed loop."""

    name, exact = "tracking MPC", False

    def __init__(self, model: Model, reference: float) -> None:
        """Write the quadratic programme once.

        Args:
            model: learned. reference: speed to be tracked [m/s].
        """
        self._limits, self._reference = model.limits, reference
        name = "stopping_distance"
        self._distance = [f.function for f in functions_of(model) if f.name.startswith(name)]
        s, v, a = (ca.SX.sym(name, STEPS) for name in ("s", "v", "a"))
        slack = ca.SX.sym("slack")
        begin, around, slope, max_speed = (
            ca.SX.sym("begin", 2),
            ca.SX.sym("around", STEPS),
            ca.SX.sym("slope", STEPS),
            ca.SX.sym("max_speed"),
        )
        before_s, before_v = ca.vertcat(begin[0], s[:-1]), ca.vertcat(begin[1], v[:-1])
        moves = ca.vertcat(
            s - before_s - STEP * before_v - 0.5 * STEP**2 * a, v - before_v - STEP * a
        )
        stops = s + around + slope * v - slack
        cost = ca.sumsqr(v - max_speed) + 0.05 * ca.sumsqr(a) + 0.2 * ca.sumsqr(a[1:] - a[:-1])
        variables = ca.vertcat(s, v, a, slack)
        problem = {
            "x": variables,
            "f": cost + SLACK * slack**2,
            "g": ca.vertcat(moves, stops),
            "p": ca.vertcat(begin, around, slope, max_speed),
        }
        quiet = {"osqp": {"verbose": False, "eps_abs": 1e-4, "eps_rel": 1e-4, "max_iter": 8000}}
        self._solver = ca.qpsol("mpc", "osqp", problem, {**quiet, "error_on_fail": False})
        self._last = np.zeros(STEPS)

    def command(self, view: View) -> DriveCommand:
        """One cycle: the first acceleration of the plan, or full brakes without one."""
        speed, grade = max(view.state.speed, 0.0), self._steepest(view)
        free = max(min(view.clear, view.known) - RESERVE, 0.0)
        if speed > 0.1 and self._needed(speed, grade)[0] > free:
            self._last[:] = 0.0
            return DriveCommand(stop=True)  # nothing but full brakes stops in time
        for _ in range(PASSES):
            solved = self._solve(speed, free, grade, view)
        plan = np.array(solved["x"]).ravel()
        speeds, accel = plan[STEPS : 2 * STEPS], float(plan[2 * STEPS])
        if not np.isfinite(plan).all():
            return DriveCommand(stop=True)
        self._last = np.clip(speeds, 0.0, self._limits.speed)
        if speed < 0.05 and self._last[2] < 0.1:
            return DriveCommand()
        return DriveCommand(speed=speed, accel=float(np.clip(accel, -4.0, self._limits.accel)))

    def stopping_distance(self, view: View) -> float:
        """Of the model, on the steepest way down ahead."""
        self._last[:] = 0.0
        return self._needed(max(view.state.speed, 0.0), self._steepest(view))[0]

    def _solve(self, speed: float, free: float, grade: float, view: View) -> Any:
        needed = [self._needed(float(v), grade) for v in self._last]
        slope = np.array([d for _, d in needed])
        around = np.array([distance for distance, _ in needed]) - slope * self._last
        max_speed = min(self._reference, self._limits.speed, self._turn(view))
        low = np.concatenate(
            (np.full(STEPS, -1.0), np.zeros(STEPS), np.full(STEPS, -self._limits.decel), [0.0])
        )
        high = np.concatenate(
            (
                np.full(STEPS, 1e3),
                np.full(STEPS, max(max_speed, speed)),
                np.full(STEPS, self._limits.accel),
                [1e3],
            )
        )
        parameters = np.concatenate(([0.0, speed], around, slope, [max_speed]))
        bounds = np.zeros(2 * STEPS)
        solved = self._solver(
            p=parameters,
            lbx=low,
            ubx=high,
            lbg=np.concatenate((bounds, np.full(STEPS, -1e3))),
            ubg=np.concatenate((bounds, np.full(STEPS, free))),
        )
        self._last = np.clip(np.array(solved["x"]).ravel()[STEPS : 2 * STEPS], 0.0, 6.0)
        return solved

    def _needed(self, speed: float, grade: float) -> tuple[float, float]:
        """Longest stopping distance of all surfaces [m], and its derivative by the speed [s]."""
        h = 0.01
        here = max(float(f(speed, grade, 0.0)) for f in self._distance)
        ahead = max(float(f(speed + h, grade, 0.0)) for f in self._distance)
        return here, (ahead - here) / h

    @staticmethod
    def _steepest(view: View) -> float:
        route = view.route
        ahead = (route.station >= view.station) & (route.station <= view.station + LOOKAHEAD)
        return float(route.grade[ahead].min()) if ahead.any() else 0.0

    def _turn(self, view: View) -> float:
        points = view.route.points(view.station, 5.0)
        steps = np.diff(points, axis=0)
        turns = np.abs(np.diff(np.unwrap(np.arctan2(steps[:, 1], steps[:, 0]))))
        sharpest = float(np.max(turns / np.hypot(*steps[1:].T), initial=1e-3))
        return math.sqrt(0.5 * self._limits.lateral_accel / sharpest)


def drive(number: int, reference: float = 3.5) -> DrivenScene:
    """One drive over generated hills."""
    model = replace(learned_model(), effect=())
    return run_drive(*scene(number, None), TrackingMpc(model, reference), number)


def main() -> None:
    """Drive, and print the result."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--drives", type=int, default=3)
    for number in range(parser.parse_args().drives):
        done = drive(number)
        print(
            f"drive {number}: {done.distance:.0f} m at {done.mean_speed:.2f} m/s, a cycle every "
            f"{CYCLE:g} s, {len(done.stops)} stops, {done.past_clear} past what was free, nearest "
            f"{-done.farthest:.2f} m before it"
        )


if __name__ == "__main__":
    main()
