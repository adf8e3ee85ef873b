"""The horizon around the current guess: how every place of the vehicle moves, and its gradients.

Everything that shapes the optimum (costs, barriers, limits) is written in terms of positions and
velocities of places on the vehicle: the end-effector that tracks, the probes that keep clear. A
place is rigid on the base or on a link. From the body's axes at a node, their rates and their exact
derivatives follow its position, its velocity and both gradients in the inputs. The model is
time-invariant: what an input does depends on how long ago it acted, not on the node.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from fsw.autopilot.model.body import ON_LINK1, ON_LINK2
from fsw.autopilot.model.kinematics import body_axes, links
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.model.prediction import (
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
from fsw.autopilot.signals import JointVector, Mat3, Vec2, Vec3
from fsw.compiled import compiled, kernel, machine_code

# Prediction states that turn the body: the accelerations, by the tilt they take, and yaw.
_TURNING = np.array([A, A + 1, A + 2, YAW])
_STEP = 1e-30  # complex step: no subtraction, hence no rounding
_AXES = 4  # b1, b3 and their rates


# What a frame holds of a node, in this order; matrices row by row. One array, because compiled code
# counts the references to each array it is handed.
_AT_P, _AT_V = 0, 3  # of the base
_AT_R, _AT_TURNING = 6, 15  # R_WB and its rate
_AT_D_R, _AT_D_TURNING = 24, 60  # their derivatives in each turning state
_AT_SWAY = 96  # of each link: sine and cosine of its angle from straight down, and its rate
_AT_LINKS = 102  # lengths
FRAME = 104
TURNED = 10  # matrices in it


class Horizon(NamedTuple):
    """The nodes of a horizon, for kernels; node 0 is its start. Axes are those of the world."""

    states: Array  # (n + 1, 19)
    frames: Array  # (n + 1, FRAME)
    impulse: Array  # (n, 11) see ``impulses``
    inputs: Array  # (6 n,) of the guess


def impulses(model: CondensedModel) -> Array:
    """What an input does so many periods later (n, 11) [SI].

    Of a horizontal acceleration on p, v, a and j, of the vertical one on p, v and a, of yaw and
    joint acceleration on angle and rate. All axes of a kind are the same, and so are all nodes.
    """
    last, rows = model.gamma[model.horizon], []
    for k in range(model.horizon):
        at = INPUTS * (model.horizon - 1 - k)
        rows.append(
            [last[state, at] for state in (P, V, A, J)]
            + [last[state, at + 2] for state in (P + 2, V + 2, A + 2)]
            + [last[state, at + 3] for state in (YAW, YAW_RATE)]
            + [last[state, at + 4] for state in (Q_ARM, QD_ARM)]
        )
    return np.array(rows)


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
            frames=np.zeros((nodes, FRAME)),
            impulse=impulses(model),
            inputs=np.zeros(unknowns),
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
        self.horizon.inputs[:] = inputs
        np.matmul(self.model.phi, start, out=self.states)
        np.add(self.states, self.model.gamma @ inputs, out=self.states)
        m1, m2 = airframe.bodies.mass[:2]
        com = (
            (m1 * airframe.bodies.com[2] + m2 * airframe.link_length[0]) / (m1 + m2),
            m2 * airframe.bodies.com[5] / (m1 + m2),
        )
        _refill(self.horizon, self.tracked, airframe.link_length, com)


@compiled
def _refilled(horizon: Horizon, tracked: Tracked, lengths: Vec2, com: Vec2) -> None:
    turned, slopes = np.empty((TURNED, 3)), np.zeros((2, STATES))
    tip = (0.0, 0.0, lengths[1])
    for i in range(horizon.states.shape[0]):
        frame = horizon.frames[i]
        fill_frame(horizon.states[i], lengths, frame)
        if i > 0:  # the start does not depend on the inputs
            _differentiate(horizon.states[i], frame)
        p, v = position(frame, ON_LINK2, tip), velocity(frame, ON_LINK2, tip)
        for k in range(3):
            tracked.position[i, k], tracked.velocity[i, k] = p[k], v[k]
            if i > 0:
                n = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
                fill_turned(frame, n, turned)
                fill_slopes(frame, ON_LINK2, tip, n, turned, slopes)
                chain(horizon.impulse, i, slopes[0], tracked.d_position[i, k])
                chain(horizon.impulse, i, slopes[1], tracked.d_velocity[i, k])
        _fill_arm_com(horizon, i, com, tracked)


@compiled
def fill_frame(state: Array, lengths: Vec2, frame: Array) -> None:
    """Where the vehicle is in a prediction ``state`` (19,) [SI], into a ``frame`` (FRAME,) [SI].

    Links of ``lengths`` [m]. The derivatives stay as they are.
    """
    axes = np.empty((_AXES, 3))
    body_axes(state, axes)
    for k in range(3):
        frame[_AT_P + k], frame[_AT_V + k] = state[P + k], state[V + k]
    _put_matrix(frame, _AT_R, axes[0], axes[1])
    _put_rate(frame, _AT_TURNING, axes[0], axes[1], axes[2], axes[3])
    put_arm(
        frame,
        (state[Q_ARM], state[Q_ARM + 1]),
        (state[QD_ARM], state[QD_ARM + 1]),
        lengths,
    )


@kernel
def put_pose(frame: Array, p: Vec3 | Array, R: Mat3 | Array) -> None:
    """The base of a ``frame`` (FRAME,) [SI] at ``p`` [m, NED]; its velocity stays as it is."""
    for k in range(3):
        frame[_AT_P + k] = p[k]
    for k in range(9):
        frame[_AT_R + k] = R[k]


@kernel
def put_turning(frame: Array, v: Vec3, w: Vec3) -> None:
    """The base of a ``frame`` (FRAME,) [SI] moves with ``v`` [m/s, NED], turns with w [rad/s, FRD].

    Its attitude is in it.
    """
    for k in range(3):
        frame[_AT_V + k] = v[k]
    wx, wy, wz = w
    for row in range(3):
        at = 3 * row
        x, y, z = frame[_AT_R + at], frame[_AT_R + at + 1], frame[_AT_R + at + 2]
        # R times the cross product with w.
        frame[_AT_TURNING + at] = y * wz - z * wy
        frame[_AT_TURNING + at + 1] = z * wx - x * wz
        frame[_AT_TURNING + at + 2] = x * wy - y * wx


@kernel
def put_arm(
    frame: Array, q_arm: JointVector | Array, qd_arm: JointVector | Array, lengths: Vec2
) -> None:
    """The arm in a ``frame`` (FRAME,) [SI]: ``q_arm`` [rad], ``qd_arm`` [rad/s], lengths [m]."""
    angle, rate = 0.0, 0.0
    for link in range(2):
        angle, rate = angle + q_arm[link], rate + qd_arm[link]
        at = _AT_SWAY + 3 * link
        frame[at], frame[at + 1], frame[at + 2] = math.sin(angle), math.cos(angle), rate
        frame[_AT_LINKS + link] = lengths[link]


@compiled
def _differentiate(state: Array, frame: Array) -> None:
    """Derivatives of rotation and its rate in the turning states, by complex steps."""
    axes, stepped = np.empty((_AXES, 3)), np.zeros((_AXES, 3), dtype=np.complex128)
    body_axes(state, axes)
    x = state.astype(np.complex128)
    for turned in range(len(_TURNING)):
        k = _TURNING[turned]
        x[k] = complex(state[k], _STEP)
        body_axes(x, stepped)
        x[k] = state[k]
        e = stepped.imag / _STEP
        _put_rate(frame, _AT_D_R + 9 * turned, axes[0], axes[1], e[0], e[1])
        _put_rate(frame, _AT_D_TURNING + 9 * turned, axes[0], axes[1], e[2], e[3])
        # The rate of b2 = b3 x b1 is a product itself: what is left of its derivative.
        at = _AT_D_TURNING + 9 * turned
        b, c = _cross(axes[3], e[0]), _cross(e[1], axes[2])
        for row in range(3):
            frame[at + 3 * row + 1] += b[row] + c[row]


@compiled
def _put_matrix(frame: Array, at: int, b1: Array, b3: Array) -> None:
    b2 = _cross(b3, b1)
    for row in range(3):
        frame[at + 3 * row], frame[at + 3 * row + 1] = b1[row], b2[row]
        frame[at + 3 * row + 2] = b3[row]


@compiled
def _put_rate(frame: Array, at: int, b1: Array, b3: Array, d1: Array, d3: Array) -> None:
    """The change of ``_put_matrix`` by the product rule, for any change of its axes."""
    a, b = _cross(d3, b1), _cross(b3, d1)
    for row in range(3):
        frame[at + 3 * row], frame[at + 3 * row + 1] = d1[row], a[row] + b[row]
        frame[at + 3 * row + 2] = d3[row]


@compiled
def _cross(a: Array, b: Array) -> Vec3:
    return (
        a[1] * b[2] - a[2] * b[1],
        a[2] * b[0] - a[0] * b[2],
        a[0] * b[1] - a[1] * b[0],
    )


@kernel
def in_body(frame: Array, on: int, local: Vec3) -> tuple[Vec3, Vec3]:
    """Where a place of the vehicle is in the body [m, FRD], and its velocity there [m/s].

    ``frame`` (FRAME,) [SI] is of a node, ``on`` [1] what the place is rigid on, ``local`` [m, part]
    where there (``fsw.autopilot.model.body.Part``).
    """
    if on == ON_BASE:
        return local, (0.0, 0.0, 0.0)
    first = local[2] if on == ON_LINK1 else frame[_AT_LINKS]
    x, z, w = first * frame[_AT_SWAY], first * frame[_AT_SWAY + 1], frame[_AT_SWAY + 2]
    vx, vz = z * w, -x * w
    if on == ON_LINK2:
        at, w = _AT_SWAY + 3, frame[_AT_SWAY + 5]
        x2, z2 = local[2] * frame[at], local[2] * frame[at + 1]
        x, z, vx, vz = x + x2, z + z2, vx + z2 * w, vz - x2 * w
    return (x, 0.0, z), (vx, 0.0, vz)


@kernel
def position(frame: Array, on: int, local: Vec3) -> Vec3:
    """Position of a place [m, NED]; ``frame`` (FRAME,) [SI], ``on`` [1], ``local`` [m, part]."""
    (x, y, z), _ = in_body(frame, on, local)
    return (
        frame[0] + frame[6] * x + frame[7] * y + frame[8] * z,
        frame[1] + frame[9] * x + frame[10] * y + frame[11] * z,
        frame[2] + frame[12] * x + frame[13] * y + frame[14] * z,
    )


@kernel
def velocity(frame: Array, on: int, local: Vec3) -> Vec3:
    """Velocity of a place [m/s, NED]; ``frame`` (FRAME,) [SI], ``on`` [1], ``local`` [m, part]."""
    place, along = in_body(frame, on, local)
    return (
        _velocity(frame, 0, place, along),
        _velocity(frame, 1, place, along),
        _velocity(frame, 2, place, along),
    )


@kernel
def _velocity(frame: Array, axis: int, place: Vec3, along: Vec3) -> float:
    """One axis of the velocity of a place that moves along in the body."""
    r, t = _AT_R + 3 * axis, _AT_TURNING + 3 * axis
    turning = (
        frame[3 + axis] + frame[t] * place[0] + frame[t + 1] * place[1] + frame[t + 2] * place[2]
    )
    return float(turning + frame[r] * along[0] + frame[r + 2] * along[2])


@kernel
def in_axes(frame: Array, n: Vec3) -> Vec3:
    """A direction ``n`` [1, NED] in the body's axes, of a ``frame`` (FRAME,) [SI]."""
    return (
        n[0] * frame[6] + n[1] * frame[9] + n[2] * frame[12],
        n[0] * frame[7] + n[1] * frame[10] + n[2] * frame[13],
        n[0] * frame[8] + n[1] * frame[11] + n[2] * frame[14],
    )


