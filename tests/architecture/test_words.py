"""Words that were removed for the field's own do not come back, in names or in what people read."""

from __future__ import annotations

import ast
import re
from functools import cache
from pathlib import Path

import pytest

from tests.architecture.sources import text_of, tree_of

ROOT = Path(__file__).parents[2]
CODE = ("benchmarks", "command_line", "fsw", "messages", "pandion", "sitl", "studies", "view")
# What was removed, and what is written instead. A name is matched as a whole.
NAMES = {
    "complain": "print_error",
    "heard_us": "last_received_us",
    "lasting_error": "correlated_error",
    "stated_variance": "measurement_noise",
    "Charge": "BatteryWarning",
    "KeptSet": "InflatedSafeSet",
    "Pace": "SampleRate",
    "StatedVariance": "MeasurementNoise",
    "Surroundings": "DisturbanceModel",
}
# Names that begin so, until their rooms are done: the vehicle's model and laws.
MAX_OR_MIN = re.compile(r"_?(MOST|LEAST)_\w+|_?(most|least)_\w+")
ANY_WORD = re.compile("|".join([*map(re.escape, NAMES), MAX_OR_MIN.pattern]))
NOT_YET = (
    "fsw/autopilot/model",
    "fsw/autopilot/mpc",
    "fsw/autopilot/barriers",
    "fsw/autopilot/control",
)
# Keys of files that users have: a scenario's rangefinder, a journal's margin.
KEYS = {"least_m", "most_m", "least_margin_m", "most_likely", "least_squares"}
SENTENCES = (
    "says what cannot be",
    "say what cannot be",
    "jumps, and is not believed",
    "for what the estimate is not sure of",
    "not announced any more",
    "found in a tenth of the time",
    "that lacks most",
)


@cache
def files() -> list[Path]:
    found = [path for top in CODE for path in (ROOT / top).rglob("*.py")]
    return [path for path in found if path.name != "dialect.py"]


@cache
def names(path: Path) -> frozenset[str]:
    """Every name in a file, its own included; text in strings and comments is none.

    A file that has none of the words, not even in its text, is not looked through.
    """
    found = {path.stem}
    if not ANY_WORD.search(text_of(path)):
        return frozenset(found)
    for node in ast.walk(tree_of(path)):
        for field in ("id", "arg", "attr", "name", "asname"):
            name = getattr(node, field, None)
            if isinstance(name, str):
                found.add(name)
    return frozenset(found)


def test_no_name_that_was_removed_comes_back() -> None:
    back = [
        f"{path.relative_to(ROOT)}: {name}, write {NAMES[name]}"
        for path in files()
        for name in names(path) & set(NAMES)
    ]
    assert back == []


def test_the_largest_is_max_and_the_smallest_min() -> None:
    rooms = tuple(str(ROOT / room) for room in NOT_YET)
    used = {name for path in files() if str(path).startswith(rooms) for name in names(path)}
    back = [
        f"{path.relative_to(ROOT)}: {name}"
        for path in files()
        for name in sorted(names(path) - KEYS - used)
        if MAX_OR_MIN.fullmatch(name)
    ]
    assert back == []


@cache
def in_one_line(path: Path) -> str:
    return re.sub(r"\s+", " ", text_of(path))


@pytest.mark.parametrize("sentence", SENTENCES)
def test_no_sentence_that_was_removed_comes_back(sentence: str) -> None:
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md"]
    back = [
        str(path.relative_to(ROOT)) for path in (*files(), *pages) if sentence in in_one_line(path)
    ]
    assert back == []
