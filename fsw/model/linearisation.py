"""The horizon around the current guess: how every place of the vehicle moves, and its gradients.

Everything that shapes the optimum (costs, barriers, limits) is written in terms of positions and
velocities of places on the vehicle: the end-effector that tracks, the probes that keep clear. A
place is rigid on the base or on a link. From the body's axes at a node, their rates and their exact
derivatives follow its position, its velocity and both gradients in the inputs.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fsw.compiled import compiled
from fsw.model.body import ON_BASE, ON_LINK1, ON_LINK2
from fsw.model.kinematics import body_axes, links
from fsw.model.prediction import (
    INPUTS,
    Q_ARM,
    QD_ARM,
    STATES,
    YAW,
    YAW_RATE,
    A,
    Array,
    CondensedModel,
    J,
    P,
    V,
)
from fsw.signals import Vec2, Vec3

# Prediction states that turn the body: the accelerations, by the tilt they take, and yaw.
_TURNING = np.array([A, A + 1, A + 2, YAW])
# Prediction states each input can move, -1 where it moves fewer.
_REACHED = np.array(
    [
        [0, 3, 6, 9],
        [1, 4, 7, 10],
        [2, 5, 8, -1],
        [13, 14, -1, -1],
        [15, 17, -1, -1],
        [16, 18, -1, -1],
    ]
)
_STEP = 1e-30  # complex step: no subtraction, hence no rounding
_AXES = 4  # b1, b3 and their rates


class Horizon(NamedTuple):
    """The nodes of a horizon, for kernels; node 0 is its start. Axes are those of the world."""

    states: Array  # (n + 1, 19)
    axes: Array  # (n + 1, 4, 3) b1, b3 and their rates
    d_axes: Array  # (n + 1, 4, 4, 3) their derivatives in a_x, a_y, a_z, yaw
    gamma: Array  # (n + 1, 19, 6 n)
    links: Vec2  # m


class Tracked(NamedTuple):
    """What the tracking cost compares with its targets, for kernels: end-effector, yaw, arm."""

    yaw: Array  # (n + 1, 2) rad and rad/s
    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s
    arm_com: Array  # (n + 1,) m
    d_yaw: Array  # (n + 1, 2, 6 n)
    d_position: Array  # (n + 1, 3, 6 n)
    d_velocity: Array  # (n + 1, 3, 6 n)
    d_arm_com: Array  # (n + 1, 6 n)


@dataclass(frozen=True)
class Linearisation:
    """Preallocated results of one linearisation."""

    model: CondensedModel
    states: Array = field(init=False)  # (n + 1, 19)
    horizon: Horizon = field(init=False)
    tracked: Tracked = field(init=False)

    def __post_init__(self) -> None:
        model, nodes = self.model, self.model.horizon + 1
        unknowns = INPUTS * model.horizon
        states = np.zeros((nodes, STATES))
        horizon = Horizon(
            states=states,
            axes=np.zeros((nodes, _AXES, 3)),
            d_axes=np.zeros((nodes, len(_TURNING), _AXES, 3)),
            gamma=model.gamma,
            links=model.airframe.link_length,
        )
        tracked = Tracked(
            yaw=states[:, YAW : YAW_RATE + 1],
            position=np.zeros((nodes, 3)),
            velocity=np.zeros((nodes, 3)),
            arm_com=np.zeros(nodes),
            d_yaw=model.gamma[:, YAW : YAW_RATE + 1],
            d_position=np.zeros((nodes, 3, unknowns)),
            d_velocity=np.zeros((nodes, 3, unknowns)),
            d_arm_com=np.zeros((nodes, unknowns)),
        )
        object.__setattr__(self, "states", states)
        object.__setattr__(self, "horizon", horizon)
        object.__setattr__(self, "tracked", tracked)

    def refill(self, start: Array, inputs: Array) -> None:
        """Linearise from the state ``start`` (19,) [SI] around the ``inputs`` (6 n,) [SI]."""
        airframe = self.model.airframe
        np.matmul(self.model.phi, start, out=self.states)
        np.add(self.states, self.model.gamma @ inputs, out=self.states)
        m1, m2 = airframe.link_mass
        com = (
            (m1 * airframe.link_com[0] + m2 * airframe.link_length[0]) / (m1 + m2),
            m2 * airframe.link_com[1] / (m1 + m2),
        )
        _refill(self.horizon, self.tracked, com)


@compiled
def _refill(horizon: Horizon, tracked: Tracked, com: Vec2) -> None:
    at_position, at_velocity = np.zeros(STATES), np.zeros(STATES)
    tip = (0.0, 0.0, horizon.links[1])
    for i in range(horizon.states.shape[0]):
        state = horizon.states[i]
        body_axes(state, horizon.axes[i])
        if i > 0:  # the start does not depend on the inputs
            _differentiate(state, horizon.d_axes[i])
        p, v = place(horizon, i, ON_LINK2, tip)
        for k in range(3):
            tracked.position[i, k], tracked.velocity[i, k] = p[k], v[k]
            if i > 0:
                n = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
                slopes(horizon, i, ON_LINK2, tip, n, at_position, at_velocity)
                chain(horizon, i, at_position, tracked.d_position[i, k])
                chain(horizon, i, at_velocity, tracked.d_velocity[i, k])
        _fill_arm_com(horizon, i, com, tracked)


@compiled
def _differentiate(state: Array, d_axes: Array) -> None:
    """Derivative of ``body_axes`` in the turning states (4, 4, 3), by complex steps."""
    stepped = np.zeros((_AXES, 3), dtype=np.complex128)
    x = state.astype(np.complex128)
    for turning in range(len(_TURNING)):
        k = _TURNING[turning]
        x[k] = complex(state[k], _STEP)
        body_axes(x, stepped)
        x[k] = state[k]
        d_axes[turning] = stepped.imag / _STEP


@compiled
def in_body(horizon: Horizon, node: int, on: int, local: Vec3) -> tuple[Vec3, Vec3]:
    """Where a place of the vehicle is in the body [m, FRD], and its velocity there [m/s].

    ``on`` [1] is what the place is rigid on, ``local`` [m] where there (``fsw.model.body.Part``).
    """
    if on == ON_BASE:
        return local, (0.0, 0.0, 0.0)
    state = horizon.states[node]
    th1, w1 = state[Q_ARM], state[QD_ARM]
    th12, w12 = th1 + state[Q_ARM + 1], w1 + state[QD_ARM + 1]
    if on == ON_LINK1:
        x, z = local[2] * math.sin(th1), local[2] * math.cos(th1)
        return (x, 0.0, z), (z * w1, 0.0, -x * w1)
    x1, z1 = horizon.links[0] * math.sin(th1), horizon.links[0] * math.cos(th1)
    x2, z2 = local[2] * math.sin(th12), local[2] * math.cos(th12)
    return (x1 + x2, 0.0, z1 + z2), (z1 * w1 + z2 * w12, 0.0, -x1 * w1 - x2 * w12)


@compiled
def place(horizon: Horizon, node: int, on: int, local: Vec3) -> tuple[Vec3, Vec3]:
    """Position [m, NED] and velocity [m/s, NED] of a place of the vehicle at a node.

    ``on`` [1] and ``local`` [m] are as in ``in_body``.
    """
    r, rd = in_body(horizon, node, on, local)
    state, axes = horizon.states[node], horizon.axes[node]
    b1, b3, d1, d3 = axes[0], axes[1], axes[2], axes[3]
    # b2 = b3 x b1 and its rate
    px, py, pz = _body_vector(b1, b3, r)
    vx, vy, vz = _body_vector(b1, b3, rd)
    tx, ty, tz = _turned(b1, b3, d1, d3, r)
    return (
        (state[P] + px, state[P + 1] + py, state[P + 2] + pz),
        (state[V] + vx + tx, state[V + 1] + vy + ty, state[V + 2] + vz + tz),
    )


@compiled
def _body_vector(b1: Array, b3: Array, r: Vec3) -> Vec3:
    """A vector of body components in the world: r_x b1 + r_y (b3 x b1) + r_z b3."""
    x, y, z = r
    return (
        x * b1[0] + z * b3[0] + y * (b3[1] * b1[2] - b3[2] * b1[1]),
        x * b1[1] + z * b3[1] + y * (b3[2] * b1[0] - b3[0] * b1[2]),
        x * b1[2] + z * b3[2] + y * (b3[0] * b1[1] - b3[1] * b1[0]),
    )


@compiled
def _turned(b1: Array, b3: Array, d1: Array, d3: Array, r: Vec3) -> Vec3:
    """How ``_body_vector`` changes with its axes by the product rule, for any change of these."""
    x, y, z = r
    return (
        x * d1[0] + z * d3[0] + y * (d3[1] * b1[2] - d3[2] * b1[1] + b3[1] * d1[2] - b3[2] * d1[1]),
        x * d1[1] + z * d3[1] + y * (d3[2] * b1[0] - d3[0] * b1[2] + b3[2] * d1[0] - b3[0] * d1[2]),
        x * d1[2] + z * d3[2] + y * (d3[0] * b1[1] - d3[1] * b1[0] + b3[0] * d1[1] - b3[1] * d1[0]),
    )


@compiled
def slopes(
    horizon: Horizon,
    node: int,
    on: int,
    local: Vec3,
    n: Vec3,
    at_position: Array,
    at_velocity: Array,
) -> None:
    """Derivatives of ``n . p`` and ``n . v`` of a place in the state, (19,) [SI] each.

    ``on`` [1] and ``local`` [m] are as in ``in_body``; ``n`` [1, NED] is any direction.
    """
    r, rd = in_body(horizon, node, on, local)
    axes, d_axes = horizon.axes[node], horizon.d_axes[node]
    b1, b3, d1, d3 = axes[0], axes[1], axes[2], axes[3]
    for k in range(3):
        at_position[P + k], at_velocity[P + k] = n[k], 0.0
        at_position[V + k], at_velocity[V + k] = 0.0, n[k]
    for turning in range(4):
        e1, e3, f1, f3 = (
            d_axes[turning, 0],
            d_axes[turning, 1],
            d_axes[turning, 2],
            d_axes[turning, 3],
        )
        of_r = _along(n, _turned(b1, b3, e1, e3, r))
        of_v = _along(n, _turned(b1, b3, e1, e3, rd)) + _along(n, _turned(b1, b3, f1, f3, r))
        if r[1] != 0.0:  # the product rule's mixed terms of b2's rate
            of_v += r[1] * _mixed(n, e1, e3, d1, d3)
        k = _TURNING[turning]
        at_position[k], at_velocity[k] = of_r, of_v
        # The rate of a turning state turns the place as the state itself does.
        if turning < 2:
            at_position[J + turning], at_velocity[J + turning] = 0.0, of_r
        if turning == 3:
            at_position[YAW_RATE], at_velocity[YAW_RATE] = 0.0, of_r
    for k in range(11, 13):  # snap moves nothing at once
        at_position[k], at_velocity[k] = 0.0, 0.0
    _arm_slopes(horizon, node, on, local, n, at_position, at_velocity)


@compiled
def _mixed(n: Vec3, e1: Array, e3: Array, d1: Array, d3: Array) -> float:
    """``n`` times e3 x d1 + d3 x e1."""
    return float(
        n[0] * (e3[1] * d1[2] - e3[2] * d1[1] + d3[1] * e1[2] - d3[2] * e1[1])
        + n[1] * (e3[2] * d1[0] - e3[0] * d1[2] + d3[2] * e1[0] - d3[0] * e1[2])
        + n[2] * (e3[0] * d1[1] - e3[1] * d1[0] + d3[0] * e1[1] - d3[1] * e1[0])
    )


@compiled
def _arm_slopes(
    horizon: Horizon,
    node: int,
    on: int,
    local: Vec3,
    n: Vec3,
    at_position: Array,
    at_velocity: Array,
) -> None:
    """The part of ``slopes`` that is the joints'."""
    for k in range(Q_ARM, QD_ARM + 2):
        at_position[k], at_velocity[k] = 0.0, 0.0
    if on == ON_BASE:
        return
    state, axes = horizon.states[node], horizon.axes[node]
    th1, w1 = state[Q_ARM], state[QD_ARM]
    th12, w12 = th1 + state[Q_ARM + 1], w1 + state[QD_ARM + 1]
    # n in the arm's plane, and how that turns.
    n1, n3 = _along_row(n, axes[0]), _along_row(n, axes[1])
    t1, t3 = _along_row(n, axes[2]), _along_row(n, axes[3])
    length1 = local[2] if on == ON_LINK1 else horizon.links[0]
    x, z = length1 * math.sin(th1), length1 * math.cos(th1)
    p1 = z * n1 - x * n3
    v1 = z * t1 - x * t3 - w1 * (x * n1 + z * n3)
    p2 = v2 = 0.0
    if on == ON_LINK2:
        x, z = local[2] * math.sin(th12), local[2] * math.cos(th12)
        p2 = z * n1 - x * n3
        v2 = z * t1 - x * t3 - w12 * (x * n1 + z * n3)
    at_position[Q_ARM], at_position[Q_ARM + 1] = p1 + p2, p2
    at_velocity[Q_ARM], at_velocity[Q_ARM + 1] = v1 + v2, v2
    at_velocity[QD_ARM], at_velocity[QD_ARM + 1] = p1 + p2, p2


