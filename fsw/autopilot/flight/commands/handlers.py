"""Command handlers: one pure function for each kind of command, which returns a decision."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from fsw.autopilot.flight.commands import arming
from fsw.autopilot.flight.commands.bounds import GRIPPER_OF_PX4, motion_refusal, place_problem
from fsw.autopilot.flight.commands.circle_room import circle_too_close
from fsw.autopilot.flight.commands.dedup import COURSE
from fsw.autopilot.flight.failsafe.table import BLOCKING
from fsw.autopilot.flight.modes.base import FlightMode
from fsw.autopilot.flight.restart import RESTARTED, rests
from fsw.autopilot.flight.safety import way_home
from fsw.autopilot.flight.setpoints.generator import PositionGoal, max_orbit_speed
from fsw.autopilot.flight.setpoints.offboard_setpoint import joints_refusal
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.model.arm_coordinates import arm_coordinates
from fsw.autopilot.model.body import hull_reach
from fsw.autopilot.parameters.flight_config import lowest_height
from fsw.autopilot.shapes.zones import surface
from fsw.autopilot.signals import (
    Arm,
    ChangeSpeed,
    Command,
    CommandAction,
    CommandResult,
    Disarm,
    FlyOrbit,
    GoTo,
    Grip,
    Home,
    InjectFailure,
    JointVector,
    LookAt,
    Mode,
    MotionSetpoint,
    MoveJoints,
    Orbit,
    Order,
    Place,
    Rejected,
    SetHome,
    SetMissionStep,
    StartMission,
    SwitchMode,
    TakeOff,
    Vec3,
)
from fsw.frozen import replace

ACCEPTED, DENIED = CommandResult.ACCEPTED, CommandResult.DENIED
LATER: Final = CommandResult.TEMPORARILY_REJECTED
MIN_SPEED: Final = 0.01  # m/s
_CLIMB_TOLERANCE: Final = 0.05  # m: a ground station rounds, and starts from its last altitude
_SETTINGS: Final = ("home", "mission_step", "look_at", "speed", "gripper")  # of a decision


@dataclass(frozen=True, slots=True)
class NewHeading:
    """Where the nose points from now on; a decision without one leaves the heading."""

    place: Vec3 | None  # m; None: along the flight


@dataclass(frozen=True, slots=True)
class Decision:
    """Result of a command and its effects."""

    result: CommandResult
    reason: str = ""  # of a refusal, or what the operator must read though it is accepted
    alarming: bool = False
    arm: bool = False
    mode: Mode | None = None  # to switch to
    intended_mode: Mode | None = None  # what arming is to lead to
    stop: bool = False  # holding already, but perhaps on the way to a place
    climb: float | None = None  # m, of a takeoff; None: the usual one
    goal: PositionGoal | None = None
    joints: JointVector | None = None  # rad
    home: Home | None = None
    mission_step: int | None = None  # to fly next
    look_at: NewHeading | None = None
    speed: ChangeSpeed | None = None
    restart: bool = False
    gripper: float | None = None  # 1 closes, -1 opens

    @property
    def changes(self) -> frozenset[str]:
        """What another command may undo: COURSE, and the names of what stays set."""
        named = {name for name in _SETTINGS if getattr(self, name) is not None}
        ways = (self.mode, self.intended_mode, self.goal, self.joints)
        if self.arm or self.stop or self.restart or any(way is not None for way in ways):
            named.add(COURSE)
        return frozenset(named)


Modes = Mapping[Mode, FlightMode]


def decide(command: Command, context: Situation, modes: Modes) -> Decision:
    """Accept a command with its effects, or refuse it with a reason.

    Before the first estimate what needs one is put off.
    """
    action = command.action
    if not (context.known or isinstance(action, _NEED_NO_ESTIMATE) or action in _ORDERS_WITHOUT):
        return Decision(LATER, "command refused: there is no valid state estimate yet")
    handler = COMMAND_HANDLERS[action if isinstance(action, Order) else type(action)]
    decision: Decision = handler(action, context, modes)
    if "{sender}" not in decision.reason:
        return decision
    sender = "{}/{}".format(*command.request.sender)
    return replace(decision, reason=decision.reason.replace("{sender}", sender))


def _reject(action: Rejected, context: Situation, modes: Modes) -> Decision:
    """Refuse a command that the link could not decode.

    What is not supported has no reason: ground stations probe for cameras, gimbals and much else,
    and a text for each would hide the texts that matter.
    """
    return Decision(action.result, action.reason)


def _arm(action: Arm, context: Situation, modes: Modes) -> Decision:
    if context.mode is Mode.FAULT:
        return Decision(LATER, "arm is not possible while fault: restart the flight software")
    if context.mode is not Mode.DISARMED:
        return Decision(ACCEPTED)
    refusal = arming.refusal(context, force=action.force)
    if refusal is not None:
        return Decision(DENIED if arming.is_permanent(context) else LATER, refusal)
    ignored = arming.refusal(context) if action.force else None
    if ignored is not None:
        return Decision(ACCEPTED, f"armed by force; {ignored}", alarming=True, arm=True)
    return Decision(ACCEPTED, arm=True)


def _disarm(action: Disarm, context: Situation, modes: Modes) -> Decision:
    if not context.mode.armed:
        return Decision(ACCEPTED)
    if context.landed or context.config.is_above_px4:  # PX4 flies: it is given back
        return Decision(ACCEPTED, mode=Mode.DISARMED)
    if not action.force:
        return Decision(LATER, "not disarmed: the vehicle is in the air; land first or force")
    reason = "disarmed in the air, by force of {sender}: the rotors stop"
    return Decision(ACCEPTED, reason, alarming=True, mode=Mode.DISARMED)


def _switch(wanted: Mode, context: Situation, modes: Modes) -> Decision:
    """Change the mode if everything that the new one needs is there."""
    mode = modes[wanted]
    blocked = _blocked(context)
    if blocked:
        return Decision(LATER, f"no {wanted.value}: {blocked}")
    denial = mode.denial(context)
    if denial is not None:
        return Decision(DENIED, denial)
    refusal = mode.refusal(context)
    if refusal is not None:
        return Decision(LATER, refusal)
    if context.mode is Mode.DISARMED and mode.before_arming:
        return Decision(ACCEPTED, intended_mode=wanted)
    if context.mode is wanted:
        return Decision(ACCEPTED, stop=wanted is Mode.HOLD)
    current = modes.get(context.mode)
    if current is None or not mode.can_follow(current):
        return Decision(LATER, f"{wanted.value} is not possible while {context.mode.value}")
    return Decision(ACCEPTED, mode=wanted)


def _take_off(action: TakeOff, context: Situation, modes: Modes) -> Decision:
    """Take off vertically; a command before arming takes effect at arming."""
    decision = _switch(Mode.TAKEOFF, context, modes)
    height = _height(action.to, context)
    if height is None or Mode.TAKEOFF not in (decision.mode, decision.intended_mode):
        return decision
    here = -context.estimate.p_WB[2]
    least = context.limits.airborne_height
    most = min(context.limits.takeoff_climb_most, context.config.steering.highest - here)
    climb = height - here
    if not least - _CLIMB_TOLERANCE <= climb <= most + _CLIMB_TOLERANCE:
        range_text = f"{here + least:.1f} to {here + most:.1f} m"
        reason = f"no takeoff: height {height:.1f} m above the origin is outside {range_text}"
        return Decision(LATER, reason)
    return replace(decision, climb=min(max(climb, least), most))


def _go_to(action: GoTo, context: Situation, modes: Modes) -> Decision:
    """Hold at another place, height or heading."""
    refusal = _hovering_refusal(context)
    if refusal is not None:
        return Decision(LATER, f"no goto: {refusal}")
    if context.mode is not Mode.HOLD and not action.may_switch_mode:
        reason = "not in hold, and the command does not ask to change the mode"
        return Decision(LATER, f"no goto: {reason}")
    place = _place(action.place, context)
    blocked = _out_of_bounds(place, context) or _too_close(place, context)
    if blocked is not None:
        return Decision(DENIED, f"no goto: {blocked}")
    decision = _switch(Mode.HOLD, context, modes)
    if decision.result != ACCEPTED:
        return decision
    motion, speed = MotionSetpoint(False, place, yaw=action.yaw), action.speed
    refusal = motion_refusal(motion)
    if refusal is not None or not (speed is None or 0.0 < speed < math.inf):
        return Decision(DENIED, f"no goto: {refusal or 'speed out of range'}")
    slower, max_speed = "", context.config.steering.speed
    if speed is not None and speed > max_speed:
        slower = f"goto at {max_speed:g} m/s: faster is not flown (STR_V_MAX)"
    return replace(decision, goal=PositionGoal(motion, speed=speed), reason=slower)


def _orbit(action: FlyOrbit, context: Situation, modes: Modes) -> Decision:
    refusal = _hovering_refusal(context)
    if refusal is not None:
        return Decision(LATER, f"no orbit: {refusal}")
    centre, radius = _place(action.centre, context), action.radius
    blocked = _out_of_bounds(centre, context) or _circle_too_close(centre, radius, context)
    if blocked is not None:
        return Decision(DENIED, f"no orbit: {blocked}")
    limits = context.config.steering
    most = max_orbit_speed(radius, limits.yaw_rate, limits.acceleration)
    most = min(most, limits.speed)
    usual = context.vehicle.speed or limits.cruise_speed
    asked = min(usual, most) if action.speed is None else action.speed
    decision = _switch(Mode.ORBIT, context, modes)
    if decision.result != ACCEPTED:
        return decision
    flown = min(asked, most)
    orbit = Orbit(
        centre=centre, radius=radius, speed=flown, clockwise=action.clockwise, facing=action.facing
    )
    slower = f"orbit at {flown:.2f} m/s: faster cannot be flown at {radius:g} m"
    goal = PositionGoal(MotionSetpoint(False, centre), orbit=orbit)
    return replace(decision, goal=goal, reason=slower if asked > most else "")


def _look_at(action: LookAt, context: Situation, modes: Modes) -> Decision:
    """The nose, and so the arm's plane, turns to a place and follows it."""
    if action.place is None:
        return Decision(ACCEPTED, look_at=NewHeading(None))
    place = _place(action.place, context)
    far = place_problem(place)
    if far is not None:
        return Decision(DENIED, f"no region of interest: {far}")
    if not context.mode.armed:
        return Decision(LATER, "no region of interest: the vehicle is not armed")
    return Decision(ACCEPTED, look_at=NewHeading(place))


