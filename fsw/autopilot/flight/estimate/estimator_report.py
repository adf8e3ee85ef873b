"""What telemetry and log say of the estimator, once a planning period."""

from __future__ import annotations

import math
from operator import attrgetter, itemgetter
from typing import Final

from fsw.autopilot.estimation.error_state import BA, BG, ERRORS, TH, Array, P, V
from fsw.autopilot.estimation.faults.sensor_fault import Health, fault_name
from fsw.autopilot.estimation.fusion_memory import FusionMemory
from fsw.autopilot.estimation.sensors import SENSORS
from fsw.autopilot.estimation.turned_covariance import SAME_AXES, Vec6, turned_covariance
from fsw.autopilot.geometry.vectors import three
from fsw.autopilot.measurements import Sensor
from fsw.autopilot.signals import (
    EstimatorReport,
    SatelliteFix,
    SensorReport,
    StateEstimate,
    TestRatios,
    Vec3,
)
from fsw.frozen import replace

# ESTIMATOR_STATUS_FLAGS of MAVLink
ATTITUDE, LEVEL_VELOCITY, VERTICAL_VELOCITY = 1, 2, 4
RELATIVE, ABSOLUTE, HEIGHT, ABOVE_GROUND = 8, 16, 32, 64
PREDICTED_RELATIVE, PREDICTED_ABSOLUTE = 256, 512
SATELLITES_DOUBTED, ACCELERATION_DOUBTED = 1024, 2048
NO_FIX: Final = 1  # GPS_FIX_TYPE
_NOT_SAID: Final = 255  # satellites
_NOWHERE: Final[Vec3] = (math.nan, math.nan, math.nan)
_NOT_KNOWN: Final = (math.nan,) * 21
# What telemetry still calls known: standard deviations.
_KNOWN_ANGLE: Final = 0.2  # rad
_KNOWN_SPEED: Final = 0.5  # m/s
_KNOWN_PLACE: Final = 0.5  # m, in dead reckoning
AIDS_PLACE: Final = (Sensor.POSE, Sensor.GNSS)
_TESTED: Final = {kind.sensor.value: kind.ratios for kind in SENSORS}
_UPPER: Final = tuple((i, j) for i in range(6) for j in range(i, 6))
_OF_POSE: Final = (P, P + 1, P + 2, TH, TH + 1, TH + 2)
_pose: Final = itemgetter(*[ERRORS * _OF_POSE[i] + _OF_POSE[j] for i, j in _UPPER])
_upper: Final = itemgetter(*[6 * i + j for i, j in _UPPER])


def unaided(memory: FusionMemory, now: float) -> float:
    """Time [s] at ``now`` [s] since a position was used last; infinite: never."""
    used = [one.fused[0] for one in memory.health if one.sensor in AIDS_PLACE and one.fused]
    return now - max(used) if used else math.inf


def estimator_report(
    memory: FusionMemory,
    covariance: Array,
    lasting: Vec6,
    estimate: StateEstimate,
    now: float,
    stale: float,
) -> EstimatorReport:
    """The report at ``now`` [s]; a sensor is silent after ``stale`` [s].

    ``covariance`` (17, 17) [SI] is of the error of the ``estimate`` as the filter knows it; what
    else is ``lasting`` of position [m^2, NED] and attitude [rad^2, FRD] is told with it. Flags say
    what is aided and has not drifted, and go by the filter alone.
    """
    x, entries = memory.numbers[0], covariance.ravel().tolist()
    variances, bias = tuple(entries[:: ERRORS + 1]), tuple(x["bias"].tolist())
    for k, more in zip(_OF_POSE, lasting, strict=True):
        entries[(ERRORS + 1) * k] += more
    without = unaided(memory, now)
    sensors = _sensors(memory, now, stale)
    return EstimatorReport(
        t_us=estimate.t_us,
        pose_covariance=_pose(entries),
        velocity_covariance=_motion(covariance, estimate),
        accel_bias=three(bias, 0),
        gyro_bias=three(bias, 3),
        accel_bias_variance=three(variances, BA),
        gyro_bias_variance=three(variances, BG),
        pose_delay=float(x["pose_delay"]),
        sensors=sensors,
        ratios=_ratios(sensors),
        unaided_us=round(1e6 * without) if without < math.inf else -1,
        resets=memory.reset.number,
        flags=_flags(variances, sensors, aided=without <= stale),
        fix=_fix(memory, now, stale),
    )


