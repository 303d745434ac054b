"""Candidate paths as GeoJSON LineStrings, in map coordinates [m] and not in degrees."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.candidate_path import CandidatePath
from slopewise.services.io.files import fault, faults_of, read_text, reason, shown

_DEGREES = ("CRS84", "4326", "4258", "4269")


def read_geojson_paths(path: Path) -> list[CandidatePath]:
    """All LineStrings of a file; each part of a MultiLineString is a separate candidate.

    A candidate is called by the property `candidate` or `name`, else by the feature's id, else by
    its number from 0. The property `speed_limit` [m/s] holds for all of a feature.
    """
    try:
        data = json.loads(read_text(path), parse_constant=float)
    except json.JSONDecodeError as error:
        where = f"line {error.lineno}, column {error.colno}"
        raise fault(path, where, f"expected JSON, got: {error.msg}") from None
    except (ValueError, RecursionError) as error:
        raise fault(path, "", f"expected JSON, got: {reason(error)}") from None
    candidates: dict[str, CandidatePath] = {}
    for where, feature in _features(path, data):
        for candidate in _candidates(path, where, len(candidates), feature):
            if candidate.name in candidates:
                expected = f"expected a separate name, got {candidate.name!r} again"
                raise fault(path, where, expected)
            candidates[candidate.name] = candidate
    if not candidates:
        raise fault(path, "features", "expected at least one LineString, got none")
    return list(candidates.values())


def _features(path: Path, data: Any) -> Iterator[tuple[str, dict[str, Any]]]:
    """Features with the place where they stand; a bare geometry is a feature without properties."""
    kind = data.get("type") if isinstance(data, dict) else None
    if not isinstance(kind, str):
        raise fault(path, "type", f"expected a GeoJSON object, got {shown(kind or data)}")
    crs = json.dumps(data.get("crs"))
    if any(name in crs for name in _DEGREES):
        raise fault(path, "crs", "expected map coordinates in metres, got degrees")
    if kind == "Feature":
        yield "feature", data
    elif kind != "FeatureCollection":
        yield "geometry", {"geometry": data}
    else:
        features = data.get("features")
        if not isinstance(features, list):
            raise fault(path, "features", f"expected a list, got {shown(features)}")
        for index, feature in enumerate(features):
            if not isinstance(feature, dict):
                raise fault(path, f"features[{index}]", f"expected a table, got {shown(feature)}")
            yield f"features[{index}]", feature


def _candidates(
    path: Path, where: str, number: int, feature: dict[str, Any]
) -> Iterator[CandidatePath]:
    geometry, properties = feature.get("geometry"), feature.get("properties") or {}
    if not isinstance(geometry, dict) or not isinstance(properties, dict):
        raise fault(path, where, "expected a geometry and properties, got something else")
    named = (properties.get("candidate"), properties.get("name"), feature.get("id"), number)
    name = next(str(given) for given in named if given not in (None, ""))
    limit = properties.get("speed_limit")
    if limit is not None and not (_finite(limit) and limit >= 0.0):
        field = f"{where}.properties.speed_limit"
        raise fault(path, field, f"expected a speed >= 0 [m/s], got {shown(limit)}")
    kind, coordinates = geometry.get("type"), geometry.get("coordinates")
    if kind not in ("LineString", "MultiLineString"):
        expected = f"expected LineString or MultiLineString, got {shown(kind)}"
        raise fault(path, f"{where}.geometry.type", expected)
    lines = coordinates if kind == "MultiLineString" else [coordinates]
    if not isinstance(lines, list):
        expected = f"expected a list of lines, got {shown(lines)}"
        raise fault(path, f"{where}.geometry.coordinates", expected)
    for index, line in enumerate(lines):
        part = f"{name}-{index + 1}" if len(lines) > 1 else name
        yield _candidate(path, f"{where}, candidate {part}", part, line, limit)


def _candidate(path: Path, where: str, name: str, line: Any, limit: float | None) -> CandidatePath:
    if not isinstance(line, list) or len(line) < 2:
        got = f"{len(line)}" if isinstance(line, list) else shown(line)
        raise fault(path, where, f"expected at least 2 points, got {got}")
    for index, point in enumerate(line, 1):
        if not (isinstance(point, list) and len(point) >= 2 and all(map(_finite, point[:2]))):
            got = json.dumps(point)[:60]
            expected = f"expected finite coordinates [x, y] in metres, got {got}"
            raise fault(path, f"{where}, point {index}", expected)
    points = np.array([point[:2] for point in line], np.float64)
    limits = None if limit is None else np.full(len(points), float(limit))
    with faults_of(path, f"{where}, "):
        return CandidatePath(name, points, limits)


def _finite(value: object) -> bool:
    if not isinstance(value, int | float) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False
