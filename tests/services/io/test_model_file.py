from __future__ import annotations

import copy
import dataclasses
import hashlib
import os
import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slopewise.models.errors import InputError
from slopewise.models.parameters import Braking, Limits, Model, Terrain
from slopewise.models.vehicle import Vehicle
from slopewise.services.io.decode import decode_table
from slopewise.services.io.files import sha256_of
from slopewise.services.io.model_file import (
    find_model,
    model_from_dict,
    model_sha256,
    model_to_dict,
    read_model,
    shipped_models,
    write_model,
)
from tests.services.faults import bad_inputs, fault_in
from tests.world.generated import by_day_and_night

ROOT = Path(__file__).parents[3]
KINDS = {"vehicle": Vehicle, "braking": Braking, "terrain": Terrain, "limits": Limits}


@pytest.fixture
def tables() -> dict[str, Any]:
    return tomllib.loads(find_model("atv").read_text())


def put(tables: dict[str, Any], where: str, value: object) -> dict[str, Any]:
    *path, last = where.split(".")
    table = tables
    for name in path:
        table = table.setdefault(name, {})
    table[last] = value
    return tables


def test_the_example_of_the_format_is_the_shipped_atv() -> None:
    model = read_model(find_model("atv"))
    assert model.name == "atv"
    assert model.vehicle.mass == 500.0
    assert model.braking.b_b == 0.40
    assert model.braking.speed_range == (1.0, 4.0)
    assert model.terrain.slip_track == 1.15
    assert model.limits.min_load == 0.10
    assert model.effect == ()


@pytest.mark.parametrize("name", ["atv", "husky", "ugv"])
def test_shipped_vehicles_stop_on_every_trained_grade(name: str) -> None:
    model = read_model(find_model(name))
    assert model.name == name
    for surface in ("", *model.braking.terrain):
        braking = model.braking.on(surface)
        for grade in (*braking.grade_range, 0.0):
            for speed in braking.speed_range:
                slope, level = braking.m_m * speed + braking.b_m, braking.m_b * speed + braking.b_b
                force = slope * grade + level
                if braking.sliding_friction is not None:
                    force = min(force, braking.sliding_friction * np.cos(grade))
                assert force + np.sin(grade) > 0.03


def test_what_the_atv_leaves_out_is_commented_with_the_number_that_then_holds() -> None:
    """Uncommented, those lines change nothing; examples of what has no default are not of them."""
    file = find_model("atv")
    known = {field.name for kind in KINDS.values() for field in dataclasses.fields(kind)}
    examples = {
        "motor_torque_constant",
        "gear_ratio",
        "idle_current",
        "sliding_friction",
        "covariance",
        "front_brake_share",
        "speed_by_grade",
    }
    commented = set(re.findall(r"^# (\w+) = ", file.read_text(), re.MULTILINE)) & known
    held = "|".join(commented - examples)
    model = read_model(file)
    explicit = model_from_dict(
        tomllib.loads(re.sub(rf"^# ({held}) = ", r"\1 = ", file.read_text(), flags=re.MULTILINE)),
        "atv",
    )
    sizes, default_sizes = explicit.vehicle.shape, model.vehicle.shape
    assert sizes.assumed == ()
    assert len(default_sizes.assumed) == 4
    assert sizes[:-1] == pytest.approx(default_sizes[:-1], abs=1e-3)
    assert explicit.braking.trained_roll == model.braking.trained_roll
    assert dataclasses.replace(explicit.braking, roll_range=None) == model.braking
    assert explicit.max_path_deviation == pytest.approx(model.max_path_deviation)
    assert dataclasses.replace(explicit.limits, max_path_deviation=None) == model.limits
    assert explicit.terrain.rolling_while_braking == model.terrain.rolling_while_braking
    assert dataclasses.replace(explicit.terrain, braking_resistance=None) == model.terrain
    for table, kind in KINDS.items():
        optional = {
            f.name for f in dataclasses.fields(kind) if f.default is not dataclasses.MISSING
        }
        assert optional <= commented | set(tomllib.loads(file.read_text())[table]) | {
            "uphill",
            "distance",
        }


def test_slip_table_1_and_2_are_the_huskys() -> None:
    model = read_model(find_model("husky"))
    vehicle = model.vehicle
    assert vehicle.mass * 9.81 == pytest.approx(294.3)
    assert (vehicle.track_width, vehicle.wheelbase) == (0.6, 0.55)
    assert 2 * vehicle.wheel_radius == 0.26
    assert (vehicle.motor_torque_constant, vehicle.gear_ratio) == (0.044, 78.71)
    terrain = model.terrain
    assert terrain.motion_resistance == 0.13
    assert terrain.lateral_resistance == 0.20
    assert terrain.slip_track == 1.15


