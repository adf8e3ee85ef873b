"""The simulator link over real sockets: one tick a step, whatever the network does."""

from __future__ import annotations

import contextlib
import math
import socket
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
import pytest

from fsw.autopilot.measurements import ImuSample, JointSample, PressureSample
from fsw.autopilot.signals import (
    BatteryReading,
    CommandAck,
    CommandRequest,
    MessageSource,
    Mode,
    SafeSet,
    Severity,
    Shape,
    StatusText,
)
from fsw.link.inbox import Inbox
from fsw.link.routed_commands import RoutedCommands
from fsw.link.sim_link import SimLink
from fsw.link.text_limiter import TextLimiter
from fsw.link.vehicle_link import Pacing
from messages import message_ids as ids
from messages import status_text
from messages.frames import FrameWriter, split
from sitl.earth import DEFAULT_ORIGIN
from sitl.link.decode import read_reply
from sitl.link.encode import StepEncoder
from sitl.link.encode_sensors import SensorEncoder
from sitl.link.failures import Injection, Injector, carry_out
from sitl.link.pilot import Phase, PilotState, flight_plan, speak
from sitl.link.pilot_messages import SendCommand
from sitl.mission_clock import MissionClock
from sitl.scenario import Scenario, Workspace
from sitl.scenario_file import load_scenario
from sitl.sensors.barometer import PressureMeasurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.exact import SensorReadings
from sitl.sensors.imu import ImuMeasurement
from sitl.shapes.box import Box
from sitl.simulation import Controls, Simulation
from studies.flight.mission import safe_set as safe_set_of
from tests.fsw.link.ground import ManualClock
from tests.fsw.link.snapshots import FACTS, outputs_at
from tests.sitl.vehicles import PAPER

NAN = float("nan")
SHUTDOWN = SendCommand(246, (0.0, 2.0, NAN, NAN, NAN, NAN, NAN))


def readings(t_us: int) -> SensorReadings:
    return SensorReadings(
        t_us=t_us,
        p_WB=(1.0, 2.0, -3.0),
        v_WB=(0.1, 0.2, 0.3),
        q_WB=(0.5, 0.5, -0.5, 0.5),
        w_WB_B=(0.4, 0.5, 0.6),
        gyro_B=(0.41, 0.51, 0.61),
        accel_B=(0.0, 0.1, -9.81),
        q_arm=(-0.7, 1.4),
        qd_arm=(0.01, 0.02),
        tau_arm=(0.03, 0.04),
    )


@dataclass
class Wire:
    """A simulator's socket and the link under test."""

    simulator: socket.socket
    link: SimLink
    inbox: Inbox
    clock: ManualClock  # a machine that is busy with something else changes nothing

    def send(self, datagram: bytes) -> None:
        self.simulator.send(datagram)

    def hear(self) -> bytes:
        return self.simulator.recv(2048)


@pytest.fixture
def wire() -> Iterator[Wire]:
    simulator = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
    simulator.bind(("127.0.0.1", 0))
    simulator.settimeout(0.5)
    inbox = Inbox()
    clock = ManualClock(5_000_000)
    link = SimLink(simulator.getsockname(), inbox, FACTS, lambda: clock.now_us)
    link.announce()
    hello, vehicle = simulator.recvfrom(2048)
    assert [frame.message_id for frame in split(hello)] == [ids.HEARTBEAT]
    simulator.connect(vehicle)
    yield Wire(simulator, link, inbox, clock)
    link.close()
    simulator.close()


def test_every_sensor_arrives_where_it_belongs(wire: Wire) -> None:
    sent = readings(1_002_000)
    wire.send(StepEncoder(lockstep=True).datagram(sent, ()))
    got = wire.link.wait_for_step()
    assert got is not None
    assert got.t_us == 1_002_000
    for name, other in (
        ("p_WB", "p_WB"),
        ("v_WB", "v_WB"),
        ("q_WB", "q_WB"),
        ("gyro_B", "gyro_B"),
        ("accel_B", "accel_B"),
        ("q_arm", "q_arm"),
        ("qd_arm", "qd_arm"),
    ):
        assert getattr(got, name) == pytest.approx(getattr(sent, other)), name


