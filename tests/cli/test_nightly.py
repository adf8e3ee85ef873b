"""`make nightly` says what passed, ends what hangs, and knows every long target."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest

from tests.nightly import ROOT, Target, night, targets

MAKEFILE = """
good: ; @echo "12 passed"
bad: ; @echo "No module named 'scipy'"; exit 3
slow: ; @sleep 60
with: ; @echo "SEED is $(SEED)"
"""


def test_a_table_says_what_passed_and_why_the_others_did_not(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "Makefile").write_text(MAKEFILE, encoding="utf-8")
    chosen = [
        Target("good"), Target("bad"), Target("slow", limit_s=0.5), Target("with", ("SEED=7",)),
    ]  # fmt: skip
    folder = tmp_path / "build"
    assert night(chosen, ["interop"], tmp_path, folder) == 1
    lines = capsys.readouterr().out.splitlines()
    assert re.fullmatch(r"good +passed +0\.0 min  12 passed", lines[0])
    assert lines[1].startswith("bad        FAILED")
    assert "ended after 0.5 s" in lines[2]
    assert "SEED is 7" in lines[3]
    assert lines[4:] == ["interop    left out", "nightly: failed: bad, slow; output in build"]
    assert "scipy" in (folder / "bad.log").read_text(encoding="utf-8")
    suite = ET.parse(folder / "junit.xml").find("testsuite")
    assert suite is not None
    assert (suite.get("tests"), suite.get("failures")) == ("4", "2")
    assert night(chosen[:1], [], tmp_path, folder) == 0


def test_every_long_target_of_the_makefile_is_one_of_the_night() -> None:
    """One that is forgotten rots unseen."""
    text = (ROOT / "Makefile").read_text(encoding="utf-8")
    there = set(re.findall(r"^([a-z-]+):[^#\n]*## ", text, re.MULTILINE))
    others = {"help", "setup", "run", "test", "nightly", "lock", "pictures", "pages", "clean"}
    others |= {"wheel"}
    assert {target.name for target in targets(0)} == there - others