def test_a_mistake_is_named_by_its_dotted_key(tables: dict[str, Any]) -> None:
    for where, value, field, message in (
        *bad_inputs("model"),
        ("vehicle.mass", 10**400, "vehicle.mass", "got a huge one"),
        ("braking.terrain", {f"s{i}": {} for i in range(62)}, "braking.terrain", "at most 61"),
    ):
        with fault_in("m.toml", field, message):
            model_from_dict(put(copy.deepcopy(tables), where, value), "m.toml")


def test_every_required_key_is_missed_by_name(tables: dict[str, Any]) -> None:
    optional = {"distance_offset", "covariance", "width", "ground_clearance"}
    for table in ("vehicle", "braking", "terrain", "limits"):
        with fault_in("m.toml", table, "missing key, expected a table"):
            model_from_dict({k: v for k, v in tables.items() if k != table}, "m.toml")
        for key in tables[table]:
            changed = copy.deepcopy(tables)
            del changed[table][key]
            if key in optional:
                model_from_dict(changed, "m.toml")
                continue
            with fault_in("m.toml", f"{table}.{key}", "missing key, expected "):
                model_from_dict(changed, "m.toml")


def test_whole_numbers_are_floats(tables: dict[str, Any]) -> None:
    model = model_from_dict(put(tables, "vehicle.mass", 500), "m.toml")
    assert type(model.vehicle.mass) is float


def test_missing_file_and_directory(tmp_path: Path) -> None:
    with fault_in(tmp_path / "none.toml", "", "expected an existing file"):
        read_model(tmp_path / "none.toml")
    with fault_in(tmp_path, "", "expected a file, got a directory"):
        read_model(tmp_path)
    with fault_in("a\\x00b", ""):
        read_model(Path("a\0b"))


def test_find_model(tmp_path: Path) -> None:
    assert find_model("husky") == shipped_models()["husky"]
    path = tmp_path / "own.toml"
    shutil.copy(find_model("atv"), path)
    assert find_model(path) == path
    assert find_model(str(path)) == path
    for unknown in ("hsky", "../vehicles/atv", str(tmp_path)):
        with fault_in(unknown, "", "a model file or one of atv, husky, ugv"):
            find_model(unknown)


def test_shipped_vehicles_are_found_after_an_installation(tmp_path: Path) -> None:
    ignore = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "slopewise", tmp_path / "slopewise", ignore=ignore)
    script = (
        "import sys; from slopewise.services.io import model_file as m;"
        "heavy = {'rasterio', 'pyarrow', 'numba', 'scipy', 'msgspec'} & set(sys.modules);"
        "print(m.read_model(m.find_model('ugv')).name, m.find_model('ugv'), heavy or 'light')"
    )
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "-P", "-c", script],
        cwd=tmp_path.parent,
        env=environment,
        capture_output=True,
        text=True,
        check=True,
    )
    place = tmp_path / "slopewise" / "configs" / "vehicles" / "ugv.toml"
    assert done.stdout.split() == ["ugv", str(place), "light"]


def test_the_digest_of_a_model_is_that_of_its_file(tmp_path: Path) -> None:
    model = read_model(find_model("atv"))
    write_model(model, tmp_path / "m.toml")
    digest = hashlib.sha256((tmp_path / "m.toml").read_bytes()).hexdigest()
    assert model_sha256(model) == digest == sha256_of(tmp_path / "m.toml")
    rows = [list(row) for row in model.braking.covariance or ()]
    for same in (rows, np.array(rows)):
        braking = dataclasses.replace(model.braking, covariance=same)  # type: ignore[arg-type]
        assert model_sha256(dataclasses.replace(model, braking=braking)) == digest
    slower = dataclasses.replace(model, limits=dataclasses.replace(model.limits, speed=1.0))
    assert model_sha256(slower) != digest


def test_the_digest_of_a_folder_is_that_of_its_files(tmp_path: Path) -> None:
    (tmp_path / "bag").mkdir()
    (tmp_path / "bag" / "b.mcap").write_bytes(b"two")
    (tmp_path / "bag" / "a.yaml").write_bytes(b"one")
    lines = "".join(
        f"{hashlib.sha256(c).hexdigest()}  {n}\n"
        for n, c in (("a.yaml", b"one"), ("b.mcap", b"two"))
    )
    assert sha256_of(tmp_path / "bag") == hashlib.sha256(lines.encode()).hexdigest()
    with pytest.raises(InputError):
        sha256_of(tmp_path / "none")


