"""A mission in flight: which step, which segment, and what follows; pure.

Each step that names a place is one segment from rest to rest (``trajectory_segment.py``), a stay
there, and the next step. A circle begins with the straight one to its nearest point, a push with
the one to its stand-off. A step is reached where the end-effector really is within its acceptance.
A place that the vehicle cannot get to, beyond a wall say, is given up after a while, with a text
and without being called reached.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from enum import Enum
from typing import Final

from fsw.autopilot.flight.commands.bounds import MOVES_NOTHING
from fsw.autopilot.flight.mission.trajectory_segment import (
    TOO_NEAR_TO_LOOK,
    CircleSegment,
    MotionLimits,
    PushSegment,
    Segment,
    braking_segment,
    circle_from,
    push_from,
    segment_to,
)
from fsw.autopilot.flight.setpoints.reference_governor import project_to_safe_set
from fsw.autopilot.flight.setpoints.target_check import Meeting
from fsw.autopilot.geometry.vectors import add_scaled
from fsw.autopilot.signals import (
    MAX_MISSION_SPEED,
    EndEffectorTarget,
    Home,
    MissionAction,
    MissionProgress,
    MissionState,
    MissionStep,
    Mode,
    SafeSet,
    Vec2,
    Vec3,
)

APPROACH_DISTANCE = 0.1  # m from a surface that is to be pressed on, before and after
_SIDEWAYS = 0.3  # of a normal, that is horizontal, from which on the nose turns to the surface
ARRIVAL_TIMEOUT_US = 5_000_000  # at the end of a segment, for the end-effector to arrive
_SPEED: Final = MissionAction.SPEED
_GRIPPER: Final = {MissionAction.GRIP: 1.0, MissionAction.RELEASE: -1.0}


class Stage(Enum):
    """What the vehicle does about its current step."""

    IDLE = "idle"  # the mission is not being flown
    BEGIN = "begin"
    BRAKE = "brake"  # before it begins with another step
    MOVE = "move"
    ARRIVE = "arrive"
    STAY = "stay"
    GONE = "gone"  # handed over to Land or Return


@dataclass(frozen=True, slots=True)
class MissionFlight:
    """What the vehicle remembers of its mission."""

    steps: tuple[MissionStep, ...] = ()
    stage: Stage = Stage.IDLE
    segment: Segment | None = None
    # m, where the step is to be reached; the segment may stop before a wall
    place: Vec3 | None = None
    since_us: int = 0  # when the stage began
    speed: float | None = None  # m/s, as the mission says
    jumps: tuple[int, ...] = ()  # the steps whose jump was taken, once for each time
    progress: MissionProgress = field(default_factory=MissionProgress)


@dataclass(frozen=True, slots=True)
class MissionContext:
    """The vehicle's state as a mission needs it."""

    now_us: int
    p_WE: Vec3  # m, estimate
    height: float  # m, base above the origin
    home_z: float  # m, NED, of home
    # Where the tool meets the surface at a place [m, NED], to press with a force [N].
    meet: Callable[[Vec3, float], Meeting]
    limits: MotionLimits  # of a segment where the mission names no speed
    safe_set: SafeSet = field(default_factory=SafeSet)
    look_at: Vec3 | None = None  # m, where the nose is to point


@dataclass(frozen=True, slots=True)
class MissionEvent:
    """Result of a mission tick."""

    next_mode: Mode | None = None
    cause: str = ""  # of that change
    text: str = ""
    unmet: bool = False  # the text is a warning
    looks: bool = False  # the nose points elsewhere from now on
    look_at: Vec3 | None = None  # m, there; None: along the flight
    gripper: float | None = None  # 1 closes, -1 opens


NOTHING = MissionEvent()
Advanced = tuple[MissionFlight, MissionEvent]


def loaded(steps: tuple[MissionStep, ...], count: int = 0) -> MissionFlight:
    """A mission that was received, not begun; ``count`` steps were reached in earlier missions."""
    state = MissionState.NOT_STARTED if steps else MissionState.NO_MISSION
    progress = MissionProgress(state, total=len(steps), reached_count=count)
    return MissionFlight(steps, progress=progress)


