"""What sensors say, each at the time it was measured and with the variance it is given.

Frames: NED for places and velocities, the body (FRD) for what is fixed to the vehicle. ``time`` is
the time of the measurement [s], not of its arrival, on the clock of the tick. A variance is of one
axis; entries that are not positive or not finite mean that the sensor does not know.
"""

from __future__ import annotations

from enum import Enum

from fsw.frozen import dataclass

# Named here, because ``fsw.autopilot.signals`` builds upon this file.
Vec2 = tuple[float, float]
Vec3 = tuple[float, float, float]
Vec4 = tuple[float, float, float, float]
JointVector = tuple[float, ...]  # (j,), a number a joint of the vehicle, from the base on
RotorVector = tuple[float, ...]  # (r,), a number a rotor of the vehicle, as actuators are numbered
_LEVEL_FIX = 2  # GPS_FIX_TYPE_2D_FIX; those above it have a height


class Sensor(Enum):
    """A source of measurements."""

    IMU = "IMU"
    POSE = "pose"
    GNSS = "GNSS"
    BAROMETER = "barometer"
    MAGNETOMETER = "magnetometer"
    RANGEFINDER = "rangefinder"
    ENCODERS = "joint encoders"


@dataclass(frozen=True, slots=True)
class ImuSample:
    """Accelerometer and gyro, at one instant."""

    time: float  # s
    acceleration: Vec3  # m/s^2, specific force, body
    rate: Vec3  # rad/s, body


@dataclass(frozen=True, slots=True)
class PoseSample:
    """Position and attitude from motion capture or visual odometry."""

    time: float  # s
    position: Vec3  # m, NED
    attitude: Vec4  # unit quaternion [w, x, y, z], body to NED
    position_variance: Vec3  # m^2, NED
    attitude_variance: Vec3  # rad^2, of a small rotation, body
    reset_counter: int = 0  # another number: the sensor's own frame has jumped
    drifts: bool = False  # the frame does: by how much since it jumped last is in the variances


@dataclass(frozen=True, slots=True)
class GnssSample:
    """Position and velocity from satellites, in the local frame."""

    time: float  # s
    position: Vec3  # m, NED
    velocity: Vec3  # m/s, NED
    position_variance: Vec3  # m^2, NED
    velocity_variance: Vec3  # m^2/s^2, NED
    fix_type: int = 3  # GPS_FIX_TYPE of MAVLink; up to 2 the rest says nothing
    satellites: int = 255  # that it sees; 255: it does not say

    @property
    def has_fix(self) -> bool:
        """Whether it knows its place in space."""
        return self.fix_type > _LEVEL_FIX


@dataclass(frozen=True, slots=True)
class PressureSample:
    """Height from a barometer."""

    time: float  # s
    altitude: float  # m above the origin of the local frame, up
    variance: float  # m^2


@dataclass(frozen=True, slots=True)
class MagneticSample:
    """Magnetometer."""

    time: float  # s
    field: Vec3  # Gauss, body


@dataclass(frozen=True, slots=True)
class RangeSample:
    """Distance to what is below, along the body's z."""

    time: float  # s
    distance: float  # m
    variance: float  # m^2


@dataclass(frozen=True, slots=True)
class JointSample:
    """Encoders of the arm."""

    time: float  # s
    angles: JointVector  # rad


AidingSample = PoseSample | GnssSample | PressureSample | MagneticSample | RangeSample
Sample = ImuSample | JointSample | AidingSample
