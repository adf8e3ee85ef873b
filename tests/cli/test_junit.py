"""JUnit XML: of campaigns and of whatever texts."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any
from xml.etree import ElementTree as ET

from hypothesis import given
from hypothesis import strategies as st

from command_line.junit import Case, junit_xml
from pandion.faults import _case as of_fault
from pandion.reproduce import _cases as reproduced
from studies.paper.settings import Report


def test_a_server_finds_what_failed_and_what_broke() -> None:
    cases = [
        Case("walls", "flight 0", 1.5),
        Case("walls", "flight 1", failure="contact with <front> & left"),
        Case("walls", "flight 2", error="MemoryError"),
    ]
    suite = ET.fromstring(junit_xml("first", cases)).find("testsuite")
    assert suite is not None
    counts = {name: suite.get(name) for name in ("name", "tests", "failures", "errors")}
    assert counts == {"name": "first", "tests": "3", "failures": "1", "errors": "1"}
    found = suite.findall("testcase")
    assert [one.get("name") for one in found] == ["flight 0", "flight 1", "flight 2"]
    failure = found[1].find("failure")
    assert failure is not None
    assert failure.get("message") == "contact with <front> & left"
    assert found[2].find("error") is not None


@given(st.text(), st.text(min_size=1))
def test_no_text_breaks_the_document(name: str, sentence: str) -> None:
    document = junit_xml(name, [Case(name, name, failure=sentence, output=sentence)])
    # As a file has it, which a lone surrogate could not be in.
    assert ET.fromstring(document.encode("utf-8")).find("testsuite/testcase/failure") is not None


def test_a_table_of_the_paper_fails_where_the_paper_has_another_mark() -> None:
    rows: list[dict[str, Any]] = [
        {
            "case": "I",
            "controller": controller,
            "passed": passed,
            "total": 20,
            "took_s": took_s,
            "paper_completed": printed,
        }
        for controller, passed, took_s, printed in (
            ("blf", 20, 1.5, True),
            ("hc", 20, 2.5, False),
            ("hc + 80 mm", 3, 3.5, None),
        )
    ]
    found = reproduced(Report("Table IV", rows, errors=("seed 3: MemoryError",)))
    assert [(one.name, bool(one.failure), bool(one.error)) for one in found] == [
        ("case I, controller blf", False, False),
        ("case I, controller hc", True, False),
        ("case I, controller hc + 80 mm", False, False),
        ("error 0", False, True),
    ]
    assert [one.seconds for one in found] == [1.5, 2.5, 3.5, 0.0]
    assert found[1].failure == "the paper prints not completed; 20 of 20 are completed"


def test_a_cell_of_the_fault_matrix_fails_or_breaks() -> None:
    def cell(problem: str = "", error: bool = False, differs: tuple[str, ...] = ()) -> Any:
        expected = SimpleNamespace(name="motor-off")
        return SimpleNamespace(
            cell=SimpleNamespace(mode="hold", expected=expected, seed=4), differs=differs,
            flight=SimpleNamespace(problem=problem, error=error, took_s=1.5),
        )  # fmt: skip

    good, differs = of_fault(cell()), of_fault(cell(differs=("silent", "contact")))
    broke = of_fault(cell("ValueError: x", error=True, differs=("broke",)))
    assert (good.group, good.name, good.seconds, good.failure, good.error) == (
        "hold",
        "motor-off, seed 4",
        1.5,
        "",
        "",
    )
    assert (differs.failure, differs.error) == ("silent; contact", "")
    assert (broke.failure, broke.error) == ("", "ValueError: x")
