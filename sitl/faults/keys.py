"""What may stand in a table of ``[[faults]]``: a unit, how it fails, and when.

Units and kinds are those of MAVLink's FAILURE_UNIT and FAILURE_TYPE where it has them.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Final, Literal, TypeAlias, get_args

from command_line.ranges import Range
from vehicles.description import Vehicle

Sensor: TypeAlias = Literal[
    "gyro",
    "accel",
    "mag",
    "baro",
    "gps",
    "optical flow",
    "vio",
    "attitude",
    "distance",
    "encoder",
]
Unit: TypeAlias = Literal[
    Sensor,
    "battery",
    "motor",
    "joint",
    "mavlink",
    "to vehicle",
    "to simulator",
    "simulator",
    "flight software",
    "planner",
    "disk",
    "clock",
]
Kind: TypeAlias = Literal[
    "off",
    "stuck",
    "frozen",
    "garbage",
    "wrong",
    "slow",
    "delayed",
    "intermittent",
    "noisy",
    "wandering",
    "drifting",
    "turning",
    "tilting",
    "weak",
    "duplicated",
    "reordered",
    "stopped",
    "killed",
    "full",
    "jump",
]


@dataclass(frozen=True, slots=True)
class Fault:
    """One unit that fails in one way for a while."""

    unit: Unit
    kind: Kind
    start_s: Annotated[float, Range(0.0, 86400.0)] = 0.0  # since the start of the simulation
    duration_s: Annotated[float, Range(0.0, 86400.0)] = 0.0  # 0: to the end of the flight
    instance: Annotated[float, Range(0.0, 8.0, step=1.0)] = 0.0  # of motors and joints; 0: all
    # Of what a sensor measures as a vector, in its own frame; 0: all.
    axis: Annotated[float, Range(0.0, 3.0, step=1.0)] = 0.0
    # weak: of the thrust that is left, or of the battery's charge; intermittent, duplicated,
    # reordered: of the time, or of the datagrams.
    share: Annotated[float, Range(0.0, 1.0)] = 0.5
    # wrong, frozen, noisy, wandering, drifting: times what is usual for the unit; turning,
    # tilting: deg/s.
    size: Annotated[float, Range(-1000.0, 1000.0)] = 1.0
    delay_ms: Annotated[float, Range(0.0, 10000.0, step=2.0)] = 200.0  # delayed; slow: of a motor
    rate_hz: Annotated[float, Range(0.1, 500.0)] = 5.0  # slow: of a sensor
    forgets_s: Annotated[float, Range(0.001, 3600.0)] = 0.1  # wandering: its time constant
    jump_s: Annotated[float, Range(-3600.0, 3600.0)] = 0.5  # of the clock

    @property
    def number(self) -> int:
        """Which motor or joint, from 1; 0: all."""
        return round(self.instance)

    def hits(self, index: int) -> bool:
        """Whether the motor, joint or axis of an index from 0 fails."""
        return (self.number or round(self.axis)) in (0, index + 1)

    @property
    def of_real_time(self) -> bool:
        """Whether it means nothing in lockstep: no datagram is late, and the planner is inline."""
        return self.unit == "planner" or (self.unit in LINKS and self.kind == "delayed")

    @property
    def random(self) -> bool:
        """Whether it draws numbers, so that the seed of a flight decides how it goes."""
        return self.kind in _RANDOM

    def __str__(self) -> str:
        """As an operator reads it."""
        which = f" {self.number}" if self.number else ""
        return f"{self.unit}{which} {self.kind}"


SENSORS: Final[tuple[Sensor, ...]] = get_args(Sensor)
LINKS: Final = ("to vehicle", "to simulator")

_RANDOM: Final = (
    "frozen", "garbage", "intermittent", "noisy", "wandering", "duplicated", "reordered",
)  # fmt: skip
_SIGNAL: Final = ("off", "stuck", "garbage", "wrong", "slow", "delayed", "intermittent")
# Of a sensor: what its numbers are, as opposed to its messages.
_OF_NUMBERS: Final = ("frozen", "noisy", "wandering", "drifting")
_OF_A_FRAME: Final = ("turning", "tilting")
_OF_MESSAGES: Final = ("off", "slow", "delayed", "intermittent")  # of sensors
_LINK: Final = ("off", "delayed", "intermittent", "duplicated", "reordered")
_PROCESS: Final = ("stopped", "killed")
KINDS: Final[dict[str, tuple[str, ...]]] = {
    **dict.fromkeys(SENSORS, (*_SIGNAL, *_OF_NUMBERS)),
    "vio": (*_SIGNAL, *_OF_NUMBERS, *_OF_A_FRAME),
    "attitude": ("stuck", "frozen", "garbage", "wrong", "noisy", "wandering", *_OF_A_FRAME),
    "battery": ("off", "weak"),
    "motor": (*_SIGNAL, "weak"),
    "joint": ("off", "stuck"),
    "mavlink": ("off", "intermittent"),
    **dict.fromkeys(LINKS, _LINK),
    **dict.fromkeys(("simulator", "flight software", "planner"), _PROCESS),
    "disk": ("full",),
    "clock": ("jump",),
}
"""How each unit can fail."""

# Units that the exact states stand for: the pose is of satellites and of cameras.
EXACT: Final = ("gyro", "accel", "gps", "vio", "attitude", "encoder")
_VECTORS: Final = ("gyro", "accel", "mag", "gps", "vio")


def instances(unit: Unit, vehicle: Vehicle) -> int:
    """How many of a unit of a vehicle can fail each for itself; 0 where it is one."""
    joints = len(vehicle.joints)
    return {"motor": len(vehicle.rotors), "joint": joints, "encoder": joints}.get(unit, 0)


def absence(unit: Unit, aboard: tuple[str, ...]) -> str | None:
    """Key, value and what there is, where a unit is a sensor that is not ``aboard``."""
    if unit in SENSORS and unit not in aboard:
        return f'unit = "{unit}": not on board; the sensors are {", ".join(aboard)}'
    return None


def problem(fault: Fault, aboard: tuple[str, ...], vehicle: Vehicle, *, exact: bool) -> str | None:
    """Key, value and what is allowed, where a fault contradicts itself or what is ``aboard``.

    The states of the ``vehicle`` are ``exact`` or a suite's.
    """
    kinds, most = KINDS[fault.unit], instances(fault.unit, vehicle)
    if fault.kind not in kinds:
        allowed = ", ".join(f'"{kind}"' for kind in kinds)
        return f'kind = "{fault.kind}": a {fault.unit} can be {allowed}'
    if (missing := absence(fault.unit, aboard)) is not None:
        return missing
    if fault.number > most:
        allowed = f"0 (all) to {most}" if most else f"0, because there is one {fault.unit}"
        return f"instance = {fault.number}: must be {allowed}"
    if fault.axis and fault.unit not in _VECTORS:
        allowed = ", ".join(_VECTORS)
        return f"axis = {fault.axis:g}: must be 0, because {fault.unit} has none ({allowed} have)"
    if fault.size < 0.0 and fault.unit not in SENSORS:
        return f"size = {fault.size:g}: must be at least 0 but of a sensor"
    if fault.unit == "clock" and fault.jump_s < -fault.start_s:
        return f"jump_s = {fault.jump_s:g}: must be at least {-fault.start_s:g}, the clock's start"
    if fault.unit == "encoder" and fault.number and not exact and fault.kind in _OF_MESSAGES:
        return (
            f"instance = {fault.number}: must be 0 (all): the encoders share a message, and "
            f'"{fault.kind}" is of the message'
        )
    return None
