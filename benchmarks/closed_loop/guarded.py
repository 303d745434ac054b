"""The guard between a policy and the base of the closed loop; and a policy that needs one.

``python -m benchmarks.closed_loop.guarded --drives 300`` drives a reckless planner behind the guard
over the scenes of the closed loop, and slopewise's own with and without it.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections import Counter, deque
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.parameters import Braking, Model
from slopewise.models.surface_braking import SurfaceBraking
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

from .drive import run_drive
from .moving_horizon import MovingHorizon
from .policies import CYCLE, Policy, View
from .quad import LIMITS, QUAD, ROLLING
from .records import DrivenScene
from .scenes import dem_folder, scene
from .tracking import DriveCommand

_LOOK = 0.35  # [s] ahead, where the sharpest turn of the route counts
_TIPPED = 0.02  # share of its level load below which an axle or side has lifted
_RESERVE = 0.15  # [m] of the clear distance, for errors of localisation; the guard's default
_GOAL = (2.5, 6.0)  # [m/s]
_HOLDS = (1.0, 4.0)  # [s]


class Reckless:
    """Full speed towards goals that change at random, whatever is in the way."""

    name, exact = "reckless", False

    def __init__(self, seed: int) -> None:
        self._rng = np.random.default_rng((11, seed))
        self._goal, self._until = 0.0, -1.0

    def command(self, view: View) -> DriveCommand:
        """Towards the goal, as hard as the vehicle can."""
        if view.state.time >= self._until:
            self._goal = float(self._rng.uniform(*_GOAL))
            self._until = view.state.time + float(self._rng.uniform(*_HOLDS))
        return DriveCommand(speed=self._goal, accel=0.0)

    def stopping_distance(self, view: View) -> float:
        """It knows of none."""
        return math.nan


class Guarded:
    """A policy whose commands come late, and go through the guard."""

    exact = False

    def __init__(self, policy: Policy, model: Model, latency: float, stands: float = CYCLE) -> None:
        """Guard with a model.

        Args:
            policy: that plans. latency: of its commands [s]. stands: of the guard's settings.
        """
        self.name = f"guarded {policy.name}"
        self._policy, self._late = policy, round(latency / CYCLE)
        self._stands = stands
        self._waiting: deque[DriveCommand] = deque()
        self._model = guard_model(model)
        self._tables = (brake_table(self._model),)
        self._map: ElevationMap | None = None
        self._ground: GuardMap | None = None
        self.actions: Counter[str] = Counter()
        self.seconds: list[float] = []
        self.log: list[tuple[float, float, float, float, float, str]] = []

    def command(self, view: View) -> DriveCommand:
        """What the guard leaves of what the policy wanted a while ago."""
        self._waiting.append(self._policy.command(view))
        wanted = self._waiting.popleft() if len(self._waiting) > self._late else DriveCommand()
        if wanted.stop:
            self._waiting.clear()
            return wanted
        speed = max(wanted.speed + wanted.accel * CYCLE, 0.0)
        decision = self._judge(view, speed)
        self.actions[decision.action] += 1
        given = decision.command.speed
        state, clear = view.state, view.station + view.clear
        self.log.append((view.station, state.speed, speed, given, clear, decision.action))
        if decision.action == "pass":
            return self._bounded(view, wanted, speed)
        if decision.action == "stop":
            self._waiting.clear()
            return DriveCommand(stop=True, reason=f"guard: {decision.reason}")
        return self._bounded(view, replace(wanted, reason=decision.reason), decision.command.speed)

    def stopping_distance(self, view: View) -> float:
        """As the policy says."""
        self._waiting.clear()
        return self._policy.stopping_distance(view)

    def _bounded(self, view: View, wanted: DriveCommand, speed: float) -> DriveCommand:
        """Towards a speed, as quick as base and policy are."""
        if self._policy.name != "reckless" and speed >= wanted.speed:
            return wanted
        now = max(view.state.speed, 0.0)
        accel = np.clip((speed - now) / CYCLE, -2.0 * LIMITS.decel, LIMITS.accel)
        return DriveCommand(speed=now, accel=float(accel), reason=wanted.reason)

    def _judge(self, view: View, speed: float) -> GuardDecision:
        if view.elevation_map is not self._map:
            known = self._map = view.elevation_map
            classes, names = known.terrain_class, known.class_names
            self._ground = GuardMap(known.elevation, known.resolution, known.origin, classes, names)
        assert self._ground is not None
        state, route = view.state, view.route
        ahead = view.station + np.array((0.0, 0.5, 1.0)) * (0.5 + _LOOK * max(state.speed, 0.0))
        headings = [route.at(float(min(s, route.length)), route.heading) for s in ahead]
        turn = float(np.angle(np.exp(1j * (headings[2] - headings[0])))) / float(
            ahead[2] - ahead[0]
        )
        # What is clear is told for the middle of the wheelbase.
        clear = max(view.clear - _RESERVE, 0.0)
        it = GuardScene(self._model, self._tables, self._ground, clear)
        motion = VehicleMotion(Pose2d(state.x, state.y, state.yaw), max(state.speed, 0.0))
        command = BaseCommand(speed, turn * max(speed, state.speed))
        begun = time.perf_counter()
        decision = decide(it, motion, command, hold_time=self._stands, late=0.02, load=0.5)
        self.seconds.append(time.perf_counter() - begun)
        return decision


def learned_model(results: Path) -> Model:
    """The model that the closed loop learned last, out of its results."""
    told = json.loads(results.read_text())["learned"]["slopewise"]
    tables = {}
    for name, values in told["surfaces"].items():
        ranges: dict[str, Any] = {k: tuple(values[k]) for k in ("speed_range", "grade_range")}
        numbers = {k: v for k, v in values.items() if k not in ranges}
        tables[name] = SurfaceBraking(**numbers, **ranges, dead_time=told["dead_time"])
    weakest = min(tables.values(), key=lambda table: table.b_b or 0.0)
    base = {name: getattr(weakest, name) for name in ("m_m", "b_m", "m_b", "b_b", "dead_time")}
    braking = Braking(
        **base,
        distance_offset=weakest.distance_offset or 0.0,
        speed_range=weakest.speed_range or (0.0, 4.0),
        grade_range=weakest.grade_range or (-0.3, 0.3),
        terrain=tables,
    )
    return Model(name="learned", vehicle=QUAD, braking=braking, terrain=ROLLING, limits=LIMITS)


def drive(number: int, model: Model, kind: str, dem: Path | None) -> tuple[DrivenScene, Any]:
    """One drive of a kind: reckless, bare, sane or plain."""
    terrain, route, course = scene(number, dem)
    latency = float(np.random.default_rng((12, number)).uniform(0.0, 0.2))
    policy: Policy
    if kind == "reckless":
        policy = Guarded(Reckless(number), model, latency)
    elif kind == "sane":
        policy = Guarded(MovingHorizon(model), model, 0.0)
    else:
        policy = MovingHorizon(model) if kind == "plain" else Reckless(number)
    driven = run_drive(terrain, route, course, policy, number)
    return driven, policy


def summary(drives: list[tuple[DrivenScene, Any]]) -> dict[str, Any]:
    """What came of drives of one kind."""
    actions: Counter[str] = Counter()
    for _, policy in drives:
        actions.update(getattr(policy, "actions", {}))
    scenes = [scene for scene, _ in drives]
    seconds = [s for _, policy in drives for s in getattr(policy, "seconds", [])]
    return {
        "drives": len(scenes),
        "past_clear": sum(s.past_clear for s in scenes),
        "farthest_m": max(s.farthest for s in scenes),
        "collisions": sum(s.collisions for s in scenes),
        "tipped": sum(float(s.least_share.min()) < _TIPPED for s in scenes),
        "least_share": min(float(s.least_share.min()) for s in scenes),
        "mean_speed": sum(s.distance for s in scenes) / sum(s.moving_time for s in scenes),
        "finished": sum(s.finished for s in scenes),
        "actions": dict(actions),
        "ms": [1e3 * float(v) for v in np.percentile(seconds, (50, 99))] if seconds else [],
    }


def draw(policy: Guarded, path: Path) -> None:
    """One drive: what was wanted, what was given, what was driven, and how far was clear."""
    from matplotlib.figure import Figure

    station, driven, wanted, given, clear = np.array([row[:5] for row in policy.log]).T
    figure = Figure(figsize=(10.0, 4.5), layout="constrained")
    axes = figure.subplots()
    axes.step(station, wanted, where="post", color="0.75", label="wanted by the planner")
    axes.plot(station, driven, color="tab:blue", label="driven")
    for action, colour in (("slow", "tab:orange"), ("stop", "tab:red")):
        here = np.array([row[5] == action for row in policy.log])
        axes.plot(station[here], given[here], ".", color=colour, label=f"{action}: given")
    left = axes.twinx()
    left.plot(station, clear - station, color="tab:green", lw=0.8, label="clear ahead [m]")
    left.set_ylabel("clear ahead [m]", color="tab:green")
    axes.set_xlabel("station [m]")
    axes.set_ylabel("speed [m/s]")
    axes.legend(loc="upper right")
    axes.set_title("A reckless planner behind the guard")
    figure.savefig(path)


def main() -> None:
    """Drive, and print what came of it."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--drives", type=int, default=300)
    parser.add_argument("--sane", type=int, default=40)
    parser.add_argument("--results", type=Path, default=Path("docs/results/closed-loop.json"))
    parser.add_argument("--picture", type=Path, help="of the first reckless drive")
    given = parser.parse_args()
    model, dem = learned_model(given.results), dem_folder()
    for kind, count in (("sane", given.sane), ("plain", given.sane), ("reckless", given.drives)):
        done = []
        for number in range(count):
            done.append(drive(number, model, kind, dem))
            if given.picture and kind == "reckless" and number == 0:
                draw(done[0][1], given.picture)
            if number % 10 == 9 or number == count - 1:
                print(kind, json.dumps(summary(done)), flush=True)


if __name__ == "__main__":
    main()
