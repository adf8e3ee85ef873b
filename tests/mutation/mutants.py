"""What can be changed in a module: cosmic-ray's changes, less those that prove nothing."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any, ClassVar

import parso
from cosmic_ray.ast import ast_nodes, get_ast
from cosmic_ray.mutating import mutate_code
from cosmic_ray.operators.operator import Operator
from cosmic_ray.plugins import get_operator

from tests.mutation.functions import enclosing, not_run

# One or two plausible slips for every construct. cosmic-ray's full list replaces each + by eleven
# other operators; << of two floats is a type error, which any test finds and which proves nothing.
_BINARY = "Add_Sub Sub_Add Mul_Div Div_Mul FloorDiv_Mul Mod_Mul Pow_Mul BitOr_BitAnd BitAnd_BitOr"
_COMPARISON = (
    "Lt_LtE Lt_GtE LtE_Lt LtE_Gt Gt_GtE Gt_LtE GtE_Gt GtE_Lt Eq_NotEq NotEq_Eq Is_IsNot IsNot_Is"
)
_OTHERS = (
    "ReplaceUnaryOperator_USub_UAdd ReplaceUnaryOperator_Delete_Not AddNot ReplaceTrueWithFalse "
    "ReplaceFalseWithTrue ReplaceAndWithOr ReplaceOrWithAnd ReplaceBreakWithContinue "
    "ReplaceContinueWithBreak NumberReplacer ZeroIterationForLoop"
)


class SwapMinMax(Operator):
    """``min`` for ``max`` and the other way round: a limit turned inside out."""

    _OTHER: ClassVar = {"min": "max", "max": "min", "minimum": "maximum", "maximum": "minimum"}

    def mutation_positions(self, node: Any) -> Iterator[Any]:
        if isinstance(node, parso.python.tree.Name) and node.value in self._OTHER:
            following = node.get_next_leaf()
            if following is not None and following.value == "(":
                yield node.start_pos, node.end_pos

    def mutate(self, node: Any, index: int) -> Any:
        return parso.python.tree.Name(self._OTHER[node.value], node.start_pos, node.prefix)

    @classmethod
    def examples(cls) -> tuple[()]:
        return ()


def _operators() -> Iterator[tuple[str, Operator]]:
    for family, names in (("Binary", _BINARY), ("Comparison", _COMPARISON)):
        for name in names.split():
            full = f"Replace{family}Operator_{name}"
            yield full, get_operator(f"core/{full}")()
    for full in _OTHERS.split():
        yield full, get_operator(f"core/{full}")()
    yield "SwapMinMax", SwapMinMax()


OPERATORS = dict(_operators())


@dataclass(frozen=True)
class Mutant:
    """One change of one line; the texts name it, because line numbers move."""

    module: str
    function: str
    line: str
    mutated: str
    nth: int  # among those with the same texts in the same function
    operator: str
    occurrence: int  # as cosmic-ray counts
    number: int  # of the line

    @property
    def key(self) -> tuple[str, str, str, str, int]:
        return self.module, self.function, self.line, self.mutated, self.nth

    def __str__(self) -> str:
        return (
            f"{self.module}:{self.number} {self.function}\n    - {self.line}\n    + {self.mutated}"
        )


# A star before keyword parameters that became a slash; a length for numpy to find, which any
# negative number asks for.
_ALIKE = re.compile(r"(^|[(,])\s*/\s*,|reshape\(- ?2\b")


def _proves_nothing(mutated: str, line: str) -> bool:
    """Whether no test is needed to see the change, or none could."""
    try:
        ast.parse(mutated)
    except SyntaxError:
        return True
    return _ALIKE.search(line) is not None


@cache
def mutants(copy: Path, module: str) -> tuple[Mutant, ...]:
    """All mutants of a module, in the order of its lines."""
    source = (copy / module).read_text()
    lines = source.splitlines()
    tree = ast.parse(source)
    skipped, functions = not_run(tree), enclosing(tree)
    found: list[tuple[Any, ...]] = []
    parsed = get_ast(source)
    for operator_name, operator in OPERATORS.items():
        positions = (
            position for node in ast_nodes(parsed) for position in operator.mutation_positions(node)
        )
        for occurrence, (start, end) in enumerate(positions):
            if any(low <= start and end <= high for low, high in skipped):
                continue
            found.append((start, operator_name, occurrence))
    counted: dict[tuple[str, ...], int] = {}
    result = []
    for _start, operator_name, occurrence in sorted(found):
        mutated = mutate_code(source, OPERATORS[operator_name], occurrence)
        changed = [
            (number, before, after)
            for number, (before, after) in enumerate(
                zip(lines, mutated.splitlines(), strict=False), start=1
            )
            if before != after
        ]
        if not changed or _proves_nothing(mutated, changed[0][2]):
            continue
        number, before, after = changed[0]
        inside = [name for first, last, name in functions if first <= number <= last]
        function = inside[-1] if inside else ""
        texts = (function, before.strip(), after.strip())
        counted[texts] = counted.get(texts, 0) + 1
        result.append(Mutant(module, *texts, counted[texts], operator_name, occurrence, number))
    return tuple(result)
