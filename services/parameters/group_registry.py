"""Registry of estimators and groups of parameters other than braking and findings.

A new one is a class of :class:`slopewise.services.parameters.parameter_group.ParameterGroups` in a
separate file and a line here: it receives drive samples, is stored, restored, published, set by
operators, rolled back, and planned with.
"""

from __future__ import annotations

from collections.abc import Callable

from slopewise.models.parameters import Model
from slopewise.services.parameters.limits_group import LimitsGroup
from slopewise.services.parameters.parameter_group import ParameterGroups
from slopewise.services.parameters.terrain_group import TerrainGroup
from slopewise.services.settings.learning_settings import Learning

GROUPS: tuple[Callable[[Model, Learning], ParameterGroups], ...] = (TerrainGroup, LimitsGroup)
"""Created from the model file and the settings of learning; published in this order."""
