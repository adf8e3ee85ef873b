r"""Rates of the arm's joints, from encoders and the torque that is applied.

Encoders have no rate, and the difference of two readings of 1.5 mrad resolution 2 ms apart is off
by 0.7 rad/s. For each joint a Kalman filter of angle, rate and a disturbing acceleration,

.. math:: \ddot\theta = u + d, \quad \dot d = w,

whose input u is the acceleration that the model of the arm gives for the torques. Readings come at
every tick, so that the gain is the stationary one, found before flight. One reading more or less
makes no difference to it.
"""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from scipy.linalg import solve_discrete_are

from fsw.compiled import compilable
from fsw.estimation.tuning import EstimatorTuning
from fsw.signals import Vec3


class JointState(NamedTuple):
    """What the filter believes of one joint."""

    angle: float  # rad
    rate: float = 0.0  # rad/s
    disturbance: float = 0.0  # rad/s^2


@lru_cache(maxsize=8)
def joint_gain(tuning: EstimatorTuning, dt: float) -> Vec3:
    """Share of a reading's surprise in angle [1], rate [1/s] and disturbance [1/s^2], per reading.

    Readings come every ``dt`` [s].
    """
    move = np.array([[1.0, dt, 0.5 * dt * dt], [0.0, 1.0, dt], [0.0, 0.0, 1.0]])
    walk = tuning.joint_disturbance_walk**2
    noise = walk * np.array(
        [
            [dt**5 / 20.0, dt**4 / 8.0, dt**3 / 6.0],
            [dt**4 / 8.0, dt**3 / 3.0, dt**2 / 2.0],
            [dt**3 / 6.0, dt**2 / 2.0, dt],
        ]
    )
    seen = np.array([[1.0, 0.0, 0.0]])
    variance = tuning.encoder_noise**2
    P = solve_discrete_are(move.T, seen.T, noise, np.array([[variance]]))
    angle, rate, disturbance = (P @ seen.T / (seen @ P @ seen.T + variance)).ravel().tolist()
    return angle, rate, disturbance


@compilable
def predicted(joint: JointState, u: float, dt: float) -> JointState:
    """A joint ``dt`` [s] later, accelerated by ``u`` [rad/s^2]."""
    a = u + joint.disturbance
    return JointState(
        joint.angle + dt * (joint.rate + 0.5 * dt * a), joint.rate + dt * a, joint.disturbance
    )


@compilable
def corrected(joint: JointState, reading: float, age: float, gain: Vec3) -> JointState:
    """A joint after a ``reading`` [rad] that is ``age`` [s] old; ``gain`` [SI, joint]."""
    surprise = reading - (joint.angle - age * joint.rate)
    return JointState(
        joint.angle + gain[0] * surprise,
        joint.rate + gain[1] * surprise,
        joint.disturbance + gain[2] * surprise,
    )