def refusal(flight: MissionFlight, landed: bool) -> str | None:
    """Why this mission cannot start or continue now."""
    if not flight.steps:
        return "no mission: none was uploaded"
    first = flight.progress
    at = 0 if first.state is MissionState.COMPLETE else first.current
    moves = [step for step in flight.steps[at:] if step.action not in MOVES_NOTHING]
    if landed and (not moves or moves[0].action is not MissionAction.TAKE_OFF):
        return f"no mission: on the ground, and step {at} is not a takeoff; take off first"
    return None


def nearest(home: Home, rally: tuple[Vec2, ...], p: Vec3) -> Home:
    """The nearest to p [m, NED] of home and the rally points; all have home's height."""
    x, y, z = home.p
    places = ((x, y), *rally)
    x, y = min(places, key=lambda place: math.dist(place, p[:2]))
    return Home((x, y, z), home.yaw)


def begun(
    flight: MissionFlight, reference: EndEffectorTarget, limits: MotionLimits
) -> MissionFlight:
    """Begin, or go on with the current step, from a reference; brake first if it moves."""
    progress = flight.progress
    if progress.state is MissionState.COMPLETE:
        progress = replace(progress, current=0, reached=-1)
        flight = replace(flight, jumps=())
    return _braked(flight, replace(progress, state=MissionState.ACTIVE), reference, limits)


def _braked(
    flight: MissionFlight,
    progress: MissionProgress,
    reference: EndEffectorTarget,
    limits: MotionLimits,
) -> MissionFlight:
    """Brake from a reference, before the current step of the new progress begins."""
    speeds = [one.speed for one in flight.steps[: progress.current] if one.action is _SPEED]
    return replace(
        flight,
        stage=Stage.BRAKE,
        segment=braking_segment(reference, limits),
        since_us=reference.t_us,
        speed=speeds[-1] if speeds else None,
        progress=progress,
    )


def paused(flight: MissionFlight) -> MissionFlight:
    """Pause the mission: its current step will start again."""
    progress = flight.progress
    if progress.state is MissionState.ACTIVE:
        progress = replace(progress, state=MissionState.PAUSED)
    return replace(flight, stage=Stage.IDLE, segment=None, progress=progress)


def jumped(flight: MissionFlight, step: int, now_us: int, limits: MotionLimits) -> MissionFlight:
    """Make another step the current one; in flight, brake first."""
    state = flight.progress.state
    if state is MissionState.COMPLETE:
        state = MissionState.NOT_STARTED
    progress = replace(flight.progress, current=step, state=state)
    flight = replace(flight, jumps=())
    if flight.segment is None:
        return replace(flight, progress=progress)
    return _braked(flight, progress, flight.segment.at(now_us), limits)


def advance(flight: MissionFlight, context: MissionContext) -> Advanced:
    """One tick of a mission that has begun: at most one thing happens, and mostly none."""
    segment, now_us = flight.segment, context.now_us
    if segment is None:
        return flight, NOTHING
    if flight.stage is Stage.BEGIN:
        return _begin(flight, segment.at(now_us), context)
    if now_us < segment.end_us:
        return flight, NOTHING
    if flight.stage is Stage.BRAKE:
        return replace(flight, stage=Stage.BEGIN), NOTHING
    if flight.stage is Stage.MOVE:
        return replace(flight, stage=Stage.ARRIVE, since_us=now_us), NOTHING
    step = flight.steps[flight.progress.current]
    if flight.stage is Stage.ARRIVE:
        return _arrive(flight, step, context)
    if flight.stage is Stage.STAY and now_us - flight.since_us >= 1e6 * step.hold_s:
        return _hand_over(flight, step)
    return flight, NOTHING


def touched_down(flight: MissionFlight) -> MissionFlight:
    """Complete a mission whose last step was a landing."""
    if flight.stage is not Stage.GONE:
        return flight
    return replace(_reached(flight), stage=Stage.IDLE, segment=None)


