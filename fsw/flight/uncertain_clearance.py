r"""Clearances that grow with what the estimator does not know.

A place of the vehicle at :math:`\ell` from the base is where the estimate says but for
:math:`\delta p + \phi\times\ell`, with the attitude's error :math:`\phi` in the world. Along a
zone's normal n its standard deviation is

.. math:: \sigma^2 = n^T C\,n, \qquad C = (I, -[\ell]_\times)\,P\,(I, -[\ell]_\times)^T,

P being the covariance of position and attitude. Each zone's clearance grows by k sigma of the part
of the body that is least certain along its normal; for zones that are not flat, along any. A
radius adds nothing: it lies along the normal, which no rotation moves.

So a vehicle whose pose is lost draws back from walls by itself. Where walls leave no room for that,
they are given what there is: the planner's rows could not be kept otherwise, and would outbid each
other unseen. What is lacking is a row of the failsafe table.

Source: docs/equations.md T7; docs/decisions/0031-barriers-that-know-the-uncertainty.md.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from fsw.barriers.safe_approach import BarrierTuning
from fsw.estimation.error_state import TH, Array, P
from fsw.model.body import ON_BASE, ON_LINK1, Body
from fsw.model.kinematics import links
from fsw.parameters.consistency import stand_off
from fsw.shapes import kind_of
from fsw.shapes.zones import all_planes
from fsw.signals import SafeSet, StateEstimate, Vec2

_STEP: Final = 1e-3  # m, by which clearances grow, so that most ticks have the same ones
_SLACK: Final = 4e-3  # m, by which one must be too large before it shrinks
_MOST: Final = 0.5  # m; a place that is lost altogether is none to plan from
_AMPLE: Final = 0.01  # m; zones that grow by less are not searched for room
LACKING: Final = 0.01  # m of room; a workspace has 1 mm to spare, motion capture asks for 3
_NEAR: Final = 2.0  # m; zones farther off leave room enough
_RIM: Final = 8  # places around a disc: an octagon around its rim, in which a convex function is
_SHARES: Final = 6  # bisections of what there is room for
_PASSES: Final = 60  # over all planes; in a corner they have to settle


_LOST: Final = np.eye(6)  # m^2, rad^2


class KeptSet(NamedTuple):
    """The safe set as it is kept: that in force, and more where the estimate is not sure."""

    source: SafeSet = SafeSet()  # in force
    safe_set: SafeSet = SafeSet()  # kept; the same object where nothing was added
    added: tuple[float, ...] = ()  # m, to the clearance of each zone; empty: nothing
    lacking: float = 0.0  # m, what there is no room for, of the zone that lacks most
    ample_us: int = -1  # when there was room enough last; -1: not known yet
    spread: tuple[float, ...] = ()  # m, k sigma at each zone
    t_us: int = 0  # at that time
    sigma: float = 0.0  # m, standard deviation of the least certain part along its worst axis

    def of(self, safe_set: SafeSet) -> KeptSet:
        """The same for another safe set in force, until the next planning tick knows better."""
        if safe_set is self.source:
            return self
        added = (max(self.added, default=0.0),) * len(safe_set.zones)
        return _grown(safe_set, added)._replace(
            lacking=self.lacking, ample_us=self.ample_us, sigma=self.sigma
        )


class UncertainClearance:
    """Grows the clearances of one configuration."""

    def __init__(
        self,
        sigmas: float,
        body: Body,
        lengths: Vec2,
        tunings: tuple[BarrierTuning, BarrierTuning],
        lag: float,
    ) -> None:
        """Keep ``sigmas`` [1] standard deviations for a body with links of ``lengths`` [m].

        A plan takes effect, and the vehicle follows it, after ``lag`` [s] on average.
        """
        # A plan keeps S(d) + n v: against a boundary that comes at r, d is less by r / k_S.
        self._lead = 1.0 / tunings[0].slope + lag
        self._sigmas, self._lengths = sigmas, lengths
        self._on_base, self._on_links, self._radii = _places(body)
        self._stand_off, self._stand_off_inside = (stand_off(one) for one in tunings)

    def keep(
        self, before: KeptSet, safe_set: SafeSet, estimate: StateEstimate, pose: Array | None
    ) -> KeptSet:
        """The safe set to keep from now on.

        ``pose`` (6, 6) [m, rad, NED] is the covariance of the estimate's position and attitude;
        None where states are exact.
        """
        if pose is None or not safe_set.zones:
            return before if before.safe_set is safe_set else KeptSet(safe_set, safe_set)
        if not np.isfinite(pose).all():
            pose = _LOST
        levers = self._levers(estimate)
        covariances = place_covariances(pose, levers)
        along_any = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances)[:, -1], 0.0))
        sigma = float(along_any.max())
        if not self._sigmas > 0.0:
            return KeptSet(safe_set, safe_set, sigma=sigma)
        spread = self._spread(safe_set, covariances, along_any)
        wanted = self._ahead(before, spread, estimate.t_us)
        granted = self._granted(safe_set, estimate, levers, wanted)
        lacking = max(map(float.__sub__, wanted, granted))
        kept = before
        if safe_set is not before.source or granted != before.added:
            kept = _grown(safe_set, granted)
        lacks = lacking > LACKING and before.ample_us >= 0
        ample_us = before.ample_us if lacks else estimate.t_us
        return kept._replace(
            lacking=lacking, ample_us=ample_us, spread=spread, t_us=estimate.t_us, sigma=sigma
        )

    def _levers(self, estimate: StateEstimate) -> Array:
        """From the base to each place of the body (places, 3) [m, NED]."""
        th1, th2 = estimate.q_arm
        (x1, z1), (x2, z2) = links(self._lengths, th1, th1 + th2)
        l1, l2 = self._lengths
        first, second = np.array((x1, 0.0, z1)) / l1, np.array((x2, 0.0, z2)) / l2
        on_link, along = self._on_links[:, 0], self._on_links[:, 1:]
        on_arm = np.where(on_link[:, None] == ON_LINK1, first * along, first * l1 + second * along)
        turn = np.reshape(estimate.R_WB, (3, 3))
        levers: Array = np.concatenate((self._on_base, on_arm)) @ turn.T
        return levers

    def _ahead(self, before: KeptSet, spread: tuple[float, ...], now_us: int) -> tuple[float, ...]:
        """What clearances are to grow by [m], in steps: k sigma as it will be when plans can act.

        A boundary that comes nearer is met by a plan that is on its way back from it.
        """
        elapsed = 1e-6 * (now_us - before.t_us)
        wanted = list(spread)
        if len(before.spread) == len(spread) and elapsed > 0.0:
            for k, then in enumerate(before.spread):
                wanted[k] += self._lead * max(spread[k] - then, 0.0) / elapsed
        stepped = [min(_stepped(more), _MOST) for more in wanted]
        if len(before.added) == len(stepped):
            return tuple(map(_settled, stepped, before.added))
        return tuple(stepped)

    def _spread(self, safe_set: SafeSet, covariances: Array, along_any: Array) -> tuple[float, ...]:
        """k sigma at each zone [m]; of the base alone where a zone keeps only that."""
        spread = []
        for zone in safe_set.zones:
            kind = kind_of(zone.shape)
            if kind.flat:
                n = np.array(zone.shape.numbers[:3])
                most = math.sqrt(max(float((covariances @ n @ n).max()), 0.0))
            else:
                most = float(along_any[0] if kind.follows_target else along_any.max())
            spread.append(self._sigmas * most)
        return tuple(spread)

    def _granted(
        self, safe_set: SafeSet, estimate: StateEstimate, levers: Array, wanted: tuple[float, ...]
    ) -> tuple[float, ...]:
        """What of the wanted growth [m] there is room for, with the stand-off of a plan at rest."""
        granted = list(wanted)
        for k, zone in enumerate(safe_set.zones):
            if kind_of(zone.shape).follows_target:
                room = zone.shape.numbers[-1] - zone.clearance - self._stand_off_inside
                granted[k] = min(granted[k], max(math.floor(room / _STEP) * _STEP, 0.0))
        if not max(wanted) > _AMPLE:
            return tuple(granted)
        found = all_planes(safe_set, estimate.p_WB, estimate.t_us)
        near = [(k, at) for k, at in found if at.distance < _NEAR]
        if len(near) > 1:
            normals = np.array([at.normal for _, at in near])
            body = (levers @ normals.T - self._radii[:, None]).min(axis=0)
            room_now = np.array([at.distance for _, at in near]) + body - self._stand_off
            growth = np.array([wanted[k] for k, _ in near])
            for (k, _), room in zip(near, _rooms(normals, growth, room_now), strict=True):
                if room < granted[k]:
                    granted[k] = max(math.floor(room / _STEP) * _STEP, 0.0)
        return tuple(granted)


def _grown(safe_set: SafeSet, added: tuple[float, ...]) -> KeptSet:
    if not max(added, default=0.0) > 0.0:
        return KeptSet(safe_set, safe_set, added)
    zones = [
        replace(zone, clearance=zone.clearance + more)
        for zone, more in zip(safe_set.zones, added, strict=True)
    ]
    return KeptSet(safe_set, SafeSet(tuple(zones)), added)


def _stepped(more: float) -> float:
    return math.ceil(more / _STEP) * _STEP


def _settled(wanted: float, before: float) -> float:
    """Growth [m] that follows at once upwards, and not for a little downwards."""
    return before if before - _SLACK <= wanted <= before else wanted


def _rooms(normals: Array, growth: Array, there: Array) -> list[float]:
    """How much each plane (planes, 3) may grow by [m] so that some place keeps off them all.

    ``growth`` (planes,) [m] is wanted, room is ``there`` (planes,) [m] now. All are given the same
    share of what they want, and those that are not in the way of others the rest.
    """
    shift = _kept_off(normals, there - growth)
    if shift is not None:
        return list(growth)
    low, high, best = 0.0, 1.0, _kept_off(normals, there)
    if best is None:
        return [0.0] * len(there)  # there is none for a plan that is sure of its place, either
    for _ in range(_SHARES):
        share = 0.5 * (low + high)
        shift = _kept_off(normals, there - share * growth)
        if shift is None:
            high = share
        else:
            low, best = share, shift
    return [float(one) for one in np.maximum(low * growth, there + normals @ best)]


def _kept_off(normals: Array, room: Array) -> Array | None:
    """A shift (3,) [m] after which ``room`` (planes,) [m] is nowhere negative, or None."""
    shift = np.zeros(3)
    for _ in range(_PASSES):
        left = room + normals @ shift
        if not (left < -_STEP).any():
            return shift
        for n, there in zip(normals, room, strict=True):
            lacking = -(there + float(n @ shift))
            if lacking > 0.0:
                shift = shift + lacking * n
    return None


def pose_covariance(covariance: Array, estimate: StateEstimate) -> Array:
    """Covariance (6, 6) of position [m, NED] and attitude [rad, NED].

    From the filter's ``covariance`` (17, 17) [SI], whose attitude is about the body's axes.
    """
    turn = np.eye(6)
    turn[3:, 3:] = np.reshape(estimate.R_WB, (3, 3))
    kept = [P, P + 1, P + 2, TH, TH + 1, TH + 2]
    found: Array = turn @ covariance[np.ix_(kept, kept)] @ turn.T
    return found


def place_covariances(pose: Array, levers: Array) -> Array:
    """Covariances (places, 3, 3) [m^2, NED] of places at ``levers`` (places, 3) [m, NED].

    ``pose`` (6, 6) [m, rad, NED] is that of the base.
    """
    slope = np.zeros((len(levers), 3, 6))
    slope[:, 0, 0] = slope[:, 1, 1] = slope[:, 2, 2] = 1.0
    x, y, z = levers.T
    # phi x lever
    slope[:, 0, 4], slope[:, 0, 5] = z, -y
    slope[:, 1, 3], slope[:, 1, 5] = -z, x
    slope[:, 2, 3], slope[:, 2, 4] = y, -x
    found: Array = slope @ pose @ slope.transpose(0, 2, 1)
    return found


def _places(body: Body) -> tuple[Array, Array, Array]:
    """Places on the base (n, 3) [m, body], on links (m, 2) [which, m], and radii (n + m,) [m].

    The deviation is a convex function of the place, so the ends of a part are its most uncertain
    places. The first one is the base.
    """
    base: list[tuple[tuple[float, float, float], float]] = []
    arm: list[tuple[tuple[int, float], float]] = []
    for part in body.parts:
        if part.on != ON_BASE:
            arm.append(((part.on, part.begin[2]), part.radius))
            continue
        if not part.rim > 0.0:
            base.append((part.begin, part.radius))  # a capsule's ends are parts of their own
            continue
        around = part.rim / math.cos(math.pi / _RIM)
        for k in range(_RIM):
            angle = 2.0 * math.pi * k / _RIM
            x, y, z = part.begin
            place = (x + around * math.cos(angle), y + around * math.sin(angle), z)
            base.append((place, part.radius))
    on_arm = np.array([place for place, _ in arm], dtype=np.float64).reshape(-1, 2)
    radii = np.array([radius for _, radius in (*base, *arm)])
    return np.array([place for place, _ in base]), on_arm, radii
