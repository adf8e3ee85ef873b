"""States of a vehicle in the air, and the vehicle in them."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scipy.spatial.transform import Rotation

from fsw.autopilot.flight.modes.base import Handover
from fsw.autopilot.flight.state import FlightState, VehicleMemory, first_state
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.signals import Home, Mode, StateEstimate, Vec3
from tests.fsw.random_states import estimate_of

CONFIG = flight_config(body="points")
GROUND_Z = -CONFIG.airframe.leg_length
HOME = Home((3.0, -2.0, GROUND_Z), 0.0)
HANDOVER = Handover(still_at((0.0, 0.0, -1.0), 0, 0.0), completed=False)


def limits(**changes: Any) -> FlightConfig:
    return replace(CONFIG, limits=replace(CONFIG.limits, **changes))


def vehicle_at(p: Vec3, v: Vec3 = (0.0, 0.0, 0.0), t_us: int = 0) -> StateEstimate:
    """Level, at a place."""
    return estimate_of(Rotation.identity(), p_WB=p, v_WB=v)._replace(t_us=t_us)


def flying(mode: Mode = Mode.HOLD, **changes: Any) -> FlightState:
    """In the air, with a home; ``changes`` are of the vehicle's memory."""
    vehicle = VehicleMemory(mode=mode, landed=False, home=HOME, **changes)
    return replace(first_state(CONFIG.airframe), vehicle=vehicle)
