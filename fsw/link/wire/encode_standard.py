"""Standard MAVLink messages from the vehicle's snapshot, and replies; pure.

Each encoder of a snapshot returns every field of its message in wire order (larger types first, see
``messages.frames.wire_fields``), or None when there is nothing to say yet.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.control.pid import attitude_reference
from fsw.autopilot.geometry.geodesy import to_global
from fsw.autopilot.geometry.rotation import euler_zyx, quaternion_from_euler, quaternion_from_matrix
from fsw.autopilot.model.airframe import Airframe
from fsw.autopilot.signals import (
    CommandAck,
    FlightSnapshot,
    MissionProgress,
    MissionState,
    Mode,
    MotionSetpoint,
    SetpointKind,
    TickOutputs,
    Vec3,
)
from fsw.link.wire.identity import custom_mode, shown_mode
from fsw.link.wire.outgoing import PX4, PlanIds, TelemetryContext, WireValues

_ARMED: Final = 128  # MAV_MODE_FLAG
_CUSTOM_MODE: Final = 1
_AUTO, _GUIDED, _STABILISED = 4, 8, 16
_BY_ITSELF: Final = _CUSTOM_MODE | _AUTO | _GUIDED | _STABILISED
_GUIDED_FROM_OUTSIDE: Final = _CUSTOM_MODE | _STABILISED
# As PX4 sets them: 29 in its automatic modes, 17 where something outside steers.
_BASE_MODES: Final = {Mode.OFFBOARD: _GUIDED_FROM_OUTSIDE, Mode.TRAJECTORY: _GUIDED_FROM_OUTSIDE}
_UNINIT, _STANDBY, _ACTIVE, _CRITICAL, _TERMINATED = 0, 3, 4, 5, 8  # MAV_STATE
_MAVLINK_VERSION: Final = 3
_LOCAL_NED: Final = 1  # MAV_FRAME
_GLOBAL: Final = 0  # MAV_FRAME
_ACCEL_AND_GYRO: Final = 0x3F  # HIGHRES_IMU_UPDATED_FLAGS
_ON_GROUND, _IN_AIR, _TAKEOFF, _LANDING = 1, 2, 3, 4  # MAV_LANDED_STATE
_LANDED_STATES: Final = {
    Mode.TAKEOFF: _TAKEOFF,
    Mode.LAND: _LANDING,
    Mode.DESCEND: _LANDING,
}
_BODY_NED: Final = 8
_IGNORE_ALL: Final = 0xDFF  # POSITION_TARGET_TYPEMASK, all but the flag of forces
_RATES_IGNORED: Final = 0x07  # ATTITUDE_TARGET_TYPEMASK
_ATTITUDE_IGNORED: Final = 0x80
_ZERO: Final[Vec3] = (0.0, 0.0, 0.0)
_U32: Final = 0xFFFFFFFF
_LOCKSTEP: Final = 1  # HIL_ACTUATOR_CONTROLS_FLAGS
_CONTROLS: Final = 16  # of a HIL_ACTUATOR_CONTROLS
_NO_MISSION: Final = 0xFFFF  # in place of a total; 0 would mean that totals are not supported
_FLYING, _SUSPENDED = 1, 2  # mission_mode


def heartbeat(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """HEARTBEAT in PX4's format; the reported autopilot is configurable."""
    shown = shown_mode(snapshot)
    base_mode = _BASE_MODES.get(shown, _BY_ITSELF) | (_ARMED if snapshot.armed else 0)
    if snapshot.mode is Mode.FAULT:
        status = _TERMINATED
    elif snapshot.armed:
        acts = snapshot.failures or snapshot.failsafe_from is not None
        status = _CRITICAL if acts else _ACTIVE
    else:
        status = _UNINIT if snapshot.arming.failed or snapshot.failures else _STANDBY
    return (
        custom_mode(shown),
        context.facts.airframe.mav_type,
        context.autopilot,
        base_mode,
        status,
        _MAVLINK_VERSION,
    )


