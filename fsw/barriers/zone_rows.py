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
from fsw.geometry.vectors import dot
from fsw.model.body import (
    CAPSULE,
    DISC,
    Body,
    Probes,
    nearest_on_disc,
    nearest_on_segment,
)
from fsw.model.linearisation import Horizon, Linearisation, chain, in_body, place, slopes
from fsw.model.prediction import STATES, Array, CondensedModel
from fsw.shapes.kind import Surface
from fsw.shapes.zones import ZoneArrays, shifts, surface_at, zone_arrays
from fsw.signals import SafeSet, Vec3

_NEAREST_STEPS = 5  # alternating projections between a part and a zone
_FLAT = 0.7  # cosine between a disc's axis and a normal from which all of its rim counts
_NO_ROW = 1e3  # residual of a row that is left out


class Moves(NamedTuple):
    """Where the zones are at the nodes."""

    shift: Array  # (n + 1, zones, 3) m
    velocity: Array  # (n + 1, zones, 3) m/s


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
    ) -> None:
        """Lay out the rows of a safe set, to be refilled.

        The first of ``tunings`` is for all zones but those that follow the target. With
        ``distances`` the rows require a distance of ``tightening`` [m] in place of a barrier.
        """
        self._probes = body.probes
        self._tunings = Tunings(*(tuning.numbers(model.period) for tuning in tunings))
        self._distances, self._tightening = distances, tightening
        self._period_us = round(1e6 * model.period)
        self.update(safe_set)
        zones, probes = self._zones, len(self._probes.part)
        per_zone = [
            int(planes) * (1 if follows else probes)
            for planes, follows in zip(zones.planes, zones.follows, strict=True)
        ]
        skipped = tunings[0].skipped_nodes if skipped_nodes is None else skipped_nodes
        self._first = 1 + skipped
        parts = len(body.parts)
        starts = sum(1 if follows else parts for follows in zones.follows)
        self.rows = block(tuple(per_zone), self._first, model.horizon, starts)
        self._rows, self._fill = self.rows.rows, of_fixed_types(_fill)

    def update(self, safe_set: SafeSet) -> None:
        """See ``fsw.barriers.constraint_block.Barrier``."""
        self._safe_set, self._zones = safe_set, zone_arrays(safe_set)

    def refill(self, horizon: Linearisation, targets: TargetPoints) -> None:
        """Linearise every row along the normals of the guess."""
        times_us = targets.t_us + self._period_us * np.arange(len(targets.position))
        moves = Moves(*shifts(self._safe_set, times_us, targets.position, targets.velocity))
        self._fill(
            self._zones,
            moves,
            self._probes,
            horizon.horizon,
            self._tunings,
            (self._distances, self._tightening, self._first),
            self._rows,
        )


def layout(safe_set: SafeSet) -> tuple[tuple[str, bool], ...]:
    """What of a safe set decides how many rows there are; the rest is numbers."""
    return tuple((zone.shape.kind, zone.keep_in) for zone in safe_set.zones)


@compiled
def _fill(
    zones: ZoneArrays,
    moves: Moves,
    probes: Probes,
    horizon: Horizon,
    tunings: Tunings,
    how: tuple[bool, float, int],
    rows: Rows,
) -> None:
    distances, tightening, first = how
    at_position, at_velocity = np.zeros(STATES), np.zeros(STATES)
    fill_starts(zones, moves, probes, horizon, tunings, distances, rows.start)
    row = 0
    for i in range(first, horizon.states.shape[0]):
        for k in range(len(zones.kind)):
            tuning = tunings.following if zones.follows[k] else tunings.kept
            for b in range(1 if zones.follows[k] else len(probes.part)):
                for which in range(zones.planes[k]):
                    shift = moves.shift[i, k]
                    local, at, binds = nearest_place(zones, k, which, shift, probes, b, horizon, i)
                    gradient = rows.gradient[row]
                    if not binds:
                        rows.value[row] = _NO_ROW
                        rows.lower_bound[row] = 0.0
                        gradient[:] = 0.0
                        row += 1
                        continue
                    n = (at.nx, at.ny, at.nz)
                    on = probes.on[b]
                    slopes(horizon, i, on, local, n, at_position, at_velocity)
                    radius = 0.0 if zones.follows[k] else probes.radius[b]
                    d = at.distance - radius
                    if distances:
                        rows.value[row], rows.lower_bound[row] = d, tightening
                        chain(horizon, i, at_position, gradient)
                        row += 1
                        continue
                    p, v = place(horizon, i, on, local)
                    p0, v0 = place(horizon, 0, on, local)
                    # The plane of the node, where the zone was at node 0, and the probe then.
                    d0 = d + dot(n, p0) - dot(n, p)
                    d0 += dot(n, moves.shift[i, k]) - dot(n, moves.shift[0, k])
                    rate0 = dot(n, v0) - dot(n, moves.velocity[0, k])
                    rate = dot(n, v) - dot(n, moves.velocity[i, k])
                    rows.value[row] = barrier_value(d, rate, tuning)
                    rows.lower_bound[row] = cbf_lower_bound(
                        barrier_value(d0, rate0, tuning), i, tuning
                    )
                    steepness = safe_approach_slope(d, tuning.alpha, tuning.slope)
                    for s in range(STATES):
                        at_velocity[s] += steepness * at_position[s]
                    chain(horizon, i, at_velocity, gradient)
                    row += 1


