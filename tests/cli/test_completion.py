"""A shell that completes: verbs, options, names, in a process as the shell asks for them."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from pandion.__main__ import HELP, VERBS
from pandion.completion import SHELLS, main
from tests.cli.command import environment

ROOT = Path(__file__).parents[2]
_ANSWER = 8  # the file that argcomplete's scripts read, as a number


def completed(line: str) -> list[str]:
    """What a shell is offered after a line."""
    reading, writing = os.pipe()
    asked = {
        **environment(), "_ARGCOMPLETE": "1", "_ARGCOMPLETE_IFS": "\n", "COMP_LINE": line,
        "COMP_POINT": str(len(line.encode())), "COMP_TYPE": "9", "_ARGCOMPLETE_SUPPRESS_SPACE": "1",
    }  # fmt: skip
    run = "runpy.run_module('pandion', run_name='__main__')"
    code = f"import os, runpy; os.dup2({writing}, {_ANSWER}); {run}"
    subprocess.run(
        [sys.executable, "-c", code], env=asked, pass_fds=[writing], cwd=ROOT, check=True,
        stdout=subprocess.DEVNULL,
    )  # fmt: skip
    os.close(writing)
    with os.fdopen(reading) as answer:
        return [word.strip() for word in answer.read().splitlines()]


@pytest.mark.parametrize(
    ("line", "offered", "not_offered"),
    [
        ("pandion c", {"campaign", "certify", "compare", "completion"}, {"fly"}),
        ("pandion ", set(VERBS), {"bench"}),
        ("pandion fly --se", {"--sensors", "--seed"}, {"--suite"}),
        ("pandion fly walls --sensors m", {"mocap"}, {"rtk"}),
        ("pandion fly wo", {"workspace", "workspace-calm"}, {"walls"}),
        ("pandion param ", {"get", "set", "export"}, {"--file"}),
        ("pandion param set --fi", {"--file"}, {"set"}),
    ],
)
def test_a_shell_is_offered_what_there_is(
    line: str, offered: set[str], not_offered: set[str]
) -> None:
    found = set(completed(line))
    assert offered <= found
    assert not found & not_offered


@pytest.mark.parametrize("shell", SHELLS)
def test_a_script_is_printed_for_each_shell(shell: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main([shell]) == 0
    assert "pandion" in capsys.readouterr().out


def test_verbs_are_grouped_and_every_line_fits_a_terminal() -> None:
    lines = HELP.splitlines()
    for title in ("fly:", "look:", "study:", "tools:"):
        assert title in lines
    assert max(map(len, lines)) <= 80
    assert all(any(line.startswith(f"  {verb} ") for line in lines) for verb in VERBS)
