"""One flight of the whole flight software in the full plant, in one process.

The order of events is that of the lockstep shell (``fsw.runtime.sim_loop``): sense, tick,
actuate, then plan at once and hand the answer in with the first tick at or after the instant
from which it applies. What the wire adds is left out: values stay doubles, and the arming and
mode commands of the scenario's pilot come on the first two ticks.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

from fsw.flight.autopilot import Autopilot
from fsw.flight.state import FlightState
from fsw.mpc.planner import Planner
from fsw.parameters.flight_config import FlightConfig
from fsw.signals import (
    Arm,
    Command,
    CommandRequest,
    EndEffectorTarget,
    Mode,
    Plan,
    PlanFailure,
    PlanRequest,
    SensorFrame,
    SwitchMode,
    TickInputs,
    TickOutputs,
)
from sitl.scenario import Scenario
from sitl.sensors.suite import SensorReadings
from sitl.simulation import STEP_US, Controls, Simulation
from studies.flight_result import (
    TRACE_STEPS,
    FlightRecorder,
    FlightResult,
    TracePoint,
    processor_time_us,
)
from studies.mission import safe_set, target

_TARGET_US = 100_000  # between points of the reference, as the pilot sends them
_TARGETS_AHEAD = 20
_PILOT = (1, 195)
_ARM = Command(Arm(), CommandRequest(400, (1.0, *(0.0,) * 6), *_PILOT))
_FOLLOW = Command(
    SwitchMode(Mode.TRAJECTORY), CommandRequest(176, (1.0, 4.0, 11.0, *(0.0,) * 4), *_PILOT)
)


@dataclass(frozen=True, slots=True)
class _Answer:
    due_us: int
    plan: Plan | PlanFailure


class RefusedError(RuntimeError):
    """The flight software denied a command of the study's pilot."""


def fly(
    scenario: Scenario,
    seed: int,
    config: FlightConfig,
    *,
    traced: bool = False,
    asked: Callable[[PlanRequest], None] | None = None,
) -> FlightResult:
    """Fly a scenario that starts in the air to its end.

    Args:
        scenario: With a trajectory plan.
        seed: Of every random number of the plant.
        config: Of the flight software.
        traced: Keep the truth every TRACE_STEPS steps.
        asked: Hears every request to the planner.

    Raises:
        RefusedError: The vehicle refused to arm or to follow.
    """
    flight = _Flight(scenario, seed, config, traced, asked)
    while flight.simulation.ended is None:
        flight.step()
    return flight.recorder.result(flight.simulation.result())


class _Flight:
    def __init__(
        self,
        scenario: Scenario,
        seed: int,
        config: FlightConfig,
        traced: bool,
        asked: Callable[[PlanRequest], None] | None,
    ) -> None:
        self.simulation = Simulation(scenario, seed)
        self.recorder = FlightRecorder()
        self._safe_set = safe_set(scenario)
        self._config = config
        self._loop = Autopilot(config)
        self._state = FlightState()
        self._planner = Planner(config.planner, config.airframe, processor_time_us)
        self._answer: _Answer | None = None
        self._steps_per_plan = config.mpc_period_us // config.tick_period_us
        self._traced = traced
        self._asked = asked

    def step(self) -> None:
        """One exchange between plant and flight software."""
        simulation = self.simulation
        step, readings = simulation.step, simulation.sense()
        inputs = TickInputs(
            _frame(readings),
            self._take(readings.t_us),
            ((_ARM,), (_FOLLOW,))[step] if step < 2 else (),
            self._targets(step),
            self._safe_set if step == 0 else None,
        )
        self._state, outputs = self._loop.tick(self._state, inputs)
        _insist(outputs)
        applied = outputs.snapshot.plan_input
        if step % self._steps_per_plan == 0 and applied is not None:
            self.recorder.metrics.add(applied)
        if self._traced and step % TRACE_STEPS == 0:
            self.recorder.trace.append(self._trace_point())
        if outputs.plan_request is not None:
            if self._asked is not None:
                self._asked(outputs.plan_request)
            answer = self._planner.plan(outputs.plan_request)
            self.recorder.planned(answer)
            self._answer = _Answer(outputs.plan_request.t_apply_us, answer)
        simulation.advance(self._controls(outputs))

    def _take(self, t_us: int) -> Plan | PlanFailure | None:
        answer = self._answer
        if answer is None or t_us < answer.due_us:
            return None
        self._answer = None
        return answer.plan

    def _targets(self, step: int) -> tuple[EndEffectorTarget, ...]:
        """Twenty points ahead at once, then one every point's interval."""
        start_us = self.simulation.trajectory_start_us
        every = _TARGET_US // STEP_US
        if start_us is None or step % every != 0:
            return ()
        newest = _TARGETS_AHEAD - 1 + step // every
        first = 0 if step == 0 else newest
        clock = self.simulation.clock
        return tuple(target(clock, start_us + _TARGET_US * k) for k in range(first, newest + 1))

    def _controls(self, outputs: TickOutputs) -> Controls:
        sent, airframe = outputs.actuators, self._config.airframe
        f1, f2, f3, f4 = (thrust / airframe.rotor_thrust_max for thrust in sent.rotor_thrust)
        torque = tuple(value / airframe.joint_torque_max for value in sent.joint_torque)
        return Controls((f1, f2, f3, f4), torque, outputs.snapshot.armed)

    def _trace_point(self) -> TracePoint:
        truth = self.simulation.truth()
        return TracePoint(
            self.simulation.time_s,
            truth.p_WB,
            truth.p_WE,
            truth.target.p,
            min(truth.margins_m),
        )


def _frame(readings: SensorReadings) -> SensorFrame:
    (q1, q2), (qd1, qd2) = readings.q_arm, readings.qd_arm
    return SensorFrame(
        readings.t_us,
        readings.p_WB,
        readings.v_WB,
        readings.q_WB,
        readings.gyro_B,
        readings.accel_B,
        (q1, q2),
        (qd1, qd2),
    )


def _insist(outputs: TickOutputs) -> None:
    for ack in outputs.acks:
        if ack.result != 0:
            texts = "; ".join(text.text for text in outputs.texts)
            raise RefusedError(f"command {ack.command} was answered with {ack.result}: {texts}")
