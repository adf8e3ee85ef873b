r"""Every zone of a safe set against every probe of the body, at every node: written once.

A zone is a shape to keep out of or in. Near a probe it is a plane with the unit normal n into the
free side (``fsw.shapes``), frozen at the guess, node by node: outside a convex shape the half-space
in front of its tangent plane lies outside the shape, wherever the optimum goes. With the distance d
of the probe's surface to it and w the zone's velocity, the paper's barriers are all

.. math:: h = S(d) + n\cdot(v - w)

(eqs 11, 22 and 23); MPC-HC (eqs 14, 15) takes d itself. Rows of one zone at one node share a slack.

A row that cannot bind, whatever the inputs are, is left out exactly: over the horizon no place of
the vehicle can go farther than its speed and the limits on the inputs allow.

Source: docs/equations.md E10, E11, E14, E15, E22, E23.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from fsw.barriers.cbf_row import barrier_value, cbf_lower_bound
from fsw.barriers.constraint_block import Rows, TargetPoints, block
from fsw.barriers.safe_approach import BarrierNumbers, BarrierTuning, safe_approach_slope
from fsw.compiled import compiled, of_fixed_types
from fsw.geometry.vectors import add_scaled, dot
from fsw.model.body import BEGIN, CAPSULE, DISC, END, FORM, ON, PART, RADIUS, RIM, TURN, Body
from fsw.model.linearisation import (
    Horizon,
    Linearisation,
    chain,
    fill_slopes,
    in_axes,
    position,
    velocity,
)
from fsw.model.prediction import (
    INPUTS,
    QD_ARM,
    STATES,
    YAW_RATE,
    Array,
    CondensedModel,
    J,
)
from fsw.shapes.kind import Surface
from fsw.shapes.zones import FLAT, FOLLOWS, PLANES, shifts, surface_at, zone_arrays
from fsw.signals import SafeSet, Vec3, Vec4

_NEAREST_STEPS = 6  # alternating projections between a part and a zone
_STILL = 1e-4  # m, a step that is none
_AXIAL = 0.7  # cosine between a disc's axis and a normal from which all of its rim counts
_NO_ROW = 1e3  # residual of a row that is left out
_LEVER = 0.6  # m, no place of the vehicle is farther from the base
_LEAST_THRUST = 6.0  # m/s^2, specific, within the limits of the inputs


class Tunings(NamedTuple):
    """Of the zones to keep off, and of the sphere that follows the target."""

    kept: BarrierNumbers
    following: BarrierNumbers


class ZoneRows:
    """Rows for zones x probes x planes x nodes, one slack a node and zone."""

    def __init__(
        self,
        safe_set: SafeSet,
        body: Body,
        model: CondensedModel,
        tunings: tuple[BarrierTuning, BarrierTuning],
        *,
        distances: bool = False,
        tightening: float = 0.0,
        skipped_nodes: int | None = None,
        most: Vec4 = (math.inf, 0.0, 0.0, 0.0),
    ) -> None:
        """Lay out the rows of a safe set, to be refilled.

        The first of ``tunings`` is for all zones but those that follow the target. With
        ``distances`` the rows require a distance of ``tightening`` [m] in place of a barrier.
        ``most`` bounds the inputs: horizontal and vertical [m/s^2], yaw and joints [rad/s^2]; by
        default no row is left out.
        """
        self._probes = body.probes
        self._tunings = Tunings(*(tuning.numbers(model.period) for tuning in tunings))
        self._distances, self._tightening = distances, tightening
        self._period_us, self._most = round(1e6 * model.period), most
        self.update(safe_set)
        following = self._zones[:, FOLLOWS] > 0.0
        per_zone = self._zones[:, PLANES] * np.where(following, 1, len(self._probes))
        skipped = tunings[0].skipped_nodes if skipped_nodes is None else skipped_nodes
        self._first = 1 + skipped
        parts = len(body.parts)
        starts = sum(1 if follows else parts for follows in following)
        self.rows = block(tuple(per_zone.astype(int).tolist()), self._first, model.horizon, starts)
        self._rows, self._fill = self.rows.rows, of_fixed_types(_fill)

    def update(self, safe_set: SafeSet) -> None:
        """See ``fsw.barriers.constraint_block.Barrier``."""
        self._safe_set, self._zones = safe_set, zone_arrays(safe_set)
        self._targets: TargetPoints | None = None

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise every row along the normals of the guess."""
        if targets is not self._targets:  # one request has many iterations
            times_us = targets.t_us + self._period_us * np.arange(len(targets.position))
            self._moves = shifts(self._safe_set, times_us, targets.position, targets.velocity)
            self._targets = targets
        self._fill(
            self._zones,
            self._moves,
            self._probes,
            horizon.horizon,
            self._tunings,
            (self._distances, self._tightening, self._first),
            self._most,
            self._rows,
        )


