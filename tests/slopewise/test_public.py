"""The namespace of the package, and its public names."""

from __future__ import annotations

import copy
import inspect
import pickle
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import slopewise
from slopewise.models.parameters import Effect
from slopewise.services.io.map_file import write_map_npz


@pytest.fixture(scope="module")
def hill() -> slopewise.ElevationMap:
    x, y = np.meshgrid(np.arange(0.0, 40.0, 0.25), np.arange(0.0, 20.0, 0.25))
    height = 1.5 * np.exp(-(((x - 20.0) / 8.0) ** 2) - ((y - 10.0) / 6.0) ** 2)
    height[(x > 34.0) & (y > 10.0)] = np.nan
    return slopewise.ElevationMap(elevation=height, resolution=0.25, origin=(0.0, 0.0))


def straight(y: float) -> slopewise.CandidatePath:
    points = np.stack([np.linspace(3.0, 37.0, 80), np.full(80, y)], axis=1)
    return slopewise.CandidatePath(name=f"y{y:.0f}", points=points)


def brisk() -> slopewise.Model:
    """A vehicle whose stops, not its limits, decide how fast it goes."""
    model = slopewise.read_model("atv")
    return replace(model, limits=replace(model.limits, accel=3.0, decel=8.0, jerk=20.0))


def test_every_name_is_documented_and_typed() -> None:
    assert sorted(slopewise.__all__) == list(slopewise.__all__)
    assert set(slopewise.__all__) <= set(dir(slopewise))
    for name in slopewise.__all__:
        value = getattr(slopewise, name)
        assert len(inspect.getdoc(value) or "") > 20, name
        if inspect.isfunction(value):
            parameters = inspect.signature(value).parameters.values()
            assert all(p.annotation is not p.empty for p in parameters), name
    assert (Path(slopewise.__file__).parent / "py.typed").is_file()
    with pytest.raises(AttributeError, match="no attribute 'plans'"):
        _ = slopewise.plans


def test_values_are_copied_compared_and_sent_to_other_processes(
    hill: slopewise.ElevationMap,
) -> None:
    model, path = brisk(), straight(5.0)
    effect = Effect(name="brake_lag", parameters={"tau": 0.2})
    model = replace(model, effect=(effect,))
    (plan,) = slopewise.plan(model, hill, [path])
    report, horizon = slopewise.check_plan(plan, model, hill), slopewise.Horizon(model)
    for copied in (pickle.loads(pickle.dumps(model)), copy.deepcopy(model)):
        assert copied == model
        assert type(copied.effect[0].parameters) is type(effect.parameters)
    assert copy.deepcopy(horizon).model == pickle.loads(pickle.dumps(horizon)).model == model
    for value in (hill, path, plan, report):
        copied = copy.deepcopy(value)
        assert value in [copied, value]
        assert {value: 1}.get(copied) is None


def test_readme_and_documentation_use_public_names_only() -> None:
    root = Path(__file__).parents[2]
    pages = [root / "README.md", *(root / "docs").rglob("*.md")]
    used = {name for page in pages for name in re.findall(r"slopewise\.(\w+)\(", page.read_text())}
    assert used >= {"read_map", "read_model", "read_paths", "plan", "check_plan", "calibrate"}
    assert used <= set(slopewise.__all__)


SERVING = "slopewise.services.cli.app, slopewise.services.daemon.daemon"
UNUSED = {
    "slopewise": "numpy numba scipy zenoh rasterio msgspec rich typer",
    "slopewise.services.cli.app": "numpy numba scipy casadi osqp rasterio matplotlib zenoh msgspec",
    SERVING: "matplotlib rasterio casadi PIL contourpy pyarrow sklearn plotly rosbags waitress "
    "scipy.stats scipy.ndimage scipy.cluster",
}


@pytest.mark.parametrize("modules", UNUSED)
def test_importing_loads_nothing_that_is_not_used(modules: str, tmp_path: Path) -> None:
    code = f"import sys, {modules}; print(set({UNUSED[modules]!r}.split()) & set(sys.modules))"
    assert run(tmp_path, "-c", code) == "set()\n"


