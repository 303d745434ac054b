"""Names, texts and lengths in every Python file, parsed once for all tests that read them."""

from __future__ import annotations

import ast
from dataclasses import dataclass
from functools import cache
from pathlib import Path

from tests.world.shared import once

ROOT = Path(__file__).parents[2]
FOLDERS = ("models", "planner", "services", "slopewise", "benchmarks", "tests", "docs", "examples")
DOCUMENTED = (ast.Module, ast.ClassDef, ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass
class Source:
    """Names that a file defines with their first line; scope, first and last line of each text."""

    names: dict[str, int]
    texts: list[tuple[str, int, int, str]]
    code_lines: list[int]
    """Of each function, without docstring and blank lines."""


def defined_name(node: ast.AST) -> str | None:
    if isinstance(node, ast.arg):
        return node.arg
    if isinstance(node, ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
        return node.name
    if isinstance(getattr(node, "ctx", None), ast.Store):
        return getattr(node, "id", None) or getattr(node, "attr", None)
    return None


def code_lines(node: ast.FunctionDef | ast.AsyncFunctionDef, text: list[str]) -> int:
    body = node.body[1:] if ast.get_docstring(node, clean=False) is not None else node.body
    last = body[-1].end_lineno if body else 0
    return sum(1 for line in text[body[0].lineno - 1 : last] if line.strip()) if body else 0


def source_of(text: str) -> Source:
    source, lines = Source({}, [], []), text.splitlines()
    for node in ast.walk(ast.parse(text)):
        if name := defined_name(node):
            source.names.setdefault(name, getattr(node, "lineno", 1))
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef):
            source.code_lines.append(code_lines(node, lines))
        if isinstance(node, DOCUMENTED) and (doc := ast.get_docstring(node, clean=False)):
            first = node.body[0]
            end = first.end_lineno or first.lineno
            source.texts.append(("first_line", first.lineno, end, doc.strip().split("\n")[0]))
        if isinstance(node, ast.Constant) and isinstance(node.value, str) and " " in node.value:
            end = node.end_lineno or node.lineno
            for i, line in enumerate(node.value.split("\n")):
                source.texts.append(("prose", min(node.lineno + i, end), end, line))
    return source


@cache
def sources() -> dict[str, Source]:
    """By path from the root; without links of the namespace package."""
    files = [file for folder in FOLDERS for file in sorted((ROOT / folder).rglob("*.py"))]
    return once(
        "sources",
        lambda: {
            file.relative_to(ROOT).as_posix(): source_of(file.read_text("utf-8")) for file in files
        },
    )
