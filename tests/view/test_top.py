"""The inspector in a terminal: what it counts, and what it shows."""

from __future__ import annotations

import asyncio
import contextlib
import math
import sys
from typing import Any

import pytest
from textual.widgets import DataTable, Input, RichLog

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.link.endpoints import OpenEndpoint
from messages.frames import Frame, FrameWriter, split, wire_fields
from pandion.top import main
from tests.waiting import wait_for
from view.telemetry import Telemetry
from view.top.app import TopApp, headline, shown_value
from view.top.peer import TelemetryPeer, fields, meaning, unit

HEARTBEAT, SYS_STATUS, ATTITUDE, LOCAL_POSITION_NED, STATUSTEXT = 0, 1, 30, 32, 253
BARRIER_MARGIN, MPC_STATUS, SETPOINT_STATUS = 60203, 60204, 60209
VEHICLE, ARM = FrameWriter(1, 1), FrameWriter(1, 25)
AUTO_TRAJECTORY = 4 << 16 | 11 << 24


def frame(writer: FrameWriter, message_id: int, **values: Any) -> bytes:
    """A frame with these values; all others are zero."""
    flat: dict[str, Any] = {}
    for name, value in values.items():
        if isinstance(value, tuple):
            flat |= {f"{name}[{k}]": one for k, one in enumerate(value)}
        else:
            flat[name] = value
    names = wire_fields(message_id)
    assert set(flat) <= set(names)
    text = {"text"}
    return writer.frame(message_id, *(flat.get(n, b"" if n in text else 0) for n in names))


def beat(armed: bool = True) -> bytes:
    return frame(
        VEHICLE, HEARTBEAT, custom_mode=AUTO_TRAJECTORY, base_mode=128 * armed, system_status=4
    )


def margins(*values: float) -> bytes:
    least = min(range(len(values)), key=values.__getitem__)
    return frame(
        ARM, BARRIER_MARGIN, margin=values, barrier=(0.5,) * len(values), count=len(values),
        margin_min=min(values), margin_min_index=least,
    )  # fmt: skip


def said(text: bytes, severity: int = 6, number: int = 0, chunk: int = 0) -> bytes:
    return frame(VEHICLE, STATUSTEXT, severity=severity, text=text, id=number, chunk_seq=chunk)


def seen(*frames: bytes, now: float = 0.0) -> str:
    telemetry = Telemetry(AIRFRAME)
    for one in frames:
        for part in split(one):
            telemetry.take(part, 0.0)
    return headline(telemetry.scene(now))


def test_the_headline_says_mode_arming_place_and_margin() -> None:
    place = frame(VEHICLE, LOCAL_POSITION_NED, time_boot_ms=1000, x=1.5, y=-0.25, z=-1.4)
    attitude = frame(VEHICLE, ATTITUDE, time_boot_ms=1000)
    status = frame(ARM, MPC_STATUS, plan_id=17, total_us=830)
    shown = seen(beat(), place, attitude, margins(0.3, 0.042), status, now=0.5)
    for part in ("trajectory", "armed", "N +1.50 E -0.25 up 1.40 m", "margin 42 mm", "0.8 ms"):
        assert part in shown
    assert "disarmed" in seen(beat(armed=False))
    assert seen(beat(), now=5.0) == "vehicle lost: silent for 5 s"
    assert seen() == "no vehicle has answered yet"


def test_the_headline_says_who_speaks_where_the_vehicle_does_not() -> None:
    other = FrameWriter(2, 1)
    assert seen(frame(other, HEARTBEAT, autopilot=12)) == (
        "no vehicle of system 1 has answered yet; those of system 2 speak"
    )
    assert seen(frame(VEHICLE, ATTITUDE, time_boot_ms=1000)) == "no heartbeat"


def test_a_component_s_heartbeat_disarms_no_vehicle() -> None:
    of_component = frame(VEHICLE, HEARTBEAT, autopilot=8)
    assert "disarmed" not in seen(beat(), of_component)


