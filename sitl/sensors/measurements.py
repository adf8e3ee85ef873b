"""What the sensors say, each with the stamp of its measurement [µs]."""

from __future__ import annotations

from typing import NamedTuple, TypeAlias

from sitl.ranges import V3

PLAIN_FIX, RTK_FIXED = 3, 6  # GPS_FIX_TYPE

V4: TypeAlias = tuple[float, float, float, float]


class ImuMeasurement(NamedTuple):
    """Gyro and accelerometer."""

    t_us: int
    gyro_B: V3  # rad/s
    accel_B: V3  # m/s², specific force


class PoseMeasurement(NamedTuple):
    """Position and attitude."""

    t_us: int
    p_WB: V3  # m, NED
    q_WB: V4  # [w, x, y, z], maps B to W
    position_variance: V3  # m², as the sensor states it
    attitude_variance: V3  # rad², roll, pitch, yaw
    resets: int  # how often the sensor's frame has jumped
    from_cameras_on_board: bool  # visual odometry, or motion capture


class GnssMeasurement(NamedTuple):
    """Position and velocity from satellites."""

    t_us: int
    p_WB: V3  # m, NED
    v_WB: V3  # m/s, NED
    horizontal_deviation: float  # m, as the receiver states it
    vertical_deviation: float  # m
    rtk: bool
    satellites: int = 18  # that it sees

    @property
    def fix_type(self) -> int:
        """GPS_FIX_TYPE of MAVLink."""
        return RTK_FIXED if self.rtk else PLAIN_FIX


class PressureMeasurement(NamedTuple):
    """Static pressure."""

    t_us: int
    pressure_pa: float


class MagneticMeasurement(NamedTuple):
    """Magnetic field."""

    t_us: int
    field_B: V3  # Gauss


class RangeMeasurement(NamedTuple):
    """Distance along the base's z axis."""

    t_us: int
    distance: float  # m
    variance: float  # m²
    least: float  # m, that it can measure
    most: float  # m


class JointMeasurement(NamedTuple):
    """Angles of the joints."""

    t_us: int
    angles: tuple[float, ...]  # (j,) rad


class WrenchMeasurement(NamedTuple):
    """What acts on the tool from outside, about the end-effector, in the axes of the last link."""

    t_us: int
    force: V3  # N
    torque: V3  # N·m


Measurement: TypeAlias = (
    ImuMeasurement
    | PoseMeasurement
    | GnssMeasurement
    | PressureMeasurement
    | MagneticMeasurement
    | RangeMeasurement
    | JointMeasurement
    | WrenchMeasurement
)
