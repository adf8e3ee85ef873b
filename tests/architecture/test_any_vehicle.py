"""No list of joints or rotors is written out by hand: a vehicle's file says how many it has."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.architecture.sources import tree_of

ROOT = Path(__file__).parents[2]
PRODUCT = ("fsw", "sitl", "vehicles", "studies", "pandion", "view", "command_line")
# The paper's tables and figures are of its vehicle.
OF_PAPER = ("studies/paper",)
# What holds one number of each joint or rotor.
LISTS = {
    "angles",
    "joint_torque",
    "joint_torques",
    "joints",
    "q",
    "q_arm",
    "qd",
    "qd_arm",
    "qdd_arm",
    "rotor_thrust",
    "rotors",
    "thrust",
    "thrusts",
    "torques",
}
PAIRS = {"Vec2", "Vec4", "V2", "V4", "Two", "Four"}
# A quaternion is called q as well, and one joint's limits are a pair.
QUATERNIONS = {"Vec4", "V4", "Four"}


def by_hand(tree: ast.AST) -> Iterator[tuple[int, str]]:
    """Line and text of every place that names single joints or rotors, or how many there are."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Tuple | ast.List):
            picked = [one for one in node.elts if isinstance(one, ast.Subscript) and _is_entry(one)]
            if len(picked) > 1:
                yield node.lineno, ast.unparse(node)
        elif isinstance(node, ast.arg | ast.AnnAssign) and node.annotation is not None:
            name = node.arg if isinstance(node, ast.arg) else _name(node.target)
            kinds = {one.id for one in ast.walk(node.annotation) if isinstance(one, ast.Name)}
            if name in LISTS and kinds & (PAIRS - QUATERNIONS if name == "q" else PAIRS):
                yield node.lineno, ast.unparse(node)
        elif isinstance(node, ast.BinOp | ast.Assign):
            yield from _spelt_out(node)


def _is_entry(node: ast.Subscript) -> bool:
    at = node.slice
    return _name(node.value) in LISTS - {"q"} and isinstance(at, ast.Constant)


def _spelt_out(node: ast.BinOp | ast.Assign) -> Iterator[tuple[int, str]]:
    """Sums of single entries, and lists that are taken apart by hand."""
    if isinstance(node, ast.BinOp):
        sides = [one for one in (node.left, node.right) if isinstance(one, ast.Subscript)]
        if len(sides) == 2 and all(map(_is_entry, sides)):
            yield node.lineno, ast.unparse(node)
    else:
        several = isinstance(node.value, ast.Tuple)
        values = node.value.elts if isinstance(node.value, ast.Tuple) else [node.value]
        targets = getattr(node.targets[0], "elts", []) if several else node.targets
        for target, value in zip(targets, values, strict=False):
            if isinstance(target, ast.Tuple) and _name(value) in LISTS - {"q"}:
                yield node.lineno, ast.unparse(node)


def _name(node: ast.expr) -> str:
    if isinstance(node, ast.Attribute):
        return node.attr
    return node.id if isinstance(node, ast.Name) else ""


def _files() -> list[Path]:
    found = [path for part in PRODUCT for path in sorted((ROOT / part).rglob("*.py"))]
    return [path for path in found if not path.relative_to(ROOT).as_posix().startswith(OF_PAPER)]


def test_no_list_of_joints_or_rotors_is_written_out() -> None:
    found = [
        f"{path.relative_to(ROOT)}:{line} {text}"
        for path in _files()
        for line, text in by_hand(tree_of(path))
    ]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "text",
    [
        "x = q_arm[0], q_arm[1]",
        "lift = state.thrust[0] + state.thrust[1]",
        "def law(q_arm: Vec2) -> None: ...",
        "def law(rotors: Vec4 | Floats) -> None: ...",
        "f1, f2, f3, f4 = command.rotor_thrust",
        "(q1, q2), dt = state.q_arm, 0.1",
        "class A:\n    joint_torque: Vec2",
    ],
)
def test_what_is_written_by_hand_is_found(text: str) -> None:
    assert list(by_hand(ast.parse(text)))


@pytest.mark.parametrize(
    "text", ["w, x, y, z = q", "total = (q[0], q[1])", "a = thrust[k] + thrust[i]", "q: Vec4"]
)
def test_what_is_for_any_vehicle_is_not(text: str) -> None:
    assert not list(by_hand(ast.parse(text)))
