"""One flight of the whole flight software in the full plant, in one process.

The order of events is that of the lockstep shell (``fsw.runtime.sim_loop``): sense, tick,
actuate, then plan at once and hand the answer in with the first tick at or after the instant
from which it applies. What the wire adds is left out: values stay doubles, and the arming and
mode commands of the scenario's pilot come on the first two ticks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from fsw.estimation.estimator import READINGS
from fsw.flight.autopilot import Autopilot
from fsw.flight.calm_tick import CalmTick
from fsw.flight.state import FlightState
from fsw.measurements import Sample, Vec2, Vec4
from fsw.model.airframe import Airframe
from fsw.mpc.planner import Planner
from fsw.parameters.flight_config import FlightConfig
from fsw.ports import PlanningCycle, PlanService
from fsw.signals import (
    Arm,
    BatteryReading,
    Command,
    CommandRequest,
    EndEffectorTarget,
    Mode,
    Plan,
    PlanFailure,
    PlanRequest,
    SafeSetAnnouncement,
    SensorFrame,
    SwitchMode,
    TickInputs,
    TickOutputs,
)
from sitl.scenario import Scenario
from sitl.simulation import START_US, STEP_US, Controls, Simulation
from studies.flight.collector import collector_off
from studies.flight.mission import announced, moves, target
from studies.flight.result import (
    TRACE_STEPS,
    FlightRecorder,
    FlightResult,
    TracePoint,
    processor_time_us,
    touched,
)
from studies.flight.samples import only_the_time, sample
from studies.flight.sensor_faults import Fault, FaultySensors

TARGET_US = 100_000  # between points of the reference, as the pilot sends them
_TARGETS_AHEAD = 20
_TARGET_STEPS = TARGET_US // STEP_US
_PILOT = (1, 195)
_ARM = Command(Arm(), CommandRequest(400, (1.0, *(0.0,) * 6), *_PILOT))
_FOLLOW = Command(
    SwitchMode(Mode.TRAJECTORY), CommandRequest(176, (1.0, 4.0, 11.0, *(0.0,) * 4), *_PILOT)
)
FIRST_COMMANDS = ((_ARM,), (_FOLLOW,))  # of the first ticks

State = TypeVar("State")


@dataclass
class ClosedLoop(Generic[State]):
    """Plant, tick and planner in one loop; the caller gives the inputs of each step."""

    simulation: Simulation
    tick: Callable[[State, TickInputs], tuple[State, TickOutputs]]
    state: State
    planner: PlanService
    airframe: Airframe

    def observe(self) -> tuple[SensorFrame, tuple[Sample, ...]]:
        """Sensor readings of this step, and what arrived from a suite of sensors.

        With a suite the readings are little more than the time.
        """
        simulation = self.simulation
        arrived = simulation.measurements()
        if arrived is not None:
            samples = tuple([sample(one) for one in arrived])
            return only_the_time(simulation.sensor_time_us, samples), samples
        now = simulation.sense()
        (q1, q2), (qd1, qd2) = now.q_arm, now.qd_arm
        # By position: keywords take a third longer, in every step.
        frame = SensorFrame(
            now.t_us, now.p_WB, now.v_WB, now.q_WB, now.gyro_B, now.accel_B, (q1, q2), (qd1, qd2)
        )
        return frame, ()

    def sense(self) -> SensorFrame:
        """The first part of :meth:`observe`."""
        return self.observe()[0]

    def samples(self) -> tuple[Sample, ...]:
        """The second part of :meth:`observe`."""
        return self.observe()[1]

    def battery(self) -> BatteryReading | None:
        """What the battery says in this step, if anything."""
        said = self.simulation.battery()
        return None if said is None else BatteryReading(*said)

    def targets(self) -> tuple[EndEffectorTarget, ...]:
        """What the scenario's pilot streams: twenty points at once, then one every 0.1 s."""
        simulation = self.simulation
        step = simulation.step
        if step % _TARGET_STEPS != 0:
            return ()
        start_us = simulation.trajectory_start_us
        if start_us is None:
            return ()
        newest = _TARGETS_AHEAD - 1 + step // _TARGET_STEPS
        first = 0 if step == 0 else newest
        clock = simulation.clock
        return tuple(target(clock, start_us + TARGET_US * k) for k in range(first, newest + 1))

    def announced(self) -> tuple[SafeSetAnnouncement, ...]:
        """What the scenario's pilot announces at this step: ten times a second where zones move."""
        step, scenario = self.simulation.step, self.simulation.scenario
        if step % _TARGET_STEPS != 0 or (step and not moves(scenario)):
            return ()
        return announced(scenario, self.simulation.t_us)

    def step(
        self, inputs: TickInputs, before_advancing: Callable[[TickOutputs], None] | None = None
    ) -> TickOutputs:
        """Tick, plan, advance; ``before_advancing`` may set what pushes the plant meanwhile."""
        self.state, outputs = self.tick(self.state, inputs)
        if outputs.plan_request is not None:
            self.planner.submit(outputs.plan_request)
        if before_advancing is not None:
            before_advancing(outputs)
        self.simulation.advance(self.controls(outputs.actuators, armed=outputs.mode.armed))
        return outputs

    def controls(self, command: tuple[Vec4, Vec2], *, armed: bool) -> Controls:
        """The shares of full thrust and torque that a ``command`` [N, N m] is."""
        # Written out: each generator would take longer than all of this.
        (f1, f2, f3, f4), (t1, t2) = command
        force, torque = self.airframe.rotor_thrust_max, self.airframe.joint_torque_max
        thrust = (f1 / force, f2 / force, f3 / force, f4 / force)
        return Controls(thrust, (t1 / torque, t2 / torque), armed)


