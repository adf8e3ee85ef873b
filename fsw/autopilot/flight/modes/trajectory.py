"""Trajectory: follows streamed END_EFFECTOR_TARGETs."""

from __future__ import annotations

from fsw.autopilot.flight.modes.base import CONTINUE, FlightMode, ModeResult, Px4Mode
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.mpc.reference import sample
from fsw.autopilot.signals import EndEffectorTarget, Mode, StateEstimate


class Trajectory(FlightMode):
    """PX4's EXTERNAL1, its place for modes that are not its own; Hold follows."""

    mode = Mode.TRAJECTORY
    px4 = Px4Mode(4, 11, 23, "external1")
    external_reference = True

    def denial(self, context: Situation) -> str | None:
        """A configuration that can keep the safe set."""
        refusals = context.mission.refusals
        return f"no trajectory: {'; '.join(refusals)}" if refusals else None

    def refusal(self, context: Situation) -> str | None:
        """A vehicle in the air, and targets."""
        if context.landed:
            return "no trajectory: the vehicle is on the ground; take off first"
        stream = context.mission.stream
        if not (stream and stream[-1].t_us >= context.estimate.t_us):
            return "no trajectory: no END_EFFECTOR_TARGET ahead of now was received"
        return None

    def update(self, state: FlightState, estimate: StateEstimate) -> tuple[FlightState, ModeResult]:
        """Done after the last target."""
        stream = state.mission.stream
        if stream and stream[-1].t_us >= estimate.t_us:
            return state, CONTINUE
        return state, ModeResult(Mode.HOLD, "trajectory done")

    def reference(self, state: FlightState, t_us: int) -> EndEffectorTarget:
        """Between the targets."""
        if state.mission.stream:
            return sample(state.mission.stream, t_us)
        return super().reference(state, t_us)
