"""Where the vehicle is on Earth, as standard MAVLink messages; pure, in wire order.

The local frame is measured; the place of its origin on Earth is configured.
"""

from __future__ import annotations

import math
from typing import Final

from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.geometry.geodesy import to_global
from fsw.autopilot.geometry.rotation import quaternion_from_matrix
from fsw.autopilot.signals import FlightSnapshot, SatelliteFix, Vec3
from fsw.link.wire.encode_standard import boot_ms
from fsw.link.wire.outgoing import TelemetryContext, WireValues

_LOCAL_NED: Final = 1  # MAV_FRAME
_BODY_FRD: Final = 12  # MAV_FRAME
_MOCAP: Final = 6  # MAV_ESTIMATOR_TYPE
_COVARIANCE_UNKNOWN: Final[tuple[float, ...]] = (math.nan, *(0.0,) * 20)
_I16: Final = 32767
_AUTOPILOT: Final = 8  # MAV_ESTIMATOR_TYPE
_UNKNOWN_U16, _U32 = 0xFFFF, 0xFFFFFFFF
_NO_FIX: Final = 1  # GPS_FIX_TYPE
_RESOLUTION: Final = 1e-3  # m and m/s, of an accuracy in GPS_RAW_INT
_NAN: Final[Vec3] = (math.nan,) * 3
# With any of these nothing measures the place.
_NOWHERE: Final = frozenset(
    condition.value
    for condition in (
        Condition.ESTIMATE_INVALID,
        Condition.POSITION_LOST,
        Condition.AIDING_LOST,
    )
)