def _change_speed(action: ChangeSpeed, context: Situation, modes: Modes) -> Decision:
    """Change the speed towards position goals; in a mission from the next segment."""
    speed, most = action.speed, context.config.steering.speed
    if speed is not None and not MIN_SPEED <= speed <= most:
        reason = f"{speed:g} m/s is outside {MIN_SPEED:g} to {most:g} m/s"
        return Decision(DENIED, f"speed unchanged: {reason}")
    return Decision(ACCEPTED, speed=action)


def _move_joints(action: MoveJoints, context: Situation, modes: Modes) -> Decision:
    """Each joint as a share of the limit of its coordinate, such as of joints 1 and 2 together."""
    refusal = _hovering_refusal(context)
    if refusal is None and context.mode is not Mode.HOLD:
        refusal = f"the arm is not free while {context.mode.value}; hold first"
    if refusal is not None:
        return Decision(LATER, f"joints not moved: {refusal}")
    goal = context.state.setpoint.goal
    asked = goal.joints if goal is not None else None
    arm, q_arm = arm_coordinates(context.config.airframe), list(asked or context.estimate.q_arm)
    for k, share in enumerate(action.shares):
        if share is None:
            continue
        if k >= arm.joints:
            refusal = f"there is no joint {k + 1}, the arm has {arm.joints}"
            return Decision(DENIED, f"joints not moved: {refusal}")
        limit = arm.high[k] if share > 0.0 else -arm.low[k]
        q_arm[k] = share * min(limit, math.pi)
    refusal = joints_refusal(tuple(q_arm), context.config.airframe)
    if refusal is not None:
        return Decision(DENIED, f"joints not moved: {refusal}")
    return Decision(ACCEPTED, joints=tuple(q_arm))


