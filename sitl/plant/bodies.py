"""The rigid bodies and where they are: base and arm of *j* revolute joints.

Joint *i* turns about z_{i-1} of the standard DH convention (link frame *i* sits at the far end of
link *i*). Body 0 is the base.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import kernel
from sitl.plant.vector import Array, add, put_row, row, times_one


class Chain(NamedTuple):
    """Numbers of the rigid bodies, ready for the kernels."""

    mount_R: Array  # (3, 3) columns x0, y0, z0 of DH frame 0, written in B
    mount_p: Array  # (3,) m, origin of DH frame 0 in B
    dh: Array  # (j, 5): a m, cosine and sine of alpha, d m, theta offset rad
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


def empty_posture(joints: int) -> Posture:
    """Room for a posture of an arm with ``joints`` joints."""
    n = joints + 1
    return Posture(
        axes=np.empty((n, 3, 3)),
        origin=np.empty((n, 3)),
        com=np.empty((n, 3)),
        inertia=np.empty((n, 3, 3)),
        force=np.empty((n, 3)),
        moment=np.empty((n, 3)),
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
    a, ca, sa = chain.dh[i - 1, 0], chain.dh[i - 1, 1], chain.dh[i - 1, 2]
    d, theta = chain.dh[i - 1, 3], angle + chain.dh[i - 1, 4]
    c, s = np.cos(theta), np.sin(theta)
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
