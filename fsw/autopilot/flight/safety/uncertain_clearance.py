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
from typing import Final, NamedTuple

import numpy as np

from fsw.autopilot.barriers.safe_approach import stand_off
from fsw.autopilot.estimation.error_state import ERRORS, TH, Array, P
from fsw.autopilot.estimation.turned_covariance import SAME_AXES, Vec6, turned_covariance
from fsw.autopilot.geometry.vectors import dot, norm
from fsw.autopilot.model.body import Body
from fsw.autopilot.model.kinematics import frame_of, position
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.kind import ShapeKind
from fsw.autopilot.shapes.zones import all_planes
from fsw.autopilot.signals import SafeSet, StateEstimate, Vec2, Vec3
from fsw.compiled import kernel
from fsw.frozen import replace

_STEP: Final = 1e-3  # m, by which clearances grow, so that most ticks have the same ones
_SLACK: Final = 4e-3  # m, by which one must be too large before it shrinks
# m; a place that is lost altogether is none to plan from. With 0.5 m a vehicle without satellites
# was at the wall before it had come down.
_MOST: Final = 2.0
# m/s; what grows faster is uncertain for a moment only, and a vehicle that flees from it flies into
# the wall behind.
_RISE: Final = 0.8
_AMPLE: Final = 0.01  # m; zones that grow by less are not searched for room
SHORTFALL: Final = 0.01  # m of room; a workspace has 1 mm to spare, motion capture asks for 3
_NEAR: Final = 2.0  # m; zones farther off leave room enough
_RIM: Final = 8  # places around a disc: an octagon around its rim, in which a convex function is
_SHARES: Final = 6  # bisections of what there is room for
_PASSES: Final = 60  # over all planes; in a corner they have to settle
_LOST: Final = np.eye(6)  # m^2, rad^2
_SURE: Final = np.zeros((6, 6))
_NO_NORMALS: Final = np.empty((0, 3))
_LEVEL: Final[Vec2] = (0.0, 0.0)
_STAYS: Final[Vec3] = (0.0, 0.0, 0.0)
_NOTHING: Final[Vec6] = (0.0,) * 6


class InflatedSafeSet(NamedTuple):
    """The safe set as it is kept: that in force, and more where the estimate is not sure."""

    source: SafeSet = SafeSet()  # in force
    safe_set: SafeSet = SafeSet()  # kept; the same object where nothing was added
    added: tuple[float, ...] = ()  # m, to the clearance of each zone; empty: nothing
    shortfall: float = 0.0  # m, largest margin shortfall of a zone
    sufficient_us: int = -1  # when there was room enough last; -1: not known yet
    spread: tuple[float, ...] = ()  # m, k sigma at each zone
    t_us: int = 0  # at that time
    given: tuple[float, ...] = ()  # m, that each clearance is less for want of room; empty: nothing
    moved: tuple[float, ...] = ()  # m, of each growth, for jumps that nothing explains

    @property
    def whole(self) -> InflatedSafeSet:
        """The same without what was given."""
        if not self.given:
            return self
        whole = _grown(self.source, self.added)
        return self._replace(safe_set=whole.safe_set, given=())

    @property
    def beyond(self) -> tuple[float, ...]:
        """What of each zone's clearance is no margin [m]; empty: nothing."""
        if not self.given:
            return self.added
        added = self.added or (0.0,) * len(self.given)
        return tuple(map(float.__sub__, added, self.given))

    def of(self, safe_set: SafeSet) -> InflatedSafeSet:
        """The same for another safe set in force, until the next planning tick knows better."""
        if safe_set is self.source:
            return self
        added = (max(self.added, default=0.0),) * len(safe_set.zones)
        alike = [zone.shape.kind for zone in safe_set.zones] == [
            zone.shape.kind for zone in self.source.zones
        ]
        return _grown(safe_set, added)._replace(
            shortfall=self.shortfall,
            sufficient_us=self.sufficient_us,
            spread=self.spread if alike else (),
            t_us=self.t_us,
        )


