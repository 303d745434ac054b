"""`slopewise export`: a model as CasADi functions, C code, or the schema of its file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, NamedTuple

from slopewise.models.errors import InputError
from slopewise.services.io.model_file import find_model, read_model


class ExportResult(NamedTuple):
    """What was written, and the functions in it: name, inputs, output."""

    model: str
    files: list[Path]
    functions: list[dict[str, Any]]


def schema() -> str:
    """The JSON schema of model files."""
    from slopewise.services.export.schema import model_schema

    return json.dumps(model_schema(), indent=1)


def run(model_file: str, casadi: Path | None, c_folder: Path | None) -> ExportResult:
    """Write what is wanted of a model; if that is nothing, only say what there is.

    Raises:
        InputError: no model, or one that cannot be read.
    """
    if not model_file:
        raise InputError("export", "M.toml", "expected a model file, or --json-schema")
    model = read_model(find_model(model_file))
    from slopewise.services.export.c_code import write_c
    from slopewise.services.export.functions import functions_of, write_functions

    made, files = functions_of(model), []
    if casadi is not None:
        write_functions(made, casadi)
        files.append(casadi)
    if c_folder is not None:
        files += write_c(model, made, c_folder)
    told = [
        {"name": f.name, "inputs": dict(f.inputs), "output": dict([f.output]), "is": f.meaning}
        for f in made
    ]
    return ExportResult(model.name, files, told)


def as_json(result: ExportResult) -> dict[str, Any]:
    """For machines."""
    return {
        "model": result.model,
        "files": [str(file) for file in result.files],
        "functions": result.functions,
    }


def show(result: ExportResult, console: Any) -> None:
    """For people."""
    from rich.table import Table

    table = Table("function", "takes", "gives", "is")
    for told in result.functions:
        (unit,) = told["output"].values()
        table.add_row(told["name"], ", ".join(told["inputs"]), unit, told["is"])
    console.print(table)
