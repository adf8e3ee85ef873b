"""Links and files of the pages exist, and their tables are those of the code."""

from __future__ import annotations

import dataclasses
import re
from pathlib import Path

import pytest

from docs.pages.failsafes import WORDS, words
from docs.pages.failsafes import reference as failsafe_reference
from docs.pages.messages import OF_MISSIONS, reference, traffic
from docs.pages.parameters import reference as parameter_reference
from docs.pages.sensors import TABLES
from docs.pages.sensors import inserted as with_sensors
from docs.pages.topics import inserted
from fsw.autopilot.flight.failsafe.table import FAILSAFES
from fsw.autopilot.mpc.planner_config import PlannerConfig
from fsw.link.services.mission_service import MissionService
from fsw.link.services.mission_store import MissionStore, Site
from fsw.link.telemetry.streams import STREAMS
from messages import dialect
from messages import message_ids as ids
from pandion.result import FlightReports, as_json
from sitl.sensors.keys import Timing
from tests.docs.fences import DOCS, PAGES, ROOT, named, without_fences

REFERENCE = DOCS / "reference"


def anchors(page: Path) -> set[str]:
    """Fragments that GitHub gives to the headings of a page."""
    headings = re.findall(r"^#+ (.+)$", without_fences(page), re.MULTILINE)
    plain = [re.sub(r"[^\w\- ]", "", heading.lower()) for heading in headings]
    return {heading.replace(" ", "-") for heading in plain}


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_links_resolve(page: Path) -> None:
    broken = []
    for target in re.findall(r"\]\(([^)\s]+)\)", without_fences(page)):
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
        r"`((?:fsw|sitl|messages|pandion|tests|docs)/[\w./-]*)`", without_fences(page)
    )
    generated = {"messages/dialect.py"}
    files = [name for name in names if not re.search(r"-v\d+$", name)]  # no environments
    assert [name for name in files if name not in generated and not (ROOT / name).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=named)
def test_a_table_is_one_block_with_a_header(page: Path) -> None:
    """Rows that an empty line cuts off are shown as text: they have no header of their own."""
    blocks = re.findall(r"(?:^[ ]*\|.*\n?)+", without_fences(page), re.MULTILINE)
    headless = [
        block.splitlines()[0]
        for block in blocks
        if not re.match(r"[^\n]*\n[ ]*\|(?:[ ]*:?-+:?[ ]*\|)+[ ]*(?:\n|$)", block)
    ]
    assert headless == []


def test_decisions_that_the_code_cites_exist() -> None:
    cited = {
        name
        for half in ("fsw", "sitl", "pandion", "messages")
        for path in (ROOT / half).rglob("*.py")
        for name in re.findall(r"docs/[\w/-]+\.md", path.read_text(encoding="utf-8"))
    }
    assert [name for name in sorted(cited) if not (ROOT / name).exists()] == []


def test_the_keys_of_the_result_on_the_page_are_those_that_are_written() -> None:
    result = as_json(FlightReports("walls", 0, "blf", None, None, None, {}))
    rows = re.findall(r"^\| (`.*?) \| (.*) \|$", (REFERENCE / "result.md").read_text("utf-8"), re.M)
    meaning = {key: text for keys, text in rows for key in re.findall(r"`(\w+)`", keys)}
    assert list(meaning) == list(result)
    for part in ("mpc", "inner", "control_effort", "control_smoothness"):
        assert set(re.findall(r"`(\w+)`", meaning[part])) == set(result[part])


def test_the_reference_of_messages_is_not_stale() -> None:
    page = (REFERENCE / "messages.md").read_text(encoding="utf-8")
    assert page == reference(traffic()), "run make pages"


def test_the_topics_of_the_flight_log_are_not_stale() -> None:
    page = (REFERENCE / "flight-log.md").read_text(encoding="utf-8")
    assert page == inserted(page), "run make pages"


def test_the_tables_of_the_sensors_are_not_stale() -> None:
    page = (REFERENCE / "sensors.md").read_text(encoding="utf-8")
    assert page == with_sensors(page), "run make pages"


def test_every_number_of_a_suite_has_a_place_in_a_table() -> None:
    """A key that a table leaves out would be one that nobody can look up."""
    page = (REFERENCE / "sensors.md").read_text(encoding="utf-8")
    for name, kind in TABLES.items():
        table = page.split(f"### `[sensors.{name}]`")[1].split("###")[0]
        own = {field.name for field in dataclasses.fields(kind)}
        own -= {field.name for field in dataclasses.fields(Timing)}
        assert own <= set(re.findall(r"^- `(\w+)`", table, re.MULTILINE)), name


def test_the_reference_of_parameters_is_not_stale() -> None:
    page = REFERENCE / "parameters.md"
    expected = parameter_reference()
    assert page.read_text(encoding="utf-8") == expected, "run make pages"


def test_the_failsafe_table_on_the_page_is_the_one_that_is_flown() -> None:
    page = (REFERENCE / "failsafes.md").read_text(encoding="utf-8")
    assert page == failsafe_reference(), "run make pages"


def test_the_reference_of_messages_names_all_that_is_sent_and_heard() -> None:
    rows = {row.message_id: row for row in traffic()}
    assert {stream.message_id for stream in STREAMS} <= {i for i, r in rows.items() if r.component}
    site = Site(lambda *_: (0.0, 0.0, 0.0), lambda: 0.1)
    assert MissionService(MissionStore(site)).message_ids == frozenset(OF_MISSIONS)
    assert {ids.COMMAND_LONG, ids.TIMESYNC, ids.PARAM_SET, *OF_MISSIONS} <= {
        i for i, row in rows.items() if row.heard
    }


def test_the_streams_on_the_page_are_those_that_are_sent() -> None:
    text = (REFERENCE / "messages.md").read_text(encoding="utf-8")
    rows = dict(re.findall(r"^\| ([^|]+) \| (.+) \|$", text, re.MULTILINE))
    for stream in STREAMS:
        name = dialect.mavlink_map[stream.message_id].msgname
        rate = f"{stream.ground_hz:g}/{stream.api_hz:g}"
        of_rate = [
            messages
            for shown, messages in rows.items()
            if shown == ("on request" if rate == "0/0" else rate) or shown.startswith(f"{rate},")
        ]
        assert any(re.search(rf"\b{name}\b", messages) for messages in of_rate), name


def test_the_barrier_constants_on_the_page_are_those_that_are_flown() -> None:
    text = (DOCS / "equations.md").read_text(encoding="utf-8")
    config = PlannerConfig()
    for name, tuning in (("walls", config.walls), ("sphere", config.workspace)):
        cells = (tuning.alpha, tuning.slope, tuning.gamma, tuning.lambda_)
        assert f"| {name} | " + " | ".join(f"{value:g}" for value in cells) + " |" in text


def test_the_pages_have_words_for_every_row_of_the_failsafe_table_and_for_no_other() -> None:
    assert set(WORDS) == {row.condition.name for row in FAILSAFES}
    for row in FAILSAFES:
        acts = {name for name in row.parameters if name.endswith("_ACT") or name == "GF_ACTION"}
        assert words(row).does or acts, f"nothing says what is done about {row.condition.value}"