def test_walls_and_points_arrive_as_the_pilot_announces_them(wire: Wire) -> None:
    branches, walls = load_scenario("branches"), load_scenario("walls").walls
    crate = Box(
        name="crate",
        clearance_m=0.2,
        centre_m=(3.0, 2.0, -1.0),
        half_size_m=(0.5, 0.25, 0.125),
        attitude_deg=(0.0, 0.0, 90.0),
        velocity_m_s=(0.0, 0.5, 0.0),
    )
    scenario = replace(branches, walls=walls[:1], zones=(crate,), workspace=Workspace(0.075, 0.225))
    clock = MissionClock(scenario)
    plan = flight_plan(scenario, lambda t_us: clock.target_at(0.0), lambda t_us: 0.0)
    _, messages = speak(plan, PilotState(Phase.IDLE), 1_000_000)
    wire.send(StepEncoder(lockstep=True).datagram(readings(1_002_000), messages))
    assert wire.link.wait_for_step() is not None
    (announced,) = wire.inbox.take().announced
    safe_set = announced.safe_set
    assert announced.source == MessageSource(1, 195, "simulator")
    assert safe_set == simulated(scenario)
    kinds = [zone.shape.kind for zone in safe_set.zones]
    assert kinds == ["half-space", *["ball"] * 4, "box", "target sphere"]


def simulated(scenario: Scenario) -> SafeSet:
    """The safe set as the studies hand it over, in the wire's single precision."""
    return SafeSet(
        tuple(
            replace(
                zone,
                shape=Shape(zone.shape.kind, singles(zone.shape.numbers)),
                clearance=singles((zone.clearance,))[0],
            )
            for zone in safe_set_of(scenario, 1_000_000).zones
        )
    )


def singles(numbers: tuple[float, ...]) -> tuple[float, ...]:
    return tuple(np.array(numbers, dtype=np.float32).astype(float).tolist())


def test_a_repeated_step_gets_the_same_answer_and_no_tick(wire: Wire) -> None:
    step = StepEncoder(lockstep=True).datagram(readings(1_002_000), ())
    wire.send(step)
    assert wire.link.wait_for_step() is not None
    wire.link.send_actuators(1_002_000, outputs_at(1_002_000))
    answer = wire.hear()
    wire.send(step)
    assert wire.link.wait_for_step() is None
    assert wire.hear() == answer
    assert wire.link.retransmissions == 1


def test_an_older_step_is_ignored(wire: Wire) -> None:
    encoder = StepEncoder(lockstep=True)
    for t_us in (1_002_000, 1_004_000):
        wire.send(encoder.datagram(readings(t_us), ()))
        assert wire.link.wait_for_step() is not None
        wire.link.send_actuators(t_us, outputs_at(t_us))
        wire.hear()
    wire.send(encoder.datagram(readings(1_002_000), ()))
    assert wire.link.wait_for_step() is None
    with pytest.raises(TimeoutError):
        wire.hear()


@pytest.mark.parametrize("wrong_us", [11_004_000, 2**63, 2**64 - 1])
def test_one_stamp_far_ahead_does_not_make_the_vehicle_deaf(wire: Wire, wrong_us: int) -> None:
    encoder = StepEncoder(lockstep=True)
    released = []
    for t_us in (1_002_000, wrong_us, 1_004_000, 1_006_000):
        wire.send(encoder.datagram(readings(t_us), ()))
        released.append(wire.link.wait_for_step())
    assert [one and one.t_us for one in released] == [1_002_000, None, 1_004_000, 1_006_000]
    (notice,) = wire.link.notices
    assert "ahead: ignored" in notice.text


@pytest.mark.parametrize("wrong_us", [11_000_000, 2**62 - 1, 2**62, 2**64 - 1])
def test_a_first_stamp_far_ahead_does_not_make_the_vehicle_deaf(wire: Wire, wrong_us: int) -> None:
    encoder = StepEncoder(lockstep=True)
    released = []
    for t_us in (wrong_us, 1_002_000, 1_004_000, 1_006_000):
        wire.send(encoder.datagram(readings(t_us), ()))
        released.append(wire.link.wait_for_step())
    first = wrong_us if wrong_us < 2**62 else None
    assert [one and one.t_us for one in released] == [first, 1_002_000, 1_004_000, 1_006_000]
    (notice,) = wire.link.notices
    assert notice.text.startswith("first step stamped")
    assert (notice.severity, notice.prompt) == (Severity.WARNING, False)


