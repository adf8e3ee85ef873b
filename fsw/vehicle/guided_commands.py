"""What a ground station asks of a vehicle that it guides: orbit, look at a place, speed."""

from __future__ import annotations

import math
from dataclasses import replace

from fsw.signals import CommandRequest, Facing, Mode, Orbit, SafeSet, Vec3
from fsw.vehicle.mode_commands import arming_refusal, change
from fsw.vehicle.modes import Event
from fsw.vehicle.orbit import fastest
from fsw.vehicle.place_commands import hovering_refusal, too_low
from fsw.vehicle.places import Refused, place_of
from fsw.vehicle.situation import (
    ACCEPTED,
    DENIED,
    TEMPORARILY_REJECTED,
    Decision,
    LookAt,
    Situation,
    Speed,
)

_RADII = (0.5, 100.0)  # m
_USUAL_RADIUS = 2.0  # m
_SLOWEST = 0.01  # m/s
_UNCHANGED = 5.0  # ORBIT_YAW_BEHAVIOUR: what an earlier orbit said, here the usual
_FACINGS = {float(facing): facing for facing in Facing} | {_UNCHANGED: Facing.CENTRE}
_GROUND_SPEEDS = (0.0, 1.0)  # SPEED_TYPE of air and ground, which are one here
_KEEP, _USUAL = -1.0, -2.0  # speeds of DO_CHANGE_SPEED that are none
_ROI_NONE, _ROI_LOCATION = 0.0, 3.0  # MAV_ROI


def orbit(request: CommandRequest, situation: Situation) -> Decision:
    """DO_ORBIT: param1 radius, negative anticlockwise, param2 speed, param3 heading, 5 to 7 centre.

    NaN leaves a parameter to the vehicle: the centre is then where it is.
    """
    refusal = hovering_refusal(situation)
    if refusal is not None:
        return Decision(TEMPORARILY_REJECTED, reason=f"no orbit: {refusal}")
    radius, speed, behaviour, turns = request.params[:4]
    clockwise = not radius < 0.0
    radius = _USUAL_RADIUS if math.isnan(radius) else abs(radius)
    if not _RADII[0] <= radius <= _RADII[1]:
        reason = f"a radius of {radius:g} m is outside {_RADII[0]:g} to {_RADII[1]:g} m"
        return Decision(DENIED, reason=f"no orbit: {reason}")
    facing = Facing.CENTRE if math.isnan(behaviour) else _FACINGS.get(behaviour)
    if facing is None:
        reason = f"heading {behaviour:g} is not one of 0 centre, 1 as it is, 3 tangent"
        return Decision(DENIED, reason=f"no orbit: {reason}")
    if math.isfinite(turns) and turns > 0.0:
        return Decision(DENIED, reason="no orbit: turns are not counted; param4 must be 0 or NaN")
    centre = place_of(request, situation.origin, situation.home, situation.position)
    if isinstance(centre, Refused):
        return Decision(DENIED, reason=f"no orbit: {centre.reason}")
    blocked = too_low(centre, situation) or _blocked(centre, radius, situation.safe_set)
    if blocked is not None:
        return Decision(DENIED, reason=f"no orbit: {blocked}")
    most = min(fastest(radius, situation.turn_rate, situation.acceleration), situation.speed_most)
    asked = min(situation.speed, most) if math.isnan(speed) else abs(speed)
    if asked < _SLOWEST:
        return Decision(DENIED, reason=f"no orbit: {speed:g} m/s is no speed")
    flown = min(asked, most)
    slower = f"orbit at {flown:.2f} m/s: faster cannot be flown at {radius:g} m"
    decision = change(Event.CIRCLE, situation)
    if decision.result != ACCEPTED:
        return decision
    return replace(
        decision,
        orbit=Orbit(centre, radius, flown, clockwise, facing),
        reason=slower if asked > most else "",
    )