def unknown_report(
    last: EstimatorReport, memory: FusionMemory, t_us: int, stale: float
) -> EstimatorReport:
    """The report of a filter that is to start anew, after its ``last`` one: nothing is known.

    A sensor is silent after ``stale`` [s].
    """
    now = memory.now
    without = unaided(memory, now)
    return replace(
        last,
        t_us=t_us,
        pose_covariance=_NOT_KNOWN,
        velocity_covariance=_NOT_KNOWN,
        sensors=_sensors(memory, now, stale),
        ratios=TestRatios(),
        unaided_us=round(1e6 * without) if without < math.inf else -1,
        flags=0,
        fix=_fix(memory, now, stale),
    )


def _fix(memory: FusionMemory, now: float, stale: float) -> SatelliteFix | None:
    """What the receiver said last; without a fix where it says so, or says nothing."""
    fix, heard = memory.gnss, [one for one in (memory.gnss, memory.without_fix) if one is not None]
    if not heard:
        return None
    last = max(heard, key=attrgetter("time"))
    kind, satellites = last.fix_type, last.satellites
    if now - memory.came(Sensor.GNSS) > stale:
        kind, satellites = NO_FIX, _NOT_SAID
    time = round(1e6 * last.time)
    if fix is None:
        return SatelliteFix(time, _NOWHERE, _NOWHERE, _NOWHERE, math.nan, kind, satellites)
    return SatelliteFix(
        time,
        fix.position,
        fix.velocity,
        _roots(fix.position_variance),
        max(_roots(fix.velocity_variance)),
        kind,
        satellites,
    )


def _sensors(memory: FusionMemory, now: float, stale: float) -> tuple[SensorReport, ...]:
    found = [memory.of(Sensor.IMU), memory.of(Sensor.ENCODERS)]
    found += [one for one in memory.health if one.sensor not in (Sensor.IMU, Sensor.ENCODERS)]
    return tuple([_sensor(one, memory.came(one.sensor), now, stale) for one in found])


def _sensor(health: Health, came: float, now: float, stale: float) -> SensorReport:
    fault = health.fault_now(came, now, stale)
    return SensorReport(
        health.sensor.value,
        round(1e6 * (now - came)) if came >= 0.0 else -1,
        fault_name(fault),
        tuple([math.sqrt(one) for one in health.ratio]),
        health.innovation,
    )


def _ratios(sensors: tuple[SensorReport, ...]) -> TestRatios:
    """Of each kind the largest one."""
    found: dict[str, float] = {}
    for one in sensors:
        for kinds, ratio in zip(_TESTED.get(one.name, ()), one.ratio, strict=False):
            found.update({kind: max(found.get(kind, 0.0), ratio) for kind in kinds})
    return TestRatios(**found)


def _flags(variances: tuple[float, ...], sensors: tuple[SensorReport, ...], *, aided: bool) -> int:
    """ESTIMATOR_STATUS_FLAGS: what is known, and what of the sensors is doubted."""
    d = variances
    placed = max(d[P], d[P + 1]) < _KNOWN_PLACE**2
    faulty = {one.name: bool(one.fault) for one in sensors}
    known = (
        (ATTITUDE, max(d[TH : TH + 3]) < _KNOWN_ANGLE**2),
        (LEVEL_VELOCITY, max(d[V], d[V + 1]) < _KNOWN_SPEED**2),
        (VERTICAL_VELOCITY, d[V + 2] < _KNOWN_SPEED**2),
        (RELATIVE | PREDICTED_RELATIVE, placed),
        (ABSOLUTE | PREDICTED_ABSOLUTE, placed and aided),
        (HEIGHT, d[P + 2] < _KNOWN_PLACE**2),
        (ABOVE_GROUND, not faulty.get(Sensor.RANGEFINDER.value, True)),
        (SATELLITES_DOUBTED, faulty.get(Sensor.GNSS.value, False)),
        (ACCELERATION_DOUBTED, faulty.get(Sensor.IMU.value, False)),
    )
    return sum(flag for flag, so in known if so)


def _motion(covariance: Array, estimate: StateEstimate) -> tuple[float, ...]:
    """Velocity in body axes, and rates, of which the error is the gyro's bias."""
    r11, r12, r13, r21, r22, r23, r31, r32, r33 = estimate.R_WB
    back = (r11, r21, r31, r12, r22, r32, r13, r23, r33)
    found = turned_covariance(covariance, (V, BG), (back, SAME_AXES))
    upper: tuple[float, ...] = _upper(found.ravel().tolist())
    return upper


def _roots(variance: Vec3) -> Vec3:
    """Standard deviations; NaN where none is stated."""
    a, b, c = [math.sqrt(one) if one > 0.0 else math.nan for one in variance]
    return a, b, c
