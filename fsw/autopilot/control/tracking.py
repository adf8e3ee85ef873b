r"""The loop that follows the plan: LQR on position through snap, every tick.

For each horizontal axis, with e = plan - vehicle and the plan's own snap command as
feed-forward, the commanded snap is

.. math:: w = k_p(u - a_p) - k_d j_p + K_5 e_s + K_4 (J - j), \quad
          J = j_p + \frac{K_3}{K_4}(A - a), \quad
          A = a_p + \frac{K_1 e_p + K_2 e_v - K_d (\hat d - \bar d)}{K_3} - \bar d

which is the LQR law in cascade form, so that acceleration (tilt) and jerk (tilt rate) can
be limited on the way. The gain on the disturbance is for one that is forgotten within
milliseconds; of what lasts, wind, :math:`\bar d` keeps the mean and all of it is cancelled.
The body's angular acceleration then solves
:math:`-f(\dot\omega_y b_1 - \dot\omega_x b_2) = w`. Height is the same with one stage.

Across the arm's plane the point that accelerates as the thrust leans is the centre of mass, a
little below the body origin: position and velocity of the laws are those of that point.

Source: docs/equations.md T2; docs/decisions/0005-tracking-inner-loop.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

from fsw.autopilot.control.gains import TrackingGains, TrackingTuning
from fsw.autopilot.geometry.rotation import Axes
from fsw.autopilot.geometry.vectors import Vector, clamp_magnitude
from fsw.autopilot.model.airframe import GRAVITY, AttitudeLag
from fsw.autopilot.model.rotors import MotionState
from fsw.autopilot.signals import Vec2, Vec3
from fsw.autopilot.tick_record import (
    AnyEstimate,
    AnyInput,
    AnyPlan,
    Observed,
)
from fsw.compiled import compilable

_LEAST_SPECIFIC_THRUST = 2.0  # m/s^2; below it tilt hardly accelerates the vehicle
_RECENT_S = 2.0  # in which a disturbance fades that is not seen again


@dataclass(frozen=True, slots=True)
class TrackingLaw:
    """Everything the law needs that does not change in flight."""

    lag: AttitudeLag
    tuning: TrackingTuning
    gains: TrackingGains


@compilable
def observe(k: Observed, v: Vec3, a: Vec3, tuning: TrackingTuning, dt: float) -> None:
    """Velocity and disturbance a tick of ``dt`` [s] later, in what is ``k`` (known).

    A second-order observer with both poles at ``observer_bandwidth``: as quick as differencing the
    measured velocity ``v`` [m/s, NED], but the disturbance is a state and does not carry the
    reading's noise straight into the rotors, which produce ``a`` [m/s^2, NED]. What is ``k.known``
    of the disturbance is no wind.
    """
    bandwidth = tuning.observer_bandwidth
    for axis in range(3):
        predicted = k.v[axis] + dt * (a[axis] + k.d[axis])
        surprise = v[axis] - predicted
        k.v[axis] = predicted + 2.0 * bandwidth * dt * surprise
        k.d[axis] += bandwidth * bandwidth * dt * surprise
    share = min(dt / tuning.wind_time, 1.0)
    for axis in range(2):
        lasts = k.d[axis] - k.known[axis] - k.disturbance_bias[axis]
        grown = k.disturbance_bias[axis] + share * lasts
        k.disturbance_bias[axis] = clamp_magnitude(grown, tuning.wind_limit)
    faded = k.recent * (1.0 - min(dt / _RECENT_S, 1.0))
    x, y = k.d[0] - k.known[0], k.d[1] - k.known[1]
    k.recent = max(math.sqrt(x * x + y * y), faded)


class AxisState(NamedTuple):
    """One horizontal axis of the vehicle or of the plan, world."""

    p: float  # m
    v: float  # m/s
    a: float  # m/s^2
    j: float  # m/s^3
    s: float  # m/s^4


@compilable
def wanted_acceleration(
    law: TrackingLaw, vehicle: AxisState, d: float, bias: float, plan: AxisState
) -> float:
    """Acceleration [m/s^2] of one horizontal axis that the law asks for, before its limit.

    ``d`` [m/s^2] and ``bias`` [m/s^2] are those of ``snap_command``.
    """
    k = law.gains.k
    k1, k2, k3 = k[0], k[1], k[2]
    e_p = clamp_magnitude(plan.p - vehicle.p, law.tuning.position_error_limit)
    e_v = plan.v - vehicle.v
    feedback = k1 * e_p + k2 * e_v - law.gains.k_disturbance * (d - bias)
    return plan.a + feedback / k3 - bias


@compilable
def snap_command(
    law: TrackingLaw,
    vehicle: AxisState,
    d: float,
    bias: float,
    plan: AxisState,
    u: float,
    known: float = 0.0,
    push: float = 0.0,
) -> float:
    """Commanded snap [m/s^4] of one horizontal axis, for the plan's acceleration ``u`` [m/s^2].

    ``d`` [m/s^2] is the observed disturbance, ``bias`` [m/s^2] its slow part, wind, which is
    cancelled whole. What a surface adds that the tool presses on is ``known`` [m/s^2], and the plan
    counts on a ``push`` [m/s^2] of it: that it comes or goes takes nothing from the jerk.
    """
    tuning, lag = law.tuning, law.lag
    k = law.gains.k
    k3, k4, k5 = k[2], k[3], k[4]
    e_s = plan.s - vehicle.s
    wanted = wanted_acceleration(law, vehicle, d, bias, plan)
    a_ref = clamp_magnitude(wanted + known, tuning.acceleration_limit) - known
    # The surface may be gone the next moment: the vehicle leans on it no farther than it may else.
    a_ref = clamp_magnitude(a_ref, tuning.acceleration_limit)
    j_ref = plan.j + k3 / k4 * (a_ref - vehicle.a)
    # A jerk that can still be stopped before the acceleration overshoots.
    stoppable = math.sqrt(2.0 * tuning.stopping_snap * (abs(a_ref - vehicle.a) + 0.15))
    most = tuning.jerk_limit + k3 / k4 * abs(known - push)
    j_ref = clamp_magnitude(j_ref, min(most, stoppable))
    return lag.kp * (u - plan.a) - lag.kd * plan.j + k5 * e_s + k4 * (j_ref - vehicle.j)


@compilable
def vertical_acceleration(
    law: TrackingLaw, p: Vector, v: Vector, a: Vec3, d: float, plan: AnyPlan, u: AnyInput
) -> float:
    """Acceleration down [m/s^2] that the law asks for.

    ``p`` [m, NED], ``v`` [m/s, NED] and ``a`` [m/s^2, NED] are the body's, ``d`` [m/s^2] is the
    observed disturbance downwards.
    """
    k_z = law.gains.k_vertical
    k1, k2, k3 = k_z[0], k_z[1], k_z[2]
    a_z = u.a[2] + k1 * (plan.p[2] - p[2]) + k2 * (plan.v[2] - v[2]) + k3 * (plan.a[2] - a[2])
    d_z = clamp_magnitude(d, law.tuning.vertical_disturbance_limit)
    return a_z - law.gains.k_vertical_disturbance * d_z


@compilable
def beyond_plan(observed: Observed, u: AnyInput) -> Vec3:
    """What a surface accelerates the base by [m/s^2, NED], beyond what the plan ``u`` counts on."""
    k, push = observed.known, u.push
    return k[0] - push[0], k[1] - push[1], k[2] - push[2]


@compilable
def wanted_accelerations(
    law: TrackingLaw,
    estimate: AnyEstimate,
    motion: MotionState,
    observed: Observed,
    plan: AnyPlan,
    u: AnyInput,
) -> Vec3:
    """What ``follow_plan`` asks for on all axes [m/s^2, NED]."""
    p, v, d, bias = estimate.p_WB, observed.v, observed.d, observed.disturbance_bias
    known, push = beyond_plan(observed, u), u.push
    x, planned = _along(0, p[0], v[0], motion, plan)
    north = wanted_acceleration(law, x, d[0] - push[0], bias[0] + known[0], planned)
    y, planned = _along(1, p[1], v[1], motion, plan)
    east = wanted_acceleration(law, y, d[1] - push[1], bias[1] + known[1], planned)
    lift = d[2] - observed.known[2]
    down = vertical_acceleration(law, p, v, motion.a, lift, plan, u) - known[2]
    return north, east, down


@compilable
def _along(
    axis: int, p: float, v: float, motion: MotionState, plan: AnyPlan
) -> tuple[AxisState, AxisState]:
    """The vehicle at ``p`` [m] with ``v`` [m/s] and the plan, along one horizontal axis."""
    return (
        AxisState(p, v, motion.a[axis], motion.j[axis], motion.s[axis]),
        AxisState(plan.p[axis], plan.v[axis], plan.a[axis], plan.j[axis], plan.s[axis]),
    )


@compilable
def velocity_of_mass(estimate: AnyEstimate, swing: Axes) -> Vec3:
    """Velocity [m/s, NED] of the centre of mass, as far as turning makes it another.

    ``swing`` (9,) [m] is what it gets in B of a rate of the base, while drives are free: of an arm
    that the base pushes off as it turns, nothing.
    """
    R, v, w = estimate.R_WB, estimate.v_WB, estimate.w_WB_B
    x = swing[0] * w[0] + swing[1] * w[1]
    y = swing[3] * w[0] + swing[4] * w[1]
    return v[0] + x * R[0] + y * R[1], v[1] + x * R[3] + y * R[4], v[2]


@compilable
def follow_plan(
    law: TrackingLaw,
    mass: float,
    swing: Axes,
    estimate: AnyEstimate,
    motion: MotionState,
    observed: Observed,
    plan: AnyPlan,
    u: AnyInput,
) -> tuple[Vec2, float]:
    """Angular acceleration about body x and y [rad/s^2] and total thrust [N].

    ``mass`` [kg] is the whole vehicle's, as estimated in flight, its ``swing`` (9,) [m] as of
    ``velocity_of_mass``; the observed velocity is that of the centre, without the reading's noise.
    """
    p, v, R = estimate.p_WB, observed.v, estimate.R_WB
    c, s = math.cos(estimate.yaw), math.sin(estimate.yaw)
    # By which the body's z axis is ahead of the plan's, and goes; how far that swings the centre.
    lean = R[2] + plan.a[0] / GRAVITY, R[5] + plan.a[1] / GRAVITY
    off = _swung(swing, c, s, lean)
    going = _swung(swing, c, s, (plan.j[0] / GRAVITY, plan.j[1] / GRAVITY))
    wx = _horizontal_snap(law, 0, estimate, motion, observed, plan, u, off[0], going[0])
    wy = _horizontal_snap(law, 1, estimate, motion, observed, plan, u, off[1], going[1])
    f = max(motion.thrust / mass, _LEAST_SPECIFIC_THRUST)
    # -f [b1_xy, -b2_xy] [wdy; wdx] = w_xy; the determinant is -R33, far from zero in flight.
    determinant = R[0] * -R[4] + R[1] * R[3]
    wdy = (wx * -R[4] + R[1] * wy) / (-f * determinant)
    wdx = (R[0] * wy - R[3] * wx) / (-f * determinant)

    lift = observed.d[2] - observed.known[2]
    a_z = vertical_acceleration(law, p, v, motion.a, lift, plan, u)
    a_z -= observed.known[2] - u.push[2]
    thrust = mass * (GRAVITY - a_z) / max(R[8], 0.5)
    return (wdx, wdy), thrust


@compilable
def _swung(swing: Axes, c: float, s: float, lean: Vec2) -> Vec2:
    """How far [m, NED] the centre of mass swings as the body's z axis leans by ``lean`` [1, NED].

    ``c`` [1] and ``s`` [1] are cosine and sine of the yaw.
    """
    forward, right = c * lean[0] + s * lean[1], c * lean[1] - s * lean[0]
    # Leaning forward is a turn about y, to the right one about -x.
    x = swing[1] * forward - swing[0] * right
    y = swing[4] * forward - swing[3] * right
    return c * x - s * y, s * x + c * y


@compilable
def _horizontal_snap(
    law: TrackingLaw,
    axis: int,
    estimate: AnyEstimate,
    motion: MotionState,
    observed: Observed,
    plan: AnyPlan,
    u: AnyInput,
    off: float,
    going: float,
) -> float:
    p, v = estimate.p_WB[axis] + off, observed.v[axis] + going
    vehicle, planned = _along(axis, p, v, motion, plan)
    bias = observed.disturbance_bias[axis] + (observed.known[axis] - u.push[axis])
    d, known = observed.d[axis] - u.push[axis], observed.known[axis]
    return snap_command(law, vehicle, d, bias, planned, u.a[axis], known, u.push[axis])
