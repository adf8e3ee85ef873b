"""Gains of the 500 Hz loops and where they come from."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np
from scipy.linalg import solve_discrete_are

from fsw.autopilot.control.arm_compensation import CompensationLimits
from fsw.autopilot.control.joint_reference import JointReferenceLimits
from fsw.autopilot.control.pid import PidGains
from fsw.autopilot.control.press import PressTuning
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.prediction import Array, zero_order_hold


@dataclass(frozen=True, slots=True)
class TrackingTuning:
    """Design of the loop that follows the plan (docs/decisions/0005-tracking-inner-loop.md).

    The gains are those of a discrete LQR on the position of one point; ``input_weight`` is its
    weight on snap. A smaller weight follows the plan more closely until the rotors saturate:
    2e-7 is the smallest with which the worst disturbance of 0.8 m/s^2 on one axis does not
    (``tube.py``, docs/decisions/0026-a-tube-that-holds.md).
    """

    input_weight: float = 2e-7  # horizontal, on (m/s^4)^2
    # The point sits half-way down to a hanging end-effector: holding the base alone, every
    # correction swings the end-effector; holding the end-effector alone, the base wanders.
    point_below_base: float = 0.1125  # m
    # Soft: thrust that height does not ask for is left for roll and pitch, which share the rotors.
    vertical_input_weight: float = 1e-3  # on (m/s^2)^2
    disturbance_correlation: float = 0.05  # s, of the Ornstein-Uhlenbeck model
    vertical_disturbance_correlation: float = 0.3  # s
    # Of the observed one, what thrust reacts to: at take-over the rotor model is off by more. Above
    # what a disturbance of 0.8 m/s^2 looks like that turns after a part of it was taken for mass.
    vertical_disturbance_limit: float = 1.7  # m/s^2
    observer_bandwidth: float = 130.0  # rad/s
    # Wind: what stays of the observed disturbance is cancelled whole. Slowly, because the mean of
    # a random one is not wind, and within a limit, because the estimate adds to a push that
    # acts one way for long and then the other (``tube.py``).
    wind_time: float = 10.0  # s
    wind_limit: float = 0.5  # m/s^2 an axis; clearances grow by what it takes (``wind_beyond``)
    position_error_limit: float = 0.12  # m; above the tube, or the loop is not the linear one
    acceleration_limit: float = 2.5  # m/s^2
    jerk_limit: float = 20.0  # m/s^3
    # A jerk is limited to what this snap stops before the acceleration overshoots. Below what the
    # tube needs (60 was) it makes the loop sluggish just where a disturbance is at its worst.
    stopping_snap: float = 100.0  # m/s^4


@dataclass(frozen=True, slots=True)
class TrackingGains:
    """Feedback on (position, velocity, acceleration, jerk, snap) and on the disturbance."""

    k: tuple[float, float, float, float, float]
    k_disturbance: float
    k_vertical: tuple[float, float, float]
    k_vertical_disturbance: float


@dataclass(frozen=True, slots=True)
class LoopGains:
    """Everything the cascade can be tuned by."""

    attitude: PidGains = field(default_factory=lambda: PidGains(50.0, 8.0, 15.0, 25.0))
    height: PidGains = field(default_factory=lambda: PidGains(7.1429, 1.4286, 3.4286, 4.0))
    # No integral: what stays of a disturbance, the joint loop's observer takes off.
    joint: PidGains = field(default_factory=lambda: PidGains(625.0, 0.0, 50.0, 300.0))
    yaw: PidGains = field(default_factory=lambda: PidGains(4.0, 0.0, 4.0, 0.5))
    compensate: bool = True  # the arm holds the end-effector while the base is pushed
    compensation: CompensationLimits = field(default_factory=CompensationLimits)
    joint_limits: JointReferenceLimits = field(default_factory=JointReferenceLimits)
    # N a rotor, of what roll and pitch leave: three times the plan's yaw acceleration, so that
    # the loop has something left to correct with
    yaw_thrust_limit: float = 3.0
    tracking: TrackingTuning = field(default_factory=TrackingTuning)
    press: PressTuning = field(default_factory=PressTuning)
    # At a surface that it may touch the arm takes up all that the base is pushed about.
    compensation_near: CompensationLimits = field(
        default_factory=lambda: CompensationLimits(whole=0.08, most=0.12, near=0.12, far=0.2)
    )


@lru_cache(maxsize=8)
def tracking_gains(tuning: TrackingTuning, rotor_lag: float, dt: float) -> TrackingGains:
    """Design the tracking loop for a time constant ``rotor_lag`` [s] and a tick of ``dt`` [s]."""
    # p, v, a, j, s and the disturbance acceleration that adds to v's derivative.
    a = np.diag([1.0, 1.0, 1.0, 1.0, 0.0], 1)
    a[1, 5] = 1.0
    a[4, 4] = -1.0 / rotor_lag
    a[5, 5] = -1.0 / tuning.disturbance_correlation
    b = np.array([[0.0], [0.0], [0.0], [0.0], [1.0 / rotor_lag], [0.0]])
    # Tilting for an acceleration moves the point below the base by -height / g times it.
    point = np.array([1.0, 0.0, -tuning.point_below_base / GRAVITY, 0.0, 0.0, 0.0])
    k = _lqr(a, b, np.outer(point, point), tuning.input_weight, dt)
    # p, v, a and the disturbance acceleration.
    a_vertical = np.diag([1.0, 1.0, 0.0], 1)
    a_vertical[1, 3] = 1.0
    a_vertical[2, 2] = -1.0 / rotor_lag
    a_vertical[3, 3] = -1.0 / tuning.vertical_disturbance_correlation
    b_vertical = np.array([[0.0], [0.0], [1.0 / rotor_lag], [0.0]])
    k_vertical = _lqr(
        a_vertical, b_vertical, np.diag([1.0, 0.0, 0.0, 0.0]), tuning.vertical_input_weight, dt
    )
    return TrackingGains(
        k=(k[0], k[1], k[2], k[3], k[4]),
        k_disturbance=k[5],
        k_vertical=(k_vertical[0], k_vertical[1], k_vertical[2]),
        k_vertical_disturbance=k_vertical[3],
    )


def _lqr(a: Array, b: Array, q: Array, input_weight: float, dt: float) -> list[float]:
    """Discrete LQR gain of a single-input chain."""
    ad, bd = zero_order_hold(a, b, dt)
    p = solve_discrete_are(ad, bd, q, np.array([[input_weight]]))
    gain = np.linalg.solve(input_weight + bd.T @ p @ bd, bd.T @ p @ ad)
    return [float(value) for value in gain[0]]
