"""Hold: stays where the vehicle was, or goes to a place and stays there."""

from __future__ import annotations

import math

from fsw.autopilot.flight.modes.base import FlightMode, Handover, Px4Mode
from fsw.autopilot.flight.setpoints.generator import PositionGoal, SetpointGenerator
from fsw.autopilot.flight.state import FlightState, SetpointMemory
from fsw.autopilot.signals import Mode, MotionSetpoint, StateEstimate
from fsw.frozen import replace

_AT_REST = 0.1  # m/s; faster, a hold brakes first


class Hold(FlightMode):
    """PX4's AUTO.LOITER; on the ground the rotors idle."""

    mode = Mode.HOLD
    px4 = Px4Mode(4, 3, 4, "loiter")
    interrupts_landing = True
    before_arming = True
    manual = True

    def activate(
        self, state: FlightState, estimate: StateEstimate, handover: Handover
    ) -> FlightState:
        """Stop; after a completed mode the reference is at rest already."""
        if not state.vehicle.flies or (handover.completed and state.setpoint.reference is None):
            return replace(state, setpoint=SetpointMemory())
        return replace(state, setpoint=stop(self.generator, state.setpoint, estimate))


def stop(
    generator: SetpointGenerator, setpoint: SetpointMemory, estimate: StateEstimate
) -> SetpointMemory:
    """Stop; a vehicle that hardly moves stays where it is."""
    reference = setpoint.reference
    if reference is None:
        if math.hypot(*estimate.v_WB) < _AT_REST:
            return SetpointMemory()
        reference = generator.begin(estimate, of_end_effector=True)
    joints = setpoint.goal.joints if setpoint.goal is not None else None
    motion = MotionSetpoint(reference.of_end_effector, v=(0.0, 0.0, 0.0))
    return SetpointMemory(reference, PositionGoal(motion, joints))
