"""The JSON schema of model files, from the dataclasses that read them."""

from __future__ import annotations

import dataclasses
import types
from collections.abc import Mapping
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from slopewise.models.parameters import Model

_PLAIN: dict[Any, str] = {float: "number", int: "integer", str: "string", bool: "boolean"}


def model_schema() -> dict[str, Any]:
    """JSON schema (2020-12) of a model file; units and ranges as
    :func:`slopewise.models.quantity.quantity` has them.
    """
    head = {"$schema": "https://json-schema.org/draft/2020-12/schema", "title": "slopewise model"}
    return {**head, **_table(Model)}


def _table(kind: Any) -> dict[str, Any]:
    hints, properties, required = get_type_hints(kind), {}, []
    for field in dataclasses.fields(kind):
        entry = _of(hints[field.name])
        rule = field.metadata
        if "unit" in rule:
            entry["description"] = f"{rule['text']} [{rule['unit']}]"
            for key, keyword in (
                ("above", "exclusiveMinimum"),
                ("at_least", "minimum"),
                ("at_most", "maximum"),
            ):
                if np.isfinite(rule[key]):
                    entry[keyword] = rule[key]
        properties[field.name] = entry
        if field.default is field.default_factory is dataclasses.MISSING:
            required.append(field.name)
    return {
        "type": "object",
        "properties": properties,
        "required": required,
        "additionalProperties": False,
    }


def _of(kind: Any) -> dict[str, Any]:
    origin, inside = get_origin(kind), get_args(kind)
    if kind in _PLAIN:
        return {"type": _PLAIN[kind]}
    if dataclasses.is_dataclass(kind):
        return _table(kind)
    if origin is Literal:
        return {"enum": list(inside)}
    if origin in (Union, types.UnionType):
        kinds = [k for k in inside if k is not type(None)]
        return _of(kinds[-1])
    if origin in (dict, types.MappingProxyType, Mapping):
        return {"type": "object", "additionalProperties": _of(inside[1])}
    if origin is tuple and Ellipsis not in inside:
        return {"type": "array", "items": _of(inside[0]), "minItems": len(inside)}
    return {"type": "array", "items": _of(inside[0])}
