"""Compiled code on disk that belongs to other sources is thrown away before anything is loaded.

numba looks at the file of a kernel alone. It does not see that a law, a structure or another pass
that was compiled into the kernel has changed since, and would go on with the old one: the plan
would not be the one that the source says.
"""

from __future__ import annotations

import hashlib
from pathlib import Path

_COMPILED_IN = ("laws", "effects")
"""Rooms of `models` whose functions become part of kernels."""


def forget_stale_kernels(planner: Path, models: Path) -> bool:
    """Delete compiled kernels that were made of other sources than those that are here now.

    Args:
        planner, models: folders of the two packages. Where they cannot be written to, nothing is
            done: what numba keeps elsewhere was installed as a whole.

    Returns:
        Whether compiled kernels were deleted.
    """
    digest, note = digest_of(planner, models), planner / "__pycache__" / "kernels.digest"
    try:
        if note.is_file() and note.read_text() == digest:
            return False
        kinds = ("*.nbi", "*.nbc", "compiled-*")
        stale = [f for kind in kinds for f in planner.rglob(f"__pycache__/{kind}")]
        for file in stale:
            file.unlink(missing_ok=True)
        note.parent.mkdir(exist_ok=True)
        note.write_text(digest)
    except OSError:
        return False
    return bool(stale)


def digest_of(planner: Path, models: Path) -> str:
    """Of all sources that compiled kernels are made of, in folders of the two packages."""
    sources = sorted(planner.rglob("*.py"))
    sources += [f for room in _COMPILED_IN for f in sorted((models / room).glob("*.py"))]
    digest = hashlib.sha256()
    for source in (*sources, models / "quantity.py"):
        digest.update(source.name.encode() + source.read_bytes())
    return digest.hexdigest()
