"""The exact coupled mass matrix of base and arm, and its solver.

It stands where the paper's eq 6 has a constant block-diagonal matrix (docs/equations.md E6).
"""

from __future__ import annotations

import numpy as np

from sitl.compiled import kernel
from sitl.plant.bodies import Chain, Posture
from sitl.plant.vector import Array, add, column, cross, dot, put_row, row, scale


@kernel
def mass_matrix_into(chain: Chain, at: Posture, out: Array) -> None:
    """Lower triangle of the exact coupled mass matrix into out (12, 12) [kg, kg·m, kg·m²].

    Rows and columns: base linear acceleration, base angular acceleration (both in B), joints.
    Equal, column by column, to ``wrench_needed_into`` with unit accelerations and zero rates;
    written with the composite body outboard of each joint because that is five times cheaper.
    """
    joints = chain.joints
    for r in range(6):
        for s in range(r):
            out[r, s] = 0.0
    # The composite body: mass, first moment, inertia about the base origin.
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
        z = column(at.axes, i, 2)
        v = cross(row(at.origin, i), z)
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
            z_k = column(at.axes, k, 2)
            v_k = cross(row(at.origin, k), z_k)
            out[5 + i, 5 + k] = dot(z_k, momentum) + dot(v_k, p)
    out[0, 0] = out[1, 1] = out[2, 2] = m
    # Angular acceleration α gives the force α × h: rows 3..5 hold its transpose.
    out[3, 1], out[3, 2] = -h[2], h[1]
    out[4, 0], out[4, 2] = h[2], -h[0]
    out[5, 0], out[5, 1] = -h[1], h[0]
    out[3, 3], out[4, 4], out[5, 5] = xx, yy, zz
    out[4, 3], out[5, 3], out[5, 4] = xy, xz, yz


def mass_matrix(chain: Chain, at: Posture, motors: Array, out: Array) -> Array:
    """The whole of it (6 + j, 6 + j) [SI], by way of ``out`` (12, 12) [SI].

    With the inertia of ``motors`` (j,) [kg·m²] behind the joints' gears; there is room for more.
    """
    joints = chain.joints
    mass_matrix_into(chain, at, out)
    lower = np.tril(out[: 6 + joints, : 6 + joints])
    whole: Array = lower + np.tril(lower, -1).T
    whole[6:, 6:] += np.diag(motors[:joints])
    return whole


@kernel
def solve_in_place(m: Array, b: Array, n: int) -> None:
    """Solve m (n, n) [any unit] x = b (n,) [any unit] by Cholesky; both are overwritten.

    Both may have room for more. Only the lower triangle of ``m`` is read.
    """
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
