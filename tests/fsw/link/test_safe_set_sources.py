"""Who announced a safe set, over real sockets, and that a stranger cannot move a wall outwards."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from dataclasses import dataclass, field

import pytest

from fsw.autopilot.flight.state import FlightState, first_state
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import MessageSource, SensorFrame, Severity, TickOutputs
from fsw.link.inbox import Inbox
from fsw.link.sim_link import SimLink
from fsw.runtime.clock import now_us
from messages import message_ids as ids
from messages.frames import FrameWriter
from sitl.link.encode import StepEncoder
from sitl.link.pilot_messages import Announce
from tests.fsw.autopilot.flight.asked import command
from tests.fsw.autopilot.flight.test_autopilot import frame
from tests.fsw.link.ground import Ground, ground_station, station_socket
from tests.fsw.link.snapshots import FACTS
from tests.fsw.link.test_sim_link import readings

ARM = 400
TRUE_WALL, FALSE_WALL = -5.0, -5.0286  # m, offsets along -x: 28.6 mm further out
CLEARANCE = 0.1


def wall_frame(writer: FrameWriter, offset: float, *, index: int = 0, count: int = 1) -> bytes:
    values = (-1.0, 0.0, 0.0, offset, CLEARANCE, 0, 0, index, count, 0)
    return writer.frame(ids.OBSTACLE_WALL, *values)


@dataclass
class Vehicle:
    """A vehicle in the air between the simulator and one link to the ground."""

    simulator: socket.socket
    sim: SimLink
    ground: Ground
    state: FlightState = field(default_factory=lambda: first_state(flight_config().airframe))
    t_us: int = 1_000_000
    step_us: int = 1_000_000  # of the simulator, which sends a step only where it announces

    def __post_init__(self) -> None:
        self._loop, self._encoder = TunedAutopilot(flight_config()), StepEncoder(lockstep=True)
        for commands in ((), (command(ARM, 1.0),)):
            self.tick(commands)
        assert self.state.vehicle.flies

    @property
    def inbox(self) -> Inbox:
        return self.ground.inbox

    def announce(self, *offsets: float) -> TickOutputs:
        """The simulator's pilot announces walls; they are in the next tick."""
        still = (0.0, 0.0, 0.0)
        whole = [
            Announce(0, (-1.0, 0.0, 0.0, offset), still, CLEARANCE, False, 0, k, len(offsets))
            for k, offset in enumerate(offsets)
        ]
        self.step_us += 2_000
        self.simulator.send(self._encoder.datagram(readings(self.step_us), tuple(whole)))
        assert self.sim.wait_for_step() is not None
        return self.tick()

    def tick(self, commands: tuple = ()) -> TickOutputs:  # type: ignore[type-arg]
        self.t_us += 2_000
        sensors: SensorFrame = frame(self.t_us, p_WB=(0.0, 0.0, -2.0))
        inputs = self.inbox.take_inputs(sensors, None, None, None)
        if commands:
            inputs.commands = commands  # type: ignore[misc]
        self.state, outputs = self._loop.tick(self.state, inputs)
        self.ground.links.publish(outputs)
        return outputs

    @property
    def walls(self) -> list[float]:
        return [zone.shape.numbers[3] for zone in self.state.mission.safe_set.zones]

    def texts(self) -> list[tuple[int, str]]:
        """Severity and text of all that the station heard about safe sets."""
        for _ in range(20):
            self.tick()
        heard, pieces = [], {}
        for one in self.ground.heard():
            if one.message_id != ids.STATUSTEXT:
                continue
            severity, raw, number, chunk = one.payload_values
            assert isinstance(raw, bytes)
            pieces.setdefault((severity, number), {})[chunk] = raw.rstrip(b"\0").decode()
        for (severity, _), parts in pieces.items():
            heard.append((severity, "".join(parts[k] for k in sorted(parts))))
        return [one for one in heard if "safe set" in one[1]]


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    simulator = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    simulator.bind(("127.0.0.1", 0))
    simulator.settimeout(0.5)
    with ground_station() as ground:
        sim = SimLink(simulator.getsockname(), ground.inbox, FACTS, now_us)
        sim.announce()
        simulator.connect(simulator.recvfrom(2048)[1])
        yield Vehicle(simulator, sim, ground)
        sim.close()
        simulator.close()


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize("ids_of", [(255, 190), (1, 195)], ids=["its own", "the owner's"])
def test_a_stranger_cannot_move_a_wall_outwards(vehicle: Vehicle, ids_of: tuple[int, int]) -> None:
    vehicle.announce(TRUE_WALL)
    assert vehicle.walls == [TRUE_WALL]
    vehicle.texts()
    stranger, writer = station_socket(), FrameWriter(*ids_of)
    for _ in range(50):
        vehicle.ground.polled(wall_frame(writer, FALSE_WALL), stranger)
        vehicle.tick()
    assert vehicle.walls == [TRUE_WALL]
    (told,) = vehicle.texts()
    port = stranger.getsockname()[1]
    assert told[0] == Severity.CRITICAL
    assert f"safe set of {ids_of[0]}/{ids_of[1]} (test 127.0.0.1:{port}) refused" in told[1]
    assert "zone 1 (half-space) moves out by 28.6 mm" in told[1]
    assert "1/195 (simulator) owns" in told[1]
    stranger.close()


