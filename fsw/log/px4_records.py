"""Records of the topics that PX4's tools draw, and the rate of each."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, Final

from fsw.autopilot.control.pid import attitude_reference
from fsw.autopilot.estimation.vibration import VibrationMeter
from fsw.autopilot.flight.estimate.estimator_report import (
    ABSOLUTE,
    HEIGHT,
    LEVEL_VELOCITY,
    RELATIVE,
)
from fsw.autopilot.flight.estimate.estimator_report import VERTICAL_VELOCITY as CLIMB
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.geometry.geodesy import DEFAULT_ORIGIN, to_global
from fsw.autopilot.geometry.rotation import quaternion_from_euler
from fsw.autopilot.geometry.vectors import dot
from fsw.autopilot.model.airframe import GRAVITY, Airframe
from fsw.autopilot.signals import (
    FlightSnapshot,
    Origin,
    PredictionState,
    RotorVector,
    Vec3,
)
from fsw.log.packed import Packed

_TORQUE_US: Final = 10_000
_SETPOINTS_US: Final = 50_000
_PLACE_US: Final = 200_000
_SECOND_US: Final = 1_000_000
_FIX_3D: Final = 3  # GPS_FIX_TYPE
_NAN: Final = math.nan
_POSITION_LOST: Final = frozenset(
    {Condition.ESTIMATE_INVALID.value, Condition.POSITION_LOST.value, Condition.ATTITUDE_LOST.value}
)
_ATTITUDE_LOST: Final = frozenset({Condition.ESTIMATE_INVALID.value, Condition.ATTITUDE_LOST.value})
_ROTOR: Final = frozenset({Condition.ROTOR_LOST.value, Condition.ROTOR_FAILED.value})

_TORQUE: Final = Packed("vehicle_torque_setpoint")
_THRUST: Final = Packed("vehicle_thrust_setpoint")
_ATTITUDE: Final = Packed("vehicle_attitude_setpoint", "vehicle_rates_setpoint")
_PLACE: Final = Packed("vehicle_global_position", "vehicle_gps_position")
_SLOW: Final = Packed("battery_status", "vehicle_imu_status")
_FLAGS: Final = Packed("failsafe_flags")
_LOAD: Final = Packed("cpuload")


class Px4Records:
    """Remembers what was told of failures, and how much the inertial unit shakes."""

    def __init__(self, airframe: Airframe, origin: Origin) -> None:
        # Of each rotor's thrust [1/N], the share of the largest torque about x, y and z, and of
        # the largest thrust.
        rows = [airframe.wrench[6 * i : 6 * i + 6] for i in range(airframe.rotors)]
        self._of_torque = [_shares([row[3 + axis] for row in rows], airframe) for axis in range(3)]
        self._of_thrust = _shares([-row[2] for row in rows], airframe)
        self._origin = origin
        self._failures: tuple[str, ...] = ()  # as told last
        self.vibration = VibrationMeter()

    def rows(self) -> list[tuple[int, Callable[[FlightSnapshot], bytes]]]:
        """What has a rate, with its interval [us]."""
        return [
            (_TORQUE_US, self._torques),
            (_SETPOINTS_US, self._setpoint_records),
            (_PLACE_US, lambda snapshot: _place(snapshot, self._origin)),
            (_SECOND_US, lambda snapshot: self._slow(snapshot) + self._flags(snapshot)),
        ]

    def news(self, snapshot: FlightSnapshot) -> bytes:
        """What is to be told at once: other failures than before."""
        return self._flags(snapshot) if snapshot.failures != self._failures else b""

    def _flags(self, snapshot: FlightSnapshot) -> bytes:
        self._failures = snapshot.failures
        active = frozenset(snapshot.failures)
        level, height, level_speed, climb = validity(snapshot)
        charge = int(snapshot.battery.charge)
        return _FLAGS.pack(
            snapshot.t_us,
            (
                *(not _ATTITUDE_LOST.isdisjoint(active), not height),
                *(not level, not (level_speed and climb)),
                snapshot.mission.total == 0,
                Condition.SETPOINTS_LOST.value in active,
                Condition.DATALINK_LOST.value in active,
                charge,
                Condition.FLIGHT_TIME_LOW.value in active,
                Condition.FENCE_BREACH.value in active,
                Condition.TILT_LOST.value in active,
                not _ROTOR.isdisjoint(active),
            ),
        )

    def _torques(self, snapshot: FlightSnapshot) -> bytes:
        thrust = snapshot.actuators.rotor_thrust
        torque = [_sum(shares, thrust) for shares in self._of_torque]
        return _TORQUE.pack(snapshot.t_us, torque)

    def _setpoint_records(self, snapshot: FlightSnapshot) -> bytes:
        t_us = snapshot.t_us
        thrust = (0.0, 0.0, -_sum(self._of_thrust, snapshot.actuators.rotor_thrust))
        found = _THRUST.pack(t_us, thrust)
        plan = snapshot.plan_state
        if plan is None:
            return found
        # Of the attitude for the acceleration in force.
        a = plan.a if snapshot.plan_input is None else snapshot.plan_input.a
        q = quaternion_from_euler(attitude_reference(a, plan.yaw))
        attitude = (*q, plan.yaw_rate, *thrust)
        return found + _ATTITUDE.pack(t_us, attitude, (*planned_rates(plan), *thrust))

    def _slow(self, snapshot: FlightSnapshot) -> bytes:
        battery = snapshot.battery
        left = battery.time_left if math.isfinite(battery.time_left) else _NAN
        status = (
            *(battery.voltage, battery.current, 1e3 * battery.consumed),
            *(battery.remaining, left, int(battery.charge)),
        )
        gyro, accel = self.vibration.metrics
        return _SLOW.pack(snapshot.t_us, status, (accel, gyro))


def origin_of(numbers: Mapping[str, float]) -> Origin:
    """Where the local frame begins, by the numbers of a configuration."""
    names = [f"origin.{part.name}" for part in fields(Origin)]
    if not all(name in numbers for name in names):
        return DEFAULT_ORIGIN
    return Origin(*(float(numbers[name]) for name in names))


def cpu_load(t_us: int, load: float, memory: float) -> bytes:
    """A record of cpuload: the ``load`` [1] of the tick, and the share of ``memory`` [1]."""
    return _LOAD.pack(t_us, (load, memory))


def validity(snapshot: FlightSnapshot) -> tuple[bool, bool, bool, bool]:
    """Whether level position, height, level velocity and climb are known, as PX4 says it."""
    if not _POSITION_LOST.isdisjoint(snapshot.failures):
        return False, False, False, False
    known = snapshot.estimator
    if known is None:
        return True, True, True, True
    flags = known.flags
    return (
        bool(flags & (RELATIVE | ABSOLUTE)),
        bool(flags & HEIGHT),
        bool(flags & LEVEL_VELOCITY),
        bool(flags & CLIMB),
    )


def planned_rates(plan: PredictionState) -> Vec3:
    """Body rates [rad/s, FRD] that turn the thrust as a plan's acceleration and jerk say."""
    roll, pitch, _ = attitude_reference(plan.a, plan.yaw)
    # The body's z axis is along the specific force that is to be given, which turns with the jerk.
    sr, cr, sp, cp = math.sin(roll), math.cos(roll), math.sin(pitch), math.cos(pitch)
    sy, cy = math.sin(plan.yaw), math.cos(plan.yaw)
    x = (cp * cy, cp * sy, -sp)
    y = (sr * sp * cy - cr * sy, sr * sp * sy + cr * cy, sr * cp)
    force = math.hypot(plan.a[0], plan.a[1], GRAVITY - plan.a[2])
    if not force > 0.0 or not abs(cr) > 0.0:
        return _NAN, _NAN, _NAN
    turning = (-plan.j[0] / force, -plan.j[1] / force, 0.0)
    p, q = -dot(turning, y), dot(turning, x)
    return p, q, (plan.yaw_rate * cp - q * sr) / cr


