"""The directory of a campaign: whose rows it has, how many, and that it can be gone on with."""

from __future__ import annotations

import json
import os
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pytest

from sitl.scenario_file import load_scenario
from sitl.scenario_text import scenario_text
from studies.campaign.campaign import Campaign
from studies.campaign.flight import CampaignFlight, CampaignRow
from studies.campaign.journal import Journal, JournalError, JournalInUseError
from studies.campaign.keys import CampaignError
from studies.campaign.plan import CampaignPlan, load_plan
from studies.campaign.store import FACTS, JOURNAL, PLAN, begin, read, refuse_campaign, sealed_facts
from vehicles.vehicle_file import PACKAGED

FILE = """\
flights = 4
duration_s = 2.0
scenarios = ["walls-calm"]
[vary]
vehicle_scale.mass = { uniform = [0.95, 1.05] }
"""


def put(
    directory: Path, plan: CampaignPlan, numbers: range, own_key: str = "", **changed: Any
) -> None:
    """Rows of flights of a plan as they would be kept, without flying."""
    rows = [
        replace(
            CampaignFlight(plan, k).broken(""), error=False, completed=True, margin_m=0.1,
            duration_s=2.0,
        )
        for k in numbers
    ]  # fmt: skip
    journal = Journal(directory / JOURNAL)
    journal.append(
        (own_key or CampaignFlight(plan, row.flight).key(), asdict(row) | changed) for row in rows
    )
    journal.close()
    seal(directory)


def seal(directory: Path) -> None:
    """Write of the journal what a campaign does at its end, if the facts can be read."""
    journal = Journal(directory / JOURNAL)
    journal.close()
    if (directory / FACTS).read_text():
        write_anew(directory, journal=asdict(journal.seal))


def write_anew(directory: Path, **changed: Any) -> None:
    """Write other facts as a campaign itself would, with their seal."""
    facts = json.loads((directory / FACTS).read_text())
    (directory / FACTS).write_text(json.dumps(sealed_facts(facts | changed)))


def begun(folder: Path, flights: int | None = None) -> tuple[Path, Path, CampaignPlan]:
    """File, directory and plan of a campaign without a row."""
    source, directory = folder / "small.toml", folder / "out"
    source.write_text(FILE)
    plan = load_plan(source)
    begin(directory, source, plan, flights)
    return source, directory, plan


def test_a_campaign_of_an_own_vehicle_is_read_from_its_kept_copy(tmp_path: Path) -> None:
    """A plan is of what the vehicle is, not of where its file lies."""
    vehicle, directory = tmp_path / "mine.toml", tmp_path / "out"
    vehicle.write_text((PACKAGED / "hexa-3r.toml").read_text())
    text = scenario_text(replace(load_scenario("walls-calm"), vehicle="hexa-3r"))
    (tmp_path / "own.toml").write_text(text.replace("hexa-3r", "mine.toml"))
    source = tmp_path / "small.toml"
    source.write_text(FILE.replace("walls-calm", "own.toml"))
    plan = load_plan(source)
    begin(directory, source, plan)
    put(directory, plan, range(4))
    assert read(directory).complete
    assert load_plan(directory / PLAN).flight(1).job.key() == plan.flight(1).job.key()
    kept = directory / "mine.toml"
    kept.write_text(kept.read_text().replace("mass = 2.0128", "mass = 2.5"))
    with pytest.raises(CampaignError, match="was changed after it was flown"):
        read(directory)


def test_rows_of_another_command_do_not_stand_for_flights(tmp_path: Path) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    good = read(directory).rows
    # As pandion tune flies them: the same numbers, other parameters.
    put(directory, replace(plan, seed=plan.seed + 1), range(4), contact=True)
    put(directory, plan, range(4), own_key="of something else", contact=True)
    found = read(directory)
    assert found.rows == good
    assert found.left_out == 8
    assert read(directory).complete


