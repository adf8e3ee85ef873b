"""What a reader can try on the pages works: links, files, commands, Python, drawings."""

from __future__ import annotations

import contextlib
import io
import json
import re
import runpy
import shlex
import struct
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections.abc import Iterator
from pathlib import Path
from random import Random

import pytest

from docs.generators.message_page import OF_MISSIONS, traffic
from docs.generators.message_reference import reference
from fsw.link.services.mission_service import MissionService
from fsw.link.services.mission_store import MissionStore, Site
from fsw.link.telemetry.streams import STREAMS
from fsw.link.wire import message_ids as ids
from fsw.log.flight_log import FlightLog, LogSubject
from fsw.log.reference import inserted
from fsw.log.tlog import TlogWriter
from fsw.mpc.planner_config import PlannerConfig
from fsw.parameters.reference import reference as parameter_reference
from messages import dialect
from messages.frames import FrameWriter
from pandion.__main__ import VERBS, main
from pandion.result import FlightReports, as_json
from sitl.link.encode import StepEncoder
from sitl.scenario_file import load_scenario, scenario_names
from sitl.simulation import Simulation
from studies.catalogue import STUDIES
from tests.fsw.link.snapshots import outputs_at
from tests.fsw.log.specimens import inputs

ROOT = Path(__file__).parents[2]
DOCS = ROOT / "docs"
PAGES = [ROOT / "README.md", ROOT / "CHANGELOG.md", *sorted(DOCS.rglob("*.md"))]
LOCAL_POSITION_NED = 32


def named(path: Path) -> str:
    return path.relative_to(ROOT).as_posix()


def blocks(page: Path, language: str) -> list[str]:
    """Fenced blocks of one language."""
    pattern = rf"^```{language}\n(.*?)^```$"
    return re.findall(pattern, page.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)


def without_blocks(page: Path) -> str:
    return re.sub(r"^```.*?^```$", "", page.read_text(encoding="utf-8"), flags=re.M | re.S)