class Flight:
    """Steps that the vehicle answers at once."""

    def __init__(self, wire: Wire, *, lockstep: bool, measured: bool = False) -> None:
        self.wire = wire
        self.encoder = StepEncoder(lockstep=lockstep, measured=measured)
        self.lockstep = lockstep
        self.measured = measured
        wire.send(self.encoder.heartbeat() + self.datagram(1_002_000))
        self.sent: dict[int, bytes] = {}  # by their stamps
        self.taken = [self.take()]

    def datagram(self, t_us: int) -> bytes:
        if not self.measured:
            return self.encoder.datagram(readings(t_us), ())
        inertial = ImuMeasurement(t_us, (0.4, 0.5, 0.6), (0.0, 0.1, -9.81))
        measured = (JointMeasurement(t_us, (-0.7, 1.4)), inertial)
        return self.encoder.measured_datagrams(t_us, measured, ())[1]

    def again(self, *stamps: int) -> int | None:
        """What the vehicle takes of datagrams that were sent before, to the byte."""
        for t_us in stamps:
            self.wire.send(self.sent[t_us])
        return self.take()

    def take(self) -> int | None:
        """The vehicle's time of the step that came; it is answered."""
        link = self.wire.link
        self.wire.clock.now_us += 2_000
        in_real_time = link.pacing is Pacing.REALTIME
        sensors = link.newest() if in_real_time else link.wait_for_step()
        if sensors is None:
            return None
        link.send_actuators(sensors.t_us, outputs_at(sensors.t_us))
        return sensors.t_us

    def step(self, *stamps: int) -> int | None:
        """What the vehicle takes of these, which are there at once."""
        for t_us in stamps:
            self.sent[t_us] = self.datagram(t_us)
            self.wire.send(self.sent[t_us])
        found = self.take()
        self.taken.append(found)
        return found

    def answered(self) -> list[int]:
        """Stamps of the answers."""
        self.wire.simulator.settimeout(0.05)
        stamps = []
        with contextlib.suppress(TimeoutError):
            while True:
                reply = read_reply(self.wire.hear(), PAPER)
                assert reply is not None
                stamps.append(reply.t_us)
        return stamps

    def jumps(self) -> int:
        """By how much the tick is told that the clock has jumped [us]."""
        return self.wire.inbox.take().sensor_clock_jump_us


AHEAD, BACK = (500_000, 6_000_000), (-10_000, -100_000, -500_000)


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-TIME-4")
@pytest.mark.parametrize("measured", [False, True], ids=["exact", "measured"])
@pytest.mark.parametrize("jump_us", [-500_000, 6_000_000])
def test_in_lockstep_a_step_of_another_time_is_answered_when_it_is_repeated(
    wire: Wire, jump_us: int, measured: bool
) -> None:
    flight = Flight(wire, lockstep=True, measured=measured)
    flight.step(1_004_000)
    flight.answered()
    flight.jumps()
    first_us = 1_006_000 + jump_us
    assert flight.step(first_us) is None
    assert flight.step() is None  # the simulator waits in vain
    assert flight.step(first_us) == 1_006_000
    assert flight.jumps() == jump_us
    assert flight.step(first_us + 2_000) == 1_008_000
    assert flight.answered() == [first_us, first_us + 2_000]
    assert flight.step(first_us + 2_000) is None  # known: the same answer again
    assert flight.answered() == [first_us + 2_000]
    assert (flight.jumps(), wire.link.notices) == (0, [])