@kernel
def fill_turned(frame: Array, n: Vec3, turned: Array) -> None:
    """``n`` [1, NED] times every matrix of a ``frame`` (FRAME,) [SI], into ``turned`` (10, 3) [SI].

    R_WB and its rate, their derivatives in the turning states, in the order of the frame.
    """
    for k in range(TURNED):
        at = _AT_R + 9 * k
        for column in range(3):
            turned[k, column] = (
                n[0] * frame[at + column]
                + n[1] * frame[at + 3 + column]
                + n[2] * frame[at + 6 + column]
            )


@kernel
def fill_slopes(frame: Array, on: int, local: Vec3, n: Vec3, turned: Array, slopes: Array) -> None:
    """Derivatives of ``n . p`` and ``n . v`` of a place in the state, into ``slopes`` (2, 19) [SI].

    ``frame`` (FRAME,) [SI], ``on`` [1] and ``local`` [m, part] are as in ``in_body``. The direction
    ``n`` [1, NED] is any, ``turned`` (10, 3) [SI] that of ``fill_turned`` for it. Snap moves
    nothing at once, so its entries stay as they are: 0.
    """
    (rx, ry, rz), (vx, _, vz) = in_body(frame, on, local)
    for k in range(3):
        slopes[0, P + k], slopes[1, P + k] = n[k], 0.0
        slopes[0, V + k], slopes[1, V + k] = 0.0, n[k]
    for turning in range(4):
        a, b = 2 + turning, 6 + turning
        of_r = turned[a, 0] * rx + turned[a, 1] * ry + turned[a, 2] * rz
        of_v = turned[a, 0] * vx + turned[a, 2] * vz
        k = _TURNING[turning]
        slopes[0, k] = of_r
        slopes[1, k] = of_v + turned[b, 0] * rx + turned[b, 1] * ry + turned[b, 2] * rz
        # The rate of a turning state turns the place as the state itself does.
        if turning < 2:
            slopes[0, J + turning], slopes[1, J + turning] = 0.0, of_r
        if turning == 3:
            slopes[0, YAW_RATE], slopes[1, YAW_RATE] = 0.0, of_r
    p1 = p2 = v1 = v2 = 0.0
    if on != ON_BASE:
        # n in the arm's plane, and how that turns.
        n1, n3, t1, t3 = turned[0, 0], turned[0, 2], turned[1, 0], turned[1, 2]
        length = local[2] if on == ON_LINK1 else frame[_AT_LINKS]
        x, z = length * frame[_AT_SWAY], length * frame[_AT_SWAY + 1]
        p1 = z * n1 - x * n3
        v1 = z * t1 - x * t3 - frame[_AT_SWAY + 2] * (x * n1 + z * n3)
        if on == ON_LINK2:
            x, z = local[2] * frame[_AT_SWAY + 3], local[2] * frame[_AT_SWAY + 4]
            p2 = z * n1 - x * n3
            v2 = z * t1 - x * t3 - frame[_AT_SWAY + 5] * (x * n1 + z * n3)
    slopes[0, Q_ARM], slopes[0, Q_ARM + 1] = p1 + p2, p2
    slopes[1, Q_ARM], slopes[1, Q_ARM + 1] = v1 + v2, v2
    slopes[0, QD_ARM], slopes[0, QD_ARM + 1] = 0.0, 0.0
    slopes[1, QD_ARM], slopes[1, QD_ARM + 1] = p1 + p2, p2


