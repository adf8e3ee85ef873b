"""Every command and example of the documentation runs, or says why it does not."""

from __future__ import annotations

import contextlib
import doctest
import io
import json
import os
import re
import runpy
import shlex
import shutil
import struct
import subprocess
import sys
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

from pandion.__main__ import VERBS, main
from sitl.link.encode import StepEncoder
from sitl.scenario_file import load_scenario, parse_scenario, scenario_names
from sitl.scenario_validation import check
from sitl.simulation import Simulation
from studies.paper.catalogue import STUDIES
from tests.docs.fences import PAGES, ROOT, Fence, commands, fences, named

BLOCKS = [fence for page in PAGES for fence in fences(page)]
LANGUAGES = {
    "bash",
    "console",
    "diff",
    "json",
    "math",
    "python",
    "text",
    "toml",
    "{include}",
    "{toctree}",
}
OPTION = re.compile(r"--[a-z][a-z-]*")
BIN = Path(sys.executable).parent


def runs(fence: Fence, *, flights: bool) -> bool:
    """Whether a block is executed, with or without those that fly."""
    wanted = {"", "added to", "long"} if flights else {"", "added to"}
    return fence.mark in wanted and fence.language in ("console", "json", "python", "toml")


def pages(*, flights: bool) -> Iterator[Path]:
    for page in PAGES:
        kinds = {fence.mark for fence in fences(page) if runs(fence, flights=flights)}
        if "long" in kinds or (kinds and not flights):
            yield page


