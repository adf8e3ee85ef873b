"""Feet on the ground plane z = 0."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import kernel
from sitl.plant.vector import V3, Array, add, cross, row, times, transposed_times


class Feet(NamedTuple):
    """Numbers of the landing gear for the kernels; there is room for 64."""

    number: int
    points: Array  # (64, 3) m, in B
    reach: float  # m, largest distance of a foot from the base origin
    stiffness: float  # N/m
    dissipation: float  # s/m
    friction: float
    slip_rate: float  # m/s


@kernel
def foot_force(feet: Feet, depth: float, v: V3) -> V3:
    """Ground reaction [N, NED] on a foot at a depth [m] below ground, moving with ``v`` [m/s, NED].

    Hunt–Crossley normal force: unlike a linear damper it grows from zero at touch-down, so
    the integrator sees no jump. Never pulls.
    """
    normal = max(feet.stiffness * depth * (1.0 + feet.dissipation * v[2]), 0.0)
    slip = np.sqrt(v[0] * v[0] + v[1] * v[1] + feet.slip_rate * feet.slip_rate)
    grip = -feet.friction * normal / slip
    return (grip * v[0], grip * v[1], -normal)


@kernel
def ground_wrench(feet: Feet, p: V3, v: V3, w: V3, rotation: Array) -> tuple[V3, V3]:
    """Force [N, B] and moment about the base origin [N·m, B] of all feet.

    The base origin is at p [m, NED] and moves at v [m/s, NED] and w [rad/s, B]; R_WB is in rotation
    (3, 3) [1].
    """
    force = moment = (0.0, 0.0, 0.0)
    if p[2] + feet.reach < 0.0:
        return force, moment
    for i in range(feet.number):
        foot = row(feet.points, i)
        depth = p[2] + times(rotation, foot)[2]
        if depth > 0.0:
            v_foot = add(v, times(rotation, cross(w, foot)))
            f = transposed_times(rotation, foot_force(feet, depth, v_foot))
            force = add(force, f)
            moment = add(moment, cross(foot, f))
    return force, moment