def _begin(flight: MissionFlight, at: EndEffectorTarget, context: MissionContext) -> Advanced:
    number = flight.progress.current
    step = flight.steps[number]
    if step.action is MissionAction.JUMP:
        return _jump(flight, step)
    if step.action in MOVES_NOTHING:
        return _set(flight, number, step)
    place, towards, look_at = _destination(step, at, context), step.yaw, context.look_at
    if step.action is MissionAction.PUSH:
        met = context.meet(place, step.force)
        if met.against:
            return _given_up(flight, f"mission step {number} not flown: {met.against}")
        place, look_at = add_scaled(met.place, met.normal, APPROACH_DISTANCE), None
        if towards is None and math.hypot(*met.normal[:2]) > _SIDEWAYS:
            towards = math.atan2(-met.normal[1], -met.normal[0])
    end = project_to_safe_set(place, context.safe_set, context.now_us)
    segment = segment_to(at, end, _heading(towards, end, look_at), _paced(flight, context))
    text = f"mission step {number}: {step.action.value}"
    moving = replace(
        flight, stage=Stage.MOVE, segment=segment, place=place, since_us=context.now_us
    )
    return moving, MissionEvent(text=text)


def _set(flight: MissionFlight, number: int, step: MissionStep) -> Advanced:
    """Do a step that moves nothing, and begin the next one."""
    if step.action is _SPEED:
        flight = replace(flight, speed=step.speed)
    following, event = _next(_reached(flight))
    if step.action is MissionAction.LOOK_AT:
        event = replace(event, looks=True, look_at=step.position)
    if step.action in _GRIPPER:
        event = replace(event, gripper=_GRIPPER[step.action])
        return following, _said(f"mission step {number}: {step.action.value}", event)
    if step.speed is not None and step.speed > MAX_MISSION_SPEED:
        text = f"mission step {number}: {step.speed:g} m/s is flown as {MAX_MISSION_SPEED:g} m/s"
        return following, _said(text, event)
    return following, event


def _said(text: str, event: MissionEvent) -> MissionEvent:
    """An event before whose text another one is said."""
    return replace(event, text="; ".join(filter(None, (text, event.text))))


def _paced(flight: MissionFlight, context: MissionContext) -> MotionLimits:
    """The limits with the speed that the mission asked for."""
    if flight.speed is None:
        return context.limits
    return replace(context.limits, speed=min(flight.speed, MAX_MISSION_SPEED))


def _jump(flight: MissionFlight, step: MissionStep) -> Advanced:
    """Go on with another step, until that was done as often as the mission says."""
    number = flight.progress.current
    taken = flight.jumps.count(number)
    if 0 <= step.repeats <= taken:
        return _next(_reached(flight))
    if step.repeats > 0:
        flight = replace(flight, jumps=(*flight.jumps, number))
    following, event = _next(_reached(flight, over=False), step.target)
    count = f"{taken + 1} of {step.repeats}" if step.repeats > 0 else "without end"
    text = f"mission step {number}: jump to step {step.target}, {count}"
    return following, _said(text, event)


def _heading(yaw: float | None, end: Vec3, look_at: Vec3 | None) -> float | None:
    """The heading at the end of a segment [rad]: towards the place that is looked at, if any."""
    if look_at is None or math.dist(look_at[:2], end[:2]) < TOO_NEAR_TO_LOOK:
        return yaw
    return math.atan2(look_at[1] - end[1], look_at[0] - end[0])


def _destination(step: MissionStep, at: EndEffectorTarget, context: MissionContext) -> Vec3:
    if step.position is None:
        return at.p_WE
    x, y, z = step.position
    if step.above_home:
        z = min(z + context.home_z, 0.0)  # home may have been set below the ground
    if step.here:
        x, y = at.p_WE[:2]
    if step.action is MissionAction.LAND:
        return x, y, at.p_WE[2]  # the descent is the landing's
    if step.action is MissionAction.CIRCLE:
        dx, dy = at.p_WE[0] - x, at.p_WE[1] - y
        bearing = math.atan2(dy, dx)  # above the centre: north
        return x + abs(step.radius) * math.cos(bearing), y + abs(step.radius) * math.sin(bearing), z
    if step.action is MissionAction.TAKE_OFF:
        # The height is the base's, and a vehicle that is higher already does not come down.
        return at.p_WE[0], at.p_WE[1], at.p_WE[2] - max(-z - context.height, 0.0)
    return x, y, z


