"""Situations that several tests of commands start from."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from scipy.spatial.transform import Rotation

from fsw.autopilot.flight.mission.sequencer import loaded
from fsw.autopilot.flight.situation import Situation
from fsw.autopilot.flight.state import (
    FlightState,
    MissionMemory,
    OffboardMemory,
    VehicleMemory,
    first_state,
)
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import MissionAction, MissionStep, Mode, StateEstimate
from fsw.autopilot.tuning import tuned
from tests.fsw.random_states import estimate_of

_CONFIG = flight_config(body="points")
_HERE = estimate_of(Rotation.identity(), p_WB=(0.0, 0.0, 0.0), v_WB=(0.0, 0.0, 0.0))
_AT_REST = _HERE._replace(t_us=0, yaw=0.0, q_arm=(0.0, 0.0), qd_arm=(0.0, 0.0))
LOW = (0.0, 0.0, -_CONFIG.airframe.leg_length - 0.2)
"""A place where the vehicle neither stands nor clearly flies."""
STANDING = Situation(first_state(_CONFIG.airframe), _AT_REST, _CONFIG)


def having(situation: Situation, **changes: Any) -> Situation:
    """The same with other values of its state, vehicle, mission or estimate, or of its own."""
    kinds = (Situation, StateEstimate, FlightState, VehicleMemory, MissionMemory)
    parts: dict[type, dict[str, Any]] = {kind: {} for kind in kinds}
    for name, value in changes.items():
        parts[next(kind for kind in kinds if name in kind.__annotations__)][name] = value
    state = replace(situation.state, **parts[FlightState])
    state = replace(
        state,
        vehicle=replace(state.vehicle, **parts[VehicleMemory]),
        mission=replace(state.mission, **parts[MissionMemory]),
    )
    estimate = situation.estimate._replace(**parts[StateEstimate])
    return replace(situation, **{"state": state, "estimate": estimate} | parts[Situation])


FRESH = OffboardMemory(joints_us=0)
AHEAD = (still_at((0.0, 0.0, -1.0), 0),)
_STEPS = (MissionAction.TAKE_OFF, MissionAction.GO, MissionAction.LAND)
MISSION = loaded(tuple(MissionStep(action) for action in _STEPS))
READY = having(STANDING, flight=MISSION, offboard=FRESH, stream=AHEAD)


def flying(**changes: Any) -> Situation:
    """In the air, with everything that any mode needs."""
    return having(READY, **{"mode": Mode.HOLD, "landed": False} | changes)


def tuned_by(situation: Situation, path: str, value: float) -> Situation:
    """The same of a vehicle with another number in its configuration."""
    return replace(situation, config=tuned(situation.config, ((path, value),)))
