"""Requirements, conditions, arming checks and tests belong together, in both directions."""

from __future__ import annotations

import csv
import math
import re
from dataclasses import replace
from pathlib import Path

import pytest

from docs.pages.failsafes import seconds
from docs.pages.requirements import (
    MARKER,
    Manual,
    ShowingTest,
    Shown,
    load,
    marked,
    problems,
    shown_by_tests,
)
from docs.pages.safety_manual import inserted, reference, traceability
from fsw.autopilot.control.tube import all_axes, all_axes_up_to
from fsw.autopilot.flight.commands.arming import CHECKS
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.failsafe.table import ROWS
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.registry import BY_NAME
from tests.docs.fences import DOCS
from tests.fsw.paper_arm import LIMIT1, LIMIT12

TRACEABILITY = DOCS / "reference" / "requirements-traceability.csv"
PAGE = (DOCS / "reference" / "safety-manual.md").read_text(encoding="utf-8")


def test_every_requirement_has_conditions_or_files_and_a_test_and_the_other_way_round() -> None:
    assert problems(load(), shown_by_tests()) == []


def test_the_tables_of_the_safety_manual_are_not_stale() -> None:
    assert inserted(PAGE) == PAGE, "run make pages"


def test_the_page_has_each_requirement_with_its_conditions_and_marks_those_without_a_test() -> None:
    lines = dict(re.findall(r"^- \*\*(REQ-[A-Z]+-\d+)\*\* (.+)$", reference(load()), re.M))
    assert list(lines) == [row.id for row in load().requirements]
    for row in load().requirements:
        assert all(
            ROWS[Condition[name]].condition.value in lines[row.id] for name in row.conditions
        )
        assert ("**No test.**" in lines[row.id]) == (row.id in load().not_shown)


def test_the_traceability_is_not_stale_and_has_each_condition_check_and_test() -> None:
    text = TRACEABILITY.read_text(encoding="utf-8")
    assert text == traceability(load(), shown_by_tests()), "run make pages"
    rows = {tuple(row[1:]) for row in csv.reader(text.splitlines())}
    for condition in Condition:
        within = seconds(ROWS[condition].within_us)
        assert ("condition", condition.value, f"Condition.{condition.name}", within) in rows
    for check in CHECKS:
        assert ("arming check", check.summary, check.subject.value, "") in rows
    for tests in shown_by_tests().values():
        for test in tests:
            kind = "long test" if test.is_long else "test"
            assert (kind, test.name, test.file, "") in rows


# ---------------------------------------------------------------- on a small scale

LOW, GUST = "BATTERY_LOW", "GUST"
SMALL = load(
    """
[groups]
BAT = "Battery"
[[requirements]]
id = "REQ-BAT-1"
shall = "It shall be reported within {after}."
conditions = ["BATTERY_LOW"]
[[requirements]]
id = "REQ-BAT-2"
shall = "It shall not be armed."
checks = ["Empty"]
by = ["fsw/autopilot/flight/commands/arming.py"]
[not_shown]
REQ-BAT-2 = "nothing measures it"
"""
)
TEST = ShowingTest("tests/test_it.py", "test_it_is_reported", is_long=False)
SHOWN: Shown = {"REQ-BAT-1": (TEST,)}
FIRST, SECOND = SMALL.requirements


def changed(**first: object) -> Manual:
    """With another first requirement."""
    row = replace(FIRST, **first)  # type: ignore[arg-type]
    return replace(SMALL, requirements=(row, SECOND))


def test_what_fits_is_no_problem() -> None:
    assert problems(SMALL, SHOWN, [LOW], ["Empty"]) == []


@pytest.mark.parametrize(
    ("manual", "shown", "words"),
    [
        (SMALL, {}, "REQ-BAT-1 is shown by no test"),
        (SMALL, {**SHOWN, "REQ-BAT-2": (TEST,)}, "take it out of [not_shown]"),
        (SMALL, {**SHOWN, "REQ-BAT-3": (TEST,)}, "shows REQ-BAT-3, which does not exist"),
        (replace(SMALL, not_shown={}), SHOWN, "REQ-BAT-2 is shown by no test"),
        (
            replace(SMALL, not_shown={**SMALL.not_shown, "REQ-BAT-9": "no"}),
            SHOWN,
            "[not_shown] has REQ-BAT-9",
        ),
        (replace(SMALL, requirements=(FIRST, FIRST, SECOND)), SHOWN, "REQ-BAT-1 stands twice"),
        (changed(conditions=(LOW, GUST)), SHOWN, "REQ-BAT-1 names no condition: GUST"),
        (changed(conditions=(), by=("fsw",)), SHOWN, "condition BATTERY_LOW belongs to no"),
        (changed(conditions=(), by=("fsw",)), SHOWN, "no condition whose time"),
        (changed(checks=("Full",)), SHOWN, "REQ-BAT-1 names no arming check: Full"),
        (changed(by=("fsw/nowhere.py",)), SHOWN, "REQ-BAT-1 names no file: fsw/nowhere.py"),
        (changed(conditions=()), SHOWN, "says of nothing that it implements it"),
        (changed(shall="It is reported."), SHOWN, "a sentence with shall"),
        (changed(id="REQ-AIR-1"), {"REQ-AIR-1": (TEST,)}, "REQ-GROUP-NUMBER with one of BAT"),
        (replace(SMALL, requirements=(FIRST,), not_shown={}), SHOWN, "arming check Empty belongs"),
    ],
)
def test_what_does_not_fit_is_named(manual: Manual, shown: Shown, words: str) -> None:
    assert [one for one in problems(manual, shown, [LOW], ["Empty"]) if words in one]


