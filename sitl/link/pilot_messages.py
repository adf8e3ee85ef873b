"""Messages of the scenario's pilot to the vehicle, before they are encoded."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, TypeAlias

from sitl.scenario import V3, Touch
from sitl.trajectory import TrajectoryPoint

Params: TypeAlias = tuple[float, float, float, float, float, float, float]


@dataclass(frozen=True, slots=True)
class Announce:
    """One zone of the safe set."""

    number: int  # PANDION_SHAPE
    numbers: tuple[float, ...]
    velocity: V3  # m/s, NED
    clearance_m: float
    keep_in: bool
    t_us: int  # when it is there
    index: int
    count: int
    touch: Touch | None = None  # what the tool meets there, if it may touch it


@dataclass(frozen=True, slots=True)
class SendTarget:
    """A point of the end-effector's trajectory."""

    t_us: int  # when it is to be met
    point: TrajectoryPoint
    yaw: float  # rad


@dataclass(frozen=True, slots=True)
class SendCommand:
    """A command that wants an acknowledgement."""

    command: int  # MAV_CMD
    params: Params  # NaN where not used


PilotMessage: TypeAlias = Announce | SendTarget | SendCommand
"""The safe set, points to be met, and commands."""


@dataclass(frozen=True, slots=True)
class Ack:
    """The vehicle's answer to a command."""

    command: int  # MAV_CMD
    result: int  # MAV_RESULT


class Heard(NamedTuple):
    """What the vehicle's last answer showed."""

    acks: tuple[Ack, ...] = ()
    texts: tuple[str, ...] = ()
    armed: bool = False
    height_m: float = 0.0  # above the ground, as the sensors measured it
    speed_m_s: float = 0.0
    custom_mode: int | None = None  # None: not reported
