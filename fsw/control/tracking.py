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


@dataclass(frozen=True, slots=True)
class Observed:
    """What the observer believes between two velocity readings."""

    v: Vec3  # m/s
    d: Vec3  # m/s^2, disturbance acceleration


def observe(memory: Observed, v: Vec3, a: Vec3, bandwidth: float, dt: float) -> Observed:
    """Velocity and disturbance from a velocity reading and the rotors' acceleration.

    A second-order observer with both poles at ``bandwidth``: as
    quick as differencing the velocity, but the disturbance is a state and does not carry
    the reading's noise straight into the rotors.

    Args:
        memory: From the last tick.
        v: Measured velocity [m/s].
        a: Acceleration the rotors produce [m/s^2].
        bandwidth: Of the observer [rad/s].
        dt: Tick length [s].
    """
    gain_v, gain_d = 2.0 * bandwidth * dt, bandwidth * bandwidth * dt
    velocity, disturbance = [], []
    for axis in range(3):
        d = memory.d[axis]
        predicted = memory.v[axis] + dt * (a[axis] + d)
        surprise = v[axis] - predicted
        velocity.append(predicted + gain_v * surprise)
        disturbance.append(d + gain_d * surprise)
    return Observed(
        (velocity[0], velocity[1], velocity[2]),
        (disturbance[0], disturbance[1], disturbance[2]),
    )


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
    mass: float,
    estimate: StateEstimate,
    motion: MotionState,
    observed: Observed,
    plan: PredictionState,
    u: PlanInput,
) -> tuple[Vec2, float]:
    """Angular acceleration about body x and y [rad/s^2] and total thrust [N].

    Args:
        law: Airframe, lag and gains.
        mass: Of the whole vehicle, as weighed in flight [kg].
        estimate: The vehicle now.
        motion: Its acceleration, jerk and snap.
        observed: Its velocity without the reading's noise, and the disturbance.
        plan: Where the plan wants the vehicle now.
        u: The plan's input now.
    """
    p, v = estimate.p_WB, observed.v
    wx, wy = (
        snap_command(
            law,
            plan.p[axis] - p[axis],
            plan.v[axis] - v[axis],
            plan.s[axis] - motion.s[axis],
            observed.d[axis],
            motion.a[axis],
            motion.j[axis],
            plan.a[axis],
            plan.j[axis],
            u.a[axis],
        )
        for axis in (0, 1)
    )
    R = estimate.R_WB
    f = max(motion.thrust / mass, _LEAST_SPECIFIC_THRUST)
    # -f [b1_xy, -b2_xy] [wdy; wdx] = w_xy; the determinant is -R33, far from zero in flight.
    determinant = R[0] * -R[4] + R[1] * R[3]
    wdy = (wx * -R[4] + R[1] * wy) / (-f * determinant)
    wdx = (R[0] * wy - R[3] * wx) / (-f * determinant)

    k1, k2, k3 = law.gains.k_vertical
    a_z = (
        u.a[2] + k1 * (plan.p[2] - p[2]) + k2 * (plan.v[2] - v[2]) + k3 * (plan.a[2] - motion.a[2])
    )
    thrust = mass * (GRAVITY - a_z) / max(R[8], 0.5)
    return (wdx, wdy), thrust


def _limit(value: float, bound: float) -> float:
    return min(max(value, -bound), bound)