def layout(safe_set: SafeSet) -> tuple[tuple[str, bool], ...]:
    """What of a safe set decides how many rows there are; the rest is numbers."""
    return tuple((zone.shape.kind, zone.keep_in) for zone in safe_set.zones)


@compiled
def _fill(
    zones: Array,
    moves: tuple[Array, Array],
    probes: Array,
    horizon: Horizon,
    tunings: Tunings,
    how: tuple[bool, float, int],
    most: Vec4,
    rows: Rows,
) -> None:
    """All rows; ``moves`` are shift and velocity of the zones at the nodes (n + 1, zones, 3)."""
    distances, tightening, first = how
    frames, impulse, (shifts, speeds) = horizon.frames, horizon.impulse, moves
    gradients, values, least_values = rows.gradient, rows.value, rows.lower_bound
    slopes = np.zeros((2, STATES))
    start = frames[0]
    fill_starts(zones, shifts[0], speeds[0], probes, start, tunings, distances, rows.start)
    row = 0
    for i in range(first, len(frames)):
        frame, shift, speed = frames[i], shifts[i], speeds[i]
        reach = _reach(horizon, i, most)
        for k in range(len(zones)):
            follows = zones[k, FOLLOWS] > 0.0
            tuning = tunings.following if follows else tunings.kept
            speed_at_start = (speeds[0, k, 0], speeds[0, k, 1], speeds[0, k, 2])
            moved = (
                shift[k, 0] - shifts[0, k, 0],
                shift[k, 1] - shifts[0, k, 1],
                shift[k, 2] - shifts[0, k, 2],
            )
            for b in range(1 if follows else len(probes)):
                radius, on = 0.0 if follows else probes[b, RADIUS], int(probes[b, ON])
                for which in range(int(zones[k, PLANES])):
                    local, at, binds = nearest_place(zones, k, which, shift, probes, b, frame)
                    n, d = (at.nx, at.ny, at.nz), at.distance - radius
                    value, least, steepness = d, tightening, 1.0
                    if binds and not distances:
                        p, p0 = position(frame, on, local), position(start, on, local)
                        # The plane of the node, where the zone was at node 0, and the probe then.
                        d0 = d + dot(n, p0) - dot(n, p) + dot(n, moved)
                        rate0 = dot(n, velocity(start, on, local)) - dot(n, speed_at_start)
                        rate = dot(n, velocity(frame, on, local))
                        rate -= n[0] * speed[k, 0] + n[1] * speed[k, 1] + n[2] * speed[k, 2]
                        value = barrier_value(d, rate, tuning)
                        least = cbf_lower_bound(barrier_value(d0, rate0, tuning), i, tuning)
                        steepness = safe_approach_slope(d, tuning.alpha, tuning.slope)
                        binds = value - least < steepness * reach[0] + reach[1]
                    elif binds:
                        binds = value - least < reach[0]
                    if binds:
                        fill_slopes(frame, on, local, n, slopes)
                        if distances:
                            chain(impulse, i, slopes[0], gradients[row])
                        else:
                            for s in range(STATES):
                                slopes[1, s] += steepness * slopes[0, s]
                            chain(impulse, i, slopes[1], gradients[row])
                        values[row], least_values[row] = value, least
                    else:
                        gradients[row] = 0.0
                        values[row], least_values[row] = _NO_ROW, 0.0
                    row += 1


