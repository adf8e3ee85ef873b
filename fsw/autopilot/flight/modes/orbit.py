"""Orbit: circles a point, level; entered by its own command, which names the circle."""

from __future__ import annotations

from fsw.autopilot.flight.modes.base import FlightMode, Handover, Px4Mode
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.signals import Mode, StateEstimate
from fsw.frozen import replace


class Orbit(FlightMode):
    """PX4's POSCTL.ORBIT."""

    mode = Mode.ORBIT
    px4 = Px4Mode(3, 1, 21, "orbit", standard=2, selectable=False)
    manual = True

    def activate(
        self, state: FlightState, estimate: StateEstimate, handover: Handover
    ) -> FlightState:
        """Start from the current setpoint; the command then sets the circle."""
        last = state.setpoint
        return replace(state, setpoint=SetpointMemory(last.reference, last.goal))