def test_rows_of_an_earlier_state_of_the_code_count_as_its_own(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("studies.campaign.flight.code", lambda: "a" * 64)
    monkeypatch.setattr("studies.campaign.store.code", lambda: "a" * 64)
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    monkeypatch.undo()
    found = read(directory)
    assert (len(found.rows), found.left_out) == (4, 0)
    assert found.digests.code == "a" * 64


def test_a_directory_of_a_campaign_is_for_no_other_command(tmp_path: Path) -> None:
    _, directory, _ = begun(tmp_path)
    refuse_campaign(tmp_path / "new")
    with pytest.raises(CampaignError, match="is the directory of a campaign; give another --out"):
        refuse_campaign(directory)


def test_no_flight_is_left_out_because_fewer_are_asked_for(tmp_path: Path) -> None:
    source, directory, plan = begun(tmp_path, 6)
    put(directory, plan, range(6))
    with pytest.raises(CampaignError, match="a campaign of 6 flights, and none may be left out"):
        begin(directory, source, plan, 2)
    assert begin(directory, source, plan) == 6
    assert begin(directory, source, plan, 7) == 7
    # Nor because the number was lowered by hand.
    write_anew(directory, flights=2)
    found = read(directory)
    assert found.asked == len(found.rows) == 6
    with pytest.raises(CampaignError, match="a campaign of 6 flights"):
        begin(directory, source, plan, 2)


def test_two_campaigns_do_not_write_to_one_directory(tmp_path: Path) -> None:
    source, directory, plan = begun(tmp_path)
    first = Journal(directory / JOURNAL)
    with pytest.raises(JournalInUseError, match="is being written by another process"):
        begin(directory, source, plan, 9)
    with pytest.raises(JournalInUseError):
        Campaign[CampaignRow](0, directory / JOURNAL).run([CampaignFlight(plan, 0)])
    assert read(directory).asked == 4
    first.close()
    assert begin(directory, source, plan, 9) == 9


@pytest.mark.parametrize("left", ["", "{", None, '{"flights": Infinity}'])
def test_facts_that_a_crash_took_follow_from_file_and_rows(
    tmp_path: Path, left: str | None
) -> None:
    source, directory, plan = begun(tmp_path, 6)
    put(directory, plan, range(6))
    whole = read(directory)
    if left is None:
        (directory / FACTS).unlink()
    else:
        (directory / FACTS).write_text(left)
    with pytest.raises(CampaignError, match="is damaged"):
        read(directory)
    assert begin(directory, source, plan) == 6
    assert read(directory) == whole


def test_facts_are_not_made_up_for_rows_of_something_else(tmp_path: Path) -> None:
    source, directory, plan = begun(tmp_path)
    put(directory, plan, range(4), own_key="of something else")
    (directory / FACTS).write_text("")
    with pytest.raises(CampaignError, match="a journal of something else"):
        begin(directory, source, plan)
    (directory / JOURNAL).unlink()
    put(directory, plan, range(4))
    (directory / PLAN).unlink()
    with pytest.raises(CampaignError, match="not the campaign file that they were flown from"):
        begin(directory, source, plan)


@pytest.mark.parametrize(
    "facts",
    [
        '{"flights": Infinity}',
        '{"flights": true}',
        '{"flights": "4"}',
        '{"name": "\\ud800"}',
        "[1]",
        "[" * 9999,
    ],
)
def test_facts_that_cannot_be_used_are_refused_in_a_sentence(tmp_path: Path, facts: str) -> None:
    _, directory, _ = begun(tmp_path)
    kept = json.loads((directory / FACTS).read_text())
    if facts.startswith("{"):
        facts = json.dumps(sealed_facts(kept | json.loads(facts)))
    (directory / FACTS).write_text(facts)
    with pytest.raises(CampaignError, match=r"campaign\.json is not there, is damaged"):
        read(directory)


@pytest.mark.parametrize(
    "changed",
    [
        {"version": "9.9.9"},
        {"name": "x\x1b[31m<script>"},
        {"flights": 3},
        {"journal": {"lines": 0, "digest": "0" * 64}},
        {"seal": "0" * 64},
        {"more": 1},
    ],
)
def test_facts_that_were_changed_are_refused(tmp_path: Path, changed: dict[str, Any]) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(4))
    assert read(directory).complete
    kept = json.loads((directory / FACTS).read_text())
    (directory / FACTS).write_text(json.dumps(kept | changed))
    with pytest.raises(CampaignError, match=r"campaign\.json .* was changed"):
        read(directory)


@pytest.mark.parametrize(
    "wrong",
    [
        {"flight": "0"},
        {"margin_m": "low"},
        {"margin_m": 2**53 + 1},
        {"margin_m": 10**19},
        {"plans": 2**63},
        {"contact": 1},
        {"values": [1]},
        {"values": {"a": "b"}},
        {"values": {"a": 1}},
        {"values": {}},
        {"values": {"vehicle_scale.mass": 2**53 + 1}},
        {"values": {"vehicle_scale.mass": float("nan")}},
    ],
)
def test_a_line_of_other_types_is_no_row(tmp_path: Path, wrong: dict[str, Any]) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(1, 4))
    put(directory, plan, range(1), **wrong)
    found = read(directory)
    assert [row.flight for row in found.rows] == [1, 2, 3]
    assert found.left_out == 1
    with pytest.raises(TypeError):
        CampaignFlight(plan, 0).from_line(asdict(found.rows[0]) | wrong)


def test_a_row_under_the_key_of_another_flight_is_flown_again(tmp_path: Path) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(1))
    (row,) = read(directory).rows
    assert CampaignFlight(plan, 0).from_line(asdict(row)) == row
    with pytest.raises(TypeError, match="flight = 0 under the key of flight 1"):
        CampaignFlight(plan, 1).from_line(asdict(row))


def test_a_flight_that_did_not_break_has_one_row(tmp_path: Path) -> None:
    _, directory, plan = begun(tmp_path)
    put(directory, plan, range(2), error=True, completed=False)
    put(directory, plan, range(4))  # what broke was flown again
    assert read(directory).complete
    put(directory, plan, range(1), margin_m=0.2)
    with pytest.raises(JournalError, match="line 7 is a second row of flight 0"):
        read(directory)


def test_facts_are_on_the_disk_before_their_name_is(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    done: list[str] = []
    sync, rename = os.fsync, Path.replace

    def synchronised(file: int) -> None:
        done.append("folder" if os.path.isdir(f"/proc/self/fd/{file}") else "file")  # noqa: PTH112
        sync(file)

    def renamed(self: Path, target: Path) -> Path:
        done.append("renamed")
        return rename(self, target)

    monkeypatch.setattr("studies.campaign.store.os.fsync", synchronised)
    monkeypatch.setattr(Path, "replace", renamed)
    begun(tmp_path)
    assert done[-3:] == ["file", "renamed", "folder"]
