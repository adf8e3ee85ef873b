"""States the vehicle may be asked about, drawn wider than it should ever fly."""

from __future__ import annotations

import math

import numpy as np
from scipy.spatial.transform import Rotation

from fsw.autopilot.model.prediction import (
    Q_ARM,
    QD_ARM,
    YAW,
    YAW_RATE,
    A,
    Array,
    J,
    P,
    S,
    V,
    states_of,
)
from fsw.autopilot.signals import Mat3, PredictionState, StateEstimate, Vec2, Vec3


def prediction_vector(random: np.random.Generator, joints: int = 2) -> Array:
    """A state of the prediction model: tilts up to 50 degrees, yaw often at plus-minus pi."""
    x = np.zeros(states_of(joints))
    x[P : P + 3] = random.uniform(-2.0, 2.0, 3)
    x[V : V + 3] = random.uniform(-1.5, 1.5, 3)
    x[A : A + 2] = random.uniform(-6.0, 6.0, 2)
    x[A + 2] = random.uniform(-3.0, 3.0)
    x[J : J + 2] = random.uniform(-20.0, 20.0, 2)
    x[S : S + 2] = random.uniform(-100.0, 100.0, 2)
    x[YAW] = random.choice([-math.pi, math.pi, random.uniform(-math.pi, math.pi)])
    x[YAW_RATE] = random.uniform(-1.0, 1.0)
    x[Q_ARM::2] = random.uniform(-1.4, 1.4, joints)
    x[QD_ARM::2] = random.uniform(-3.0, 3.0, joints)
    return x


def as_state(x: Array) -> PredictionState:
    """The vector (19,) as the boundary type, entry by entry."""
    v = [float(value) for value in x]
    return PredictionState(
        p=(v[0], v[1], v[2]),
        v=(v[3], v[4], v[5]),
        a=(v[6], v[7], v[8]),
        j=(v[9], v[10]),
        s=(v[11], v[12]),
        yaw=v[13],
        yaw_rate=v[14],
        q_arm=(v[15], v[17]),
        qd_arm=(v[16], v[18]),
    )


def estimate_of(
    rotation: Rotation,
    w_WB_B: Vec3 = (0.0, 0.0, 0.0),
    p_WB: Vec3 = (0.0, 0.0, -1.0),
    v_WB: Vec3 = (0.0, 0.0, 0.0),
    q_arm: Vec2 = (0.0, 0.0),
    qd_arm: Vec2 = (0.0, 0.0),
) -> StateEstimate:
    """An estimate with this attitude, otherwise at rest by default."""
    yaw = float(rotation.as_euler("ZYX")[0])
    return StateEstimate(0, p_WB, v_WB, mat3(rotation), w_WB_B, yaw, q_arm, qd_arm)


def mat3(rotation: Rotation) -> Mat3:
    """Row-major nine floats."""
    m = [float(value) for value in rotation.as_matrix().ravel()]
    return (m[0], m[1], m[2], m[3], m[4], m[5], m[6], m[7], m[8])


def vec3(values: Array) -> Vec3:
    """Three floats."""
    x, y, z = (float(value) for value in values)
    return (x, y, z)


def random_estimate(random: np.random.Generator, tilt: float = 1.0) -> StateEstimate:
    """Any heading, roll and pitch within ``tilt`` [rad], everything moving."""
    yaw = random.choice([-math.pi, math.pi, random.uniform(-math.pi, math.pi)])
    rotation = Rotation.from_euler("ZYX", [yaw, *random.uniform(-tilt, tilt, 2)])
    q1, q2 = (float(q) for q in random.uniform(-1.4, 1.4, 2))
    qd1, qd2 = (float(qd) for qd in random.uniform(-3.0, 3.0, 2))
    return estimate_of(
        rotation,
        vec3(random.uniform(-2.0, 2.0, 3)),
        vec3(random.uniform(-2.0, 2.0, 3)),
        vec3(random.uniform(-2.0, 2.0, 3)),
        (q1, q2),
        (qd1, qd2),
    )


def any_estimate(random: np.random.Generator, joints: int) -> StateEstimate:
    """Any attitude, everything moving, of a vehicle with so many joints."""
    estimate = random_estimate(random, tilt=3.0)
    q, qd = (tuple(random.uniform(-3.0, 3.0, joints).tolist()) for _ in range(2))
    return estimate._replace(q_arm=q, qd_arm=qd)
