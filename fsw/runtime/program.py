"""The flight program as the loop sees it: a first state, a pure tick and a planner."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, TypeAlias

from fsw.autopilot.ports import PlanningCycle, VehicleFacts
from fsw.autopilot.signals import TickInputs, TickOutputs
from fsw.link.events.event_service import EventLog
from fsw.link.services.mission_store import MissionStore

if TYPE_CHECKING:
    # They import everything that flies; a refusal need not wait for that.
    from fsw.autopilot.flight.autopilot import Controlled
    from fsw.autopilot.flight.state import FlightState
    from fsw.storage.parameter_store import ParameterStore

Control: TypeAlias = "Callable[[FlightState, TickInputs], Controlled]"
"""A tick from a state and its inputs up to its answer."""
Conclude: TypeAlias = "Callable[[Controlled], tuple[FlightState, TickOutputs]]"
"""The rest of that tick: the next state, and everything the tick says."""


@dataclass(frozen=True, slots=True)
class FlightProgram:
    """Everything that is pure, with its stores; the loop adds time, links and logs."""

    facts: VehicleFacts
    first_state: FlightState
    control: Control
    conclude: Conclude
    planner: PlanningCycle
    parameters: ParameterStore
    missions: MissionStore
    events: EventLog = field(default_factory=EventLog)
    numbers: Mapping[str, float] = field(default_factory=dict)  # of the configuration, by name
