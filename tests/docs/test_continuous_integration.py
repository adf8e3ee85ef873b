"""The recipe of the page about continuous integration does what the page says."""

from __future__ import annotations

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from studies.campaign.plan import parse_plan
from studies.campaign.store import JOURNAL
from studies.statistics.requirement import requirement
from tests.cli.command import environment
from tests.docs.fences import DOCS, fences

PAGE = DOCS / "how-to" / "continuous-integration.md"


def fence(language: str) -> str:
    (found,) = (one.text for one in fences(PAGE) if one.language == language)
    return found


def test_the_file_of_the_page_is_a_campaign_and_its_requirements_are_such() -> None:
    assert parse_plan(fence("toml"), "page", Path()).count == 20
    wanted = re.findall(r'--require "([^"]+)"', fence("bash"))
    section = PAGE.read_text("utf-8").split("## What can be required\n")[1].split("\n## ")[0]
    listed = re.findall(r"^\| (`[^|]+`) \|", section, re.MULTILINE)
    wanted += [text for row in listed for text in re.findall(r"`([^`]+)`", row)]
    assert len(wanted) >= 8
    for text in wanted:
        requirement(text)


@pytest.mark.long
def test_the_recipe_passes_a_good_night_and_fails_a_worse_one(tmp_path: Path) -> None:
    program = Path(sys.executable).parent
    path = {**environment(), "PATH": os.pathsep.join([str(program), os.environ["PATH"]])}
    text = re.sub(r"duration_s = [\d.]+", "duration_s = 0.5", fence("toml"))
    (tmp_path / "nightly.toml").write_text(text, encoding="utf-8")
    (tmp_path / "runs").mkdir()

    def night() -> subprocess.CompletedProcess[str]:
        return subprocess.run(
            ["bash", "-c", fence("bash")],
            cwd=tmp_path, env=path, capture_output=True, text=True, check=False,
        )  # fmt: skip

    first = night()
    assert first.returncode == 0, first.stdout + first.stderr
    (tmp_path / "runs" / "tonight").rename(tmp_path / "runs" / "before")
    same = night()
    assert same.returncode == 0, same.stdout + same.stderr
    assert "no difference shown" in same.stdout
    shutil.rmtree(tmp_path / "runs" / "tonight")
    windy = text.replace("[0.0, 0.2]", "[6.0, 6.2]")
    (tmp_path / "nightly.toml").write_text(windy, encoding="utf-8")
    worse = night()
    assert worse.returncode == 1, worse.stdout + worse.stderr
    assert (tmp_path / "runs" / "tonight" / JOURNAL).exists()
    assert (tmp_path / "runs" / "compared.xml").exists()
