"""A model as numbers of the planner's core, for C++ programs: one header, without a reader."""

from __future__ import annotations

import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import numpy as np

from slopewise.models.elevation_map import ElevationMap
from slopewise.models.errors import ParameterError
from slopewise.models.parameters import Model
from slopewise.planner.ground.braking_ground import stop_errors
from slopewise.planner.ground.height_grid import tyre_footprint
from slopewise.planner.ground.sight import within_sight
from slopewise.planner.ground.surfaces import surface_cache_of
from slopewise.planner.ground.uncertainty import Uncertainty, survived_errors
from slopewise.planner.planning_limits import planning_limits
from slopewise.planner.settings import PlannerSettings
from slopewise.planner.swept.sentences import LIMITING_OF_KIND, Kind
from slopewise.planner.swept.sizes import swept_sizes
from slopewise.planner.verify.ground import body_sizes, ground_limits
from slopewise.planner.verify.terms import terms_of
from slopewise.services.export.identifier import identifier
from slopewise.services.io.files import write_atomic

CMAKE_FOLDER = Path(__file__).parents[2] / "planner" / "core"
"""With the package file that CMake looks for: ``-Dslopewise_DIR=`` this folder."""


def write_cpp(
    model: Model, folder: Path, *, resolution: float, height_std: float, quantile: float
) -> Path:
    """Write NAME.hpp with a ``slopewise::PlanningModel`` named NAME, that of plans at a quantile.

    For maps with cells of the resolution [m], whose heights have that error [m]. ParameterError:
    the model has effects, whose place and time the core alone does not know.
    """
    if model.effect:
        names = ", ".join(effect.name for effect in model.effect)
        raise ParameterError("effect", f"a model without effects for C++, got {names}")
    flat = ElevationMap(
        elevation=np.zeros((2, 2)), resolution=resolution, origin=(0.0, 0.0), height_std=height_std
    )
    uncertainty = Uncertainty(quantile=quantile)
    name = identifier(model.name)
    planned = within_sight(uncertainty.cautious(model), flat, PlannerSettings().unseen_steps)
    numbers = _numbers(planned, flat, uncertainty)
    members = "".join(f"  .{key} = {_text(value)},\n" for key, value in numbers)
    text = (
        f"// The vehicle {model.name!r} for maps of {resolution:g} m whose heights are known to\n"
        f"// {height_std:g} m, at the quantile {quantile:g}: written by slopewise export --cpp. SI."
        "\n#pragma once\n\n#include <limits>\n\n#include <slopewise/core.hpp>\n\n"
        f"inline const slopewise::PlanningModel {name}{{\n{members}}};\n"
    )
    folder.mkdir(parents=True, exist_ok=True)
    file = folder / f"{name}.hpp"
    write_atomic(file, text.encode())
    return file


def _numbers(
    model: Model, flat: ElevationMap, uncertainty: Uncertainty
) -> Iterable[tuple[str, Any]]:
    """Members of a PlanningModel in their order."""
    vehicle, braking = model.vehicle, model.braking
    errors = stop_errors(model, uncertainty, flat.height_std)
    known = surface_cache_of(model, flat.class_names, uncertainty)
    terms = terms_of(model, known.motion, errors, all_loads=True)
    return (
        ("resolution", flat.resolution),
        ("spacing", PlannerSettings().spacing_on(flat.resolution, vehicle)),
        ("front", model.front),
        ("jerk", model.limits.jerk),
        ("ride_frequency", vehicle.ride_frequency),
        ("ride_damping", vehicle.ride_damping),
        ("extrapolation_margin", braking.extrapolation_margin if braking.extrapolate else -1.0),
        ("slides", known.slides),
        ("limits", planning_limits(model)),
        ("envelope", swept_sizes(vehicle, flat.resolution)),
        ("tyre", tyre_footprint(vehicle, flat.resolution)),
        ("body", body_sizes(model)),
        ("weighed", terms.body),
        ("steering", terms.steering),
        ("ground", ground_limits(model, survived_errors(model, uncertainty))),
        ("errors", errors),
        ("motion", known.motion),
        ("code_of_hazard", [int(LIMITING_OF_KIND.get(kind, 0)) for kind in Kind]),
        ("surfaces", known.table.tolist()),
        ("surface_bits", int(known.class_bits[0])),
        ("hull", [] if known.hull is None else known.hull.reshape(-1, 2).tolist()),
        ("uncertainty", [] if known.margins is None else known.margins.ravel().tolist()),
    )


def _text(value: Any) -> str:
    """An initialiser of C++; named tuples name their members, which the compiler compares."""
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, int):
        return str(value)
    if isinstance(value, float):
        if math.isinf(value):
            sign = "-" if value < 0.0 else ""
            return f"{sign}std::numeric_limits<double>::infinity()"
        return f"{value:.17g}"
    if hasattr(value, "_asdict"):
        named = (f".{key} = {_text(part)}" for key, part in value._asdict().items())
        return f"{{{', '.join(named)}}}"
    return f"{{{', '.join(_text(part) for part in value)}}}"
