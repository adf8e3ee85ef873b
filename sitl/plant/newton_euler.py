"""The floating-base Newton–Euler recursion for a serial arm of *j* revolute joints.

Equations 4 and 5 of the paper, with every vector written in the body frame B instead of one
frame per link: the recursion is the same, the rotations between links drop out, and the
composite inertias of all links can be added. Joint *i* turns about z_{i-1} of the standard DH
convention (link frame *i* sits at the far end of link *i*). Body 0 is the base.

Deviations from the printed equations: eq 2's ω̇ × Iω̇ is ω × Iω, eq 5's cross products are
ordered so that moments balance, and eq 6's constant block-diagonal mass matrix is replaced by
the exact coupled one (docs/equations.md).
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import compiled, kernel
from sitl.plant.vector import (
    V3,
    Array,
    add,
    column,
    cross,
    dot,
    put,
    put_row,
    row,
    scale,
    sub,
    times_one,
    transposed_times,
)


class Chain(NamedTuple):
    """Numbers of the rigid bodies, ready for the kernels."""

    mount_R: Array  # (3, 3) columns x0, y0, z0 of DH frame 0, written in B
    mount_p: Array  # (3,) m, origin of DH frame 0 in B
    dh: Array  # (j, 4): a m, alpha rad, d m, theta offset rad
    mass: Array  # (j+1,) kg
    com: Array  # (j+1, 3) m, centre of mass in the body's own frame
    inertia: Array  # (j+1, 3, 3) kg·m², about the centre of mass, in the body's own frame


class Posture(NamedTuple):
    """Where everything is at one set of joint angles, written in B about the base origin."""

    axes: Array  # (j+1, 3, 3): columns x, y, z of DH frame i
    origin: Array  # (j+1, 3) m, origin of DH frame i
    com: Array  # (j+1, 3) m
    inertia: Array  # (j+1, 3, 3) kg·m², about each centre of mass
    force: Array  # (j+1, 3) N, that each body receives from the one before (recursion's memory)
    moment: Array  # (j+1, 3) N·m, likewise, about the joint between them


@compiled
def empty_posture(joints: int) -> Posture:
    """Room for a posture of an arm with ``joints`` joints."""
    n = joints + 1
    return Posture(
        np.empty((n, 3, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
        np.empty((n, 3, 3)),
        np.empty((n, 3)),
        np.empty((n, 3)),
    )


@kernel
def _place(chain: Chain, i: int, out: Posture) -> None:
    """Centre of mass and inertia of link ``i`` from its frame."""
    axes = out.axes
    com = times_one(axes, i, row(chain.com, i))
    put_row(out.com, i, add(row(out.origin, i), com))
    # R I Rᵀ, column by column: the rows of R are the columns of Rᵀ.
    for r in range(3):
        half = times_one(chain.inertia, i, (axes[i, r, 0], axes[i, r, 1], axes[i, r, 2]))
        whole = times_one(axes, i, half)
        out.inertia[i, 0, r] = whole[0]
        out.inertia[i, 1, r] = whole[1]
        out.inertia[i, 2, r] = whole[2]


@kernel
def _turn(chain: Chain, i: int, angle: float, out: Posture) -> None:
    """DH frame ``i`` from frame i − 1 and the angle of joint ``i``."""
    a, alpha, d = chain.dh[i - 1, 0], chain.dh[i - 1, 1], chain.dh[i - 1, 2]
    theta = angle + chain.dh[i - 1, 3]
    c, s, ca, sa = np.cos(theta), np.sin(theta), np.cos(alpha), np.sin(alpha)
    axes = out.axes
    for r in range(3):
        z = axes[i - 1, r, 2]
        x = c * axes[i - 1, r, 0] + s * axes[i - 1, r, 1]
        y = c * axes[i - 1, r, 1] - s * axes[i - 1, r, 0]
        axes[i, r, 0] = x
        axes[i, r, 1] = ca * y + sa * z
        axes[i, r, 2] = ca * z - sa * y
        out.origin[i, r] = out.origin[i - 1, r] + d * z + a * x


@kernel
def posture_into(chain: Chain, angles: Array, out: Posture) -> None:
    """Fill ``out`` for the joint angles (j,) [rad]."""
    for r in range(3):
        for c in range(3):
            out.axes[0, r, c] = chain.mount_R[r, c]
            out.inertia[0, r, c] = chain.inertia[0, r, c]
        out.origin[0, r] = chain.mount_p[r]
        out.com[0, r] = chain.com[0, r]
    for i in range(1, chain.mass.shape[0]):
        _turn(chain, i, angles[i - 1], out)
        _place(chain, i, out)


@kernel
def wrench_needed_into(
    chain: Chain,
    at: Posture,
    w: V3,
    alpha: V3,
    a: V3,
    qd: Array,
    qdd: Array,
    out: Array,
) -> None:
    """Inverse dynamics: the generalised force that produces the given accelerations.

    Forward recursion of ω, α, a (eq 4), backward recursion of f, τ (eq 5), base included.

    Args:
        chain: Rigid bodies.
        at: Posture at the joint angles.
        w: Angular velocity of the base [rad/s, B].
        alpha: Angular acceleration of the base [rad/s², B].
        a: Acceleration of the base origin minus gravity [m/s², B].
        qd: Joint rates (j,) [rad/s].
        qdd: Joint accelerations (j,) [rad/s²].
        out: (6 + j,) force [N, B], moment about the base origin [N·m, B], joint torques [N·m].

    Source: eqs 4 and 5 with errata; docs/equations.md.
    """
    joints = qd.shape[0]
    force, moment = at.force, at.moment
    # Forward, eq 4: inertial force and moment of each body about the origin of its joint.
    w_i, alpha_i, a_i = w, alpha, a
    for i in range(joints + 1):
        if i > 0:
            turn = scale(qd[i - 1], column(at.axes, i - 1, 2))
            alpha_i = add(alpha_i, cross(w_i, turn))
            alpha_i = add(alpha_i, scale(qdd[i - 1], column(at.axes, i - 1, 2)))
            w_i = add(w_i, turn)
        joint = row(at.origin, i - 1) if i > 0 else (0.0, 0.0, 0.0)
        to_com = sub(row(at.com, i), joint)
        a_com = add(a_i, add(cross(alpha_i, to_com), cross(w_i, cross(w_i, to_com))))
        f = scale(chain.mass[i], a_com)
        spin = times_one(at.inertia, i, w_i)
        own = add(times_one(at.inertia, i, alpha_i), cross(w_i, spin))
        put_row(force, i, f)
        put_row(moment, i, add(own, cross(to_com, f)))
        to_end = sub(row(at.origin, i), joint)
        a_i = add(a_i, add(cross(alpha_i, to_end), cross(w_i, cross(w_i, to_end))))
    # Backward, eq 5.
    for i in range(joints, 0, -1):
        out[5 + i] = dot(column(at.axes, i - 1, 2), row(moment, i))
        joint_below = row(at.origin, i - 2) if i > 1 else (0.0, 0.0, 0.0)
        arm = sub(row(at.origin, i - 1), joint_below)
        f = row(force, i)
        put_row(moment, i - 1, add(row(moment, i - 1), add(row(moment, i), cross(arm, f))))
        put_row(force, i - 1, add(row(force, i - 1), f))
    put(out, 0, row(force, 0))
    put(out, 3, row(moment, 0))


@kernel
def mass_matrix_into(chain: Chain, at: Posture, out: Array) -> None:
    """Lower triangle of the exact coupled mass matrix (6+j, 6+j).

    Rows and columns: base linear acceleration, base angular acceleration (both in B), joints.
    Equal, column by column, to ``wrench_needed_into`` with unit accelerations and zero rates;
    written with the composite body outboard of each joint because that is five times cheaper.
    """
    joints = at.origin.shape[0] - 1
    m, h = 0.0, (0.0, 0.0, 0.0)
    xx = yy = zz = xy = xz = yz = 0.0
    for i in range(joints, -1, -1):
        m_i, c, inertia = chain.mass[i], row(at.com, i), at.inertia
        m += m_i
        h = add(h, scale(m_i, c))
        xx += inertia[i, 0, 0] + m_i * (c[1] * c[1] + c[2] * c[2])
        yy += inertia[i, 1, 1] + m_i * (c[0] * c[0] + c[2] * c[2])
        zz += inertia[i, 2, 2] + m_i * (c[0] * c[0] + c[1] * c[1])
        xy += inertia[i, 1, 0] - m_i * c[0] * c[1]
        xz += inertia[i, 2, 0] - m_i * c[0] * c[2]
        yz += inertia[i, 2, 1] - m_i * c[1] * c[2]
        if i == 0:
            break
        # Unit rate of joint i moves the composite body: about z, and at the base origin
        # with o × z.
        z = column(at.axes, i - 1, 2)
        v = cross(row(at.origin, i - 1), z)
        p = add(scale(m, v), cross(z, h))
        spin = (
            xx * z[0] + xy * z[1] + xz * z[2],
            xy * z[0] + yy * z[1] + yz * z[2],
            xz * z[0] + yz * z[1] + zz * z[2],
        )
        momentum = add(cross(h, v), spin)
        put_row(out, 5 + i, p)
        out[5 + i, 3], out[5 + i, 4], out[5 + i, 5] = momentum
        for k in range(1, i + 1):
            z_k = column(at.axes, k - 1, 2)
            v_k = cross(row(at.origin, k - 1), z_k)
            out[5 + i, 5 + k] = dot(z_k, momentum) + dot(v_k, p)
    for r in range(6):
        for s in range(6):
            out[r, s] = 0.0
    out[0, 0] = out[1, 1] = out[2, 2] = m
    # Angular acceleration α gives the force α × h: rows 3..5 hold its transpose.
    out[3, 1], out[3, 2] = -h[2], h[1]
    out[4, 0], out[4, 2] = h[2], -h[0]
    out[5, 0], out[5, 1] = -h[1], h[0]
    out[3, 3], out[4, 4], out[5, 5] = xx, yy, zz
    out[4, 3], out[5, 3], out[5, 4] = xy, xz, yz


@kernel
def solve_in_place(m: Array, b: Array) -> None:
    """Solve M x = b by Cholesky; ``m`` (n, n) lower triangle and ``b`` (n,) are overwritten."""
    n = b.shape[0]
    for k in range(n):
        pivot, value = m[k, k], b[k]
        for s in range(k):
            pivot -= m[k, s] * m[k, s]
            value -= m[k, s] * b[s]
        # The diagonal keeps the inverse of the factor's: divisions are the slow part.
        inverse = 1.0 / np.sqrt(pivot)
        m[k, k] = inverse
        b[k] = value * inverse
        for r in range(k + 1, n):
            value = m[r, k]
            for s in range(k):
                value -= m[r, s] * m[k, s]
            m[r, k] = value * inverse
    for k in range(n - 1, -1, -1):
        value = b[k]
        for s in range(k + 1, n):
            value -= m[s, k] * b[s]
        b[k] = value * m[k, k]


@kernel
def gravity_in_body(rotation: Array, g: float) -> V3:
    """Gravity [m/s²] written in B for R_WB (3, 3); W is NED, so it points along +z."""
    return transposed_times(rotation, (0.0, 0.0, g))
