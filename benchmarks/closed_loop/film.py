"""Frames of one drive, rendered without a screen by the physics engine."""

from __future__ import annotations

import multiprocessing
import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.arrays import Floats

from .drive import run_drive
from .policies import Policy
from .scenes import scene
from .terrain import PhysicsGround
from .world import DrivenWorld

Frame = tuple[float, Any]

_SIZE = (360, 480)  # rows, columns
_COLOURS = np.array([[150, 140, 125], [196, 178, 140], [112, 150, 88]], np.uint8)
_WALL = -1  # the last of what is placed
_DEEP = -20.0  # [m] below that it is out of the way
_GRID = 2.0  # [m]
_ASIDE = 35.0  # [deg] of the camera from behind


@dataclass(frozen=True, slots=True)
class FilmPose:
    """Everything that a frame shows.

    Attributes:
        time: [s]. joints: of the vehicle.
        places, turns: of tiles and wall, (k, 3) [m] and (k, 4) quaternions.
    """

    time: float
    joints: Floats
    places: Floats
    turns: Floats


def film(number: int, dem: Path | None, policy: Policy, frames: int) -> list[Frame]:
    """(time, image) of one drive, evenly over its forced stops; images are (rows, columns, 3).

    Rendering runs in a process of its own: without a driver for off-screen OpenGL it may fail, and
    takes nobody along.

    Raises:
        RuntimeError: the machine cannot render without a screen.
    """
    chosen = film_poses(number, dem, policy, frames)
    os.environ.setdefault("MUJOCO_GL", "egl")
    spawn = multiprocessing.get_context("spawn")
    try:
        with ProcessPoolExecutor(1, spawn) as pool:
            return pool.submit(render, number, dem, chosen).result()
    except (BrokenProcessPool, OSError, ImportError, AttributeError, RuntimeError) as error:
        raise RuntimeError(f"cannot render without a screen: {error}") from error


def film_poses(number: int, dem: Path | None, policy: Policy, frames: int) -> list[FilmPose]:
    """What frames of one drive show, evenly over the time that the wall stood."""
    poses: list[FilmPose] = []

    def watch(world: DrivenWorld) -> None:
        d = world.data
        poses.append(FilmPose(world.time, d.qpos.copy(), d.mocap_pos.copy(), d.mocap_quat.copy()))

    terrain, route, course = scene(number, dem)
    run_drive(terrain, route, course, policy, number, watch)
    walled = [p for p in poses if p.places[_WALL, 2] > _DEEP] or poses
    return [walled[i] for i in np.linspace(0, len(walled) - 1, frames).astype(int)]


def render(number: int, dem: Path | None, poses: list[FilmPose]) -> list[Frame]:
    """Images of poses in a scene."""
    import mujoco

    terrain, _, _ = scene(number, dem)
    world = DrivenWorld(terrain, np.random.default_rng(0))
    _paint(world, terrain)
    renderer = mujoco.Renderer(world.model, *_SIZE)
    images = []
    for pose in poses:
        world.data.qpos[:] = pose.joints
        world.data.mocap_pos[:], world.data.mocap_quat[:] = pose.places, pose.turns
        mujoco.mj_forward(world.model, world.data)
        world.look()
        camera = mujoco.MjvCamera()
        x, y, yaw = world.pose
        camera.lookat = (x, y, world.height(x, y) + 0.5)
        camera.distance, camera.elevation = 7.0, -20.0
        camera.azimuth = float(np.rad2deg(yaw)) + _ASIDE
        renderer.update_scene(world.data, camera)
        images.append((pose.time, renderer.render().copy()))
    renderer.close()
    return images


def _paint(world: DrivenWorld, terrain: PhysicsGround) -> None:
    """Surfaces as colours of the ground, under a grid."""
    model = world.model
    texture = model.texture("surfaces")
    first, width = int(texture.adr[0]), int(texture.width[0])
    where = np.linspace(0, len(terrain.surface) - 1, width).astype(int)
    image = _COLOURS[terrain.surface[np.ix_(where, where)]].copy()
    pixel = terrain.size / width
    lines = (np.arange(width) * pixel) % _GRID < pixel
    image[lines] = (image[lines] * 0.85).astype(np.uint8)
    image[:, lines] = (image[:, lines] * 0.85).astype(np.uint8)
    model.tex_data[first : first + image.size] = image.ravel()
