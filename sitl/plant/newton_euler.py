"""The floating-base Newton–Euler recursion for a serial arm of *j* revolute joints.

Equations 4 and 5 of the paper, with every vector written in the body frame B instead of one
frame per link: the recursion is the same, the rotations between links drop out, and the
composite inertias of all links can be added (``mass_matrix``).

Deviations from the printed equations: eq 2's ω̇ × Iω̇ is ω × Iω, eq 5's cross products are
ordered so that moments balance, and the base is a body like the others
(docs/equations.md E4, E5).
"""

from __future__ import annotations

from sitl.compiled import kernel
from sitl.plant.bodies import Chain, Posture
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
)


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

    The base has w [rad/s, B], alpha [rad/s², B] and, less gravity, a [m/s², B]; the joints have qd
    (j,) [rad/s] and qdd (j,) [rad/s²]. Into out (6 + j,) [SI]: force [N, B], moment about the base
    origin [N·m, B], joint torques [N·m]. Each array may be longer.

    Source: eqs 4 and 5 with errata; docs/equations.md E4, E5.
    """
    joints, force, moment = chain.joints, at.force, at.moment
    # Forward, eq 4: inertial force and moment of each body about the origin of its joint.
    w_i, alpha_i, a_i = w, alpha, a
    for i in range(joints + 1):
        if i > 0:
            to_joint = sub(row(at.origin, i), row(at.origin, i - 1))
            a_i = add(a_i, add(cross(alpha_i, to_joint), cross(w_i, cross(w_i, to_joint))))
            z = column(at.axes, i, 2)
            turn = scale(qd[i - 1], z)
            alpha_i = add(alpha_i, cross(w_i, turn))
            alpha_i = add(alpha_i, scale(qdd[i - 1], z))
            w_i = add(w_i, turn)
        to_com = sub(row(at.com, i), row(at.origin, i))
        a_com = add(a_i, add(cross(alpha_i, to_com), cross(w_i, cross(w_i, to_com))))
        f = scale(chain.mass[i], a_com)
        spin = times_one(at.inertia, i, w_i)
        own = add(times_one(at.inertia, i, alpha_i), cross(w_i, spin))
        put_row(force, i, f)
        put_row(moment, i, add(own, cross(to_com, f)))
    # Backward, eq 5.
    for i in range(joints, 0, -1):
        out[5 + i] = dot(column(at.axes, i, 2), row(moment, i))
        arm = sub(row(at.origin, i), row(at.origin, i - 1))
        f = row(force, i)
        put_row(moment, i - 1, add(row(moment, i - 1), add(row(moment, i), cross(arm, f))))
        put_row(force, i - 1, add(row(force, i - 1), f))
    put(out, 0, row(force, 0))
    put(out, 3, row(moment, 0))