@pytest.mark.requirement("REQ-TIME-4")
@pytest.mark.parametrize("measured", [False, True], ids=["exact", "measured"])
@pytest.mark.parametrize("jump_us", [*BACK, *AHEAD])
def test_in_real_time_steps_of_another_time_are_followed_before_readings_are_too_old(
    wire: Wire, jump_us: int, measured: bool
) -> None:
    flight = Flight(wire, lockstep=False, measured=measured)
    flight.step(1_004_000)
    flight.jumps()
    for k in range(6):
        flight.step(1_006_000 + jump_us + 2_000 * k)
    taken = flight.taken[2:]
    ignored = taken.index(next(one for one in taken if one is not None))
    # The numbers of frames say at once that a step a little behind is no late one.
    assert ignored == (1 if jump_us > 0 else 3 if jump_us < -40_000 else 0)
    assert taken[ignored:] == [1_006_000 + 2_000 * k for k in range(ignored, 6)]
    stamps = flight.answered()[2:]
    assert stamps == [1_006_000 + jump_us + 2_000 * k for k in range(ignored, 6)]
    assert (flight.jumps(), wire.link.notices) == (jump_us, [])


def test_a_clock_may_jump_before_there_is_a_schedule(wire: Wire) -> None:
    """The first ticks of real time wait for their steps."""
    encoder = StepEncoder(lockstep=False)
    wire.send(encoder.heartbeat() + encoder.datagram(readings(1_500_000), ()))
    assert wire.link.wait_for_step() is not None
    taken = []
    for k in range(6):
        wire.send(encoder.datagram(readings(1_002_000 + 2_000 * k), ()))
        sensors = wire.link.wait_for_step()
        taken.append(sensors and sensors.t_us)
    assert taken == [None, None, None, 1_508_000, 1_510_000, 1_512_000]


def test_what_sensors_measured_is_at_the_vehicle_s_time_too(wire: Wire) -> None:
    flight = Flight(wire, lockstep=False, measured=True)
    flight.step(1_004_000)
    encoder, jump_us = SensorEncoder(FrameWriter(1, 200), DEFAULT_ORIGIN), -500_000
    for k in range(3):
        flight.step(1_006_000 + jump_us + 2_000 * k)
    wire.inbox.take()
    # What has no room in a step goes ahead of it, and is of its clock.
    early = PressureMeasurement(1_012_000 + jump_us, 101_325.0)
    wire.send(encoder.frames(0, (early,))[0])
    assert flight.step(1_012_000 + jump_us) == 1_012_000
    taken = wire.inbox.take()
    times = [sample.time for sample in taken.samples]
    assert [type(one) for one in taken.samples] == [PressureSample, JointSample, ImuSample]
    assert times == [1e-6 * 1_012_000] * 3
    assert taken.sensor_clock_jump_us == jump_us


@pytest.mark.parametrize("lockstep", [True, False], ids=["lockstep", "real time"])
def test_a_step_of_before_is_no_jump_however_late_and_often_it_comes(
    wire: Wire, lockstep: bool
) -> None:
    flight = Flight(wire, lockstep=lockstep)
    stamps = [1_004_000 + 2_000 * k for k in range(40)]
    for k, t_us in enumerate(stamps):
        assert flight.step(t_us) == t_us
        for back in (4, 4, 3, 2):
            assert k < 4 or flight.again(stamps[k - back]) is None
    assert flight.answered() == [1_002_000, *stamps]
    assert (flight.jumps(), wire.link.notices) == (0, [])


def test_a_burst_of_old_steps_in_their_order_is_no_jump(wire: Wire) -> None:
    flight = Flight(wire, lockstep=False)
    burst = [1_004_000 + 2_000 * k for k in range(20)]
    for t_us in burst:
        flight.sent[t_us] = flight.datagram(t_us)  # and keep it back
    assert flight.step(1_044_000) == 1_044_000
    for _ in range(3):
        assert flight.again(*burst) is None
    assert flight.step(1_046_000) == 1_046_000
    assert flight.jumps() == 0


def test_frames_that_were_missing_for_long_are_no_jump(wire: Wire) -> None:
    flight = Flight(wire, lockstep=False)
    flight.step(1_004_000)
    flight.step(1_006_000)
    wire.clock.now_us += 250_000
    assert flight.step(1_206_000) == 1_206_000
    assert (flight.jumps(), wire.link.notices) == (0, [])


def test_a_step_without_its_barrier_releases_no_tick(wire: Wire) -> None:
    step = StepEncoder(lockstep=True).datagram(readings(1_002_000), ())
    wire.send(step[:-10])
    assert wire.link.wait_for_step() is None
    wire.send(step)
    assert wire.link.wait_for_step() is not None


