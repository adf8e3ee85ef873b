"""What may stand in the tables of ``[sensors]``, apart from the suite ``perfect``.

The numbers of the suites, with their sources, are in ``suites/*.toml``. A deviation is a standard
deviation of a normal distribution. What is drawn once a flight, such as a turn-on bias, is drawn
with the deviation that is given here.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Literal, TypeAlias

from command_line.ranges import Range
from sitl.ranges import V3

SuiteName: TypeAlias = Literal["perfect", "mocap", "vio", "rtk", "gnss"]

_SHARE = Range(0.0, 1.0)
_MS = Range(0.0, 1000.0)
_METRES = Range(0.0, 100.0)
_DEGREES = Range(0.0, 180.0)
_SECONDS = Range(0.001, 86400.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """What every sensor has: when it measures, and what becomes of its messages."""

    rate_hz: Annotated[float, Range(0.1, 500.0)]
    latency_ms: Annotated[float, _MS] = 0.0  # mean, from the measurement to the arrival
    jitter_ms: Annotated[float, _MS] = 0.0  # deviation of it; nothing arrives before it is measured
    stamp_error_ms: Annotated[float, Range(-1000.0, 1000.0)] = 0.0  # stamp minus measurement
    dropout_share: Annotated[float, _SHARE] = 0.0  # of the messages, each for itself
    gap_ms: Annotated[float, Range(0.0, 60000.0)] = 0.0  # length of a silence
    gap_every_s: Annotated[float, _SECONDS] = 60.0  # one silence in each such interval
    outlier_share: Annotated[float, _SHARE] = 0.0  # of the messages


@dataclass(frozen=True, slots=True, kw_only=True)
class Imu(Timing):
    """Gyro and accelerometer at the base's origin."""

    # White noise per √Hz: its Allan deviation at 1 s; that of a sample is √rate_hz times as large.
    gyro_density_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    accel_density_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0
    # In-run bias: a first-order Gauss–Markov process with this deviation and correlation time. The
    # bias instability of a data sheet, the floor of the Allan deviation, is 0.617 of the deviation.
    gyro_bias_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    gyro_bias_time_s: Annotated[float, _SECONDS] = 1000.0
    accel_bias_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0
    accel_bias_time_s: Annotated[float, _SECONDS] = 300.0
    # Drawn once a flight.
    gyro_turn_on_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    accel_turn_on_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0
    gyro_scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0
    accel_scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0
    misalignment_deg: Annotated[float, Range(0.0, 45.0)] = 0.0  # of each axis towards each other
    # Measuring range and step of the digits; a step of 0: as fine as the message.
    gyro_limit_rad_s: Annotated[float, Range(0.1, 1000.0)] = 1000.0
    accel_limit_m_s2: Annotated[float, Range(1.0, 10000.0)] = 10000.0
    gyro_resolution_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    accel_resolution_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0
    # Amplitude that one unbalanced rotor causes at the speed of hover; it grows with its square.
    vibration_rad_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    vibration_m_s2: Annotated[float, Range(0.0, 100.0)] = 0.0
    rotor_hz: Annotated[float, Range(1.0, 1000.0)] = 90.0  # of a rotor in hover


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCapture(Timing):
    """Cameras on the walls that see markers on the base."""

    position_m: Annotated[float, _METRES] = 0.0
    attitude_deg: Annotated[float, _DEGREES] = 0.0
    outlier_m: Annotated[float, _METRES] = 0.0  # how far an outlier lies off, in any direction
    outlier_deg: Annotated[float, _DEGREES] = 0.0
    # Steps of the digits; 0: as fine as the message. Of the attitude, those of a small rotation.
    position_resolution_m: Annotated[float, _METRES] = 0.0
    attitude_resolution_deg: Annotated[float, Range(0.0, 10.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class VisualOdometry(MotionCapture):
    """Cameras on the vehicle: a pose that drifts until the place is recognised again."""

    # Random walk of the frame: m per √s on each axis, and degrees per √s of its yaw.
    drift_m: Annotated[float, Range(0.0, 1.0)] = 0.0
    drift_deg: Annotated[float, Range(0.0, 10.0)] = 0.0
    # The frame then jumps to within these deviations of the true one, and says so.
    recognises_every_s: Annotated[float, _SECONDS] = 86400.0  # mean, exponentially distributed
    recognised_m: Annotated[float, _METRES] = 0.0
    recognised_deg: Annotated[float, _DEGREES] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Gnss(Timing):
    """Satellites: a position that wanders, and a velocity."""

    horizontal_m: Annotated[float, _METRES] = 0.0  # white noise, of each axis
    vertical_m: Annotated[float, _METRES] = 0.0
    # What changes slowly, a first-order Gauss–Markov process.
    wander_horizontal_m: Annotated[float, _METRES] = 0.0
    wander_vertical_m: Annotated[float, _METRES] = 0.0
    wander_time_s: Annotated[float, _SECONDS] = 60.0
    velocity_m_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    outlier_m: Annotated[float, _METRES] = 0.0
    # Steps of the digits, by default those of HIL_GPS; 0: as fine as the message.
    position_resolution_deg: Annotated[float, Range(0.0, 1e-3)] = 1e-7  # latitude and longitude
    height_resolution_m: Annotated[float, _METRES] = 0.001
    velocity_resolution_m_s: Annotated[float, Range(0.0, 10.0)] = 0.01
    rtk: bool = False  # what it says it is: a fix with corrections, or a plain one


@dataclass(frozen=True, slots=True, kw_only=True)
class Barometer(Timing):
    """Static pressure."""

    noise_pa: Annotated[float, Range(0.0, 1000.0)] = 0.0
    offset_pa: Annotated[float, Range(0.0, 10000.0)] = 0.0  # drawn once a flight
    drift_pa: Annotated[float, Range(0.0, 1000.0)] = 0.0  # Gauss–Markov process: weather, warmth
    drift_time_s: Annotated[float, _SECONDS] = 600.0
    resolution_pa: Annotated[float, Range(0.0, 100.0)] = 0.0
    outlier_pa: Annotated[float, Range(0.0, 10000.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnetometer(Timing):
    """The Earth's field, as bent by the vehicle."""

    field_gauss: Annotated[V3, Range(-1.0, 1.0)]  # NED
    noise_gauss: Annotated[float, Range(0.0, 1.0)] = 0.0
    offset_gauss: Annotated[float, Range(0.0, 1.0)] = 0.0  # of each axis, drawn once a flight
    scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0  # the same
    resolution_gauss: Annotated[float, Range(0.0, 0.1)] = 0.0
    outlier_gauss: Annotated[float, Range(0.0, 10.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rangefinder(Timing):
    """Distance along the base's z axis to the ground; silent where it is out of range."""

    least_m: Annotated[float, _METRES] = 0.0
    most_m: Annotated[float, _METRES] = 100.0
    noise_m: Annotated[float, _METRES] = 0.0
    scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0  # drawn once a flight
    resolution_m: Annotated[float, Range(0.0, 1.0)] = 0.0
    outlier_m: Annotated[float, _METRES] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders(Timing):
    """Angles of the joints; no rate is measured."""

    resolution_rad: Annotated[float, Range(0.0, 1.0)] = 0.0
    noise_rad: Annotated[float, Range(0.0, 1.0)] = 0.0
    offset_rad: Annotated[float, Range(0.0, 1.0)] = 0.0  # of each zero, drawn once a flight
    outlier_rad: Annotated[float, Range(0.0, 3.2)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceTorque(Timing):
    """What acts on the tool from outside, in the axes of the last link, tared.

    The defaults are our choice, typical of a small sensor of six axes.
    """

    rate_hz: Annotated[float, Range(0.1, 500.0)] = 500.0
    latency_ms: Annotated[float, _MS] = 2.0
    force_n: Annotated[float, Range(0.0, 100.0)] = 0.05
    torque_n_m: Annotated[float, Range(0.0, 10.0)] = 0.002
    force_bias_n: Annotated[float, Range(0.0, 100.0)] = 0.2  # of each axis, drawn once a flight
    torque_bias_n_m: Annotated[float, Range(0.0, 10.0)] = 0.005
    force_resolution_n: Annotated[float, Range(0.0, 10.0)] = 0.0125
    torque_resolution_n_m: Annotated[float, Range(0.0, 1.0)] = 0.0005
    outlier_n: Annotated[float, Range(0.0, 1000.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredSensors:
    """A suite of sensors; what is None is not on board."""

    suite: SuiteName
    imu: Imu
    encoders: Encoders
    motion_capture: MotionCapture | None = None
    visual_odometry: VisualOdometry | None = None
    gnss: Gnss | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None
    rangefinder: Rangefinder | None = None
    force_torque: ForceTorque | None = None  # of no suite: where the scenario has its table
