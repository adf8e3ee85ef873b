"""What is shown of a flight at one instant, wherever it comes from."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from enum import StrEnum
from typing import Any, NamedTuple

from fsw.autopilot.signals import JointVector, RotorVector, SafeSet, Vec3, Vec4


def vec3(values: Iterable[Any]) -> Vec3:
    """Three ``values`` [any unit, any frame], whatever holds them."""
    x, y, z = map(float, values)
    return x, y, z


class Posture(NamedTuple):
    """A vehicle with an arm in space."""

    p: Vec3  # m, NED, body origin
    q: Vec4  # [w, x, y, z], body to NED
    q_arm: JointVector  # rad


class Horizon(NamedTuple):
    """A plan, from its start to its end: one place a node."""

    base: tuple[Vec3, ...]  # m, NED
    tip: tuple[Vec3, ...]  # m, NED; the end-effector


class Margin(NamedTuple):
    """One zone and part of the body."""

    name: str
    margin: float  # m beyond the clearance; negative is a violation
    barrier: float  # m/s, h; the barrier acts at or below 0


class Battery(NamedTuple):
    """What is left."""

    voltage: float  # V
    remaining: float  # share


class Solver(NamedTuple):
    """The last planning cycle."""

    status: str
    total: float  # s; NaN where it was not measured
    solve: float  # s; NaN where it was not measured
    iterations: int  # of the interior-point or the dual solver
    slack: float  # m/s
    missed: int  # deadlines, since the start
    fallbacks: int  # plans that were refused, since the start


class Timing(NamedTuple):
    """One rate group over its last second; NaN in lockstep."""

    name: str
    period: float  # s
    execution_p99: float  # s
    late: int  # ticks, since the start
    skipped: int  # ticks, since the start


class Tool(NamedTuple):
    """What the tool does at a surface that it may touch."""

    force: Vec3  # N, NED, on it, observed
    pressed: float  # N, of that along the normal
    asked: float  # N
    most: float  # N, that the surface allows
    contact: bool


class Held(NamedTuple):
    """What is in the gripper."""

    closed: bool
    mass: float  # kg, weighed


class Safety(NamedTuple):
    """Episodes since the start."""

    breaches: int = 0
    departures: int = 0
    interventions: int = 0
    refusals: int = 0  # of what was announced, streamed or uploaded, each message counted


_SAFE = Safety()


@dataclass(frozen=True, slots=True, kw_only=True)
class Scene:
    """What is shown; None, NaN or empty where the source does not say it."""

    t: float  # s, sensor time
    estimate: Posture | None = None
    truth: Posture | None = None
    velocity: Vec3 | None = None  # m/s, NED, estimated
    thrust: RotorVector | None = None  # N, commanded
    torque: JointVector | None = None  # N m, commanded
    joint_rates: JointVector | None = None  # rad/s
    target: Vec3 | None = None  # m, NED: where the end-effector should be now
    horizon: Horizon | None = None
    safe_set: SafeSet | None = None
    margins: tuple[Margin, ...] = ()
    minimum: float = math.nan  # m, of all margins
    added: float = math.nan  # m, kept beyond the clearances because the estimate is not sure
    sigma: Vec3 | None = None  # m, standard deviation of the estimated place, NED
    mode: str = ""
    armed: bool | None = None  # None: not known
    landed: bool = False
    failures: str = ""  # names of the active failsafes
    battery: Battery | None = None
    link_age: float = math.nan  # s since something came; NaN for a log, and before anything came
    others: tuple[int, ...] = ()  # systems that speak where the vehicle does not
    dropped: str = ""  # what the vehicle has dropped of all that it was sent
    solver: Solver | None = None
    timing: tuple[Timing, ...] = ()
    safety: Safety = _SAFE
    tool: Tool | None = None  # None: nothing that it may touch is near
    held: Held | None = None  # None: the gripper was never told anything


class EventKind(StrEnum):
    """What an event is about."""

    MODE = "mode"
    ARMING = "arming"
    FAULT = "fault"
    COMMAND = "command"
    WARNING = "warning"
    TEXT = "text"


class Event(NamedTuple):
    """Something to jump to."""

    t: float  # s, sensor time
    kind: EventKind
    text: str


class Worst(NamedTuple):
    """The smallest margin of a flight."""

    t: float  # s, sensor time
    margin: float  # m
    name: str  # of zone and part
    source: str  # who says so