class UncertainClearance:
    """Grows the clearances of one configuration."""

    def __init__(self, config: FlightConfig, loop_lag: float) -> None:
        """The vehicle follows a plan after ``loop_lag`` [s]."""
        planner, tunings = config.planner, config.planner.tunings
        # Half a period until a plan is asked for, what it takes then, and the loop's own lag.
        lag = 0.5 * planner.period + config.plan_delay_ticks * config.tick + loop_lag
        # A plan keeps S(d) + n v: against a boundary that comes at r, d is less by r / k_S.
        self._lead = 1.0 / tunings[0].slope + lag
        self._sigmas, self._bodies = config.limits.clearance_sigmas, config.airframe.bodies
        self._places, self._radii = _places(config.body)
        self._stand_off, self._stand_off_inside = (stand_off(one) for one in tunings)
        self._known = (SafeSet(), *_kinds_and_normals(SafeSet()))

    def warm_up(self, estimate: StateEstimate) -> None:
        """Compile every kernel."""
        self.deviation(estimate, pose_covariance(np.zeros((ERRORS, ERRORS)), estimate))

    def keep(
        self,
        before: InflatedSafeSet,
        safe_set: SafeSet,
        estimate: StateEstimate,
        pose: Array | None,
        wind: Vec2 = _LEVEL,
        unproven: Vec3 = _STAYS,
    ) -> InflatedSafeSet:
        """The safe set to keep from now on.

        ``pose`` (6, 6) [m, rad, NED] is the covariance of the estimate's position and attitude;
        None where states are exact. ``wind`` [m, NED] is what the memory of wind can add to the
        tube; what there is no room for of that is not ``lacking``: the analysis says it before.
        By ``unproven`` [m, NED] the estimate has jumped, and nothing says that it was wrong before:
        zones are kept where they are by it, and where they were.
        """
        sure = pose is None or not self._sigmas > 0.0
        if (sure and wind == _LEVEL and unproven == _STAYS) or not safe_set.zones:
            return before if before.safe_set is safe_set else InflatedSafeSet(safe_set, safe_set)
        pose = _SURE if sure or pose is None else _finite(pose)
        spread, levers = self._spread(safe_set, estimate, pose)
        turned = _turned(safe_set, wind)
        spread = tuple(map(float.__add__, spread, turned))
        moved = _moved(safe_set, unproven)
        wanted = self._ahead(before, spread, estimate.t_us)
        # At once: by as much the estimate says that the zone is farther away.
        wanted = tuple(map(float.__add__, wanted, moved))
        granted = self._granted(safe_set, estimate, levers, wanted)
        short = [
            max(more - there - gust, 0.0)
            for more, there, gust in zip(wanted, granted, turned, strict=True)
        ]
        shortfall = max(short)
        same = safe_set is before.source and granted == before.added
        kept = before if same else _grown(safe_set, granted)
        lacks = shortfall > SHORTFALL and before.sufficient_us >= 0
        return kept._replace(
            shortfall=shortfall,
            sufficient_us=before.sufficient_us if lacks else estimate.t_us,
            spread=spread,
            t_us=estimate.t_us,
            given=(),
            moved=moved,
        )

    def deviation(self, estimate: StateEstimate, pose: Array) -> float:
        """Standard deviation [m] of the least certain part of the body, along its worst axis.

        ``pose`` (6, 6) [m, rad, NED] as for ``keep``.
        """
        pose = _finite(pose)
        return float(_along_any(pose, self._look(estimate, pose)[0]).max())

    def _look(
        self, estimate: StateEstimate, pose: Array, normals: Array = _NO_NORMALS
    ) -> tuple[Array, list[float]]:
        """From the base to each place of the body (places, 3) [m, NED], and see ``_look``."""
        levers, most = np.empty((len(self._places), 3)), np.empty(len(normals))
        _look(pose, frame_of(self._bodies, estimate), self._places, normals, levers, most)
        return levers, most.tolist()

    def _ahead(
        self, before: InflatedSafeSet, spread: tuple[float, ...], now_us: int
    ) -> tuple[float, ...]:
        """What clearances are to grow by [m], in steps: k sigma as it will be when plans can act.

        A boundary that comes nearer is met by a plan that is on its way back from it.
        """
        elapsed = 1e-6 * (now_us - before.t_us)
        wanted = list(spread)
        if len(before.spread) == len(spread) and elapsed > 0.0:
            for k, then in enumerate(before.spread):
                wanted[k] += self._lead * max(spread[k] - then, 0.0) / elapsed
        stepped = [min(_stepped(more), _MOST) for more in wanted]
        if len(before.added) != len(stepped):
            return tuple(stepped)
        rise = _RISE * elapsed if elapsed > 0.0 else 0.0
        own = before.added
        if before.moved:
            own = tuple([max(a - b, 0.0) for a, b in zip(own, before.moved, strict=True)])
        bounded = [min(more, _stepped(old + rise)) for more, old in zip(stepped, own, strict=True)]
        return tuple(map(_settled, bounded, own))

    def _spread(
        self, safe_set: SafeSet, estimate: StateEstimate, pose: Array
    ) -> tuple[tuple[float, ...], Array]:
        """k sigma at each zone [m], and the levers of ``_look``."""
        if safe_set is not self._known[0]:  # looked at ten times a second, and the same
            self._known = (safe_set, *_kinds_and_normals(safe_set))
        _, kinds, normals = self._known
        levers, most = self._look(estimate, pose, normals)
        if len(normals) < len(kinds):
            along_any, along = _along_any(pose, levers), iter(most)
            base, worst = float(along_any[0]), float(along_any.max())
            # Of the base alone where a zone keeps only that.
            round_ = [base if kind.follows_target else worst for kind in kinds]
            most = [
                next(along) if kind.flat else one for kind, one in zip(kinds, round_, strict=True)
            ]
        return tuple([self._sigmas * one for one in most]), levers

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


