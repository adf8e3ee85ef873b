r"""What pushes back where the vehicle touches something: feet on the ground, its balls on surfaces.

One law for both, that of Hunt and Crossley with a smoothed friction of Coulomb:

.. math::
    f_n = \max(0, k δ (1 + c \dot δ)), \quad
    f_t = -μ f_n v_t / \sqrt{v_t^2 + v_s^2}

Unlike a linear damper it grows from zero at touch-down, so that the integrator sees no jump, and it
never pulls. What slips slower than :math:`v_s` sticks but for a creep.

Source: K. H. Hunt, F. R. E. Crossley, Coefficient of restitution interpreted as damping in
vibroimpact, J. Applied Mechanics 42 (1975) 440, with the exponent 1.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from sitl.compiled import compilable, kernel
from sitl.nearest import nearest
from sitl.plant.bodies import Chain, Posture
from sitl.plant.state import P_WB, V_WB, W_WB_B
from sitl.plant.vector import (
    V3,
    Array,
    add,
    column,
    cross,
    dot,
    put_row,
    row,
    scale,
    sub,
    times,
    times_one,
    transposed_times,
    triple,
)

SLIP_RATE = 0.01  # m/s, width of the smoothed friction on surfaces
TIP = 0  # which of the balls may touch
FASTEST = 20.0  # m/s, at which a tip and a surface meet
_UP: V3 = (0.0, 0.0, -1.0)


class Law(NamedTuple):
    """Numbers of one pair of bodies."""

    stiffness: float  # N/m
    dissipation: float  # s/m
    friction: float
    slip_rate: float  # m/s


class Feet(NamedTuple):
    """Numbers of the landing gear for the kernels; there is room for 64."""

    number: int
    points: Array  # (64, 3) m, in B
    reach: float  # m, largest distance of a foot from the base origin
    law: Law


class Balls(NamedTuple):
    """What of the vehicle surfaces push at: the tip of the tool first; there is room for 128."""

    number: int
    body: Array  # (128,) which one each is on
    place: Array  # (128, 3) m, of its centre, in the body's frame
    radius: Array  # (128,) m
    reach: float  # m, from the base origin to the farthest place of any


class Surfaces(NamedTuple):
    """What can be touched, an entry a surface; there is room for eight.

    Place, velocity and time are written before every exchange, the rest by the kernels.
    """

    number: int  # 0: nothing can be touched
    finer: int  # steps into which a step of the plant is divided where something is touched
    kind: Array  # (8,) of sitl.shapes
    numbers: Array  # (8, 16), where each is at the beginning of the exchange
    velocity: Array  # (8, 3) m/s, NED
    stiffness: Array  # (8,) N/m
    dissipation: Array  # (8,) s/m
    friction: Array  # (8,)
    clock: Array  # (2,) s, of the beginning of the exchange, and passed since
    force: Array  # (8, 3) N, NED, on the tip
    outward: Array  # (8, 3) [1], NED, the normal there
    normal: Array  # (8,) N, part of it along the normal
    depth: Array  # (8,) m, of the tip
    slip: Array  # (8,) m/s, of the tip along the surface
    force_max: Array  # (8,) N, largest normal force so far
    when_s: Array  # (8,) s, when that was
    touching: Array  # (8,) 1 where the tip does now
    contacts: Array  # (8,) how often it began to
    contact_s: Array  # (8,) s, for how long
    path: Array  # (8,) m, along which it slipped


@kernel
def contact_force(law: Law, depth: float, n: V3, v: V3) -> V3:
    """Force [N] on a body that is a ``depth`` [m] below a surface, and moves against it.

    The outward normal is n [1, any frame], the velocity v [m/s, same frame], as the force is.
    """
    along = dot(n, v)
    normal = max(law.stiffness * depth * (1.0 - law.dissipation * along), 0.0)
    across = sub(v, scale(along, n))
    slip = np.sqrt(dot(across, across) + law.slip_rate * law.slip_rate)
    return add(scale(normal, n), scale(-law.friction * normal / slip, across))


@kernel
def ground_wrench(feet: Feet, p: V3, v: V3, w: V3, rotation: Array) -> tuple[V3, V3]:
    """Force [N, B] and moment about the base origin [N·m, B] of all feet on the ground plane z = 0.

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
            f = transposed_times(rotation, contact_force(feet.law, depth, _UP, v_foot))
            force = add(force, f)
            moment = add(moment, cross(foot, f))
    return force, moment


@compilable
def surface_law(surfaces: Surfaces, s: int) -> Law:
    """The law of surface ``s``."""
    return Law(surfaces.stiffness[s], surfaces.dissipation[s], surfaces.friction[s], SLIP_RATE)


