"""A reckless planner behind the guard, over the scenes of the closed loop.

``python -m benchmarks.closed_loop.guarded --drives 300`` measures.
"""

from __future__ import annotations

import argparse
import json
import math
from collections import Counter, deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.parameters import Model
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion, decide
from slopewise.services.guard.guard_model import GuardScene, guard_model
from slopewise.services.guard.stop_courses import Pose2d

from .drive_loop import DrivenScene, dem_folder, run_drive, scene
from .policies import CYCLE, RESERVE, View
from .quad import LIMITS, learned_model
from .tracking import DriveCommand

_PREVIEW = (0.5, 0.35)  # [m], [s] ahead, where the curvature of the route is taken
_TIPPED = 0.02  # share of its level load below which an axle or side has lifted [1]
_GOAL = (2.5, 6.0)  # [m/s]
_HOLD_TIME = (1.0, 4.0)  # [s] of a goal
_MAX_LATENCY = 0.2  # [s] of the reckless planner's commands
_COMMAND_AGE = 0.02  # [s], as the guard measures it on a robot
_LOAD_SHARE = 0.5  # of `min_load`, kept in every stop; the default of the guard's settings [1]


class Guarded:
    """Full speed towards goals that change at random, even on blocked routes, behind the guard."""

    name, exact = "reckless", False

    def __init__(self, seed: int, model: Model) -> None:
        self._rng = np.random.default_rng((11, seed))
        latency = float(np.random.default_rng((12, seed)).uniform(0.0, _MAX_LATENCY))
        self._goal, self._until = 0.0, -1.0
        self._delay, self._waiting = round(latency / CYCLE), deque[float]()
        self._model = guard_model(model)
        self.actions: Counter[str] = Counter()  # of the guard

    def command(self, view: View) -> DriveCommand:
        """Pass the goal, late and as hard as the vehicle can, through the guard."""
        if view.state.time >= self._until:
            self._goal = float(self._rng.uniform(*_GOAL))
            self._until = view.state.time + float(self._rng.uniform(*_HOLD_TIME))
        self._waiting.append(self._goal)
        speed = self._waiting.popleft() if len(self._waiting) > self._delay else 0.0
        decision = self._decide(view, speed)
        self.actions[decision.action] += 1
        if decision.action == "stop":
            self._waiting.clear()
            return DriveCommand(stop=True)
        if decision.action != "pass":
            speed = decision.command.speed
        now = max(view.state.speed, 0.0)
        accel = np.clip((speed - now) / CYCLE, -2.0 * LIMITS.decel, LIMITS.accel)
        return DriveCommand(speed=now, accel=float(accel))

    def stopping_distance(self, view: View) -> float:
        """NaN: no prediction."""
        self._waiting.clear()
        return math.nan

    def _decide(self, view: View, speed: float) -> GuardDecision:
        state, route = view.state, view.route
        reach = _PREVIEW[0] + _PREVIEW[1] * max(state.speed, 0.0)
        ahead = view.station + np.array((0.0, 1.0)) * reach
        headings = [route.at(float(min(s, route.length)), route.heading) for s in ahead]
        turn = float(np.angle(np.exp(1j * (headings[1] - headings[0]))))
        curvature = turn / float(ahead[1] - ahead[0])
        # The clear distance is that of the middle of the wheelbase.
        clear = max(view.clear - RESERVE, 0.0)
        guard_scene = GuardScene(self._model, view.elevation_map, clear)
        motion = VehicleMotion(Pose2d(state.x, state.y, state.yaw), max(state.speed, 0.0))
        command = BaseCommand(speed, curvature * max(speed, state.speed))
        given = (guard_scene, motion, command)
        return decide(*given, hold_time=CYCLE, late=_COMMAND_AGE, load=_LOAD_SHARE)


def drive(number: int, model: Model, dem: Path | None) -> tuple[DrivenScene, Counter[str]]:
    """One drive, and the count of each action of the guard."""
    policy = Guarded(number, model)
    return run_drive(*scene(number, dem), policy, number), policy.actions


def summary(drives: list[tuple[DrivenScene, Counter[str]]]) -> dict[str, Any]:
    scenes = [scene for scene, _ in drives]
    return {
        "drives": len(scenes),
        "past_clear": sum(s.past_clear for s in scenes),
        "farthest_m": max(s.farthest for s in scenes),
        "collisions": sum(s.collisions for s in scenes),
        "tipped": sum(float(s.min_load_shares.min()) < _TIPPED for s in scenes),
        "least_share": min(float(s.min_load_shares.min()) for s in scenes),
        "mean_speed": sum(s.distance for s in scenes) / sum(s.moving_time for s in scenes),
        "finished": sum(s.finished for s in scenes),
        "actions": dict(sum((actions for _, actions in drives), Counter[str]())),
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=300)
    count = parser.parse_args().drives
    model, dem = replace(learned_model(), effect=()), dem_folder()
    drives = []
    for number in range(count):
        drives.append(drive(number, model, dem))
        if number % 10 == 9 or number == count - 1:
            print(json.dumps(summary(drives)), flush=True)


if __name__ == "__main__":
    main()