def test_commands_of_a_repeated_step_are_taken_once(wire: Wire) -> None:
    arm = SendCommand(400, (1.0, NAN, NAN, NAN, NAN, NAN, NAN))
    step = StepEncoder(lockstep=True).datagram(readings(1_002_000), (arm,))
    for _ in range(2):
        wire.send(step)
        wire.link.wait_for_step()
    assert len(wire.inbox.take().commands) == 1


def test_acknowledgements_come_before_the_actuators_and_are_repeated_with_them(wire: Wire) -> None:
    step = StepEncoder(lockstep=True).datagram(readings(1_002_000), ())
    wire.send(step)
    wire.link.wait_for_step()
    wire.link.queue_ack(CommandAck(400, 0, 1, 195))
    wire.link.send_actuators(1_002_000, outputs_at(1_002_000))
    answer = wire.hear()
    order = [frame.message_id for frame in split(answer)]
    assert order == [ids.HEARTBEAT, ids.COMMAND_ACK, ids.HIL_ACTUATOR_CONTROLS]
    wire.send(step)
    wire.link.wait_for_step()
    assert wire.hear() == answer


def test_texts_without_room_in_the_answer_come_ahead_of_it_and_again_when_it_is_repeated(
    wire: Wire,
) -> None:
    texts = tuple(StatusText(Severity.WARNING, f"text {k:02d} {'.' * 180}") for k in range(20))
    step = StepEncoder(lockstep=True).datagram(readings(1_002_000), ())
    wire.send(step)
    wire.link.wait_for_step()
    wire.link.send_actuators(1_002_000, replace(outputs_at(1_002_000), texts=texts))

    def answer() -> list[bytes]:
        datagrams = [wire.hear()]
        while split(datagrams[-1])[-1].message_id != ids.HIL_ACTUATOR_CONTROLS:
            datagrams.append(wire.hear())
        return datagrams

    first = answer()
    assert len(first) > 3
    assert max(map(len, first)) <= 1400
    frames = [frame for datagram in first for frame in split(datagram)]
    said = "".join(
        str(frame.payload_values[1]) for frame in frames if frame.message_id == ids.STATUSTEXT
    )
    assert [f"text {k:02d}" in said for k in range(20)] == [True] * 20
    wire.send(step)
    wire.link.wait_for_step()
    assert answer() == first


def test_what_a_tick_says_behind_its_answer_comes_with_the_next_one_and_once(wire: Wire) -> None:
    late, own = (StatusText(Severity.WARNING, text) for text in ("late", "own"))

    def said(t_us: int, *texts: StatusText) -> tuple[str, ...]:
        wire.link.send_actuators(t_us, replace(outputs_at(t_us), texts=texts))
        return status_text.joined(split(wire.hear()))

    assert said(1_002_000) == ()
    wire.link.queue_texts((late,))
    assert said(1_004_000, own) == ("late", "own")
    assert said(1_006_000) == ()


def test_the_simulator_is_told_the_mode_when_it_changes_and_once_a_second(wire: Wire) -> None:
    reported = []
    for step in range(1, 1001):
        t_us = 1_000_000 + 2_000 * step
        outputs = outputs_at(t_us)
        if step >= 700:
            outputs = replace(outputs, mode=Mode.HOLD)
        wire.link.send_actuators(t_us, outputs)
        for frame in split(wire.hear()):
            if frame.message_id == ids.HEARTBEAT:
                reported.append((step, frame.payload_values[0]))
    assert reported == [(1, 0x0B040000), (501, 0x0B040000), (700, 0x03040000)]


def test_the_heartbeat_of_the_simulator_says_who_waits(wire: Wire) -> None:
    encoder = StepEncoder(lockstep=False)
    wire.send(encoder.heartbeat() + encoder.datagram(readings(1_002_000), ()))
    assert wire.link.wait_for_step() is not None
    assert wire.link.pacing is Pacing.REALTIME


