"""What the arming checks look at beside the mode: one value, made from the state of the vehicle."""

from __future__ import annotations

import math

from fsw.autopilot.estimation.faults.sensor_fault import sentence
from fsw.autopilot.flight.state import FlightState
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import JointVector, StateEstimate
from fsw.frozen import dataclass

_DENIES = 2  # of COM_ARM_SDCARD
_SILENT_US = 1_000_000
_KNOWN_ANGLE = 0.2  # rad, standard deviation of roll and pitch that telemetry calls known


@dataclass(frozen=True, slots=True)
class ArmingHealth:
    """Empty sentences are what is well."""

    tilt: float = 0.0  # rad
    estimator: str = ""  # why the estimate is not to be relied upon
    sensor: str = ""  # which one fails, and how
    remaining: float = 1.0  # share of the battery's capacity
    min_remaining: float = 0.1
    parameters: str = ""  # which contradict each other
    min_margin: float = math.inf  # m, of the safe set
    joint_rates: JointVector = ()  # rad/s
    joints: JointVector = ()  # rad
    damage: str = ""  # parts that have failed
    storage: str = ""  # why the flight log is not written


def arming_health(
    config: FlightConfig, state: FlightState, estimate: StateEstimate, contradiction: str
) -> ArmingHealth:
    """The health of a vehicle in a state; its parameters may have a ``contradiction``."""
    limits, aiding, margins = config.limits, state.aiding, state.constraints.margins
    estimator = ""
    if aiding.unaided_us >= limits.aiding_loss_us:
        estimator = f"no position measurement: {sentence(aiding.pose, aiding.pose_fault)}"
    elif not aiding.attitude_sigma <= _KNOWN_ANGLE:
        degrees = math.degrees(aiding.attitude_sigma)
        estimator = f"roll and pitch are known to {degrees:.0f} deg only"
    least = limits.arm_battery if limits.arm_battery >= 0.0 else limits.battery_critical
    upright = estimate.R_WB[8]
    return ArmingHealth(
        tilt=math.acos(min(max(upright, -1.0), 1.0)) if upright == upright else math.pi,
        estimator=estimator,
        sensor=_failing_sensor(state, estimate.t_us - limits.sensor_loss_us),
        remaining=state.battery.remaining,
        min_remaining=least,
        parameters=contradiction,
        min_margin=min(margins, default=math.inf),
        joint_rates=estimate.qd_arm,
        joints=estimate.q_arm,
        damage=state.damage.rotor or state.damage.joint,
        storage=state.host.log_failure if limits.arm_without_log >= _DENIES else "",
    )


def _failing_sensor(state: FlightState, since_us: int) -> str:
    """The first sensor that has been of no use ``since_us``, or was there and is silent."""
    aiding = state.aiding
    for lost in aiding.lost:
        if lost.since_us <= since_us:
            return sentence(lost.sensor, lost.fault)
    for one in state.estimator.sensors if state.estimator is not None else ():
        if one.silent_us > _SILENT_US:
            return f"{one.name} has been silent for {1e-6 * one.silent_us:.0f} s"
    return ""
