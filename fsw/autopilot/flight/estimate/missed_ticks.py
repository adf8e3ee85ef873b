"""What the flight software makes of time in which it did not run: its process was suspended.

Over few missed ticks the plan is moved on as if they had been there. Over more, nothing that the
loops remember says what happened: what moved the vehicle meanwhile was not their last command, and
an observer would take it for a disturbance. So loops and plan begin anew from the measurement, and
the estimator first takes every reading of that time as if it had come in a tick of its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

from fsw.autopilot.control.joints import rest_joints
from fsw.autopilot.estimation.imu import IMU_TOO_OLD
from fsw.autopilot.flight.plan_exchange import (
    measured_state,
    with_arm_in_bounds,
    with_plan_state,
    without_plan,
)
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.model.rotors import MotionState
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import StateEstimate, TickInputs
from fsw.frozen import replace

# Since the last tick. The filter takes what is so old at once, and nothing that is older.
READ_LATE_US: Final = round(1e6 * IMU_TOO_OLD)
_STEP_US: Final = 4_000  # in which they are: the filter has room for more, but takes it for jitter


def missed_inputs(last_us: int, inputs: TickInputs) -> Iterator[TickInputs]:
    """What ticks since ``last_us`` [us] would have been given, and at the end what is left.

    Nothing but ``inputs`` themselves where few ticks were missed, or no sensor has measured.
    """
    now_us, samples = inputs.sensors.t_us, inputs.samples
    if samples and now_us - last_us > READ_LATE_US:
        for t_us in range(last_us + _STEP_US, now_us - _STEP_US, _STEP_US):
            due = tuple([one for one in samples if one.time <= 1e-6 * t_us])
            if due:
                samples = tuple([one for one in samples if not one.time <= 1e-6 * t_us])
                yield TickInputs(replace(inputs.sensors, t_us=t_us), samples=due)
        inputs = replace(inputs, samples=samples)
    yield inputs


def resumed(
    config: FlightConfig, state: FlightState, estimate: StateEstimate, motion: MotionState
) -> FlightState:
    """The state without a plan, to brake from the measured motion until there is one.

    Loops go on from what they have learned, but from no motion; of the disturbance its lasting part
    is kept, wind.
    """
    measured = measured_state(estimate, motion)
    settled = with_arm_in_bounds(measured, config.airframe, config.planner.limits)
    state = without_plan(state, estimate)
    r = with_plan_state(state.record, settled)
    r.observed.v[:] = estimate.v_WB
    r.observed.d[:2], r.observed.d[2] = r.observed.disturbance_bias, 0.0
    rest_joints(r.joints, config.airframe, estimate)
    return replace(state, record=r)