class CalmStretch:
    """Flies the calm ticks of a loop without the inputs and outputs of each, which nobody reads.

    For studies of exact states: see ``fsw.flight.calm_tick``.
    """

    def __init__(self, loop: ClosedLoop[FlightState], calm: CalmTick, *, allowed: bool) -> None:
        """Fly none unless it is ``allowed``."""
        self._loop, self._calm = loop, calm
        self._allowed = allowed and loop.simulation.tells_its_state
        self._reading = np.empty(READINGS)

    def fly(self) -> bool:
        """Go on as far as nothing happens, often not at all; whether the run is not over then."""
        loop, calm, reading = self._loop, self._calm, self._reading
        simulation, before = loop.simulation, loop.state
        r, flown = before.cascade, 0
        allowed = self._allowed and simulation.t_us == before.t_us + STEP_US
        for _ in range(calm.ticks(before) if allowed else 0):
            simulation.exact_state(reading)
            after = calm.step(r, reading, simulation.t_us)
            if after is None:
                break
            r, flown = after, flown + 1
            simulation.advance(loop.controls(r.commanded, armed=True))
            if simulation.ended is not None:
                break
        if flown:
            loop.state = calm.after(before, r, ticks=flown)
        return simulation.ended is None


class RefusedError(RuntimeError):
    """The flight software denied a command of the study's pilot."""


class InlinePlanner:
    """Plans at once; the answer waits for its tick."""

    def __init__(self, planner: PlanningCycle) -> None:
        self._planner = planner
        self._answer: tuple[int, Plan | PlanFailure] | None = None

    def submit(self, request: PlanRequest) -> None:
        """See ``PlanService``."""
        self._answer = (request.t_apply_us, self._planner.plan(request))

    def take(self, t_us: int) -> Plan | PlanFailure | None:
        """See ``PlanService``."""
        if self._answer is None or t_us < self._answer[0]:
            return None
        (_, answer), self._answer = self._answer, None
        return answer

    def close(self) -> None:
        """Nothing to stop."""


@collector_off()
def simulate(
    scenario: Scenario,
    seed: int,
    config: FlightConfig,
    *,
    fault: Fault | None = None,
    traced: bool = False,
    asked: Callable[[PlanRequest], None] | None = None,
) -> FlightResult:
    """Fly a scenario that starts in the air, with a trajectory plan, to its end.

    A ``fault`` is one of a sensor; ``traced`` keeps the truth every TRACE_STEPS steps; ``asked``
    receives every request to the planner.

    Raises:
        RefusedError: The vehicle refused to arm or to follow.
    """
    simulation, recorder = Simulation(scenario, seed), FlightRecorder()
    planner = InlinePlanner(Planner(config.planner, config.airframe, processor_time_us))
    autopilot = Autopilot(config)
    loop = ClosedLoop(simulation, autopilot.tick, FlightState(), planner, config.airframe)
    # A trace is of every so many ticks, and a fault of a sensor may be in each.
    stretch = CalmStretch(loop, autopilot.calm, allowed=fault is None and not traced)
    steps_per_plan = config.mpc_period_us // config.tick_period_us
    faulty, mode = FaultySensors(fault, seed), Mode.TRAJECTORY
    while stretch.fly():
        step = simulation.step
        sensors, samples = loop.observe()
        if fault is not None:
            samples = faulty.samples(samples)
            exact = simulation.measurements() is None
            sensors = faulty.frame(sensors) if exact else only_the_time(sensors.t_us, samples)
        answer = planner.take(sensors.t_us)
        if answer is not None:
            recorder.planned(answer)
        inputs = TickInputs(
            sensors=sensors,
            plan=answer,
            commands=FIRST_COMMANDS[step] if step < len(FIRST_COMMANDS) else (),
            targets=loop.targets(),
            announced=loop.announced(),
            samples=samples,
        )
        if traced and step % TRACE_STEPS == 0:
            recorder.trace.append(_trace_point(simulation))
        outputs = loop.step(inputs)
        if outputs.acks:
            _insist(outputs)
        if outputs.texts:
            time_s = 1e-6 * (sensors.t_us - START_US)
            recorder.texts += [(time_s, one.text) for one in outputs.texts]
        if outputs.mode is not mode and step >= len(FIRST_COMMANDS):
            mode = outputs.mode
            recorder.modes.append(mode.value)
            # As the scenario's pilot would, who looks on.
            why = f"the vehicle left the trajectory for {mode.value}"
            why += _other_body(scenario, config)
            simulation.leave_trajectory(sensors.t_us, why)
        if step % steps_per_plan == 0 and outputs.snapshot.plan_input is not None:
            recorder.metrics.add(outputs.snapshot.plan_input)
        if outputs.plan_request is not None and asked is not None:
            asked(outputs.plan_request)
    return FlightResult(simulation.result(), recorder, touched(simulation.ended))


def _other_body(scenario: Scenario, config: FlightConfig) -> str:
    """What may be the reason where another body keeps clear than the scenario is made for."""
    body = config.planner.body
    if body == scenario.body:
        return ""
    return (
        f" (body {body!r} keeps clear, the scenario is for {scenario.body!r}: "
        f"flight_config(body={scenario.body!r}))"
    )


def _trace_point(simulation: Simulation) -> TracePoint:
    truth = simulation.truth()
    return TracePoint(
        t_s=simulation.time_s,
        p_WB=truth.p_WB,
        p_WE=truth.p_WE,
        p_target=truth.target.p,
        margin_m=min(truth.margins_m),
    )


def _insist(outputs: TickOutputs) -> None:
    for ack in outputs.acks:
        if ack.result != 0:
            texts = "; ".join(text.text for text in outputs.texts)
            raise RefusedError(f"command {ack.command} was answered with {ack.result}: {texts}")
