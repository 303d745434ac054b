"""Drives in MuJoCo with drawn tracking errors and latency, past walls, posts and cliffs.

The body slides on a plane, held by springs to the place on the planned line that it has reached,
off by the errors of its drive; contacts are those of the engine. An emergency stop begins late by a
drawn latency at a station that is measured with an error. Nothing here is the planner's.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import product
from typing import Any, NamedTuple

import numpy as np
from rich.console import Console
from scipy import ndimage

from slopewise.models.arrays import Bools, Floats
from slopewise.models.candidate_path import CandidatePath
from slopewise.models.elevation_map import ElevationMap
from slopewise.models.input_errors import Tracking, input_errors, lateral_band
from slopewise.models.parameters import Model
from slopewise.models.quantity import GRAVITY
from slopewise.planner.ground.uncertainty import Uncertainty
from slopewise.planner.pipeline.candidates import CandidatePlanner
from slopewise.planner.plan import SpeedPlan
from slopewise.services.io.model_file import shipped_models

from ..common.campaign import BenchmarkRequest, Progress, Result, tracked
from ..common.scene import shipped
from ..common.text_tables import table_of
from .passes import poses_on, steered

Random = np.random.Generator

TRACKING = Tracking(cross_track_std=0.08, cross_track_per_curvature=0.1)
TRACKING = replace(TRACKING, heading_std=math.radians(2.0), along_track_std=0.1)
TRACKING = replace(TRACKING, latency=0.1, latency_std=0.05)  # of the plans and of the drives

LEVELS = (0.9, 0.99)  # quantiles of plans [1]: of 1000 drives they promise 100 and 10 contacts
HAZARDS = ("wall", "post", "cliff", "stop")
_SEED, _SCENES, _DRAWS = 29, 16, 4  # seed; scenes of a case, and drives of a scene [1]
_CELL, _HALF = 0.1, 11.0  # [m] edge of a cell, half that of a map
_MAX_CURVATURE = 0.15  # of a path [1/m]
_LENGTH, _PASSAGE = 16.0, 4.0  # [m] of a path; of it before and behind the obstacle
_STEP = 0.005  # of the engine [s]
_HOLD = 2.0 * math.pi * 3.0  # of the springs [1/s]: turns of 2 m/s² lead 5 mm off the drawn offset
_BODY, _WHEEL = 1, 2  # bits of what obstacles touch: the body, or the middle of a wheel


def vehicles() -> dict[str, Model]:
    """Shipped vehicles, and one of them with steered front wheels."""
    models = {name: shipped(name) for name in shipped_models()}
    models["atv, steered"] = steered(models["atv"])
    return {name: replace(model, tracking=TRACKING) for name, model in models.items()}


@dataclass(frozen=True, slots=True)
class Scene:
    """A path over even ground, cells of an obstacle in its middle, and which part touches them."""

    path: CandidatePath
    ground: ElevationMap
    marked: Bools
    touched_by: int


def scene(hazard: str, model: Model, spare: float, rng: Random) -> Scene:
    """A gentle turn past an obstacle at a distance from the planned body [m], or towards a wall."""
    heading = rng.uniform(-np.pi, np.pi)
    curvature = float(rng.choice([-1.0, 1.0]) * rng.uniform(0.01, _MAX_CURVATURE))
    shift = rng.uniform(0.0, _CELL, 2)
    y, x = np.mgrid[-_HALF:_HALF:_CELL, -_HALF:_HALF:_CELL] + shift[:, None, None]
    u, v = _along_turn(x, y, heading, curvature)
    half = 0.5 * (model.vehicle.track_width if hazard == "cliff" else model.vehicle.shape.width)
    lateral = v - half - spare
    marked = {
        "wall": (np.abs(u) < 1.5) & (lateral > 0.0) & (lateral < 0.5),
        "post": (np.abs(u) < 0.1) & (lateral > 0.0) & (lateral < 0.2),
        "cliff": (np.abs(u) < 1.5) & (lateral > 0.0) & (lateral < 3.0),
        "stop": (u > 2.0) & (u < 2.5) & (np.abs(v) < 3.0),
    }[hazard]
    s = np.linspace(-0.5, 0.5, 65) * _LENGTH
    turn = np.sinc(0.5 * curvature * s / np.pi) * s  # chord from the middle
    angle = heading + 0.5 * curvature * s
    path = CandidatePath(hazard, np.column_stack([turn * np.cos(angle), turn * np.sin(angle)]))
    height = np.where(marked, -1.0 if hazard == "cliff" else 1.0, 0.0)
    origin = (-_HALF + float(shift[1]), -_HALF + float(shift[0]))
    ground = ElevationMap(elevation=height, resolution=_CELL, origin=origin)
    return Scene(path, ground, marked, _WHEEL if hazard == "cliff" else _BODY)


def _along_turn(x: Floats, y: Floats, heading: float, curvature: float) -> tuple[Floats, Floats]:
    """Distance along a circle through the origin, and to its left [m]."""
    c, s = math.cos(heading), math.sin(heading)
    ahead, left = c * x + s * y, c * y - s * x
    side, radius = math.copysign(1.0, curvature), abs(1.0 / curvature)
    from_centre = radius - side * left
    u = radius * np.arctan2(ahead, from_centre)
    return u, side * (radius - np.hypot(ahead, from_centre))


class Reference(NamedTuple):
    """Places on a planned line, (n,) each: arc [m], x, y [m], heading [rad], curvature [1/m]."""

    arc: Floats
    x: Floats
    y: Floats
    heading: Floats
    curvature: Floats


def reference(plan: SpeedPlan, model: Model) -> Reference:
    """Places of the vehicle along a plan, by separate kinematics."""
    poses = poses_on(plan.x, plan.y, model)
    arc = np.concatenate(([0.0], np.cumsum(np.hypot(np.diff(poses.x), np.diff(poses.y)))))
    direction = np.unwrap(np.arctan2(np.gradient(poses.y), np.gradient(poses.x)))
    return Reference(arc, poses.x, poses.y, np.unwrap(poses.heading), np.gradient(direction, arc))


_WORLD = """<mujoco><option timestep="{step}" gravity="0 0 0" integrator="implicitfast"/>
<worldbody>{cells}<body><joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/>
<joint type="hinge" axis="0 0 1"/>
<geom type="box" pos="{middle} 0 0" size="{length} {half} 0.2" mass="{mass}" contype="0"
conaffinity="{body}"/>{wheels}</body></worldbody></mujoco>"""

_CELL_GEOM = '<geom type="box" pos="{} {} 0" size="{edge} {edge} 0.2" contype="{touches}"/>'
_WHEEL_GEOM = """<geom type="sphere" pos="{} {} 0" size="0.001" mass="0" contype="0"
conaffinity="{}"/>"""


def world_of(scene: Scene, model: Model) -> Any:
    """The engine's model: the body, the middles of its wheels, and the rim of the obstacle."""
    import mujoco

    shape, vehicle = model.vehicle.shape, model.vehicle
    inner = ndimage.binary_erosion(scene.marked, np.ones((3, 3)))
    rows, columns = np.nonzero(scene.marked & ~inner)
    x, y = (o + _CELL * n for o, n in zip(scene.ground.origin, (columns, rows), strict=True))
    cell = {"edge": 0.5 * _CELL, "touches": scene.touched_by}
    middle, length = 0.5 * (shape.front - shape.rear), 0.5 * (shape.front + shape.rear)
    numbers = {"middle": middle, "length": length, "half": 0.5 * shape.width, "step": _STEP}
    numbers |= {"mass": vehicle.mass, "body": _BODY}
    parts = {
        "cells": (_CELL_GEOM.format(*at, **cell) for at in zip(x, y, strict=True)),
        "wheels": (
            _WHEEL_GEOM.format(u * vehicle.wheelbase, v * vehicle.track_width, _WHEEL)
            for u, v in product((-0.5, 0.5), repeat=2)
        ),
    }
    text = _WORLD.format(**numbers, **{name: "".join(part) for name, part in parts.items()})
    return mujoco.MjModel.from_xml_string(text)