def test_plans_are_ranked_and_pass_the_check(hill: slopewise.ElevationMap) -> None:
    model = slopewise.read_model("atv")
    plans = slopewise.plan(model, hill, [straight(14.0), straight(6.0)], start_speed=1.0)
    assert [p.candidate for p in plans] == ["y6", "y14"]
    assert [p.status.value for p in plans] == ["ok", "blocked"]
    for plan in plans:
        verdict = slopewise.check_plan(plan, model, hill)
        assert verdict.valid
        moving = plan.speed > 0.0
        np.testing.assert_allclose(
            verdict.stop_distance[moving], plan.stop_distance[moving], rtol=0.02, atol=0.02
        )


def test_a_refused_path_is_named_and_the_others_are_planned(hill: slopewise.ElevationMap) -> None:
    model, place = slopewise.read_model("atv"), np.full((3, 2), 5.0)
    nowhere = slopewise.CandidatePath(name="nowhere", points=place)
    plans = slopewise.plan(model, hill, [straight(14.0), nowhere, straight(6.0)], start_speed=1.0)
    (refused,) = plans.refused
    assert refused.candidate == "nowhere"
    assert refused.reason.startswith("nowhere.points")
    without = slopewise.plan(model, hill, [straight(14.0), straight(6.0)], start_speed=1.0)
    assert [plan.candidate for plan in plans] == [plan.candidate for plan in without]
    for plan, alone in zip(plans, without, strict=True):
        np.testing.assert_array_equal(plan.speed, alone.speed)
    assert without.refused == ()
    with pytest.raises(ValueError, match=r"nowhere\.points"):
        slopewise.plan(model, hill, [nowhere])


def test_the_check_bites(hill: slopewise.ElevationMap) -> None:
    model = brisk()
    (plan,) = slopewise.plan(model, hill, [straight(14.0)], start_speed=1.0, clear=12.0)
    assert slopewise.check_plan(plan, model, hill, clear=12.0).valid
    faster = replace(plan, speed=1.2 * plan.speed)
    assert not slopewise.check_plan(faster, model, hill, clear=12.0).valid
    assert not slopewise.check_plan(plan, model, hill, clear=plan.clear_distance - 0.5).valid
    weaker = replace(model, braking=replace(model.braking, b_b=model.braking.b_b - 0.1))
    assert not slopewise.check_plan(plan, weaker, hill, clear=12.0).valid
    short = replace(plan, **{n: getattr(plan, n)[:1] for n in ("station", "x", "y", "speed")})
    with pytest.raises(slopewise.SlopewiseError, match="at least 2 stations"):
        slopewise.check_plan(short, model, hill)


def test_a_quantile_makes_plans_slower(hill: slopewise.ElevationMap) -> None:
    mean, margins = (
        slopewise.plan(brisk(), hill, [straight(6.0)], clear=12.0, quantile=q)[0].travel_time
        for q in (None, 0.999)
    )
    assert margins > mean


@pytest.mark.parametrize("cell", [0.1, 1.0])
def test_ground_that_is_unknown_throughout_is_not_driven(cell: float) -> None:
    heights = np.full((round(40.0 / cell),) * 2, np.nan)
    unknown = slopewise.ElevationMap(
        elevation=heights, resolution=cell, origin=(0, 0), height_std=0.02
    )
    known, model = replace(unknown, elevation=np.zeros_like(heights)), slopewise.read_model("atv")
    (plan,) = slopewise.plan(model, unknown, [straight(20.0)])
    assert (plan.status.value, plan.progress) == ("blocked", 0.0)
    assert slopewise.guard_decision(model, unknown, (9.0, 20.0, 0.0), 1.0, (1.0, 0.0)).brake
    (plan,) = slopewise.plan(model, known, [straight(20.0)])
    assert not slopewise.check_plan(plan, model, unknown).valid


def test_a_plan_that_ends_metres_before_its_path_is_not_ok() -> None:
    heights = np.tile(np.arange(40.0) * np.tan(np.deg2rad(-8.0)), (40, 1))
    ground = slopewise.ElevationMap(
        elevation=heights, resolution=1.0, origin=(0, 0), height_std=0.1
    )
    model = slopewise.read_model("husky")
    (plan,) = slopewise.plan(model, ground, [straight(20.0)])
    assert plan.status.value == "blocked"
    assert slopewise.check_plan(plan, model, ground).valid


