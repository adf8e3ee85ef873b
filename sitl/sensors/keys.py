"""What may stand in the tables of ``[sensors]``, apart from the suite ``perfect``.

The numbers of the suites, with their sources, are in ``suites/*.toml``. A deviation is a standard
deviation of a normal distribution. What is drawn once a flight, such as a turn-on bias, is drawn
with the deviation that is given here.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Annotated, Literal, TypeAlias, cast

from command_line.ranges import Range
from sitl.faults.keys import Unit
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

    units = cast("tuple[Unit, ...]", ())  # of FAILURE_UNIT, that can fail

    rate_hz: Annotated[float, Range(0.1, 500.0)]  # measurements; at most that of the steps, 500
    latency_ms: Annotated[float, _MS] = 0.0  # mean, from measurement to arrival
    # deviation of the latency; messages do not overtake each other
    jitter_ms: Annotated[float, _MS] = 0.0
    # the stamp says so much later than it was; the vehicle does not know
    stamp_error_ms: Annotated[float, Range(-1000.0, 1000.0)] = 0.0
    dropout_share: Annotated[float, _SHARE] = 0.0  # of the messages are lost, each for itself
    gap_ms: Annotated[float, Range(0.0, 60000.0)] = 0.0  # length of a silence
    # one silence in each such interval, at a random place in it
    gap_every_s: Annotated[float, _SECONDS] = 60.0
    outlier_share: Annotated[float, _SHARE] = 0.0  # of the messages are outliers


@dataclass(frozen=True, slots=True, kw_only=True)
class Imu(Timing):
    """Gyro and accelerometer at the base's origin."""

    units = ("gyro", "accel")

    # white noise per √Hz; a sample has √rate times as much
    gyro_density_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    accel_density_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0  # the same
    # deviation of the bias that wanders, a Gauss–Markov process; 0.617 of it is the bias
    # instability
    gyro_bias_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    gyro_bias_time_s: Annotated[float, _SECONDS] = 1000.0  # its correlation time
    accel_bias_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0  # the same
    accel_bias_time_s: Annotated[float, _SECONDS] = 300.0  # the same
    gyro_turn_on_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0  # bias drawn once a flight
    accel_turn_on_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0  # the same
    # scale error of each axis, drawn once a flight
    gyro_scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0
    accel_scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0  # the same
    # of each axis towards each other one, drawn once a flight
    misalignment_deg: Annotated[float, Range(0.0, 45.0)] = 0.0
    gyro_limit_rad_s: Annotated[float, Range(0.1, 1000.0)] = 1000.0  # end of the range
    accel_limit_m_s2: Annotated[float, Range(1.0, 10000.0)] = 10000.0  # the same
    gyro_resolution_rad_s: Annotated[float, Range(0.0, 1.0)] = 0.0
    accel_resolution_m_s2: Annotated[float, Range(0.0, 10.0)] = 0.0
    # amplitude that one rotor causes in hover; grows with its thrust
    vibration_rad_s: Annotated[float, Range(0.0, 10.0)] = 0.0
    vibration_m_s2: Annotated[float, Range(0.0, 100.0)] = 0.0  # the same
    # turns of a rotor in hover; with the root of its thrust
    rotor_hz: Annotated[float, Range(1.0, 1000.0)] = 90.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCapture(Timing):
    """Cameras on the walls that see markers on the base."""

    units = ("vio", "attitude")

    position_m: Annotated[float, _METRES] = 0.0  # noise of each axis
    attitude_deg: Annotated[float, _DEGREES] = 0.0  # noise about each axis
    outlier_m: Annotated[float, _METRES] = 0.0
    outlier_deg: Annotated[float, _DEGREES] = 0.0
    position_resolution_m: Annotated[float, _METRES] = 0.0
    attitude_resolution_deg: Annotated[float, Range(0.0, 10.0)] = 0.0  # of a small rotation


@dataclass(frozen=True, slots=True, kw_only=True)
class VisualOdometry(MotionCapture):
    """Cameras on the vehicle: a pose that drifts until the place is recognised again."""

    # random walk of the frame, per √s on each axis
    drift_m: Annotated[float, Range(0.0, 1.0)] = 0.0
    drift_deg: Annotated[float, Range(0.0, 10.0)] = 0.0  # random walk of the frame's yaw, per √s
    # mean time until the frame jumps back, with a new `reset_counter`
    recognises_every_s: Annotated[float, _SECONDS] = 86400.0
    recognised_m: Annotated[float, _METRES] = 0.0  # deviation of the frame after a jump
    recognised_deg: Annotated[float, _DEGREES] = 0.0  # the same, of its yaw


