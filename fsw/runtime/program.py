"""The flight software proper, as the loop sees it: a first state, a pure tick and a planner."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from fsw.link.telemetry import VehicleFacts
from fsw.ports import Planner
from fsw.signals import TickInputs, TickOutputs

State = TypeVar("State")


@dataclass(frozen=True, slots=True)
class FlightProgram(Generic[State]):
    """Everything that flies; the loop adds time, links and logs."""

    facts: VehicleFacts
    first_state: State
    tick: Callable[[State, TickInputs], tuple[State, TickOutputs]]
    planner: Planner