def test_files_by_name_and_path(hill: slopewise.ElevationMap, tmp_path: Path) -> None:
    write_map_npz(hill, tmp_path / "hill.npz")
    again = slopewise.read_map(str(tmp_path / "hill.npz"))
    np.testing.assert_array_equal(again.elevation, hill.elevation)
    (tmp_path / "paths.csv").write_text("x,y\n1,1\n2,1\n3,1\n")
    (path,) = slopewise.read_paths(tmp_path / "paths.csv")
    assert path.points.shape == (3, 2)
    model = replace(slopewise.read_model("husky"), name="mine")
    slopewise.write_model(model, tmp_path / "mine.toml")
    assert slopewise.read_model(tmp_path / "mine.toml") == model


def test_the_horizon_accepts_public_types(hill: slopewise.ElevationMap) -> None:
    horizon = slopewise.Horizon(slopewise.read_model("atv"))
    state = slopewise.PlanarState(x=3.0, y=6.0, heading=0.0, speed=1.0)
    answer = horizon.step(state, [straight(6.0)], hill)
    assert answer.chosen is not None
    assert answer.command.speed > 0.0


def log_of_stops(path: Path) -> slopewise.DriveLog:
    """Twenty stops with F_b/W = 0.35 after 0.25 s."""
    random = np.random.default_rng(1)
    rows, clock = ["run,t,v,v_cmd,pitch"], 0.0
    for run in range(20):
        speed, grade = random.uniform(1.0, 4.0), random.uniform(-0.2, 0.2)
        decel = 9.80665 * (0.35 + np.sin(grade))
        for t in np.arange(-1.5, speed / decel + 1.5, 0.02):
            v = max(speed - decel * max(t - 0.25, 0.0), 0.0) + random.normal(0.0, 0.01)
            rows.append(f"{run},{clock + t:.3f},{v:.4f},{speed * (t < 0.0):.3f},{-grade:.4f}")
        clock += 60.0
    path.write_text("\n".join(rows))
    return slopewise.read_drive_log(path)


def test_brakes_are_calibrated_and_compared_with_a_log(tmp_path: Path) -> None:
    log = log_of_stops(tmp_path / "drive.csv")
    model = slopewise.read_model("atv")
    learned = slopewise.calibrate(log, model).braking
    assert abs(learned.b_b + learned.m_b * 2.5 - 0.35) < 0.02
    assert abs(learned.dead_time - 0.25) < 0.05
    drifted = slopewise.find_discrepancies(log, model)
    assert drifted.verdict.value == "parameter_drift"


NAMES = ("models", "planner", "services", "benchmarks", "configs")


@pytest.fixture
def workspace(tmp_path: Path) -> Path:
    """A folder with packages of those names of another project."""
    for name in NAMES:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(f"raise AssertionError('foreign {name}')")
    return tmp_path


def run(folder: Path, *arguments: str) -> str:
    command = [sys.executable, *arguments]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=300)
    assert (done.returncode, done.stderr) == (0, "")
    return done.stdout


FIRST = """
import numpy as np
import slopewise

ground = slopewise.ElevationMap(elevation=np.zeros((40, 100)), resolution=0.5, origin=(0, 0))
path = slopewise.CandidatePath("straight", np.array([[5.0, 10.0], [30.0, 10.0]]))
model = slopewise.read_model("atv")
(plan,) = slopewise.plan(model, ground, [path])
assert slopewise.check_plan(plan, model, ground).valid
state = slopewise.PlanarState(x=5, y=10, heading=0, speed=0)
answer = slopewise.Horizon(model).step(state, [path], ground)
print(plan.status.value, answer.command.stop, slopewise.Model.__module__)
"""


def test_it_plans_at_once_in_a_folder_with_foreign_packages(workspace: Path) -> None:
    assert run(workspace, "-c", FIRST) == "ok False slopewise.models.parameters\n"
