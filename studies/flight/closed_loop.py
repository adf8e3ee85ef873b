"""One flight of the whole flight software in the full plant, in one process.

The order of events is that of the lockstep shell (``fsw.runtime.flight_loop``): sense, tick,
actuate, then plan at once and hand the answer in with the first tick at or after the instant
from which it applies. What the wire adds is left out: values stay doubles, and the arming and
mode commands of the scenario's pilot come on the first two ticks.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias

import numpy as np

from fsw.autopilot.estimation.estimator import READINGS
from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.calm_tick import CalmTick
from fsw.autopilot.flight.state import FlightState, first_state
from fsw.autopilot.measurements import Sample
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.parameters.carrying import payload_range
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.touching import Pressed, against_pressing
from fsw.autopilot.ports import PlanningCycle, PlanService
from fsw.autopilot.signals import (
    ActuatorCommand,
    Arm,
    BatteryReading,
    Command,
    CommandRequest,
    EndEffectorTarget,
    Grip,
    Mode,
    Plan,
    PlanFailure,
    PlanRequest,
    SafeSetAnnouncement,
    SensorFrame,
    SwitchMode,
    TickInputs,
    TickOutputs,
    frame_of_samples,
)
from sitl.scenario import Push, Scenario
from sitl.scenario_file import ScenarioError
from sitl.sensors.force_torque import WrenchMeasurement
from sitl.simulation import START_US, STEP_US, Controls, Simulation
from studies.flight.collector import collector_off
from studies.flight.mission import announced, moves, safe_set, target
from studies.flight.own_parts import OURS, OwnParts, planner_of
from studies.flight.result import (
    TRACE_STEPS,
    FlightRecorder,
    FlightResult,
    TracePoint,
    touched,
)
from studies.flight.samples import sample
from studies.flight.sensor_faults import Fault, FaultySensors

TARGET_US = 100_000  # between points of the reference, as the pilot sends them
_TARGETS_AHEAD = 20
_TARGET_STEPS = TARGET_US // STEP_US
_PILOT = (1, 195)
_ARM = Command(Arm(), CommandRequest(400, (1.0, *(0.0,) * 6), *_PILOT))
_FOLLOW = Command(
    SwitchMode(Mode.TRAJECTORY), CommandRequest(176, (1.0, 4.0, 11.0, *(0.0,) * 4), *_PILOT)
)


def _grip(*, closes: bool) -> Command:
    return Command(Grip(closes), CommandRequest(211, (1.0, float(closes), *(0.0,) * 5), *_PILOT))


FIRST_COMMANDS = ((_ARM,), (_FOLLOW,))  # of the first ticks

Seen: TypeAlias = Callable[[Simulation, TickInputs, TickOutputs], None]
"""Looks at a tick before the plant moves on."""


@dataclass
class ClosedLoop:
    """Plant, tick and planner in one loop; the caller gives the inputs of each step."""

    simulation: Simulation
    tick: Callable[[FlightState, TickInputs], tuple[FlightState, TickOutputs]]
    planner: PlanService
    airframe: Airframe
    state: FlightState = field(init=False)
    gripped: int = 0  # commands to the gripper that were given

    def __post_init__(self) -> None:
        self.state = first_state(self.airframe)

    def observe(self) -> tuple[SensorFrame, tuple[Sample, ...]]:
        """See :func:`readings`."""
        return readings(self.simulation)

    def inputs(self, sensors: SensorFrame, samples: tuple[Sample, ...] = ()) -> TickInputs:
        """What a tick with these readings is given beside them: a plan, and what a pilot sends."""
        step = self.simulation.step
        return TickInputs(
            sensors=sensors,
            plan=self.planner.take(sensors.t_us),
            commands=FIRST_COMMANDS[step] if step < len(FIRST_COMMANDS) else self.grips(),
            targets=self.targets(),
            announced=self.announced(),
            samples=samples,
        )

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

    def grips(self) -> tuple[Command, ...]:
        """What the scenario's pilot tells the gripper, in the first tick that is seen from then."""
        pilot = self.simulation.scenario.pilot
        times = (pilot.grab_s, pilot.release_s)[self.gripped :]
        if not times or not STEP_US * self.simulation.step >= 1e6 * times[0]:
            return ()
        self.gripped += 1
        return (_grip(closes=self.gripped == 1),)

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
        outputs = self.respond(inputs)
        if before_advancing is not None:
            before_advancing(outputs)
        self.simulation.advance(
            self.controls(outputs.actuators, armed=outputs.mode.armed, gripper=outputs.gripper)
        )
        return outputs

    def respond(self, inputs: TickInputs) -> TickOutputs:
        """Tick and plan: all of :meth:`step` but the plant's part."""
        self.state, outputs = self.tick(self.state, inputs)
        if outputs.plan_request is not None:
            self.planner.submit(outputs.plan_request)
        return outputs

    def controls(self, command: ActuatorCommand, *, armed: bool, gripper: float = 0.0) -> Controls:
        """See :func:`controls`, for ``gripper`` [1] too."""
        return controls(self.airframe, command, armed=armed, gripper=gripper)