@compiled
def _along(n: Vec3, v: Vec3) -> float:
    return n[0] * v[0] + n[1] * v[1] + n[2] * v[2]


@compiled
def _along_row(n: Vec3, v: Array) -> float:
    return float(n[0] * v[0] + n[1] * v[1] + n[2] * v[2])


@compiled
def chain(horizon: Horizon, node: int, at_state: Array, gradient: Array) -> None:
    """From a slope in the state (19,) [any / SI] to one in the inputs before a node, (6 n,)."""
    gamma = horizon.gamma[node]
    for column in range(INPUTS * node):
        total = 0.0
        for k in _REACHED[column % INPUTS]:
            if k >= 0:
                total += at_state[k] * gamma[k, column]
        gradient[column] = total


@compiled
def _fill_arm_com(horizon: Horizon, i: int, com: Vec2, tracked: Tracked) -> None:
    th1 = horizon.states[i, Q_ARM]
    (x1, c1), (x2, c12) = links(com, th1, th1 + horizon.states[i, Q_ARM + 1])
    tracked.arm_com[i] = x1 + x2
    gamma = horizon.gamma[i]
    for column in range(INPUTS * i):
        tracked.d_arm_com[i, column] = (c1 + c12) * gamma[Q_ARM, column] + c12 * gamma[
            Q_ARM + 1, column
        ]
