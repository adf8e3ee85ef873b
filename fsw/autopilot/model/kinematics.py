"""Forward kinematics: every place where angles become positions.

A place is rigid on the base or on a link. A frame holds, in the world's axes, where base and links
are, how they are turned and how both change; from it follow position and velocity of every place.
In flight the attitude is measured. Along the horizon it follows from the planned acceleration:
thrust points along ``g - a`` and the body's x axis keeps the planned yaw, so the plan includes how
tilting swings the end-effector.
"""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.geometry.rotation import Axes, nine, rotate
from fsw.autopilot.geometry.vectors import (
    Vector,
    add,
    add_scaled,
    cross,
    put_three,
    subtract,
    three,
)
from fsw.autopilot.model.airframe import GRAVITY
from fsw.autopilot.model.multibody import Bodies, next_axes
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.model.prediction import Q_ARM, QD_ARM, YAW, YAW_RATE, A, Array, J, P, V
from fsw.autopilot.signals import JointVector, Mat3, StateEstimate, Vec3
from fsw.compiled import compilable, kernel, machine_code, packed
from fsw.record import JOINTS, Floats

# What a frame holds, in this order; matrices row by row. One array, because compiled code counts
# the references to each array it is handed. First the base: position, velocity, R_WB and its rate.
AT_P, AT_V, AT_R, AT_TURNING = 0, 3, 6, 15
AT_D_R, AT_D_TURNING = 24, 60  # derivatives of the last two in each of four turning states
# Then each link: the same of its joint's origin and its own axes, the joint's axis and its rate.
AT_LINKS, AT_AXIS, AT_AXIS_RATE = 96, 24, 27
LINK: Final = 30
FRAME: Final = AT_LINKS + LINK * JOINTS
Frame = Array
"""Where and how the vehicle is (FRAME,) [SI]."""

_REST: Final[Vec3] = (0.0, 0.0, 0.0)


@kernel
def place_of(on: int) -> int:
    """Where in a frame the numbers begin of what a part is ``on`` [1]."""
    return 0 if on == ON_BASE else AT_LINKS + LINK * (on - 1)


@compilable
def fill_frame(state: Array, b: Bodies, frame: Frame) -> None:
    """Where the vehicle is in a prediction ``state`` (states,) [SI]; no derivatives."""
    _fill_base(state, frame)
    put_links(frame, b, state[Q_ARM::2], state[QD_ARM::2])


@compilable
def _fill_base(state: Array, frame: Frame) -> None:
    b1, b3, d1, d3 = body_axes(turning_of(state))
    for k in range(3):
        frame[AT_P + k], frame[AT_V + k] = state[P + k], state[V + k]
    put_matrix(frame, AT_R, b1, b3)
    put_rate(frame, AT_TURNING, b1, b3, d1, d3)


@compilable
def put_matrix(frame: Frame, at: int, b1: Vec3, b3: Vec3) -> None:
    """The axes b1, b2 and b3 as columns, of ``b1`` [1, NED] and ``b3`` [1, NED]."""
    b2 = cross(b3, b1)
    for row in range(3):
        frame[at + 3 * row], frame[at + 3 * row + 1] = b1[row], b2[row]
        frame[at + 3 * row + 2] = b3[row]


@compilable
def put_rate(frame: Frame, at: int, b1: Vec3, b3: Vec3, d1: Vec3, d3: Vec3) -> None:
    """The change of ``put_matrix`` by the product rule, for any change of its axes.

    ``b1`` [1, NED] changes by ``d1`` [any, NED] and ``b3`` [1, NED] by ``d3`` [any, NED].
    """
    a, b = cross(d3, b1), cross(b3, d1)
    for row in range(3):
        frame[at + 3 * row], frame[at + 3 * row + 1] = d1[row], a[row] + b[row]
        frame[at + 3 * row + 2] = d3[row]


@compilable
def put_base(frame: Frame, p: Vector, v: Vector, R: Axes, w: Vector) -> None:
    """The base at ``p`` [m, NED] with the attitude ``R`` [1].

    It moves with ``v`` [m/s, NED] and turns with ``w`` [rad/s, FRD].
    """
    for row in range(3):
        frame[AT_P + row], frame[AT_V + row] = p[row], v[row]
        x, y, z = R[3 * row], R[3 * row + 1], R[3 * row + 2]
        put_three(frame, AT_R + 3 * row, (x, y, z))
        # R times the cross product with w.
        turning = (y * w[2] - z * w[1], z * w[0] - x * w[2], x * w[1] - y * w[0])
        put_three(frame, AT_TURNING + 3 * row, turning)


