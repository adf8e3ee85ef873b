"""Standard MAVLink messages from the vehicle's snapshot; pure.

Each encoder returns every field of its message in wire order (larger types first, see
``messages.frames.wire_fields``), or None when there is nothing to say yet.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.control.attitude import attitude_reference
from fsw.geometry.rotation import euler_zyx, quaternion_from_matrix
from fsw.link.wire.encode_setpoints import as_asked
from fsw.link.wire.outgoing import WireValues
from fsw.link.wire.px4_mode import custom_mode, shown_mode
from fsw.link.wire.telemetry_context import TelemetryContext
from fsw.signals import FlightSnapshot, Mode, SetpointKind, Vec3, Vec4

_QUADROTOR: Final = 2  # MAV_TYPE
_ARMED: Final = 128  # MAV_MODE_FLAG
_GUIDED: Final = 8
_STABILISED: Final = 16
_CUSTOM_MODE: Final = 1
_STANDBY, _ACTIVE, _CRITICAL, _TERMINATED = 3, 4, 5, 8  # MAV_STATE
_MAVLINK_VERSION: Final = 3
_LOCAL_NED: Final = 1  # MAV_FRAME
_ON_GROUND, _IN_AIR, _TAKEOFF, _LANDING = 1, 2, 3, 4  # MAV_LANDED_STATE
_BODY_NED: Final = 8
_RATES_IGNORED: Final = 0x07  # ATTITUDE_TARGET_TYPEMASK
_ATTITUDE_IGNORED: Final = 0x80
_ZERO: Final[Vec3] = (0.0, 0.0, 0.0)
_U32: Final = 0xFFFFFFFF


def heartbeat(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """HEARTBEAT as PX4 would send it, under whatever autopilot's name."""
    base_mode = _CUSTOM_MODE | _STABILISED | _GUIDED | (_ARMED if snapshot.armed else 0)
    if snapshot.mode is Mode.FAULT:
        status = _TERMINATED
    elif snapshot.failures:
        status = _CRITICAL
    else:
        status = _ACTIVE if snapshot.armed else _STANDBY
    return (
        custom_mode(shown_mode(snapshot)),
        _QUADROTOR,
        context.autopilot,
        base_mode,
        status,
        _MAVLINK_VERSION,
    )


def extended_sys_state(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """EXTENDED_SYS_STATE: no VTOL, on the ground or what the mode is doing."""
    if snapshot.landed or not snapshot.armed:
        return (0, _ON_GROUND)
    return (0, {Mode.TAKEOFF: _TAKEOFF, Mode.LAND: _LANDING}.get(snapshot.mode, _IN_AIR))


def system_time(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """SYSTEM_TIME: the wall time of the start plus sensor time, as in the log."""
    return (context.start_unix_us + snapshot.t_us, _boot_ms(snapshot.t_us))


def attitude(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """ATTITUDE."""
    estimate = snapshot.estimate
    return (_boot_ms(snapshot.t_us), *euler_zyx(estimate.R_WB), *estimate.w_WB_B)


def attitude_quaternion(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """ATTITUDE_QUATERNION; no offset for display."""
    quaternion = quaternion_from_matrix(snapshot.estimate.R_WB)
    rates = snapshot.estimate.w_WB_B
    return (_boot_ms(snapshot.t_us), *quaternion, *rates, 0.0, 0.0, 0.0, 0.0)


def local_position(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """LOCAL_POSITION_NED of the body origin."""
    return (_boot_ms(snapshot.t_us), *snapshot.estimate.p_WB, *snapshot.estimate.v_WB)


def position_target(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues | None:
    """POSITION_TARGET_LOCAL_NED: the set-point flown, or where the plan wants the body now."""
    plan, offboard = snapshot.plan_state, snapshot.offboard
    if offboard.kind is SetpointKind.BODY and offboard.motion is not None:
        numbers, mask = as_asked(offboard.motion)
        frame = _BODY_NED if offboard.motion.along_heading else _LOCAL_NED
        return (_boot_ms(snapshot.t_us), *numbers, mask, frame)
    if plan is None:
        return None
    motion = (*plan.p, *plan.v, *plan.a)
    return (_boot_ms(snapshot.t_us), *motion, plan.yaw, plan.yaw_rate, 0, _LOCAL_NED)


def attitude_target(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """ATTITUDE_TARGET: the set-point flown, or attitude reference and thrust, 0 to 1."""
    asked = snapshot.offboard.attitude
    if snapshot.offboard.kind is SetpointKind.ATTITUDE and asked is not None:
        mask = _RATES_IGNORED if asked.w_WB_B is None else _ATTITUDE_IGNORED
        rates, attitude = asked.w_WB_B or _ZERO, asked.q_WB or (1.0, 0.0, 0.0, 0.0)
        return (_boot_ms(snapshot.t_us), *attitude, *rates, asked.thrust, mask)
    thrust = sum(snapshot.actuators.rotor_thrust) / (4.0 * context.facts.rotor_thrust_max)
    plan, u = snapshot.plan_state, snapshot.plan_input
    yaw = snapshot.estimate.yaw if plan is None else plan.yaw
    quaternion = _quaternion(attitude_reference((0.0, 0.0, 0.0) if u is None else u.a, yaw))
    return (_boot_ms(snapshot.t_us), *quaternion, 0.0, 0.0, 0.0, thrust, _RATES_IGNORED)


def _boot_ms(t_us: int) -> int:
    return (t_us // 1000) & _U32


def _quaternion(euler: Vec3) -> Vec4:
    """Quaternion [w, x, y, z] of ZYX Euler angles [rad]."""
    cr, cp, cy = (math.cos(0.5 * angle) for angle in euler)
    sr, sp, sy = (math.sin(0.5 * angle) for angle in euler)
    return (
        cr * cp * cy + sr * sp * sy,
        sr * cp * cy - cr * sp * sy,
        cr * sp * cy + sr * cp * sy,
        cr * cp * sy - sr * sp * cy,
    )
