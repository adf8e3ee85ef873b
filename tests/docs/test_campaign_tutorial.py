"""The campaign of the tutorial, flown in small as a reader types it."""

from __future__ import annotations

import re
import shlex
from pathlib import Path

import pytest

from pandion.__main__ import main
from studies.campaign.plan import parse_plan
from studies.campaign.store import read
from tests.docs.fences import DOCS, commands, fences

TUTORIAL = DOCS / "tutorials" / "fly-a-campaign.md"
REFERENCE = DOCS / "reference" / "campaign-files.md"


@pytest.mark.parametrize("page", [TUTORIAL, REFERENCE], ids=lambda page: page.stem)
def test_the_files_of_a_page_are_campaigns(page: Path) -> None:
    found = [fence for fence in fences(page) if fence.language == "toml"]
    assert found
    for fence in found:
        plan = parse_plan(fence.text, "page", Path())
        assert plan.flight(plan.count - 1).values


@pytest.mark.long
def test_the_tutorial_can_be_typed_in(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    typed = 0
    for fence in fences(TUTORIAL):
        if fence.language == "toml":
            small = re.sub(r"flights = \d+", "flights = 4", fence.text)
            small = re.sub(r"duration_s = [\d.]+", "duration_s = 0.5", small)
            (tmp_path / "first.toml").write_text(small)
        elif fence.language == "console" and fence.mark == "run in":
            for line, _ in commands(fence):
                words = shlex.split(line)
                assert words[0] == "pandion"
                assert main(words[1:]) == 0, line
                typed += 1
    assert typed >= 2
    result = read(tmp_path / "runs" / "first")
    assert result.complete
    assert not any(row.error for row in result.rows)
    assert (tmp_path / "runs" / "third" / "flight-3.json").exists()