@pytest.fixture(scope="module")
def flight(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The directory of one second of ``walls``, flown as a reader flies it.

    The first flight of a fresh clone compiles the kernels, which takes minutes on a busy machine.
    """
    out = tmp_path_factory.mktemp("flight") / "flown"
    line = ["fly", "walls", "--duration", "1", "--gcs", "udp:127.0.0.1:9", "--api", "none"]
    subprocess.run(
        [BIN / "pandion", *line, "--out", out], check=True, capture_output=True, timeout=400.0
    )
    return out


@pytest.fixture
def workplace(flight: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Where a reader would type: beside the logs of a flight and a capture of the link."""
    shutil.copytree(flight, tmp_path / "runs" / "walls-seed0-1")
    for name in ("flight.ulg", "flight.tlog", "result.json", "parameters.params"):
        shutil.copy(flight / name, tmp_path)
    write_capture(tmp_path / "link.pcap")
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", f"{BIN}:{os.environ['PATH']}")
    monkeypatch.setenv("LC_ALL", "C.UTF-8")  # bash warns of a locale that is not there
    monkeypatch.setenv("MPLBACKEND", "Agg")
    return tmp_path


@pytest.mark.parametrize("page", list(pages(flights=False)), ids=named)
def test_the_blocks_of_a_page_run(page: Path, workplace: Path) -> None:
    run_all(page, workplace, flights=False)


@pytest.mark.long
@pytest.mark.parametrize("page", list(pages(flights=True)), ids=named)
def test_the_flights_of_a_page_run(page: Path, workplace: Path) -> None:
    run_all(page, workplace, flights=True)


def run_all(page: Path, workplace: Path, *, flights: bool) -> None:
    for fence in fences(page):
        if runs(fence, flights=flights):
            {"console": type_in, "json": read, "python": execute, "toml": load}[fence.language](
                fence, workplace
            )


def type_in(fence: Fence, workplace: Path) -> None:
    """Type the commands, compare what they print with what the page shows."""
    for command, expected in commands(fence):
        code, printed = answer(command, workplace)
        assert code == 0, f"{fence}: {command} ended with {code}\n{printed}"
        options = doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE
        if expected and not doctest.OutputChecker().check_output(expected, printed, options):
            pytest.fail(f"{fence}: {command} printed\n{printed}\ninstead of\n{expected}")


def answer(command: str, workplace: Path) -> tuple[int, str]:
    """Exit code and output of one command.

    The quick verbs run in this process, which has imported what they need: a process each
    would cost a second.
    """
    words = shlex.split(command)
    quick = ("replay", "export", "param", "dialect", "vehicle", "faults", "--version", "--help")
    if words[0] == "pandion" and words[1] in quick and not set(words) & {"|", ">", "&&"}:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.redirect_stderr(printed):
            try:
                code = main(words[1:])
            except SystemExit as left:
                code = int(left.code or 0)
        return int(code or 0), printed.getvalue()
    done = subprocess.run(
        ["bash", "-c", command],
        cwd=workplace,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        timeout=600.0,
    )
    return done.returncode, done.stdout


def execute(fence: Fence, workplace: Path) -> None:
    """Run a Python example as a script."""
    script = workplace / "example.py"
    script.write_text(fence.text, encoding="utf-8")
    try:
        runpy.run_path(str(script), run_name="__main__")
    except Exception as error:  # the page and line are what a reader of the report needs
        raise AssertionError(f"{fence}: {error!r}") from error


def load(fence: Fence, workplace: Path) -> None:
    """Load a scenario and build its simulation; its first line may name a file to write.

    Blocks of vehicles are written alone.
    """
    title = re.match(r"# (\S+\.toml)\n", fence.text)
    name = fence.reason if fence.mark == "added to" else title.group(1) if title else ""
    text = fence.text
    if name:
        before = (workplace / name).read_text(encoding="utf-8") if fence.mark else ""
        text = f"{before}\n{text}"
        (workplace / name).write_text(text, encoding="utf-8")
    if not {"rotors", "parts"}.isdisjoint(tomllib.loads(text)):
        return  # of a vehicle, which the commands beside it check
    scenario = parse_scenario(text, "example")
    check(scenario)
    assert Simulation(scenario, 0).ended is None, str(fence)


def read(fence: Fence, _workplace: Path) -> None:
    json.loads(fence.text)


def write_capture(path: Path) -> None:
    """Three steps of a flight as a capture of the loopback interface would show them."""
    simulation, encoder = Simulation(load_scenario("walls-calm"), 0), StepEncoder(lockstep=True)
    packets = [encoder.heartbeat() + encoder.datagram(simulation.sense(), ()) for _ in range(3)]
    capture = struct.pack("<IHHiIII", 0xA1B2C3D4, 2, 4, 0, 0, 262144, 1)
    for payload in packets:
        udp = struct.pack(">HHHH", 4560, 40000, 8 + len(payload), 0) + payload
        packet = bytes(12) + b"\x08\x00" + b"\x45" + bytes(19) + udp
        capture += struct.pack("<IIII", 0, 0, len(packet), len(packet)) + packet
    path.write_bytes(capture)


def test_every_block_says_its_language() -> None:
    assert [str(fence) for fence in BLOCKS if fence.language not in LANGUAGES] == []


def test_what_another_test_runs_is_run_there() -> None:
    elsewhere = [fence for fence in BLOCKS if fence.mark == "run in"]
    assert elsewhere
    assert [str(fence) for fence in elsewhere if not (ROOT / fence.reason).is_file()] == []


def lines() -> list[str]:
    """Every command line that a page shows, run or not."""
    shown = {line for f in BLOCKS if f.language == "console" for line, _ in commands(f)}
    programs = {"pandion", "make", ".venv/bin/pandion", "python", ".venv/bin/python"}
    return sorted(line for line in shown if line.split()[0] in programs)


@pytest.mark.parametrize("line", lines())
def test_a_command_on_a_page_exists(line: str) -> None:
    program, *words = shlex.split(line.replace(".venv/bin/", ""))
    if program == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        targets = [word for word in words if "=" not in word]
        assert [word for word in targets if f"\n{word}:" not in makefile] == []
    elif program == "python":
        assert words[0] == "-m"
        module = words[1].replace(".", "/")
        assert any((ROOT / found).exists() for found in (module, f"{module}.py")), line
    elif words[0] not in ("--help", "--version"):
        check_verb(words)


def check_verb(words: list[str]) -> None:
    """Verb, options and scenario of a ``pandion`` line."""
    verb = words[0]
    assert verb in VERBS
    printed = io.StringIO()
    with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
        # The actions of some verbs have options of their own.
        main([*words[: 2 if verb in ("px4", "vehicle") else 1], "--help"])
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    known = printed.getvalue()
    unknown = [option for option in options if option not in known]
    if verb != "param":
        assert unknown == []
    if verb in ("fly", "sitl") and len(words) > 1 and not words[1].startswith("-"):
        assert words[1] in scenario_names() or words[1].endswith(".toml")
    if verb == "reproduce":
        assert words[1] in STUDIES


def test_the_page_of_the_command_line_names_every_option_of_a_flight() -> None:
    text = (ROOT / "docs/reference/command-line.md").read_text(encoding="utf-8")
    table = text.split("<!-- options: fly sitl fsw -->\n")[1].split("<!-- end -->")[0]
    for verb in ("fly", "sitl", "fsw"):
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed), contextlib.suppress(SystemExit):
            main([verb, "--help"])
        rows = [row.partition(" (") for row in table.splitlines()]
        of_verb = [option for option, _, rest in rows if verb in rest.partition(";")[0].split(", ")]
        named_here = {option for row in of_verb for option in OPTION.findall(row)}
        given = set(OPTION.findall(printed.getvalue())) - {"--help"}
        assert named_here == given, verb