def readings(simulation: Simulation) -> tuple[SensorFrame, tuple[Sample, ...]]:
    """Sensor readings of this step, and what arrived from a suite of sensors.

    With a suite the readings are little more than the time.
    """
    arrived = simulation.measurements()
    if arrived is not None:
        # What a force sensor says the flight software does not take in.
        samples = tuple([sample(one) for one in arrived if type(one) is not WrenchMeasurement])
        return frame_of_samples(
            simulation.sensor_time_us, samples, len(simulation.vehicle.joints)
        ), samples
    now = simulation.sense()
    # By position: keywords take a third longer, in every step.
    frame = SensorFrame(
        now.t_us, now.p_WB, now.v_WB, now.q_WB, now.gyro_B, now.accel_B, now.q_arm, now.qd_arm
    )
    return frame, ()


def controls(
    airframe: Airframe, command: ActuatorCommand, *, armed: bool, gripper: float = 0.0
) -> Controls:
    """The shares of full thrust and torque of a ``command`` [N, N m], and a ``gripper`` [1]."""
    return Controls(*airframe.shares(command), armed=armed, gripper=gripper)


class CalmStretch:
    """Flies the calm ticks of a loop without the inputs and outputs of each, which nobody reads.

    For studies of exact states: see ``fsw.autopilot.flight.calm_tick``.
    """

    def __init__(self, loop: ClosedLoop, calm: CalmTick, *, allowed: bool) -> None:
        """Fly none unless it is ``allowed``."""
        self._loop, self._calm = loop, calm
        self._allowed = allowed and loop.simulation.tells_its_state
        self._reading = np.zeros(READINGS)

    def fly(self) -> bool:
        """Go on as far as nothing happens, often not at all; whether the run is not over then."""
        loop, calm, reading = self._loop, self._calm, self._reading
        simulation, before = loop.simulation, loop.state
        r, flown = before.record, 0
        allowed = self._allowed and simulation.t_us == before.t_us + STEP_US
        for _ in range(calm.ticks(before) if allowed else 0):
            simulation.exact_state(reading)
            after = calm.step(r, reading, simulation.t_us)
            if after is None:
                break
            r, flown = after, flown + 1
            simulation.advance(
                loop.controls(r.actuator_command, armed=True, gripper=before.vehicle.gripper)
            )
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


class ScenarioFlight:
    """A scenario that starts in the air, with a trajectory plan, and what flies it, step by step.

    Of a step, :meth:`respond` is the flight software's part, then the plant moves, and
    :meth:`conclude` writes down what happened.
    """

    def __init__(
        self,
        simulation: Simulation,
        config: FlightConfig,
        seed: int = 0,
        *,
        parts: OwnParts = OURS,
        fault: Fault | None = None,
        traced: bool = False,
        asked: Callable[[PlanRequest], None] | None = None,
        seen: Seen | None = None,
    ) -> None:
        """The arguments are those of :func:`simulate`.

        Raises:
            ScenarioError: The body of the configuration starts outside the safe set, the payload is
                too heavy, or a force too large.
            OwnPartError: A part cannot be used.
        """
        check_body(simulation.scenario, config)
        check_payload(simulation.scenario, config)
        check_pressing(simulation.scenario, config)
        self.recorder = FlightRecorder()
        self.autopilot = Autopilot(config)
        law = parts.law(self.autopilot, simulation.clock, self.recorder)
        tick = self.autopilot.tick if law is None else law.tick
        planner = InlinePlanner(planner_of(config, parts))
        self.loop = ClosedLoop(simulation, tick, planner, config.airframe)
        # Somebody looks at each tick, or has a part in it; a fault of a sensor may be in each.
        self.may_be_calm = law is None and seen is None and fault is None and not traced
        self._steps_per_plan = config.ticks_per_plan
        self._fault, self._faulty = fault, FaultySensors(fault, seed)
        self._traced, self._asked, self._seen = traced, asked, seen
        self._mode, self._stamp_us = Mode.TRAJECTORY, START_US

    def step(self) -> None:
        """All of one step."""
        outputs, loop = self.respond(), self.loop
        loop.simulation.advance(
            loop.controls(outputs.actuators, armed=outputs.mode.armed, gripper=outputs.gripper)
        )
        self.conclude(outputs)

    def respond(self) -> TickOutputs:
        """Sense, tick and plan."""
        loop, recorder, simulation = self.loop, self.recorder, self.loop.simulation
        sensors, samples = loop.observe()
        if self._fault is not None:
            samples = self._faulty.samples(samples)
            exact = simulation.measurements() is None
            joints = len(simulation.vehicle.joints)
            sensors = (
                self._faulty.frame(sensors)
                if exact
                else frame_of_samples(sensors.t_us, samples, joints)
            )
        self._stamp_us = sensors.t_us
        inputs = loop.inputs(sensors, samples)
        if inputs.plan is not None:
            recorder.planned(inputs.plan)
        if self._traced and simulation.step % TRACE_STEPS == 0:
            recorder.trace.append(_trace_point(simulation))
        outputs = loop.respond(inputs)
        if self._seen is not None:
            self._seen(simulation, inputs, outputs)
        return outputs

    def conclude(self, outputs: TickOutputs) -> None:
        """Write down what a step has brought; see :meth:`respond`.

        Raises:
            RefusedError: The vehicle refused to arm or to follow.
        """
        recorder, simulation = self.recorder, self.loop.simulation
        step, t_us = simulation.step - 1, self._stamp_us
        if outputs.acks:
            _insist(outputs)
        if outputs.texts:
            time_s = 1e-6 * (t_us - START_US)
            recorder.texts += [(time_s, one.text) for one in outputs.texts]
        if outputs.mode is not self._mode and step >= len(FIRST_COMMANDS):
            self._mode = outputs.mode
            recorder.modes.append(self._mode.value)
            # As the scenario's pilot would, who looks on.
            simulation.leave_trajectory(
                t_us, f"the vehicle left the trajectory for {self._mode.value}"
            )
        if step % self._steps_per_plan == 0 and outputs.snapshot.plan_input is not None:
            recorder.metrics.add(outputs.snapshot.plan_input)
        if outputs.plan_request is not None and self._asked is not None:
            self._asked(outputs.plan_request)

    def result(self) -> FlightResult:
        """What the flight leaves."""
        simulation = self.loop.simulation
        return FlightResult(simulation.result(), self.recorder, touched(simulation.ended))


