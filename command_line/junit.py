"""Results as JUnit XML, which servers of continuous integration show test by test."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final
from xml.etree import ElementTree as ET

# What XML 1.0 cannot hold, written or escaped.
_NO_CHARACTER: Final = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")


@dataclass(frozen=True, slots=True)
class Case:
    """One thing that was tried."""

    group: str
    name: str
    seconds: float = 0.0
    failure: str = ""  # it is not as it must be, in a sentence
    error: str = ""  # it could not be tried, in a sentence
    output: str = ""  # that goes with it


def junit_xml(suite: str, cases: Sequence[Case]) -> str:
    """The document of a suite of this name."""
    top = ET.Element("testsuites")
    counts = {
        "tests": str(len(cases)),
        "failures": str(sum(bool(case.failure) for case in cases)),
        "errors": str(sum(bool(case.error) for case in cases)),
        "skipped": "0",
        "time": f"{sum(case.seconds for case in cases):.3f}",
    }
    inside = ET.SubElement(top, "testsuite", {"name": _text(suite), **counts})
    for case in cases:
        facts = {"classname": _text(case.group), "name": _text(case.name)}
        one = ET.SubElement(inside, "testcase", {**facts, "time": f"{case.seconds:.3f}"})
        for kind, sentence in (("failure", case.failure), ("error", case.error)):
            if sentence:
                ET.SubElement(one, kind, {"message": _text(sentence)})
        if case.output:
            ET.SubElement(one, "system-out").text = _text(case.output)
    ET.indent(top)
    return ET.tostring(top, encoding="unicode", xml_declaration=False) + "\n"


def _text(text: str) -> str:
    return _NO_CHARACTER.sub("?", text)