def test_of_steps_that_piled_up_the_newest_counts_and_every_message_is_kept(
    wire: Wire,
) -> None:
    encoder = StepEncoder(lockstep=False)
    wire.send(encoder.heartbeat() + encoder.datagram(readings(1_002_000), ()))
    assert wire.link.wait_for_step() is not None
    assert not wire.link.wait(0.0)
    arm = SendCommand(400, (1.0, NAN, NAN, NAN, NAN, NAN, NAN))
    wire.send(encoder.datagram(readings(1_004_000), (arm,)))
    for t_us in (1_006_000, 1_008_000):
        wire.send(encoder.datagram(readings(t_us), ()))
    assert wire.link.wait(1.0)
    newest = wire.link.newest()
    assert newest is not None
    assert newest.t_us == 1_008_000
    assert [one.request.command for one in wire.inbox.take().commands] == [400]
    assert wire.link.newest() is None


def test_shutdown_is_acknowledged_and_ends_the_flight(wire: Wire) -> None:
    wire.send(StepEncoder(lockstep=True).spoken((SHUTDOWN,)))
    assert wire.link.wait_for_step() is None
    assert wire.link.shutdown
    (ack,) = split(wire.hear())
    assert ack.message_id == ids.COMMAND_ACK
    assert ack.payload_values == (246, 0, 0, 0, 1, 195)


def test_a_reboot_is_not_a_shutdown(wire: Wire) -> None:
    reboot = SendCommand(246, (1.0, 1.0, NAN, NAN, NAN, NAN, NAN))
    wire.send(StepEncoder(lockstep=True).spoken((reboot,)))
    assert wire.link.wait_for_step() is None
    assert not wire.link.shutdown


def test_garbage_releases_no_tick(wire: Wire) -> None:
    for datagram in (b"", b"\xfd" * 300, FrameWriter(1, 200).frame(ids.HEARTBEAT, *(0,) * 6)):
        wire.send(datagram)
        assert wire.link.wait_for_step() is None


INJECT = CommandRequest(420, (0.0, 1.0, 0.0, NAN, NAN, NAN, NAN), 245, 190, confirmation=1)


@pytest.mark.parametrize("sender", [(255, 0), (0, 0), (1, 1), (1, 191)])
def test_a_sender_of_any_identity_gets_the_simulator_s_answer(sender: tuple[int, int]) -> None:
    """pymavlink's component is 0 unless it is told another; no frame can be sent in that name."""
    routed = RoutedCommands()
    routed.add(replace(INJECT, source_system=sender[0], source_component=sender[1]))
    (frame,) = split(routed.due(1_000_000))
    named = CommandAck(420, 0, frame.system_id, frame.component_id)
    assert routed.answered([named]) == [CommandAck(420, 0, *sender)]
    routed.add(replace(INJECT, source_system=sender[0], source_component=sender[1]))
    routed.due(1_000_000)
    assert routed.given_up(2_000_000) == [CommandAck(420, 4, *sender)]


def test_a_fault_is_asked_for_in_the_name_of_its_sender_and_the_answer_comes_back(
    wire: Wire,
) -> None:
    encoder = StepEncoder(lockstep=True)
    simulation = Simulation(load_scenario("walls-calm"), 0)
    wire.link.route(INJECT)
    wire.link.send_actuators(1_002_000, outputs_at(1_002_000))
    reply = read_reply(wire.hear(), PAPER)
    assert reply is not None
    (asked,) = reply.injections
    assert asked == Injection(unit=0, kind=1, instance=0, system=245, component=190, confirmation=1)
    answer = encoder.answer(asked, carry_out(simulation, asked))
    wire.send(answer + encoder.datagram(readings(1_004_000), ()))
    assert wire.link.wait_for_step() is not None
    assert wire.link.routed_acks == [CommandAck(420, 0, 245, 190)]
    begun = StatusText(Severity.WARNING, "fault injected: gyro off", prompt=True)
    assert wire.link.notices == [begun]
    simulation.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True))
    assert math.isnan(simulation.sense().gyro_B[0])


