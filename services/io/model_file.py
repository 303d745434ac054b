"""Model files: one vehicle on its ground, as TOML. Strict; SI units and radians throughout."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from slopewise.models.effects import registry
from slopewise.models.parameters import Model
from slopewise.models.plausibility import check_plausible
from slopewise.models.surface_names import MAX_CLASSES
from slopewise.services.io.decode import decode_table, dotted, encode_table
from slopewise.services.io.files import (
    fault,
    faults_of,
    find_shipped,
    read_toml,
    shipped_files,
    write_atomic,
)

_MAX_SURFACES = MAX_CLASSES - 1  # one class of a map is the base


def read_model(path: Path) -> Model:
    return model_from_dict(read_toml(path), str(path))


def write_model(model: Model, path: Path, objections: Sequence[str] = ()) -> None:
    """Write a model, all or nothing; :func:`read_model` gives the same model again.

    `objections`: reasons not to plan with it, as comments on top.
    """
    with faults_of(path):
        check_plausible(model_to_dict(model))
    comments = [f"# rejected, do not plan with it: {objection}\n" for objection in objections]
    write_atomic(path, "".join(comments).encode() + _written(model))


def model_sha256(model: Model) -> str:
    """SHA-256 of the file that :func:`write_model` writes of a model, as `sha256sum` prints it."""
    return hashlib.sha256(_written(model)).hexdigest()


def _written(model: Model) -> bytes:
    import tomli_w

    return tomli_w.dumps(model_to_dict(model)).encode()


def model_from_dict(data: object, source: str) -> Model:
    """A model from the tables of a file or message, as a TOML or JSON reader gives them."""
    model = decode_table(Model, data, source)
    _check_surfaces(model, source)
    for index, effect in enumerate(model.effect):
        with faults_of(source, f"effect[{index}]."):
            registry.validate(effect)
            registry.motion(model.effect[: index + 1])
    assert isinstance(data, Mapping)
    with faults_of(source):
        check_plausible(data)
    return model


def _check_surfaces(model: Model, source: str) -> None:
    """Names and numbers by which maps call the surfaces must be usable and unique."""
    where = "braking.terrain"
    tables = model.braking.terrain
    if len(tables) > _MAX_SURFACES:
        raise fault(source, where, f"expected at most {_MAX_SURFACES} surfaces, got {len(tables)}")
    owners: dict[int, str] = {}
    for name, table in tables.items():
        if not name or name.startswith("#"):
            expected = "expected a name that is not empty and begins without #"
            raise fault(source, dotted(where, name), expected)
        if table.class_id is None:
            continue
        owner = owners.setdefault(table.class_id, name)
        if owner != name:
            field = f"{dotted(where, name)}.class_id"
            raise fault(
                source, field, f"expected a number that no other surface has, got that of {owner}"
            )


def model_to_dict(model: Model) -> dict[str, Any]:
    """Tables of plain values as TOML holds them, without absent or empty ones."""
    return encode_table(model)


def shipped_models() -> dict[str, Path]:
    """Vehicles that come with the package: name -> file."""
    return shipped_files("vehicles")


def find_model(name_or_path: str | Path) -> Path:
    """The model file a user means: an existing file, else a vehicle that comes with the package."""
    return find_shipped(name_or_path, "vehicles", "model")
