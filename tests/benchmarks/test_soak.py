"""The soak sees what grows and what is not answered."""

from __future__ import annotations

import json
import time
from dataclasses import replace
from pathlib import Path

import pytest

from benchmarks.soak import Glance, Soaked, grown, judge, main, recorded, stood_still
from benchmarks.soak_client import Client
from fsw.log.tlog import TlogWriter
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


def test_a_steady_process_has_not_grown_and_a_short_one_says_nothing() -> None:
    assert grown(STEADY) == pytest.approx({"memory": 0.0, "handles": 0.0, "threads": 0.0})
    assert grown(STEADY[:30]) == {}


def test_a_leak_of_memory_and_of_handles_is_seen() -> None:
    leaks = [
        one._replace(resident_mb=100.0 + 0.01 * one.at_s, handles=8 + int(one.at_s / 100.0))
        for one in STEADY
    ]
    assert grown(leaks)["memory"] == pytest.approx(36.0)
    assert grown(leaks)["handles"] >= 2


def test_what_a_short_life_takes_once_is_no_growth_of_an_hour_and_handles_count_at_any_age() -> (
    None
):
    once = [one._replace(resident_mb=100.0 + (one.at_s > 200.0), handles=8) for one in STEADY]
    opens = [one._replace(handles=8 + (one.at_s > 300.0)) for one in once]
    assert grown(once)["memory"] > 5.0
    assert grown(opens, 600.0) == {"handles": 1, "threads": 0}
    leaks = [one._replace(resident_mb=100.0 + 0.01 * one.at_s) for one in STEADY]
    flown = replace(FINE, glances=FINE.glances | {"planner 4": leaks[:60]})
    assert all(
        row.passed for row in judge([replace(flown, flown_s=3600.0)]) if "growth" in row.name
    )
    flown = replace(FINE, glances=FINE.glances | {"planner 4": leaks})
    assert "planner: memory, growth" in [row.name for row in judge([flown]) if not row.passed]


@pytest.mark.parametrize(("seconds", "passes"), [(500.0, True), (3600.0, False)])
def test_what_is_taken_once_fails_an_hour_and_no_soak_of_minutes(
    seconds: float, passes: bool
) -> None:
    each = [one._replace(at_s=one.at_s * seconds / STEADY[-1].at_s) for one in STEADY]
    grows = [one._replace(resident_mb=100.0 + 18.0 * one.at_s / 3600.0) for one in each]
    flown = replace(FINE, glances=FINE.glances | {"fsw 1": grows}, flown_s=seconds)
    failed = [row.name for row in judge([flown]) if not row.passed and "memory" in row.name]
    assert failed == ([] if passes else ["fsw: memory, growth"])


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
