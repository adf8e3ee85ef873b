"""Every telemetry stream, read back with pymavlink's generated classes."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.signals import (
    ArmingReport,
    AttitudeSetpoint,
    BatteryWarning,
    ConstraintKind,
    ConstraintReport,
    FlightSnapshot,
    JointSetpoint,
    Mode,
    MotionSetpoint,
    OffboardReport,
    SatelliteFix,
    SensorReport,
    SetpointKind,
    Severity,
    TickOutputs,
)
from fsw.link.telemetry.streams import STREAMS, Stream
from fsw.link.wire import encode_standard
from fsw.link.wire.outgoing import GENERIC
from messages import dialect, status_text
from messages import message_ids as ids
from messages.frames import FrameWriter
from tests.fsw.link.snapshots import ACTUATORS, CONTEXT, REPORT, SNAPSHOT


def read_back(stream: Stream, snapshot: Any = SNAPSHOT) -> Any:
    values = stream.encode(snapshot, CONTEXT)
    assert values is not None
    return decoded(FrameWriter(1, stream.component).frame(stream.message_id, *values))


def decoded(frame: bytes) -> Any:
    (message,) = dialect.MAVLink(None).parse_buffer(bytearray(frame))
    return message


def stream_of(message_id: int) -> Stream:
    return next(stream for stream in STREAMS if stream.message_id == message_id)


# What pymavlink must read for the snapshot, one or a few telling fields a message.
TELLING: dict[int, dict[str, Any]] = {
    ids.HEARTBEAT: {
        "type": 2, "autopilot": 12, "custom_mode": 0x0B040000, "system_status": 4,
        "base_mode": 145,
    },
    ids.SYS_STATUS: {
        "load": 40, "voltage_battery": 15_200, "current_battery": 1_830, "battery_remaining": 62,
    },
    ids.EXTENDED_SYS_STATE: {"landed_state": 2},
    ids.ATTITUDE: {"time_boot_ms": 3004, "yaw": math.pi / 2, "rollspeed": 0.4},
    ids.ATTITUDE_QUATERNION: {"q1": math.sqrt(0.5), "q4": math.sqrt(0.5), "yawspeed": 0.6},
    ids.LOCAL_POSITION_NED: {"x": 1.0, "y": 2.0, "z": -3.0, "vz": 0.3},
    ids.POSITION_TARGET_LOCAL_NED: {"x": 1.1, "vy": 0.21, "afz": 0.32, "yaw": 0.33},
    ids.ATTITUDE_TARGET: {"thrust": 40.0 / 64.0, "type_mask": 7},
    ids.GLOBAL_POSITION_INT: {
        "lat": 473977510, "lon": 85456206, "alt": 3_000, "relative_alt": 2_700, "vx": 10, "vy": 20,
        "vz": 30, "hdg": 9_000,
    },
    ids.VFR_HUD: {
        "groundspeed": math.hypot(0.1, 0.2), "alt": 3.0, "climb": -0.3, "heading": 90,
        "throttle": 62,
    },
    ids.ALTITUDE: {"altitude_amsl": 3.0, "altitude_local": 3.0, "altitude_relative": 2.7},
    ids.HOME_POSITION: {
        "latitude": 473977375, "x": -0.5, "z": -0.3, "altitude": 300, "q": [0.0, 0.0, 0.0, 1.0],
    },
    ids.BATTERY_STATUS: {
        "voltages": [15_200, *[65_535] * 9], "current_battery": 1_830, "current_consumed": 1_900,
        "battery_remaining": 62, "charge_state": 1,
    },
    ids.ESTIMATOR_STATUS: {
        "time_usec": 3_003_000, "flags": 831, "vel_ratio": 0.1, "pos_horiz_ratio": 0.2,
        "pos_vert_ratio": 0.3, "mag_ratio": 0.4, "hagl_ratio": 0.5,
        "pos_horiz_accuracy": math.sqrt(8e-4), "pos_vert_accuracy": math.sqrt(12e-4),
    },
    ids.GPS_RAW_INT: {
        "time_usec": 2_900_000, "fix_type": 5, "vel": 500, "cog": 5313, "eph": 65535,
        "satellites_visible": 14, "alt": 3000, "alt_ellipsoid": 0,
        "h_acc": 12, "v_acc": 20, "vel_acc": 100,
    },
    ids.SYSTEM_TIME: {"time_boot_ms": 3004, "time_unix_usec": 1_750_000_003_004_000},
    ids.MISSION_CURRENT: {
        "seq": 2, "total": 5, "mission_state": 4, "mission_mode": 2,
        "mission_id": 0xDEADBEEF, "fence_id": 7, "rally_points_id": 9,
    },
    ids.CURRENT_MODE: {
        "custom_mode": 0x0B040000, "standard_mode": 0, "intended_custom_mode": 0x0B040000,
    },
    ids.SERVO_OUTPUT_RAW: {
        "servo1_raw": 1500, "servo2_raw": 1250, "servo3_raw": 1750, "servo4_raw": 2000,
        "servo5_raw": 1750, "servo6_raw": 1375, "servo7_raw": 0,
    },
    ids.VIBRATION: {"vibration_y": 0.02, "vibration_z": 0.3, "clipping_0": 17, "clipping_1": 0},
    ids.ORBIT_EXECUTION_STATUS: {
        "radius": -2.5, "x": 473977510, "y": 85456206, "z": 3.0, "frame": 0,
    },
    ids.HIGHRES_IMU: {"xacc": 0.1, "zacc": -9.7, "xgyro": 0.4, "fields_updated": 0x3F, "xmag": 0.0},
    ids.PROTOCOL_VERSION: {"version": 200, "min_version": 100, "max_version": 200},
    ids.ODOMETRY: {"x": 1.0, "vx": 0.2, "vy": -0.1, "vz": 0.3, "rollspeed": 0.4, "frame_id": 1},
    ids.GPS_GLOBAL_ORIGIN: {"latitude": 473977420, "longitude": 85455940, "altitude": 0},
    ids.AUTOPILOT_VERSION: {
        "uid": int.from_bytes(b"PANDION", "big"), "flight_sw_version": 0x01100000,
    },
    ids.ARM_JOINT_STATE: {"joint_count": 2, "time_usec": 3_004_000},
    ids.ARM_JOINT_SETPOINT: {"joint_count": 2},
    ids.END_EFFECTOR_TARGET: {"yaw": 0.3, "coordinate_frame": 1},
    ids.SETPOINT_STATUS: {"accepted": 5, "refused": 2, "age_us": 40_000, "kind": 0, "refusals": 4},
    ids.BARRIER_MARGIN: {
        "margin_min": 0.2, "margin_min_index": 1, "count": 3, "constraint_kind": 1,
        "active_mask": 0b010, "slack_max": 0.25,
        "breaches": 3, "departures": 5, "interventions": 7, "lacking": 0.0625,
        "added": [0.125, 0.25, *[0.0] * 14],
    },
    ids.MPC_STATUS: {
        "plan_id": 7, "total_us": 703, "linearise_us": 101, "solve_us": 502, "budget_us": 10_000,
        "missed_deadlines": 1, "fallbacks": 2, "cost": 12.5, "horizon": 5, "rate_hz": 10,
        "sqp_iterations": 2, "solver_iterations": 19, "solver_status": 4,
    },
    ids.MPC_HORIZON: {
        "time_usec": 3_000_000, "start": [0.0, 0.0, -1.0, *[0.0] * 16], "inputs": [0.0] * 36,
        "plan_id": 7, "period_us": 100_000, "steps": 0,
    },
    ids.TOOL_CONTACT: {
        "force": [-5.0, 0.5, 1.5], "pressed": 5.25, "unsure": 0.375, "commanded": 5.125,
        "asked": 4.75, "force_max": 10.0, "distance": -0.0625, "contact": 1,
    },
    ids.PAYLOAD_STATUS: {"mass": 0.28125, "gripper": 1},
    ids.MPC_HORIZON_ARM: {
        "time_usec": 3_000_000, "position": [0.0] * 8, "velocity": [0.0] * 8,
        "acceleration": [0.0] * 36, "plan_id": 7, "steps": 0, "joint_count": 2,
    },
    ids.LOOP_TIMING: {"ticks": 5000, "late_ticks": 3, "skipped_ticks": 1, "lateness_p99_us": 90.0},
}  # fmt: skip


@pytest.mark.parametrize("message_id", TELLING)
def test_pymavlink_reads_what_was_meant(message_id: int) -> None:
    message = read_back(stream_of(message_id))
    for field, expected in TELLING[message_id].items():
        assert getattr(message, field) == pytest.approx(expected, rel=1e-6), field


def test_every_stream_is_checked_above() -> None:
    assert {stream.message_id for stream in STREAMS} == set(TELLING)


def test_arrays_of_the_arm_hold_two_joints_and_zeros() -> None:
    state = read_back(stream_of(ids.ARM_JOINT_STATE))
    assert state.position == pytest.approx([0.7, 0.8, 0.0, 0.0])
    assert state.torque == pytest.approx([1.0, -0.5, 0.0, 0.0])
    # Body x points east: the arm's reach along x is seen in y, its depth in z.
    reach = 0.15 * (math.sin(0.7) + math.sin(1.5))
    depth = 0.15 * (math.cos(0.7) + math.cos(1.5))
    assert state.ee_position == pytest.approx([1.0, 2.0 + reach, -3.0 + depth])
    setpoint = read_back(stream_of(ids.ARM_JOINT_SETPOINT))
    assert setpoint.acceleration == pytest.approx([0.8, 0.9, 0.0, 0.0])


@pytest.mark.parametrize(
    ("mode", "main", "sub"),
    [
        (Mode.TAKEOFF, 4, 2),
        (Mode.HOLD, 4, 3),
        (Mode.LAND, 4, 6),
        (Mode.TRAJECTORY, 4, 11),
        (Mode.MISSION, 4, 4),
        (Mode.RETURN, 4, 5),
        (Mode.OFFBOARD, 6, 0),
    ],
)
def test_modes_have_the_names_that_px4_gave_them(mode: Mode, main: int, sub: int) -> None:
    message = read_back(stream_of(ids.HEARTBEAT), replace(SNAPSHOT, mode=mode))
    assert message.custom_mode == main << 16 | sub << 24


def test_armed_and_custom_mode_are_flags_of_the_heartbeat() -> None:
    assert read_back(stream_of(ids.HEARTBEAT)).base_mode & 0x81 == 0x81
    disarmed = replace(SNAPSHOT, mode=Mode.DISARMED, armed=False)
    assert read_back(stream_of(ids.HEARTBEAT), disarmed).base_mode & 0x81 == 0x01


def test_a_fault_takes_the_prearm_bit_and_the_suspect_away() -> None:
    healthy = read_back(stream_of(ids.SYS_STATUS))
    assert healthy.onboard_control_sensors_health == healthy.onboard_control_sensors_present
    broken = replace(SNAPSHOT, failures=("state estimate invalid",), estimator=None)
    status = read_back(stream_of(ids.SYS_STATUS), broken)
    lost = status.onboard_control_sensors_present & ~status.onboard_control_sensors_health
    # Nothing is known without an estimate: neither place nor heading nor what feeds them.
    assert lost == 0x10000000 | 0x200000 | 0x80 | 0x27
    assert read_back(stream_of(ids.HEARTBEAT), broken).system_status == 5


_GPS, _MAG = dialect.MAV_SYS_STATUS_SENSOR_GPS, dialect.MAV_SYS_STATUS_SENSOR_3D_MAG
_VISION = dialect.MAV_SYS_STATUS_SENSOR_VISION_POSITION
_PRESSURE = dialect.MAV_SYS_STATUS_SENSOR_ABSOLUTE_PRESSURE
_LASER = dialect.MAV_SYS_STATUS_SENSOR_LASER_POSITION


def bits_with(*sensors: SensorReport, failures: tuple[str, ...] = ()) -> tuple[int, int]:
    """Bits of sensors that are there, and of those that are not well."""
    report = replace(REPORT, sensors=sensors)
    status = read_back(
        stream_of(ids.SYS_STATUS), replace(SNAPSHOT, estimator=report, failures=failures)
    )
    there = status.onboard_control_sensors_present
    assert status.onboard_control_sensors_enabled & ~there == 0
    of_sensors = _GPS | _MAG | _VISION | _PRESSURE | _LASER
    return there & of_sensors, there & ~status.onboard_control_sensors_health & of_sensors


@pytest.mark.parametrize(
    ("sensor", "bit"),
    [
        (Sensor.POSE, _VISION),
        (Sensor.GNSS, _GPS),
        (Sensor.BAROMETER, _PRESSURE),
        (Sensor.MAGNETOMETER, _MAG),
        (Sensor.RANGEFINDER, _LASER),
    ],
)
def test_a_sensor_that_is_heard_has_its_bit_and_one_that_fails_loses_it(
    sensor: Sensor, bit: int
) -> None:
    name, always = sensor.value, _GPS | _MAG  # position and heading are known all the same
    assert bits_with() == (always, 0)
    assert bits_with(SensorReport(name, 8_000)) == (always | bit, 0)
    assert bits_with(SensorReport(name, 8_000, "rate too low")) == (always | bit, 0)
    for fault in ("stale", "stuck", "not finite", "no fix", "too old"):
        assert bits_with(SensorReport(name, 600_000, fault)) == (always | bit, bit)
    # One outlier was refused, or the newest reading is.
    assert bits_with(SensorReport(name, 8_000, "jump", (0.4,))) == (always | bit, 0)
    assert bits_with(SensorReport(name, 8_000, "jump", (0.4, 9.0))) == (always | bit, bit)


def test_satellites_that_are_lost_leave_the_bit_of_vision_alone() -> None:
    silent = SensorReport(Sensor.GNSS.value, 2_000_000, "stale")
    there, ill = bits_with(silent, failures=(Condition.AIDING_LOST.value,))
    assert (there, ill) == (_GPS | _MAG, _GPS)


def test_a_receiver_that_never_had_a_fix_shows_no_place() -> None:
    nowhere = (math.nan,) * 3
    fix = SatelliteFix(2_900_000, nowhere, nowhere, nowhere, math.nan, kind=1, satellites=3)
    known = replace(SNAPSHOT, estimator=replace(REPORT, fix=fix))
    raw = read_back(stream_of(ids.GPS_RAW_INT), known)
    assert (raw.fix_type, raw.satellites_visible, raw.lat, raw.lon, raw.alt) == (1, 3, 0, 0, 0)
    assert (raw.h_acc, raw.v_acc, raw.vel) == (0, 0, 0)


def test_a_place_that_is_known_without_a_receiver_is_a_fix() -> None:
    """dronekit, mavkit and libmav wait for one; the accuracy is that of what was simulated."""
    here = read_back(stream_of(ids.GLOBAL_POSITION_INT))
    for report, accuracy in ((None, (1, 1)), (replace(REPORT, fix=None), (26, 35))):
        raw = read_back(stream_of(ids.GPS_RAW_INT), replace(SNAPSHOT, estimator=report))
        assert (raw.fix_type, raw.satellites_visible) == (3, 255)
        assert (raw.lat, raw.lon, raw.alt) == (here.lat, here.lon, here.alt)
        assert (raw.h_acc, raw.v_acc) == accuracy
        assert (raw.eph, raw.epv, raw.time_usec) == (65535, 65535, SNAPSHOT.t_us)
        assert raw.vel == round(100.0 * math.hypot(*SNAPSHOT.estimate.v_WB[:2]))


@pytest.mark.parametrize(
    "condition", [Condition.AIDING_LOST, Condition.POSITION_LOST, Condition.ESTIMATE_INVALID]
)
def test_a_place_that_nothing_measures_is_no_fix(condition: Condition) -> None:
    for report in (None, replace(REPORT, fix=None)):
        lost = replace(SNAPSHOT, estimator=report, failures=(condition.value,))
        raw = read_back(stream_of(ids.GPS_RAW_INT), lost)
        assert (raw.fix_type, raw.lat, raw.lon, raw.h_acc) == (1, 0, 0, 0)
    never = replace(SNAPSHOT, estimator=replace(REPORT, fix=None, unaided_us=-1), failures=())
    assert read_back(stream_of(ids.GPS_RAW_INT), never).fix_type == 1


def test_a_log_that_fails_takes_its_bit_away() -> None:
    broken = replace(SNAPSHOT, log_failure="flight.ulg ends early")
    status = read_back(stream_of(ids.SYS_STATUS), broken)
    lost = status.onboard_control_sensors_present & ~status.onboard_control_sensors_health
    assert lost == 0x1000000  # MAV_SYS_STATUS_LOGGING


@pytest.mark.parametrize(
    ("sensor", "bits"),
    [
        (
            Sensor.IMU,
            dialect.MAV_SYS_STATUS_SENSOR_3D_GYRO | dialect.MAV_SYS_STATUS_SENSOR_3D_ACCEL,
        ),
        (Sensor.ENCODERS, dialect.MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS),
    ],
)
def test_the_sensor_that_is_lost_is_the_one_that_is_blamed(sensor: Sensor, bits: int) -> None:
    healthy = read_back(stream_of(ids.SYS_STATUS))
    lost = (Condition.SENSOR_LOST.value,)
    status = read_back(
        stream_of(ids.SYS_STATUS), replace(SNAPSHOT, failures=lost, sensors_lost=(sensor.value,))
    )
    blamed = healthy.onboard_control_sensors_health & ~status.onboard_control_sensors_health
    assert blamed == bits | dialect.MAV_SYS_STATUS_PREARM_CHECK


@pytest.mark.parametrize(("left", "told"), [(123.4, 123), (math.inf, 0), (0.2, 0)])
def test_the_flight_time_that_is_left_is_in_seconds_and_0_where_it_is_not_known(
    left: float, told: int
) -> None:
    battery = replace(SNAPSHOT.battery, time_left=left)
    status = read_back(stream_of(ids.BATTERY_STATUS), replace(SNAPSHOT, battery=battery))
    assert status.time_remaining == told


def test_a_descent_is_a_landing_for_a_ground_station() -> None:
    down = replace(SNAPSHOT, mode=Mode.DESCEND)
    assert read_back(stream_of(ids.EXTENDED_SYS_STATE), down).landed_state == 4
    landing = read_back(stream_of(ids.HEARTBEAT), replace(SNAPSHOT, mode=Mode.LAND))
    assert read_back(stream_of(ids.HEARTBEAT), down).custom_mode == landing.custom_mode


def test_the_fence_is_enabled_where_there_is_one_and_healthy_until_it_is_left() -> None:
    fence = 0x100000
    for margins, enabled, healthy in (((), 0, fence), ((0.1,), fence, fence), ((-0.1,), fence, 0)):
        report = replace(SNAPSHOT.constraints, margins=margins)
        status = read_back(stream_of(ids.SYS_STATUS), replace(SNAPSHOT, constraints=report))
        assert status.onboard_control_sensors_enabled & fence == enabled
        assert status.onboard_control_sensors_health & fence == healthy


@pytest.mark.parametrize(
    ("changes", "landed_state"),
    [
        ({"armed": True, "landed": True, "mode": Mode.HOLD}, 1),
        ({"armed": False, "landed": False, "mode": Mode.DISARMED}, 1),
        ({"armed": True, "landed": False, "mode": Mode.HOLD}, 2),
        ({"armed": True, "landed": False, "mode": Mode.TAKEOFF}, 3),
        ({"armed": True, "landed": False, "mode": Mode.LAND}, 4),
    ],
)
def test_landed_state_is_what_clients_wait_for(changes: dict[str, Any], landed_state: int) -> None:
    message = read_back(stream_of(ids.EXTENDED_SYS_STATE), replace(SNAPSHOT, **changes))
    assert message.landed_state == landed_state


def test_there_is_nothing_to_say_before_the_first_plan() -> None:
    idle = replace(SNAPSHOT, plan=None, plan_state=None, plan_input=None, reference=None)
    for message_id in (
        ids.ARM_JOINT_SETPOINT,
        ids.END_EFFECTOR_TARGET,
        ids.MPC_STATUS,
        ids.MPC_HORIZON,
        ids.MPC_HORIZON_ARM,
    ):
        assert stream_of(message_id).encode(idle, CONTEXT) is None


def test_actuators_are_fractions_of_their_limits() -> None:
    airframe = replace(AIRFRAME, rotor_thrust_max=(16.0,) * 4, joint_torque_max=(2.0,) * 2)
    outputs = TickOutputs(ACTUATORS, Mode.HOLD, armed=True)
    values = encode_standard.hil_actuator_controls(airframe, 3_004_000, outputs)
    message = decoded(FrameWriter(1, 1).frame(ids.HIL_ACTUATOR_CONTROLS, *values))
    assert message.time_usec == 3_004_000
    assert message.controls[:6] == pytest.approx([0.5, 0.25, 0.75, 1.0, 0.5, -0.25])
    assert message.mode & 128
    assert message.flags == 1


def test_a_long_text_is_cut_into_numbered_pieces() -> None:
    sentence = "arming refused: " + "ä" * 60
    pieces = [
        decoded(FrameWriter(1, 1).frame(ids.STATUSTEXT, *values))
        for values in status_text.pieces(sentence, Severity.WARNING, 9)
    ]
    assert [piece.chunk_seq for piece in pieces] == list(range(len(pieces)))
    assert {piece.id for piece in pieces} == {9}
    whole = b"".join(values[1] for values in status_text.pieces(sentence, Severity.WARNING, 9))
    assert whole.decode() == sentence


def test_attitude_of_a_level_vehicle_is_level() -> None:
    assert encode_standard.attitude(SNAPSHOT, CONTEXT)[1:3] == pytest.approx((0.0, 0.0))


BODY = MotionSetpoint(False, v=(0.5, 0.25, -0.125), yaw=0.75)
ATTITUDE = AttitudeSetpoint(0.625, None, (0.25, 0.5, -0.5))


def offboard(kind: SetpointKind, **setpoints: Any) -> FlightSnapshot:
    return replace(SNAPSHOT, mode=Mode.OFFBOARD, offboard=OffboardReport(kind, **setpoints))


def test_offboard_the_set_point_that_is_flown_is_sent_back_with_its_mask() -> None:
    flown = offboard(SetpointKind.BODY, motion=BODY)
    message = read_back(stream_of(ids.POSITION_TARGET_LOCAL_NED), flown)
    assert (message.vx, message.vy, message.vz, message.yaw) == (0.5, 0.25, -0.125, 0.75)
    assert (message.type_mask, message.coordinate_frame) == (0x9C7, 1)
    flown = offboard(SetpointKind.ATTITUDE, attitude=ATTITUDE)
    message = read_back(stream_of(ids.ATTITUDE_TARGET), flown)
    assert (message.body_pitch_rate, message.thrust, message.type_mask) == (0.5, 0.625, 0x80)
    point = MotionSetpoint(True, p=(1.0, 2.0, -3.0))
    flown = offboard(SetpointKind.END_EFFECTOR, motion=point, joints=JointSetpoint((0.5, -0.25)))
    message = read_back(stream_of(ids.END_EFFECTOR_TARGET), flown)
    assert (message.time_usec, list(message.position)) == (0, [1.0, 2.0, -3.0])
    assert message.type_mask == 0xDF8
    message = read_back(stream_of(ids.ARM_JOINT_SETPOINT), flown)
    assert list(message.position) == [0.5, -0.25, 0.0, 0.0]


def test_a_generic_autopilot_does_not_say_px4() -> None:
    generic = replace(CONTEXT, autopilot=GENERIC)
    stream = stream_of(ids.HEARTBEAT)
    values = stream.encode(SNAPSHOT, generic)
    assert values is not None
    message = decoded(FrameWriter(1, 1).frame(ids.HEARTBEAT, *values))
    assert message.autopilot == dialect.MAV_AUTOPILOT_GENERIC
    assert message.custom_mode == 0x0B040000  # the modes stay what they are


def test_what_forbids_arming_takes_the_prearm_bit_alone() -> None:
    refused = replace(SNAPSHOT, arming=ArmingReport((5,)))
    status = read_back(stream_of(ids.SYS_STATUS), refused)
    lost = status.onboard_control_sensors_present & ~status.onboard_control_sensors_health
    assert lost == dialect.MAV_SYS_STATUS_PREARM_CHECK


@pytest.mark.parametrize(("charge", "state"), [(0, 1), (1, 2), (2, 3), (3, 4)])
def test_a_battery_that_runs_low_says_so(charge: int, state: int) -> None:
    low = replace(SNAPSHOT, battery=replace(SNAPSHOT.battery, charge=BatteryWarning(charge)))
    assert read_back(stream_of(ids.BATTERY_STATUS), low).charge_state == state


def test_without_a_home_there_is_no_home_position() -> None:
    assert stream_of(ids.HOME_POSITION).encode(replace(SNAPSHOT, home=None), CONTEXT) is None


@pytest.mark.parametrize(
    ("changes", "base_mode", "status"),
    [
        ({"mode": Mode.DISARMED, "armed": False}, 29, 3),
        ({"mode": Mode.DISARMED, "armed": False, "arming": ArmingReport((5,))}, 29, 0),
        ({"mode": Mode.DISARMED, "armed": False, "intended_mode": Mode.OFFBOARD}, 17, 3),
        ({"mode": Mode.DISARMED, "armed": False, "failures": ("x",)}, 29, 0),
        ({"mode": Mode.HOLD}, 157, 4),
        ({"mode": Mode.DESCEND, "failsafe_from": Mode.HOLD}, 157, 5),
        ({"mode": Mode.ORBIT}, 157, 4),
        ({"mode": Mode.OFFBOARD}, 145, 4),
        ({"mode": Mode.HOLD, "failsafe_from": Mode.OFFBOARD}, 157, 5),
        ({"mode": Mode.HOLD, "failures": ("x",)}, 157, 5),
        ({"mode": Mode.FAULT, "armed": False}, 29, 8),
    ],
)
def test_base_mode_and_status_are_those_of_a_px4(
    changes: dict[str, Any], base_mode: int, status: int
) -> None:
    """29/157 in automatic modes, 17/145 where something outside steers; 0 if it cannot be armed."""
    beat = read_back(stream_of(ids.HEARTBEAT), replace(SNAPSHOT, **changes))
    assert (beat.base_mode, beat.system_status) == (base_mode, status)


def test_what_a_failsafe_took_over_from_is_the_intended_mode() -> None:
    seen = replace(SNAPSHOT, mode=Mode.HOLD, failsafe_from=Mode.OFFBOARD)
    mode = read_back(stream_of(ids.CURRENT_MODE), seen)
    assert (mode.custom_mode, mode.intended_custom_mode) == (0x03040000, 0x00060000)


def test_without_a_plan_the_position_target_says_to_ignore_all_of_it() -> None:
    resting = replace(SNAPSHOT, plan_state=None)
    assert read_back(stream_of(ids.POSITION_TARGET_LOCAL_NED), resting).type_mask == 0xDFF


def test_without_an_orbit_there_is_no_orbit_status() -> None:
    encode = stream_of(ids.ORBIT_EXECUTION_STATUS).encode
    assert encode(replace(SNAPSHOT, orbit=None), CONTEXT) is None


def test_disarmed_no_pulse_is_sent() -> None:
    outputs = read_back(stream_of(ids.SERVO_OUTPUT_RAW), replace(SNAPSHOT, armed=False))
    assert outputs.servo1_raw == outputs.servo5_raw == 0


def test_margins_of_three_points_are_all_sent_while_they_fit_else_one_a_zone() -> None:
    kind = ConstraintKind.WALLS
    five = ConstraintReport(kind, tuple(range(1, 16)), tuple(range(15)), (3,) * 5)
    assert five.shown(16) == (five.margins, five.barrier, 0)
    six = ConstraintReport(kind, (*range(2, 19), 1), tuple(range(18)), (3,) * 6)
    assert six.shown(16) == ((2, 5, 8, 11, 14, 1), (0, 3, 6, 9, 12, 15), 5)


def test_margins_of_the_full_body_are_the_least_of_each_zone_and_the_least_of_all() -> None:
    kind = ConstraintKind.OBSTACLES
    one = ConstraintReport(kind, (3.0, 1.0, 2.0, 4.0), (9.0, 8.0, 7.0, 6.0), (4,))
    assert one.shown(16) == ((1.0,), (6.0,), 0)
    many = ConstraintReport(kind, tuple(map(float, range(80, 0, -1))), (1.0,) * 80, (4,) * 20)
    margins, _, least = many.shown(16)
    assert margins == tuple(float(80 - 4 * k - 3) for k in range(16))
    assert least == 19
    sent = read_back(stream_of(ids.BARRIER_MARGIN), replace(SNAPSHOT, constraints=many))
    assert (sent.count, sent.margin_min, sent.margin_min_index) == (16, 1.0, 19)
