"""Surfaces of a model that each class of a map may be."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from slopewise.models.arrays import Bools
from slopewise.models.surface_names import NamedSurface, candidate_surfaces


def possible_surfaces(tables: Mapping[str, NamedSurface], class_names: Sequence[str]) -> Bools:
    """(C, R) which of R surfaces the C classes may be: the base, and the tables in their order."""
    names = ["", *tables]
    possible = np.zeros((len(class_names), len(names)), np.bool_)
    for row, name in zip(possible, class_names, strict=True):
        row[[names.index(surface) for surface in candidate_surfaces(tables, name)]] = True
    return possible
