"""Every numeric constant of the product states its unit and its reason.

A constant is explained by the docstring below it or below its group, a comment on its line or above
it, or an annotation that carries both (thresholds of the discrepancy workflow). Members of an enum
are names.
"""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
FOLDERS = ("models", "planner", "services", "slopewise", "benchmarks")


def is_numeric(node: ast.expr) -> bool:
    if isinstance(node, ast.Constant):
        return isinstance(node.value, int | float) and not isinstance(node.value, bool)
    if isinstance(node, ast.UnaryOp):
        return is_numeric(node.operand)
    if isinstance(node, ast.BinOp):
        return is_numeric(node.left) or is_numeric(node.right)
    if isinstance(node, ast.Tuple | ast.List):
        return bool(node.elts) and all(is_numeric(item) for item in node.elts)
    return isinstance(node, ast.Call) and any(is_numeric(argument) for argument in node.args)


def constant_names(statement: ast.stmt) -> list[str]:
    """Names of the numeric constants that a statement defines."""
    if isinstance(statement, ast.Assign):
        targets, value = statement.targets, statement.value
    elif isinstance(statement, ast.AnnAssign) and statement.value is not None:
        if "Annotated" in ast.unparse(statement.annotation):
            return []
        targets, value = [statement.target], statement.value
    else:
        return []
    if isinstance(value, ast.Call) and ast.unparse(value.func) == "range":
        return []  # codes
    parts = [part for t in targets for part in (t.elts if isinstance(t, ast.Tuple) else [t])]
    names = [part.id for part in parts if isinstance(part, ast.Name)]
    is_constant = bool(names) and all(name.lstrip("_").isupper() for name in names)
    return names if is_constant and is_numeric(value) else []


def is_explained(body: list[ast.stmt], index: int, lines: list[str]) -> bool:
    statement = body[index]
    assert statement.end_lineno is not None
    if "#" in "".join(lines[statement.lineno - 1 : statement.end_lineno]):
        return True
    if lines[statement.lineno - 2].strip().startswith("#"):
        return True
    below = body[index + 1] if index + 1 < len(body) else None
    while below is not None and below.lineno == statement.end_lineno + 1 and constant_names(below):
        index, statement = index + 1, below  # a group that shares one docstring
        below = body[index + 1] if index + 1 < len(body) else None
    return (
        isinstance(below, ast.Expr)
        and isinstance(below.value, ast.Constant)
        and isinstance(below.value.value, str)
    )


def unexplained(source: str) -> Iterator[str]:
    tree, lines = ast.parse(source), source.split("\n")
    classes = (node for node in ast.walk(tree) if isinstance(node, ast.ClassDef))
    bodies = [c.body for c in classes if "Enum" not in "".join(map(ast.unparse, c.bases))]
    bodies.append(tree.body)
    for body in bodies:
        for index, statement in enumerate(body):
            names = constant_names(statement)
            if names and not is_explained(body, index, lines):
                yield f"{statement.lineno}: {', '.join(names)}"


@pytest.mark.parametrize("folder", FOLDERS)
def test_every_constant_has_a_unit_and_a_reason(folder: str) -> None:
    files = (ROOT / folder).rglob("*.py")  # without the links of `slopewise` to other folders
    missing = [f"{file}:{name}" for file in files for name in unexplained(file.read_text())]
    assert missing == []
