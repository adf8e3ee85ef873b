"""The rigid bodies and where they are: base and a serial arm of revolute joints about any axes.

Body 0 is the base, body *i* the link behind joint *i*. Its frame sits at that joint and has the
joint's axis along z.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import kernel
from sitl.plant.state import JOINTS_MAX
from sitl.plant.vector import Array, add, put_row, row, times_one


class Chain(NamedTuple):
    """Numbers of the rigid bodies for the kernels; there is room for more joints than there are."""

    joints: int
    turn: Array  # (7, 3, 3) axes of frame i in frame i − 1, its joint at zero; of 0: the identity
    origin: Array  # (8, 3) m, joint i in frame i − 1; behind the last joint the end-effector
    mass: Array  # (7,) kg
    com: Array  # (7, 3) m, centre of mass in the body's own frame
    inertia: Array  # (7, 3, 3) kg·m², about the centre of mass, in the body's own frame


class Points(NamedTuple):
    """Points of the vehicle that are no joint, see ``places``; there is room for 192."""

    number: int
    body: Array  # (192,) which one each is on
    place: Array  # (192, 3) m, in its frame


class Posture(NamedTuple):
    """Where everything is at one set of joint angles, written in B about the base origin."""

    axes: Array  # (7, 3, 3): columns x, y, z of frame i; z is the axis of joint i
    origin: Array  # (8, 3) m, joint i; behind the last joint the end-effector
    com: Array  # (7, 3) m
    inertia: Array  # (7, 3, 3) kg·m², about each centre of mass
    force: Array  # (7, 3) N, that each body receives from the one before (recursion's memory)
    moment: Array  # (7, 3) N·m, likewise, about the joint between them


def empty_posture() -> Posture:
    """Room for a posture of any arm."""
    n = JOINTS_MAX + 1
    return Posture(
        axes=np.empty((n, 3, 3)),
        origin=np.empty((n + 1, 3)),
        com=np.empty((n, 3)),
        inertia=np.empty((n, 3, 3)),
        force=np.empty((n, 3)),
        moment=np.empty((n, 3)),
    )


@kernel
def posture_into(chain: Chain, state: Array, first: int, out: Posture) -> None:
    """Fill ``out`` for the joint angles [rad] from entry ``first`` of a state (n,) [SI] on."""
    axes, origin = out.axes, out.origin
    for r in range(3):
        for c in range(3):
            axes[0, r, c] = 1.0 if r == c else 0.0
            out.inertia[0, r, c] = chain.inertia[0, r, c]
        origin[0, r] = 0.0
        out.com[0, r] = chain.com[0, r]
    for i in range(1, chain.joints + 1):
        put_row(origin, i, add(row(origin, i - 1), times_one(axes, i - 1, row(chain.origin, i))))
        c, s = np.cos(state[first + i - 1]), np.sin(state[first + i - 1])
        for r in range(3):
            x = y = z = 0.0
            for k in range(3):
                x += axes[i - 1, r, k] * chain.turn[i, k, 0]
                y += axes[i - 1, r, k] * chain.turn[i, k, 1]
                z += axes[i - 1, r, k] * chain.turn[i, k, 2]
            axes[i, r, 0] = c * x + s * y
            axes[i, r, 1] = c * y - s * x
            axes[i, r, 2] = z
        put_row(out.com, i, add(row(origin, i), times_one(axes, i, row(chain.com, i))))
        # R I Rᵀ, column by column: the rows of R are the columns of Rᵀ.
        for r in range(3):
            half = times_one(chain.inertia, i, (axes[i, r, 0], axes[i, r, 1], axes[i, r, 2]))
            whole = times_one(axes, i, half)
            out.inertia[i, 0, r] = whole[0]
            out.inertia[i, 1, r] = whole[1]
            out.inertia[i, 2, r] = whole[2]
    last = chain.joints
    tool = add(row(origin, last), times_one(axes, last, row(chain.origin, last + 1)))
    put_row(origin, last + 1, tool)
