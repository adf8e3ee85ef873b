r"""The last line before a zone: the acceleration that the loops are about to realise, each tick.

The planner keeps the plan off the zones, by more than the loop can be pushed off the plan. Where
that fails, for whatever reason, the measured vehicle comes close too fast. With the distance d of a
part to a zone, the zone's normal n and the relative velocity v, moved on by the time :math:`\tau`
that the loop takes to realise an acceleration,

.. math:: h = S(d) + n\cdot v, \qquad
          n\cdot a \ge -\gamma\,h - S'(d)\,n\cdot v + d_r =: b

keeps h from falling faster than :math:`-\gamma h`, with :math:`d_r` left for what is not measured
of the disturbance; a, like v, is relative to the zone. An acceleration that is less is brought to b
along n: the nearest one that keeps the condition, in closed form; several zones are satisfied one
after the other, a few times.

Each part counts where it is nearest to the zone (``fsw.autopilot.barriers.nearest_place``). Parts
on the base are taken to move as its origin does. Parts on the arm count for the margin that is
reported and not for the acceleration: to push a swinging arm off by the base would first swing it
on, and the arm compensates by itself.

The zones are those that are kept: clearances have grown by what the estimate is not sure of. The
margin is that of the safe set in force.

It has a room and a speed. From a zone deeper than ``ROOM`` no way leads out that is known to be
right: it pushes nobody. And nothing is pushed faster than the law's ``speed``, by however many
zones: what the vehicle moves at across a normal leaves less along it.

The planner's own bound is :math:`h \ge \lambda`; this law has none, so in flights that go as
planned it changes no bit. Its command can be no more than the loops stand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fsw.autopilot.barriers.nearest_place import nearest_place
from fsw.autopilot.barriers.safe_approach import (
    BarrierTuning,
    safe_approach_slope,
    safe_approach_speed,
)
from fsw.autopilot.geometry.vectors import Vector, add_scaled, clamp, dot, subtract
from fsw.autopilot.model.body import CAPSULE, FORM, ON, RADIUS, TOOL, TURN, Body
from fsw.autopilot.model.kinematics import FRAME, put_base, put_links
from fsw.autopilot.model.multibody import Bodies
from fsw.autopilot.model.parts import ON_BASE
from fsw.autopilot.shapes.zones import (
    ADDED,
    FLAT,
    FOLLOWS,
    FORCE_MAX,
    KEEP_IN,
    PLANES,
    Zones,
    acceleration_of,
    moved_by,
    surface_at,
    velocity_of,
)
from fsw.autopilot.signals import Vec2, Vec3
from fsw.autopilot.tick_record import AnyEstimate
from fsw.compiled import compilable

ROOM = 1.0  # m, that a vehicle may be outside of a zone and still draws back from it
_PASSES = 4  # over all zones


@dataclass(frozen=True, slots=True)
class FilterTuning:
    """The barrier condition, for zones and for the sphere that follows the target."""

    gamma: float = 3.0  # 1/s
    # m/s^2, d_r. In workspace the loops fall short of the condition by 0.2 against the assumed
    # disturbance; in walls and branches 0.4 is left. What they do by themselves is left alone.
    allowance: float = -1.0
    near: float = 0.3  # m beyond the vehicle's own reach; what is farther off is left out
    vertical: float = 3.0  # m/s^2, at most
    enabled: int = 1  # 0: the loops' own acceleration is realised


@dataclass(frozen=True, slots=True)
class FilterLaw:
    """Everything the law needs that does not change in flight, but the body's probes."""

    tuning: FilterTuning
    kept: Vec2  # alpha [m/s^2] and k_S [1/s] of zones
    following: Vec2  # of the sphere that follows the target
    near: float  # m from the base; zones that are farther off are left out
    lag: float  # s, tau
    level: float  # m/s^2, at most, an axis
    speed: float  # m/s, at most


def filter_law(
    tuning: FilterTuning,
    barriers: tuple[BarrierTuning, BarrierTuning],
    reach: float,
    lag: float,
    level: float,
    speed: float = math.inf,
) -> FilterLaw:
    """The law for a loop that takes ``lag`` [s] and stands ``level`` [m/s^2].

    No place of the vehicle is farther from the base than ``reach`` [m]. The law pushes up to a
    ``speed`` [m/s].
    """
    kept, following = barriers
    return FilterLaw(
        tuning=tuning,
        near=reach + tuning.near,
        kept=(kept.alpha, kept.slope),
        following=(following.alpha, following.slope),
        lag=lag,
        level=level,
        speed=speed,
    )


class FilterProbes(NamedTuple):
    """What the filter keeps off zones."""

    rows: NDArray[np.float64]  # (probes, 12) of a body; a disc has one, where it is nearest
    frame: NDArray[np.float64]  # (FRAME,) to work in