def _blocked(centre: Vec3, radius: float, safe_set: SafeSet) -> str | None:
    """Why the body cannot fly a circle."""
    for number, wall in enumerate(safe_set.walls, start=1):
        n = wall.normal
        nearest = sum(a * b for a, b in zip(n, centre, strict=True)) - radius * math.hypot(
            n[0], n[1]
        )
        if not nearest - wall.offset > wall.clearance:
            return f"the circle comes too close to the fence or a wall (wall {number})"
    for number, obstacle in enumerate(safe_set.obstacles, start=1):
        o = obstacle.position
        across = math.dist(centre[:2], o[:2]) - radius
        up = 0.0 if obstacle.upright else centre[2] - o[2]
        if not math.hypot(across, up) > obstacle.clearance:
            return f"the circle comes too close to a fence or an obstacle (obstacle {number})"
    return None


def look_at(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_ROI_LOCATION: the nose, and so the arm's plane, turns to a place and follows it.

    The height does not matter: the arm hangs below the body. A ground station that clicked on a
    map sends NaN for it.
    """
    params = request.params
    if any(math.isnan(value) for value in params[4:6]):
        return Decision(DENIED, reason="nothing to look at: latitude and longitude are needed")
    if not math.isfinite(params[6]):
        request = replace(request, params=(*params[:6], math.nan))
    place = place_of(request, situation.origin, situation.home, situation.position)
    if isinstance(place, Refused):
        return Decision(DENIED, reason=f"nothing to look at: {place.reason}")
    return _while_armed(LookAt(place), situation)


def look_away(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_ROI_NONE: the heading is the flight's again."""
    return Decision(ACCEPTED, look_at=LookAt(None))


def look(request: CommandRequest, situation: Situation) -> Decision:
    """DO_SET_ROI, the older form: param1 says whether there is a place at all."""
    kind = request.params[0]
    if kind == _ROI_NONE:
        return look_away(request, situation)
    if kind == _ROI_LOCATION:
        return look_at(request, situation)
    return Decision(DENIED, reason=f"kind {kind:g} of a region of interest is not 0 or 3")


def _while_armed(wanted: LookAt, situation: Situation) -> Decision:
    if situation.mode in (Mode.DISARMED, Mode.FAULT):
        return Decision(TEMPORARILY_REJECTED, reason="nothing to look at: the vehicle is not armed")
    return Decision(ACCEPTED, look_at=wanted)


def change_speed(request: CommandRequest, situation: Situation) -> Decision:
    """DO_CHANGE_SPEED: of the ways to places that follow, until the vehicle is disarmed.

    A mission flies with it from its next leg on.
    """
    kind, speed = request.params[:2]
    if kind not in _GROUND_SPEEDS:
        reason = f"speed type {kind:g} is neither air speed (0) nor ground speed (1)"
        return Decision(DENIED, reason=f"speed unchanged: {reason}")
    if speed == _KEEP:
        return Decision(ACCEPTED)
    if speed == _USUAL:
        return Decision(ACCEPTED, speed=Speed(None))
    if not _SLOWEST <= speed <= situation.speed_most:
        reason = f"{speed:g} m/s is outside {_SLOWEST:g} to {situation.speed_most:g} m/s"
        return Decision(DENIED, reason=f"speed unchanged: {reason}")
    return Decision(ACCEPTED, speed=Speed(speed))


def no_actuator_test(request: CommandRequest, situation: Situation) -> Decision:
    """ACTUATOR_TEST and DO_MOTOR_TEST: rotors turn under the loops, or not at all."""
    reason = "no actuator test: rotors and joints move only in closed loop; arm and fly instead"
    return Decision(DENIED, reason=reason)


def no_calibration(request: CommandRequest, situation: Situation) -> Decision:
    """PREFLIGHT_CALIBRATION; all zeros breaks one off, which is so already."""
    if all(value == 0.0 or math.isnan(value) for value in request.params):
        return Decision(ACCEPTED)
    # The prefix is how PX4 tells a ground station's calibration page.
    return Decision(DENIED, reason="[cal] calibration failed: these sensors need none")


def check_arming(request: CommandRequest, situation: Situation) -> Decision:
    """RUN_PREARM_CHECKS: says what stands against arming."""
    if situation.mode not in (Mode.DISARMED, Mode.FAULT):
        return Decision(TEMPORARILY_REJECTED, reason="no checks: the vehicle is armed")
    return Decision(ACCEPTED, reason=arming_refusal(situation) or "ready to arm")
