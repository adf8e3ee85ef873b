"""What is sent to the ground, and how often by default: one table for both links.

Rates are counted in sensor time, so they are the same in real time and in lockstep at any speed.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from fsw.autopilot.signals import FlightSnapshot
from fsw.link.files.vehicle_files import component_metadata
from fsw.link.wire import (
    encode_dialect,
    encode_health,
    encode_place,
    encode_standard,
    identity,
)
from fsw.link.wire.outgoing import Outgoing, TelemetryContext, WireValues
from messages import message_ids
from messages.message_ids import AUTOPILOT, PANDION

Encoder = Callable[[FlightSnapshot, TelemetryContext], WireValues | None]
Answerer = Callable[[float, FlightSnapshot, TelemetryContext], Sequence[Outgoing]]


@dataclass(frozen=True, slots=True)
class Stream:
    """One message from one component; a rate of 0 sends it on request only."""

    message_id: int
    ground_hz: float  # to ground stations
    api_hz: float  # to programs
    encode: Encoder
    component: int = AUTOPILOT

    @property
    def vital(self) -> bool:
        """Whether it says what the vehicle is and does: it is sent even where a line is full."""
        return self.message_id in _VITAL


# First on a line that is too slow for all.
_VITAL: Final = frozenset(
    (
        message_ids.HEARTBEAT,
        message_ids.SYS_STATUS,
        message_ids.EXTENDED_SYS_STATE,
        message_ids.CURRENT_MODE,
        message_ids.BATTERY_STATUS,
        message_ids.MISSION_CURRENT,
    )
)

HEARTBEAT: Final = Stream(message_ids.HEARTBEAT, 1, 1, encode_standard.heartbeat)
_CURRENT_MODE = Stream(message_ids.CURRENT_MODE, 0.5, 0.5, identity.current_mode)
_EXTENDED_STATE = Stream(message_ids.EXTENDED_SYS_STATE, 1, 5, encode_standard.extended_sys_state)

STREAMS: Final = (
    HEARTBEAT,
    Stream(message_ids.SYS_STATUS, 2, 2, encode_health.sys_status),
    _EXTENDED_STATE,
    Stream(message_ids.ATTITUDE, 50, 50, encode_standard.attitude),
    Stream(message_ids.ATTITUDE_QUATERNION, 10, 50, encode_standard.attitude_quaternion),
    Stream(message_ids.LOCAL_POSITION_NED, 30, 50, encode_standard.local_position),
    Stream(message_ids.GLOBAL_POSITION_INT, 5, 10, encode_place.global_position),
    Stream(message_ids.POSITION_TARGET_LOCAL_NED, 10, 10, encode_standard.position_target),
    Stream(message_ids.ATTITUDE_TARGET, 10, 10, encode_standard.attitude_target),
    Stream(message_ids.VFR_HUD, 4, 4, encode_place.vfr_hud),
    Stream(message_ids.ALTITUDE, 1, 2, encode_place.altitude),
    Stream(message_ids.MISSION_CURRENT, 1, 1, encode_standard.mission_current),
    Stream(message_ids.HOME_POSITION, 0.5, 1, encode_place.home_position),
    Stream(message_ids.BATTERY_STATUS, 1, 1, encode_health.battery_status),
    Stream(message_ids.ESTIMATOR_STATUS, 1, 1, encode_health.estimator_status),
    Stream(message_ids.SYSTEM_TIME, 1, 1, encode_standard.system_time),
    _CURRENT_MODE,
    Stream(message_ids.SERVO_OUTPUT_RAW, 5, 5, encode_standard.servo_outputs),
    Stream(message_ids.VIBRATION, 0.5, 0.5, encode_health.vibration),
    Stream(message_ids.ORBIT_EXECUTION_STATUS, 2, 2, encode_standard.orbit_status),
    Stream(message_ids.ODOMETRY, 0, 30, encode_place.odometry),
    Stream(message_ids.HIGHRES_IMU, 0, 50, encode_standard.highres_imu),
    Stream(message_ids.PROTOCOL_VERSION, 0, 0, identity.protocol_version),
    Stream(message_ids.GPS_GLOBAL_ORIGIN, 0, 0, encode_place.global_origin),
    Stream(message_ids.AUTOPILOT_VERSION, 0, 0, identity.autopilot_version),
    Stream(message_ids.ARM_JOINT_STATE, 30, 50, encode_dialect.arm_joint_state, PANDION),
    Stream(message_ids.ARM_JOINT_SETPOINT, 10, 10, encode_dialect.arm_joint_setpoint, PANDION),
    Stream(message_ids.END_EFFECTOR_TARGET, 10, 10, encode_dialect.end_effector_target, PANDION),
    Stream(message_ids.SETPOINT_STATUS, 5, 5, encode_dialect.setpoint_status, PANDION),
    Stream(message_ids.BARRIER_MARGIN, 10, 10, encode_dialect.barrier_margin, PANDION),
    Stream(message_ids.MPC_STATUS, 10, 10, encode_dialect.mpc_status, PANDION),
    *(
        Stream(message_ids.LOOP_TIMING, 1, 1, encode_dialect.loop_timing(group), PANDION)
        for group in range(4)
    ),
    # Behind the others, whose places decide when each is sent.
    Stream(message_ids.GPS_RAW_INT, 1, 5, encode_place.gps_raw),
    Stream(message_ids.MPC_HORIZON, 0, 0, encode_dialect.mpc_horizon, PANDION),
    Stream(message_ids.MPC_HORIZON_ARM, 0, 0, encode_dialect.mpc_horizon_arm, PANDION),
    Stream(message_ids.TOOL_CONTACT, 10, 20, encode_dialect.tool_contact, PANDION),
    Stream(message_ids.PAYLOAD_STATUS, 2, 10, encode_dialect.payload_status, PANDION),
)

# These leave at once when mode, arming, landing or health change.
AT_ONCE: Final = (HEARTBEAT, _CURRENT_MODE, _EXTENDED_STATE)

# Sent on request only, because they have several parts; the request's param2 chooses.
ON_REQUEST: Final[dict[int, Answerer]] = {
    message_ids.AVAILABLE_MODES: identity.available_modes,
    message_ids.COMPONENT_METADATA: component_metadata,
    message_ids.OBSTACLE_SHAPE: encode_dialect.safe_set_shapes,
}

GROUND_RATES: Final = tuple(stream.ground_hz for stream in STREAMS)
API_RATES: Final = tuple(stream.api_hz for stream in STREAMS)


def messages_now(
    message_id: int, which: float, snapshot: FlightSnapshot, context: TelemetryContext
) -> Sequence[Outgoing] | None:
    """Any message of this vehicle as it would be sent now; ``which`` [1] is its part, if any.

    Empty where there is nothing to say yet; None if the vehicle has no such message.
    """
    answerer = ON_REQUEST.get(message_id)
    if answerer is not None:
        return answerer(which, snapshot, context)
    streams = [stream for stream in STREAMS if stream.message_id == message_id]
    if not streams:
        return None
    found = ((stream, stream.encode(snapshot, context)) for stream in streams)
    return [
        Outgoing(s.message_id, values, s.component) for s, values in found if values is not None
    ]
