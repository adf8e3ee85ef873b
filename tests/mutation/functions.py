"""Which function a line is in, and what of it a change would prove nothing of."""

from __future__ import annotations

import ast
from typing import Any


def enclosing(tree: ast.Module) -> list[tuple[int, int, str]]:
    """First and last line of every function and class, outer ones first."""
    found: list[tuple[int, int, str]] = []

    def visit(node: ast.AST, prefix: str) -> None:
        for child in ast.iter_child_nodes(node):
            if isinstance(child, ast.FunctionDef | ast.ClassDef):
                name = f"{prefix}{child.name}"
                found.append((child.lineno, child.end_lineno or child.lineno, name))
                visit(child, f"{name}.")
            else:
                visit(child, prefix)

    visit(tree, "")
    return found


Span = tuple[tuple[int, int], tuple[int, int]]


def _span(node: Any) -> Span:
    return (node.lineno, node.col_offset), (node.end_lineno, node.end_col_offset)


def not_run(tree: ast.Module) -> list[Span]:
    """Where a change changes nothing that flies: annotations, decorators, types, examples."""
    nodes: list[Any] = []
    for node in ast.walk(tree):
        nodes += getattr(node, "decorator_list", [])
        nodes += filter(None, [getattr(node, "returns", None), getattr(node, "annotation", None)])
        # The examples of machine code say types only.
        if isinstance(node, ast.Call) and getattr(node.func, "id", "") == "machine_code":
            nodes.append(node)
        # What a warm-up computes is thrown away.
        if isinstance(node, ast.FunctionDef) and node.name == "warm_up":
            nodes.append(node)
        if isinstance(node, ast.If) and getattr(node.test, "id", "") == "TYPE_CHECKING":
            nodes.append(node)
    nodes += [node for node in tree.body if isinstance(node, ast.Assign) and _is_type(node.value)]
    return [_span(node) for node in nodes]


def _is_type(value: ast.expr) -> bool:
    """Whether it reads like an alias: tuple[float, ...] | None."""
    while isinstance(value, ast.BinOp | ast.Subscript):
        value = value.left if isinstance(value, ast.BinOp) else value.value
    return getattr(value, "id", "") in ("tuple", "dict", "Callable", "NDArray", "Vec3")