@compiled
def _reach(horizon: Horizon, node: int, most: Vec4) -> tuple[float, float]:
    """How far [m] and how much faster [m/s] any place can be at a node than at the guess.

    A bound for all inputs within their limits, ``most``: horizontal, vertical, yaw, joints. A
    place swings about the base by the tilt that a change of acceleration takes, by yaw and joints.
    """
    far = fast = up = up_fast = 0.0
    tilt = tilt_rate = turn = turn_rate = swing = swing_rate = 0.0
    for step in range(node):
        g, u = horizon.impulse[node - 1 - step], horizon.inputs[INPUTS * step : INPUTS * (step + 1)]
        level = most[0] + math.sqrt(u[0] * u[0] + u[1] * u[1])
        vertical = most[1] + abs(u[2])
        far, fast = far + abs(g[0]) * level, fast + abs(g[1]) * level
        up, up_fast = up + abs(g[4]) * vertical, up_fast + abs(g[5]) * vertical
        tilt, tilt_rate = tilt + abs(g[2]) * level, tilt_rate + abs(g[3]) * level
        turn, turn_rate = (
            turn + abs(g[7]) * (most[2] + abs(u[3])),
            turn_rate + abs(g[8]) * (most[2] + abs(u[3])),
        )
        joint = 2.0 * most[3] + abs(u[4]) + abs(u[5])
        swing, swing_rate = swing + abs(g[9]) * joint, swing_rate + abs(g[10]) * joint
    state = horizon.states[node]
    jerk = math.sqrt(state[J] * state[J] + state[J + 1] * state[J + 1])
    rates = abs(state[QD_ARM]) + abs(state[QD_ARM + 1])
    # Linearised, a place turns about the base as much as it does for a small turn.
    angle = tilt / _LEAST_THRUST + turn
    rate = tilt_rate / _LEAST_THRUST + turn_rate
    rate += angle * (jerk / _LEAST_THRUST + abs(state[YAW_RATE]) + rates)
    rate_of_arm = swing_rate + swing * (rates + jerk / _LEAST_THRUST + abs(state[YAW_RATE]))
    return (
        math.sqrt(far * far + up * up) + angle * _LEVER + swing * _LEVER,
        math.sqrt(fast * fast + up_fast * up_fast) + rate * _LEVER + rate_of_arm * _LEVER,
    )


@compiled
def fill_starts(
    zones: Array,
    shift: Array,
    speed: Array,
    probes: Array,
    frame: Array,
    tunings: Tunings,
    distances: bool,
    starts: Array,
) -> None:
    """The least value of each zone and part at one instant: h [m/s], or the distance [m].

    ``zones`` and ``probes`` are rows of numbers [SI], ``frame`` (FRAME,) [SI] is the vehicle;
    ``shift`` (zones, 3) [m, NED] and ``speed`` (zones, 3) [m/s, NED] those of the zones. Into
    ``starts`` (zones x parts,), zone by zone; a zone that follows the target has one entry.
    """
    starts[:] = math.inf
    first = 0
    for k in range(len(zones)):
        follows = zones[k, FOLLOWS] > 0.0
        tuning = tunings.following if follows else tunings.kept
        tried = 1 if follows else len(probes)
        # Of the sphere the paper's pair h2a and h2b: towards the nearest place, and away from it.
        planes = 2 if follows else int(zones[k, PLANES])
        for b in range(tried):
            at_part = first + int(probes[b, PART])
            for which in range(planes):
                local, at, _ = nearest_place(zones, k, which, shift, probes, b, frame)
                value = at.distance - (0.0 if follows else probes[b, RADIUS])
                if not distances:
                    n, v = (at.nx, at.ny, at.nz), velocity(frame, int(probes[b, ON]), local)
                    rate = dot(n, v) - n[0] * speed[k, 0] - n[1] * speed[k, 1] - n[2] * speed[k, 2]
                    value = barrier_value(value, rate, tuning)
                starts[at_part] = min(starts[at_part], value)
        first += int(probes[tried - 1, PART]) + 1


