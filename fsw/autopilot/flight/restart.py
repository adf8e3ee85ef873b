"""A restart of the flight software on command: when it is possible, and what it leaves as it is.

It is how an operator says that what had failed is well again. As after a start of the process,
nothing is known of actuators, estimate and modes, and a termination is over. What the ground has
uploaded stays: tuning, safe set, fence, mission and rally points. So do the battery's charge and
the counts of the flight. Home, speed, region of interest, a mode chosen before arming and
setpoints do not.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import (
    FlightState,
    OffboardMemory,
    PlanMemory,
    SafetyMemory,
    VehicleMemory,
    first_state,
)
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import StateEstimate

RESTARTED: Final = "flight software restarted"
_REST_US: Final = 1_000_000  # without thrust, for which what falls is fast or has come down
_FALLEN_US: Final = 10_000_000  # without thrust: from 490 m
_REST_SPEED: Final = 0.2  # m/s
_REST_RATE: Final = 0.5  # rad/s


def rests(state: FlightState, estimate: StateEstimate, unaided_us: int) -> bool:
    """Whether a vehicle without thrust has come to rest, as far as is known.

    Where it has come down, and how it lies, height and attitude say nothing. One that knows nothing
    of its motion, or has not measured its position for ``unaided_us`` [us], has come down after a
    while.
    """
    for_us = estimate.t_us - state.vehicle.mode_begin_us
    if state.invalid_ticks or state.aiding.unaided_us >= unaided_us:
        return for_us >= _FALLEN_US
    slow = math.hypot(*estimate.v_WB) < _REST_SPEED and math.hypot(*estimate.w_WB_B) < _REST_RATE
    return slow and for_us >= _REST_US


def restarted(state: FlightState, airframe: Airframe) -> FlightState:
    """The state from which the next tick begins anew."""
    vehicle, plan, offboard = state.vehicle, state.plan, state.offboard
    return replace(
        first_state(airframe),
        # What was answered stays as well: the same command, sent again, is no second restart.
        vehicle=VehicleMemory(gcs_heard_us=vehicle.gcs_heard_us, answered=vehicle.answered),
        mission=state.mission,
        kept=InflatedSafeSet().of(state.mission.safe_set),
        # Until margins are known anew, those of where it stands count for arming.
        constraints=state.constraints,
        aiding=state.aiding,
        tuning=state.tuning,
        plan=PlanMemory(next_id=plan.next_id, counters=plan.counters),
        offboard=OffboardMemory(accepted=offboard.accepted, refused=offboard.refused),
        battery=state.battery,
        safety=SafetyMemory(counters=state.safety.counters),
        host=state.host,
    )
