"""Measurements as MAVLink frames, as PX4's simulators send them; wire order, see messages.frames.

HIL_SENSOR with id 0 ends every step and is its clock. It carries what the inertial unit measured at
that very instant, if anything; what is older comes before it, with id 1 and its own time.
"""

from __future__ import annotations

import math
from typing import Final

from messages import message_ids
from messages.frames import FrameWriter
from messages.joint_arrays import BASE, base, more
from messages.lockstep_codec import LockstepFrame
from sitl.earth import Place, place_of
from sitl.sensors.barometer import PressureMeasurement, standard_altitude
from sitl.sensors.channel import Measurement
from sitl.sensors.encoders import JointMeasurement
from sitl.sensors.force_torque import WrenchMeasurement
from sitl.sensors.gnss import GnssMeasurement
from sitl.sensors.imu import ImuMeasurement
from sitl.sensors.magnetometer import MagneticMeasurement
from sitl.sensors.motion_capture import PoseMeasurement
from sitl.sensors.rangefinder import RangeMeasurement

# HIL_SENSOR_UPDATED_FLAGS
INERTIAL: Final = 0x3F
MAGNETIC: Final = 0x1C0
BAROMETRIC: Final = 0x1A00
_AT_ANOTHER_TIME: Final = 1  # id of HIL_SENSOR

_LOCAL_NED, _BODY_FRD = 1, 12  # MAV_FRAME
VIO, _MOTION_CAPTURE = 3, 6  # MAV_ESTIMATOR_TYPE
_ALL_WELL: Final = 100  # quality
_UNKNOWN: Final = (math.nan, *(0.0,) * 20)  # a covariance
_NO_RATES: Final = (math.nan,) * 6
_LASER, _DOWNWARD = 0, 25  # MAV_DISTANCE_SENSOR, MAV_SENSOR_ORIENTATION
_NO_MORE: Final = more(())
_U8, _U16, _I16 = 0xFF, 0xFFFF, 0x7FFF
_WARM_C: Final = 15.0


class SensorEncoder:
    """Builds the frames of what arrived in one step."""

    def __init__(self, writer: FrameWriter, origin: Place) -> None:
        """Write with a component's sequence; the local frame begins at ``origin``."""
        self._writer = writer
        self._origin = origin
        tail = (*(0.0,) * 7, INERTIAL, 0)
        self._barrier = LockstepFrame(writer, message_ids.HIL_SENSOR, *tail)
        self._about_pose: object = None
        self._pose: LockstepFrame | None = None
        self._joints = {
            count: LockstepFrame(
                writer, message_ids.JOINT_ENCODERS, *(0.0,) * (BASE - count), count, *_NO_MORE
            )
            for count in range(1, BASE + 1)
        }

    def frames(self, t_us: int, measurements: tuple[Measurement, ...]) -> list[bytes]:
        """The frames of all that arrived in the step of ``t_us``, the barrier last."""
        clock: ImuMeasurement | None = None
        out = []
        for one in measurements:
            if isinstance(one, ImuMeasurement) and one.t_us == t_us:
                clock = one
            elif isinstance(one, JointMeasurement):
                out.append(self.encoders(max(one.t_us, 0), one.angles))
            else:
                out.append(self._frame(one))
        if clock is not None:
            out.append(self._barrier(t_us, *clock.accel_B, *clock.gyro_B))
        else:
            out.append(self._hil_sensor(t_us, (0.0,) * 13, 0, 0))
        return out

    def encoders(self, t_us: int, angles: tuple[float, ...]) -> bytes:
        """JOINT_ENCODERS with ``angles`` (j,) [rad].

        Without joints in the extension its length is always the same.
        """
        if len(angles) in self._joints:
            return self._joints[len(angles)](t_us, *angles)
        values = (*base(angles), len(angles), *more(angles))
        return self._writer.frame(message_ids.JOINT_ENCODERS, t_us, *values)

    def _frame(self, one: Measurement) -> bytes:
        # A clock that is wrong by more than the flight is long cannot be sent.
        t_us = max(one.t_us, 0)
        match one:
            case PoseMeasurement():
                return self._odometry(t_us, one)
            case GnssMeasurement():
                gps = gps_values(self._origin, one)
                return self._writer.frame(message_ids.HIL_GPS, t_us, *gps)
            case WrenchMeasurement():
                values = (*one.force, *one.torque)
                return self._writer.frame(message_ids.FORCE_TORQUE, t_us, *values)
            case RangeMeasurement():
                return self._writer.frame(message_ids.DISTANCE_SENSOR, *distance_values(one))
            case PressureMeasurement():
                fields = (*(0.0,) * 9, *pressure_values(one))
                return self._hil_sensor(t_us, fields, BAROMETRIC, _AT_ANOTHER_TIME)
            case MagneticMeasurement():
                fields = (*(0.0,) * 6, *one.field_B, *(0.0,) * 4)
                return self._hil_sensor(t_us, fields, MAGNETIC, _AT_ANOTHER_TIME)
            case ImuMeasurement():
                fields = (*one.accel_B, *one.gyro_B, *(0.0,) * 7)
                return self._hil_sensor(t_us, fields, INERTIAL, _AT_ANOTHER_TIME)
        raise TypeError(f"{one} has no message")

    def _hil_sensor(self, t_us: int, fields: tuple[float, ...], updated: int, sensor: int) -> bytes:
        return self._writer.frame(message_ids.HIL_SENSOR, t_us, *fields, updated, sensor)

    def _odometry(self, t_us: int, one: PoseMeasurement) -> bytes:
        """ODOMETRY; what has been the same in the last two is not packed again."""
        about = one[3:]
        if about == self._about_pose:
            self._pose = self._pose or LockstepFrame(
                self._writer, message_ids.ODOMETRY, *_about(one)
            )
            return self._pose(t_us, *one.p_WB, *one.q_WB)
        self._about_pose, self._pose = about, None
        values = (t_us, *one.p_WB, *one.q_WB, *_about(one))
        return self._writer.frame(message_ids.ODOMETRY, *values)


