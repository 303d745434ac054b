"""`slopewise check` and `plan --check`: words in, violations, status and lines out."""

from __future__ import annotations

import csv
import json
from pathlib import Path

import numpy as np
import pytest

from slopewise.models.parameters import Model
from slopewise.services.io.map_file import write_map_npz
from slopewise.services.io.model_file import write_model
from tests.services.check.drives import ground, model_with, trapezoid
from tests.services.command_line import here, one_line_of


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A level map and the quad."""
    write_map_npz(ground(), tmp_path / "level.npz")
    model: Model = model_with()
    write_model(model, tmp_path / "quad.toml")
    return tmp_path


def write_plan(path: Path, share: float = 1.0, **columns: object) -> Path:
    s, v = trapezoid(3.0, spacing=0.25)
    table = {"x": s, "y": np.zeros_like(s), "speed": share * v, **columns}
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        writer.writerows(
            zip(*(np.broadcast_to(np.asarray(c), s.shape) for c in table.values()), strict=True)
        )
    return path


def words(scene: Path, plan: Path, *more: object) -> tuple[object, ...]:
    return ("check", plan, "--map", scene / "level.npz", "--model", scene / "quad.toml", *more)


def test_three_columns_are_enough(scene: Path) -> None:
    done = here(*words(scene, write_plan(scene / "plan.csv")))
    assert done.returncode == 0, done.stderr
    assert "no violation" in done.stdout


def test_violations_are_told_by_kind_and_the_status_is_3(scene: Path) -> None:
    plan = write_plan(scene / "plan.csv", share=1.5)
    done = here(*words(scene, plan, "--json"))
    assert done.returncode == 3
    told = json.loads(done.stdout)
    assert not told["valid"]
    assert {v["kind"] for v in told["violations"]} >= {"speed_limit", "decel", "accel"}
    for violation in told["violations"]:
        assert violation["size"] > 0.0
        assert violation["candidate"] == "plan"
        assert violation["unit"] == told["tolerances"][violation["kind"]]["unit"]
        assert violation["sentence"]
    (one,) = told["plans"]
    assert one["stops"] > 0
    assert sum(one["kinds"].values()) == len(told["violations"])
    shown = here(*words(scene, plan))
    assert shown.returncode == 3
    assert "speed_limit" in shown.stdout
    assert "1 with violations" in shown.stdout


def test_many_plans_in_one_file(scene: Path) -> None:
    path = write_plan(scene / "plan.csv", candidate="good")
    bad = write_plan(scene / "bad.csv", share=1.5, candidate="bad").read_text().splitlines()[1:]
    path.write_text(path.read_text() + "\n".join(bad))
    told = json.loads(here(*words(scene, path, "--json")).stdout)
    assert [(plan["candidate"], plan["valid"]) for plan in told["plans"]] == [
        ("good", True),
        ("bad", False),
    ]


def test_the_way_known_free_counts(scene: Path) -> None:
    plan = write_plan(scene / "plan.csv")
    done = here(*words(scene, plan, "--clear", "10", "--json"))
    assert done.returncode == 3
    assert {v["kind"] for v in json.loads(done.stdout)["violations"]} == {"stopping_path"}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("x,y\n0,0\n1,0\n", ("plan.csv", "speed", "missing column")),
        ("x,y,speed\n", ("plan.csv", "row 2", "at least one row")),
        ("x,y,speed\n0,0,1\n1,0,fast\n", ("row 3", "column speed", "m/s", "fast")),
        ("x,y,speed\n0,0,1\n1,0,-1\n", ("row 3", "column speed", "a speed >= 0", "-1")),
        ("x,y,speed\n0,0,1\n1,nan,0\n", ("row 3", "column y")),
        ("x,y,speed,z\n0,0,1,0\n1,0,0,\n", ("row 3", "column z", "every row")),
        ("x,y,speed\n900,0,1\n901,0,0\n", ("plan.csv", "on the map", "900")),
        ("x,y,speed\n1,1,1\n1,1,1\n", ("plan.csv", "2 different places")),
        ("x,y,speed,candidate\n1,1,1,\n", ("row 2", "candidate", "a name")),
    ],
)
def test_bad_input_is_one_line(scene: Path, text: str, expected: tuple[str, ...]) -> None:
    (scene / "plan.csv").write_text(text)
    one_line_of(here(*words(scene, scene / "plan.csv")), *expected)


def test_bad_options_are_one_line(scene: Path) -> None:
    plan = write_plan(scene / "plan.csv")
    one_line_of(here(*words(scene, plan, "--clear", "-1")), "--clear", "distance >= 0")
    one_line_of(here("check", plan, "--map", scene / "no.npz", "--model", "atv"), "no.npz")
    one_line_of(here("check", plan, "--map", scene / "level.npz", "--model", "no"), "no")


def test_plans_are_checked_as_they_are_written(scene: Path) -> None:
    (scene / "paths.csv").write_text("x,y\n0,0\n20,0\n")
    out = scene / "plan.csv"
    plan = ("plan", scene / "level.npz", scene / "paths.csv", "--model", scene / "quad.toml")
    done = here(*plan, "--out", out, "--check", "--json")
    assert done.returncode == 0, done.stderr
    told = json.loads(done.stdout)
    assert told["check"]["valid"], told["check"]["violations"][:3]
    assert told["check"]["plans"][0]["stops"] > 100
    assert here(*words(scene, out)).returncode == 0
    shown = here(*plan, "--check")
    assert shown.returncode == 0
    assert "no violation" in shown.stdout


def test_a_plan_that_is_found_wrong_ends_with_status_3(
    scene: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from slopewise.services.cli.commands import plan as command

    def faster(result: command.PlanResult, path: Path) -> None:
        write_plan(path, share=1.5)

    (scene / "paths.csv").write_text("x,y\n0,0\n20,0\n")
    monkeypatch.setattr(command, "write", faster)
    done = here(
        "plan",
        scene / "level.npz",
        scene / "paths.csv",
        "--model",
        scene / "quad.toml",
        "--out",
        scene / "plan.csv",
        "--check",
    )
    assert done.returncode == 3
    assert "with violations" in done.stdout
