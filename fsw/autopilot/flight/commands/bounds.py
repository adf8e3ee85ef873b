"""The one set of bounds of what others say, before anything believes it.

Zones, targets, setpoints, places of commands and steps of missions pass here, on the link where an
answer can name the reason and again in the tick, which believes no link: finite, within a kilometre
of the origin, clearances of at most ten metres, and no faster than the vehicle is told to expect.
Each function says what is wrong in a sentence; None where nothing is.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.shapes import BY_NAME
from fsw.autopilot.signals import (
    MAX_DISTANCE,
    EndEffectorTarget,
    MissionAction,
    MissionStep,
    MissionUpdate,
    MotionSetpoint,
    SafeSet,
    Touch,
    Vec3,
    Zone,
)

MAX_CLEARANCE: Final = 10.0  # m; what needs more is a larger shape
MAX_FORCE: Final = 200.0  # N, on a surface
MAX_STIFFNESS: Final = 1e6  # N/m, of one
MAX_SPEED: Final = 20.0  # m/s; faster is a slip of the unit
MAX_ACCELERATION: Final = 20.0  # m/s^2, the same
MAX_RATE: Final = 10.0  # rad/s
MAX_YAW: Final = 4.0 * math.pi  # rad
MAX_STAY: Final = 3600.0  # s, at a place of a mission, and ahead of now of a target
CIRCLE_RADII: Final = (0.5, 100.0)  # m
MAX_TURNS: Final = 100.0
MAX_REPEATS: Final = 1000  # of a jump
MOVES_NOTHING: Final = frozenset(
    {
        MissionAction.SPEED,
        MissionAction.LOOK_AT,
        MissionAction.JUMP,
        MissionAction.SKIP,
        MissionAction.GRIP,
        MissionAction.RELEASE,
    }
)
GRIPPER_OF_PX4: Final = "gripper not moved: above PX4 it is PX4's; ask PX4 for it"
_ROUNDED: Final = 1.0 + 2.0**-22  # of a bound: two last bits of float32, which links round to
_AT_REST: Final[Vec3] = (0.0, 0.0, 0.0)
_AXES: Final = ("north", "east", "down")
_WHAT: Final = ("position", "velocity", "acceleration")
_UNITS: Final = ("m", "m/s", "m/s^2")
_MOST: Final = (MAX_DISTANCE, MAX_SPEED, MAX_ACCELERATION)


def _within(size: float, most: float) -> bool:
    """Whether a number or the size of a vector is within a bound, both in one unit; NaN is not."""
    return abs(size) <= most * _ROUNDED


def safe_set_problem(safe_set: SafeSet, max_speed: float = math.inf) -> str | None:
    """Why a safe set is none that can be believed; its zones move at ``max_speed`` [m/s] at most.

    A link does not know that speed, and leaves it to the tick.
    """
    for number, zone in enumerate(safe_set.zones, start=1):
        problem = zone_problem(zone, max_speed)
        if problem is not None:
            return f"zone {number} ({zone.shape.kind}): {problem}"
    return None


def zone_problem(zone: Zone, max_speed: float = math.inf) -> str | None:
    """Why a zone is out of bounds; it moves at ``max_speed`` [m/s] at most.

    Whether its numbers describe such a shape is for the link to ask.
    """
    kind = BY_NAME.get(zone.shape.kind)
    if kind is None:
        return "there is no such shape"
    if len(zone.shape.numbers) != kind.size:
        return kind.check(zone.shape)
    for number, meaning, most in zip(zone.shape.numbers, kind.meaning, kind.farthest, strict=True):
        if not _within(number, most):
            return f"{meaning} is {number:g}; at most {most:g} is accepted"
    if not 0.0 <= zone.clearance <= MAX_CLEARANCE:
        return f"a clearance of {zone.clearance:g} m is outside 0 to {MAX_CLEARANCE:g} m"
    speed = math.hypot(*zone.velocity)
    if not _within(speed, min(max_speed, MAX_SPEED)):
        most = min(max_speed, MAX_SPEED)
        return f"it moves at {speed:g} m/s; at most {most:g} m/s is expected (SUR_V_ZONE)"
    against = None if zone.touch is None else touch_problem(zone, zone.touch)
    if against is not None:
        return against
    if kind.follows_target and (not zone.keep_in or zone.velocity != _AT_REST):
        return "what follows the target is to be kept in, and has no velocity of its own"
    return None


def touch_problem(zone: Zone, touch: Touch) -> str | None:
    """Why what is said of a surface that may be touched is out of range."""
    if zone.keep_in:
        return "what is to be kept in cannot be touched"
    low, high = touch.stiffness_low, touch.stiffness_high
    if not 0.0 < touch.force_max <= MAX_FORCE:
        return f"a force of {touch.force_max:g} N is outside 0 to {MAX_FORCE:g} N"
    if not 0.0 < low <= high <= MAX_STIFFNESS:
        return (
            f"a stiffness of {low:g} to {high:g} N/m is no range within 0 to {MAX_STIFFNESS:g} N/m"
        )
    if not (0.0 <= touch.dissipation <= 1000.0 and 0.0 <= touch.friction <= 10.0):
        return "dissipation must be 0 to 1000 s/m and friction 0 to 10"
    return None


def target_problem(target: EndEffectorTarget, now_us: int) -> str | None:
    """Why a target of a stream cannot be believed at a time."""
    if abs(target.t_us - now_us) > 1e6 * MAX_STAY:
        return f"its time is more than {MAX_STAY:g} s from now"
    return reference_problem(target)


def reference_problem(target: EndEffectorTarget) -> str | None:
    """Why a target is out of range; none of its axes may be open."""
    if not 0.0 <= target.force <= MAX_FORCE:
        return f"a force of {target.force:g} N is outside 0 to {MAX_FORCE:g} N"
    p, v, a, yaw = target.p_WE, target.v_WE, target.a_WE, target.yaw
    if not all(map(math.isfinite, (*p, *v, *a, yaw))):
        return "a number is not finite"
    return motion_refusal(MotionSetpoint(True, p, v, a, yaw))


def motion_refusal(setpoint: MotionSetpoint) -> str | None:
    """Why a motion setpoint is out of range, or has vectors that all leave one axis open."""
    vectors = setpoint.p, setpoint.v, setpoint.a
    for vector, most, what, unit in zip(vectors, _MOST, _WHAT, _UNITS, strict=True):
        if vector is None:
            continue
        size = math.hypot(*[0.0 if math.isnan(x) else x for x in vector])
        if not _within(size, most):
            return f"{what} out of range: {size:g} {unit}, at most {most:g} {unit}"
    given = [vector for vector in vectors if vector is not None]
    for axis, name in enumerate(_AXES):
        if given and all(math.isnan(vector[axis]) for vector in given):
            return f"{name} has no position, velocity or acceleration"
    if setpoint.yaw is not None and not _within(setpoint.yaw, MAX_YAW):
        return f"yaw out of range: {setpoint.yaw:g} rad, at most {MAX_YAW:.2f} rad"
    if setpoint.yaw_rate is not None and not _within(setpoint.yaw_rate, MAX_RATE):
        return f"yaw rate out of range: {setpoint.yaw_rate:g} rad/s, at most {MAX_RATE:g} rad/s"
    return None


def place_problem(place: Vec3) -> str | None:
    """Why a ``place`` [m, NED] is none to fly to, or to look at."""
    if _within(math.hypot(*place), MAX_DISTANCE):
        return None
    return f"the place is more than {MAX_DISTANCE:g} m from the origin"


def upload_problem(update: MissionUpdate) -> str | None:
    """Why an upload is refused, whole, whatever the vehicle does."""
    wrong = mission_problem(update.steps or ())
    if wrong is not None:
        return f"mission refused: item {wrong[0]}: {wrong[1]}"
    if not all(_within(math.hypot(*place), MAX_DISTANCE) for place in update.rally or ()):
        return f"rally points refused: one is more than {MAX_DISTANCE:g} m away"
    return None


def mission_problem(steps: tuple[MissionStep, ...]) -> tuple[int, str] | None:
    """The first step of a mission that cannot be flown, and why."""
    for number, step in enumerate(steps):
        problem = step_problem(step)
        if problem is None and step.action is MissionAction.JUMP:
            problem = _jump_problem(steps, number)
        if problem is not None:
            return number, problem
    return None


def _jump_problem(steps: tuple[MissionStep, ...], number: int) -> str | None:
    """Why a jump cannot be taken: it leads nowhere, or back to itself before anything is flown."""
    if not 0 <= steps[number].target < len(steps):
        return f"a jump to item {steps[number].target} of 0 to {len(steps) - 1}"
    seen, at = set[int](), number
    while at < len(steps) and steps[at].action in MOVES_NOTHING:
        if at in seen:
            return "a jump without end past nothing that is flown"
        seen.add(at)
        endless = steps[at].action is MissionAction.JUMP and steps[at].repeats < 0
        at = steps[at].target if endless else at + 1
    return None


def step_problem(step: MissionStep) -> str | None:
    """Why a step of a mission is out of range; a stay without end is infinite."""
    if step.position is not None and not all(_within(x, MAX_DISTANCE) for x in step.position):
        return f"the place is more than {MAX_DISTANCE:g} m from the origin"
    if step.yaw is not None and not _within(step.yaw, MAX_YAW):
        return "yaw out of range"
    if step.speed is not None and not 0.0 < step.speed <= MAX_SPEED:
        return f"a speed of {step.speed:g} m/s is outside 0 to {MAX_SPEED:g} m/s"
    stays = step.hold_s == math.inf and step.action is MissionAction.GO
    if not (stays or 0.0 <= step.hold_s <= MAX_STAY):
        return f"a stay of {step.hold_s:g} s is outside 0 to {MAX_STAY:g} s"
    if not (0.0 <= step.force <= MAX_FORCE and 0.0 <= step.press_s <= MAX_STAY):
        most = f"{MAX_FORCE:g} N, {MAX_STAY:g} s"
        return f"a push of {step.force:g} N for {step.press_s:g} s is outside 0 to {most}"
    if step.action is MissionAction.CIRCLE:
        return circle_problem(step.radius, step.turns)
    if step.action is MissionAction.JUMP and not -1 <= step.repeats <= MAX_REPEATS:
        return f"{step.repeats} jumps are outside 0 to {MAX_REPEATS}, or -1 without end"
    return None if step.acceptance >= 0.0 else "the acceptance is less than 0"


def circle_problem(radius: float, turns: float) -> str | None:
    """Why ``turns`` [1] of a ``radius`` [m], negative anticlockwise, cannot be flown."""
    least, most = CIRCLE_RADII
    if not least <= abs(radius) <= most:
        return f"a radius of {abs(radius):g} m is outside {least:g} to {most:g} m"
    if not 0.0 < turns <= MAX_TURNS:
        return f"{turns:g} turns are outside 0 to {MAX_TURNS:g}"
    return None