@compiled
def nearest_place(
    zones: Array, zone: int, which: int, shift: Array, probes: Array, probe: int, frame: Array
) -> tuple[Vec3, Surface, bool]:
    """The place of a probe that counts against a plane of a zone, and that plane.

    ``zones``, ``probes`` and ``frame`` [SI] are as in ``fill_starts``, the zones moved by ``shift``
    (zones, 3) [m, NED]; ``which`` [1] of the planes. The place is given where it is on its part
    [m]. False: this probe says nothing that another does not say.
    """
    form = probes[probe, FORM]
    if form == CAPSULE:
        return _nearest_on_capsule(zones, zone, which, shift, probes[probe], frame)
    if form == DISC:
        return _nearest_on_disc(zones, zone, which, shift, probes[probe], frame)
    begin = (probes[probe, BEGIN], probes[probe, BEGIN + 1], probes[probe, BEGIN + 2])
    x = position(frame, int(probes[probe, ON]), begin)
    return begin, _seen(zones, zone, which, shift, x), True


@compiled
def _nearest_on_capsule(
    zones: Array, zone: int, which: int, shift: Array, probe: Array, frame: Array
) -> tuple[Vec3, Surface, bool]:
    begin = (probe[BEGIN], probe[BEGIN + 1], probe[BEGIN + 2])
    end = (probe[END], probe[END + 1], probe[END + 2])
    first = position(frame, int(probe[ON]), begin)
    if zones[zone, FLAT] > 0.0:  # then an end is nearest, which is a sphere of another part
        return begin, _seen(zones, zone, which, shift, first), False
    last = position(frame, int(probe[ON]), end)
    axis = (last[0] - first[0], last[1] - first[1], last[2] - first[2])
    square = dot(axis, axis)
    share = 0.5
    at = _seen(zones, zone, which, shift, add_scaled(first, axis, share))
    for _ in range(_NEAREST_STEPS):
        # From the nearest place of the zone back onto the capsule.
        back = dot((at.nx, at.ny, at.nz), axis) * max(at.distance, 0.0) / square
        moved = min(max(share - back, 0.0), 1.0)
        if abs(moved - share) * math.sqrt(square) < _STILL:
            break
        share = moved
        at = _seen(zones, zone, which, shift, add_scaled(first, axis, share))
    local = (
        begin[0] + share * (end[0] - begin[0]),
        begin[1] + share * (end[1] - begin[1]),
        begin[2] + share * (end[2] - begin[2]),
    )
    return local, at, 0.0 < share < 1.0


@compiled
def _nearest_on_disc(
    zones: Array, zone: int, which: int, shift: Array, probe: Array, frame: Array
) -> tuple[Vec3, Surface, bool]:
    begin, rim = (probe[BEGIN], probe[BEGIN + 1], probe[BEGIN + 2]), probe[RIM]
    on, flat = int(probe[ON]), zones[zone, FLAT] > 0.0
    local = begin
    at = _seen(zones, zone, which, shift, position(frame, on, local))
    n1, n2, n3 = in_axes(frame, (at.nx, at.ny, at.nz))
    u = v = 0.0  # of the place, from the disc's centre
    for _ in range(_NEAREST_STEPS):
        step = 1e3 if flat else max(at.distance, 0.05)
        aim_u, aim_v = u - step * n1, v - step * n2
        length = math.sqrt(aim_u * aim_u + aim_v * aim_v)
        if length > rim:
            aim_u, aim_v = aim_u * rim / length, aim_v * rim / length
        moved = abs(aim_u - u) + abs(aim_v - v)
        u, v = aim_u, aim_v
        if moved < _STILL:
            break
        local = (begin[0] + u, begin[1] + v, begin[2])
        at = _seen(zones, zone, which, shift, position(frame, on, local))
        n1, n2, n3 = in_axes(frame, (at.nx, at.ny, at.nz))
        if flat:
            break
    if probe[TURN] == 0.0:
        return local, at, True
    if abs(n3) < _AXIAL:
        return local, at, False
    angle = math.atan2(v, u) + probe[TURN]
    local = (begin[0] + rim * math.cos(angle), begin[1] + rim * math.sin(angle), begin[2])
    return local, _seen(zones, zone, which, shift, position(frame, on, local)), True


@compiled
def _seen(zones: Array, zone: int, which: int, shift: Array, x: Vec3) -> Surface:
    """The plane of a zone near a place in the world."""
    return surface_at(
        zones, zone, which, x[0] - shift[zone, 0], x[1] - shift[zone, 1], x[2] - shift[zone, 2]
    )
