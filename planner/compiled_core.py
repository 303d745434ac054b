"""The compiled core, rejected where it is no longer made from what plans have to follow."""

from __future__ import annotations

from pathlib import Path

from slopewise.models.effects.registry import MOTION_LAWS
from slopewise.models.errors import SlopewiseError
from slopewise.planner.core_sources import digest_of_core

__all__ = ["CoreError", "core"]

_SOURCES = Path(__file__).parent / "core"
_REMEDY = "run `make core` in the repository, or install slopewise again"


class CoreError(SlopewiseError, ImportError):
    """The compiled core cannot be used."""


try:
    import slopewise.planner._core as core
except ModuleNotFoundError:
    raise CoreError(f"the compiled core of slopewise is missing: {_REMEDY}") from None
except ImportError as error:
    raise CoreError(f"the compiled core of slopewise cannot be loaded: {error}") from None

if _SOURCES.is_dir() and digest_of_core(_SOURCES) != core.DIGEST:
    raise CoreError(f"the compiled core of slopewise is older than its sources: {_REMEDY}")
if tuple(core.MOTION_LAWS.split()) != MOTION_LAWS:
    raise CoreError(
        "the compiled core of slopewise lacks motion effects, which plans would ignore: run "
        "`python planner/core/generate_laws.py`, then `make core`"
    )