def anchors(page: Path) -> set[str]:
    """Fragments that GitHub gives to the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", without_blocks(page), re.MULTILINE)
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings]
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_resolve(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", without_blocks(page)):
        if re.match(r"https?:", target):
            continue
        file, _, fragment = target.partition("#")
        other = (page.parent / file).resolve() if file else page
        if not other.exists() or (fragment and fragment not in anchors(other)):
            broken.append(target)
    assert broken == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_files_named_in_the_text_exist(page: Path) -> None:
    names = re.findall(
        r"`((?:fsw|sitl|messages|pandion|tests|docs)/[\w./-]*)`", without_blocks(page)
    )
    generated = {"messages/dialect.py"}
    assert [name for name in names if name not in generated and not (ROOT / name).exists()] == []


def test_decisions_that_the_code_cites_exist() -> None:
    cited = {
        name
        for half in ("fsw", "sitl", "pandion", "messages")
        for path in (ROOT / half).rglob("*.py")
        for name in re.findall(r"docs/[\w/-]+\.md", path.read_text(encoding="utf-8"))
    }
    assert [name for name in sorted(cited) if not (ROOT / name).exists()] == []


def commands() -> list[str]:
    """Every `pandion` and `make` command line in console blocks."""
    lines = [
        line.lstrip("$# ").removeprefix(".venv/bin/")
        for page in PAGES
        for block in blocks(page, "console")
        for line in block.splitlines()
        if line.startswith(("$ ", "# "))
    ]
    return sorted({line for line in lines if line.split()[0] in ("pandion", "make")})


@pytest.mark.parametrize("line", commands())
def test_commands_shown_exist(line: str) -> None:
    program, *words = shlex.split(line)
    if program == "make":
        makefile = (ROOT / "Makefile").read_text(encoding="utf-8")
        assert [word for word in words if f"\n{word}:" not in makefile] == []
        return
    if words[0] == "--help":
        return
    assert words[0] in VERBS
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.suppress(SystemExit):
        main([words[0], "--help"])
    options = {word.partition("=")[0] for word in words if word.startswith("--")}
    assert [option for option in options if option not in said.getvalue()] == []
    if words[0] in ("fly", "sitl") and len(words) > 1 and not words[1].startswith("-"):
        assert words[1] in scenario_names() or words[1].endswith(".toml")
    if words[0] == "reproduce":
        assert words[1] in STUDIES


def examples() -> Iterator[tuple[Path, str]]:
    # Those about clients need a vehicle and are run in tests/interop.
    alone = [page for page in PAGES if page.parent != DOCS / "ground-stations"]
    for page in [*alone, ROOT / "messages" / "README.md"]:
        for block in blocks(page, "python"):
            yield page, block


@pytest.mark.parametrize(
    ("page", "code"),
    list(examples()),
    ids=lambda value: named(value) if isinstance(value, Path) else "",
)
def test_python_examples_run(
    page: Path, code: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    write_capture(tmp_path / "link.pcap")
    write_log(tmp_path / "flight.tlog")
    write_flight_log(tmp_path / "flight.ulg")
    (tmp_path / "result.json").write_text(
        json.dumps({"margins_m": {"front/base": 0.1}, "completed": True}), encoding="utf-8"
    )
    (tmp_path / "example.py").write_text(code, encoding="utf-8")
    runpy.run_path(str(tmp_path / "example.py"))


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


def write_log(path: Path) -> None:
    """A .tlog with one position."""
    log = TlogWriter(path, 0)
    log.add(0, FrameWriter(1, 1).frame(LOCAL_POSITION_NED, 0, 1.0, 2.0, -3.0, 0.0, 0.0, 0.0))
    log.close()


def write_flight_log(path: Path) -> None:
    """A flight log of one tick."""
    facts: dict[str, str | int] = {"ver_sw": "0", "scenario": "walls", "seed": 0}
    log = FlightLog(path, LogSubject(facts, {}, {}, 16.0, (0.15, 0.15)))
    log.begin(1_000_000, lockstep=True)
    log.add(inputs(1_000_000, Random(0)), outputs_at(1_000_000))
    log.close()


def test_the_keys_of_the_result_on_the_page_are_those_that_are_written() -> None:
    result = as_json(FlightReports("walls", 0, "blf", None, None, None, {}))
    rows = re.findall(r"^\| (`.*?) \| (.*) \|$", (DOCS / "result.md").read_text("utf-8"), re.M)
    meaning = {key: text for keys, text in rows for key in re.findall(r"`(\w+)`", keys)}
    assert list(meaning) == list(result)
    for part in ("mpc", "inner", "control_effort", "control_smoothness"):
        assert set(re.findall(r"`(\w+)`", meaning[part])) == set(result[part])


def test_the_reference_of_messages_is_not_stale() -> None:
    page = (DOCS / "messages.md").read_text(encoding="utf-8")
    assert page == reference(traffic()), "run python -m docs.generators.message_page"


def test_the_topics_of_the_flight_log_are_not_stale() -> None:
    page = (DOCS / "flight-log.md").read_text(encoding="utf-8")
    assert page == inserted(page), "run python -m fsw.log.reference"


def test_the_reference_of_parameters_is_not_stale() -> None:
    page = DOCS / "parameters.md"
    expected = parameter_reference()
    assert page.read_text(encoding="utf-8") == expected, "run python -m fsw.parameters.reference"


def test_the_reference_of_messages_names_all_that_is_sent_and_heard() -> None:
    rows = {row.message_id: row for row in traffic()}
    assert {stream.message_id for stream in STREAMS} <= {i for i, r in rows.items() if r.component}
    site = Site(lambda *_: (0.0, 0.0, 0.0), lambda _: (), lambda: 0.1)
    assert MissionService(MissionStore(site)).message_ids == frozenset(OF_MISSIONS)
    assert {ids.COMMAND_LONG, ids.TIMESYNC, ids.PARAM_SET, *OF_MISSIONS} <= {
        i for i, row in rows.items() if row.heard
    }


def test_the_streams_on_the_page_are_those_that_are_sent() -> None:
    text = (DOCS / "ground-station.md").read_text(encoding="utf-8")
    table = text.split("<!-- streams -->\n")[1].split("<!-- end -->")[0]
    shown = [
        tuple(cell.strip() for cell in line.strip("|").split("|"))
        for line in table.strip().splitlines()[2:]
    ]
    assert shown == [
        (
            dialect.mavlink_map[stream.message_id].msgname,
            f"{stream.ground_hz:g}",
            f"{stream.api_hz:g}",
            str(stream.component),
        )
        for stream in STREAMS
    ]


def test_the_barrier_constants_on_the_page_are_those_that_are_flown() -> None:
    text = (DOCS / "equations.md").read_text(encoding="utf-8")
    config = PlannerConfig()
    for name, tuning in (("walls", config.walls), ("sphere", config.workspace)):
        cells = (tuning.alpha, tuning.slope, tuning.gamma, tuning.robustness)
        assert f"| {name} | " + " | ".join(f"{value:g}" for value in cells) + " |" in text


@pytest.mark.parametrize("name", ["frames", "architecture"])
def test_drawings_are_what_their_script_draws(name: str, tmp_path: Path) -> None:
    drawn = tmp_path / f"{name}.svg"
    script = DOCS / "figures" / f"{name}.py"
    subprocess.run([sys.executable, str(script), str(drawn)], check=True, cwd=ROOT)
    assert drawn.read_bytes() == (DOCS / "images" / f"{name}.svg").read_bytes()


@pytest.mark.parametrize("image", sorted((DOCS / "images").glob("*.svg")), ids=named)
def test_drawings_are_well_formed(image: Path) -> None:
    assert ET.parse(image).getroot().tag.endswith("svg")
