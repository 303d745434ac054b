"""Additions of the site to the pages: decisions in the navigation, equations as MathML.

Equations are written as TeX between dollars and become MathML here, so that a reader needs neither
a script nor a network.
"""

from __future__ import annotations

import html
import re
from pathlib import Path
from typing import Any

from latex2mathml.converter import convert
from mkdocs.structure.files import Files

_INLINE = re.compile(r'<span class="arithmatex">\\\((?P<tex>.*?)\\\)</span>', re.DOTALL)
_BLOCK = re.compile(r'<div class="arithmatex">\s*\\\[(?P<tex>.*?)\\\]\s*</div>', re.DOTALL)


def on_config(config: Any) -> Any:
    """Put all decisions into the navigation, in their order."""
    folder = Path(config["docs_dir"]) / "decisions"
    decisions = [f"decisions/{path.name}" for path in sorted(folder.glob("*.md"))]
    if not any("Decisions" in entry for entry in config["nav"] if isinstance(entry, dict)):
        config["nav"].append({"Decisions": decisions})
    return config


def on_page_content(content: str, page: Any, config: Any, files: Files) -> str:
    """TeX to MathML."""
    content = _BLOCK.sub(lambda m: convert(html.unescape(m["tex"]), display="block"), content)
    return _INLINE.sub(lambda m: convert(html.unescape(m["tex"])), content)