@compiled
def fill_starts(
    zones: ZoneArrays,
    moves: Moves,
    probes: Probes,
    horizon: Horizon,
    tunings: Tunings,
    distances: bool,
    starts: Array,
) -> None:
    """The least value of each zone and part at node 0: h [m/s], or the distance [m].

    Into ``starts`` (zones x parts,), zone by zone; a zone that follows the target has one entry.
    """
    starts[:] = math.inf
    first = 0
    for k in range(len(zones.kind)):
        tuning = tunings.following if zones.follows[k] else tunings.kept
        tried = 1 if zones.follows[k] else len(probes.part)
        for b in range(tried):
            # The paper's pair h2a and h2b: towards the nearest place, and away from it.
            for which in range(min(zones.planes[k], 2)):
                shift = moves.shift[0, k]
                local, at, _ = nearest_place(zones, k, which, shift, probes, b, horizon, 0)
                _, v = place(horizon, 0, probes.on[b], local)
                n = (at.nx, at.ny, at.nz)
                value = at.distance - (0.0 if zones.follows[k] else probes.radius[b])
                if not distances:
                    rate = dot(n, v) - dot(n, moves.velocity[0, k])
                    value = barrier_value(value, rate, tuning)
                at_part = first + probes.part[b]
                starts[at_part] = min(starts[at_part], value)
        first += probes.part[tried - 1] + 1


@compiled
def nearest_place(
    zones: ZoneArrays,
    zone: int,
    which: int,
    shift: Array,
    probes: Probes,
    probe: int,
    horizon: Horizon,
    node: int,
) -> tuple[Vec3, Surface, bool]:
    """The place of a probe that counts against a plane of a zone, and that plane.

    The place is given where it is on its part [m], the plane at the place, with the zone moved by
    ``shift`` (3,) [m, NED]. False: this probe says nothing that another does not say.
    """
    form = probes.form[probe]
    begin = _three(probes.begin[probe])
    if form != CAPSULE and form != DISC:
        return begin, _seen(zones, zone, which, shift, probes, probe, horizon, node, begin), True
    end, rim = _three(probes.end[probe]), probes.rim[probe]
    local = begin
    if form == CAPSULE:
        local = (0.5 * (begin[0] + end[0]), 0.5 * (begin[1] + end[1]), 0.5 * (begin[2] + end[2]))
    at = _seen(zones, zone, which, shift, probes, probe, horizon, node, local)
    nx, ny, nz = 0.0, 0.0, 1.0
    for _ in range(_NEAREST_STEPS):
        nx, ny, nz = _in_part(horizon, node, probes.on[probe], at)
        step = max(at.distance, 0.05)
        aim = (local[0] - step * nx, local[1] - step * ny, local[2] - step * nz)
        if form == CAPSULE:
            moved = nearest_on_segment(begin, end, aim)
        else:
            moved = nearest_on_disc(begin, rim, aim)
        still = (
            abs(moved[0] - local[0]) + abs(moved[1] - local[1]) + abs(moved[2] - local[2]) < 1e-4
        )
        if still:
            break
        local = moved
        at = _seen(zones, zone, which, shift, probes, probe, horizon, node, local)
    if form == CAPSULE:
        at_end = local == begin or local == end  # a sphere of another part
        return local, at, not at_end
    turn = probes.turn[probe]
    if turn > 0.0:
        if abs(nz) < _FLAT:
            return local, at, False
        angle = math.atan2(local[1] - begin[1], local[0] - begin[0]) + turn
        local = (begin[0] + rim * math.cos(angle), begin[1] + rim * math.sin(angle), begin[2])
        at = _seen(zones, zone, which, shift, probes, probe, horizon, node, local)
    return local, at, True


@compiled
def _seen(
    zones: ZoneArrays,
    zone: int,
    which: int,
    shift: Array,
    probes: Probes,
    probe: int,
    horizon: Horizon,
    node: int,
    local: Vec3,
) -> Surface:
    """The plane of a zone near a place of the vehicle."""
    p, _ = place(horizon, node, probes.on[probe], local)
    return surface_at(zones, zone, which, p[0] - shift[0], p[1] - shift[1], p[2] - shift[2])


@compiled
def _in_part(horizon: Horizon, node: int, on: int, at: Surface) -> Vec3:
    """A normal in the axes in which a part's places are given: the body's, or along a link."""
    b1, b3 = horizon.axes[node, 0], horizon.axes[node, 1]
    n1 = at.nx * b1[0] + at.ny * b1[1] + at.nz * b1[2]
    n3 = at.nx * b3[0] + at.ny * b3[1] + at.nz * b3[2]
    if on == 0:
        b2x, b2y, b2z = (
            b3[1] * b1[2] - b3[2] * b1[1],
            b3[2] * b1[0] - b3[0] * b1[2],
            b3[0] * b1[1] - b3[1] * b1[0],
        )
        return n1, at.nx * b2x + at.ny * b2y + at.nz * b2z, n3
    joint, _ = in_body(horizon, node, on, (0.0, 0.0, 0.0))
    tip, _ = in_body(horizon, node, on, (0.0, 0.0, 1.0))
    return 0.0, 0.0, (tip[0] - joint[0]) * n1 + (tip[2] - joint[2]) * n3


@compiled
def _three(row: Array) -> Vec3:
    return row[0], row[1], row[2]
