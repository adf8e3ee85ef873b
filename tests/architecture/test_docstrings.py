"""Unit, frame and shape of every quantity a public function takes."""

from __future__ import annotations

import importlib.util
import sys
from pathlib import Path

import pytest

_ROOT = Path(__file__).parents[2]
_SPEC = importlib.util.spec_from_file_location(
    "docstring_rules", Path(__file__).with_name("docstring_rules.py")
)
assert _SPEC is not None
assert _SPEC.loader is not None
rules = importlib.util.module_from_spec(_SPEC)
sys.modules["docstring_rules"] = rules
_SPEC.loader.exec_module(rules)

_FILES = sorted(
    path
    for top in (
        "benchmarks",
        "command_line",
        "fsw",
        "messages",
        "pandion",
        "sitl",
        "studies",
        "vehicles",
        "view",
    )
    for path in (_ROOT / top).rglob("*.py")
    if path.name != "dialect.py"
)


def test_every_quantity_has_its_unit_frame_and_shape() -> None:
    found = [problem for path in _FILES for problem in rules.problems(path)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    ("source", "complaint"),
    [
        ('def f(x: float) -> None:\n    """Push ``x`` [m]."""', ""),
        ('def f(x: float) -> None:\n    """Push x [m]."""', ""),
        ('def f(x_us: float) -> None:\n    """Push."""', ""),
        ('def f(x: float) -> None:\n    """Push x far, [m] of course."""', "no unit"),
        ('def f(p_WE: Vec3) -> None:\n    """Go to p_WE [m]."""', ""),
        ('def f(p: Vec3) -> None:\n    """Go to p [m]."""', "no frame"),
        ('def f(p: Vec3) -> None:\n    """Go to p [m, NED]."""', ""),
        ('def f(x: Array) -> None:\n    """Step x [SI]."""', "no shape"),
        ('def f(x: Array) -> None:\n    """Step x (8,) [SI]."""', ""),
        (
            'def f(x: Array) -> None:\n    """Step.\n\n    Args:\n        x: Is (8,) [m].\n    """',
            "",
        ),
    ],
)
def test_the_rule_itself(tmp_path: Path, source: str, complaint: str) -> None:
    path = tmp_path / "one.py"
    path.write_text(source)
    found = rules.problems(path)
    assert bool(found) == bool(complaint)
    assert complaint in "".join(found)
