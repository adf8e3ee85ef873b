"""Sensor readings and the pilot's messages as MAVLink frames; wire order, see messages.frames."""

from __future__ import annotations

import math
from typing import Final

from messages import message_ids, status_text
from messages.frames import FrameWriter
from messages.joint_arrays import BASE, base, more
from messages.lockstep_codec import LockstepFrame
from messages.message_ids import PATH_PLANNER, SIMULATOR, SYSTEM_ID
from sitl.earth import DEFAULT_ORIGIN, Place
from sitl.link.encode_sensors import SensorEncoder
from sitl.link.failures import Answer, Injection
from sitl.link.pilot_messages import (
    PilotMessage,
    SendCommand,
    SendTarget,
)
from sitl.scenario import Touch
from sitl.sensors.channel import Measurement
from sitl.sensors.exact import SensorReadings
from sitl.shapes.kind import NUMBERS

WireValues = tuple[float | bytes, ...]

_MAX_DATAGRAM: Final = 1400  # bytes, fits an Ethernet packet
_LOCAL_NED: Final = 1  # MAV_FRAME; of ODOMETRY's position and velocity
_MOTION_CAPTURE: Final = 6  # MAV_ESTIMATOR_TYPE
_ACCEL_AND_GYRO: Final = 0x3F  # HIL_SENSOR_UPDATED_FLAGS: there is no magnetometer or barometer
_GENERIC: Final = 0  # MAV_TYPE
_NO_AUTOPILOT: Final = 8  # MAV_AUTOPILOT
_HIL: Final = 32  # MAV_MODE_FLAG
_ACTIVE: Final = 4  # MAV_STATE
_MAVLINK_VERSION: Final = 3
_UNKNOWN_CELL, _UNKNOWN_WARMTH = 0xFFFF, 0x7FFF  # of BATTERY_STATUS
_FOR_EVERYTHING, _LIPO = 1, 1  # MAV_BATTERY_FUNCTION, MAV_BATTERY_TYPE
_CRITICAL, _WARNING = 2, 4  # MAV_SEVERITY
# An unknown covariance is a NaN in its first entry.
_NO_COVARIANCE: Final = (math.nan, *(0.0,) * 20)
_ODOMETRY_TAIL: Final = (
    *_NO_COVARIANCE,
    *_NO_COVARIANCE,
    *(_LOCAL_NED, _LOCAL_NED, 0, _MOTION_CAPTURE, 100),
)
_HIL_TAIL: Final = (*(0.0,) * 7, _ACCEL_AND_GYRO, 0)
_KEEP_IN, _TOUCH = 1, 2  # PANDION_SHAPE_FLAGS
_ARM_TAIL: Final = (0.0,) * 6  # the end-effector's place and velocity: not measured


