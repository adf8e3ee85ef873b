"""Whether the vehicle stands on the ground, by its height and its speed."""

from __future__ import annotations

from fsw.parameters.flight_config import FlightConfig
from fsw.signals import StateEstimate


def height_above_ground(config: FlightConfig, estimate: StateEstimate) -> float:
    """Height of the vehicle above its standing height at the origin [m]."""
    return -estimate.p_WB[2] - config.airframe.leg_length


def is_low(config: FlightConfig, estimate: StateEstimate) -> bool:
    """Whether the vehicle is as low as where it stands."""
    return height_above_ground(config, estimate) < config.limits.landed_height


def stands(config: FlightConfig, estimate: StateEstimate) -> bool:
    """Near standing height and hardly moving."""
    vx, vy, vz = estimate.v_WB
    slow = vx * vx + vy * vy + vz * vz < config.limits.landed_speed**2
    return is_low(config, estimate) and slow


def standing_unclear(config: FlightConfig, estimate: StateEstimate) -> bool:
    """Neither at rest on the ground nor clearly in the air."""
    low = height_above_ground(config, estimate) < config.limits.airborne_height
    return low and not stands(config, estimate)
