"""Planner, checker, guard and service take each cell of a map for the same surfaces."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import InputError
from slopewise.models.parameters import Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.planner.ground.surfaces import surface_table
from slopewise.services.check.external_plan import ExternalPlan
from slopewise.services.check.path_force import path_force_along
from slopewise.services.check.path_ground import ground_under
from slopewise.services.check.plan_line import line_of
from slopewise.services.guard.decide import BaseCommand, GuardDecision, VehicleMotion, decide
from slopewise.services.guard.guard_map import read_guard_map
from slopewise.services.guard.guard_model import GuardScene, read_guard_model
from slopewise.services.guard.stop_courses import Course, Pose2d, courses_ahead
from slopewise.services.io.map_file import read_map
from slopewise.services.io.model_file import find_model, read_model, write_model
from slopewise.services.planning.map_store import MapStore
from slopewise.services.wire.plan_messages import MapUpdate
from tests.services.command_line import here, one_line_of

ATV = read_model(find_model("atv"))
CELL, SHAPE = 0.25, (48, 96)
NAMES = ("", "#0", "#1", "#2", "#3", "#4", "#7", "#61", "mud", "ice", "gravel", "mud, weaker")
FLAT = {"elevation": np.zeros(SHAPE), "resolution": CELL, "origin": (0.0, -6.0)}


def drawn_model(rng: np.random.Generator) -> Model:
    """Surfaces in any order, with numbers and without, 0 included; one may be a state."""
    names = [str(name) for name in rng.permutation(["mud", "ice", "grass"])][: rng.integers(1, 4)]
    numbers = [int(n) for n in rng.permutation([0, 1, 3, 7, 61])]
    tables = {
        name: SurfaceBraking(
            b_b=float(rng.uniform(0.2, 0.6)), class_id=number if rng.random() < 0.5 else None
        )
        for name, number in zip(names, numbers, strict=False)
    }
    if rng.random() < 0.5:
        of = str(rng.choice(["", *names]))
        tables["mud, weaker"] = SurfaceBraking(b_b=0.15, class_id=1000, state_of=of)
    return dataclasses.replace(ATV, braking=dataclasses.replace(ATV.braking, terrain=tables))


def planned(model: Model, names: tuple[str, ...]) -> list[set[str]]:
    """Surfaces that each class may be to the planner."""
    surfaces = ["", *model.braking.terrain]
    _, bits = surface_table(model, names, None)
    return [{s for i, s in enumerate(surfaces) if (int(row) >> i) & 1} for row in bits]


def checked(model: Model, name: str) -> set[str]:
    """Surfaces that ground of one class may be to the checker."""
    x = np.linspace(4.0, 12.0, 30)
    plan = ExternalPlan(name="p", x=x, y=0.0 * x, speed=np.ones_like(x))
    classes = np.ones(SHAPE, np.int64)
    ground = ElevationMap(**FLAT, terrain_class=classes, class_names=("", name))  # type: ignore[arg-type]
    line = line_of(plan, 0.0)
    under = ground_under(ground, line, model.vehicle)
    return set(path_force_along(model, under, line, ground.class_names).names)


def guarded(model_file: Path, name: str) -> set[str]:
    """Surfaces that ground of one class may be to the guard."""
    model = read_guard_model(model_file)
    classes = np.ones(SHAPE, np.int64)
    ground = ElevationMap(**FLAT, terrain_class=classes, class_names=("", name))  # type: ignore[arg-type]
    straight, pose = Course(1.0, 0.0, 0.0, 0.0, forward=True), Pose2d(5.0, 0.0, 0.0)
    courses = courses_ahead(GuardScene(model, ground, np.inf), pose, straight, 6.0)
    return {model.surfaces[kind] for kind in courses.possible}


@pytest.mark.parametrize(
    "seed", [*range(10), *(pytest.param(n, marks=pytest.mark.nightly) for n in range(10, 100))]
)
def test_each_class_is_the_same_surface_to_all(seed: int, tmp_path: Path) -> None:
    rng = np.random.default_rng(seed)
    model, file = drawn_model(rng), tmp_path / "model.toml"
    write_model(model, file)
    for name, surfaces in zip(NAMES, planned(model, NAMES), strict=True):
        assert checked(model, name) == surfaces, (name, model.braking.terrain)
        assert guarded(file, name) == surfaces, (name, model.braking.terrain)


@pytest.mark.parametrize("kind", ["numbers", "numbers and names", "names", "none"])
@pytest.mark.parametrize("seed", range(4))
def test_each_cell_of_a_map_is_of_the_same_class_to_all(
    kind: str, seed: int, tmp_path: Path
) -> None:
    rng, file = np.random.default_rng(seed), tmp_path / "map.npz"
    cells = rng.integers(0, len(NAMES), SHAPE)
    layers: dict[str, Any] = {
        "numbers": {"terrain_class": cells},
        "numbers and names": {"terrain_class": cells, "terrain_names": np.array(NAMES)},
        "names": {"terrain_class": np.array(NAMES)[cells]},
        "none": {},
    }[kind]
    np.savez(file, **FLAT, **layers)  # type: ignore[arg-type]
    ours = read_map(file)
    theirs = class_names_of(ours)
    np.testing.assert_array_equal(class_names_of(read_guard_map(file)), theirs)
    if ours.terrain_class is not None:
        update = MapUpdate(
            source="m",
            sequence=1,
            **FLAT,
            terrain_class=ours.terrain_class,  # type: ignore[arg-type]
            class_names=list(ours.class_names),
        )
        store = MapStore()
        assert store.apply(update, "map")
        np.testing.assert_array_equal(class_names_of(store.snapshot.elevation_map), theirs)


def class_names_of(ground: ElevationMap) -> np.ndarray:
    """Name of the class of each cell."""
    classes = ground.terrain_class
    if classes is None:
        classes = np.zeros(ground.elevation.shape, np.int64)
    named: np.ndarray = np.array(ground.class_names)[classes]
    return named


def drive(model_file: Path, map_file: Path, speed: float) -> GuardDecision:
    """The guard, with a map to begin with, on a command that keeps the speed."""
    model = read_guard_model(model_file)
    scene = GuardScene(model, read_guard_map(map_file), 3.0)
    motion = VehicleMotion(Pose2d(2.0, 0.0, 0.0), speed)
    return decide(scene, motion, BaseCommand(speed, 0.0), hold_time=0.1, late=0.02, load=0.5)


@pytest.mark.parametrize("classes", ["number", "name", "number 0"])
def test_guard_brakes_for_weak_apply_update_its_first_map(classes: str, tmp_path: Path) -> None:
    """Ice from x = 4 m on: its stop does not end within the clear distance, that of grass does."""
    numbered = SurfaceBraking(b_b=0.12, class_id=0 if classes == "number 0" else 3)
    braking = dataclasses.replace(ATV.braking, terrain={"ice": numbered})
    model, plain, iced = (tmp_path / name for name in ("model.toml", "plain.npz", "iced.npz"))
    write_model(dataclasses.replace(ATV, braking=braking), model)
    cells = np.zeros(SHAPE, np.int64)
    cells[:, 16:] = 3
    layers: dict[str, Any] = {
        "number": {"terrain_class": cells},
        "name": {"terrain_class": np.where(cells == 3, "ice", "")},
        "number 0": {"terrain_class": cells, "terrain_names": np.array(["", "a", "b", "#0"])},
    }[classes]
    np.savez(plain, **FLAT)  # type: ignore[arg-type]
    np.savez(iced, **FLAT, **layers)  # type: ignore[arg-type]
    assert drive(model, plain, 3.0).action == "pass"
    assert drive(model, iced, 3.0).action == "stop"
    assert drive(model, iced, 1.0).action == "pass"


@pytest.mark.parametrize(
    ("layer", "value", "field"),
    [
        ("terrain_class", np.full(SHAPE, -1), "terrain_class"),
        ("terrain_class", np.zeros((2, 2), np.int64), "terrain_class"),
        ("knwon", np.ones(SHAPE, np.bool_), "known"),
    ],
)
def test_guard_refuses_a_first_map_that_plans_refuse(
    layer: str, value: np.ndarray, field: str, tmp_path: Path
) -> None:
    file = tmp_path / "map.npz"
    np.savez(file, **FLAT, **{layer: value})  # type: ignore[arg-type]
    for reader in (read_guard_map, read_map):
        with pytest.raises(InputError, match=field):
            reader(file)
    settings = tmp_path / "guard.toml"
    settings.write_text(f'model = "atv"\nmap = "{file}"\n')
    one_line_of(here("guard", "--config", settings), field)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("class_id = 1.5", "terrain.ice.class_id: expected a whole number"),
        ('state_of = "mud"', "terrain.ice.state_of: expected"),
    ],
)
def test_guard_refuses_surfaces_that_plans_refuse(line: str, message: str, tmp_path: Path) -> None:
    file = tmp_path / "model.toml"
    file.write_text(f"{find_model('atv').read_text()}\n[braking.terrain.ice]\nb_b = 0.2\n{line}\n")
    with pytest.raises(InputError, match=message):
        read_guard_model(file)
    with pytest.raises(InputError):
        read_model(file)