def test_the_owner_moves_it_and_every_station_is_told_once(vehicle: Vehicle) -> None:
    vehicle.announce(TRUE_WALL)
    vehicle.texts()
    for _ in range(3):
        vehicle.announce(FALSE_WALL)
    assert vehicle.walls == pytest.approx([FALSE_WALL])
    assert [text for _, text in vehicle.texts()] == ["safe set of 1/195 (simulator): 1 half-space"]


def test_a_stranger_may_move_it_inwards_and_the_owner_s_repetition_leaves_it(
    vehicle: Vehicle,
) -> None:
    vehicle.announce(TRUE_WALL)
    vehicle.texts()
    vehicle.ground.polled(wall_frame(FrameWriter(255, 190), -4.0))
    vehicle.tick()
    assert vehicle.walls == [-4.0]
    ((severity, text),) = vehicle.texts()
    assert severity == Severity.INFO
    assert "safe set of 255/190" in text
    vehicle.announce(TRUE_WALL)
    assert vehicle.walls == [-4.0]
    assert vehicle.texts() == []


def test_the_walls_of_two_sources_do_not_make_one_set(vehicle: Vehicle) -> None:
    one, other = station_socket(), station_socket()
    writer = FrameWriter(255, 190)
    ground = vehicle.ground
    ground.polled(wall_frame(writer, -1.0, index=0, count=2), one)
    ground.polled(wall_frame(writer, -2.0, index=1, count=2), other)
    assert vehicle.inbox.take().announced == []
    ground.polled(wall_frame(writer, -3.0, index=1, count=2), one)
    (announced,) = vehicle.inbox.take().announced
    assert [zone.shape.numbers for zone in announced.safe_set.zones] == [
        (-1.0, 0.0, 0.0, -1.0),
        (-1.0, 0.0, 0.0, -3.0),
    ]
    port = one.getsockname()[1]
    assert announced.source == MessageSource(255, 190, "test", f"127.0.0.1:{port}")
    one.close()
    other.close()


def test_a_flood_of_sources_keeps_no_more_than_a_few(vehicle: Vehicle) -> None:
    stations = [station_socket() for _ in range(6)]
    for station in stations:
        vehicle.ground.polled(wall_frame(FrameWriter(255, 190), -1.0), station)
    assert len(vehicle.inbox.take().announced) == 4
    assert vehicle.inbox.refused == 2
    for system in range(1, 30):
        half = wall_frame(FrameWriter(system, 190), -1.0, count=2)
        vehicle.ground.polled(half, stations[0])
    first = wall_frame(FrameWriter(1, 190), -1.0, index=1, count=2)
    vehicle.ground.polled(first, stations[0])
    assert vehicle.inbox.take().announced == [], "the oldest was forgotten"
    last = wall_frame(FrameWriter(29, 190), -1.0, index=1, count=2)
    vehicle.ground.polled(last, stations[0])
    assert len(vehicle.inbox.take().announced) == 1
    for station in stations:
        station.close()