def _set_home(action: SetHome, context: Situation, modes: Modes) -> Decision:
    if not context.estimate_is_valid:
        return Decision(LATER, "home not set: the estimate is invalid")
    place = context.estimate.p_WB if action.place is None else _place(action.place, context)
    north, east, height = *place[:2], -place[2]
    mission, owner = context.mission, context.limits.safe_set_owner
    denied = way_home.against(mission, context.sender, owner, armed=context.mode.armed)
    against = denied or place_problem(place)
    highest = context.config.steering.highest
    if not against and not height <= highest:
        against = f"{height:.1f} m above the origin is too high; the maximum is {highest:g} m"
    against = against or way_home.outside(mission.fence, (north, east))
    if against:
        return Decision(DENIED, f"home not set by {{sender}}: {against}")
    where = f"{way_home.told(((north, east),))}, {height:.1f} m above the origin"
    home = Home(place, context.estimate.yaw)
    return Decision(ACCEPTED, f"home set by {{sender}}: {where}", home=home)


def _start_mission(action: StartMission, context: Situation, modes: Modes) -> Decision:
    """Start the mission; this arms a disarmed vehicle, as in PX4."""
    first, total = action.first, context.mission.flight.progress.total
    if 0.0 < action.last < total - 1:
        return Decision(DENIED, "no mission: it can only be flown to its last step")
    decision = _switch(Mode.MISSION, context, modes)
    if decision.result == ACCEPTED and context.mode is Mode.DISARMED:
        armed = _arm(Arm(), context, modes)
        decision = replace(armed, intended_mode=Mode.MISSION) if armed.arm else armed
    if decision.result != ACCEPTED or not first > 0.0:
        return decision
    if not first < total:
        return Decision(DENIED, _no_step(first, total))
    return replace(decision, mission_step=int(first))