def test_a_refusal_of_the_simulator_is_critical_and_prompt_as_the_vehicle_s_own(wire: Wire) -> None:
    """A second one in the same words is an answer too, and is sent at once."""
    encoder, limiter = StepEncoder(lockstep=True), TextLimiter()
    simulation = Simulation(load_scenario("walls-calm"), 0)
    asked = Injection(unit=2, kind=1, instance=0, system=245, component=190)
    for t_us in (1_002_000, 1_004_000):
        wire.link.route(INJECT)
        answer = encoder.answer(asked, carry_out(simulation, asked))
        wire.send(answer + encoder.datagram(readings(t_us), ()))
        assert wire.link.wait_for_step() is not None
    assert len(wire.link.notices) == 2
    for notice, t_us in zip(wire.link.notices, (1_002_000, 1_004_000), strict=True):
        assert notice.text.startswith('no fault: unit = "mag": not on board')
        assert notice.severity == Severity.CRITICAL
        assert limiter.admit(notice, t_us) is not None


def test_no_text_of_the_simulator_is_an_emergency(wire: Wire) -> None:
    """Those pass every limit."""
    wire.link.route(INJECT)
    writer = FrameWriter(1, 200)
    answer = writer.frame(ids.COMMAND_ACK, 420, 0, 0, 0, 245, 190)
    for severity in (0, 255):
        answer += writer.frame(ids.STATUSTEXT, severity, b"odd", 0, 0)
    wire.send(answer + StepEncoder(lockstep=True).datagram(readings(1_002_000), ()))
    assert wire.link.wait_for_step() is not None
    assert [one.severity for one in wire.link.notices] == [Severity.CRITICAL, Severity.WARNING]


@pytest.mark.parametrize("lockstep", [True, False])
def test_an_answer_of_the_simulator_is_taken_late_and_once(wire: Wire, lockstep: bool) -> None:
    flight = Flight(wire, lockstep=lockstep)
    wire.link.route(INJECT)
    answer = FrameWriter(1, 200).frame(ids.COMMAND_ACK, 420, 0, 0, 0, 245, 190)
    late = answer + flight.datagram(1_004_000)
    if not lockstep:
        flight.step(1_006_000)  # has overtaken it
    for _ in range(2):  # by a network that doubles it, or because the vehicle's answer was lost
        wire.send(late)
        flight.take()
    assert wire.link.routed_acks == [CommandAck(420, 0, 245, 190)]


@pytest.mark.parametrize("lost", range(8))
@pytest.mark.parametrize("there", [True, False], ids=["command", "answer"])
def test_a_command_to_the_simulator_is_answered_however_often_it_is_lost(
    wire: Wire, there: bool, lost: int
) -> None:
    """On its way there, or on the way of its answer back; and it is carried out once."""
    simulation, controls = Simulation(load_scenario("walls-calm"), 0), (0.5, 0.5, 0.5, 0.5)
    encoder, injector = StepEncoder(lockstep=True), Injector(simulation)
    wire.link.route(replace(INJECT, confirmation=0))
    heard: list[int] = []  # ticks in which the command was sent
    for k in range(400):
        t_us = 1_002_000 + 2_000 * k
        wire.link.send_actuators(t_us, outputs_at(t_us))
        if wire.link.routed_acks:
            break
        reply = read_reply(wire.hear(), PAPER)
        assert reply is not None
        answer = b""
        for asked in reply.injections:
            heard.append(k)
            arrives = len(heard) > lost
            if arrives or not there:
                said = encoder.answer(asked, injector.answer(asked))
                answer += said if arrives else b""
        simulation.advance(Controls(controls, (0.0, 0.0), armed=True))
        wire.send(answer + encoder.datagram(readings(t_us + 2_000), ()))
        assert wire.link.wait_for_step() is not None
    known = lost < 6
    assert heard == [50 * n for n in range(min(lost + 1, 6))], "each 0.1 s, for 0.6 s"
    assert wire.link.routed_acks == [CommandAck(420, 0 if known else 4, 245, 190)]
    assert k == (50 * lost + 1 if known else 300)
    simulation.advance(Controls(controls, (0.0, 0.0), armed=True))
    assert len(simulation.faults.active) == (0 if there and not known else 1)
    (notice,) = wire.link.notices
    words = "fault injected: gyro off" if known else "the simulator does not answer"
    assert notice.text.startswith(words)


