"""The interface of a flight mode.

A flight mode is one file in this folder: a subclass of ``FlightMode`` and a name in
``fsw.autopilot.signals.Mode``. Disarmed and terminated vehicles are in no flight mode.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from fsw.autopilot.flight.land_detector import feel_ground
from fsw.autopilot.flight.setpoints.generator import PositionGoal, SetpointGenerator
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import EndEffectorTarget, Mode, StateEstimate, StatusText
from fsw.frozen import replace


@dataclass(frozen=True, slots=True)
class Px4Mode:
    """A mode in PX4's numbers, so that ground stations name it and offer their buttons."""

    main: int  # PX4_CUSTOM_MAIN_MODE
    sub: int  # PX4_CUSTOM_SUB_MODE_*; 0: none
    nav_state: int  # NAVIGATION_STATE, and its bit in navigation_mode_group_t
    name: str  # in that group
    standard: int = 0  # MAV_STANDARD_MODE as announced; 0: none
    also_standard: int = 0  # MAV_STANDARD_MODE that is understood though not announced
    selectable: bool = True  # offered to the operator; else entered by a command of its own
    offered: bool = True  # announced at all; else no command enters it


@dataclass(frozen=True, slots=True)
class ModeResult:
    """Result of a mode's tick."""

    next_mode: Mode | None = None  # None: the mode goes on
    cause: str = ""  # of the change, for the operator
    texts: tuple[StatusText, ...] = ()
    completed: bool = True  # the mode is done; False: it cannot go on
    lift_off: bool = False  # a vehicle that stands is to fly, in the same mode


CONTINUE = ModeResult()


@dataclass(frozen=True, slots=True)
class Handover:
    """How one mode takes over from another."""

    reference: EndEffectorTarget  # of the mode that is left, now
    completed: bool  # that mode was done; the change was neither commanded nor a failsafe's


class FlightMode:
    """One flight mode of one configuration; holds nothing that changes in flight.

    ``refusal`` is what it needs, ``activate`` how it begins, ``update`` what it does each tick and
    which mode follows when it is done, ``reference`` where the end-effector should be.
    """

    mode: ClassVar[Mode]
    px4: ClassVar[Px4Mode]
    enter_from: ClassVar[frozenset[Mode] | None] = None  # None: from every interruptible mode
    interruptible: ClassVar[bool] = True  # by any other mode
    interrupts_landing: ClassVar[bool] = False
    before_arming: ClassVar[bool] = False  # can be chosen while disarmed, and is flown on arming
    lifts_off: ClassVar[bool] = False  # closes the loops of a vehicle that stands
    continues_reference: ClassVar[bool] = False  # begins where the last reference was
    manual: ClassVar[bool] = False  # flown by an operator, whose loss is acted upon
    external_reference: ClassVar[bool] = False  # targets from outside pass the governor

    def __init__(self, config: FlightConfig) -> None:
        self.config = config
        self.generator = SetpointGenerator(config)

    def can_follow(self, current: FlightMode) -> bool:
        """Whether this mode can take over from another."""
        if self.enter_from is not None:
            return current.mode in self.enter_from
        return current.interruptible or self.interrupts_landing

    def refusal(self, context: Situation) -> str | None:
        """Why the mode cannot be entered now: a condition that it needs is missing."""
        return None

    def denial(self, context: Situation) -> str | None:
        """Why this configuration never allows the mode."""
        return None

    def activate(
        self, state: FlightState, estimate: StateEstimate, handover: Handover
    ) -> FlightState:
        """Begin, in the state of the mode that is left: that is still ``state.vehicle.mode``."""
        return replace(state, setpoint=SetpointMemory())

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """What the mode does in each tick, and the mode that follows when it is done."""
        return state, CONTINUE

    def waits(self, state: FlightState, now_us: int) -> str | None:
        """Why the mode chosen before arming is dropped now; None if it stays chosen."""
        return None

    def aim(self, state: FlightState, estimate: StateEstimate) -> FlightState:
        """Bring the setpoint's goal up to date; called once a planning period."""
        return state

    def guided(self, goal: PositionGoal, state: FlightState) -> PositionGoal:
        """The goal with the speed and the heading that commands asked for."""
        vehicle = state.vehicle
        if vehicle.look_at is None and (vehicle.speed is None or goal.speed is not None):
            return goal
        return replace(goal, speed=goal.speed or vehicle.speed, look_at=vehicle.look_at)

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Where the end-effector should be at an instant, where no setpoint is generated."""
        vehicle = state.vehicle
        return still_at(vehicle.mode_origin, t_us, vehicle.mode_yaw)

    def target(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Where the end-effector should be at an instant."""
        reference = state.setpoint.reference
        if reference is None:
            return self.reference(state, t_us)
        return self.generator.target(reference, t_us)


def touch_down(
    config: FlightConfig, state: FlightState, estimate: StateEstimate
) -> tuple[FlightState, ModeResult]:
    """The end of every landing: once the ground carries the vehicle, it disarms."""
    state, landed = feel_ground(config, state, estimate)
    if not landed:
        return state, CONTINUE
    state = replace(state, vehicle=replace(state.vehicle, landed=True))
    return state, ModeResult(Mode.DISARMED, "touched down")