def test_a_key_that_is_not_known_is_refused() -> None:
    with pytest.raises(ValueError, match=r"REQ-A-1: .*'condition'"):
        load('[[requirements]]\nid = "REQ-A-1"\nshall = "."\ncondition = ["X"]\n')


def test_markers_are_found_with_the_tests_they_are_on() -> None:
    source = f"""
@{MARKER}("REQ-BAT-1", "REQ-BAT-2")
@pytest.mark.long
def test_one(): ...
@pytest.mark.parametrize("x", [1])
@{MARKER}("REQ-BAT-2")
def test_two(x): ...
def test_three(): ...
"""
    assert list(marked(source, "f")) == [
        ("REQ-BAT-1", ShowingTest("f", "test_one", is_long=True)),
        ("REQ-BAT-2", ShowingTest("f", "test_one", is_long=True)),
        ("REQ-BAT-2", ShowingTest("f", "test_two", is_long=False)),
    ]
    of_file = f'pytestmark = pytest.mark.long\n@{MARKER}("REQ-BAT-1")\ndef test_one(): ...\n'
    ((_, test),) = marked("\n" + of_file, "f")
    assert test.is_long


@pytest.mark.parametrize(
    "source",
    [
        f'@{MARKER}("REQ-BAT-1")\ndef helper(): ...\n',
        f'pytestmark = {MARKER}("REQ-BAT-1")\n',
        f'x = [pytest.param(1, marks={MARKER}("REQ-BAT-1"))]\n',
        f'class T:\n    @{MARKER}("REQ-BAT-1")\n    def test_it(self): ...\n',
    ],
)
def test_a_marker_that_would_not_be_found_is_refused(source: str) -> None:
    with pytest.raises(ValueError, match="a decorator of a test"):
        list(marked(source, "f"))


def test_files_without_a_marker_show_nothing(tmp_path: Path) -> None:
    tests = tmp_path / "tests"
    tests.mkdir()
    (tests / "test_a.py").write_text("def test_a( : this is not even Python", encoding="utf-8")
    marker = f'@{MARKER}("REQ-BAT-1")\ndef test_b(): ...\n'
    (tests / "test_b.py").write_text(marker, encoding="utf-8")
    assert shown_by_tests(tests) == {
        "REQ-BAT-1": (ShowingTest("tests/test_b.py", "test_b", False),)
    }


def test_numbers_in_sentences_and_limits_are_those_that_are_flown() -> None:
    config = flight_config()
    body, loop = config.airframe, loop_tube(config)
    sentences = {row.id: row.shall for row in load().requirements}
    one = 1e3 * (0.8 * loop.base + loop.base_wind - loop.wind_beyond)
    most = all_axes_up_to(body, loop, 0.8)
    every = 1e3 * (all_axes(body, loop, most)[0] - loop.wind_beyond)
    assert f"{one:.0f} mm on a horizontal axis for 0.8 m/s²" in sentences["REQ-SAFE-2"]
    assert f"{every:.0f} mm for {most:.2f} m/s² on all axes" in sentences["REQ-SAFE-2"]
    thrust, torque = body.weakest_thrust, body.joint_torque_max[0]
    assert f"within 0 to {thrust:.1f} N and {torque:g} N·m" in sentences["REQ-ACT-7"]
    first, both, tilt = (round(math.degrees(limit)) for limit in (LIMIT1, LIMIT12, body.tilt_max))
    rate, (turn, yaw) = body.joint_rate_max[0], body.body_rate_max
    of_joints = f"joints ({first} and {both} deg, {rate:g} rad/s), its tilt ({tilt} deg)"
    assert f"{of_joints} and its body rates ({turn:g} and {yaw:g} rad/s)" in sentences["REQ-ACT-8"]
    for limit in (
        f"joint 1, link 2 | {first} deg, {both} deg",
        f"rate of a joint | {rate:g} rad/s",
        f"{BY_NAME['PLN_TILT_MAX'].default:g} deg (`PLN_TILT_MAX`), {tilt} deg",
        f"roll and pitch rate, yaw rate | {turn:g} rad/s, {yaw:g} rad/s",
        f"{BY_NAME['STR_V_MAX'].default:g} m/s (`STR_V_MAX`), "
        f"{BY_NAME['MSN_SPEED'].default:g} m/s (`MSN_SPEED`)",
        f"{BY_NAME['TKO_CLIMB_MAX'].default:g} m (`TKO_CLIMB_MAX`)",
    ):
        assert limit in PAGE