@pytest.mark.parametrize("number", [NAN, math.inf, -1.0, 0.5, 256.0, 1e30])
@pytest.mark.parametrize("place", range(3))
def test_the_simulator_passes_over_a_fault_of_no_number(
    wire: Wire, number: float, place: int
) -> None:
    params = [1.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0]
    params[place] = number
    wire.link.route(replace(INJECT, params=tuple(params)))
    wire.link.send_actuators(1_002_000, outputs_at(1_002_000))
    reply = read_reply(wire.hear(), PAPER)
    assert reply is not None
    assert reply.injections == ()


@pytest.mark.parametrize(
    ("numbers", "result", "sentence"),
    [
        ((2, 1, 0), 3, 'no fault: unit = "mag": not on board'),
        ((2, 0, 0), 3, 'no fault: unit = "mag": not on board'),  # nor does it work again
        ((5, 0, 0), 3, 'no fault: unit = "optical flow": not on board'),
        ((104, 1, 0), 3, "no fault: the vehicle has no unit 104"),
        ((0, 9, 0), 3, "no fault: kind 9 is not one of 0 to 7"),
        ((101, 1, 5), 2, "no fault: motor 5 is not one of 4"),
        ((102, 3, 1), 3, 'no fault: kind = "garbage": a joint can be "off", "stuck"'),
        ((101, 1, 2), 0, "fault injected: motor 2 off"),
        ((0, 0, 1), 0, "gyro works: there was no fault to end"),
    ],
)
def test_the_simulator_says_why_it_lets_nothing_fail(
    numbers: tuple[int, int, int], result: int, sentence: str
) -> None:
    simulation = Simulation(load_scenario("walls-calm"), 0)
    answer = carry_out(simulation, Injection(*numbers, system=1, component=1))
    assert answer.result == result
    assert answer.sentence.startswith(sentence)


@pytest.mark.parametrize(("name", "result"), [("ground", 3), ("walls-calm", 0), ("hop", 0)])
def test_only_a_pilot_that_is_there_can_be_silenced(name: str, result: int) -> None:
    """FAILURE_UNIT_SYSTEM_MAVLINK_SIGNAL is no link of a ground station."""
    simulation = Simulation(load_scenario(name), 0)
    answer = carry_out(simulation, Injection(105, 1, 0, system=255, component=190))
    assert answer.result == result
    if result:
        assert answer.sentence.endswith("the scenario's pilot, and this scenario has none")
        works = carry_out(simulation, Injection(105, 0, 0, system=255, component=190))
        assert works == answer, "a link that is not there does not work again"
    simulation.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True))
    simulation.faults.at(simulation.step)
    assert simulation.faults.pilot_silent(simulation.t_us) == (result == 0)


def test_a_fault_ends_for_whom_it_began() -> None:
    simulation = Simulation(load_scenario("walls-calm"), 0)

    def asked(unit: int, kind: int, instance: int) -> tuple[int, str]:
        answer = carry_out(simulation, Injection(unit, kind, instance, 1, 1))
        for _ in range(2):
            simulation.sense()
            simulation.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.0, 0.0), armed=True))
        return answer.result, answer.sentence

    asked(101, 1, 0)
    assert asked(101, 0, 2) == (2, "no fault of motor 2 alone to end: what lasts is motor off")
    assert asked(101, 0, 0) == (0, "fault ended: motor off")
    asked(101, 1, 2)
    assert asked(101, 0, 2) == (0, "fault ended: motor 2 off")


@pytest.mark.parametrize("measured", [False, True])
def test_the_battery_is_measured_where_the_simulator_says_so(wire: Wire, measured: bool) -> None:
    encoder = StepEncoder(lockstep=True, measured=measured)
    step = (
        encoder.measured_datagrams(1_002_000, (), ())[1]
        if measured
        else encoder.datagram(readings(1_002_000), ())
    )
    wire.send(encoder.heartbeat() + encoder.battery(14.2, 0.08) + step)
    assert wire.link.wait_for_step() is not None
    assert wire.inbox.take().battery == BatteryReading(pytest.approx(14.2), pytest.approx(0.08))
    ground = FrameWriter(255, 190).frame(ids.BATTERY_STATUS, *(0,) * 26)
    for frame in split(ground):
        wire.inbox.accept(frame)
    assert wire.inbox.take().battery is None, "a ground station is no sensor"