class Motion:
    """Place of the vehicle along its plan: speed of the plan, then a stop that begins late."""

    def __init__(self, plan: SpeedPlan, model: Model, errors: Floats, stop_at: float) -> None:
        """Begin before the obstacle; ``stop_at`` is where the stop is commanded [m]."""
        self.plan, self.braking, self.stop_at = plan, model.braking, stop_at
        self.ahead = TRACKING.along_track_std * float(errors[2])
        late = TRACKING.latency + TRACKING.latency_std * float(errors[3])
        self.left = max(late, 0.0) + model.braking.dead_time
        self.at, self.speed, self.commanded = 0.5 * _LENGTH - _PASSAGE, 0.0, False

    def advance(self) -> bool:
        """One step of the engine; false at the end of the drive."""
        measured = self.at - self.ahead
        self.commanded |= measured >= self.stop_at
        if not self.commanded:
            v_sq = np.interp(measured, self.plan.station, self.plan.speed**2)
            self.speed = math.sqrt(float(v_sq))
            self.force = self.braking.m_b * self.speed + self.braking.b_b
        elif self.left > 0.0:
            self.left -= _STEP
        else:
            self.speed -= GRAVITY * self.force * _STEP
        self.at += self.speed * _STEP
        return self.speed > 0.0 and self.at < 0.5 * _LENGTH + _PASSAGE


