r"""The loop that follows the plan: LQR on position through snap, every tick.

For each horizontal axis, with e = plan - vehicle and the plan's own snap command as
feed-forward, the commanded snap is

.. math:: w = k_p(u - a_p) - k_d j_p + K_5 e_s + K_4 (J - j), \quad
          J = j_p + \frac{K_3}{K_4}(A - a), \quad
          A = a_p + \frac{K_1 e_p + K_2 e_v - K_d \hat d}{K_3}

which is the LQR law in cascade form, so that acceleration (tilt) and jerk (tilt rate) can
be limited on the way. The body's angular acceleration then solves
:math:`-f(\dot\omega_y b_1 - \dot\omega_x b_2) = w`. Height is the same with one stage.

Source: docs/equations.md T2; docs/decisions/0005-tracking-inner-loop.md.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from fsw.control.inner_tuning import TrackingGains, TrackingTuning
from fsw.model.airframe import GRAVITY, Airframe
from fsw.model.prediction import LagModel
from fsw.model.rotors import MotionState
from fsw.signals import PlanInput, PredictionState, StateEstimate, Vec2, Vec3

_LEAST_SPECIFIC_THRUST = 2.0  # m/s^2; below it tilt hardly accelerates the vehicle


@dataclass(frozen=True, slots=True)
class TrackingLaw:
    """Everything the law needs that does not change in flight."""

    airframe: Airframe
    lag: LagModel
    tuning: TrackingTuning
    gains: TrackingGains


def observe_disturbance(
    v_hat: Vec3, v: Vec3, a: Vec3, bandwidth: float, dt: float
) -> tuple[Vec3, Vec3]:
    """Disturbance acceleration from the velocity the rotors do not explain.

    Args:
        v_hat: Velocity predicted by the observer last tick [m/s].
        v: Measured velocity [m/s].
        a: Acceleration the rotors produce [m/s^2].
        bandwidth: Observer gain [1/s].
        dt: Tick length [s].

    Returns:
        The disturbance estimate [m/s^2] and the velocity to pass back next tick.
    """
    dx, dy, dz = (
        bandwidth * (v[0] - v_hat[0]),
        bandwidth * (v[1] - v_hat[1]),
        bandwidth * (v[2] - v_hat[2]),
    )
    predicted = (
        v_hat[0] + dt * (a[0] + dx),
        v_hat[1] + dt * (a[1] + dy),
        v_hat[2] + dt * (a[2] + dz),
    )
    return (dx, dy, dz), predicted


def snap_command(
    law: TrackingLaw,
    e_p: float,
    e_v: float,
    e_s: float,
    d: float,
    a: float,
    j: float,
    a_plan: float,
    j_plan: float,
    u: float,
) -> float:
    """Commanded snap of one horizontal axis [m/s^4]."""
    tuning, lag = law.tuning, law.lag
    k1, k2, k3, k4, k5 = law.gains.k
    e_p = _limit(e_p, tuning.position_error_limit)
    wanted_a = a_plan + (k1 * e_p + k2 * e_v - law.gains.k_disturbance * d) / k3
    wanted_a = _limit(wanted_a, tuning.acceleration_limit)
    wanted_j = j_plan + k3 / k4 * (wanted_a - a)
    # A jerk that can still be stopped before the acceleration overshoots.
    stoppable = math.sqrt(120.0 * (abs(wanted_a - a) + 0.15))
    wanted_j = _limit(wanted_j, min(tuning.jerk_limit, stoppable))
    return lag.kp * (u - a_plan) - lag.kd * j_plan + k5 * e_s + k4 * (wanted_j - j)


def follow_plan(
    law: TrackingLaw,
    estimate: StateEstimate,
    motion: MotionState,
    disturbance: Vec3,
    plan: PredictionState,
    u: PlanInput,
) -> tuple[Vec2, float]:
    """Angular acceleration about body x and y [rad/s^2] and total thrust [N].

    Args:
        law: Airframe, lag and gains.
        estimate: The vehicle now.
        motion: Its acceleration, jerk and snap.
        disturbance: Estimated disturbance acceleration [m/s^2].
        plan: Where the plan wants the vehicle now.
        u: The plan's input now.
    """
    p, v = estimate.p_WB, estimate.v_WB
    wx, wy = (
        snap_command(
            law,
            plan.p[axis] - p[axis],
            plan.v[axis] - v[axis],
            plan.s[axis] - motion.s[axis],
            disturbance[axis],
            motion.a[axis],
            motion.j[axis],
            plan.a[axis],
            plan.j[axis],
            u.a[axis],
        )
        for axis in (0, 1)
    )
    R = estimate.R_WB
    f = max(motion.thrust / law.airframe.mass, _LEAST_SPECIFIC_THRUST)
    # -f [b1_xy, -b2_xy] [wdy; wdx] = w_xy; the determinant is -R33, far from zero in flight.
    determinant = R[0] * -R[4] + R[1] * R[3]
    wdy = (wx * -R[4] + R[1] * wy) / (-f * determinant)
    wdx = (R[0] * wy - R[3] * wx) / (-f * determinant)

    k1, k2, k3 = law.gains.k_vertical
    a_z = (
        u.a[2] + k1 * (plan.p[2] - p[2]) + k2 * (plan.v[2] - v[2]) + k3 * (plan.a[2] - motion.a[2])
    )
    thrust = law.airframe.mass * (GRAVITY - a_z) / max(R[8], 0.5)
    return (wdx, wdy), thrust


def _limit(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