def test_the_vehicle_is_heard_behind_any_crowd() -> None:
    crowd = [FrameWriter(s, c) for s in range(2, 40) for c in range(1, 255)]
    shown = seen(*(frame(one, HEARTBEAT, autopilot=12) for one in crowd), beat())
    assert "armed" in shown


def test_the_headline_counts_what_was_refused() -> None:
    assert "refused" not in seen(beat(), frame(ARM, SETPOINT_STATUS, refused=7), now=0.5)
    assert "3 refused" in seen(beat(), frame(ARM, SETPOINT_STATUS, refusals=3), now=0.5)
    assert "3 refused" in seen(
        beat(), margins(0.3), frame(ARM, SETPOINT_STATUS, refusals=3), now=0.5
    )


def test_the_headline_says_what_the_vehicle_dropped() -> None:
    status = frame(VEHICLE, SYS_STATUS, battery_remaining=80, errors_comm=3, errors_count1=12)
    assert "dropped 3 damaged, 12 echoes" in seen(beat(), status)
    unhandled = frame(VEHICLE, SYS_STATUS, errors_count3=7)
    assert "dropped" not in seen(beat(), unhandled), "a ground station sends much that is of no use"


def test_fields_have_units_and_names_of_values() -> None:
    (one,) = split(beat())
    assert fields(HEARTBEAT, one.payload_values)["system_status"] == 4
    assert meaning(HEARTBEAT, "system_status", 4) == "ACTIVE"
    assert meaning(HEARTBEAT, "base_mode", 128) == ""  # a set of flags is no name
    assert unit(LOCAL_POSITION_NED, "x") == "m"
    (held,) = split(margins(0.5, 0.25))
    assert fields(BARRIER_MARGIN, held.payload_values)["margin"][:3] == (0.5, 0.25, 0.0)  # type: ignore[index]
    assert shown_value((0.5, 1.0 / 3.0)) == "0.5 0.333333"


def test_the_peer_asks_once_a_second_and_is_no_ground_station() -> None:
    vehicle = OpenEndpoint(("127.0.0.1", 1))
    peer = TelemetryPeer(("127.0.0.1", vehicle.port))
    with contextlib.closing(vehicle), contextlib.closing(peer):
        assert peer.poll(0.0) == []
        assert peer.poll(0.5) == []
        datagram, address = wait_for(vehicle.receive_waiting, "the first heartbeat")
        assert vehicle.receive_waiting() is None
        (asked,) = split(datagram)
        assert (asked.message_id, asked.payload_values[1]) == (HEARTBEAT, 18)
        vehicle.send(beat() + margins(0.1), address)
        came = wait_for(lambda: peer.poll(0.7), "messages")
        assert [one.message_id for one in came] == [HEARTBEAT, BARRIER_MARGIN]
        peer.poll(1.1)
        wait_for(vehicle.receive_waiting, "the second heartbeat")


