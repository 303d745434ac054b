"""What the site adds to the pages: reference made from the schemas, decisions, equations as MathML.

Equations are written as TeX between dollars and become MathML here, so that a reader needs neither
a script nor a network.
"""

from __future__ import annotations

import html
import re
import sys
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import File, Files

sys.path.insert(0, str(Path(__file__).parent))

import commands
import parameters

_INLINE = re.compile(r'<span class="arithmatex">\\\((?P<tex>.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(?P<tex>.*?)\\\]\s*</div>', re.DOTALL)
_PAGES = {
    "reference/commands.md": commands.page,
    "reference/model.md": parameters.model_page,
    "reference/service.md": parameters.service_page,
    "reference/messages.md": parameters.messages_page,
    "reference/edge.md": parameters.edge_page,
}


def on_config(config: Any) -> Any:
    """Put all decisions into the navigation, in their order."""
    folder = Path(config["docs_dir"]) / "decisions"
    decisions = [f"decisions/{path.name}" for path in sorted(folder.glob("*.md"))]
    if not any("Decisions" in entry for entry in config["nav"] if isinstance(entry, dict)):
        config["nav"].append({"Decisions": decisions})
    return config


def on_files(files: Files, config: Any) -> Files:
    """Add the pages that are made, not written."""
    for name, make in _PAGES.items():
        files.append(File.generated(config, name, content=make()))
    return files


def on_page_content(content: str, page: Any, config: Any, files: Files) -> str:
    """TeX to MathML."""
    content = _BLOCK.sub(lambda m: convert(html.unescape(m["tex"]), display="block"), content)
    return _INLINE.sub(lambda m: convert(html.unescape(m["tex"])), content)
