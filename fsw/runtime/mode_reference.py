"""The end-effector reference of each mode."""

from __future__ import annotations

from fsw.mpc.reference import sample, still_at, vertical_ramp
from fsw.parameters.flight_config import FlightLimits
from fsw.runtime.flight_state import MissionMemory, VehicleMemory
from fsw.signals import EndEffectorTarget, Mode
from fsw.vehicle.confine import confined

_FAR_DOWN = -100.0  # m; landing descends until the ground is felt, wherever it is


def mode_reference(
    vehicle: VehicleMemory, mission: MissionMemory, limits: FlightLimits, t_us: int
) -> EndEffectorTarget:
    """Where the end-effector should be at an instant, by the vehicle's mode."""
    if vehicle.mode is Mode.TRAJECTORY and mission.stream:
        return sample(mission.stream, t_us)
    if vehicle.mode is Mode.MISSION and mission.flight.leg is not None:
        return confined(mission.flight.leg.at(t_us), mission.safe_set)
    if vehicle.mode is Mode.TAKEOFF:
        return _ramp(vehicle, vehicle.climb, limits.climb_speed, t_us)
    if vehicle.mode is Mode.LAND:
        return _ramp(vehicle, _FAR_DOWN, limits.land_speed, t_us)
    return still_at(vehicle.anchor, t_us, vehicle.anchor_yaw)


def _ramp(vehicle: VehicleMemory, climb: float, speed: float, t_us: int) -> EndEffectorTarget:
    start = still_at(vehicle.anchor, vehicle.anchor_us, vehicle.anchor_yaw)
    return vertical_ramp(start, climb, speed, t_us)