def test_writing_is_all_or_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = read_model(find_model("atv"))
    path = tmp_path / "m.toml"
    path.write_text("old")
    path.chmod(0o640)

    def full(_: int) -> None:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr("slopewise.services.io.files.os.fsync", full)
        with fault_in(path, "", "expected a writable file, got: No space left on device"):
            write_model(model, path)
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]
    link = tmp_path / "link.toml"
    link.symlink_to(path)
    write_model(model, link)
    assert link.is_symlink()
    assert read_model(path) == model
    assert path.stat().st_mode & 0o777 == 0o640
    assert sorted(tmp_path.iterdir()) == [link, path]


def test_writing_where_nothing_can_be_written(tmp_path: Path) -> None:
    model = read_model(find_model("atv"))
    for path in (tmp_path / "none" / "m.toml", tmp_path):
        with fault_in(path, "", "expected a writable file"):
            write_model(model, path)
    assert list(tmp_path.iterdir()) == []


NAMES = st.text(min_size=1, max_size=8).filter(lambda name: not name.startswith("#"))
OPTIONAL = tomllib.loads(Path(__file__).with_name("optional_keys.toml").read_text())
COVARIANCE = OPTIONAL["braking.covariance"]
SURFACE = st.fixed_dictionaries(
    {},
    optional={
        "b_b": st.floats(0.2, 0.5),
        "dead_time": st.floats(0.0, 1.0),
        "covariance": st.just(COVARIANCE),
        "speed_range": st.just([0.5, 3.0]),
        "sliding_friction": st.floats(0.2, 0.9),
        "uphill": st.just({"m_m": 0.0, "b_m": -0.2}),
    },
)
LAG = st.fixed_dictionaries(
    {"name": st.just("brake_lag"), "parameters": st.builds(dict, tau=st.floats(0.0, 0.9))},
    optional={"covariance": st.just([[0.01]]), "source": st.text(max_size=10)},
)


@by_day_and_night(25, 2000)
@given(
    given_keys=st.sets(st.sampled_from(sorted(OPTIONAL))),
    factor=st.floats(0.97, 1.0),
    name=st.text(max_size=10),
    surfaces=st.dictionaries(NAMES, SURFACE, max_size=3),
    effects=st.lists(LAG, max_size=1),
)
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory,
    given_keys: set[str],
    factor: float,
    name: str,
    surfaces: dict[str, Any],
    effects: list[dict[str, Any]],
) -> None:
    tables = tomllib.loads(find_model("atv").read_text())
    for key in OPTIONAL:
        table, _, last = key.partition(".")
        tables.get(table, {}).pop(last, None)
    for key in given_keys:
        put(tables, key, OPTIONAL[key])
    for table in ("vehicle", "limits"):
        for key, value in tables[table].items():
            if isinstance(value, float):  # any number, digit by digit; sizes stay consistent
                tables[table][key] = factor * value
    tables |= {"name": name, "effect": effects}
    tables["braking"]["terrain"] = surfaces
    tables["terrain"]["slip_track"] = 1.15
    model = decode_table(Model, tables, "m.toml")
    path = tmp_path_factory.mktemp("model") / "m.toml"
    write_model(model, path)
    assert read_model(path) == model
    assert model_from_dict(model_to_dict(model), "message") == model


JSON = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text(max_size=5),
    lambda inner: st.lists(inner, max_size=5) | st.dictionaries(st.text(max_size=5), inner),
    max_leaves=6,
)


@settings(deadline=None)
@given(data=st.data())
def test_whatever_a_key_holds_it_is_a_model_or_one_line(data: st.DataObject) -> None:
    tables = tomllib.loads(find_model("ugv").read_text())
    tables["effect"] = [{"name": "brake_lag", "parameters": {"tau": 0.3}, "covariance": [[0.1]]}]
    holder: Any = tables
    while True:
        keys = list(holder) if isinstance(holder, dict) else range(len(holder))
        key = data.draw(st.sampled_from(list(keys)))
        if not isinstance(holder[key], dict | list) or data.draw(st.booleans()):
            break
        holder = holder[key]
    holder[key] = data.draw(JSON)
    try:
        assert isinstance(model_from_dict(tables, "m.toml"), Model)
    except InputError as error:
        assert str(error).isprintable()  # noqa: PT017  either outcome is right
