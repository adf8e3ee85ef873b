"""The commander: commands, failsafes and completed modes move the vehicle between modes.

It sets the home position too: at the first estimate, when arming, and by command.

What changes the state returns a new one; almost every tick none does.
"""

from __future__ import annotations

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.control.cascade import at_rest, in_hover
from fsw.autopilot.control.press import off_surface
from fsw.autopilot.control.tube import base_reach
from fsw.autopilot.flight.commands import arming
from fsw.autopilot.flight.commands.dedup import answered_before, remember, still_true
from fsw.autopilot.flight.commands.handlers import Decision, decide
from fsw.autopilot.flight.failsafe.conditions import NOTHING_DONE, Action
from fsw.autopilot.flight.failsafe.response import overridden, respond
from fsw.autopilot.flight.failsafe.table import ROWS, SLOW_US, active, active_between
from fsw.autopilot.flight.land_detector import in_the_air, stands
from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode, Handover
from fsw.autopilot.flight.modes.hold import stop
from fsw.autopilot.flight.modes.mission import left as mission_left
from fsw.autopilot.flight.modes.mission import with_update
from fsw.autopilot.flight.plan_exchange import without_plan
from fsw.autopilot.flight.safety import way_home
from fsw.autopilot.flight.safety.progress_watch import ProgressMemory
from fsw.autopilot.flight.safety.retreat import retreat_place
from fsw.autopilot.flight.safety.zone_room import within_room
from fsw.autopilot.flight.setpoints.generator import PositionGoal, SetpointGenerator
from fsw.autopilot.flight.setpoints.reference_horizon import ReferenceHorizon
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.parameters.carrying import payload_range
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.contradictions import contradictions
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import (
    ArmingReport,
    Command,
    CommandAck,
    CommandResult,
    Home,
    JointVector,
    MissionUpdate,
    Mode,
    MotionSetpoint,
    Sender,
    Severity,
    StateEstimate,
    StatusText,
)
from fsw.frozen import replace

# A name of the module is looked up ten times faster than a member of an enumeration.
_DISARMED = Mode.DISARMED
_RESTARTS = "command refused: the flight software restarts; send it again"
_AWAY = 0.3  # m off a surface that it has touched, or that is not as announced