@dataclass(frozen=True, slots=True, kw_only=True)
class Gnss(Timing):
    """Satellites: a position that wanders, and a velocity."""

    units = ("gps",)

    horizontal_m: Annotated[float, _METRES] = 0.0  # white noise, north and east
    vertical_m: Annotated[float, _METRES] = 0.0  # white noise, down
    # deviation of what changes slowly, a Gauss–Markov process
    wander_horizontal_m: Annotated[float, _METRES] = 0.0
    wander_vertical_m: Annotated[float, _METRES] = 0.0  # the same
    wander_time_s: Annotated[float, _SECONDS] = 60.0  # its correlation time
    velocity_m_s: Annotated[float, Range(0.0, 10.0)] = 0.0  # noise of each axis
    outlier_m: Annotated[float, _METRES] = 0.0
    # of latitude and longitude; default 1e-7 as in HIL_GPS, 11 mm northwards
    position_resolution_deg: Annotated[float, Range(0.0, 1e-3)] = 1e-7
    height_resolution_m: Annotated[float, _METRES] = 0.001  # default 0.001 as in HIL_GPS
    velocity_resolution_m_s: Annotated[float, Range(0.0, 10.0)] = 0.01  # default 0.01 as in HIL_GPS
    # says that its fix is one with corrections (`fix_type` 6), or a plain one (3)
    rtk: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Barometer(Timing):
    """Static pressure."""

    units = ("baro",)

    noise_pa: Annotated[float, Range(0.0, 1000.0)] = 0.0  # white noise
    # pressure of the day against the standard, drawn once a flight
    offset_pa: Annotated[float, Range(0.0, 10000.0)] = 0.0
    # deviation of what changes slowly, a Gauss–Markov process
    drift_pa: Annotated[float, Range(0.0, 1000.0)] = 0.0
    drift_time_s: Annotated[float, _SECONDS] = 600.0  # its correlation time
    resolution_pa: Annotated[float, Range(0.0, 100.0)] = 0.0
    outlier_pa: Annotated[float, Range(0.0, 10000.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Magnetometer(Timing):
    """The Earth's field, as bent by the vehicle."""

    units = ("mag",)

    field_gauss: Annotated[V3, Range(-1.0, 1.0)]  # the Earth's field, NED
    noise_gauss: Annotated[float, Range(0.0, 1.0)] = 0.0  # white noise of each axis
    offset_gauss: Annotated[float, Range(0.0, 1.0)] = 0.0  # of each axis, drawn once a flight
    # scale error of each axis, drawn once a flight
    scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0
    resolution_gauss: Annotated[float, Range(0.0, 0.1)] = 0.0
    outlier_gauss: Annotated[float, Range(0.0, 10.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Rangefinder(Timing):
    """Distance along the base's z axis to the ground; silent where it is out of range."""

    units = ("distance",)

    least_m: Annotated[float, _METRES] = 0.0  # nearer, nothing is sent
    most_m: Annotated[float, _METRES] = 100.0  # farther, nothing is sent
    noise_m: Annotated[float, _METRES] = 0.0  # white noise
    scale_share: Annotated[float, Range(0.0, 0.5)] = 0.0  # scale error, drawn once a flight
    resolution_m: Annotated[float, Range(0.0, 1.0)] = 0.0
    outlier_m: Annotated[float, _METRES] = 0.0  # too short


@dataclass(frozen=True, slots=True, kw_only=True)
class Encoders(Timing):
    """Angles of the joints; no rate is measured."""

    units = ("encoder",)

    resolution_rad: Annotated[float, Range(0.0, 1.0)] = 0.0
    noise_rad: Annotated[float, Range(0.0, 1.0)] = 0.0  # white noise of each joint
    offset_rad: Annotated[float, Range(0.0, 1.0)] = 0.0  # error of each zero, drawn once a flight
    outlier_rad: Annotated[float, Range(0.0, 3.2)] = 0.0  # of the first joint


@dataclass(frozen=True, slots=True, kw_only=True)
class ForceTorque(Timing):
    """What acts on the tool from outside, in the axes of the last link, tared.

    The defaults are our choice, typical of a small sensor of six axes.
    """

    rate_hz: Annotated[float, Range(0.1, 500.0)] = 500.0
    latency_ms: Annotated[float, _MS] = 2.0
    force_n: Annotated[float, Range(0.0, 100.0)] = 0.05  # white noise of each axis; default 0.05
    torque_n_m: Annotated[float, Range(0.0, 10.0)] = 0.002  # the same; default 0.002
    # of each axis, drawn once a flight; default 0.2
    force_bias_n: Annotated[float, Range(0.0, 100.0)] = 0.2
    torque_bias_n_m: Annotated[float, Range(0.0, 10.0)] = 0.005  # the same; default 0.005
    force_resolution_n: Annotated[float, Range(0.0, 10.0)] = 0.0125  # default 0.0125
    torque_resolution_n_m: Annotated[float, Range(0.0, 1.0)] = 0.0005  # default 0.0005
    outlier_n: Annotated[float, Range(0.0, 1000.0)] = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasuredSensors:
    """A suite of sensors; what is None is not on board."""

    suite: SuiteName
    # In the order in which what they say of one step is sent.
    motion_capture: MotionCapture | None = None
    visual_odometry: VisualOdometry | None = None
    gnss: Gnss | None = None
    barometer: Barometer | None = None
    magnetometer: Magnetometer | None = None
    rangefinder: Rangefinder | None = None
    force_torque: ForceTorque | None = None  # of no suite: where the scenario has its table
    encoders: Encoders
    imu: Imu

    @property
    def units(self) -> tuple[Unit, ...]:
        """What of them can fail."""
        aboard = [getattr(self, field.name) for field in fields(self)]
        return tuple(unit for one in aboard if isinstance(one, Timing) for unit in one.units)
