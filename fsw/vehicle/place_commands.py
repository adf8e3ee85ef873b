"""Commands that name a place or the joints: goto, home, actuators."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.barriers.tangent import distance_to
from fsw.model.airframe import AIRFRAME, Airframe
from fsw.signals import CommandRequest, Home, Mode, Vec2, Vec3
from fsw.vehicle.mode_commands import change
from fsw.vehicle.modes import Event
from fsw.vehicle.places import Refused, place_of
from fsw.vehicle.situation import (
    ACCEPTED,
    DENIED,
    TEMPORARILY_REJECTED,
    Decision,
    Goto,
    Situation,
)

_CHANGE_MODE = 1  # MAV_DO_REPOSITION_FLAGS
# DO_SET_ACTUATOR's -1 to 1: joint 1 to its limit, joint 2 to a right angle.
_ACTUATOR_RANGE: Vec2 = (AIRFRAME.joint1_limit, AIRFRAME.joint12_limit)


def reposition(request: CommandRequest, situation: Situation) -> Decision:
    """DO_REPOSITION: hold at another place, height or heading."""
    refusal = hovering_refusal(situation)
    if refusal is not None:
        return Decision(TEMPORARILY_REJECTED, reason=f"no goto: {refusal}")
    speed, flags, _, yaw = request.params[:4]
    asked = math.isfinite(flags) and int(flags) & _CHANGE_MODE
    if situation.mode is not Mode.HOLD and not asked:
        return Decision(
            TEMPORARILY_REJECTED,
            reason="no goto: not in hold, and the command does not ask to change the mode",
        )
    place = place_of(request, situation.origin, situation.home, situation.position)
    if isinstance(place, Refused):
        return Decision(DENIED, reason=f"no goto: {place.reason}")
    blocked = _blocked(place, situation)
    if blocked is not None:
        return Decision(DENIED, reason=f"no goto: {blocked}")
    goto = Goto(
        place,
        yaw if math.isfinite(yaw) else None,
        speed if math.isfinite(speed) and speed > 0.0 else None,
    )
    decision = change(Event.HOLD, situation)
    return replace(decision, goto=goto) if decision.result == ACCEPTED else decision


def hovering_refusal(situation: Situation) -> str | None:
    """Why a vehicle cannot be sent anywhere now."""
    if situation.mode in (Mode.DISARMED, Mode.FAULT):
        return "the vehicle is not armed"
    return "the vehicle is on the ground; take off first" if situation.landed else None


def _blocked(place: Vec3, situation: Situation) -> str | None:
    """Why the body cannot be at a place."""
    low = too_low(place, situation)
    if low is not None:
        return low
    for number, wall in enumerate(situation.safe_set.walls, start=1):
        distance = sum(n * x for n, x in zip(wall.normal, place, strict=True)) - wall.offset
        if not distance > wall.clearance:
            return f"the place is too close to the fence or a wall, or beyond it (wall {number})"
    for number, obstacle in enumerate(situation.safe_set.obstacles, start=1):
        if not distance_to(obstacle, place) > obstacle.clearance:
            return f"the place is too close to a fence or an obstacle, or in it (obstacle {number})"
    return None


def too_low(place: Vec3, situation: Situation) -> str | None:
    """Why the body cannot be at a height."""
    least = situation.airframe.leg_length + situation.climb_range[0]
    if -place[2] >= least:
        return None
    return f"{-place[2]:.1f} m above the origin is too low, {least:.1f} m is the least"


def set_actuator(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_ACTUATOR: 1 and 2 of index 0 are the joints; NaN leaves one as it is."""
    first, second, *others, index = request.params
    if math.isfinite(index) and index != 0.0:
        return Decision(DENIED, reason="no such actuators: the joints are 1 and 2 of index 0")
    if any(math.isfinite(value) for value in others):
        return Decision(DENIED, reason="no such actuator: only the joints, 1 and 2, can be set")
    refusal = hovering_refusal(situation)
    if refusal is None and situation.mode is not Mode.HOLD:
        refusal = f"the arm is not free while {situation.mode.value}; hold first"
    if refusal is not None:
        return Decision(TEMPORARILY_REJECTED, reason=f"joints not moved: {refusal}")
    asked = [first, second]
    if any(math.isinf(value) or abs(value) > 1.0 for value in asked):
        return Decision(DENIED, reason="joints not moved: an actuator's range is -1 to 1")
    q1, q2 = (
        joint if math.isnan(value) else value * whole
        for value, whole, joint in zip(asked, _ACTUATOR_RANGE, situation.joints, strict=True)
    )
    refusal = joints_refusal((q1, q2), situation.airframe)
    if refusal is not None:
        return Decision(DENIED, reason=f"joints not moved: {refusal}")
    return Decision(ACCEPTED, joints=(q1, q2))


def joints_refusal(q_arm: Vec2, airframe: Airframe) -> str | None:
    """Why the arm cannot have these angles [rad]."""
    both = q_arm[0] + q_arm[1]
    if not abs(q_arm[0]) <= airframe.joint1_limit + 1e-6:
        return f"joint 1 at {math.degrees(q_arm[0]):.0f} deg is beyond its limit"
    if not abs(both) <= airframe.joint12_limit + 1e-6:
        return f"joints 1 and 2 together at {math.degrees(both):.0f} deg are beyond their limit"
    return None


def set_home(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_HOME, here or at a place."""
    if not situation.estimate_valid:
        return Decision(TEMPORARILY_REJECTED, reason="home not set: the estimate is invalid")
    if request.params[0] == 1.0:
        return Decision(ACCEPTED, home=Home(situation.position, situation.yaw))
    if any(math.isnan(value) for value in request.params[4:7]):
        return Decision(DENIED, reason="home not set: latitude, longitude and altitude are needed")
    place = place_of(request, situation.origin, situation.home, situation.position)
    if isinstance(place, Refused):
        return Decision(DENIED, reason=f"home not set: {place.reason}")
    return Decision(ACCEPTED, home=Home(place, situation.yaw))
