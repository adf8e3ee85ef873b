"""The link of the live page: what it announces, and that no vehicle keeps it from its work."""

from __future__ import annotations

import contextlib
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import replace

import pytest

from fsw.autopilot.model.airframe import AIRFRAME, airframe_of
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.signals import SafeSet, Touch, Zone
from fsw.link.telemetry.streams import messages_now
from fsw.link.wire import decode
from fsw.link.wire.outgoing import Outgoing
from messages import message_ids as ids
from messages.addresses import parse_link_address
from messages.frames import Frame, FrameWriter, split
from tests.fsw.link.snapshots import CONTEXT, SNAPSHOT
from tests.speakers import Flood, Speaker
from tests.waiting import wait_for
from vehicles.vehicle_file import load_vehicle
from view import live_link
from view.live_link import VehicleLink

WRITERS = {component: FrameWriter(1, component) for component in (1, 25)}
TOUCHED = Zone(ball((1.0, 2.0, -1.0), 0.5), 0.25, touch=Touch(10.0, 500.0, 1000.0, 0.5, 0.25))
INSIDE = Zone(ball((0.0, 0.0, -2.0), 8.0), 0.5, keep_in=True)
NO_FENCE, FENCE = {0: 1, 1: 0, 2: 0}, {0: 1, 1: 7, 2: 0}


class Vehicle(Speaker):
    """Answers what it is asked for; ``told`` is what was announced to it."""

    def __init__(self, *zones: Zone, plan_ids: dict[int, int] | None = None) -> None:
        self.asked: set[int] = set()
        self.told: list[decode.IndexedObstacle] = []
        self.change: Callable[[Outgoing], Outgoing] = lambda one: one
        self._snapshot = replace(SNAPSHOT, safe_set=SafeSet(zones))
        self._context = replace(CONTEXT, plan_ids=plan_ids or NO_FENCE)
        own = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        own.bind(("127.0.0.1", 0))
        super().__init__(own)

    def _run(self) -> None:
        while not self._ended:
            try:
                datagram, where = self.socket.recvfrom(2048)
            except TimeoutError:
                continue
            for frame in split(datagram):
                for one in self._answer(frame):
                    sent = self.change(one)
                    data = WRITERS[sent.component].frame(sent.message_id, *sent.values)
                    self.socket.sendto(data, where)

    def _answer(self, frame: Frame) -> list[Outgoing]:
        values = frame.payload_values
        if frame.message_id == ids.OBSTACLE_SHAPE:
            zone = decode.obstacle_shape(values)  # type: ignore[arg-type]
            assert zone is not None
            self.told.append(zone)
        if frame.message_id != ids.COMMAND_LONG:
            return []
        self.asked.add(int(values[0]))
        if values[7] != 512:
            return []
        return list(messages_now(int(values[0]), 0.0, self._snapshot, self._context) or ())


@contextlib.contextmanager
def spoken_to(vehicle: Vehicle, airframe: str = "paper") -> Iterator[VehicleLink]:
    known = airframe_of(load_vehicle(airframe))
    link = VehicleLink(vehicle.socket.getsockname(), known, commands=True)
    with contextlib.closing(vehicle), contextlib.closing(link):
        link.start()
        yield link


def test_a_set_is_announced_again_with_all_that_it_was() -> None:
    vehicle = Vehicle(TOUCHED, INSIDE)
    with spoken_to(vehicle) as link:
        assert link.announce((3.0, 0.0, -1.0), 0.25) is None
        wait_for(lambda: len(vehicle.told) == 3, "the set")
    assert [one.zone for one in vehicle.told[:2]] == [TOUCHED, INSIDE]
    assert vehicle.told[2].zone.shape == ball((3.0, 0.0, -1.0), 0.25)
    assert [(one.index, one.count) for one in vehicle.told] == [(0, 3), (1, 3), (2, 3)]


def unknown_kind(one: Outgoing) -> Outgoing:
    if one.message_id != ids.OBSTACLE_SHAPE:
        return one
    return replace(one, values=(*one.values[:25], 99, *one.values[26:]))


def no_mission(one: Outgoing) -> Outgoing:
    unheard = one.message_id == ids.MISSION_CURRENT
    return Outgoing(ids.STATUSTEXT, (6, b"", 0, 0)) if unheard else one


@pytest.mark.parametrize(
    ("plan_ids", "change", "words"),
    [
        (FENCE, lambda one: one, "a fence is in force, and the vehicle does not say which zones"),
        (NO_FENCE, no_mission, "there may be a fence, and the vehicle does not say which zones"),
        (NO_FENCE, unknown_kind, "zone 1 is not shown: it is of no known kind"),
    ],
)
def test_what_is_not_known_whole_is_not_written_back(
    plan_ids: dict[int, int], change: Callable[[Outgoing], Outgoing], words: str
) -> None:
    vehicle = Vehicle(INSIDE, plan_ids=plan_ids)
    vehicle.change = change
    with spoken_to(vehicle) as link:
        refusal = link.announce((3.0, 0.0, -1.0), 0.25)
    assert refusal is not None
    assert refusal.startswith(f"no obstacle: {words}")
    assert "\n" not in refusal
    assert vehicle.told == []


def test_a_ball_that_fits_no_message_is_refused_in_a_sentence() -> None:
    vehicle = Vehicle()
    with spoken_to(vehicle) as link:
        refusal = link.announce((1e300, 0.0, 0.0), 0.25)
    assert refusal is not None
    assert refusal.startswith("no obstacle: centre north [m] is 1e+300; at most ")


@pytest.mark.parametrize(("airframe", "asks"), [("paper", False), ("hexa-3r", True)])
def test_all_joints_of_a_plan_are_asked_for(airframe: str, asks: bool) -> None:
    vehicle = Vehicle()
    with spoken_to(vehicle, airframe):
        wait_for(lambda: ids.OBSTACLE_SHAPE in vehicle.asked, "the last request")
    assert (ids.MPC_HORIZON_ARM in vehicle.asked) is asks


def test_numbers_that_fit_no_message_end_no_link() -> None:
    vehicle = Vehicle()
    with spoken_to(vehicle) as link:
        link.aim((1e300, 0.0, 0.0))
        texts = wait_for(
            lambda: [one.text for one in link.read(lambda t: tuple(t.events))], "a sentence"
        )
        link.aim(None)
        assert link.is_alive()
    assert [one for one in texts if one.startswith("not sent: ")]


def test_a_stream_that_never_pauses_keeps_the_link_from_nothing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flood = Flood()
    with contextlib.closing(flood):
        link = VehicleLink(parse_link_address(flood.address), AIRFRAME, commands=True)
        beats: list[float] = []
        monkeypatch.setattr(live_link, "_BEAT_S", 0.1)
        monkeypatch.setattr(link, "_beat", lambda: beats.append(time.monotonic()))
        link.start()
        wait_for(lambda: len(beats) > 5, "heartbeats")
        wait_for(lambda: link.read(lambda t: t.heard), "messages")
        began = time.monotonic()
        link.close()
    assert time.monotonic() - began < 2.0
