"""Counts with their noun, for tables, pages and messages."""

from __future__ import annotations


def plural(count: int, noun: str) -> str:
    """Format a count with its noun, e.g. "1 candidate", "3 candidates", "2 batches"."""
    ending = "" if count == 1 else "es" if noun.endswith(("s", "ch")) else "s"
    return f"{count} {noun}{ending}"
