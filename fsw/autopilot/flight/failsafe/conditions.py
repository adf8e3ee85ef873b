"""What can go wrong in flight, what can be done about it, and what is kept of both."""

from __future__ import annotations

from enum import Enum
from typing import Final, NamedTuple

from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import Mode


class Action(Enum):
    """What is done about a condition, from mildest to strongest."""

    NONE = "none"  # not even reported
    WARN = "warn"
    REPLAN = "replanning"  # from the measurement, which the tick does by itself
    PUSH = "pushed off"  # by the safety filter, in every tick that needs it
    DEAD_RECKON = "dead reckoning"  # which the estimator does by itself
    BRAKE = "brake"  # the tick does so whenever no plan is young enough
    HOLD = "holding"
    RETREAT = "retreating"  # off the zones that are too close, then hold
    RETURN = "returning"
    LAND = "landing"
    DESCEND = "descending"  # where it is, without a plan and, if need be, without a position
    TERMINATE = "terminate"

    @property
    def mode(self) -> Mode | None:
        """The mode that the action switches to."""
        return _MODES.get(self)

    @property
    def strength(self) -> int:
        """Place in the order of actions; the stronger one wins."""
        return _STRENGTHS[self]


_MODES: Final = {
    Action.HOLD: Mode.HOLD,
    Action.RETREAT: Mode.HOLD,
    Action.RETURN: Mode.RETURN,
    Action.LAND: Mode.LAND,
    Action.DESCEND: Mode.DESCEND,
    Action.TERMINATE: Mode.FAULT,
}
_STRENGTHS: Final = {action: place for place, action in enumerate(Action)}


class Condition(Enum):
    """Every condition, named for what the operator reads."""

    ATTITUDE_LOST = "attitude unknown"
    TILT_LOST = "tilt beyond recovery"
    POSITION_LOST = "position unknown"
    PLANNER_LOST = "planner lost"
    BREACH = "outside the safe set"
    FENCE_BREACH = "outside the fence"
    FAR_OUTSIDE = "too far outside to retreat"
    GROUND_CONTACT = "ground contact"
    ROTOR_LOST = "rotor lost"
    ROTOR_FAILED = "rotor failed"
    JOINT_FAILED = "joint failed"
    POSITION_LOW = "position uncertain"
    SENSOR_LOST = "sensor lost"
    INERTIAL_LOST = "no attitude measurement"
    SENSORS_UNDECIDED = "sensors contradict each other for long"
    SENSORS_CONTRADICT = "sensors contradict each other"
    ROOM_LACKING = "clearance too small for the position uncertainty"
    FORCE_HIGH = "force on the tool too high"
    CONTACT_LOST = "contact lost"
    SURFACE_MOVED = "surface not where announced"
    TOOL_SLIPS = "tool slips"
    PAYLOAD_HEAVY = "payload too heavy"
    TUBE_LEFT = "off the plan"
    FILTER_ACTIVE = "too fast towards a zone"
    PLAN_STALE = "no plan for three periods"
    AIDING_LOST = "no position measurement"
    ESTIMATE_INVALID = "state estimate invalid"
    OUTPUT_NOT_FINITE = "actuator command not finite"
    PLAN_REFUSED = "last plan refused"
    PLAN_LATE = "plan late"
    TIME_JUMPED = "time jumped"
    LOOP_OVERRUN = "ticks missed"
    CLOCK_JUMPED = "wall clock jumped"
    LINK_FLOODED = "link flooded"
    LOG_STOPPED = "flight log damaged"
    DISK_FULL = "disk nearly full"
    SETPOINTS_LOST = "offboard setpoints stopped"
    ZONES_SILENT = "moving zones not updated"
    DATALINK_LOST = "no ground station"
    FLIGHT_TIME_LOW = "flight time short"
    BATTERY_LOW = "battery low"
    BATTERY_CRITICAL = "battery critical"
    BATTERY_EMERGENCY = "battery nearly empty"
    PARAMETERS_CONTRADICT = "parameters contradict each other"


class FailsafeMemory(NamedTuple):
    """What is being done about the active conditions."""

    since_us: tuple[int, ...] = ()  # when each of them became active, in their order
    action: Action = Action.NONE  # the strongest that was taken since the pilot commanded a mode
    cause: Condition | None = None  # condition that asked for the action
    pending: Action = Action.NONE  # what follows the hold that gives the pilot time
    due_us: int = 0  # when
    overridden: tuple[Condition, ...] = ()  # whose actions a command of the pilot has put aside
    # As they were looked at last; another one is the same condition, and news.
    joint: str = ""  # which joints have failed
    sensors: tuple[Sensor, ...] = ()  # that are lost
    contradiction: str = ""  # of parameters


NOTHING_DONE: Final = FailsafeMemory()