class Fed:
    """A peer that hears what it is given."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []
        self.now = 10.0
        self.closed = False

    def poll(self, now: float) -> list[Frame]:
        frames, self.waiting = self.waiting, []
        return [part for one in frames for part in split(one)]

    def close(self) -> None:
        self.closed = True


def cells(table: DataTable[Any], row: int) -> list[str]:
    return [str(cell) for cell in table.get_row_at(row)]


@pytest.mark.long
def test_what_is_shown_and_what_keys_do() -> None:
    asyncio.run(drive())


async def drive() -> None:
    fed = Fed()
    app = TopApp(fed, AIRFRAME, lambda: fed.now)
    async with app.run_test(size=(140, 40)) as pilot:
        fed.waiting = [margins(0.3, 0.02), beat(), said(b"no plan in time", 3)]
        app.refresh_all()
        await pilot.pause()
        streams = app.query_one("#streams", DataTable)
        names = [cells(streams, row)[0] for row in range(streams.row_count)]
        assert names == ["BARRIER_MARGIN", "HEARTBEAT", "STATUSTEXT"]
        assert cells(app.query_one("#margins", DataTable), 1)[1] == "20"
        assert "no plan in time" in "".join(
            strip.text for strip in app.query_one("#events", RichLog).lines
        )

        await pilot.press("down")  # to HEARTBEAT
        await pilot.pause()
        fields = app.query_one("#fields", DataTable)
        rows = {cells(fields, row)[0]: cells(fields, row) for row in range(fields.row_count)}
        assert rows["system_status"][1:] == ["4", "", "ACTIVE"]

        await pilot.press("p")
        fed.waiting = [beat()]
        app.refresh_all()
        await pilot.pause()
        assert app.telemetry.heard[1, 1, HEARTBEAT].count == 2
        assert cells(streams, 1)[3] == "1"  # the picture stands
        await pilot.press("p")
        app.refresh_all()
        assert cells(streams, 1)[3] == "2"

        await pilot.press("slash", *"barr")
        await pilot.pause()
        assert app.query_one("#filter", Input).value == "barr"
        assert [cells(streams, row)[0] for row in range(streams.row_count)] == ["BARRIER_MARGIN"]
        await pilot.press("escape")
        app.refresh_all()
        await pilot.pause()
        assert streams.row_count == 3
        await pilot.press("q")
    assert fed.closed


def test_a_crowd_is_sorted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    asyncio.run(show_a_crowd(monkeypatch))


async def show_a_crowd(monkeypatch: pytest.MonkeyPatch) -> None:
    fed = Fed()
    app = TopApp(fed, AIRFRAME, lambda: fed.now)
    async with app.run_test(size=(140, 40)) as pilot:
        await pilot.pause()
        sorts: list[Any] = []
        table = app.query_one("#streams", DataTable)
        monkeypatch.setattr(table, "sort", lambda *by, **how: sorts.append(by))
        fed.waiting = [
            frame(FrameWriter(s, c), HEARTBEAT) for s in range(2, 40) for c in range(1, 255)
        ]
        for _ in range(2):
            app.refresh_all()
        assert 500 < table.row_count <= 1100
        assert len(sorts) == 1
        await pilot.press("q")


def test_a_margin_that_is_not_finite_has_no_bar() -> None:
    asyncio.run(show_margins_that_are_not_finite())


async def show_margins_that_are_not_finite() -> None:
    fed = Fed()
    app = TopApp(fed, AIRFRAME, lambda: fed.now)
    async with app.run_test(size=(140, 40)) as pilot:
        await pilot.pause()  # until its widgets are there
        fed.waiting = [margins(math.nan, math.inf, 0.25)]
        app.refresh_all()
        await pilot.pause()
        table = app.query_one("#margins", DataTable)
        shown = [cells(table, row)[1::2] for row in range(table.row_count)]
        assert shown == [["nan", ""], ["inf", ""], ["250", 7 * "█"]]


class Broken(Fed):
    """A peer that no message comes from, but an error."""

    def poll(self, now: float) -> list[Frame]:
        raise RuntimeError("broken")


def test_the_exit_code_tells_that_an_exception_ended_it(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    run = TopApp.run
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    monkeypatch.setattr("view.top.peer.TelemetryPeer", lambda vehicle: Broken())
    monkeypatch.setattr(TopApp, "run", lambda self: run(self, headless=True))
    assert main([]) == 1
    assert "broken" in capsys.readouterr().err


def test_without_a_terminal_or_with_a_bad_address_one_sentence(capsys: Any) -> None:
    for words, expected in (
        (["--vehicle=nowhere"], "is not of the form udp:HOST:PORT"),
        ([], "ssh -t HOST pandion top"),
    ):
        assert main(words) == 2
        complaint = capsys.readouterr().err
        assert complaint.count("\n") == 1
        assert expected in complaint