class Commander:
    """Moves the vehicle of one configuration between modes."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        loop = loop_tube(config)
        self._tube_radius = base_reach(loop, config.surroundings.disturbance)
        self._heaviest = payload_range(config, loop).most
        self._generator = SetpointGenerator(config)
        self._horizon = ReferenceHorizon(config)
        self._modes: dict[Mode, FlightMode] = {mode: kind(config) for mode, kind in MODES.items()}
        self._contradiction = "; ".join(contradictions(config))
        self._no_mode = FlightMode(config)  # disarmed or terminated

    def mode(self, state: FlightState) -> FlightMode:
        """The current flight mode; without one, the vehicle stays where it is."""
        return self._modes.get(state.vehicle.mode, self._no_mode)

    def handle_commands(
        self,
        state: FlightState,
        estimate: StateEstimate,
        commands: tuple[Command, ...],
        texts: list[StatusText],
        *,
        known: bool = True,
    ) -> tuple[FlightState, list[CommandAck]]:
        """Carry out commands in the order they came; a repeated one is acknowledged again only.

        Before the first estimate nothing of it is ``known``, and what needs one is put off.
        """
        acks = []
        for command in commands:
            request, memory = command.request, state.vehicle.answered
            if state.vehicle.restarts:  # it would be undone
                texts.append(StatusText(Severity.CRITICAL, _RESTARTS, prompt=True))
                acks.append(acknowledgement(command, CommandResult.TEMPORARILY_REJECTED))
                continue
            before = answered_before(memory, request, estimate.t_us)
            if before is not None:
                result = before.result
            else:
                context = self.situation(state, estimate, request.sender, known=known)
                decision = decide(command, context, self._modes)
                result = decision.result
                texts += _reason(decision)
                state = self._carry_out(state, decision, estimate, texts)
                state = way_home.commanded(state, request.sender, decision.home, arms=decision.arm)
                now_answered, changes = state.vehicle.answered, decision.changes
                memory = remember(now_answered, request, result, estimate.t_us, changes)
                state = replace(state, vehicle=replace(state.vehicle, answered=memory))
            acks.append(acknowledgement(command, result))
        return state, acks

    def situation(
        self,
        state: FlightState,
        estimate: StateEstimate,
        sender: Sender | None = None,
        *,
        known: bool = True,
    ) -> Situation:
        """What a command of a ``sender``, or a failsafe, is decided on."""
        laws = self._config, self._contradiction, self._heaviest
        return Situation(state, estimate, *laws, sender, known)

    def arming_report(self, state: FlightState, estimate: StateEstimate) -> ArmingReport:
        """Which arming checks fail, for telemetry; of a vehicle that is armed, what is ill."""
        if state.vehicle.armed:
            ill = [one.value for one in state.vehicle.conditions if ROWS[one].component is not None]
            report = ArmingReport(ill=tuple(ill))
        else:
            found = arming.failed(self.situation(state, estimate))
            report = ArmingReport(tuple([number for number, _ in found]))
        return state.arming if report == state.arming else report

    def check_failsafes(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Report each condition once, when it becomes active, and take its action."""
        slowly = estimate.t_us // SLOW_US != state.t_us // SLOW_US
        vehicle = state.vehicle
        if vehicle.mode is Mode.FAULT:
            return state  # what ended the flight stays on show
        context = self.situation(state, estimate)
        rows = active(context) if slowly else active_between(context)
        before = vehicle.conditions
        if not rows and not before:
            return state
        now = tuple([row.condition for row in rows])
        if now == before and not slowly:
            return state
        response = respond(context, rows)
        texts += response.reports
        if now != before or response.memory != vehicle.failsafe:
            vehicle = replace(vehicle, conditions=now, failsafe=response.memory)
            state = replace(state, vehicle=vehicle)
        if response.action.mode is not None:
            state = self._fail_safe(state, response.action.mode, estimate, texts)
        if response.action is Action.RETREAT:
            state = replace(state, setpoint=self._retreating(state, estimate))
        return state

    def _fail_safe(
        self, state: FlightState, mode: Mode, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Switch to the failsafe's mode; the pilot's next mode command ends it."""
        if mode is Mode.FAULT:
            return self._switch(state, mode, "terminate", estimate, texts)
        before = state.vehicle.failsafe_from or state.vehicle.mode
        state = self._switch(state, mode, "failsafe", estimate, texts)
        return replace(state, vehicle=replace(state.vehicle, failsafe_from=before))

    def _retreating(self, state: FlightState, estimate: StateEstimate) -> SetpointMemory:
        """A setpoint off every zone by what a plan at rest keeps from it, and by the tube again.

        What has pushed the vehicle out may go on to push it.
        """
        config = self._config
        room = stand_off(config.planner.walls) + self._tube_radius
        safe_set = within_room(config, state.kept.safe_set, estimate)
        if safe_set.touchable:  # a moving surface needs more room
            room += _AWAY + max(state.record.pressing.moved, 0.0)
        place = retreat_place(config, safe_set, estimate, room)
        home = config.airframe.home if safe_set.touchable else None  # the arm has given way
        return self._towards(state, PositionGoal(MotionSetpoint(False, place), home), estimate)

    def check_mode_completion(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Update the mode; when it is complete, switch to the next one. At first set home."""
        vehicle = state.vehicle
        if vehicle.home is None:
            return _with_home(state, estimate)
        if vehicle.mode is _DISARMED:
            return self._check_intended_mode(state, estimate, texts)
        state, result = self.mode(state).update(state, estimate)
        if result is CONTINUE:
            return state
        texts += result.texts
        if result.lift_off:
            return replace(_lift_off(state, estimate), setpoint=SetpointMemory())
        if result.next_mode is None:
            return state
        return self._switch(
            state, result.next_mode, result.cause, estimate, texts, completed=result.completed
        )

    def _check_intended_mode(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Drop a mode chosen before arming when it times out or its conditions are lost."""
        intended = self._modes[state.vehicle.intended_mode]
        forgotten = intended.waits(state, estimate.t_us)
        if forgotten is None:
            return state
        texts.append(StatusText(Severity.WARNING, forgotten))
        vehicle = replace(state.vehicle, intended_mode=Mode.HOLD, answered=())
        return replace(state, vehicle=vehicle)

    def _carry_out(
        self,
        state: FlightState,
        decision: Decision,
        estimate: StateEstimate,
        texts: list[StatusText],
    ) -> FlightState:
        if decision.result != CommandResult.ACCEPTED:
            return state
        answered = still_true(state.vehicle.answered, decision.changes)
        if answered is not state.vehicle.answered:
            # Another sender's command is not done any more: it acts again if it is sent again.
            state = replace(state, vehicle=replace(state.vehicle, answered=answered))
        state = self._apply(state, decision, estimate)
        if decision.arm:
            state = self._arm(state, estimate, texts)
        elif decision.mode is not None:
            state = self._switch(state, decision.mode, "command", estimate, texts)
        if decision.stop and state.setpoint.reference is not None:
            state = replace(state, setpoint=stop(self._generator, state.setpoint, estimate))
        if decision.goal is not None:
            state = replace(state, setpoint=self._towards(state, decision.goal, estimate))
        if decision.joints is not None:
            state = replace(state, setpoint=self._with_joints(state, decision.joints, estimate))
        return self._taken_over(state, decision, texts)

    def _taken_over(
        self, state: FlightState, decision: Decision, texts: list[StatusText]
    ) -> FlightState:
        """The state after a command of the pilot: it ends a failsafe whose mode it changes."""
        vehicle, action = state.vehicle, state.vehicle.failsafe.action
        commands = decision.mode is not None or decision.stop or decision.goal is not None
        if action is Action.NONE or not commands or not vehicle.armed:
            return state
        cause = vehicle.failsafe.cause
        if cause in vehicle.conditions:
            assert cause is not None
            text = f"failsafe overridden: {cause.value}"
            texts.append(StatusText(Severity.WARNING, text))
        memory = overridden(vehicle.failsafe, vehicle.conditions)
        return replace(state, vehicle=replace(vehicle, failsafe=memory, failsafe_from=None))

    def _apply(
        self, state: FlightState, decision: Decision, estimate: StateEstimate
    ) -> FlightState:
        vehicle, limits = state.vehicle, self._config.limits
        if decision.home is not None:
            vehicle = replace(vehicle, home=decision.home)
        if Mode.TAKEOFF in (decision.mode, decision.intended_mode):
            climb = limits.takeoff_climb if decision.climb is None else decision.climb
            vehicle = replace(vehicle, climb=climb)
        if decision.intended_mode is not None:
            intended = decision.intended_mode
            vehicle = replace(vehicle, intended_mode=intended, intended_us=estimate.t_us)
        if decision.look_at is not None:
            vehicle = replace(vehicle, look_at=decision.look_at.place)
        if decision.speed is not None:
            vehicle = replace(vehicle, speed=decision.speed.speed)
            flight = replace(state.mission.flight, speed=decision.speed.speed)
            state = replace(state, mission=replace(state.mission, flight=flight))
        if decision.restart or decision.gripper is not None:
            gripper = decision.gripper or vehicle.gripper
            restarts = vehicle.restarts or decision.restart
            vehicle = replace(vehicle, restarts=restarts, gripper=gripper)
        if vehicle is not state.vehicle:
            state = replace(state, vehicle=vehicle)
        if decision.look_at is not None:
            state = self._turnable(state, estimate)
        if decision.mission_step is None:
            return state
        step = MissionUpdate(current=decision.mission_step)
        return with_update(state, step, self._config, estimate.t_us)

    def _turnable(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Give a stationary hold a setpoint, so that it can turn."""
        holds = state.vehicle.mode is Mode.HOLD and state.vehicle.flies
        if not holds or state.setpoint.reference is not None:
            return state
        return replace(state, setpoint=self._staying(estimate))

    def _staying(self, estimate: StateEstimate, q_arm: JointVector | None = None) -> SetpointMemory:
        """A setpoint of the body that stays where it is."""
        reference = self._generator.begin(estimate)
        return SetpointMemory(reference, PositionGoal(MotionSetpoint(False, reference.p), q_arm))

    def _towards(
        self, state: FlightState, goal: PositionGoal, estimate: StateEstimate
    ) -> SetpointMemory:
        """A setpoint of the body towards a goal; the arm stays as it was asked for."""
        reference, last = state.setpoint.reference, state.setpoint.goal
        if reference is None or reference.of_end_effector:
            reference = self._generator.begin(estimate)
        if goal.joints is None and last is not None:
            goal = replace(goal, joints=last.joints)
        if goal.orbit is not None:
            goal = replace(goal, motion=replace(goal.motion, yaw=reference.yaw))
        return SetpointMemory(reference, goal)

    def _with_joints(
        self, state: FlightState, q_arm: JointVector, estimate: StateEstimate
    ) -> SetpointMemory:
        """Hold the body where it is or on its way, and the arm as asked, from now on."""
        setpoint, goal = state.setpoint, state.setpoint.goal
        if setpoint.reference is None or goal is None or setpoint.reference.of_end_effector:
            return self._staying(estimate, q_arm)
        return replace(setpoint, goal=replace(goal, joints=q_arm))

    def _arm(
        self, state: FlightState, estimate: StateEstimate, texts: list[StatusText]
    ) -> FlightState:
        """Close the loops, in Hold; then go on to the mode that was chosen before arming."""
        airframe, landed = self._config.airframe, stands(self._config, estimate)
        intended = state.vehicle.intended_mode
        state = self._switch(state, Mode.HOLD, "arm", estimate, texts)
        vehicle = replace(
            state.vehicle,
            home=Home(estimate.p_WB, estimate.yaw),
            landed=landed,
            look_at=None,
            speed=None,
            intended_mode=Mode.HOLD,
            conditions=(),  # what is so is told again, and acted upon
            failsafe=NOTHING_DONE,
        )
        state, begin = without_plan(state, estimate), at_rest if landed else in_hover
        state = replace(
            state,
            vehicle=vehicle,
            setpoint=SetpointMemory(),
            record=begin(airframe, estimate, state.record),
        )
        if intended is Mode.HOLD:
            return state
        refusal = self._modes[intended].refusal(self.situation(state, estimate))
        if refusal is None:
            return self._switch(state, intended, "chosen before arming", estimate, texts)
        texts.append(StatusText(Severity.CRITICAL, refusal))
        return state

    def _switch(
        self,
        state: FlightState,
        mode: Mode,
        cause: str,
        estimate: StateEstimate,
        texts: list[StatusText],
        *,
        completed: bool = False,
    ) -> FlightState:
        """Begin another mode; a failsafe's mark stays if the one that is left was ``completed``."""
        before, vehicle = state.vehicle.mode, state.vehicle
        texts.append(StatusText(Severity.INFO, f"{before.value} to {mode.value}: {cause}"))
        follower = self._modes.get(mode, self._no_mode)
        here = self._horizon.here(estimate, estimate.t_us)
        last = self._horizon.target(self.mode(state), state, estimate, estimate.t_us)
        origin = last if completed or follower.continues_reference else here
        state = follower.activate(mission_left(state, mode), estimate, Handover(last, completed))
        if follower.lifts_off and vehicle.landed:
            state = _lift_off(state, estimate)
        state = in_the_air(state, estimate)
        vehicle = replace(
            state.vehicle,
            mode=mode,
            # What follows from a mode that was completed is what its command led to.
            answered=state.vehicle.answered if completed else (),
            mode_origin=off_surface(state.record.pressing, origin.p_WE, _AWAY),
            mode_yaw=origin.yaw,
            mode_begin_us=estimate.t_us,
            is_up=False,
            failsafe_from=vehicle.failsafe_from if completed else None,
        )
        if not vehicle.armed:
            memory = overridden(vehicle.failsafe, ())
            vehicle = replace(vehicle, failsafe_from=None, failsafe=memory)
            # On the ground another source may own the safe set from now on.
            state = replace(state, mission=replace(state.mission, owner_heard_us=-1))
        progress = ProgressMemory(estimate.p_WB, estimate.t_us)
        return replace(state, vehicle=vehicle, progress=progress)


def acknowledgement(command: Command, result: int) -> CommandAck:
    """The answer to its sender."""
    request = command.request
    return CommandAck(request.command, result, request.source_system, request.source_component)


def _with_home(state: FlightState, estimate: StateEstimate) -> FlightState:
    """The home position is where the vehicle is."""
    home = Home(estimate.p_WB, estimate.yaw)
    return replace(state, vehicle=replace(state.vehicle, home=home))


def _lift_off(state: FlightState, estimate: StateEstimate) -> FlightState:
    """Fly from now on, with the plan's state where the vehicle is."""
    state = in_the_air(state, estimate)
    vehicle = replace(state.vehicle, landed=False)
    return without_plan(replace(state, vehicle=vehicle), estimate)


def _reason(decision: Decision) -> tuple[StatusText, ...]:
    """A decision's reason as a text for the operator."""
    if not decision.reason:
        return ()
    harmless = decision.result == CommandResult.ACCEPTED and not decision.alarming
    severity = Severity.INFO if harmless else Severity.CRITICAL
    return (StatusText(severity, decision.reason, prompt=True),)