def _arrive(flight: MissionFlight, step: MissionStep, context: MissionContext) -> Advanced:
    place = flight.place
    off = 0.0 if step.position is None or place is None else math.dist(context.p_WE, place)
    if off <= step.acceptance:
        if step.action is MissionAction.CIRCLE and not isinstance(flight.segment, CircleSegment):
            return _circle(flight, step, context), NOTHING
        if step.action is MissionAction.PUSH and not isinstance(flight.segment, PushSegment):
            return _push(flight, step, context)
        return replace(flight, stage=Stage.STAY, since_us=context.now_us), NOTHING
    if context.now_us - flight.since_us < ARRIVAL_TIMEOUT_US:
        return flight, NOTHING
    text = f"mission step {flight.progress.current} not reached: {off:.2f} m away"
    return _given_up(flight, text)


def _given_up(flight: MissionFlight, text: str) -> Advanced:
    """Go on with the next step, and say why the current one was not done."""
    following, event = _next(flight)
    return following, replace(event, text=text, unmet=True)


def _push(flight: MissionFlight, step: MissionStep, context: MissionContext) -> Advanced:
    """From the stand-off to the surface, where it is by now, a force on it, and back."""
    assert flight.segment is not None
    at = flight.segment.at(context.now_us)
    met = context.meet(at.p_WE, step.force)
    if met.against:
        return _given_up(flight, f"mission step {flight.progress.current} not flown: {met.against}")
    push = push_from(at, met.place, step.force, step.press_s, _paced(flight, context))
    return replace(flight, stage=Stage.MOVE, segment=push, since_us=context.now_us), NOTHING


def _circle(flight: MissionFlight, step: MissionStep, context: MissionContext) -> MissionFlight:
    """The circle itself, from the end of the way to it."""
    assert flight.segment is not None
    assert step.position is not None
    at = flight.segment.at(context.now_us)
    x, y, _ = step.position
    if step.here:  # the way led straight from the centre to the north
        x, y = at.p_WE[0] - abs(step.radius), at.p_WE[1]
    centre = (x, y, at.p_WE[2])
    circle = circle_from(
        at, centre, step.radius, step.turns, context.look_at, _paced(flight, context)
    )
    end = circle.at(circle.end_us).p_WE
    return replace(flight, stage=Stage.MOVE, segment=circle, place=end, since_us=context.now_us)


def _hand_over(flight: MissionFlight, step: MissionStep) -> Advanced:
    """Complete the step: continue with the next one or switch to its mode."""
    if step.action is MissionAction.LAND:
        return replace(flight, stage=Stage.GONE), MissionEvent(Mode.LAND, "land")
    if step.action is MissionAction.RETURN:
        return replace(_reached(flight), stage=Stage.GONE), MissionEvent(Mode.RETURN, "return")
    return _next(_reached(flight))


def _reached(flight: MissionFlight, *, over: bool = True) -> MissionFlight:
    """The current step is done; with the last one the mission is, unless it is not ``over``."""
    now = flight.progress
    last = over and now.current == now.total - 1
    state = MissionState.COMPLETE if last else now.state
    progress = replace(now, state=state, reached=now.current, reached_count=now.reached_count + 1)
    return replace(flight, progress=progress)


def _next(flight: MissionFlight, following: int | None = None) -> Advanced:
    """Go on with the step that follows, by default the next one."""
    now = flight.progress
    following = now.current + 1 if following is None else following
    if following == now.total:
        done = replace(flight, progress=replace(now, state=MissionState.COMPLETE))
        return done, MissionEvent(Mode.HOLD, "mission done", "mission complete")
    stops = flight.steps[now.current].stop_after
    begins = replace(flight, stage=Stage.BEGIN, progress=replace(now, current=following))
    if stops:
        return begins, MissionEvent(Mode.HOLD, "hold", f"mission holds before step {following}")
    return begins, NOTHING
