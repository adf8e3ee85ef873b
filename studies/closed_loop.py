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

from fsw.flight.autopilot import Autopilot
from fsw.flight.state import FlightState
from fsw.measurements import Sample
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
from studies.faults import Fault, FaultySensors
from studies.flight_result import (
    TRACE_STEPS,
    FlightRecorder,
    FlightResult,
    TracePoint,
    processor_time_us,
    touched,
)
from studies.mission import announced, moves, target
from studies.samples import only_the_time, sample

TARGET_US = 100_000  # between points of the reference, as the pilot sends them
_TARGETS_AHEAD = 20
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

    def sense(self) -> SensorFrame:
        """Sensor readings of this step; with a suite of sensors its time alone."""
        now = self.simulation.sense()
        if self.simulation.measurements() is not None:
            return only_the_time(now.t_us, self.samples())
        (q1, q2), (qd1, qd2) = now.q_arm, now.qd_arm
        return SensorFrame(
            t_us=now.t_us,
            p_WB=now.p_WB,
            v_WB=now.v_WB,
            q_WB=now.q_WB,
            gyro_B=now.gyro_B,
            accel_B=now.accel_B,
            q_arm=(q1, q2),
            qd_arm=(qd1, qd2),
        )

    def samples(self) -> tuple[Sample, ...]:
        """What arrived from the suite of sensors in this step."""
        return tuple([sample(said) for said in self.simulation.measurements() or ()])

    def battery(self) -> BatteryReading | None:
        """What the battery says in this step, if anything."""
        said = self.simulation.battery()
        return None if said is None else BatteryReading(*said)

    def targets(self) -> tuple[EndEffectorTarget, ...]:
        """What the scenario's pilot streams: twenty points at once, then one every 0.1 s."""
        simulation = self.simulation
        start_us, step = simulation.trajectory_start_us, simulation.step
        every = TARGET_US // STEP_US
        if start_us is None or step % every != 0:
            return ()
        newest = _TARGETS_AHEAD - 1 + step // every
        first = 0 if step == 0 else newest
        clock = simulation.clock
        return tuple(target(clock, start_us + TARGET_US * k) for k in range(first, newest + 1))

    def announced(self) -> tuple[SafeSetAnnouncement, ...]:
        """What the scenario's pilot announces at this step: ten times a second where zones move."""
        step, scenario = self.simulation.step, self.simulation.scenario
        if step == 0 or (step % (TARGET_US // STEP_US) == 0 and moves(scenario)):
            return announced(scenario, self.simulation.t_us)
        return ()

    def step(
        self, inputs: TickInputs, before_advancing: Callable[[TickOutputs], None] | None = None
    ) -> TickOutputs:
        """Tick, plan, advance; ``before_advancing`` may set what pushes the plant meanwhile."""
        self.state, outputs = self.tick(self.state, inputs)
        if outputs.plan_request is not None:
            self.planner.submit(outputs.plan_request)
        if before_advancing is not None:
            before_advancing(outputs)
        self.simulation.advance(self._controls(outputs))
        return outputs

    def _controls(self, outputs: TickOutputs) -> Controls:
        sent, airframe = outputs.actuators, self.airframe
        f1, f2, f3, f4 = (thrust / airframe.rotor_thrust_max for thrust in sent.rotor_thrust)
        torque = tuple(value / airframe.joint_torque_max for value in sent.joint_torque)
        return Controls((f1, f2, f3, f4), torque, outputs.snapshot.armed)


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
    loop = ClosedLoop(simulation, Autopilot(config).tick, FlightState(), planner, config.airframe)
    steps_per_plan = config.mpc_period_us // config.tick_period_us
    faulty, mode = FaultySensors(fault, seed), Mode.TRAJECTORY
    while simulation.ended is None:
        step, samples = simulation.step, faulty.samples(loop.samples())
        sensors = loop.sense()
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
        _insist(outputs)
        recorder.texts += [(1e-6 * (sensors.t_us - START_US), one.text) for one in outputs.texts]
        if outputs.snapshot.mode is not mode and step >= len(FIRST_COMMANDS):
            mode = outputs.snapshot.mode
            recorder.modes.append(mode.value)
            # As the scenario's pilot would, who looks on.
            why = f"the vehicle left the trajectory for {mode.value}"
            simulation.leave_trajectory(sensors.t_us, why)
        applied = outputs.snapshot.plan_input
        if step % steps_per_plan == 0 and applied is not None:
            recorder.metrics.add(applied)
        if outputs.plan_request is not None and asked is not None:
            asked(outputs.plan_request)
    return FlightResult(simulation.result(), recorder, touched(simulation.ended))


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
