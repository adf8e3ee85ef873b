"""Two links at once: what they share, what they do not, and time."""

from __future__ import annotations

import socket
import threading
import time
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, closing
from dataclasses import replace
from pathlib import Path

import pytest

from fsw.autopilot.signals import CommandAck, MissionProgress
from fsw.link.endpoints import LinkError, OpenEndpoint
from fsw.link.ground_links import GroundLinks
from fsw.link.link_choice import LinkChoice, addresses
from fsw.link.services.service import LinkService, TimeService
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, split
from tests.fsw.link.ground import Ground, ground_station, station_socket
from tests.fsw.link.snapshots import outputs_at

HEARTBEAT = (0, 6, 8, 0, 4, 3)


def queued_us() -> int:
    """How long this thread was ready to run and another had the processor, since it began."""
    return int(Path("/proc/thread-self/schedstat").read_text().split()[1]) // 1000


def wall_us() -> int:
    return time.monotonic_ns() // 1000


@pytest.fixture
def both() -> Iterator[tuple[Ground, Ground, GroundLinks]]:
    with ExitStack() as stack:
        gcs = stack.enter_context(ground_station())
        api = stack.enter_context(ground_station(services=(TimeService(),), api=True))
        links = GroundLinks([gcs.link, api.link], 2_000, wall_us)
        gcs.links = api.links = links
        yield gcs, api, links


def speak(ground: Ground, system: int = 245) -> None:
    ground.polled(FrameWriter(system, 190).frame(ids.HEARTBEAT, *HEARTBEAT))