def touches(
    plan: SpeedPlan, line: Reference, model: Model, world: Any, errors: Floats, stop_at: float
) -> bool:
    """Drive until the obstacle is passed or touched, or the vehicle stands.

    ``errors`` are (4,) standard normal: cross-track, heading, along-track, latency; at the station
    ``stop_at`` [m] an emergency stop is commanded.
    """
    import mujoco

    data, before = mujoco.MjData(world), None
    motion, going = Motion(plan, model, errors, stop_at), True
    while going:
        going = motion.advance()
        x, y, heading, curvature = (np.interp(motion.at, line.arc, row) for row in line[1:])
        width = TRACKING.cross_track_std + TRACKING.cross_track_per_curvature * abs(curvature)
        offset, turned = width * errors[0], heading + TRACKING.heading_std * errors[1]
        x, y = x - offset * math.sin(heading), y + offset * math.cos(heading)
        goal = np.array([x, y, turned])
        if before is None:
            data.qpos[:] = before = goal
        rate = (goal - before) / _STEP
        if not data.qvel.any():
            data.qvel[:] = rate
        pull = _HOLD**2 * (goal - data.qpos) + 2.0 * _HOLD * (rate - data.qvel)
        data.qfrc_applied[:] = world.dof_M0 * pull
        mujoco.mj_step(world, data)
        if data.ncon > 0:
            return True
        before = goal
    return False


def drives(hazard: str, level: float, model: Model, scenes: int, rng: Random) -> tuple[int, int]:
    """Number of drives, and of those with a contact; scenes are near what the plan passes."""
    planner = CandidatePlanner(model, uncertainty=Uncertainty(quantile=level))
    reach = max(model.vehicle.shape.front, model.vehicle.shape.rear)
    band = lateral_band(input_errors(TRACKING, level), reach)
    driven = touched = 0
    while driven < scenes * _DRAWS:
        place = scene(hazard, model, float(band + rng.uniform(-0.05, 0.25)), rng)
        plan = planner.plan(place.ground, [place.path])[0]
        if plan.status.value != ("blocked" if hazard == "stop" else "ok"):
            continue
        line, world = reference(plan, model), world_of(place, model)
        for _ in range(_DRAWS):
            stop_at = plan.progress - rng.uniform(0.1, 2.5) if hazard == "stop" else math.inf
            errors = rng.standard_normal(4)
            driven += 1
            touched += touches(plan, line, model, world, errors, stop_at)
    return driven, touched


def run(request: BenchmarkRequest, progress: Progress) -> Result:
    rng, rows = np.random.default_rng(_SEED), []
    scenes, models = 2 if request.quick else _SCENES, vehicles()
    for case in tracked(progress, "drives", list(product(LEVELS, models, HAZARDS))):
        level, vehicle, hazard = case
        driven, touched = drives(hazard, level, models[vehicle], scenes, rng)
        row = {"quantile": level, "vehicle": vehicle, "hazard": hazard}
        rows.append(row | {"drives": driven, "contacts": touched})
    return {"quick": request.quick, "drives": rows}


def show(result: Result, console: Console) -> None:
    """Print contacts of each vehicle at each hazard, and their share at each quantile."""
    table = table_of("drives", *HAZARDS, "share", "promised", first="quantile, vehicle")
    rows = result["drives"]
    for level, vehicle in dict.fromkeys((row["quantile"], row["vehicle"]) for row in rows):
        matches = [row for row in rows if (row["quantile"], row["vehicle"]) == (level, vehicle)]
        counts = [f"{row['contacts']}/{row['drives']}" for row in matches]
        share = sum(row["contacts"] for row in matches) / sum(row["drives"] for row in matches)
        table.add_row(f"{level:g}, {vehicle}", *counts, f"{share:.1%}", f"{1.0 - level:.1%}")
    console.print(table)
