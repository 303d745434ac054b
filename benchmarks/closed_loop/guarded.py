"""The guard between a policy and the base of the closed loop, and a policy that needs it.

``python -m benchmarks.closed_loop.guarded --drives 300`` drives a reckless planner behind the guard
over the scenes of the closed loop, and slopewise's own with and without it.
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

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Model
from slopewise.services.guard.command_arc import Pose2d
from slopewise.services.guard.decide import (
    BaseCommand,
    GuardDecision,
    GuardScene,
    VehicleMotion,
    decide,
)
from slopewise.services.guard.guard_map import GuardMap
from slopewise.services.guard.guard_model import brake_table, guard_model

from .drive_loop import DrivenScene, run_drive
from .policies import CYCLE, RESERVE, MovingHorizon, Policy, View
from .quad import LIMITS, learned_model
from .scenes import dem_folder, scene
from .tracking import DriveCommand

_PREVIEW = (0.5, 0.35)  # [m], [s] ahead, where the curvature of the route is taken
_TIPPED = 0.02  # share of its level load below which an axle or side has lifted [1]
_GOAL = (2.5, 6.0)  # [m/s]
_HOLD_TIME = (1.0, 4.0)  # [s] of a goal
_MAX_LATENCY = 0.2  # [s] of the reckless planner's commands
_COMMAND_AGE = 0.02  # [s], as the guard measures it on a robot
_LOAD_SHARE = 0.5  # of `min_load`, kept in every stop; the default of the guard's settings [1]


class Reckless:
    """Full speed towards goals that change at random, even on blocked routes."""

    name, exact = "reckless", False

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng((11, seed))
        self._goal, self._until = 0.0, -1.0

    def command(self, view: View) -> DriveCommand:
        """Command the goal, as hard as the vehicle can."""
        if view.state.time >= self._until:
            self._goal = float(self._rng.uniform(*_GOAL))
            self._until = view.state.time + float(self._rng.uniform(*_HOLD_TIME))
        return DriveCommand(speed=self._goal, accel=0.0)

    def stopping_distance(self, view: View) -> float:
        """NaN: no prediction."""
        return math.nan


class Guarded:
    """A policy whose commands arrive late and pass the guard."""

    exact = False

    def __init__(self, policy: Policy, model: Model, latency: float) -> None:
        self.name = f"guarded {policy.name}"
        self._policy, self._delay = policy, round(latency / CYCLE)
        self._waiting: deque[DriveCommand] = deque()
        self._model = guard_model(model)
        self._tables = (brake_table(self._model),)
        self._map: ElevationMap | None = None
        self._ground: GuardMap | None = None
        self.actions: Counter[str] = Counter()  # of the guard

    def command(self, view: View) -> DriveCommand:
        """Pass the policy's delayed command through the guard."""
        self._waiting.append(self._policy.command(view))
        late = len(self._waiting) > self._delay
        command = self._waiting.popleft() if late else DriveCommand()
        if command.stop:
            self._waiting.clear()
            return command
        speed = max(command.speed + command.accel * CYCLE, 0.0)
        decision = self._decide(view, speed)
        self.actions[decision.action] += 1
        if decision.action == "pass":
            return self._limited(view, command, speed)
        if decision.action == "stop":
            self._waiting.clear()
            return DriveCommand(stop=True)
        return self._limited(view, command, decision.command.speed)

    def stopping_distance(self, view: View) -> float:
        """Prediction of the policy [m]."""
        self._waiting.clear()
        return self._policy.stopping_distance(view)

    def _limited(self, view: View, command: DriveCommand, speed: float) -> DriveCommand:
        """Approach a speed within the limits of base and policy."""
        if self._policy.name != "reckless" and speed >= command.speed:
            return command
        now = max(view.state.speed, 0.0)
        accel = np.clip((speed - now) / CYCLE, -2.0 * LIMITS.decel, LIMITS.accel)
        return DriveCommand(speed=now, accel=float(accel))

    def _decide(self, view: View, speed: float) -> GuardDecision:
        if view.elevation_map is not self._map:
            known = self._map = view.elevation_map
            ground = (known.elevation, known.resolution, known.origin)
            self._ground = GuardMap(*ground, known.terrain_class, known.class_names)
        assert self._ground is not None
        state, route = view.state, view.route
        reach = _PREVIEW[0] + _PREVIEW[1] * max(state.speed, 0.0)
        ahead = view.station + np.array((0.0, 1.0)) * reach
        headings = [route.at(float(min(s, route.length)), route.heading) for s in ahead]
        turn = float(np.angle(np.exp(1j * (headings[1] - headings[0]))))
        curvature = turn / float(ahead[1] - ahead[0])
        # The clear distance is that of the middle of the wheelbase.
        clear = max(view.clear - RESERVE, 0.0)
        guard_scene = GuardScene(self._model, self._tables, self._ground, clear)
        motion = VehicleMotion(Pose2d(state.x, state.y, state.yaw), max(state.speed, 0.0))
        command = BaseCommand(speed, curvature * max(speed, state.speed))
        return decide(
            guard_scene, motion, command, hold_time=CYCLE, late=_COMMAND_AGE, load=_LOAD_SHARE
        )


def drive(number: int, model: Model, kind: str, dem: Path | None) -> tuple[DrivenScene, Policy]:
    """One drive of a kind: "reckless" and "sane" behind the guard, "plain" without it."""
    terrain, route, course = scene(number, dem)
    latency = float(np.random.default_rng((12, number)).uniform(0.0, _MAX_LATENCY))
    policy: Policy
    if kind == "reckless":
        policy = Guarded(Reckless(number), model, latency)
    elif kind == "sane":
        policy = Guarded(MovingHorizon(model), model, 0.0)
    else:
        policy = MovingHorizon(model)
    return run_drive(terrain, route, course, policy, number), policy


def summary(drives: list[tuple[DrivenScene, Policy]]) -> dict[str, Any]:
    """Figures of drives of one kind."""
    actions = sum((p.actions for _, p in drives if isinstance(p, Guarded)), Counter[str]())
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
        "actions": dict(actions),
    }


def main() -> None:
    """Drive, and print the figures of each kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--drives", type=int, default=300)
    parser.add_argument("--sane", type=int, default=40)
    options = parser.parse_args()
    model, dem = replace(learned_model(), effect=()), dem_folder()
    counts = {"sane": options.sane, "plain": options.sane, "reckless": options.drives}
    for kind, count in counts.items():
        drives = []
        for number in range(count):
            drives.append(drive(number, model, kind, dem))
            if number % 10 == 9 or number == count - 1:
                print(kind, json.dumps(summary(drives)), flush=True)


if __name__ == "__main__":
    main()
