"""What the compiled stretch carries from tick to tick, checked without ten seconds of compiling."""

from __future__ import annotations

import ast
from pathlib import Path

from fsw.control.cascade import CascadeMemory
from studies.search import tracked_flight


def test_the_stretch_hands_on_the_whole_memory_of_the_fast_loops() -> None:
    tree = ast.parse(Path(tracked_flight.__file__).read_text(encoding="utf-8"))
    made = [
        node
        for node in ast.walk(tree)
        if isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id == "CascadeMemory"
    ]
    assert [len(call.args) for call in made] == [len(CascadeMemory._fields)]
