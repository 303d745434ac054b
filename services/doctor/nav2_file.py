"""Parameters of Nav2 and of bases, from the YAML files that ROS 2 nodes are started with."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from slopewise.models.errors import InputError
from slopewise.services.doctor.robot_facts import Nav2Facts
from slopewise.services.io.files import fault, read_text, reason

_PARAMETERS = "ros__parameters"


def read_nav2(paths: list[Path]) -> Nav2Facts:
    """Parameters of all nodes in some files; later files add to a node."""
    try:
        from ruamel.yaml import YAML
        from ruamel.yaml.error import YAMLError
    except ImportError:
        hint = "expected ruamel.yaml for parameter files: pip install '.[ros]' in a clone"
        raise InputError("ruamel.yaml", "", hint) from None
    nodes: dict[str, dict[str, Any]] = {}
    for path in paths:
        try:
            tables = dict(_nodes(YAML(typ="safe").load(read_text(path)), ""))
        except (YAMLError, RecursionError) as error:
            raise fault(path, "", f"expected YAML, got: {reason(error)}") from None
        if not tables:
            raise fault(path, _PARAMETERS, "expected parameters of nodes, got none")
        for name, table in tables.items():
            nodes.setdefault(name, {}).update(table)
    return Nav2Facts(nodes)


def _nodes(data: Any, name: str) -> list[tuple[str, Mapping[str, Any]]]:
    if not isinstance(data, Mapping):
        return []
    nodes: list[tuple[str, Mapping[str, Any]]] = []
    for key, value in data.items():
        if key == _PARAMETERS and isinstance(value, Mapping):
            nodes.append((name, _nested(value)))
        else:
            nodes += _nodes(value, str(key).strip("/").rpartition("/")[2])
    return nodes


def _nested(table: Mapping[str, Any]) -> dict[str, Any]:
    """Parameters with keys such as ``FollowPath.vx_max`` as nested tables."""
    nested: dict[str, Any] = {}
    for key, value in table.items():
        *outer, last = str(key).split(".")
        inside = nested
        for part in outer:
            inside = inside.setdefault(part, {})
        value = _nested(value) if isinstance(value, Mapping) else value
        if isinstance(value, dict) and isinstance(inside.get(last), dict):
            inside[last].update(value)
        else:
            inside[last] = value
    return nested
