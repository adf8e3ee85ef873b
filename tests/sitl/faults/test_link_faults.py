"""What a network that fails makes of datagrams, in either direction."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass, field, replace

import pytest

from command_line.process import StopRequest
from messages.frames import split
from messages.message_ids import COMMAND_ACK, OBSTACLE_SHAPE
from sitl.faults.keys import KINDS, Fault, Kind
from sitl.link.decode import VehicleReply
from sitl.link.encode import StepEncoder
from sitl.link.exchange import ExchangeCounts
from sitl.link.failures import Injection
from sitl.link.faulty_endpoint import FaultyEndpoint
from sitl.link.pilot import flight_plan
from sitl.link.server import serve
from sitl.scenario_file import load_scenario
from sitl.simulation import Controls, Simulation

NUMBERS = [k.to_bytes(2, "big") for k in range(400)]
FIRST, END = 100, 300


@dataclass
class Wire:
    """An endpoint whose datagrams are numbered, and a clock of 2 ms a datagram."""

    now_s: float = 0.0
    sent: list[bytes] = field(default_factory=list)
    coming: deque[bytes] = field(default_factory=deque)

    def send(self, datagram: bytes) -> None:
        self.sent.append(datagram)

    def receive(self) -> bytes | None:
        return self.receive_waiting()

    def receive_waiting(self) -> bytes | None:
        return self.coming.popleft() if self.coming else None


def passed(fault: Fault) -> tuple[list[bytes], list[list[bytes]]]:
    """What is sent, and what is received in each step, with the fault from FIRST to END."""
    wire, active = Wire(), [False]
    link = FaultyEndpoint(wire, lambda: (fault,) if active[0] else (), 5, lambda: wire.now_s)
    received = []
    for k, datagram in enumerate(NUMBERS):
        active[0] = FIRST <= k < END
        link.send(datagram)
        wire.coming.append(datagram)
        came = []
        while (one := link.receive_waiting()) is not None:
            came.append(one)
        received.append(came)
        wire.now_s += 0.002
    return wire.sent, received


@pytest.mark.parametrize("kind", KINDS["to vehicle"])
def test_each_direction_fails_for_itself_and_for_its_time(kind: Kind) -> None:
    one_each = [[datagram] for datagram in NUMBERS]
    sent, received = passed(Fault("to vehicle", kind, delay_ms=20.0))
    assert received == one_each
    assert sent != NUMBERS
    assert sent[:FIRST] == NUMBERS[:FIRST]
    assert sent[-50:] == NUMBERS[-50:]
    sent, received = passed(Fault("to simulator", kind, delay_ms=20.0))
    assert sent == NUMBERS
    assert received[:FIRST] == one_each[:FIRST]
    assert received[FIRST:END] != one_each[FIRST:END]
    assert received[-50:] == one_each[-50:]


def test_shares_are_kept_and_nothing_is_lost_that_is_not_to_be() -> None:
    sent, _ = passed(Fault("to vehicle", "intermittent", share=0.3))
    assert 30 < len(NUMBERS) - len(sent) < 90
    sent, _ = passed(Fault("to vehicle", "duplicated", share=0.3))
    assert 30 < len(sent) - len(NUMBERS) < 90
    sent, _ = passed(Fault("to vehicle", "reordered", share=0.3))
    assert sorted(sent) == NUMBERS
    assert sent != NUMBERS


def test_a_late_datagram_comes_when_its_time_has_come() -> None:
    _, received = passed(Fault("to simulator", "delayed", delay_ms=20.0))
    assert received[FIRST + 9] == []
    assert received[FIRST + 10] == [NUMBERS[FIRST]]


@dataclass
class Vehicle:
    """Answers every step, and routes what a ground station asks for in the first."""

    asked: tuple[Injection, ...] = ()
    counts: ExchangeCounts = field(default_factory=ExchangeCounts)
    silent_since: int | None = None
    held_s: float | None = None
    received: list[list[int]] = field(default_factory=list)  # message ids by step

    def send_ahead(self, datagram: bytes) -> None:
        raise AssertionError("there is room")

    def step(
        self, number: int, t_us: int, datagram: bytes, meanwhile: Callable[[], None]
    ) -> VehicleReply:
        self.received.append([frame.message_id for frame in split(datagram)])
        controls = Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True)
        return VehicleReply(t_us, controls, injections=() if number else self.asked)


def served(*faults: Fault, asked: tuple[Injection, ...] = ()) -> tuple[Vehicle, list[str]]:
    """Ten steps of a simulation, and which faults it said had begun."""
    scenario = replace(load_scenario("walls-calm"), duration_s=0.02, faults=faults)
    simulation, vehicle, begun = Simulation(scenario, 0), Vehicle(asked), list[str]()
    plan = flight_plan(scenario, lambda _: simulation.clock.target_at(0.0), lambda _: 0.0)
    serve(
        simulation,
        plan,
        vehicle,  # type: ignore[arg-type]
        StepEncoder(lockstep=True),
        StopRequest(),
        lambda *_: None,
        lambda _: None,
        lambda fault: begun.append(str(fault)),
    )
    return vehicle, begun


def test_the_pilot_is_not_received_while_its_link_is_off() -> None:
    vehicle, begun = served(Fault("mavlink", "off"))
    assert begun == ["mavlink off"]
    assert not any(OBSTACLE_SHAPE in step for step in vehicle.received)
    assert any(OBSTACLE_SHAPE in step for step in served()[0].received)


def test_an_injected_fault_begins_and_is_acknowledged_with_the_next_step() -> None:
    vehicle, begun = served(asked=(Injection(unit=0, kind=1, instance=0, system=255, component=1),))
    assert begun == ["gyro off"]
    assert [COMMAND_ACK in step for step in vehicle.received[:3]] == [False, True, False]
