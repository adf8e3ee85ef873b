"""Whether the vehicle stands on the ground: before arming by height and speed, in flight by thrust.

In a landing the stages are those of PX4's detector: ground contact, maybe landed, landed. An
accelerometer that is wrong makes height and velocity of the estimate wrong as well, so these alone
must not stop the rotors. What cannot be feigned is that nothing falls: on contact, when rotors
carry less than the weight, the loops open and rotors idle. In the air the vehicle then falls, and
its velocity shows it within 0.1 s: even an accelerometer that is wrong by 3 m/s^2 shows 6.8 of
free fall's 9.8, and on the ground no more than 3. Then the loops close again.

Where the rotors' model stands in for gyro or accelerometer, sensors contradict each other, or a
rotor does not obey, the ground must not carry any of the weight: what the legs feel would be taken
for a tilt, a climb or that rotor's thrust.
Then rotors stop as soon as the legs are close above the ground, and the vehicle falls less far than
its legs stand.

Where neither the height nor the force is measured no ground is noticed, and nothing that falls. A
descent is faster from where the ground should be (``modes/descend.py``); rotors stop 1 m below
that, or there, without a gyro.

In every mode a vehicle whose rotors carry less than the weight for a second stands, whatever it
believes of its height: the failsafe table lands it (``evidence.stands_on_ground``).

Source: docs/concepts/failsafes.md.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.estimation.faults.sensor_fault import SensorFault
from fsw.autopilot.flight.failsafe.evidence import FALLING_US
from fsw.autopilot.flight.plan_exchange import without_plan
from fsw.autopilot.flight.state import FlightState, VehicleMemory
from fsw.autopilot.measurements import RangeSample, Sensor
from fsw.autopilot.model.rotors import is_light
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.signals import StateEstimate, Vec2
from fsw.frozen import replace

_SINKS: Final = 0.15  # m/s; slower than a landing, faster than the rebound of the legs
_FALLS: Final = 5.0  # m/s^2; half-way between what is seen at rest and in free fall, at worst
_SIGMAS: Final = 3.0  # by which a height may be wrong
_CLOSE: Final = 0.1  # m of the legs above the ground; from there it falls at 1.4 m/s
_FALL: Final = 0.2  # m, of a vehicle whose rotors stop; the legs stand it
_SUNK: Final = 1.0  # m below the ground; what falls faster and faster is there by then
_RANGE_AGE: Final = 0.3  # s, in which a distance is one of now
_RANGE_MEMORY: Final = 0.1  # s, in which none must be longer
_CONTACT_US: Final = 100_000  # of contact before loops open
_SURE_US: Final = 200_000  # with open loops, in which a fall is seen


def height_above_ground(config: FlightConfig, estimate: StateEstimate) -> float:
    """Height of the vehicle above its standing height at the origin [m]."""
    return -estimate.p_WB[2] - config.airframe.leg_length


def with_range(vehicle: VehicleMemory, sample: RangeSample) -> VehicleMemory:
    """The vehicle after a ``sample`` of the rangefinder: it keeps those of 0.1 s, and two."""
    oldest = [_RANGE_MEMORY] * len(vehicle.ranges[:-1]) + [_RANGE_AGE]
    seen = zip(vehicle.ranges, oldest, strict=False)
    kept = [one for one, age in seen if 0.0 <= sample.time - one.time <= age]
    return replace(vehicle, ranges=(*kept, sample))


def longest_range(vehicle: VehicleMemory, newest: int = 0) -> RangeSample | None:
    """The rangefinder's last reading, with the longest distance of some: there is dust, and noise.

    So many of the ``newest`` count, 0: all that are kept.
    """
    counted = vehicle.ranges[-newest:]
    if not counted:
        return None
    return replace(counted[-1], distance=max([one.distance for one in counted]))


def stands(config: FlightConfig, estimate: StateEstimate) -> bool:
    """Near standing height and hardly moving."""
    vx, vy, vz = estimate.v_WB
    slow = vx * vx + vy * vy + vz * vz < config.limits.landed_speed**2
    return height_above_ground(config, estimate) < config.limits.landed_height and slow


def is_low(config: FlightConfig, estimate: StateEstimate) -> bool:
    """Not clearly in the air: the plan may well be lower than the vehicle can be."""
    return height_above_ground(config, estimate) < config.limits.airborne_height


def standing_unclear(config: FlightConfig, estimate: StateEstimate) -> bool:
    """Neither at rest on the ground nor clearly in the air."""
    return is_low(config, estimate) and not stands(config, estimate)


def may_be_low(config: FlightConfig, state: FlightState, estimate: StateEstimate) -> bool:
    """Whether the vehicle may be as low as where it stands.

    By the rangefinder where there is one, else by the estimate, as far as that knows its height.
    """
    limits, aiding = config.limits, state.aiding
    measured = _measured_now(config, state, estimate)
    if measured is not None:
        height, sigma = measured
    elif aiding.unaided_us >= limits.aiding_loss_us:
        return True
    else:
        height, sigma = height_above_ground(config, estimate), aiding.height_sigma
    return height - _SIGMAS * sigma < limits.landed_height


def is_close(config: FlightConfig, state: FlightState, estimate: StateEstimate) -> bool:
    """Whether legs are less than 0.1 m above the ground: nothing that is known says otherwise."""
    height, room = height_above_ground(config, estimate), _SIGMAS * state.aiding.height_sigma
    measured = _measured_now(config, state, estimate, newest=2)  # 0.1 s later legs carry
    if measured is not None and measured[0] < _CLOSE:
        return height - room < _CLOSE
    jumped = _has_fault(state, 1e-6 * estimate.t_us, SensorFault.JUMP)
    # Sensors that contradict each other may be wrong about the height as well.
    by_estimate = (measured is None or jumped) and not state.aiding.disputed_us
    return by_estimate and height < _CLOSE and height + room < _FALL


def _measured_now(
    config: FlightConfig, state: FlightState, estimate: StateEstimate, newest: int = 0
) -> Vec2 | None:
    now, legs = 1e-6 * estimate.t_us, config.airframe.leg_length
    return _measured_height(state, now, estimate.R_WB[8], legs, _RANGE_AGE, newest)


def _has_fault(state: FlightState, now: float, kind: SensorFault) -> bool:
    """Whether a reading of the rangefinder has lately had a fault of this ``kind``."""
    if state.fusion is None:
        return False
    health = state.fusion.of(Sensor.RANGEFINDER)
    return health.fault is kind and now - health.fault_at < _RANGE_AGE


def is_aloft(state: FlightState, now: float, legs: float, oldest: float = _RANGE_AGE) -> bool:
    """Whether the vehicle flies so high at ``now`` [s] that its ``legs`` [m] cannot touch anything.

    By the rangefinder's reading, if that is not ``oldest`` [s], or by the estimate, as far as it
    knows its height. Where they differ and sensors are in dispute, the estimate may be what is
    wrong; else it is the rangefinder, and who else is wrong must be asked all the same.
    """
    r, vehicle = state.record, state.vehicle
    if not (r.has_estimate and vehicle.flies):
        return False
    measured = _measured_height(state, now, r.upright, legs, oldest)
    if measured is not None and (measured[0] > _CLOSE or state.aiding.disputed_us):
        return measured[0] > _CLOSE
    return -r.down - legs - _SIGMAS * state.aiding.height_sigma > _CLOSE


def _measured_height(
    state: FlightState, now: float, upright: float, legs: float, oldest: float, newest: int = 0
) -> Vec2 | None:
    """Height of the ``legs`` [m, long] above the ground [m], and its deviation [m].

    By the rangefinder; None if that is stuck, or ``oldest`` [s] or more at ``now`` [s]. The cosine
    of the tilt is ``upright`` [1]; for ``newest`` see ``longest_range``.
    """
    seen = longest_range(state.vehicle, newest)
    if seen is None or not 0.0 <= now - seen.time < oldest:
        return None
    if _has_fault(state, now, SensorFault.STUCK):
        return None
    return seen.distance * upright - legs, math.sqrt(max(seen.variance, 0.0))


def feel_ground(
    config: FlightConfig, state: FlightState, estimate: StateEstimate
) -> tuple[FlightState, bool]:
    """The land detector's memory a tick on, and whether the vehicle has landed.

    To be asked where a descent is commanded.
    """
    vehicle, now_us, sinking = state.vehicle, estimate.t_us, estimate.v_WB[2]
    in_doubt = state.aiding.has_lost(Sensor.IMU) or state.aiding.disputed_us > 0
    in_doubt = in_doubt or state.damage.report.disobeys
    if in_doubt and is_close(config, state, estimate):
        return state, True
    sunk = 0.0 if state.aiding.gyro_lost else _SUNK
    if state.aiding.feels_nothing and height_above_ground(config, estimate) < -sunk:
        return state, True
    if vehicle.unloaded is None:
        if not is_light(config.airframe, state.record.rotors):
            return in_the_air(state, estimate), False
        blind = state.aiding.unaided_us >= config.limits.aiding_loss_us
        expected = may_be_low(config, state, estimate) and (blind or sinking < _SINKS)
        # Longer where height or velocity say that there is no ground.
        if now_us - vehicle.moved_us >= (_CONTACT_US if expected else FALLING_US):
            state = replace(state, vehicle=replace(vehicle, unloaded=(now_us, sinking)))
        return state, False
    since_us, before = vehicle.unloaded
    if not sinking - before < _SINKS + _FALLS * 1e-6 * (now_us - since_us):
        return in_the_air(state, estimate), False
    sure_us = max(config.limits.landed_time_us - _CONTACT_US, _SURE_US)
    return state, now_us - since_us >= sure_us


def in_the_air(state: FlightState, estimate: StateEstimate) -> FlightState:
    """The state without contact: loops that were open for it are closed again."""
    vehicle = state.vehicle
    if vehicle.unloaded is not None:
        state = without_plan(state, estimate)
    vehicle = replace(vehicle, moved_us=estimate.t_us, unloaded=None)
    return replace(state, vehicle=vehicle)
