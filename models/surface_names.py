"""Names of surfaces: which surface of a model a terrain class of a map is.

The one meaning of a class name, for planner, checker, guard and service:

- ``""`` is the base, the ground of `[braking]` itself;
- the name of a table `[braking.terrain.NAME]` is that surface, even where it has a number;
- ``#3`` is class number 3: the surface with ``class_id = 3``, else the third table of the file if
  it has no ``class_id``; ``#0`` is the base unless a surface has ``class_id = 0``;
- any other name is a surface that the model does not know: it may be each one that it knows.

A surface may turn out to be in one of its states (``state_of``): these count with it.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Protocol

MAX_CLASSES = 62
"""Classes that one map can distinguish: bits of an int64, with room for the sign and one more."""


class NamedSurface(Protocol):
    """A surface of a model.

    Attributes:
        class_id: number of its class in maps, None without.
        state_of: name of the surface that it is a state of, None if it is no state.
    """

    @property
    def class_id(self) -> int | None: ...
    @property
    def state_of(self) -> str | None: ...


def resolve_class(surfaces: Mapping[str, NamedSurface], name: str) -> str | None:
    """Name of the surface that a map's class is, "" for the base; None if the model lacks it.

    Args:
        surfaces: tables by name in the order of the model file, without the base.
        name: class name in the map.
    """
    if name == "" or name in surfaces:
        return name
    if not (name.startswith("#") and name[1:].isdecimal()):
        return None
    number, names = int(name[1:]), list(surfaces)
    for surface in names:
        if surfaces[surface].class_id == number:
            return surface
    if number == 0:
        return ""
    if number <= len(names) and surfaces[names[number - 1]].class_id is None:
        return names[number - 1]
    return None


def states_of(surfaces: Mapping[str, NamedSurface], surface: str) -> tuple[str, ...]:
    """Names of the states that a surface may turn out to be in; "" is the base."""
    return tuple(name for name, table in surfaces.items() if table.state_of == surface)


def candidate_surfaces(surfaces: Mapping[str, NamedSurface], name: str) -> tuple[str, ...]:
    """Names of all surfaces that a map's class may turn out to be, its own first; as above."""
    surface = resolve_class(surfaces, name)
    if surface is None:
        return ("", *surfaces)
    return (surface, *states_of(surfaces, surface))


def number_names(highest: int) -> tuple[str, ...]:
    """Names of the classes 0 … highest of a map that has numbers only; 0 is the base."""
    return ("", *(f"#{number}" for number in range(1, highest + 1)))
