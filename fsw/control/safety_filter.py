r"""The last line before a zone: the acceleration that the loops are about to realise, each tick.

The planner keeps the plan off the zones, by more than the loop can be pushed off the plan. Where
that fails, for whatever reason, the measured vehicle comes close too fast. With the distance d of a
part to a zone, the zone's normal n and the relative velocity v, moved on by the time :math:`\tau`
that the loop takes to realise an acceleration,

.. math:: h = S(d) + n\cdot v, \qquad
          n\cdot a \ge -\gamma\,h - S'(d)\,n\cdot v + d_r =: b

keeps h from falling faster than :math:`-\gamma h`, with :math:`d_r` left for what is not measured
of the disturbance. An acceleration that is less is brought to b along n: the nearest one that
keeps the condition, in closed form; several zones are satisfied one after the other, a few times.

Parts on the base are taken to move as its origin does. Parts on the arm count for the margin that
is reported and not for the acceleration: to push a swinging arm off by the base would first swing
it on, and the arm compensates by itself.

The planner's own bound is :math:`h \ge \lambda`; this law has none, so in flights that go as
planned it changes no bit. Its command can be no more than the loops stand.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fsw.barriers.safe_approach import BarrierTuning, safe_approach_slope, safe_approach_speed
from fsw.compiled import compilable
from fsw.geometry.rotation import rotate, rotate_back
from fsw.geometry.vectors import add_scaled, clamp, dot, subtract
from fsw.model.body import ON_LINK2, Body
from fsw.model.kinematics import links
from fsw.shapes.kind import NUMBERS
from fsw.shapes.zones import FIRST, FOLLOWS, surface_at, zone_arrays
from fsw.signals import EndEffectorTarget, SafeSet, StateEstimate, Vec2, Vec3

_PASSES = 4  # over all zones
_DISC_STEPS = 5  # from a disc to a zone and back
_MOVE = FIRST + NUMBERS  # columns of a zone's movement: velocity, where it is at a time, that time
_COLUMNS = _MOVE + 7
_ON, _Z, _RADIUS, _RIM = 0, 3, 4, 5  # columns of a part
_MOST_PARTS = 12
_NO_PART = (0.0,) * 6

NO_ZONES: NDArray[np.float64] = np.zeros((0, _COLUMNS))


@dataclass(frozen=True, slots=True)
class FilterTuning:
    """The barrier condition, for zones and for the sphere that follows the target."""

    gamma: float = 3.0  # 1/s
    # m/s^2, d_r. In workspace the loops fall short of the condition by 0.2 against the assumed
    # disturbance; in walls and branches 0.4 is left. What they do by themselves is left alone.
    allowance: float = -1.0
    near: float = 0.6  # m from the base; what is farther off is left out
    vertical: float = 3.0  # m/s^2, at most
    enabled: int = 1  # 0: the loops' own acceleration is realised


@dataclass(frozen=True, slots=True)
class FilterLaw:
    """Everything the law needs that does not change in flight."""

    tuning: FilterTuning
    kept: Vec2  # alpha [m/s^2] and k_S [1/s] of zones
    following: Vec2  # of the sphere that follows the target
    links: Vec2  # m
    lag: float  # s, tau
    level: float  # m/s^2, at most, an axis
    # Spheres and discs of the body: what each is on, its place there [m], radius and rim [m]. As
    # many rows for every body: of two layouts in one process the second is read wrongly.
    parts: tuple[tuple[float, ...], ...]
    count: int  # of the rows, that are parts


def filter_law(
    tuning: FilterTuning,
    barriers: tuple[BarrierTuning, BarrierTuning],
    body: Body,
    links: Vec2,
    lag: float,
    level: float,
) -> FilterLaw:
    """The law of a body, of which capsules are left to the spheres at their ends.

    Its ``links`` [m] are known; the loop takes ``lag`` [s] and stands ``level`` [m/s^2].
    """
    kept, following = barriers
    parts = tuple(
        (float(part.on), *part.begin, part.radius, part.rim)
        for part in body.parts
        if part.end is None
    )
    return FilterLaw(
        tuning=tuning,
        kept=(kept.alpha, kept.slope),
        following=(following.alpha, following.slope),
        links=links,
        lag=lag,
        level=level,
        parts=parts + (_NO_PART,) * (_MOST_PARTS - len(parts)),
        count=len(parts),
    )


def moving_zones(safe_set: SafeSet, target: EndEffectorTarget | None) -> NDArray[np.float64]:
    """The zones and how they move, (zones, columns) [SI]; of no target, without what follows it."""
    if not safe_set.zones:
        return NO_ZONES
    rows = np.zeros((len(safe_set.zones), _COLUMNS))
    rows[:, :_MOVE] = zone_arrays(safe_set)
    for row, zone in zip(rows, safe_set.zones, strict=True):
        row[_MOVE : _MOVE + 3], row[_MOVE + 6] = zone.velocity, zone.t_us
        if row[FOLLOWS] > 0.0 and target is not None:
            row[_MOVE : _MOVE + 3], row[_MOVE + 3 : _MOVE + 6] = target.v_WE, target.p_WE
            row[_MOVE + 6] = target.t_us
    return rows if target is not None else rows[rows[:, FOLLOWS] == 0.0]


@compilable
def filtered(
    law: FilterLaw,
    zones: NDArray[np.float64],
    estimate: StateEstimate,
    v: Vec3,
    a: Vec3,
    wanted: Vec3,
) -> tuple[Vec3, bool, float]:
    """The acceleration nearest to the ``wanted`` [m/s^2, NED] one that keeps the condition.

    ``zones`` (zones, k) [SI] are those of ``moving_zones``, ``v`` [m/s, NED] and ``a`` [m/s^2, NED]
    the body's own now, disturbance included. Also says whether the wanted one was changed, and the
    least margin [m] of all parts, infinite where no zone is near.
    """
    changed, margin = False, math.inf
    for _ in range(_PASSES):
        again = False
        for k in range(zones.shape[0]):
            zone = zones[k]
            elapsed = 1e-6 * (estimate.t_us - zone[_MOVE + 6])
            drift = (zone[_MOVE], zone[_MOVE + 1], zone[_MOVE + 2])
            shift = (
                zone[_MOVE + 3] + elapsed * drift[0],
                zone[_MOVE + 4] + elapsed * drift[1],
                zone[_MOVE + 5] + elapsed * drift[2],
            )
            x, y, z = subtract(estimate.p_WB, shift)
            if surface_at(zones, k, 0, x, y, z).distance > law.tuning.near:
                continue
            follows = zone[FOLLOWS] > 0.0
            for j in range(1 if follows else law.count):
                n, least, distance = _condition(
                    law, zones, k, j, follows, shift, drift, estimate, v, a
                )
                margin = min(margin, distance)
                lacking = least - dot(n, wanted)
                if lacking > 0.0:
                    wanted = _within(law, add_scaled(wanted, n, lacking))
                    again = changed = True
        if not again:
            break
    return wanted, changed, margin


@compilable
def _within(law: FilterLaw, a: Vec3) -> Vec3:
    level, vertical = law.level, law.tuning.vertical
    return (
        clamp(a[0], -level, level),
        clamp(a[1], -level, level),
        clamp(a[2], -vertical, vertical),
    )


@compilable
def _condition(
    law: FilterLaw,
    zones: NDArray[np.float64],
    zone: int,
    part: int,
    follows: bool,
    shift: Vec3,
    drift: Vec3,
    estimate: StateEstimate,
    v: Vec3,
    a: Vec3,
) -> tuple[Vec3, float, float]:
    """The normal of a zone at a part of the body, the least acceleration along it, the margin.

    In m/s^2 and m.
    """
    p, radius = estimate.p_WB, 0.0
    alpha, slope = law.kept[0], law.kept[1]
    if follows:
        alpha, slope = law.following[0], law.following[1]
    else:
        p = add_scaled(p, _place(law, part, estimate), 1.0)
        radius = law.parts[part][_RADIUS]
        if law.parts[part][_RIM] > 0.0:
            p = _nearest_of_disc(law, zones, zone, part, shift, estimate, p)
    x, y, z = subtract(p, shift)
    at = surface_at(zones, zone, 0, x, y, z)
    n = (at.nx, at.ny, at.nz)
    distance = at.distance - radius
    tau = law.lag
    approach, along = dot(n, subtract(v, drift)), dot(n, a)
    ahead = distance + tau * (approach + 0.5 * tau * along)
    rate_ahead = approach + tau * along
    h = safe_approach_speed(ahead, alpha, slope) + rate_ahead
    steepness = safe_approach_slope(ahead, alpha, slope)
    if not follows and law.parts[part][_ON] > 0.0:
        return n, -math.inf, distance
    least = law.tuning.allowance - law.tuning.gamma * h - steepness * rate_ahead
    return n, least, distance


@compilable
def _nearest_of_disc(
    law: FilterLaw,
    zones: NDArray[np.float64],
    zone: int,
    part: int,
    shift: Vec3,
    estimate: StateEstimate,
    centre: Vec3,
) -> Vec3:
    """The place of a disc nearest to a zone [m, NED], by projecting from one to the other."""
    p, numbers, R = centre, law.parts[part], estimate.R_WB
    for _ in range(_DISC_STEPS):
        x, y, z = subtract(p, shift)
        at = surface_at(zones, zone, 0, x, y, z)
        step = max(at.distance, 0.05)
        aim = add_scaled(p, (at.nx, at.ny, at.nz), -step)
        ax, ay, _ = rotate_back(R, subtract(aim, centre))
        length = math.sqrt(ax * ax + ay * ay)
        if length > numbers[_RIM]:
            ax, ay = numbers[_RIM] / length * ax, numbers[_RIM] / length * ay
        p = add_scaled(centre, rotate(R, (ax, ay, 0.0)), 1.0)
    return p


@compilable
def _place(law: FilterLaw, part: int, estimate: StateEstimate) -> Vec3:
    """Where a part is from the body's origin [m, NED]."""
    numbers = law.parts[part]
    on = numbers[_ON]
    x, y, z = numbers[1], numbers[2], numbers[_Z]
    if on > 0.0:
        # On a link the place is (0, 0, distance from its joint).
        lengths = (numbers[_Z], 0.0) if on < ON_LINK2 else (law.links[0], numbers[_Z])
        th1 = estimate.q_arm[0]
        (x1, z1), (x2, z2) = links(lengths, th1, th1 + estimate.q_arm[1])
        x, y, z = x1 + x2, 0.0, z1 + z2
    return rotate(estimate.R_WB, (x, y, z))
