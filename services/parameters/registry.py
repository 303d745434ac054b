"""Every estimator and group of parameters beside the brakes and the findings, in one place.

A new one is a class of :class:`slopewise.services.parameters.group.ParameterGroups` in a file of
its own and a line here: it is fed with drive samples, kept and restored, published, set by
operators, rolled back, and planned with.
"""

from __future__ import annotations

from collections.abc import Callable

from slopewise.models.parameters import Model
from slopewise.services.parameters.group import ParameterGroups
from slopewise.services.parameters.limits_group import LimitsGroup
from slopewise.services.parameters.terrain_group import TerrainGroup
from slopewise.services.settings.learning_settings import Learning

GROUPS: tuple[Callable[[Model, Learning], ParameterGroups], ...] = (TerrainGroup, LimitsGroup)
"""Made of the model file and the settings of learning; published in this order."""
