"""The packages that come with slopewise must be its own, not others of the same name."""

from __future__ import annotations

import sys
from importlib.util import find_spec
from pathlib import Path

_OWN = ("models", "planner", "services")


def check_own_packages() -> None:
    """Refuse to go on where Python would import a foreign package in the place of an own one.

    Raises:
        ImportError: names the package and the file that Python finds instead.
    """
    top = Path(__file__).resolve().parents[1]
    for name in _OWN:
        found = _file_of(name)
        if found is None or found.resolve().parent.parent != top:
            where = "Python finds none" if found is None else f"Python finds {found} first"
            raise ImportError(
                f"slopewise needs its own package {name!r} from {top}, but {where}: "
                "rename that one, or take its folder off sys.path"
            )


def _file_of(name: str) -> Path | None:
    """The file that an import would run; the folder of a package that has none."""
    loaded = sys.modules.get(name)
    if loaded is not None:
        file = getattr(loaded, "__file__", None)
        if file is not None:
            return Path(file)
        folders = list(getattr(loaded, "__path__", []))
    else:
        spec = find_spec(name)
        if spec is not None and spec.origin is not None:
            return Path(spec.origin)
        folders = list(spec.submodule_search_locations or []) if spec is not None else []
    return Path(folders[0]) / "__init__.py" if folders else None
