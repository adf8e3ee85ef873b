"""The scenario's pilot: the messages to the vehicle at each step; pure.

It announces the safe set, keeps the trajectory two seconds ahead of the vehicle, and takes the
vehicle through its plan by commands that it repeats until they are acknowledged.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final

from messages import message_ids
from sitl.link.pilot_messages import (
    Announce,
    Heard,
    PilotMessage,
    SendCommand,
    SendTarget,
)
from sitl.scenario import Scenario
from sitl.simulation import START_US
from sitl.trajectory import TrajectoryPoint
from sitl.zones import Zone, zones_of

TARGET_INTERVAL_US: Final = 100_000  # 10 points a second; it need not be the planning period
TARGET_LEAD_US: Final = 2_000_000  # 1.5 s are promised; the rest covers a lost datagram
MESSAGES_PER_STEP: Final = 8  # keeps a datagram below 1400 bytes

_REPEAT_US: Final = 500_000
_ROUND_US: Final = 1_000_000  # the safe set is announced again: a datagram may be lost
_MOVING_ROUND_US: Final = 100_000  # and where a zone moves, ten times a second
_PATIENCE_US: Final = 10_000_000  # of asking for the same thing
_HOVER_SPEED_M_S: Final = 0.1
_CLIMB_M: Final = 0.4  # at least, before a hop counts as flying
_LANDED_M: Final = 0.05  # above where it took off
_HOVER_US: Final = 3_000_000
_NAN: Final = math.nan

# PX4's custom_mode: main mode in bits 16 to 23, sub mode from bit 24 on.
_MAIN_AUTO, _AUTO_EXTERNAL1 = 4, 11
_TRAJECTORY: Final = _MAIN_AUTO << 16 | _AUTO_EXTERNAL1 << 24
_NAMES: Final[dict[tuple[int, int], str]] = {
    (4, 3): "hold",
    (4, 4): "mission",
    (4, 5): "return",
    (4, 6): "land",
    (6, 0): "offboard",
}


class Phase(Enum):
    """Phase of the pilot's plan."""

    IDLE = "idle"  # plan none: a ground station flies
    ARM = "arm"
    FOLLOW = "start the trajectory"
    FOLLOWING = "watch the trajectory being flown"
    TAKE_OFF = "take off"
    HOVER = "hover"
    GRAB = "close the gripper"
    RELEASE = "open the gripper"
    LAND = "land"
    DISARM = "wait for the vehicle to disarm"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class FlightPlan:
    """The pilot's constants."""

    zones: tuple[Zone, ...]  # the safe set
    round_us: int  # between two announcements of it
    target_at: Callable[[int], TrajectoryPoint] | None  # by time stamp [us]; None: no targets
    yaw_at: Callable[[int], float]  # of the targets [rad], by time stamp [us]
    hop: bool
    takeoff_height_m: float
    first_phase: Phase
    gripper_us: tuple[tuple[int, Phase], ...] = ()  # when to close and to open it


@dataclass(frozen=True, slots=True)
class PilotState:
    """The pilot's state."""

    phase: Phase
    announced: int = 0  # zones announced in this round
    round_us: int = START_US  # begin of this round
    next_round_us: int = START_US  # of announcements
    next_target_us: int = START_US
    since_us: int = START_US  # start of the phase
    next_ask_us: int = START_US
    hovering_since_us: int | None = None
    gripped: int = 0  # commands to the gripper that were given
    start_height_m: float = 0.0
    last_text: str = ""
    refusal: str | None = None  # ends the run
    left: str | None = None  # another client took the vehicle off the trajectory

    @property
    def done(self) -> bool:
        """True once the plan is flown."""
        return self.phase is Phase.DONE


# The command of each phase that asks for something, and the phase that follows its acceptance.
_COMMANDS: Final[dict[Phase, tuple[int, Phase]]] = {
    Phase.ARM: (message_ids.CMD_ARM_DISARM, Phase.FOLLOW),
    Phase.FOLLOW: (message_ids.CMD_DO_SET_MODE, Phase.FOLLOWING),
    Phase.TAKE_OFF: (message_ids.CMD_TAKEOFF, Phase.HOVER),
    Phase.GRAB: (message_ids.CMD_DO_GRIPPER, Phase.FOLLOWING),
    Phase.RELEASE: (message_ids.CMD_DO_GRIPPER, Phase.FOLLOWING),
    Phase.LAND: (message_ids.CMD_LAND, Phase.DISARM),
}