def _set_mission_step(action: SetMissionStep, context: Situation, modes: Modes) -> Decision:
    number, progress = action.number, context.mission.flight.progress
    if number == -1.0:
        number = 0.0 if action.reset else float(progress.current)
    if not 0.0 <= number < progress.total:
        return Decision(DENIED, _no_step(number, progress.total))
    return Decision(ACCEPTED, mission_step=int(number))


def _inject_failure(action: InjectFailure, context: Situation, modes: Modes) -> Decision:
    """The simulator answers; a vehicle without one never does."""
    if not context.limits.failure_injection:
        return Decision(DENIED, "no failure injected: SYS_FAILURE_EN is 0; set it to 1 to allow it")
    return Decision(CommandResult.IN_PROGRESS)


def _grip(action: Grip, context: Situation, modes: Modes) -> Decision:
    if context.config.is_above_px4:
        return Decision(DENIED, GRIPPER_OF_PX4)
    return Decision(ACCEPTED, gripper=1.0 if action.closes else -1.0)


def _terminate(action: Order, context: Situation, modes: Modes) -> Decision:
    """Stop the rotors until the flight software is restarted."""
    if not context.mode.armed:
        return Decision(DENIED, "not terminated: the vehicle is not armed")
    if context.config.is_above_px4:
        return Decision(DENIED, "not terminated: the rotors are PX4's; terminate it there")
    reason = "flight terminated by {sender}: the rotors stop"
    return Decision(ACCEPTED, reason, alarming=True, mode=Mode.FAULT)


def _pause_mission(action: Order, context: Situation, modes: Modes) -> Decision:
    """Hold where the vehicle is."""
    if context.mode not in (Mode.MISSION, Mode.HOLD):
        return Decision(LATER, f"not paused: no mission is flown while {context.mode.value}")
    return _switch(Mode.HOLD, context, modes)


def _check_arming(action: Order, context: Situation, modes: Modes) -> Decision:
    if context.mode.armed:
        return Decision(LATER, "no checks: the vehicle is armed")
    refusal = arming.refusal(context)
    if refusal is not None and context.mode is Mode.FAULT:
        return Decision(DENIED, refusal)
    return Decision(ACCEPTED, refusal or "ready to arm")


def _restart(action: Order, context: Situation, modes: Modes) -> Decision:
    """Begin anew: what had failed is well again, says the operator."""
    if context.mode.armed:
        return Decision(DENIED, "not restarted: the vehicle is armed; disarm first")
    if context.known and not rests(context.state, context.estimate, context.limits.aiding_loss_us):
        return Decision(LATER, "not restarted: the vehicle must have been at rest for a second")
    if context.mode is Mode.FAULT:
        reason = f"{RESTARTED} by {{sender}}; the termination is over"
        return Decision(ACCEPTED, reason, alarming=True, restart=True)
    return Decision(ACCEPTED, RESTARTED, restart=True)


