"""What a command is decided on, and what a decision is."""

from __future__ import annotations

from dataclasses import dataclass, field

from fsw.geometry.geodesy import DEFAULT_ORIGIN
from fsw.model.airframe import AIRFRAME, Airframe
from fsw.signals import (
    Charge,
    Home,
    MissionProgress,
    Mode,
    Orbit,
    Origin,
    SafeSet,
    Vec2,
    Vec3,
)
from fsw.vehicle.modes import Event

# MAV_RESULT of MAVLink common.xml.
ACCEPTED, TEMPORARILY_REJECTED, DENIED, UNSUPPORTED = 0, 1, 2, 3
CLIMB_TOLERANCE = 0.05  # m: a ground station rounds, and reckons from the altitude it was sent last


@dataclass(frozen=True, slots=True)
class Situation:
    """What a decision may depend on."""

    mode: Mode
    landed: bool
    estimate_valid: bool
    targets_ahead: bool  # the stream holds a point at or after now
    standing_unclear: bool = False  # too high to stand, too low to be surely in the air
    inconsistent: str = ""  # why the configuration cannot keep the safe set
    mission: MissionProgress = field(default_factory=MissionProgress)
    mission_refusal: str | None = "no mission: none was uploaded"  # None: it can be flown
    setpoint_fresh: bool = False  # an offboard set-point came within the last 0.5 s
    position: Vec3 = (0.0, 0.0, 0.0)  # m, of the body
    yaw: float = 0.0  # rad
    joints: Vec2 = (0.0, 0.0)  # rad, asked for last or as they are
    origin: Origin = DEFAULT_ORIGIN
    home: Home | None = None
    safe_set: SafeSet = field(default_factory=SafeSet)
    climb_range: Vec2 = (0.3, 50.0)  # m, of a takeoff
    airframe: Airframe = AIRFRAME
    charge: Charge = Charge.OK
    speed: float = 1.0  # m/s, on the way to places
    speed_most: float = 1.5  # m/s, that can be asked for
    turn_rate: float = 0.3  # rad/s, at most
    acceleration: float = 1.0  # m/s^2, of a steered reference


@dataclass(frozen=True, slots=True)
class Goto:
    """A place to hold at."""

    p: Vec3  # m, of the body
    yaw: float | None  # rad; None: as it is
    speed: float | None  # m/s; None: as usual


@dataclass(frozen=True, slots=True)
class LookAt:
    """Where the nose is to point from now on."""

    place: Vec3 | None  # m; None: wherever it is flown


@dataclass(frozen=True, slots=True)
class Speed:
    """How fast to fly to places from now on."""

    speed: float | None  # m/s; None: as usual


@dataclass(frozen=True, slots=True)
class Decision:
    """Answer to a command: its MAV_RESULT, the event it causes and what goes with it."""

    result: int
    event: Event | None = None
    reason: str = ""  # of a refusal, or what the operator must read though it is accepted
    alarming: bool = False
    stop: bool = False  # holding already, but perhaps on the way to a place
    climb: float | None = None  # m, of a takeoff; None: the usual one
    goto: Goto | None = None
    joints: Vec2 | None = None  # rad
    home: Home | None = None
    standby: Mode | None = None  # what arming is to lead to
    mission_step: int | None = None  # to fly next
    orbit: Orbit | None = None
    look_at: LookAt | None = None
    speed: Speed | None = None
