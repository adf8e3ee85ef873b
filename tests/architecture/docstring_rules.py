"""What the docstring of a public function owes a reader: unit, frame and shape of each quantity.

A parameter is a physical quantity if it is a float, a tuple of floats or an array. Each one needs,
in the docstring, its name and a bracket behind it, in the summary line or in ``Args``:

    thrust [N]        p_WE [m]        rate [rad/s, FRD]        share [1]        states (n, 8) [SI]

A name that ends with a unit (``t_us``, ``wait_s``) needs none. A vector needs its frame as well:
in the name in monogram notation (``p_WE``, ``v_B``) or in the bracket after the unit
(``[m, NED]``). An array needs its shape in parentheses before the bracket. See ``problems``.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

from tests.architecture.sources import tree_of

_QUANTITIES = re.compile(r"^(float|Vec[234]|V3|Quaternion|Matrix\w*|Array|NDArray.*|.*ndarray.*)$")
_VECTOR = re.compile(r"^(Vec3|V3|Quaternion|Matrix\w*)$")
_ARRAY = re.compile(r"^(Array|NDArray.*|.*ndarray.*)$")
_UNIT_SUFFIX = re.compile(r"_(us|ms|ns|s|hz|m|rad|deg|bytes|mb|percent|per_\w+)$")
_MONOGRAM = re.compile(r"_(W|B|E|[A-Z]{1,3}\d?)(_[A-Z]+)*\d?(_\w+)?$")
_BRACKET = r"(?P<between>[^\[\]\n]{0,80}?)\[(?P<unit>[^\]\n]+)\]"


def functions(tree: ast.Module) -> Iterator[ast.FunctionDef]:
    """Public functions and methods, not those inside functions."""
    for node in tree.body:
        if isinstance(node, ast.FunctionDef) and not node.name.startswith("_"):
            yield node
        elif isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
            for inner in node.body:
                if isinstance(inner, ast.FunctionDef) and not inner.name.startswith("_"):
                    yield inner


def quantities(function: ast.FunctionDef) -> Iterator[tuple[str, str]]:
    """Name and annotation of the parameters that are physical quantities."""
    arguments = function.args
    for one in (*arguments.posonlyargs, *arguments.args, *arguments.kwonlyargs):
        if one.annotation is None:
            continue
        kind = ast.unparse(one.annotation).strip("'\"").removesuffix(" | None")
        if _QUANTITIES.match(kind):
            yield one.arg, kind


def problems(path: Path) -> list[str]:
    """One sentence for each quantity of the file whose unit, frame or shape is missing."""
    found = []
    for function in functions(tree_of(path)):
        text = ast.get_docstring(function) or ""
        for name, kind in quantities(function):
            wrong = _problem(name, kind, text)
            if wrong:
                found.append(f"{path}:{function.lineno} {function.name}({name}: {kind}): {wrong}")
    return found


def _problem(name: str, kind: str, text: str) -> str:
    if _UNIT_SUFFIX.search(name):
        return ""
    # In double backticks, as an entry of Args, or right before its bracket: not as a word of prose.
    own = re.escape(name)
    named = rf"(?:``{own}``|^\s*{own}:|\b{own}(?=\s*(?:\([^()\n]*\)\s*)?\[))"
    reported = re.search(rf"(?m){named}\s*{_BRACKET}", text)
    if reported is None:
        return f"no unit: say ``{name}`` [unit] in the docstring, [1] if it has none"
    if _VECTOR.match(kind) and not (_MONOGRAM.search(name) or "," in reported["unit"]):
        return f"no frame: name it as in p_WE or say [{reported['unit']}, NED]"
    if _ARRAY.match(kind) and "(" not in reported["between"]:
        return f"no shape: say ``{name}`` (n, 3) [{reported['unit']}]"
    return ""