def extended_sys_state(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """EXTENDED_SYS_STATE: no VTOL, on the ground or what the mode is doing."""
    if snapshot.landed or not snapshot.armed:
        return (0, _ON_GROUND)
    return (0, _LANDED_STATES.get(snapshot.mode, _IN_AIR))


def system_time(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """SYSTEM_TIME: the wall time of the start plus sensor time, as in the log."""
    return (context.start_unix_us + snapshot.t_us, boot_ms(snapshot.t_us))


def attitude(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """ATTITUDE."""
    estimate = snapshot.estimate
    return (boot_ms(snapshot.t_us), *euler_zyx(estimate.R_WB), *estimate.w_WB_B)


def attitude_quaternion(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """ATTITUDE_QUATERNION; no offset for display."""
    quaternion = quaternion_from_matrix(snapshot.estimate.R_WB)
    rates = snapshot.estimate.w_WB_B
    return (boot_ms(snapshot.t_us), *quaternion, *rates, 0.0, 0.0, 0.0, 0.0)


def local_position(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """LOCAL_POSITION_NED of the body origin."""
    return (boot_ms(snapshot.t_us), *snapshot.estimate.p_WB, *snapshot.estimate.v_WB)


def position_target(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """POSITION_TARGET_LOCAL_NED: the setpoint flown, or where the plan wants the body now."""
    plan, offboard = snapshot.plan_state, snapshot.offboard
    if offboard.kind is SetpointKind.BODY and offboard.motion is not None:
        numbers, mask = as_asked(offboard.motion)
        frame = _BODY_NED if offboard.motion.along_heading else _LOCAL_NED
        return (boot_ms(snapshot.t_us), *numbers, mask, frame)
    if plan is None:
        # Nothing is followed: the stream goes on, as PX4's does, and says to ignore all of it.
        return (boot_ms(snapshot.t_us), *(0.0,) * 11, _IGNORE_ALL, _LOCAL_NED)
    motion = (*plan.p, *plan.v, *plan.a)
    return (boot_ms(snapshot.t_us), *motion, plan.yaw, plan.yaw_rate, 0, _LOCAL_NED)


def attitude_target(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """ATTITUDE_TARGET: the setpoint flown, or attitude reference and thrust, 0 to 1."""
    asked = snapshot.offboard.attitude
    if snapshot.offboard.kind is SetpointKind.ATTITUDE and asked is not None:
        mask = _RATES_IGNORED if asked.w_WB_B is None else _ATTITUDE_IGNORED
        rates, attitude = asked.w_WB_B or _ZERO, asked.q_WB or (1.0, 0.0, 0.0, 0.0)
        return (boot_ms(snapshot.t_us), *attitude, *rates, asked.thrust, mask)
    thrust = context.facts.thrust_share(snapshot.actuators)
    plan, u = snapshot.plan_state, snapshot.plan_input
    yaw = snapshot.estimate.yaw if plan is None else plan.yaw
    quaternion = quaternion_from_euler(
        attitude_reference((0.0, 0.0, 0.0) if u is None else u.a, yaw)
    )
    return (boot_ms(snapshot.t_us), *quaternion, 0.0, 0.0, 0.0, thrust, _RATES_IGNORED)


def servo_outputs(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """SERVO_OUTPUT_RAW: rotors, then joints, as pulse lengths 1000 to 2000 us.

    A rotor's is its share of full thrust, a joint's its torque about 1500.
    """
    thrusts, torques = context.facts.airframe.shares(snapshot.actuators)
    pulses = [0] * (len(thrusts) + len(torques))
    if snapshot.armed:
        pulses = [1000 + round(1000.0 * f) for f in thrusts]
        pulses += [1500 + round(500.0 * t) for t in torques]
    first, second = pulses[:8], pulses[8:]
    rest = (*first, *(0,) * (8 - len(first))), (*second, *(0,) * (8 - len(second)))
    return (snapshot.t_us & _U32, *rest[0], 0, *rest[1])


def highres_imu(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """HIGHRES_IMU: accelerometer and gyro; nothing else is there."""
    accel, gyro = snapshot.accel_B, snapshot.estimate.w_WB_B
    nothing = (0.0,) * 7
    return (snapshot.t_us, *accel, *gyro, *nothing, _ACCEL_AND_GYRO, 0)


def orbit_status(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues | None:
    """ORBIT_EXECUTION_STATUS: the circle that is flown, while one is; radius < 0 to the left."""
    orbit = snapshot.orbit
    if orbit is None:
        return None
    latitude, longitude, altitude = to_global(context.origin, orbit.centre)
    radius = orbit.radius if orbit.clockwise else -orbit.radius
    place = (round(1e7 * latitude), round(1e7 * longitude), altitude)
    return (snapshot.t_us, radius, *place, _GLOBAL)


def mission_current(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """MISSION_CURRENT of a snapshot."""
    return current_values(snapshot.mission, snapshot.mode is Mode.MISSION, context.plan_ids)


def current_values(progress: MissionProgress, in_mission: bool, plans: PlanIds) -> WireValues:
    """MISSION_CURRENT."""
    which = (plans[0], plans[1], plans[2])
    if progress.state is MissionState.NO_MISSION:
        return (0, _NO_MISSION, int(progress.state), _SUSPENDED, *which)
    mode = _FLYING if in_mission else _SUSPENDED
    return (progress.current, progress.total, int(progress.state), mode, *which)


def vehicle_heartbeat(mode: Mode, mav_type: int, *, armed: bool) -> WireValues:
    """HEARTBEAT to who looks at the mode alone: the simulator, or an arm."""
    state = _ACTIVE if armed else _STANDBY
    return (custom_mode(mode), mav_type, PX4, _flags(armed), state, _MAVLINK_VERSION)


def command_ack(ack: CommandAck) -> WireValues:
    """COMMAND_ACK: no progress, no detail."""
    return (ack.command, ack.result, 0, 0, ack.target_system, ack.target_component)


def hil_actuator_controls(airframe: Airframe, t_us: int, outputs: TickOutputs) -> WireValues:
    """HIL_ACTUATOR_CONTROLS, the answer to a HIL_SENSOR of ``t_us`` [us].

    Rotors come first, then joints, each as a share of its largest value; the last control is the
    gripper: 1 closes, -1 opens.
    """
    thrust, torque = airframe.shares(outputs.actuators)
    unused = (0.0,) * (_CONTROLS - 1 - len(thrust) - len(torque))
    mode = _flags(outputs.armed)
    return (t_us, _LOCKSTEP, *thrust, *torque, *unused, outputs.gripper, mode)


def _flags(armed: bool) -> int:
    return _CUSTOM_MODE | (_ARMED if armed else 0)


def as_asked(motion: MotionSetpoint) -> tuple[tuple[float, ...], int]:
    """A setpoint as it came: position to yaw rate, and POSITION_TARGET_TYPEMASK."""
    open_axes = (math.nan,) * 3
    vectors = [vector or open_axes for vector in (motion.p, motion.v, motion.a)]
    numbers = [number for vector in vectors for number in vector]
    mask = sum(1 << bit for bit, number in enumerate(numbers) if math.isnan(number))
    mask |= (0x400 if motion.yaw is None else 0) | (0x800 if motion.yaw_rate is None else 0)
    used = [0.0 if math.isnan(number) else number for number in numbers]
    return (*used, motion.yaw or 0.0, motion.yaw_rate or 0.0), mask


def boot_ms(t_us: int) -> int:
    """Milliseconds of the vehicle's time ``t_us`` [us], as MAVLink counts them."""
    return (t_us // 1000) & _U32
