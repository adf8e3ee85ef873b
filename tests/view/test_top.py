"""The inspector in a terminal: what it counts, and what it shows."""

from __future__ import annotations

import asyncio
import contextlib
from typing import Any

import pytest
from textual.widgets import DataTable, Input, RichLog

from fsw.link.udp_endpoint import OpenEndpoint
from messages.frames import FrameWriter, split, wire_fields
from pandion.top import main
from tests.waiting import wait_for
from view.top.app import TopApp, shown_value
from view.top.inspector import Inspector
from view.top.peer import Message, TelemetryPeer, meaning, messages, unit

HEARTBEAT, LOCAL_POSITION_NED, STATUSTEXT = 0, 32, 253
BARRIER_MARGIN, MPC_STATUS = 60203, 60204
VEHICLE, ARM = FrameWriter(1, 1), FrameWriter(1, 191)
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


def seen(*frames: bytes, at: float = 0.0) -> Inspector:
    inspector = Inspector()
    for one in frames:
        inspector.see(messages(one, at))
    return inspector


def test_a_rate_is_counted_over_the_last_seconds() -> None:
    inspector = Inspector()
    for k in range(100):
        inspector.see(messages(beat(), 0.1 * k))
    stream = inspector.streams["HEARTBEAT", 1]
    assert stream.rate(9.9) == pytest.approx(10.0, rel=0.05)
    assert (stream.count, stream.age(12.0)) == (100, pytest.approx(2.1))
    assert stream.rate(20.0) == 0.0


def test_streams_of_two_components_are_two() -> None:
    inspector = seen(beat(), frame(ARM, HEARTBEAT))
    assert set(inspector.streams) == {("HEARTBEAT", 1), ("HEARTBEAT", 191)}


def test_the_headline_says_mode_arming_place_and_margin() -> None:
    place = frame(VEHICLE, LOCAL_POSITION_NED, x=1.5, y=-0.25, z=-1.4)
    status = frame(ARM, MPC_STATUS, plan_id=17, total_us=830)
    shown = seen(beat(), place, margins(0.3, 0.042), status).headline(0.5)
    for part in ("armed", "active", "N +1.50 E -0.25 up 1.40 m", "margin 42 mm", "plan 17",
                 "0.8 ms"):  # fmt: skip
        assert part in shown
    assert "disarmed" in seen(beat(armed=False)).headline(0.0)
    assert seen(beat()).headline(5.0) == "vehicle lost: silent for 5 s"
    assert Inspector().headline(0.0) == "no vehicle has answered yet"


def test_margins_are_those_of_the_message_and_the_least_is_marked() -> None:
    found = seen(margins(0.3, -0.01, 0.2)).margins()
    assert [round(one.margin, 3) for one in found] == [0.3, -0.01, 0.2]
    assert [one.least for one in found] == [False, True, False]


def test_a_long_text_is_joined() -> None:
    first, second = b"x" * 50, b"the end"
    inspector = seen(said(first, number=7), said(b"short"), said(second, 4, number=7, chunk=1))
    assert [one.text for one in inspector.texts] == ["short", "x" * 50 + "the end"]
    assert inspector.texts[1].severity == 4


def test_fields_have_units_and_names_of_values() -> None:
    (message,) = messages(beat(), 0.0)
    assert message.fields["system_status"] == 4
    assert meaning(HEARTBEAT, "system_status", 4) == "ACTIVE"
    assert meaning(HEARTBEAT, "base_mode", 128) == ""  # a set of flags is no name
    assert unit(LOCAL_POSITION_NED, "x") == "m"
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
        assert [one.name for one in came] == ["HEARTBEAT", "BARRIER_MARGIN"]
        peer.poll(1.1)
        wait_for(vehicle.receive_waiting, "the second heartbeat")


class Fed:
    """A peer that hears what it is given."""

    def __init__(self) -> None:
        self.waiting: list[bytes] = []
        self.now = 10.0
        self.closed = False

    def poll(self, now: float) -> list[Message]:
        frames, self.waiting = self.waiting, []
        return [message for one in frames for message in messages(one, now)]

    def close(self) -> None:
        self.closed = True


def cells(table: DataTable[Any], row: int) -> list[str]:
    return [str(cell) for cell in table.get_row_at(row)]


def test_what_is_shown_and_what_keys_do() -> None:
    asyncio.run(drive())


async def drive() -> None:
    fed = Fed()
    app = TopApp(fed, lambda: fed.now)
    async with app.run_test(size=(140, 40)) as pilot:
        fed.waiting = [margins(0.3, 0.02), beat(), said(b"no plan in time", 3)]
        app.refresh_all()
        await pilot.pause()
        streams = app.query_one("#streams", DataTable)
        names = [cells(streams, row)[0] for row in range(streams.row_count)]
        assert names == ["BARRIER_MARGIN", "HEARTBEAT", "STATUSTEXT"]
        assert cells(app.query_one("#margins", DataTable), 1)[:2] == ["2", "20"]
        assert "no plan in time" in "".join(
            strip.text for strip in app.query_one("#texts", RichLog).lines
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
        assert app.inspector.streams["HEARTBEAT", 1].count == 2
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


def test_without_a_terminal_or_with_a_bad_address_one_sentence(capsys: Any) -> None:
    for words, expected in (
        (["--vehicle=nowhere"], "is not of the form udp:HOST:PORT"),
        ([], "ssh -t HOST pandion top"),
    ):
        assert main(words) == 2
        complaint = capsys.readouterr().err
        assert complaint.count("\n") == 1
        assert expected in complaint
