"""`slopewise export`: a model as CasADi functions, C code, or the schema of its file."""

from __future__ import annotations

import json
from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from slopewise.models.errors import InputError
from slopewise.services.cli import options
from slopewise.services.cli.command import echo, print_result
from slopewise.services.cli.options import argument, option, output
from slopewise.services.cli.tables import table

if TYPE_CHECKING:
    from slopewise.models.parameters import Model
    from slopewise.services.export.functions import ModelFunction


def export(
    model: Annotated[str, argument("Model file, or shipped vehicle.", "M.toml")] = "",
    casadi: Annotated[Path | None, output("All functions, for CasADi to read.", "FILE")] = None,
    c: Annotated[Path | None, option("C code, header, test vectors.", "FOLDER", "--c")] = None,
    cpp: Annotated[Path | None, option("Header for slopewise::core.", "FOLDER", "--cpp")] = None,
    resolution: Annotated[
        float | None, option("With --cpp: edge of a map's cell [m].", "M")
    ] = None,
    height_std: Annotated[
        float | None, option("With --cpp: error of a map's heights [m].", "M")
    ] = None,
    quantile: options.Quantile = 0.999,
    json_schema: Annotated[
        bool, option("Print the JSON schema of model files.", None, "--json-schema")
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Export a model: stopping distance, speed bound, loads, effects, with derivatives.

    [bold]Example[/]  slopewise export mine.toml --c generated
    """
    if json_schema:
        from slopewise.services.export.schema import model_schema

        echo(json.dumps(model_schema(), indent=1))
        return
    from slopewise.services.io.model_file import find_model, read_model

    if not model:
        raise InputError("export", "M.toml", "expected a model file, or --json-schema")
    _check_margins(cpp is not None, resolution, height_std, quantile)
    vehicle = read_model(find_model(model))
    summary: dict[str, Any] = {"model": vehicle.name}
    tables: list[Any] = []
    files: list[Path] = []
    if cpp is not None and resolution is not None and height_std is not None:
        from slopewise.services.export.cpp_model import CMAKE_FOLDER, write_cpp

        files.append(
            write_cpp(vehicle, cpp, resolution=resolution, height_std=height_std, quantile=quantile)
        )
        summary["cmake"] = str(CMAKE_FOLDER)
        tables.append(f"for CMake: -Dslopewise_DIR={CMAKE_FOLDER}")
    if casadi is not None or c is not None or cpp is None:
        functions = _write_functions(vehicle, casadi, c, files)
        summary["functions"] = [
            {"name": f.name, "inputs": dict(f.inputs), "output": dict([f.output]), "is": f.meaning}
            for f in functions
        ]
        tables += _table(functions)
    summary["files"] = [str(file) for file in files]
    print_result(as_json, summary, tables, *files)


def _check_margins(
    of_planner: bool, resolution: float | None, height_std: float | None, quantile: float
) -> None:
    """InputError if the planner lacks the error of its maps, or functions are given margins."""
    from slopewise.planner.ground.uncertainty import QUANTILE

    if of_planner and (resolution is None or height_std is None):
        raise InputError("export", "--cpp", "expected --resolution and --height-std with it")
    of_maps = resolution is not None or height_std is not None
    if not of_planner and (of_maps or quantile != QUANTILE):
        expected = "expected with --resolution, --height-std or --quantile: functions have none"
        raise InputError("export", "--cpp", expected)


def _write_functions(
    vehicle: Model, casadi: Path | None, c: Path | None, files: list[Path]
) -> list[ModelFunction]:
    """Functions of a model, written as CasADi reads them and as C; add the names of the files."""
    from slopewise.services.export.c_code import write_c
    from slopewise.services.export.functions import functions_of, write_functions

    functions = functions_of(vehicle)
    if casadi is not None:
        write_functions(functions, casadi)
        files.append(casadi)
    if c is not None:
        files += write_c(vehicle, functions, c)
    return functions


def _table(functions: list[ModelFunction]) -> Iterable[Any]:
    columns = ("function", "inputs", "unit", "meaning")
    cells = ((f.name, ", ".join(n for n, _ in f.inputs), f.output[1], f.meaning) for f in functions)
    return table(columns, cells, left=columns)