def test_a_program_that_has_not_spoken_hears_heartbeats_only(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    gcs, api, _ = both
    gcs.fly(1500)
    assert {frame.message_id for frame in api.heard()} == {ids.HEARTBEAT}
    speak(api)
    gcs.fly(500)
    counts = Counter(frame.message_id for frame in api.heard())
    assert abs(counts[ids.ATTITUDE_QUATERNION] - 50) <= 1


def test_a_rate_is_one_links_own(both: tuple[Ground, Ground, GroundLinks]) -> None:
    gcs, api, _ = both
    speak(api)
    command = (float(ids.ATTITUDE), 500_000.0, *(0.0,) * 5, 511, 1, 1, 0)
    api.polled(FrameWriter(245, 190).frame(ids.COMMAND_LONG, *command))
    frames = gcs.fly(1000)
    assert abs(sum(f.message_id == ids.ATTITUDE for f in frames) - 100) <= 1
    assert abs(sum(f.message_id == ids.ATTITUDE for f in api.heard()) - 4) <= 1


def test_nobody_loses_telemetry_to_the_wish_of_another_on_its_link() -> None:
    """A stranger turned HEARTBEAT and all else off for the owner."""
    writer = FrameWriter(66, 66)

    def wish(message_id: int, interval_us: float) -> bytes:
        command = (float(message_id), interval_us, *(0.0,) * 5, 511, 1, 1, 0)
        return writer.frame(ids.COMMAND_LONG, *command)

    with ground_station() as gcs, closing(station_socket()) as stranger:
        speak(gcs)
        for message_id in (ids.HEARTBEAT, ids.ATTITUDE):
            gcs.polled(wish(message_id, -1.0), stranger)
        gcs.fly(600)  # 1.2 s
        counts = Counter(frame.message_id for frame in gcs.fly(1000))
        assert abs(counts[ids.ATTITUDE] - 100) <= 1
        assert counts[ids.HEARTBEAT] == 2
        gcs.polled(wish(ids.ATTITUDE, 10_000.0), stranger)
        assert abs(Counter(f.message_id for f in gcs.fly(1000))[ids.ATTITUDE] - 200) <= 2
        for message_id in (ids.HEARTBEAT, ids.ATTITUDE):
            gcs.polled(wish(message_id, -1.0))
            gcs.polled(wish(message_id, -1.0), stranger)
        gcs.heard()
        counts = Counter(frame.message_id for frame in gcs.fly(1000))
        assert counts[ids.ATTITUDE] == 0, "nobody wants it"
        assert counts[ids.HEARTBEAT] >= 1, "it is vital"


def test_an_answer_goes_to_the_link_the_command_came_from(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    gcs, api, links = both
    speak(api, system=245)
    speak(gcs, system=255)
    for ground in (gcs, api):
        ground.heard()
    links.acknowledge(1_000_000, CommandAck(400, 0, 245, 190))
    assert [f.message_id for f in api.heard()] == [ids.COMMAND_ACK]
    assert gcs.heard() == []
    links.acknowledge(1_000_000, CommandAck(400, 0, 99, 1))  # of no known peer: to all
    assert [len(ground.heard()) for ground in (gcs, api)] == [1, 1]


def test_a_client_is_answered_though_many_others_spoke_on_its_link_before(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    """Its ids were heard on the other link too, so that link alone was answered."""
    gcs, api, links = both
    for system in range(1, 41):
        speak(api, system=100 + system)
    speak(gcs, system=7)
    speak(api, system=7)
    for ground in (gcs, api):
        ground.heard()
    links.acknowledge(1_000_000, CommandAck(401, 0, 7, 190))
    assert [f.message_id for f in api.heard()] == [ids.COMMAND_ACK]
    assert [f.message_id for f in gcs.heard()] == [ids.COMMAND_ACK]


def test_who_speaks_often_is_not_forgotten_for_those_who_spoke_once(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    _, api, _ = both
    for system in range(1, 101):
        speak(api, system=100 + system)
        speak(api, system=7)
    assert api.link.hears(7, 190)
    assert api.link.hears(200, 190)
    assert not api.link.hears(101, 190)


class Counting(LinkService):
    """A service that says nothing, and counts how often it is asked whether it would."""

    message_ids = frozenset((ids.TIMESYNC,))
    polls = asked = 0

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        self.asked += 1
        return ()

    def poll(self, t_us: int) -> Sequence[ServiceOutput]:
        self.polls += 1
        return ()


def test_a_service_is_asked_once_a_slot_and_every_tick_after_a_question() -> None:
    service = Counting()
    with ground_station(services=(service,)) as gcs:
        gcs.fly(500)
        assert service.polls == pytest.approx(100, abs=1)
        gcs.polled(FrameWriter(255, 190).frame(ids.TIMESYNC, 0, 1))
        before = service.polls
        gcs.fly(50)  # 0.1 s; never on the tick on which messages are encoded
        assert service.polls - before == pytest.approx(40, abs=2)
        before = service.polls
        gcs.fly(500)
        assert service.polls - before == pytest.approx(100, abs=4)


def test_each_step_of_a_mission_is_asked_about_in_its_own_tick() -> None:
    service = Counting()
    with ground_station(services=(service,)) as gcs:
        gcs.fly(50)
        for current in range(1, 5):
            t_us, before = 2_000 * gcs.ticks, service.polls
            said = outputs_at(t_us)
            progress = MissionProgress(total=5, current=current)
            snapshot = replace(said.snapshot, mission=progress)
            gcs.links.publish(replace(said, shown=snapshot))
            assert service.polls == before + 1


def test_between_ticks_the_time_is_told_within_a_millisecond(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    """TIMESYNC and PING while the vehicle sleeps until its next tick."""
    _, api, links = both
    client = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    client.settimeout(1.0)
    delays, reported = [], []

    def ask() -> None:
        writer = FrameWriter(245, 190)
        for number in range(1, 41):
            sent = time.monotonic_ns()
            values = (0, number) if number % 2 else (number, number, 0, 0)
            frame = writer.frame(ids.TIMESYNC if number % 2 else ids.PING, *values)
            client.sendto(frame, ("127.0.0.1", api.link.port))
            while not reported or reported[-1].payload_values[1] != number:
                reported.extend(
                    f for f in split(client.recv(2048)) if f.message_id in (ids.TIMESYNC, ids.PING)
                )
            delays.append((time.monotonic_ns() - sent) / 1e6)
            time.sleep(0.0007)

    asking = threading.Thread(target=ask)
    asking.start()
    t_us = 5_000_000
    while asking.is_alive():
        t_us += 2_000
        links.publish(outputs_at(t_us))
        links.attend(0.0019)
    asking.join()
    client.close()
    assert sorted(delays)[len(delays) // 2] < 1.0  # ms
    synced = [f for f in reported if f.message_id == ids.TIMESYNC]
    assert len(synced) == 20
    assert all(5_000_000 <= f.payload_values[0] / 1000 <= t_us + 2_000 for f in synced)


def test_sleeping_takes_as_long_as_it_should_under_a_flood(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    gcs, _, links = both
    links.publish(outputs_at(1_000_000))
    over, of_its_own = [], []
    for _ in range(20):
        for _ in range(30):
            gcs.station.sendto(b"\xfd" * 1400, ("127.0.0.1", gcs.link.port))
        queued, begin = queued_us(), wall_us()
        links.attend(0.002)
        over.append(wall_us() - begin - 2_000)
        of_its_own.append(over[-1] - (queued_us() - queued))
    assert min(over) >= -5
    assert sorted(of_its_own)[10] < 500


def test_a_datagram_of_many_requests_is_taken_frame_by_frame() -> None:
    """150 lists of all parameters in one datagram took ten ticks."""
    service, writer = Counting(), FrameWriter(66, 66)
    with ground_station(services=(service,)) as gcs:
        gcs.station.sendto(
            b"".join(writer.frame(ids.TIMESYNC, 0, 1) for _ in range(90)),
            ("127.0.0.1", gcs.link.port),
        )
        assert gcs.link.read(gcs.t_us, 1) <= 0
        assert service.asked == 1
        gcs.link.read(gcs.t_us, 1_000)
        assert service.asked < 40
        links = GroundLinks([gcs.link], 2_000, wall_us)
        links.attend(0.02)
        assert service.asked == 90, "the rest waits for nobody's next datagram"
        assert not gcs.link.arrivals.waits


def test_what_is_answered_costs_as_much_as_what_asks() -> None:
    """Nobody can have a vehicle send much more than is sent to it, to every other peer too."""
    writer = FrameWriter(66, 66)
    with ground_station(services=(Talkative(),)) as gcs:
        for _ in range(20):
            ask = writer.frame(ids.TIMESYNC, 0, 1)
            gcs.station.sendto(ask, ("127.0.0.1", gcs.link.port))
        gcs.link.read(gcs.t_us, 4_096)
        assert 4_096 < sum(map(len, gcs.datagrams())) < 4_096 + 1_500


class Talkative(LinkService):
    """A service that answers a question with 40 messages."""

    message_ids = frozenset((ids.TIMESYNC,))

    def handle(self, frame: Frame, t_us: int) -> Sequence[ServiceOutput]:
        return [Outgoing(ids.TIMESYNC, (1, 1))] * 40


def test_somebody_elses_answer_to_a_ping_is_not_answered(
    both: tuple[Ground, Ground, GroundLinks],
) -> None:
    _, api, _ = both
    api.heard()
    api.polled(FrameWriter(245, 190).frame(ids.PING, 1, 1, 1, 1))
    api.polled(FrameWriter(245, 190).frame(ids.TIMESYNC, 5, 6))
    assert api.heard() == []


def test_the_wanted_port_is_taken_if_it_is_free_and_another_if_not() -> None:
    first = OpenEndpoint(("127.0.0.1", 14550))
    second = OpenEndpoint(("127.0.0.1", 14550), first.port)
    wanted = second.port
    second.close()
    third = OpenEndpoint(("127.0.0.1", 14550), wanted)
    assert wanted != first.port
    assert third.port == wanted
    first.close()
    third.close()


def test_two_links_to_one_address_are_refused() -> None:
    with pytest.raises(LinkError, match="different ports"):
        addresses(LinkChoice(gcs="udp:127.0.0.1:14550", api="udp:localhost:14550"))
    assert addresses(LinkChoice(api="none"))[1] is None
