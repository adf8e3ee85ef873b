"""What the page asks of a recorded flight."""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

from numpy.typing import NDArray

from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import Vec3
from view.scene import Event, Scene, Worst

Array = NDArray[Any]


class Curve(NamedTuple):
    """Values over time: ``t`` (n,) [s, sensor time] and a row (n,) for each name."""

    title: str
    t: Array
    names: tuple[str, ...]
    rows: tuple[Array, ...]
    limits: tuple[float, ...] = ()  # drawn across


class Trail(NamedTuple):
    """A path and how far inside its safe set the vehicle was on it."""

    points: Array  # (n, 3) m, NED
    margins: Array  # (n,) m; NaN: not known


class Flight(Protocol):
    """A flight that is over."""

    title: str
    begin: float  # s, sensor time
    end: float  # s, sensor time
    airframe: Airframe
    facts: tuple[tuple[str, str], ...]  # what is known about it
    unusable: tuple[str, ...]  # a sentence about each file beside it that cannot be used
    events: tuple[Event, ...]  # in order of time
    worst: Worst | None

    def scene(self, t: float) -> Scene:
        """What was at ``t`` [s, sensor time]."""

    def trail(self) -> Trail:
        """The end-effector's path."""

    def reference(self) -> Array:
        """Where the end-effector should have been, (n, 3) [m, NED]."""

    def curves(self) -> tuple[Curve, ...]:
        """What is drawn over time."""

    def region(self) -> tuple[Vec3, Vec3]:
        """Least and largest corner of where something happened [m, NED]."""
