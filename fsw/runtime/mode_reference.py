"""The end-effector reference of each mode."""

from __future__ import annotations

from fsw.mpc.reference import sample, still_at, vertical_ramp
from fsw.parameters.flight_config import FlightLimits
from fsw.runtime.flight_state import FlightState
from fsw.signals import EndEffectorTarget, Mode

_FAR_DOWN = -100.0  # m; landing descends until the ground is felt, wherever it is


def mode_reference(state: FlightState, limits: FlightLimits, t_us: int) -> EndEffectorTarget:
    """Where the end-effector should be at an instant, by the state's mode."""
    if state.mode is Mode.TRAJECTORY and state.stream:
        return sample(state.stream, t_us)
    if state.mode is Mode.TAKEOFF:
        return vertical_ramp(
            state.anchor, limits.takeoff_climb, limits.climb_speed, state.anchor_us, t_us
        )
    if state.mode is Mode.LAND:
        return vertical_ramp(state.anchor, _FAR_DOWN, limits.land_speed, state.anchor_us, t_us)
    return still_at(state.anchor, t_us)
