"""Exported functions agree with the model: C with Python, derivatives with differences."""

from __future__ import annotations

import ctypes
import json
import shutil
import subprocess
import tomllib
from dataclasses import replace
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np
import pytest

from slopewise.models.errors import InputError, ParameterError
from slopewise.models.parameters import Model
from slopewise.models.surface_braking import SurfaceBraking
from slopewise.services.export.c_code import sample_inputs, write_c
from slopewise.services.export.cpp_model import write_cpp
from slopewise.services.export.functions import (
    ModelFunction,
    derivative_of,
    functions_of,
    write_functions,
)
from slopewise.services.export.schema import model_schema
from slopewise.services.io.model_file import find_model, model_from_dict, read_model, shipped_models
from tests.services.command_line import here, one_line_of

CORE = Path(__file__).parents[3] / "planner" / "core"
POINTS = 400
EXACT = 1e-9


def with_everything() -> Model:
    """Surfaces, uphill coefficients, effects, a friction cap."""
    data = tomllib.loads(find_model("atv").read_text())
    data["name"] = "all of it"
    data["braking"]["uphill"] = {"m_m": -0.02, "b_m": -0.25}
    data["braking"]["terrain"] = {"gravel": {"b_b": 0.3, "sliding_friction": 0.45}}
    data["braking"]["level"] = 0.8
    data["braking"]["dead_band"] = 0.1
    data["effect"] = [
        {"name": "brake_lag", "parameters": {"tau": 0.3}},
        {"name": "aerodynamic_drag", "parameters": {"c": 0.01}},
        {"name": "cross_slope", "parameters": {"k": -0.1}},
    ]
    return model_from_dict(data, "test")


MODELS = {"atv": read_model(find_model("atv")), "all of it": with_everything()}


def by_numpy(function: ModelFunction, points: np.ndarray) -> np.ndarray:
    values: np.ndarray = np.broadcast_to(function.evaluate(*points.T), len(points))
    return values


@pytest.fixture(scope="module", params=MODELS)
def model(request: pytest.FixtureRequest) -> Model:
    return MODELS[request.param]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc")
def test_c_code_says_what_python_says(model: Model, tmp_path: Path) -> None:
    functions = functions_of(model)
    source, header, units = write_c(model, functions, tmp_path / "c")
    assert header.exists()
    library = tmp_path / "model.so"
    flags = ["-O0", "-Wall", "-Wextra", "-Werror", "-shared", "-fPIC"]
    subprocess.run(["gcc", *flags, "-o", str(library), str(source), "-lm"], check=True)
    compiled, rng = ctypes.CDLL(str(library)), np.random.default_rng(1)
    for function in functions:
        call = getattr(compiled, function.name)
        points = np.ascontiguousarray(sample_inputs(function, POINTS, rng))
        expected = by_numpy(function, points)
        values, out = np.empty(POINTS), (ctypes.c_double * 1)()
        result = (ctypes.POINTER(ctypes.c_double) * 1)(out)
        columns = [np.ascontiguousarray(column) for column in points.T]
        step, arguments = ctypes.sizeof(ctypes.c_double), (ctypes.c_void_p * len(columns))()
        starts = [column.ctypes.data for column in columns]
        for k in range(POINTS):
            for i, start in enumerate(starts):
                arguments[i] = start + k * step
            assert call(arguments, result, None, None, 0) == 0
            values[k] = out[0]
        np.testing.assert_allclose(values, expected, rtol=EXACT, atol=EXACT, err_msg=function.name)
    # The header with units and vectors compiles, too, and its vectors are the model's.
    check = tmp_path / "check.c"
    check.write_text(f'#include "{units.name}"\nint main(void) {{ return 0; }}\n')
    command = ["gcc", "-fsyntax-only", f"-I{units.parent}", str(check)]
    subprocess.run(command, check=True)
    assert "speed [m/s]" in units.read_text()


def test_derivatives_are_differences(model: Model) -> None:
    rng, h = np.random.default_rng(2), 1e-6
    for function in functions_of(model):
        derivatives = derivative_of(function)
        for point in sample_inputs(function, 60, rng):
            exact = np.array(derivatives(*point)).ravel()
            for i in range(len(point)):
                low, high = point.copy(), point.copy()
                low[i], high[i] = point[i] - h, point[i] + h
                ends = [float(function.function(*p)) for p in (low, high)]
                slope = (ends[1] - ends[0]) / (2.0 * h)
                # At a kink of the law (end of the trained speeds) the derivative does not exist.
                if not np.isclose(exact[i], slope, rtol=1e-4, atol=1e-5):
                    third = (ends[0] + ends[1] - 2.0 * float(function.function(*point))) / h
                    assert abs(third) > 1e-4, (function.name, point, i, exact[i], slope)