@collector_off()
def simulate(
    scenario: Scenario,
    seed: int,
    config: FlightConfig,
    *,
    fault: Fault | None = None,
    traced: bool = False,
    asked: Callable[[PlanRequest], None] | None = None,
    parts: OwnParts = OURS,
    seen: Seen | None = None,
) -> FlightResult:
    """Fly a scenario that starts in the air, with a trajectory plan, to its end.

    A ``fault`` is one of a sensor; ``traced`` keeps the truth every TRACE_STEPS steps; ``asked``
    receives every request to the planner, and ``seen`` every tick before the plant moves on.
    ``parts`` take the place of ours.

    Raises:
        RefusedError: The vehicle refused to arm or to follow.
        ScenarioError: The body of the configuration starts outside the safe set.
        OwnPartError: A part cannot be used.
    """
    simulation = Simulation(scenario, seed, parts.pushes())
    more: Any = {"fault": fault, "traced": traced, "asked": asked, "seen": seen}
    flight = ScenarioFlight(simulation, config, seed, parts=parts, **more)
    stretch = CalmStretch(flight.loop, flight.autopilot.calm, allowed=flight.may_be_calm)
    while stretch.fly():
        flight.step()
    return flight.result()


def check_body(scenario: Scenario, config: FlightConfig) -> None:
    """Refuse a configuration whose body is outside of the safe set where the scenario begins.

    Raises:
        ScenarioError: With the constraint, its margin and what to do.
    """
    body = config.planner.body
    if body == scenario.body:
        return
    try:
        Simulation(replace(scenario, body=body), 0)
    except ScenarioError as error:
        raise ScenarioError(
            f"body {body!r} keeps clear, the scenario is for {scenario.body!r}: {error}; use "
            f"body={scenario.body!r}"
        ) from None


def check_payload(scenario: Scenario, config: FlightConfig) -> None:
    """Refuse a payload that is heavier than the vehicle of a configuration may carry.

    Raises:
        ScenarioError: With its mass, what is allowed and what bounds that.
    """
    if scenario.payload is None:
        return
    held, (most, by) = scenario.payload.mass_kg, payload_range(config, loop_tube(config))
    if held > most:
        raise ScenarioError(
            f"payload.mass_kg = {held:g}: the vehicle may carry at most {most:.3f} kg, bounded "
            f"by {by}"
        )


def check_pressing(scenario: Scenario, config: FlightConfig) -> None:
    """Refuse a reference that presses harder, or slides so, than the vehicle can balance.

    Raises:
        ScenarioError: With the force, what is allowed and why.
    """
    curve = scenario.trajectory
    if not isinstance(curve, Push):
        return
    zones = [zone for zone in safe_set(scenario).zones if zone.touch is not None]
    loop = loop_tube(config)
    slides = curve.slide_m or ((0.0, 0.0, 0.0),) * len(curve.force_n)
    for k, (force, slide) in enumerate(zip(curve.force_n, slides, strict=True)):
        for zone in zones:
            against = against_pressing(config, zone, loop, Pressed(curve.normal, force, slide))
            if against:
                raise ScenarioError(f"trajectory.force_n[{k}] = {force:g}: {against}")


def _trace_point(simulation: Simulation) -> TracePoint:
    truth = simulation.truth()
    return TracePoint(
        t_s=simulation.time_s,
        p_WB=truth.p_WB,
        p_WE=truth.p_WE,
        p_target=truth.target.p,
        margin_m=min(truth.margins_m, default=math.inf),
    )


def _insist(outputs: TickOutputs) -> None:
    denied = [ack.command for ack in outputs.acks if ack.result != 0]
    if denied:
        # Beside the answer, which says why not, there may be news of other things.
        why = "; ".join(text.text for text in outputs.texts if text.prompt)
        raise RefusedError(why or f"command {denied[0]} was refused without a reason")
