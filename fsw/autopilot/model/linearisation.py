"""The horizon around the current guess: how every place of the vehicle moves, and its gradients.

Everything that shapes the optimum (costs, barriers, limits) is written in terms of positions and
velocities of places on the vehicle: the end-effector that tracks, the probes that keep clear. A
place is rigid on the base or on a link. From the frame of a node (``kinematics``) and the exact
derivatives of the body's axes follow both gradients of a place in the inputs. The model is
time-invariant: what an input does depends on how long ago it acted, not on the node.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.vectors import add_scaled, cross, dot, subtract, three
from fsw.autopilot.model.kinematics import (
    AT_AXIS,
    AT_AXIS_RATE,
    AT_D_R,
    AT_D_TURNING,
    AT_P,
    AT_R,
    AT_V,
    FRAME,
    Frame,
    body_axes,
    fill_frame,
    in_axes,
    in_body,
    packed_bodies,
    place_of,
    position,
    put_rate,
    turning_of,
    velocity,
)
from fsw.autopilot.model.multibody import Bodies
from fsw.autopilot.model.prediction import (
    Q_ARM,
    QD_ARM,
    QDD_ARM,
    YAW,
    YAW_ACC,
    YAW_RATE,
    A,
    Array,
    CondensedModel,
    J,
    P,
    V,
    inputs_of,
)
from fsw.autopilot.signals import Vec3
from fsw.compiled import compilable, kernel, machine_code

# Prediction states that turn the body: the accelerations, by the tilt they take, and yaw.
_TURNING = np.array([A, A + 1, A + 2, YAW])
_STEP = 1e-30  # complex step: no subtraction, hence no rounding
TURNED = 10  # matrices of the base in a frame
COMPARED = 9  # of a node: position and velocity of the end-effector, centre of mass, yaw


class Horizon(NamedTuple):
    """The nodes of a horizon, for kernels; node 0 is its start. Axes are those of the world."""

    states: Array  # (n + 1, states)
    frames: Array  # (n + 1, FRAME)
    impulse: Array  # (n, 11) see ``impulses``
    inputs: Array  # (inputs n,) of the guess
    turned: Array  # (10, 3) to work in, of one direction
    slopes: Array  # (2, states) the same, of one place along it


def impulses(model: CondensedModel) -> Array:
    """What an input does so many periods later (n, 11) [SI].

    Of a horizontal acceleration on p, v, a and j, of the vertical one on p, v and a, of yaw and
    joint acceleration on angle and rate. All axes of a kind are the same, and so are all joints and
    all nodes.
    """
    last, rows = model.gamma[model.horizon], []
    for k in range(model.horizon):
        at = model.inputs * (model.horizon - 1 - k)
        rows.append(
            [last[state, at] for state in (P, V, A, J)]
            + [last[state, at + 2] for state in (P + 2, V + 2, A + 2)]
            + [last[state, at + YAW_ACC] for state in (YAW, YAW_RATE)]
            + [last[state, at + QDD_ARM] for state in (Q_ARM, QD_ARM)]
        )
    return np.array(rows)


class Tracked(NamedTuple):
    """What the tracking cost compares with its targets, for kernels: end-effector, yaw, arm."""

    yaw: Array  # (n + 1, 2) rad and rad/s
    position: Array  # (n + 1, 3) m
    velocity: Array  # (n + 1, 3) m/s
    arm_com: Array  # (n + 1, 2) m, the arm's centre of mass ahead and to the right in the body
    d_yaw: Array  # (n + 1, 2, inputs n)
    d_position: Array  # (n + 1, 3, inputs n)
    d_velocity: Array  # (n + 1, 3, inputs n)
    d_arm_com: Array  # (n + 1, 2, inputs n)
    gradients: Array  # (9, inputs n) to work in, of all that is compared at a node


class Linearisation:
    """Preallocated results of one linearisation."""

    def __init__(self, model: CondensedModel) -> None:
        nodes, unknowns = model.horizon + 1, model.inputs * model.horizon
        self.model, self.states = model, np.zeros((nodes, model.states))
        self.horizon = Horizon(
            states=self.states,
            frames=np.zeros((nodes, FRAME)),
            impulse=impulses(model),
            inputs=np.zeros(unknowns),
            turned=np.empty((TURNED, 3)),
            slopes=np.zeros((2, model.states)),
        )
        self.tracked = Tracked(
            yaw=self.states[:, YAW : YAW_RATE + 1],
            position=np.zeros((nodes, 3)),
            velocity=np.zeros((nodes, 3)),
            arm_com=np.zeros((nodes, 2)),
            d_yaw=model.gamma[:, YAW : YAW_RATE + 1],
            d_position=np.zeros((nodes, 3, unknowns)),
            d_velocity=np.zeros((nodes, 3, unknowns)),
            d_arm_com=np.zeros((nodes, 2, unknowns)),
            gradients=np.zeros((COMPARED, unknowns)),
        )

    def refill(self, start: Array, inputs: Array, pushes: Array | None = None) -> None:
        """Linearise from ``start`` (states,) [SI] around the ``inputs`` (inputs n,) [SI].

        ``pushes`` (n, 3) [m/s^2, NED] accelerate the base in each step beside its thrust.
        """
        self.horizon.inputs[:] = inputs
        # One matrix: NumPy takes twice as long for a stack of them.
        np.dot(self.model.phi.reshape(-1, len(start)), start, out=self.states.reshape(-1))
        np.add(self.states, self.model.gamma @ inputs, out=self.states)
        if pushes is not None:
            p, v, dt = np.zeros(3), np.zeros(3), self.model.period
            for i, push in enumerate(pushes, start=1):
                p, v = p + dt * (v + 0.5 * dt * push), v + dt * push
                self.states[i, P : P + 3] += p
                self.states[i, V : V + 3] += v
        _refill(self.horizon, self.tracked, packed_bodies(self.model.airframe.bodies))


@kernel
def _refilled(horizon: Horizon, tracked: Tracked, bodies: NDArray[Any]) -> None:
    b, turned, slopes = bodies[0], horizon.turned, horizon.slopes
    tip, last = (b.tip[0], b.tip[1], b.tip[2]), int(b.joints)
    for i in range(horizon.states.shape[0]):
        frame = horizon.frames[i]
        fill_frame(horizon.states[i], b, frame)
        if i > 0:  # the start does not depend on the inputs
            _differentiate(horizon.states[i], frame)
        p, v = position(frame, last, tip), velocity(frame, last, tip)
        for k in range(3):
            tracked.position[i, k], tracked.velocity[i, k] = p[k], v[k]
            if i > 0:
                n = (1.0 * (k == 0), 1.0 * (k == 1), 1.0 * (k == 2))
                fill_turned(frame, n, turned)
                fill_slopes(frame, last, tip, n, turned, slopes)
                chain(horizon.impulse, i, slopes[0], tracked.d_position[i, k])
                chain(horizon.impulse, i, slopes[1], tracked.d_velocity[i, k])
        _fill_arm_com(horizon, i, b, tracked)


@kernel
def _differentiate(state: Array, frame: Frame) -> None:
    """Derivatives of rotation and its rate in the turning states, by complex steps."""
    ax, ay, az, yaw, jx, jy, w = turning_of(state)
    b1, b3, d1, d3 = body_axes((ax, ay, az, yaw, jx, jy, w))
    for turned in range(len(_TURNING)):
        e1, e3, de1, de3 = body_axes(
            (
                complex(ax, _STEP if turned == 0 else 0.0),
                complex(ay, _STEP if turned == 1 else 0.0),
                complex(az, _STEP if turned == 2 else 0.0),
                complex(yaw, _STEP if turned == 3 else 0.0),
                complex(jx, 0.0),
                complex(jy, 0.0),
                complex(w, 0.0),
            )
        )
        f1, f3 = _stepped(e1), _stepped(e3)
        at = AT_D_TURNING + 9 * turned
        put_rate(frame, AT_D_R + 9 * turned, b1, b3, f1, f3)
        put_rate(frame, at, b1, b3, _stepped(de1), _stepped(de3))
        # The rate of b2 = b3 x b1 is a product itself: what is left of its derivative.
        b, c = cross(d3, f1), cross(f3, d1)
        for row in range(3):
            frame[at + 3 * row + 1] += b[row] + c[row]


@compilable
def _stepped(e: Any) -> Vec3:
    """The derivative that a complex step has made of three numbers."""
    return e[0].imag / _STEP, e[1].imag / _STEP, e[2].imag / _STEP


@kernel
def fill_turned(frame: Frame, n: Vec3, turned: Array) -> None:
    """``n`` [1, NED] times every matrix of a frame, into ``turned`` (10, 3) [SI].

    R_WB and its rate, their derivatives in the turning states, in the order of the frame.
    """
    for k in range(TURNED):
        at = AT_R + 9 * k
        for column in range(3):
            turned[k, column] = (
                n[0] * frame[at + column]
                + n[1] * frame[at + 3 + column]
                + n[2] * frame[at + 6 + column]
            )


@kernel
def fill_slopes(frame: Frame, on: int, local: Vec3, n: Vec3, turned: Array, slopes: Array) -> None:
    """Derivatives of ``n . p`` and ``n . v`` of a place in the state.

    Into ``slopes`` (2, states) [SI]; ``on`` and ``local`` [m, part] as in ``in_body``. The
    direction ``n`` [1, NED] is any, ``turned`` (10, 3) [SI] that of ``fill_turned`` for it. Snap
    moves nothing at once, so its entries stay as they are: 0.
    """
    place, along = in_body(frame, on, local)
    for k in range(3):
        slopes[0, P + k], slopes[1, P + k] = n[k], 0.0
        slopes[0, V + k], slopes[1, V + k] = 0.0, n[k]
    for turning in range(4):
        of_r = dot(turned[2 + turning], place)
        of_v = dot(turned[2 + turning], along) + dot(turned[6 + turning], place)
        k = _TURNING[turning]
        slopes[0, k], slopes[1, k] = of_r, of_v
        # The rate of a turning state turns the place as the state itself does.
        if turning < 2:
            slopes[0, J + turning], slopes[1, J + turning] = 0.0, of_r
        if turning == 3:
            slopes[0, YAW_RATE], slopes[1, YAW_RATE] = 0.0, of_r
    p, v = position(frame, on, local), velocity(frame, on, local)
    for joint in range((slopes.shape[1] - Q_ARM) // 2):
        of_p = of_v = 0.0
        if joint < on:
            at = place_of(joint + 1)
            axis, arm = three(frame, at + AT_AXIS), subtract(p, three(frame, at + AT_P))
            of_p = dot(n, cross(axis, arm))
            # The place moves by axis x arm with the angle, so its velocity by how that changes.
            of_v = dot(n, cross(three(frame, at + AT_AXIS_RATE), arm))
            of_v += dot(n, cross(axis, subtract(v, three(frame, at + AT_V))))
        slopes[0, Q_ARM + 2 * joint], slopes[1, Q_ARM + 2 * joint] = of_p, of_v
        slopes[0, QD_ARM + 2 * joint], slopes[1, QD_ARM + 2 * joint] = 0.0, of_p


@kernel
def chain(impulse: Array, node: int, slope: Array, gradient: Array) -> None:
    """From a ``slope`` (states,) [any / SI] in the state to one in the inputs before a node.

    ``impulse`` (n, 11) [SI] is of the horizon, ``gradient`` (inputs n,) [any / input] is filled.
    """
    joints = (len(slope) - Q_ARM) // 2
    for step in range(node):
        g, at = impulse[node - 1 - step], inputs_of(joints) * step
        for axis in range(2):
            gradient[at + axis] = (
                slope[P + axis] * g[0]
                + slope[V + axis] * g[1]
                + slope[A + axis] * g[2]
                + slope[J + axis] * g[3]
            )
        gradient[at + 2] = slope[P + 2] * g[4] + slope[V + 2] * g[5] + slope[A + 2] * g[6]
        gradient[at + YAW_ACC] = slope[YAW] * g[7] + slope[YAW_RATE] * g[8]
        for joint in range(joints):
            of_q, of_qd = slope[Q_ARM + 2 * joint], slope[QD_ARM + 2 * joint]
            gradient[at + QDD_ARM + joint] = of_q * g[9] + of_qd * g[10]


@kernel
def _fill_arm_com(horizon: Horizon, i: int, b: Bodies, tracked: Tracked) -> None:
    """The arm's centre of mass in the body: each joint turns all that comes after it."""
    frame, joints = horizon.frames[i], int(b.joints)
    arm = 0.0
    for joint in range(joints):
        arm += b.mass[joint]
    base, mass, moment = three(frame, AT_P), 0.0, (0.0, 0.0, 0.0)
    for joint in range(joints - 1, -1, -1):
        com = (b.com[3 * joint], b.com[3 * joint + 1], b.com[3 * joint + 2])
        at = place_of(joint + 1)
        mass += b.mass[joint]
        c = subtract(position(frame, joint + 1, com), base)
        moment = add_scaled(moment, c, b.mass[joint])
        to_joint = subtract(three(frame, at + AT_P), base)
        turned = cross(three(frame, at + AT_AXIS), add_scaled(moment, to_joint, -mass))
        slope = in_axes(frame, turned)
        for step in range(i):
            gain = horizon.impulse[i - 1 - step, 9] / arm
            at = inputs_of(joints) * step + QDD_ARM + joint
            for axis in range(2):
                tracked.d_arm_com[i, axis, at] = slope[axis] * gain
    centre = in_axes(frame, moment)
    for axis in range(2):
        tracked.arm_com[i, axis] = centre[axis] / arm


_refill = machine_code(_refilled)
