"""The soak sees what grows and what is not answered."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.soak import (
    Glance,
    Soaked,
    Used,
    grown,
    judge,
    main,
    recorded,
    starved,
    stood_still,
)
from benchmarks.soak_client import Client
from fsw.log.flight_log import TlogWriter
from messages import dialect
from messages.frames import FrameWriter

STEADY = [Glance(5.0 * k, 100.0, 8, 4) for k in range(100)]
FINE = Soaked(
    heard={"answered_s": [0.01], "unanswered": [], "parameters_missing": 0, "airborne_s": 400.0},
    dropped=0,
    read=1,
    written=1,
    glances={"fsw 1": STEADY, "planner 3": STEADY, "sitl 2": STEADY},
    ended="flew 500 s",
    flown_s=500.0,
)


def failed(glances: list[Glance], flown_s: float = 500.0, name: str = "planner 4") -> list[str]:
    """What a process does not pass that goes on like this, among others that are steady."""
    flown = replace(FINE, glances=FINE.glances | {name: glances}, flown_s=flown_s)
    return [row.name for row in judge([flown]) if not row.passed and "growth" in row.name]


def at(seconds: float, mb_h: float = 0.0, taken: float = 0.0, when: float = 0.5) -> list[Glance]:
    """A process of so many seconds that grows, and takes something at once at a share of them."""
    times = [5.0 * k for k in range(round(seconds / 5.0))]
    return [
        Glance(t, 100.0 + mb_h * t / 3600.0 + taken * (t > when * seconds), 8, 4) for t in times
    ]


def test_a_steady_process_has_not_grown_and_a_short_one_says_nothing() -> None:
    found = {what: value for what, (value, _) in grown(STEADY).items()}
    assert found == pytest.approx(
        {"memory": 0.0, "memory, steady": 0.0, "handles": 0.0, "threads": 0.0}
    )
    assert grown(STEADY[:30]) == {}


@pytest.mark.parametrize("minutes", [5, 8, 14, 60])
def test_a_leak_is_seen_in_minutes_and_what_is_taken_once_is_none(minutes: int) -> None:
    seconds = 60.0 * minutes
    assert "planner: memory, steady, growth" in failed(at(seconds, mb_h=12.0), seconds)
    assert not failed(at(seconds, mb_h=8.0), seconds)
    flown = replace(FINE, glances={"fsw 1": at(seconds, mb_h=8.0), "fsw 2": STEADY})
    shown = {row.name: row.measured for row in judge([flown])}
    assert shown["fsw: memory, steady, growth"] == pytest.approx(8.0)
    for when in (0.3, 0.5, 0.7, 0.9):
        assert not failed(at(seconds, taken=3.5, when=when), seconds)
    leaps = [one._replace(private_mb=100.0 + 20.0 * round(one.at_s / 900.0)) for one in at(seconds)]
    # One that comes in lumps is seen from the first lump on that is more than a process takes once.
    assert ("planner: memory, growth" in failed(leaps, seconds)) == (minutes >= 8)


def test_a_planner_that_fills_what_it_keeps_and_one_that_leaks() -> None:
    """As in 14 minutes with three landings: programs are kept, 4 MB in steps, and no more."""
    fills = [
        one._replace(private_mb=100.0 + min(4.0, 1.3 * round(one.at_s / 100.0)))
        for one in at(840.0)
    ]
    assert not failed(fills, 840.0)
    grows = [one._replace(private_mb=100.0 + 1.3 * round(one.at_s / 100.0)) for one in at(840.0)]
    assert "planner: memory, growth" in failed(grows, 840.0)


def test_handles_count_at_any_age_and_memory_at_a_quarter_of_the_flight() -> None:
    opens = [one._replace(handles=8 + (one.at_s > 300.0)) for one in STEADY]
    assert grown(opens, 600.0) == {"handles": (1, 0.0), "threads": (0, 0.0)}
    assert failed(opens) == ["planner: handles, growth"]
    leaks = at(300.0, mb_h=36.0)
    assert not failed(leaks, 3600.0)
    assert failed(leaks, 900.0)


def test_what_was_used_before_the_vehicle_spoke_is_no_part_of_the_flight() -> None:
    """Kernels were compiled for two minutes, and what a flight takes at its start was judged."""
    used = Used({"fsw 1": at(400.0), "fsw 2": at(60.0)}, begin_s=1000.0)
    later = used.since(1120.0)
    assert list(later) == ["fsw 1"]
    assert later["fsw 1"][0].at_s == 120.0


def test_a_vehicle_that_waited_for_a_processor_is_said_to_be_starved() -> None:
    def shares(share: float) -> list[Glance]:
        return [one._replace(waited_s=share * one.at_s) for one in STEADY]

    alone = replace(FINE, glances={"fsw 1": shares(0.01), "sitl 2": shares(0.02)})
    said = starved([alone])
    assert (
        said == "Flight 1 waited for a processor: fsw 1 %, sitl 2 %, at most 2 % of half a minute."
    )
    shared = starved([alone, replace(FINE, glances={"fsw 1": shares(0.3)})])
    assert shared.startswith(said)
    assert "Flight 2 waited for a processor: fsw 30 %" in shared
    assert shared.endswith("it was starved, and shows little.")


@pytest.mark.parametrize(
    ("flown", "fails"),
    [
        (FINE, set()),
        (replace(FINE, written=0), {"commands that were read and not answered"}),
        (
            replace(FINE, heard=FINE.heard | {"airborne_s": 200.0}),
            {"share of the time on the ground"},
        ),
        (
            replace(FINE, heard=FINE.heard | {"unanswered": [(3.0, 400)]}),
            {"commands without an answer within 1 s"},
        ),
        (
            replace(
                FINE,
                glances=FINE.glances
                | {
                    "sitl 2": [g._replace(threads=int(g.at_s)) for g in STEADY],
                },
            ),
            {"sitl: threads, growth"},
        ),
        (
            replace(FINE, glances=FINE.glances | {"sitl 2": STEADY[:30]}),
            {"processes that were not seen for long enough"},
        ),
    ],
)
def test_what_went_wrong_fails(flown: Soaked, fails: set[str]) -> None:
    assert {row.name for row in judge([flown]) if not row.passed} == fails


def test_the_record_counts_the_clients_commands_and_the_answers_to_it(tmp_path: Path) -> None:
    writer = TlogWriter(tmp_path / "flight.tlog", 1_700_000_000_000_000)
    client, other, vehicle = FrameWriter(255, 190), FrameWriter(254, 1), FrameWriter(1, 1)
    asked = (0.0,) * 7 + (dialect.MAV_CMD_RUN_PREARM_CHECKS, 1, 1, 0)
    for t_us, frame in enumerate(
        [
            client.frame(dialect.MAVLINK_MSG_ID_COMMAND_LONG, *asked),
            other.frame(dialect.MAVLINK_MSG_ID_COMMAND_LONG, *asked),
            client.frame(dialect.MAVLINK_MSG_ID_COMMAND_LONG, *asked),
            vehicle.frame(dialect.MAVLINK_MSG_ID_COMMAND_ACK, 401, 0, 0, 0, 255, 190),
            vehicle.frame(dialect.MAVLINK_MSG_ID_COMMAND_ACK, 401, 0, 0, 0, 254, 1),
        ]
    ):
        writer.add(t_us, frame)
    writer.close()
    assert recorded(tmp_path / "flight.tlog") == (2, 1)


def test_a_client_that_stood_still_says_when_and_for_how_long() -> None:
    class Held:
        """Holds the client once, as a machine that stands still would."""

        held = False

        def receive_waiting(self) -> None:
            if not self.held:
                self.held = True
                time.sleep(0.4)

        def close(self) -> None:
            """Nothing is open."""

    client = Client(0)
    client._endpoint.close()
    client._endpoint = Held()  # type: ignore[assignment]
    client.start()
    time.sleep(0.6)
    client.close()
    ((at_s, pause_s),) = client.heard.pauses
    assert 0.4 <= pause_s <= at_s + 0.01  # both are rounded
    flown = replace(FINE, heard={"pauses": client.heard.pauses, "gaps": []})
    assert f"client {pause_s:.2f} s" in stood_still([flown])


@pytest.mark.long
def test_half_a_minute_with_failures_is_answered(tmp_path: Path) -> None:
    found = tmp_path / "soak.json"
    main(["--minutes", "0.6", "--json", str(found)])
    rows = {row["name"]: row for row in json.loads(found.read_text())["rows"]}
    assert rows["commands without an answer within 1 s"]["pass"]
    assert rows["commands that were read and not answered"]["pass"]
    flights = json.loads(found.read_text())["flights"]
    assert sum(one["read"] for one in flights) > 50
    assert sum(one["heard"]["faults"] for one in flights) > 0