@compilable
def put_links(frame: Frame, b: Bodies, q: JointVector | Floats, qd: JointVector | Floats) -> None:
    """The links of a base that is there, joints at ``q`` (j,) [rad] with ``qd`` (j,) [rad/s]."""
    R, turning = nine(frame, AT_R), nine(frame, AT_TURNING)
    p, v = three(frame, AT_P), three(frame, AT_V)
    # The rate of the base in the world: its cross product is turning times R transposed.
    w = (
        turning[6] * R[3] + turning[7] * R[4] + turning[8] * R[5],
        turning[0] * R[6] + turning[1] * R[7] + turning[2] * R[8],
        turning[3] * R[0] + turning[4] * R[1] + turning[5] * R[2],
    )
    for k in range(int(b.joints)):
        offset = (b.offset[3 * k], b.offset[3 * k + 1], b.offset[3 * k + 2])
        p, v = add(p, rotate(R, offset)), add(v, cross(w, rotate(R, offset)))
        axis, R = next_axes(b, k, R, q[k])
        at = AT_LINKS + LINK * k
        put_three(frame, at + AT_P, p)
        put_three(frame, at + AT_V, v)
        put_three(frame, at + AT_AXIS, axis)
        put_three(frame, at + AT_AXIS_RATE, cross(w, axis))
        w = add_scaled(w, axis, qd[k])
        for column in range(3):
            x, y, z = R[column], R[3 + column], R[6 + column]
            frame[at + AT_R + column], frame[at + AT_R + 3 + column] = x, y
            frame[at + AT_R + 6 + column] = z
            dx, dy, dz = cross(w, (x, y, z))
            frame[at + AT_TURNING + column], frame[at + AT_TURNING + 3 + column] = dx, dy
            frame[at + AT_TURNING + 6 + column] = dz


@kernel
def position(frame: Frame, on: int, local: Vec3) -> Vec3:
    """Position of a place [m, NED], ``local`` [m, part] where it is ``on``."""
    at = place_of(on)
    return add(three(frame, at), rotate(nine(frame, at + AT_R), local))


@kernel
def velocity(frame: Frame, on: int, local: Vec3) -> Vec3:
    """Velocity of a place [m/s, NED], ``local`` [m, part] where it is ``on``."""
    at = place_of(on)
    return add(three(frame, at + AT_V), rotate(nine(frame, at + AT_TURNING), local))


@kernel
def in_axes(frame: Frame, n: Vec3) -> Vec3:
    """A direction ``n`` [1, NED] in the body's axes."""
    return (
        n[0] * frame[6] + n[1] * frame[9] + n[2] * frame[12],
        n[0] * frame[7] + n[1] * frame[10] + n[2] * frame[13],
        n[0] * frame[8] + n[1] * frame[11] + n[2] * frame[14],
    )


@kernel
def in_body(frame: Frame, on: int, local: Vec3) -> tuple[Vec3, Vec3]:
    """Where a place of the vehicle is in the body [m, FRD], and its velocity there [m/s].

    ``on`` is what it is rigid on, ``local`` [m, part] where there (``model.parts.Part``).
    """
    p, v = position(frame, on, local), velocity(frame, on, local)
    place = in_axes(frame, subtract(p, three(frame, AT_P)))
    carried = velocity(frame, ON_BASE, place)
    return place, in_axes(frame, subtract(v, carried))


def packed_bodies(bodies: Bodies) -> NDArray[Any]:
    """The bodies for kernels (1,) [SI], made once.

    Known by identity: to hash them takes longer than what is done with them.
    """
    for known, numbers in _PACKED:
        if known is bodies:
            return numbers
    _PACKED.append((bodies, packed(bodies)))
    del _PACKED[:-_KEPT]
    return _PACKED[-1][1]


_PACKED: Final[list[tuple[Bodies, NDArray[Any]]]] = []
_KEPT: Final = 8


def frame_of(bodies: Bodies, estimate: StateEstimate) -> Array:
    """The vehicle of an estimate as a frame (FRAME,) [SI]."""
    frame = np.zeros(FRAME)
    q, qd = np.array(estimate.q_arm), np.array(estimate.qd_arm)
    pose = estimate.p_WB, estimate.v_WB, estimate.R_WB, estimate.w_WB_B
    _put_vehicle(frame, packed_bodies(bodies), *pose, q, qd)
    return frame