@compilable
def gap_of(surfaces: Surfaces, s: int, p: V3) -> tuple[float, V3]:
    """Distance [m] of a place p [m, NED] to surface ``s``, and the outward normal [1, NED]."""
    moved = scale(surfaces.clock[1], row(surfaces.velocity, s))
    at = nearest(int(surfaces.kind[s]), surfaces.numbers[s], sub(p, moved))
    return at.distance, (at.nx, at.ny, at.nz)


@compilable
def is_near(surfaces: Surfaces, p: V3, room: float) -> bool:
    """Whether a place p [m, NED] is within ``room`` [m] of any surface, or is no number."""
    near = False
    for s in range(surfaces.number):
        near = near or not gap_of(surfaces, s, p)[0] > room
    return near


@compilable
def steps_within(
    balls: Balls, surfaces: Surfaces, at: Posture, rotation: Array, p: V3, step: float
) -> int:
    """Into how many steps one of ``step`` [s] is divided: into more where the tip may touch.

    The base origin is at p [m, NED] and its bodies are placed, R_WB is in rotation (3, 3) [1].
    """
    body = int(balls.body[TIP])
    centre = add(row(at.origin, body), times_one(at.axes, body, row(balls.place, TIP)))
    tip = add(p, times(rotation, centre))
    return int(surfaces.finer) if is_near(surfaces, tip, balls.radius[TIP] + FASTEST * step) else 1


@compilable
def touch_into(
    chain: Chain,
    balls: Balls,
    surfaces: Surfaces,
    at: Posture,
    rotation: Array,
    state: Array,
    angles: int,
    load: Array,
) -> None:
    """Add the generalised force of all surfaces to load (6 + j,) [SI].

    At a state (n,) [SI] with the first joint's angle in entry ``angles``, whose bodies are placed
    and whose R_WB is in rotation (3, 3) [1].
    """
    for s in range(surfaces.number):
        put_row(surfaces.force, s, (0.0, 0.0, 0.0))
        surfaces.normal[s] = surfaces.depth[s] = surfaces.slip[s] = 0.0
    p = triple(state, P_WB)
    if not is_near(surfaces, p, balls.reach):
        return
    v, w, rates = triple(state, V_WB), triple(state, W_WB_B), angles + chain.joints
    for b in range(balls.number):
        body = int(balls.body[b])
        centre = add(row(at.origin, body), times_one(at.axes, body, row(balls.place, b)))
        place = add(p, times(rotation, centre))
        for s in range(surfaces.number):
            distance, n = gap_of(surfaces, s, place)
            depth = balls.radius[b] - distance
            if not depth > 0.0:
                continue
            # Where it touches, or as near to that as the surface was before it gave way.
            lever = sub(centre, scale(distance, transposed_times(rotation, n)))
            turning = cross(w, lever)
            for i in range(1, body + 1):
                z = column(at.axes, i, 2)
                arm = cross(z, sub(lever, row(at.origin, i)))
                turning = add(turning, scale(state[rates + i - 1], arm))
            moving = sub(add(v, times(rotation, turning)), row(surfaces.velocity, s))
            f = contact_force(surface_law(surfaces, s), depth, n, moving)
            force = transposed_times(rotation, f)
            moment = cross(lever, force)
            for k in range(3):
                load[k] += force[k]
                load[3 + k] += moment[k]
            for i in range(1, body + 1):
                arm = cross(column(at.axes, i, 2), sub(lever, row(at.origin, i)))
                load[5 + i] += dot(arm, force)
            if b == TIP:
                across = sub(moving, scale(dot(n, moving), n))
                put_row(surfaces.force, s, f)
                put_row(surfaces.outward, s, n)
                surfaces.normal[s] = dot(n, f)
                surfaces.depth[s] = depth
                surfaces.slip[s] = np.sqrt(dot(across, across))


@compilable
def pass_stage(surfaces: Surfaces, stage: int, step: float, until: float) -> None:
    """After a stage of Runge and Kutta: let time pass ``until`` [s] that of the next.

    The first one begins a ``step`` [s], for which what it has found is counted.
    """
    now_s = surfaces.clock[0] + surfaces.clock[1]
    surfaces.clock[1] = until
    for s in range(surfaces.number if stage == 0 else 0):
        normal = surfaces.normal[s]
        if normal > surfaces.force_max[s]:
            surfaces.force_max[s] = normal
            surfaces.when_s[s] = now_s
        touching = 1.0 if surfaces.depth[s] > 0.0 else 0.0
        surfaces.contacts[s] += max(touching - surfaces.touching[s], 0.0)
        surfaces.touching[s] = touching
        surfaces.contact_s[s] += touching * step
        surfaces.path[s] += touching * step * surfaces.slip[s]