def _kinds_and_normals(safe_set: SafeSet) -> tuple[list[ShapeKind], Array]:
    """The kind of each zone, and the normals (flat zones, 3) [NED] of those that are flat."""
    kinds = [kind_of(zone.shape) for zone in safe_set.zones]
    flat = [zone for zone, kind in zip(safe_set.zones, kinds, strict=True) if kind.flat]
    if not flat:
        return kinds, _NO_NORMALS
    return kinds, np.array([zone.shape.numbers[:3] for zone in flat])


def _turned(safe_set: SafeSet, wind: Vec2) -> tuple[float, ...]:
    """How far ``wind`` [m, NED] can lead towards each zone [m]."""
    x, y = wind
    return tuple(
        [
            abs(x * n[0]) + abs(y * n[1]) if kind_of(zone.shape).flat else math.hypot(x, y)
            for zone in safe_set.zones
            for n in (zone.shape.numbers,)
        ]
    )


def _moved(safe_set: SafeSet, by: Vec3) -> tuple[float, ...]:
    """How much farther away a jump ``by`` [m, NED] makes each zone [m], in steps.

    A round one is at most as much. What rides on the target comes along.
    """
    if by == _STAYS:
        return (0.0,) * len(safe_set.zones)
    found = []
    for zone in safe_set.zones:
        kind, (x, y, z) = kind_of(zone.shape), zone.shape.numbers[:3]
        farther = dot((x, y, z), by) if kind.flat else norm(by)
        found.append(0.0 if kind.follows_target else _stepped(max(farther, 0.0)))
    return tuple(found)


def _grown(safe_set: SafeSet, added: tuple[float, ...]) -> InflatedSafeSet:
    if not max(added, default=0.0) > 0.0:
        return InflatedSafeSet(safe_set, safe_set, added)
    zones = [
        replace(zone, clearance=zone.clearance + more)
        for zone, more in zip(safe_set.zones, added, strict=True)
    ]
    return InflatedSafeSet(safe_set, SafeSet(tuple(zones)), added)


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
            shortfall = -(there + float(n @ shift))
            if shortfall > 0.0:
                shift = shift + shortfall * n
    return None


def pose_covariance(covariance: Array, estimate: StateEstimate, besides: Vec6 = _NOTHING) -> Array:
    """Covariance (6, 6) of position [m, NED] and attitude [rad, NED].

    From the filter's ``covariance`` (17, 17) [SI], whose attitude is about the body's axes, and
    variances ``besides`` [m^2, NED] [rad^2, FRD].
    """
    return turned_covariance(covariance, (P, TH), (SAME_AXES, estimate.R_WB), besides)


def _finite(pose: Array) -> Array:
    # By itself: a sum of NumPy's takes 1 us, and 10 us where it is not in the caches.
    return pose if math.isfinite(sum(pose.ravel().tolist())) else _LOST


@kernel
def _look(
    pose: Array, frame: Array, places: Array, normals: Array, levers: Array, most: Array
) -> None:
    """Each place's lever (places, 3) [m, NED], and the most uncertain one's along each normal.

    That is the deviation ``most`` (planes,) [m] along ``normals`` (planes, 3) [NED] of all places.
    """
    for i in range(places.shape[0]):
        local = (places[i, 1], places[i, 2], places[i, 3])
        at = position(frame, int(places[i, 0]), local)
        for axis in range(3):
            levers[i, axis] = at[axis] - frame[axis]
    for k in range(normals.shape[0]):
        n, variance = (normals[k, 0], normals[k, 1], normals[k, 2]), 0.0
        for i in range(places.shape[0]):
            x, y, z = levers[i]
            slope = (*n, y * n[2] - z * n[1], z * n[0] - x * n[2], x * n[1] - y * n[0])
            total = 0.0
            for a in range(6):
                for b in range(6):
                    total += slope[a] * pose[a, b] * slope[b]
            variance = max(variance, total)
        most[k] = math.sqrt(variance)


def _along_any(pose: Array, levers: Array) -> Array:
    """Deviation of each place along its worst axis (places,) [m]."""
    covariances = place_covariances(pose, levers)
    found: Array = np.sqrt(np.maximum(np.linalg.eigvalsh(covariances)[:, -1], 0.0))
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


def _places(body: Body) -> tuple[Array, Array]:
    """Places (places, 4) [1, m], and their radii (places,) [m].

    A place is what it is on and where there. The deviation is a convex function of it, so the ends
    of a part are its most uncertain places. The first is the base.
    """
    found: list[tuple[tuple[float, ...], float]] = []
    for part in body.parts:
        x, y, z = part.begin
        if not part.rim > 0.0:
            # A capsule's ends are parts of their own.
            found.append(((part.on, x, y, z), part.radius))
            continue
        around = part.rim / math.cos(math.pi / _RIM)
        for k in range(_RIM):
            angle = 2.0 * math.pi * k / _RIM
            rim = (part.on, x + around * math.cos(angle), y + around * math.sin(angle), z)
            found.append((rim, part.radius))
    places, radii = zip(*found, strict=True)
    return np.array(places), np.array(radii)