def test_what_stops_within_a_distance_does(model: Model) -> None:
    functions = {m.name: m for m in functions_of(model)}
    rng = np.random.default_rng(3)
    for _ in range(300):
        clear, grade = rng.uniform(1.0, 20.0), rng.uniform(-0.2, 0.2)
        for end in ("", *(f"_{name}" for name in model.braking.terrain)):
            bound = float(functions[f"speed_bound{end}"].function(clear, grade, 0.0))
            if not model.braking.speed_range[0] <= bound <= model.braking.speed_range[1]:
                continue
            needed = float(functions[f"stopping_distance{end}"].function(bound, grade, 0.0))
            assert needed <= clear + 1e-9


def test_a_part_of_the_brakes_slows_by_its_part() -> None:
    data = tomllib.loads(find_model("atv").read_text())
    full = read_model(find_model("atv"))
    data["braking"] |= {"level": 0.8, "dead_band": 0.1, "saturation": 0.9}
    part, rolls = model_from_dict(data, "test"), full.terrain.rolling_while_braking
    hot, less = (
        float(next(f for f in functions_of(m) if f.name == "force_ratio").function(2.0, 0.0, 0.0))
        for m in (full, part)
    )
    share = (0.8 - 0.1) / (0.9 - 0.1)
    assert less == pytest.approx(share * (hot - rolls) + rolls, rel=1e-12)


def test_no_stop_is_known_at_a_place_that_is_not() -> None:
    patch = {"delta": -0.1, "x": 1.0, "y": 2.0, "radius": 3.0}
    data = tomllib.loads(find_model("atv").read_text())
    data["effect"] = [{"name": "surface_patch", "parameters": patch}]
    functions = {f.name: f.function for f in functions_of(model_from_dict(data, "test"))}
    for x, y, stops in ((1.0, 2.0, True), (np.nan, 2.0, False), (1.0, np.nan, False)):
        force = float(functions["ground_force"](0.0, 0.0, x, y, 0.0))
        assert (force == patch["delta"]) == stops
        assert np.isfinite(float(functions["stopping_distance"](2.0, 0.0, force))) == stops
        assert (float(functions["speed_bound"](2.0, 0.0, force)) > 0.0) == stops


def test_casadi_reads_it_again(model: Model, tmp_path: Path) -> None:
    functions = functions_of(model)
    write_functions(functions, tmp_path / "model.casadi")
    file = ca.FileDeserializer(str(tmp_path / "model.casadi"))
    again = {str(f.name()): f for f in (file.unpack() for _ in range(file.unpack()))}
    assert set(again) == {name for m in functions for name in (m.name, f"d_{m.name}")}
    assert float(again["stopping_distance"](2.0, 0.1, 0.0)) == float(
        next(m for m in functions if m.name == "stopping_distance").function(2.0, 0.1, 0.0)
    )


def complaints(schema: dict[str, Any], value: Any, where: str = "") -> list[str]:
    """A validator of just what the schema uses."""
    if "enum" in schema:
        return [] if value in schema["enum"] else [where]
    kinds = {"object": dict, "array": list, "string": str, "number": (int, float)}
    kinds |= {"integer": int, "boolean": bool}
    if not isinstance(value, kinds[schema["type"]]):
        return [where]
    if schema["type"] == "array":
        return [c for item in value for c in complaints(schema["items"], item, where)]
    if schema["type"] == "number":
        wrong = value <= schema.get("exclusiveMinimum", -np.inf)
        wrong |= value < schema.get("minimum", -np.inf) or value > schema.get("maximum", np.inf)
        return [where] if wrong else []
    if schema["type"] != "object":
        return []
    known, wrong_keys = schema.get("properties", {}), []
    for key, item in value.items():
        inside = known.get(key, schema.get("additionalProperties"))
        wrong_keys += complaints(inside, item, f"{where}.{key}") if inside else [f"{where}.{key}"]
    return wrong_keys + [f"{where}.{key}" for key in schema.get("required", []) if key not in value]