def about_pose(one: PoseMeasurement, estimator: int) -> tuple[float, ...]:
    """All of ODOMETRY behind its pose; ``estimator`` is a MAV_ESTIMATOR_TYPE."""
    x, y, z = one.position_variance
    roll, pitch, yaw = one.attitude_variance
    # The upper triangle, row by row.
    covariance = (
        *(x, 0.0, 0.0, 0.0, 0.0, 0.0),
        *(y, 0.0, 0.0, 0.0, 0.0),
        *(z, 0.0, 0.0, 0.0),
        *(roll, 0.0, 0.0),
        *(pitch, 0.0),
        yaw,
    )
    tail = (_LOCAL_NED, _BODY_FRD, one.resets, estimator, _ALL_WELL)
    return (*_NO_RATES, *covariance, *_UNKNOWN, *tail)


def _about(one: PoseMeasurement) -> tuple[float, ...]:
    """The same of the sensor's own kind."""
    return about_pose(one, VIO if one.from_cameras_on_board else _MOTION_CAPTURE)


def pressure_values(one: PressureMeasurement) -> tuple[float, float, float, float]:
    """The last numbers of HIL_SENSOR: hPa, hPa, m, °C."""
    altitude = standard_altitude(max(one.pressure_pa, 1.0))
    return (0.01 * one.pressure_pa, 0.0, altitude, _WARM_C)


def gps_values(origin: Place, one: GnssMeasurement) -> tuple[float, ...]:
    """All of HIL_GPS behind its time; the local frame begins at ``origin``."""
    place = place_of(origin, one.p_WB)
    north, east, down = one.v_WB
    course = math.degrees(math.atan2(east, north)) % 360.0
    return (
        round(1e7 * place.latitude),
        round(1e7 * place.longitude),
        round(1e3 * place.altitude),
        _counted(100.0 * one.horizontal_deviation, _U16),
        _counted(100.0 * one.vertical_deviation, _U16),
        min(round(100.0 * math.hypot(north, east)), _U16),
        *(min(max(round(100.0 * v), -_I16), _I16) for v in (north, east, down)),
        round(100.0 * course) % 36_000,
        one.fix_type,
        one.satellites,
        0,
        0,  # no yaw
    )


def distance_values(one: RangeMeasurement) -> tuple[float | bytes, ...]:
    """All of DISTANCE_SENSOR."""
    lengths = (100.0 * one.least, 100.0 * one.most, 100.0 * one.distance)
    variance = _counted(1e4 * one.variance, _U8 - 1)
    begin = (max(one.t_us, 0) // 1000, *(min(max(round(cm), 0), _U16) for cm in lengths))
    return (*begin, _LASER, 0, _DOWNWARD, variance, 0.0, 0.0, *(0.0,) * 4, 0)


def _counted(value: float, most: int) -> int:
    """A deviation or variance in whole units: never stated as smaller than it is, nor as 0."""
    return min(max(math.ceil(value - 1e-9), 1), most)