def _shares(effects: list[float], airframe: Airframe) -> list[float]:
    """Effects of each rotor's thrust over the largest that all of them have together [1/N]."""
    tops = airframe.rotor_thrust_max
    most = sum(top * max(one, 0.0) for top, one in zip(tops, effects, strict=False))
    return [one / most if most > 0.0 else 0.0 for one in effects]


def _sum(shares: list[float], thrust: RotorVector) -> float:
    return sum([share * f for share, f in zip(shares, thrust, strict=True)])


def _place(snapshot: FlightSnapshot, origin: Origin) -> bytes:
    known = snapshot.estimator
    here = _on_earth(origin, snapshot.estimate.p_WB)
    level, vertical = (
        (_NAN, _NAN) if known is None else (known.level_accuracy, known.vertical_accuracy)
    )
    north, east, _ = snapshot.estimate.v_WB
    reading: tuple[Any, ...] = (*here, level, vertical, _NAN, _NAN, _NAN, math.hypot(north, east))
    kind, satellites = (_FIX_3D if validity(snapshot)[0] else 1), 0
    fix = None if known is None else known.fix
    if fix is not None:
        sigma = fix.position_sigma
        reading = (
            *(*_on_earth(origin, fix.p), math.hypot(sigma[0], sigma[1]), sigma[2], _NAN, _NAN),
            *(fix.velocity_sigma, math.hypot(fix.v[0], fix.v[1])),
        )
        kind, satellites = fix.kind & 0xFF, fix.satellites & 0xFF
    return _PLACE.pack(snapshot.t_us, (*here, level, vertical), (*reading, kind, satellites))


def _on_earth(origin: Origin, p: Vec3) -> Vec3:
    """Latitude and longitude [deg] and altitude [m]; NaN where ``p`` [m, NED] is not known."""
    if not all(map(math.isfinite, p)):
        return _NAN, _NAN, _NAN
    return to_global(origin, p)
