"""JUnit XML: of campaigns and of whatever texts."""

from __future__ import annotations

from xml.etree import ElementTree as ET

from hypothesis import given
from hypothesis import strategies as st

from command_line.junit import Case, junit_xml


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
