"""The reference pages, written into docs/reference: a reader on a code host has no site.

`python docs/site/reference.py` rewrites them; a test compares them with what the schemas, the
registries and the command line say.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

import commands
import laws
import parameters

FOLDER = Path(__file__).parents[1] / "reference"
PAGES: dict[str, Callable[[], str]] = {
    "commands.md": commands.page,
    "model.md": parameters.model_page,
    "bounds.md": laws.bounds_page,
    "effects.md": laws.effects_page,
    "service.md": parameters.service_page,
    "messages.md": parameters.messages_page,
    "edge.md": parameters.edge_page,
}
_NOTE = "<!-- written by docs/site/reference.py -->\n\n"


def page(name: str) -> str:
    """Text of one page, as stored."""
    return _NOTE + PAGES[name]().rstrip() + "\n"


def main() -> None:
    """Write all of them."""
    FOLDER.mkdir(exist_ok=True)
    for name in PAGES:
        (FOLDER / name).write_text(page(name))


if __name__ == "__main__":
    main()
