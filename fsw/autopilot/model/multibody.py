r"""The vehicle as rigid bodies: a base and an arm of up to ``JOINTS`` joints about any axes.

A payload is a point mass at the end-effector. Everything is written in the body frame B, about its
origin, whose velocity is taken as zero: what the base's linear acceleration does to the arm is a
uniform field. With w the base's rate and q the joints, the vehicle obeys

.. math::
    \begin{bmatrix} m 1 & M_{vw} & M_{vq} \\ \cdot & M_{ww} & M_{wq} \\ \cdot & \cdot & M_{qq}
    \end{bmatrix}
    \begin{bmatrix} \dot v \\ \dot w \\ \ddot q \end{bmatrix}
    + \begin{bmatrix} b_v \\ b_w \\ b_q \end{bmatrix}
    = \begin{bmatrix} F \\ \tau_B \\ \tau_q \end{bmatrix}

with F all forces but weight, :math:`\dot v` the acceleration beside gravity, b of the rates. One
elimination of linear motion and joints leaves what turns the base:

.. math:: J \dot w = \tau_B - c \times F - R (\tau_q - M_{qv} F / m - b_q') - b_w'

with J the effective inertia about the centre of mass c and R how joint torques react on the base.

Source: R. Featherstone, Rigid Body Dynamics Algorithms, 2008, ch. 6 and 9; docs/equations.md T1.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from typing import Final

from fsw.autopilot.geometry.rotation import (
    matrix_from_quaternion,
    nine,
    quaternion_from_euler,
    rotate,
)
from fsw.autopilot.geometry.vectors import (
    add,
    add_scaled,
    cross,
    dot,
    put_three,
    subtract,
    three,
)
from fsw.autopilot.signals import Mat3, Vec3
from fsw.autopilot.tick_record import AnyEstimate, ArmTask, Multibody
from fsw.compiled import compilable
from fsw.record import JOINTS, Floats, padded_rows
from vehicles.description import V6, Vehicle

Several = tuple[float, ...]
_SINGULAR: Final = 1e-9  # share of a diagonal entry that is left of one that others determine
_SUMS: Final = len(Multibody().of_link) // JOINTS  # numbers that a link adds: seven vectors
_VECTORS: Final = _SUMS // 3
_CARRIED: Final = 3 + 2 * JOINTS  # its place in ``of``


@dataclass(frozen=True, slots=True)
class Bodies:
    """Numbers of the bodies, one joint after the other, with room for ``JOINTS`` of them."""

    joints: int
    base_mass: float  # kg
    base_com: Vec3  # m, B
    base_inertia: V6  # kg m^2, xx yy zz xy xz yz about the centre of mass
    offset: Several  # (3,) m each, of the joint in the frame of the link before
    turned: Several  # (9,) each, from the joint's frame at angle zero to that of the link before
    axis: Several  # (3,) each, unit, in the joint's frame
    mass: Several  # kg, of the link
    com: Several  # (3,) m each, in the joint's frame, which the link moves with
    inertia: Several  # (6,) kg m^2 each, about the link's centre of mass
    armature: Several  # kg m^2, of the motor behind its gear
    tip: Vec3  # m, end-effector in the frame of the last joint


def bodies_of(vehicle: Vehicle) -> Bodies:
    """The bodies of a vehicle."""
    joints = vehicle.joints
    return Bodies(
        joints=len(joints),
        base_mass=vehicle.base.mass,
        base_com=vehicle.base.com,
        base_inertia=vehicle.base.inertia,
        offset=padded_rows([joint.xyz for joint in joints], 3 * JOINTS),
        turned=padded_rows(
            [matrix_from_quaternion(quaternion_from_euler(joint.rpy)) for joint in joints],
            9 * JOINTS,
        ),
        axis=padded_rows([joint.axis for joint in joints], 3 * JOINTS),
        mass=padded_rows([(joint.link.mass,) for joint in joints], JOINTS),
        com=padded_rows([joint.link.com for joint in joints], 3 * JOINTS),
        inertia=padded_rows([joint.link.inertia for joint in joints], 6 * JOINTS),
        armature=padded_rows([(joint.armature,) for joint in joints], JOINTS),
        tip=vehicle.end_effector.position,
    )


@compilable
def _six(a: Several, k: int) -> V6:
    i = 6 * k
    return a[i], a[i + 1], a[i + 2], a[i + 3], a[i + 4], a[i + 5]


@compilable
def _product(a: Mat3, b: Mat3) -> Mat3:
    return (
        a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
        a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
        a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
        a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
        a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
        a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
        a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
        a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
        a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
    )


@compilable
def times_symmetric(s: V6, v: Vec3) -> Vec3:
    """A symmetric matrix ``s`` (xx yy zz xy xz yz) times a vector ``v`` [any, B]; both in B."""
    return (
        s[0] * v[0] + s[3] * v[1] + s[4] * v[2],
        s[3] * v[0] + s[1] * v[1] + s[5] * v[2],
        s[4] * v[0] + s[5] * v[1] + s[2] * v[2],
    )


@compilable
def _rotated(R: Mat3, s: V6) -> V6:
    """A symmetric matrix in other axes."""
    x = times_symmetric(s, (R[0], R[1], R[2]))
    y = times_symmetric(s, (R[3], R[4], R[5]))
    z = times_symmetric(s, (R[6], R[7], R[8]))
    return (
        R[0] * x[0] + R[1] * x[1] + R[2] * x[2],
        R[3] * y[0] + R[4] * y[1] + R[5] * y[2],
        R[6] * z[0] + R[7] * z[1] + R[8] * z[2],
        R[3] * x[0] + R[4] * x[1] + R[5] * x[2],
        R[6] * x[0] + R[7] * x[1] + R[8] * x[2],
        R[6] * y[0] + R[7] * y[1] + R[8] * y[2],
    )


@compilable
def _about(axis: Vec3, angle: float) -> Mat3:
    """Rotation by an angle about a unit axis."""
    x, y, z = axis
    c, s = math.cos(angle), math.sin(angle)
    d = 1.0 - c
    return (
        *(c + x * x * d, x * y * d - z * s, x * z * d + y * s),
        *(y * x * d + z * s, c + y * y * d, y * z * d - x * s),
        *(z * x * d - y * s, z * y * d + x * s, c + z * z * d),
    )


@compilable
def next_axes(b: Bodies, k: int, R: Mat3, angle: float) -> tuple[Vec3, Mat3]:
    """The axis of joint ``k`` and the axes of its link, turned by an ``angle`` [rad].

    ``R`` are the axes of the link before, or of the base, in whatever frame.
    """
    at_zero = _product(R, nine(b.turned, 9 * k))
    axis = three(b.axis, 3 * k)
    return rotate(at_zero, axis), _product(at_zero, _about(axis, angle))


@compilable
def place_links(m: Multibody | ArmTask, b: Bodies, q: Several | Floats) -> None:
    """Where joints and links are at the angles ``q`` (j,) [rad]. Writes rotation, origin, axis."""
    R: Mat3 = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)
    o: Vec3 = (0.0, 0.0, 0.0)
    for k in range(int(b.joints)):
        o = add(o, rotate(R, three(b.offset, 3 * k)))
        axis, R = next_axes(b, k, R, q[k])
        put_three(m.axis, 3 * k, axis)
        put_three(m.origin, 3 * k, o)
        for i in range(9):
            m.rotation[9 * k + i] = R[i]


@compilable
def move_bodies(m: Multibody, b: Bodies, armature: float, estimate: AnyEstimate) -> None:
    """All of ``m`` at the joints' angles and rates and the base's rate that are estimated.

    Every joint has an ``armature`` [kg m^2] beside its own.
    """
    if not _are_others(m, b, estimate):
        return
    place_links(m, b, estimate.q_arm)
    rate = estimate.w_WB_B
    _move_links(m, b, estimate.qd_arm, (rate[0], rate[1], rate[2]))
    _sum_up(m, b, armature, estimate.qd_arm, (rate[0], rate[1], rate[2]))
    _eliminate(m, b)


@compilable
def _are_others(m: Multibody, b: Bodies, estimate: AnyEstimate) -> bool:
    """Whether a pose and motion are others than those of ``m``. Writes of."""
    changed = not m.inertia[0] > 0.0  # nothing was found yet
    for i in range(3):
        changed = changed or m.of[i] != estimate.w_WB_B[i]
        m.of[i] = estimate.w_WB_B[i]
    for k in range(int(b.joints)):
        i = 3 + 2 * k
        changed = changed or m.of[i] != estimate.q_arm[k] or m.of[i + 1] != estimate.qd_arm[k]
        m.of[i], m.of[i + 1] = estimate.q_arm[k], estimate.qd_arm[k]
    changed = changed or m.of[_CARRIED] != m.carried
    m.of[_CARRIED] = m.carried
    return changed


@lru_cache(maxsize=64)
def posture(b: Bodies, q: Several) -> Multibody:
    """The vehicle at rest with its joints at ``q`` (j,) [rad]."""
    m, still = Multibody(), (0.0, 0.0, 0.0)
    place_links(m, b, q)
    _move_links(m, b, (0.0,) * b.joints, still)
    _sum_up(m, b, 0.0, (0.0,) * b.joints, still)
    _eliminate(m, b)
    return m


@compilable
def _move_links(m: Multibody, b: Bodies, qd: Several | Floats, rate: Vec3) -> None:
    """Motion of each link, and what of it is summed. Writes rate, speed, of_link."""
    w = rate
    turning: Vec3 = (0.0, 0.0, 0.0)  # rad/s^2, of the link, without accelerations of joints
    before: Vec3 = (0.0, 0.0, 0.0)
    v: Vec3 = (0.0, 0.0, 0.0)
    a: Vec3 = (0.0, 0.0, 0.0)
    for k in range(int(b.joints)):
        o, axis = three(m.origin, 3 * k), three(m.axis, 3 * k)
        d = add_scaled(o, before, -1.0)
        a = add(a, add(cross(turning, d), cross(w, cross(w, d))))
        v = add(v, cross(w, d))
        turning = add_scaled(turning, cross(w, axis), qd[k])
        w = add_scaled(w, axis, qd[k])
        put_three(m.rate, 3 * k, w)
        put_three(m.speed, 3 * k, v)
        R = nine(m.rotation, 9 * k)
        mass, com, own = _loaded(b, k, m.carried)
        inertia, arm = _rotated(R, own), rotate(R, com)
        swept = cross(w, arm)
        _note(
            m.of_link,
            k,
            mass,
            add(o, arm),
            inertia,
            add(v, swept),
            times_symmetric(inertia, w),
            add(a, add(cross(turning, arm), cross(w, swept))),
            add(times_symmetric(inertia, turning), cross(w, times_symmetric(inertia, w))),
        )
        before = o


@compilable
def _loaded(b: Bodies, k: int, load: float) -> tuple[float, Vec3, V6]:
    """Mass, centre and inertia of a link; the last has a ``load`` [kg] at the end-effector."""
    mass, com, own = b.mass[k], three(b.com, 3 * k), _six(b.inertia, k)
    if k < int(b.joints) - 1 or not load > 0.0:
        return mass, com, own
    whole = mass + load
    d = b.tip[0] - com[0], b.tip[1] - com[1], b.tip[2] - com[2]
    x, y, z = d
    apart, square = mass * load / whole, dot(d, d)
    return (
        whole,
        add_scaled(com, d, load / whole),
        (
            *(own[0] + apart * (square - x * x), own[1] + apart * (square - y * y)),
            *(own[2] + apart * (square - z * z), own[3] - apart * x * y),
            *(own[4] - apart * x * z, own[5] - apart * y * z),
        ),
    )


@compilable
def _note(
    sums: Floats,
    k: int,
    mass: float,
    c: Vec3,
    inertia: V6,
    v: Vec3,
    spin: Vec3,
    a: Vec3,
    moment: Vec3,
) -> None:
    """What one link adds, about the origin: moments of mass, momentum, force that it takes."""
    at, square, (x, y, z), (xx, yy, zz, xy, xz, yz) = _SUMS * k, dot(c, c), c, inertia
    own = (xx + mass * (square - x * x), yy + mass * (square - y * y), zz + mass * (square - z * z))
    put_three(sums, at, (mass * x, mass * y, mass * z))
    put_three(sums, at + 3, own)
    put_three(sums, at + 6, (xy - mass * x * y, xz - mass * x * z, yz - mass * y * z))
    put_three(sums, at + 9, (mass * v[0], mass * v[1], mass * v[2]))
    put_three(sums, at + 12, add_scaled(spin, cross(c, v), mass))
    put_three(sums, at + 15, (mass * a[0], mass * a[1], mass * a[2]))
    put_three(sums, at + 18, add_scaled(moment, cross(c, a), mass))


@compilable
def _sum_up(m: Multibody, b: Bodies, armature: float, qd: Several | Floats, rate: Vec3) -> None:
    """From the tip to the base. Writes of_link, vq, wq, qq, bias, momentum, drift, bias_v, _w."""
    n, sums, mass = int(b.joints), m.of_link, m.carried
    for k in range(n - 1, -1, -1):
        mass += b.mass[k]
        if k < n - 1:
            for i in range(_SUMS):
                sums[_SUMS * k + i] += sums[_SUMS * (k + 1) + i]
        i = _VECTORS * k
        axis, o, h = three(m.axis, 3 * k), three(m.origin, 3 * k), three(sums, 3 * i)
        s = cross(o, axis)  # velocity at B's origin of a body that turns about the joint
        x, y = three(sums, 3 * (i + 1)), three(sums, 3 * (i + 2))
        inertia = (x[0], x[1], x[2], y[0], y[1], y[2])
        put_three(m.vq, 3 * k, add_scaled(cross(axis, h), s, mass))
        put_three(m.wq, 3 * k, add(cross(h, s), times_symmetric(inertia, axis)))
        for j in range(k + 1):
            along, aside = three(m.axis, 3 * j), cross(three(m.origin, 3 * j), three(m.axis, 3 * j))
            value = dot(along, three(m.wq, 3 * k)) + dot(aside, three(m.vq, 3 * k))
            m.qq[JOINTS * j + k] = m.qq[JOINTS * k + j] = value
        m.qq[JOINTS * k + k] += b.armature[k] + armature
        p, spin = three(sums, 3 * (i + 3)), three(sums, 3 * (i + 4))
        spin = add_scaled(spin, cross(o, p), -1.0)  # about the joint
        own = (b.armature[k] + armature) * qd[k]
        m.momentum[k] = dot(axis, spin) + own
        turned = cross(three(m.rate, 3 * k), axis)
        m.drift[k] = dot(turned, spin) - dot(axis, cross(three(m.speed, 3 * k), p))
        m.bias[k] = dot(axis, three(sums, 3 * (i + 6))) + dot(s, three(sums, 3 * (i + 5)))
    base, c = b.base_mass, (b.base_com[0], b.base_com[1], b.base_com[2])
    swept = cross(rate, cross(rate, c))
    spin = cross(rate, times_symmetric(_six(b.base_inertia, 0), rate))
    put_three(m.bias_v, 0, add_scaled(three(sums, 15), swept, base))
    put_three(m.bias_w, 0, add_scaled(add(three(sums, 18), spin), cross(c, swept), base))
    whole = 1.0 / (mass + base)
    h = add_scaled(three(sums, 0), c, base)
    put_three(m.centre, 0, (whole * h[0], whole * h[1], whole * h[2]))


@compilable
def mass_of(m: Multibody, b: Bodies) -> float:
    """Of all bodies, and of what is carried [kg]."""
    mass = b.base_mass
    for k in range(int(b.joints)):
        mass += b.mass[k]
    return float(mass + m.carried)


@compilable
def _eliminate(m: Multibody, b: Bodies) -> None:
    """Linear motion and joints out of the mass matrix. Writes what comes after in the record."""
    n, mass, c = int(b.joints), mass_of(m, b), three(m.centre, 0)
    for k in range(n):
        f = three(m.vq, 3 * k)
        put_three(m.wq_free, 3 * k, add_scaled(three(m.wq, 3 * k), cross(c, f), -1.0))
        for i in range(n):
            less = dot(f, three(m.vq, 3 * i)) / mass
            m.qq_free[JOINTS * k + i] = m.qq[JOINTS * k + i] - less
    factorise(m.factor, m.qq_free, n)
    for axis in range(3):
        for k in range(n):
            m.work[k] = m.wq_free[3 * k + axis]
        solve(m.factor, m.work, n)
        for k in range(n):
            m.reaction[3 * k + axis] = m.work[k]
    _begin_inertia(m, b, mass, c)
    J, S = m.inertia, m.swing
    S[0], S[1], S[2] = 0.0, c[2], -c[1]
    S[3], S[4], S[5] = -c[2], 0.0, c[0]
    S[6], S[7], S[8] = c[1], -c[0], 0.0
    for k in range(n):
        f, t, r = three(m.vq, 3 * k), three(m.wq_free, 3 * k), three(m.reaction, 3 * k)
        for i in range(3):
            for j in range(3):
                J[3 * i + j] -= t[i] * r[j]
                S[3 * i + j] -= f[i] * r[j] / mass
    _invert(J, m.inverse)


@compilable
def _begin_inertia(m: Multibody, b: Bodies, mass: float, c: Vec3) -> None:
    """The inertia of all bodies about the centre of mass ``c``, as if no joint moved."""
    d, base, sums, J = b.base_com, b.base_inertia, m.of_link, m.inertia
    for i in range(3):
        for j in range(i + 1):
            entry = i if i == j else 2 + i + j  # of xx yy zz xy xz yz
            J[3 * i + j] = base[entry] + sums[3 + entry]
            J[3 * i + j] += mass * c[i] * c[j] - b.base_mass * d[i] * d[j]
        J[4 * i] += b.base_mass * dot(d, d) - mass * dot(c, c)
    J[1], J[2], J[5] = J[3], J[6], J[7]


@compilable
def _invert(a: Floats, out: Floats) -> None:
    """The inverse of a symmetric matrix (3, 3)."""
    p = a[4] * a[8] - a[5] * a[5]
    q = a[2] * a[5] - a[1] * a[8]
    r = a[1] * a[5] - a[2] * a[4]
    scale = 1.0 / (a[0] * p + a[1] * q + a[2] * r)
    out[0], out[1], out[2] = scale * p, scale * q, scale * r
    out[3], out[4] = out[1], scale * (a[0] * a[8] - a[2] * a[2])
    out[5] = scale * (a[1] * a[2] - a[0] * a[5])
    out[6], out[7], out[8] = out[2], out[5], scale * (a[0] * a[4] - a[1] * a[1])


@compilable
def factorise(factor: Floats, a: Floats, n: int) -> None:
    """Cholesky's lower factor of the leading part (n, n) of a matrix (JOINTS, JOINTS) [any].

    A row that the ones before it determine is left out: its unknown will be 0.
    """
    for i in range(n):
        for j in range(i + 1):
            total = a[JOINTS * i + j]
            for k in range(j):
                total -= factor[JOINTS * i + k] * factor[JOINTS * j + k]
            if i == j:
                whole = total > _SINGULAR * a[JOINTS * i + i]
                factor[JOINTS * i + i] = math.sqrt(total) if whole else math.inf
            else:
                factor[JOINTS * i + j] = total / factor[JOINTS * j + j]


@compilable
def solve(factor: Floats, x: Floats, n: int) -> None:
    """Solve A y = x (n,) [any] in place, with the ``factor`` (JOINTS, JOINTS) [any] of A."""
    for i in range(n):
        for k in range(i):
            x[i] -= factor[JOINTS * i + k] * x[k]
        x[i] /= factor[JOINTS * i + i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[JOINTS * k + i] * x[k]
        x[i] /= factor[JOINTS * i + i]


@compilable
def load_on_base(m: Multibody, b: Bodies, force: Vec3, torque: Several | Floats) -> Vec3:
    """What of a rotor torque [N m, B] does not turn the base.

    ``force`` [N, B] is that of the rotors, at B's origin, ``torque`` (j,) [N m] that of the joints.
    """
    c, mass = three(m.centre, 0), mass_of(m, b)
    push = add_scaled(force, three(m.bias_v, 0), -1.0)
    load = add(cross(c, push), three(m.bias_w, 0))
    for k in range(int(b.joints)):
        free = torque[k] - m.bias[k] - dot(three(m.vq, 3 * k), push) / mass
        load = add_scaled(load, three(m.reaction, 3 * k), free)
    return load


@compilable
def base_acceleration(
    m: Multibody, b: Bodies, turn: Vec3, force: Vec3, torque: Several | Floats
) -> Vec3:
    """Angular acceleration [rad/s^2, B] under a ``turn`` [N m, B] of the rotors.

    ``force`` [N, B] and ``torque`` (j,) [N m] as of ``load_on_base``.
    """
    return rotate(m.inverse, add_scaled(turn, load_on_base(m, b, force, torque), -1.0))


@compilable
def torque_to_turn(
    m: Multibody, b: Bodies, acceleration: Vec3, load: Vec3, knows_arm: bool = True
) -> Vec3:
    """Rotor torque [N m, B] for an ``acceleration`` [rad/s^2, B] against a ``load`` [N m, B].

    The paper's own loop does not know that the arm adds to the base's inertia.
    """
    if knows_arm:
        return add(rotate(m.inertia, acceleration), load)
    return add(times_symmetric(_six(b.base_inertia, 0), acceleration), load)


@compilable
def joint_load(m: Multibody, k: int, field: Vec3, turning: Vec3) -> float:
    """Torque [N m] of joint ``k`` that does not accelerate any joint.

    The ``field`` [m/s^2, B] is gravity less the acceleration of B's origin; the base has an angular
    acceleration ``turning`` [rad/s^2, B].
    """
    return float(m.bias[k] - dot(three(m.vq, 3 * k), field) + dot(three(m.wq, 3 * k), turning))


@compilable
def joint_drift(m: Multibody, k: int, field: Vec3) -> float:
    """What changes joint ``k``'s momentum [N m] beside its torque in a ``field`` [m/s^2, B]."""
    return float(m.drift[k] + dot(three(m.vq, 3 * k), field))


@compilable
def place_of_tip(m: Multibody | ArmTask, b: Bodies) -> Vec3:
    """Position [m, B] of the end-effector, of links that are placed."""
    last = int(b.joints) - 1
    tip = (b.tip[0], b.tip[1], b.tip[2])
    return add(three(m.origin, 3 * last), rotate(nine(m.rotation, 9 * last), tip))


@compilable
def lever_of(m: Multibody | ArmTask, k: int, tip: Vec3) -> Vec3:
    """How a turn of joint ``k`` moves what is at ``tip`` [m, B] on the last link [m/rad, B]."""
    return cross(three(m.axis, 3 * k), subtract(tip, three(m.origin, 3 * k)))


@compilable
def velocity_of_tip(m: Multibody, b: Bodies) -> Vec3:
    """Velocity [m/s, B] of the end-effector beside that of B's origin."""
    last = int(b.joints) - 1
    arm = rotate(nine(m.rotation, 9 * last), (b.tip[0], b.tip[1], b.tip[2]))
    return add(three(m.speed, 3 * last), cross(three(m.rate, 3 * last), arm))