@machine_code
@kernel
def _put_vehicle(
    frame: Frame, bodies: NDArray[Any], p: Vec3, v: Vec3, R: Mat3, w: Vec3, q: Array, qd: Array
) -> None:
    put_base(frame, p, v, R, w)
    put_links(frame, bodies[0], q, qd)


def end_effector(bodies: Bodies, estimate: StateEstimate) -> tuple[Vec3, Vec3]:
    """World position p_WE [m] and velocity v_WE [m/s] of the estimated end-effector."""
    return _tip(frame_of(bodies, estimate), packed_bodies(bodies))


@machine_code
@kernel
def _tip(frame: Frame, bodies: NDArray[Any]) -> tuple[Vec3, Vec3]:
    b = bodies[0]
    tip, last = (b.tip[0], b.tip[1], b.tip[2]), int(b.joints)
    return position(frame, last, tip), velocity(frame, last, tip)


def level_frame(bodies: Bodies, q_arm: JointVector, yaw: float) -> Array:
    """A level vehicle at rest at the origin as a frame (FRAME,) [SI].

    Joints at ``q_arm`` (j,) [rad], the body at ``yaw`` [rad].
    """
    c, s = math.cos(yaw), math.sin(yaw)
    R = (c, -s, 0.0, s, c, 0.0, 0.0, 0.0, 1.0)
    arm = q_arm, (0.0,) * bodies.joints
    return frame_of(bodies, StateEstimate(0, _REST, _REST, R, _REST, yaw, *arm))


def end_effector_when_level(bodies: Bodies, q_arm: JointVector, yaw: float) -> Vec3:
    """From the body origin to the end-effector of a level vehicle [m, NED].

    Joints at ``q_arm`` (j,) [rad], the body at ``yaw`` [rad].
    """
    return position(level_frame(bodies, q_arm, yaw), bodies.joints, bodies.tip)


def predicted_end_effector(b: Bodies, state: Array) -> tuple[Vec3, Vec3]:
    """Its position [m, NED] and velocity [m/s, NED] in a prediction ``state`` (states,) [SI]."""
    frame, tip = np.zeros(FRAME), (b.tip[0], b.tip[1], b.tip[2])
    fill_frame(state, b, frame)
    return position(frame, int(b.joints), tip), velocity(frame, int(b.joints), tip)


@compilable
def turning_of(x: Any) -> Any:
    """What turns the body in a prediction state ``x`` (states,) [SI], for ``body_axes``."""
    return x[A], x[A + 1], x[A + 2], x[YAW], x[J], x[J + 1], x[YAW_RATE]


@compilable
def body_axes(turning: Any) -> Any:
    """The body's x and z axes of a prediction state, and how fast they turn.

    Written without trigonometry of the tilt and without absolute values, so that what is
    ``turning`` [m/s^2, rad, m/s^3, rad/s, NED] may be complex: the derivative is then exact
    (complex step). Of ``turning_of`` a state; b1, b3 [1, NED] and their rates [1/s, NED].
    """
    ax, ay, az, yaw, jx, jy, w = turning
    # Thrust along f = g e3 - a; its derivative needs the horizontal jerk only: a vertical
    # jerk changes the length of f, hardly its direction.
    fx, fy, fz = -ax, -ay, GRAVITY - az
    dfx, dfy = -jx, -jy
    f = np.sqrt(fx * fx + fy * fy + fz * fz)
    b3x, b3y, b3z = fx / f, fy / f, fz / f
    along = (b3x * dfx + b3y * dfy) / f
    d3x, d3y, d3z = dfx / f - b3x * along, dfy / f - b3y * along, -b3z * along

    # b1 = (heading's left-right axis) x b3, normalised: the ZYX attitude of this yaw.
    c, s = np.cos(yaw), np.sin(yaw)
    nx, ny, nz = c * b3z, s * b3z, -s * b3y - c * b3x
    dnx = -s * w * b3z + c * d3z
    dny = c * w * b3z + s * d3z
    dnz = -c * w * b3y - s * d3y + s * w * b3x - c * d3x
    n = np.sqrt(nx * nx + ny * ny + nz * nz)
    b1x, b1y, b1z = nx / n, ny / n, nz / n
    along = (b1x * dnx + b1y * dny + b1z * dnz) / n
    d1 = dnx / n - b1x * along, dny / n - b1y * along, dnz / n - b1z * along
    return (b1x, b1y, b1z), (b3x, b3y, b3z), d1, (d3x, d3y, d3z)