@kernel
def chain(impulse: Array, node: int, slope: Array, gradient: Array) -> None:
    """From a ``slope`` (19,) [any / SI] in the state to one in the inputs before a node, (6 n,).

    ``impulse`` (n, 11) [SI] is of the horizon, ``gradient`` (6 n,) [any / input] is filled.
    """
    for step in range(node):
        g, at = impulse[node - 1 - step], INPUTS * step
        for axis in range(2):
            gradient[at + axis] = (
                slope[P + axis] * g[0]
                + slope[V + axis] * g[1]
                + slope[A + axis] * g[2]
                + slope[J + axis] * g[3]
            )
        gradient[at + 2] = slope[P + 2] * g[4] + slope[V + 2] * g[5] + slope[A + 2] * g[6]
        gradient[at + 3] = slope[YAW] * g[7] + slope[YAW_RATE] * g[8]
        gradient[at + 4] = slope[Q_ARM] * g[9] + slope[QD_ARM] * g[10]
        gradient[at + 5] = slope[Q_ARM + 1] * g[9] + slope[QD_ARM + 1] * g[10]


@compiled
def _fill_arm_com(horizon: Horizon, i: int, com: Vec2, tracked: Tracked) -> None:
    th1 = horizon.states[i, Q_ARM]
    (x1, c1), (x2, c12) = links(com, th1, th1 + horizon.states[i, Q_ARM + 1])
    tracked.arm_com[i] = x1 + x2
    for step in range(i):
        gain, at = horizon.impulse[i - 1 - step, 9], INPUTS * step
        tracked.d_arm_com[i, at + 4] = (c1 + c12) * gain
        tracked.d_arm_com[i, at + 5] = c12 * gain


_refill = machine_code(_refilled)