def flight_plan(
    scenario: Scenario,
    target_at: Callable[[int], TrajectoryPoint],
    yaw_at: Callable[[int], float],
) -> FlightPlan:
    """The plan of a scenario; its reference and yaw [rad] are asked for by time stamp [us]."""
    zones, kind = zones_of(scenario), scenario.pilot.plan
    return FlightPlan(
        zones=zones,
        round_us=_MOVING_ROUND_US if any(zone.moves for zone in zones) else _ROUND_US,
        target_at=target_at if kind == "trajectory" else None,
        yaw_at=yaw_at,
        hop=kind == "hop",
        takeoff_height_m=scenario.pilot.takeoff_height_m,
        first_phase=Phase.IDLE if kind == "none" else Phase.ARM,
        gripper_us=tuple(
            (START_US + round(1e6 * at_s), phase)
            for at_s, phase in (
                (scenario.pilot.grab_s, Phase.GRAB),
                (scenario.pilot.release_s, Phase.RELEASE),
            )
            if math.isfinite(at_s)
        ),
    )


def attends(state: PilotState) -> bool:
    """Whether the pilot looks at the vehicle itself, and not only at what it says."""
    return state.phase is Phase.HOVER or state.phase is Phase.DISARM


def listen(plan: FlightPlan, state: PilotState, heard: Heard, t_us: int) -> PilotState:
    """Process the vehicle's answer to the step of ``t_us``."""
    if heard.texts:
        # What else the vehicle tells in the same step is not the reason of its refusal.
        refusals = [text for text in heard.texts if text.startswith("not armed: ")]
        state = replace(state, last_text=(refusals or heard.texts)[-1])
    for ack in heard.acks:
        wanted = _COMMANDS.get(state.phase)
        if wanted is not None and ack.command == wanted[0]:
            state = _acknowledged(plan, state, ack.result, heard, t_us)
    if state.phase is Phase.FOLLOWING and heard.custom_mode not in (None, _TRAJECTORY):
        return replace(state, phase=Phase.IDLE, left=_left(heard.custom_mode))
    if state.phase is Phase.HOVER:
        return _hover(state, heard, t_us)
    if state.phase is Phase.DISARM and not heard.armed and _stands(state, heard):
        return replace(state, phase=Phase.DONE)
    return state


def speak(
    plan: FlightPlan, state: PilotState, t_us: int
) -> tuple[PilotState, tuple[PilotMessage, ...]]:
    """Messages to send at the step of ``t_us``, at most MESSAGES_PER_STEP."""
    state = _grip_next(plan, state, t_us)
    target_due = plan.target_at is not None and state.next_target_us <= t_us + TARGET_LEAD_US
    command_due = state.phase in _COMMANDS and t_us >= state.next_ask_us
    if plan.zones and t_us >= state.next_round_us:
        state = replace(state, announced=0, round_us=t_us, next_round_us=t_us + plan.round_us)
    if not target_due and not command_due and state.announced == len(plan.zones):
        return state, ()
    messages = _announcements(plan, state)
    state = replace(state, announced=state.announced + len(messages))
    # The trajectory is asked for once its points are there.
    waits_for_targets = state.phase is Phase.FOLLOW and target_due
    if command_due and t_us - state.since_us >= _PATIENCE_US:
        wish = f"the vehicle did not acknowledge the command to {state.phase.value}"
        return replace(state, refusal=wish), tuple(messages)
    if command_due and not waits_for_targets and len(messages) < MESSAGES_PER_STEP:
        state = replace(state, next_ask_us=t_us + _REPEAT_US)
        messages.append(_command(plan, state.phase))
    if plan.target_at is None:
        return state, tuple(messages)
    next_us = state.next_target_us
    while next_us <= t_us + TARGET_LEAD_US and len(messages) < MESSAGES_PER_STEP:
        messages.append(SendTarget(next_us, plan.target_at(next_us), plan.yaw_at(next_us)))
        next_us += TARGET_INTERVAL_US
    return replace(state, next_target_us=next_us), tuple(messages)