class StepEncoder:
    """Builds the datagram of a step."""

    def __init__(
        self, lockstep: bool, *, measured: bool = False, origin: Place = DEFAULT_ORIGIN
    ) -> None:
        """Send the true state, or what sensors have ``measured``; the frame is at ``origin``."""
        self._sensors = FrameWriter(SYSTEM_ID, SIMULATOR)
        self._pilot = FrameWriter(SYSTEM_ID, PATH_PLANNER)
        self._text_id = 0
        self._mode = (1 if lockstep else 0) | (2 if measured else 0)
        self._measured = SensorEncoder(self._sensors, origin)
        self._odometry = LockstepFrame(self._sensors, message_ids.ODOMETRY, *_ODOMETRY_TAIL)
        self._hil_sensor = LockstepFrame(self._sensors, message_ids.HIL_SENSOR, *_HIL_TAIL)
        self._arms = {
            joints: LockstepFrame(
                self._sensors, message_ids.ARM_JOINT_STATE, *_ARM_TAIL, joints, *more(()) * 3
            )
            for joints in range(1, BASE + 1)
        }

    def datagram(self, readings: SensorReadings, messages: tuple[PilotMessage, ...]) -> bytes:
        """Pilot's messages, pose, arm, and HIL_SENSOR last, as the barrier."""
        t_us, p, v, q, w, gyro, accel, angles, rates, torques, _ = readings
        step = (
            self._odometry(t_us, *p, *q, *v, *w)
            + self._arm(t_us, angles, rates, torques)
            + self._hil_sensor(t_us, *accel, *gyro)
        )
        return self.spoken(messages) + step if messages else step

    def _arm(self, t_us: int, *arrays: tuple[float, ...]) -> bytes:
        """ARM_JOINT_STATE; without joints in the extension its length is always the same."""
        count = len(arrays[0])
        first = [value for one in arrays for value in base(one)]
        if count in self._arms:
            return self._arms[count](t_us, *first)
        rest = [value for one in arrays for value in more(one)]
        values = (*first, *_ARM_TAIL, count, *rest)
        return self._sensors.frame(message_ids.ARM_JOINT_STATE, t_us, *values)

    def measured_datagrams(
        self,
        t_us: int,
        measurements: tuple[Measurement, ...],
        messages: tuple[PilotMessage, ...],
        opening: bytes = b"",
    ) -> tuple[list[bytes], bytes]:
        """Pilot's messages, what arrived from the sensors, and HIL_SENSOR last, as the barrier.

        That is the second; what arrived and has no room in it goes ahead, in the first, as it does
        once at the start of a flight. Each datagram begins with ``opening``.
        """
        frames = self._measured.frames(t_us, measurements)
        if not messages:
            datagram = opening + b"".join(frames)
            if len(datagram) <= _MAX_DATAGRAM:  # almost always
                return [], datagram
        step = [opening, self.spoken(messages)] if messages else [opening]
        size = sum(map(len, step)) + len(frames[-1])
        first = len(frames) - 1
        while first > 0 and size + len(frames[first - 1]) <= _MAX_DATAGRAM:
            first -= 1
            size += len(frames[first])
        ahead: list[bytes] = []
        for frame in frames[:first]:
            if not ahead or len(ahead[-1]) + len(frame) > _MAX_DATAGRAM:
                ahead.append(opening)
            ahead[-1] += frame
        return ahead, b"".join([*step, *frames[first:]])

    def heartbeat(self) -> bytes:
        """HEARTBEAT; in its custom_mode bit 0 is set in lockstep and bit 1 with sensors."""
        values = (self._mode, _GENERIC, _NO_AUTOPILOT, _HIL, _ACTIVE, _MAVLINK_VERSION)
        return self._sensors.frame(message_ids.HEARTBEAT, *values)

    def answer(self, asked: Injection, answer: Answer) -> bytes:
        """COMMAND_ACK to the one that asked for a fault, and the sentence for the operator."""
        ack = (message_ids.CMD_INJECT_FAILURE, answer.result, 0, 0, asked.system, asked.component)
        self._text_id = self._text_id % 0xFFFF + 1
        # As the vehicle's own: a refusal is critical, a fault that begins or ends a warning.
        severity = _WARNING if answer.result == message_ids.ACCEPTED else _CRITICAL
        texts = status_text.pieces(answer.sentence, severity, self._text_id)
        frames = (self._sensors.frame(message_ids.STATUSTEXT, *values) for values in texts)
        return self._sensors.frame(message_ids.COMMAND_ACK, *ack) + b"".join(frames)

    def battery(self, volts: float, share: float) -> bytes:
        """BATTERY_STATUS of a pack at ``volts`` [V] with a ``share`` [1] of its charge."""
        cells = (round(1000.0 * volts), *(_UNKNOWN_CELL,) * 9)
        about = (-1, 0, _FOR_EVERYTHING, _LIPO, round(100.0 * share))
        values = (-1, -1, _UNKNOWN_WARMTH, *cells, *about, 0, 0, *(0,) * 4, 0, 0)
        return self._sensors.frame(message_ids.BATTERY_STATUS, *values)

    def spoken(self, messages: tuple[PilotMessage, ...]) -> bytes:
        """What the pilot says."""
        return b"".join(self._pilot.frame(*_wire(message)) for message in messages)


def _contact(touch: Touch | None) -> tuple[float, ...]:
    """What OBSTACLE_SHAPE says of contact."""
    if touch is None:
        return (0.0,) * 5
    return (
        touch.force_max_n,
        *touch.stiffness_range_n_m,
        touch.dissipation_s_m,
        touch.friction,
    )


def _wire(message: PilotMessage) -> tuple[int, *WireValues]:
    """Message id and wire values."""
    if isinstance(message, SendTarget):
        motion = (*message.point.p, *message.point.v, *message.point.a)
        about = (message.yaw, 0.0, 0, SYSTEM_ID, 1, _LOCAL_NED, message.point.force)
        return (message_ids.END_EFFECTOR_TARGET, message.t_us, *motion, *about)
    if isinstance(message, SendCommand):
        return (message_ids.COMMAND_LONG, *message.params, message.command, SYSTEM_ID, 1, 0)
    one, rest = message, (0.0,) * (NUMBERS - len(message.numbers))
    begin = (one.t_us, one.clearance_m, *one.velocity)
    flags = (_KEEP_IN if one.keep_in else 0) | (_TOUCH if one.touch is not None else 0)
    tail = (SYSTEM_ID, 1, one.index, one.count, one.number, flags)
    set_id = one.t_us // 1000 & 0xFFFFFFFF  # all zones of a set are of one time
    values: WireValues = (*begin, *one.numbers, *rest, *tail, *_contact(one.touch), set_id)
    return (message_ids.OBSTACLE_SHAPE, *values)