def test_the_schema_is_that_of_model_files() -> None:
    schema = json.loads(here("export", "--json-schema").stdout)
    assert schema == model_schema()
    for path in shipped_models().values():
        data = tomllib.loads(path.read_text())
        assert complaints(schema, data) == []
        data["braking"]["boost"], data["vehicle"]["mass"] = 1.0, -3.0
        del data["limits"]["jerk"]
        assert sorted(complaints(schema, data)) == [
            ".braking.boost",
            ".limits.jerk",
            ".vehicle.mass",
        ]


def test_command_writes_and_lists_its_files(tmp_path: Path) -> None:
    done = here("export", "atv", "--c", tmp_path / "c", "--casadi", tmp_path / "f", "--json")
    assert done.returncode == 0, done.stderr
    exported = json.loads(done.stdout)
    assert all(Path(file).exists() for file in exported["files"])
    assert "stopping_distance" in {f["name"] for f in exported["functions"]}
    listed = json.loads(here("export", "atv", "--json").stdout)
    assert (listed["functions"], listed["files"]) == (exported["functions"], [])
    one_line_of(here("export"), "expected a model file")
    one_line_of(here("export", "atv", "--casadi", tmp_path), "expected a writable file")
    for margin in ("--quantile", "--resolution", "--height-std"):
        one_line_of(here("export", "atv", "--c", tmp_path, margin, "0.9"), "--cpp: expected with")
    assert here("export", "nobody", "--c", tmp_path).returncode == 2


@pytest.mark.skipif(shutil.which("g++") is None, reason="no g++")
def test_every_name_is_one_in_c(tmp_path: Path) -> None:
    atv = read_model(find_model("atv"))
    names = {
        "class": "model_class",
        "2fast": "model_2fast",
        "Ätv (v2) */": "Atv_v2_",
        "泥": "model",
    }
    wet = {"wet grass": SurfaceBraking(b_b=0.3), "Wiese_ü": SurfaceBraking(b_b=0.35)}
    for name, written in names.items():
        model = replace(atv, name=name, braking=replace(atv.braking, terrain=wet))
        files = write_c(model, functions_of(model), tmp_path)
        header = write_cpp(model, tmp_path, resolution=0.1, height_std=0.0, quantile=0.999)
        assert [file.name.removesuffix(".hpp") for file in (files[0], header)] == [
            f"{written}.c",
            written,
        ]
        includes = "".join(f'#include "{file.name}"\n' for file in (*files[1:], header))
        check = ["g++", "-std=c++20", "-fsyntax-only", f"-I{CORE}", f"-I{tmp_path}", "-xc++", "-"]
        subprocess.run(check, input=includes, text=True, check=True)
    assert "stopping_distance_wet_grass" in files[1].read_text()
    for surfaces in ({"a b": wet["wet grass"], "a-b": wet["wet grass"]}, {"泥": wet["wet grass"]}):
        with pytest.raises(ParameterError, match="names that differ in letters"):
            functions_of(replace(atv, braking=replace(atv.braking, terrain=surfaces)))


def test_one_call_writes_every_kind(tmp_path: Path) -> None:
    kinds = ("--cpp", tmp_path, "--c", tmp_path, "--casadi", tmp_path / "atv.casadi")
    done = here("export", "atv", *kinds, "--resolution", "0.1", "--height-std", "0", "--json")
    exported = json.loads(done.stdout)
    names = {"atv.hpp", "atv.casadi", "atv.c", "atv.h", "atv_model.h"}
    assert {Path(file).name for file in exported["files"]} == names
    assert {path.name for path in tmp_path.iterdir()} == names
    assert exported["functions"]
    assert exported["cmake"]


def test_code_that_casadi_cut_off_replaces_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    old = tmp_path / "atv.c"
    old.write_text("old")
    generate = ca.CodeGenerator.generate

    def on_a_full_disk(generator: Any, folder: str) -> None:
        generate(generator, folder)
        code = Path(folder) / "atv.c"
        code.write_text(code.read_text()[:40960])

    monkeypatch.setattr(ca.CodeGenerator, "generate", on_a_full_disk)
    with pytest.raises(InputError, match="expected room for a copy in"):
        write_c(MODELS["atv"], functions_of(MODELS["atv"]), tmp_path)
    assert (old.read_text(), [path.name for path in tmp_path.iterdir()]) == ("old", ["atv.c"])


def test_speeds_for_distances_are_tested_below_their_limit() -> None:
    functions = functions_of(read_model(find_model("atv")))
    bound = next(f for f in functions if f.name == "speed_bound")
    points = sample_inputs(bound, 8, np.random.default_rng(0))
    assert len({float(bound.function(*point)) for point in points}) > 4