def filter_probes(body: Body) -> FilterProbes:
    """The probes of a body."""
    probes = body.probes
    return FilterProbes(probes[probes[:, TURN] == 0.0], np.zeros(FRAME))


@compilable
def filtered(
    law: FilterLaw,
    bodies: Bodies,
    probes: FilterProbes,
    zones: Zones,
    estimate: AnyEstimate,
    v: Vector,
    a: Vec3,
    wanted: Vec3,
) -> tuple[Vec3, bool, float]:
    """The acceleration nearest to the ``wanted`` [m/s^2, NED] one that keeps the condition.

    ``zones`` are those of ``moving_zones``, ``v`` [m/s, NED] and ``a`` [m/s^2, NED] the body's own
    now, disturbance included. Also says whether the wanted one was changed, and the least margin
    [m] of all parts, infinite where no zone is near.
    """
    put_base(probes.frame, estimate.p_WB, estimate.v_WB, estimate.R_WB, estimate.w_WB_B)
    put_links(probes.frame, bodies, estimate.q_arm, estimate.qd_arm)
    changed, margin = False, math.inf
    for _ in range(_PASSES):
        again = False
        for k in range(zones.shape[0]):
            shift = moved_by(zones, k, estimate.t_us)
            x, y, z = subtract(estimate.p_WB, shift)
            for which in range(int(zones[k, PLANES])):
                if surface_at(zones, k, which, x, y, z).distance <= law.near:
                    wanted, lacked, least = _kept_off(
                        law, probes, zones, k, which, shift, estimate.t_us, v, a, wanted
                    )
                    again, margin = again or lacked, min(margin, least)
        changed = changed or again
        if not again:
            break
    return wanted, changed, margin


@compilable
def _kept_off(
    law: FilterLaw,
    all_probes: FilterProbes,
    zones: Zones,
    zone: int,
    which: int,
    shift: Vec3,
    t_us: int,
    v: Vector,
    a: Vec3,
    wanted: Vec3,
) -> tuple[Vec3, bool, float]:
    """``filtered`` for one plane of one zone, once."""
    probes, frame = all_probes
    relative = subtract(v, velocity_of(zones, zone, t_us))
    acceleration, follows = acceleration_of(zones, zone), zones[zone, FOLLOWS] > 0.0
    lacked, margin = False, math.inf
    ends_do = zones[zone, FLAT] > 0.0 or zones[zone, KEEP_IN] > 0.0  # which are spheres
    for j in range(1 if follows else probes.shape[0]):
        if ends_do and probes[j, FORM] == CAPSULE:
            continue
        if zones[zone, FORCE_MAX] > 0.0 and probes[j, TOOL] > 0.0:
            continue  # the tool may touch it
        _, at, _ = nearest_place(zones, zone, which, shift, probes, j, frame)
        n, distance = (at.nx, at.ny, at.nz), at.distance
        if not follows:
            distance -= probes[j, RADIUS]
        margin = min(margin, distance + zones[zone, ADDED])
        if probes[j, ON] == ON_BASE and distance + zones[zone, ADDED] > -ROOM:
            along, away = dot(n, a), dot(n, acceleration)
            needed = away + _needed(law, follows, distance, dot(n, relative), along - away)
            lacking = min(needed, _fastest(law, n, v, along)) - dot(n, wanted)
            if lacking > 0.0:
                wanted, lacked = _within(law, add_scaled(wanted, n, lacking)), True
    return wanted, lacked, margin


@compilable
def _within(law: FilterLaw, a: Vec3) -> Vec3:
    level, vertical = law.level, law.tuning.vertical
    return (
        clamp(a[0], -level, level),
        clamp(a[1], -level, level),
        clamp(a[2], -vertical, vertical),
    )


@compilable
def _fastest(law: FilterLaw, n: Vec3, v: Vector, along: float) -> float:
    """The acceleration [m/s^2] along ``n`` that brings ``v`` [m/s, NED] to the most, ``along`` now.

    What it moves at across ``n`` leaves less of that.
    """
    speed = dot(n, v)
    across = dot(v, v) - speed * speed
    most = math.sqrt(max(law.speed * law.speed - across, 0.0))
    return law.tuning.gamma * (most - speed - law.lag * along)


@compilable
def _needed(law: FilterLaw, follows: bool, distance: float, approach: float, along: float) -> float:
    """b, the least acceleration along a normal [m/s^2].

    At a ``distance`` [m] that changes by ``approach`` [m/s], accelerated by ``along`` [m/s^2].
    """
    alpha, slope = law.kept[0], law.kept[1]
    if follows:
        alpha, slope = law.following[0], law.following[1]
    tau = law.lag
    ahead = distance + tau * (approach + 0.5 * tau * along)
    rate_ahead = approach + tau * along
    h = safe_approach_speed(ahead, alpha, slope) + rate_ahead
    steepness = safe_approach_slope(ahead, alpha, slope)
    return law.tuning.allowance - law.tuning.gamma * h - steepness * rate_ahead