_Handler = Callable[[Any, Situation, Modes], Decision]
COMMAND_HANDLERS: Final[dict[type[CommandAction] | Order, _Handler]] = {
    Arm: _arm,
    Disarm: _disarm,
    SwitchMode: lambda action, context, modes: _switch(action.mode, context, modes),
    TakeOff: _take_off,
    GoTo: _go_to,
    FlyOrbit: _orbit,
    LookAt: _look_at,
    ChangeSpeed: _change_speed,
    MoveJoints: _move_joints,
    SetHome: _set_home,
    StartMission: _start_mission,
    SetMissionStep: _set_mission_step,
    InjectFailure: _inject_failure,
    Grip: _grip,
    Order.TERMINATE: _terminate,
    Order.PAUSE_MISSION: _pause_mission,
    Order.CONTINUE_MISSION: lambda _, context, modes: _switch(Mode.MISSION, context, modes),
    Order.CHECK_ARMING: _check_arming,
    Order.RESTART: _restart,
    Order.NOTHING: lambda _, context, modes: Decision(ACCEPTED),
    Rejected: _reject,
}
# The vehicle cannot be armed then, and so is not.
_NEED_NO_ESTIMATE: Final = (Arm, Disarm, InjectFailure, Rejected)
_ORDERS_WITHOUT: Final = frozenset(
    {Order.TERMINATE, Order.CHECK_ARMING, Order.RESTART, Order.NOTHING}
)


def _blocked(context: Situation) -> str:
    """Why nothing but Descend can be flown now; empty: other modes can be."""
    if not context.vehicle.flies or context.mode is not Mode.DESCEND:
        return ""
    reasons = [c.value for c in context.vehicle.conditions if c in BLOCKING]
    return f"{reasons[0]}; the vehicle descends" if reasons else ""


def _hovering_refusal(context: Situation) -> str | None:
    """Why the vehicle cannot accept a position goal now."""
    if not context.mode.armed:
        return "the vehicle is not armed"
    return "the vehicle is on the ground; take off first" if context.landed else None


def _height(place: Place, context: Situation) -> float | None:
    """Height above the origin [m], None if the command gives none."""
    if place.height is None or not place.above_home:
        return place.height
    home = context.vehicle.home
    return place.height - (home.p[2] if home is not None else 0.0)


def _place(place: Place, context: Situation) -> Vec3:
    """Position in the local frame [m]; coordinates that are not given stay as they are."""
    north, east = place.north_east or context.estimate.p_WB[:2]
    height = _height(place, context)
    return north, east, context.estimate.p_WB[2] if height is None else -height


def _out_of_bounds(place: Vec3, context: Situation) -> str | None:
    """Why the body is not to be at a place, whatever the safe set."""
    far = place_problem(place)
    if far is not None:
        return far
    least, most = lowest_height(context.config), context.config.steering.highest
    if not -place[2] >= least:
        return f"{-place[2]:.1f} m above the origin is too low; the minimum is {least:.1f} m"
    if not -place[2] <= most:
        return f"{-place[2]:.1f} m above the origin is too high; the maximum is {most:g} m"
    return None


def _too_close(place: Vec3, context: Situation) -> str | None:
    body = context.config.body
    safe_set = context.mission.safe_set
    for number in range(len(safe_set.zones)):
        at = surface(safe_set, number, place, context.estimate.t_us)
        if at is not None and not at.distance > hull_reach(body, at.normal):
            return f"the place is too close to zone {number + 1} of the safe set, or beyond it"
    return None


def _circle_too_close(centre: Vec3, radius: float, context: Situation) -> str | None:
    about = context.mission.safe_set, context.config.body, context.estimate.t_us
    number = circle_too_close(centre, radius, *about)
    if number is None:
        return None
    return f"the circle comes too close to zone {number + 1} of the safe set"


def _no_step(number: float, total: int) -> str:
    return f"there is no mission step {number:g}; {total} were uploaded"