def _grip_next(plan: FlightPlan, state: PilotState, t_us: int) -> PilotState:
    """The next command to the gripper, when its time has come on the trajectory."""
    if state.phase is not Phase.FOLLOWING or state.gripped == len(plan.gripper_us):
        return state
    at_us, phase = plan.gripper_us[state.gripped]
    if t_us < at_us:
        return state
    done = state.gripped + 1
    return replace(state, phase=phase, gripped=done, since_us=t_us, next_ask_us=t_us)


def _announcements(plan: FlightPlan, state: PilotState) -> list[PilotMessage]:
    """The next zones of this round, all as they are when it begins."""
    time_s, first = 1e-6 * (state.round_us - START_US), state.announced
    messages: list[PilotMessage] = []
    for index, zone in enumerate(plan.zones[first : first + MESSAGES_PER_STEP], start=first):
        place = zone.at(time_s)
        messages.append(
            Announce(
                number=zone.kind.number,
                numbers=place.numbers,
                velocity=place.velocity,
                clearance_m=zone.table.clearance_m,
                keep_in=zone.table.keep_in,
                t_us=state.round_us,
                index=index,
                count=len(plan.zones),
                touch=zone.table.touch,
            )
        )
    return messages


def _acknowledged(
    plan: FlightPlan, state: PilotState, result: int, heard: Heard, t_us: int
) -> PilotState:
    if result == message_ids.ACCEPTED:
        following = _COMMANDS[state.phase][1]
        if state.phase is Phase.ARM and plan.hop:
            following = Phase.TAKE_OFF
        return replace(
            state,
            phase=following,
            since_us=t_us,
            next_ask_us=t_us,
            start_height_m=heard.height_m,
        )
    can_wait = result in (message_ids.TEMPORARILY_REJECTED, message_ids.IN_PROGRESS)
    if can_wait and t_us - state.since_us < _PATIENCE_US:
        return state
    reason = f": {state.last_text}" if state.last_text else f" (MAV_RESULT {result})"
    return replace(state, refusal=f"the vehicle refused to {state.phase.value}{reason}")


def _left(custom_mode: int | None) -> str:
    """State of the trajectory as part of a sentence."""
    number = custom_mode or 0
    main, sub = number >> 16 & 0xFF, number >> 24 & 0xFF
    return f"the vehicle left the trajectory for {_NAMES.get((main, sub), f'mode {main}/{sub}')}"


def _stands(state: PilotState, heard: Heard) -> bool:
    """Whether the vehicle is as low and slow as after a landing, wherever it disarmed."""
    low = heard.height_m - state.start_height_m < _LANDED_M
    return low and heard.speed_m_s < _HOVER_SPEED_M_S


def _hover(state: PilotState, heard: Heard, t_us: int) -> PilotState:
    """Land after three seconds of standing still in the air."""
    still = heard.speed_m_s < _HOVER_SPEED_M_S
    if not still or not heard.height_m - state.start_height_m >= _CLIMB_M:
        return replace(state, hovering_since_us=None)
    if state.hovering_since_us is None:
        return replace(state, hovering_since_us=t_us)
    if t_us - state.hovering_since_us < _HOVER_US:
        return state
    return replace(state, phase=Phase.LAND, since_us=t_us, next_ask_us=t_us)


def _command(plan: FlightPlan, phase: Phase) -> SendCommand:
    command = _COMMANDS[phase][0]
    if phase is Phase.ARM:
        return SendCommand(command, (1.0, 0.0, _NAN, _NAN, _NAN, _NAN, _NAN))
    if phase is Phase.FOLLOW:
        # Custom mode (1), PX4's main mode 4, automatic, and its first sub mode for modes of
        # others: here the end-effector's trajectory.
        return SendCommand(command, (1.0, _MAIN_AUTO, _AUTO_EXTERNAL1, _NAN, _NAN, _NAN, _NAN))
    if phase is Phase.GRAB or phase is Phase.RELEASE:
        closes = 1.0 if phase is Phase.GRAB else 0.0
        return SendCommand(command, (1.0, closes, _NAN, _NAN, _NAN, _NAN, _NAN))
    height = plan.takeoff_height_m if phase is Phase.TAKE_OFF else _NAN
    return SendCommand(command, (_NAN, _NAN, _NAN, _NAN, _NAN, _NAN, height))
