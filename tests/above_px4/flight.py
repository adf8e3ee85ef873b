"""The planner above PX4 in one process, in step: plant, stand-in for PX4, flight software."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

from fsw.autopilot.flight.state import first_state
from fsw.autopilot.flight.tuned_autopilot import TunedAutopilot
from fsw.autopilot.parameters.flight_config import FlightConfig, above_px4, flight_config
from fsw.autopilot.signals import EndEffectorTarget, MissionUpdate, Mode, Setpoint, TickOutputs
from fsw.link.inbox import Inbox
from fsw.link.px4.arm import Joints, servo_ranges
from fsw.link.px4.link import Px4Link
from fsw.link.px4.messages import shares_of
from fsw.runtime.assembly import vehicle_facts
from messages.frames import Losses, split
from sitl.earth import DEFAULT_ORIGIN
from sitl.link.px4_messages import Px4Answer, Px4Encoder, read_answer
from sitl.scenario import Scenario, vehicle_of
from sitl.sensors.encoders import JointMeasurement
from sitl.servos import PositionServos
from sitl.simulation import START_US, STEP_US, Controls, Simulation
from sitl.start import effects
from studies.flight.closed_loop import InlinePlanner
from studies.flight.mission import announced, target
from tests.closed_loop.harness import command, real_planner
from tests.px4_companion_stand_in import Gains, Px4Companion
from tests.sitl.px4_flight import airframe

TRAJECTORY = command(176, 1.0, 4.0, 11.0)
TARGET_US = 100_000


class Wire:
    """Both ends of the link, without a wire."""

    def __init__(self, px4: Px4Companion) -> None:
        self.px4 = px4

    def fileno(self) -> int:
        return -1

    def receive_waiting(self) -> tuple[bytes, tuple[str, int]] | None:
        data, self.px4.said = self.px4.said, b""
        return (data, ("px4", 1)) if data else None

    def cut(self, data: bytes, losses: Losses) -> Any:
        return [(frame, b"") for frame in split(data)]

    def send(self, datagram: bytes, peer: tuple[str, int]) -> None:
        self.px4.hear_companion(datagram)

    def news(self) -> str | None:
        return None

    def close(self) -> None:
        pass


@dataclass
class Encoders:
    """The arm's own link: its encoders as the plant has them."""

    joints: Joints
    silent: bool = False

    def poll(self) -> None:
        pass

    def send(self, t_us: int, outputs: TickOutputs, q: Any) -> None:
        pass

    def acknowledge(self, ack: Any) -> None:
        pass

    def close(self) -> None:
        pass


@dataclass
class AbovePx4:
    """One flight, exchange by exchange of 4 ms, from the air, where PX4 holds."""

    scenario: Scenario
    seed: int = 0
    config: FlightConfig | None = None
    gains: Gains = field(default_factory=Gains)
    child_frame: int = 1
    texts: list[str] = field(default_factory=list)
    modes: list[Mode] = field(default_factory=list)
    setpoints: list[tuple[int, Setpoint]] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.sim = Simulation(self.scenario, self.seed)
        if self.config is None:
            base = flight_config(body=self.scenario.body, vehicle=vehicle_of(self.scenario))
            self.config = above_px4(base)
        self.px4 = Px4Companion(airframe(self.sim), gains=self.gains, child_frame=self.child_frame)
        self.px4.airborne()
        self.loop = TunedAutopilot(self.config)
        self.state = first_state(self.config.airframe)
        self.planner = InlinePlanner(real_planner(self.config))
        self.inbox = Inbox()
        self.wire = Wire(self.px4)
        self.wall_us = 0
        facts = vehicle_facts(self.config)
        self.link = Px4Link(
            self.wire, ("px4", 1), self.inbox, facts, lambda: self.wall_us, Encoders,
            servos=True, wait=lambda _, s: False,
        )  # fmt: skip
        self.encoder = Px4Encoder(DEFAULT_ORIGIN)
        truth = self.sim.healthy()
        self.servos = PositionServos(
            self.sim.vehicle, effects(self.scenario), truth.q_arm, 1e-6 * STEP_US
        )
        self.px4.joints = shares_of(servo_ranges(self.config.airframe), truth.q_arm)
        self.link.joints.measured(0, truth.q_arm, truth.qd_arm)
        self.answer = Px4Answer(0, *Controls.off(self.sim.vehicle)[:3])
        self.outputs: TickOutputs | None = None
        self.commands: list[Any] = []
        self.upload: MissionUpdate | None = None
        self.next_target_us = START_US
        self.streams = True  # of targets
        self.stopped = False  # our process, whose clocks go on
        self.arrived: list[Any] = []
        self.link.announce()

    @property
    def mode(self) -> Mode:
        return Mode.DISARMED if self.outputs is None else self.outputs.mode

    def run(self, seconds: float) -> None:
        for _ in range(round(seconds / 0.004)):
            self.exchange()
            assert self.sim.ended is None, self.sim.ended

    def exchange(self) -> None:
        """Sense, PX4, our tick, and two steps of the plant."""
        for half in range(2):
            self.arrived += self.sim.measurements() or ()
            if half == 0:
                self._meet_px4()
            now = self.sim.healthy()
            torques = self.servos.torques(
                self.answer.joints, now.q_arm, now.qd_arm, powered=self.answer.armed
            )
            self.sim.advance(Controls(self.answer.thrust, torques, self.answer.armed))

    def _meet_px4(self) -> None:
        for one in self.arrived:
            if isinstance(one, JointMeasurement):
                self.link.joints.measured(one.t_us, one.angles, None)
        message = self.encoder.step(self.sim.sensor_time_us, self.arrived)
        self.arrived = []
        answers = [read_answer(f, self.sim.vehicle) for f in split(self.px4.hear(message))]
        found = [one for one in answers if one is not None]
        self.answer = found[-1] if found else self.answer
        self.wall_us += 4000
        frame = None if self.stopped else self.link.wait_for_step()
        if frame is not None:
            self._tick(frame)

    def _tick(self, frame: Any) -> None:
        taken = self.planner.take(frame.t_us)
        inputs = self.inbox.take_inputs(frame, taken, None, None)
        commands, self.commands = tuple(self.commands), []
        upload, self.upload = self.upload, None
        fresh = announced(self.scenario) if self.outputs is None else ()
        inputs = replace(
            inputs,
            commands=(*inputs.commands, *commands),
            mission=upload,
            targets=self._targets(frame.t_us),
            announced=(*inputs.announced, *fresh),
        )
        controlled = self.loop.control(self.state, inputs)
        before = self.mode
        self.link.send_actuators(frame.t_us, controlled.outputs)
        self.state, self.outputs = self.loop.conclude(controlled)
        if self.outputs.plan_request is not None:
            self.planner.submit(self.outputs.plan_request)
        if self.outputs.setpoint is not None:
            self.setpoints.append((frame.t_us, self.outputs.setpoint))
        self.texts += [one.text for one in (*self.outputs.texts, *self.link.notices)]
        self.link.notices.clear()
        if self.mode is not before:
            self.modes.append(self.mode)

    def _targets(self, t_us: int) -> tuple[EndEffectorTarget, ...]:
        found = []
        while self.streams and self.next_target_us <= t_us + 2_000_000:
            start_us = self.sim.trajectory_start_us
            assert start_us is not None
            found.append(target(self.sim.clock, self.next_target_us))
            self.next_target_us += TARGET_US
        return tuple(found)