def global_position(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """GLOBAL_POSITION_INT of the body origin."""
    estimate = snapshot.estimate
    latitude, longitude, altitude = _scaled(to_global(context.origin, estimate.p_WB))
    vx, vy, vz = (min(max(round(100.0 * v), -_I16), _I16) for v in estimate.v_WB)
    heading = round(100.0 * _degrees(estimate.yaw)) % 36000
    above = round(1000.0 * _above_home(snapshot))
    return (boot_ms(snapshot.t_us), latitude, longitude, altitude, above, vx, vy, vz, heading)


def home_position(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues | None:
    """HOME_POSITION, once there is one; level ground and no direction of approach."""
    home = snapshot.home
    if home is None:
        return None
    half = 0.5 * home.yaw
    heading = (math.cos(half), 0.0, 0.0, math.sin(half))
    place = _scaled(to_global(context.origin, home.p))
    return (*place, *home.p, *heading, 0.0, 0.0, 0.0, snapshot.t_us)


def global_origin(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """GPS_GLOBAL_ORIGIN: where the local frame begins."""
    return (*_scaled(to_global(context.origin, (0.0, 0.0, 0.0))), snapshot.t_us)


def altitude(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """ALTITUDE; nothing is known about the terrain."""
    local = -snapshot.estimate.p_WB[2]
    mean_sea = context.origin.altitude + local
    above_home = _above_home(snapshot)
    return (snapshot.t_us, mean_sea, mean_sea, local, above_home, math.nan, math.nan)


def vfr_hud(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """VFR_HUD; without an airspeed sensor the ground speed stands for it."""
    estimate = snapshot.estimate
    vx, vy, vz = estimate.v_WB
    speed = math.hypot(vx, vy)
    thrust = context.facts.thrust_share(snapshot.actuators)
    heading = round(_degrees(estimate.yaw)) % 360
    mean_sea = context.origin.altitude - estimate.p_WB[2]
    return (speed, speed, mean_sea, -vz, heading, round(100.0 * thrust))


def odometry(snapshot: FlightSnapshot, _: TelemetryContext) -> WireValues:
    """ODOMETRY: pose in local NED, velocity in the body; exact states have no covariance.

    Of the covariance, errors of the attitude are about the body's axes.
    """
    known = snapshot.estimator
    pose, motion, resets, kind = _COVARIANCE_UNKNOWN, _COVARIANCE_UNKNOWN, 0, _MOCAP
    if known is not None:
        pose, motion = known.pose_covariance, known.velocity_covariance
        resets, kind = known.resets & 0xFF, _AUTOPILOT
    estimate = snapshot.estimate
    r, v = estimate.R_WB, estimate.v_WB
    v_B = tuple(r[i] * v[0] + r[i + 3] * v[1] + r[i + 6] * v[2] for i in range(3))
    return (
        snapshot.t_us,
        *estimate.p_WB,
        *quaternion_from_matrix(r),
        *v_B,
        *estimate.w_WB_B,
        *pose,
        *motion,
        _LOCAL_NED,
        _BODY_FRD,
        resets,
        kind,
        0,
    )


def gps_raw(snapshot: FlightSnapshot, context: TelemetryContext) -> WireValues:
    """GPS_RAW_INT: what the receiver said last, or else the estimate as a fix.

    Programs wait for a fix before they arm. A vehicle that knows its place by other sensors knows
    it on Earth too, by the origin of the local frame: where this holds it is a fix in three
    dimensions of unknown satellites, with the accuracy of the estimate.
    """
    known = snapshot.estimator
    fix = None if known is None else known.fix
    if fix is None:
        fix = _estimate_as_fix(snapshot)
    known_place = math.isfinite(sum(fix.p))
    place = _scaled(to_global(context.origin, fix.p)) if known_place else (0, 0, 0)
    north, east, _ = fix.v if known_place else (0.0, 0.0, 0.0)
    level = max(fix.position_sigma[0], fix.position_sigma[1])
    down = fix.position_sigma[2]
    return (
        fix.t_us,
        *place,
        _UNKNOWN_U16,  # dilution of precision
        _UNKNOWN_U16,
        _at_most(100.0 * math.hypot(north, east), _UNKNOWN_U16 - 1),
        round(100.0 * _degrees(math.atan2(east, north))) % 36000,
        fix.kind,
        fix.satellites,
        0,  # height above the ellipsoid: not known
        _at_most(1e3 * level, _U32),
        _at_most(1e3 * down, _U32),
        _at_most(1e3 * fix.velocity_sigma, _U32),
        0,  # heading
        0,
    )


def _estimate_as_fix(snapshot: FlightSnapshot) -> SatelliteFix:
    """The place without a receiver; exact states are accurate to what the message resolves."""
    known, estimate = snapshot.estimator, snapshot.estimate
    if not _NOWHERE.isdisjoint(snapshot.failures) or (known is not None and known.unaided_us < 0):
        return SatelliteFix(snapshot.t_us, _NAN, _NAN, _NAN, math.nan, kind=_NO_FIX)
    sigma, speed_sigma = (_RESOLUTION,) * 3, _RESOLUTION
    if known is not None:
        pose, motion = known.pose_covariance, known.velocity_covariance
        sigma = (math.sqrt(pose[0]), math.sqrt(pose[6]), math.sqrt(pose[11]))
        speed_sigma = math.sqrt(max(motion[0], motion[6], motion[11]))
    return SatelliteFix(snapshot.t_us, estimate.p_WB, estimate.v_WB, sigma, speed_sigma)


def _scaled(place: Vec3) -> tuple[int, int, int]:
    """Degrees times 1e7 and millimetres."""
    return round(1e7 * place[0]), round(1e7 * place[1]), round(1000.0 * place[2])


def _above_home(snapshot: FlightSnapshot) -> float:
    ground = 0.0 if snapshot.home is None else snapshot.home.p[2]
    return ground - snapshot.estimate.p_WB[2]


def _degrees(yaw: float) -> float:
    return math.degrees(yaw) % 360.0


def _at_most(value: float, most: int) -> int:
    """A rounded number within a field; 0, which is unknown, for what is none."""
    return min(round(value), most) if math.isfinite(value) else 0
