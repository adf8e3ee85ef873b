"""Which safe set is in force: the announced one and the geofence together, if they can be kept.

One source owns what is announced, the first or the configured one, and one the fence that is in
force; nobody owns what never was. In flight any source may shrink either, and only its owner may
grow it (``safe_set_change.growth``) or announce a zone that comes so close that the vehicle must
give way: it could push it into others. Every change
and every refusal is a text that says who and what. Disarmed, another source may become the
owner once the old one has been silent for a while, or the vehicle has disarmed. From arming on
nobody, owner or first comer, may announce a set that is out of bounds or leaves the vehicle, or the
way in which it could stop, outside. A moving zone that has timed out is not predicted for ever: it
is held where it is then.
"""

from __future__ import annotations

from typing import NamedTuple

from fsw.autopilot.barriers.margins import Margins
from fsw.autopilot.flight.commands.bounds import safe_set_problem, upload_problem
from fsw.autopilot.flight.safety import way_home
from fsw.autopilot.flight.safety.safe_set_change import (
    growth,
    held,
    is_moving,
    is_update,
    is_update_of,
    summary,
)
from fsw.autopilot.flight.safety.safety_watch import least
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import MissionMemory
from fsw.autopilot.geometry.vectors import norm
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.parameters.consistency import (
    Finding,
    analyse,
    loop_tube,
    part_tube,
    refusals,
    warnings,
)
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.shapes import kind_of
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.zones import surfaces
from fsw.autopilot.signals import (
    ConstraintReport,
    EndEffectorTarget,
    MessageSource,
    MissionUpdate,
    SafeSet,
    SafeSetAnnouncement,
    Severity,
    StateEstimate,
    StatusText,
    TickInputs,
)
from fsw.frozen import replace

_SAME = 1e-3  # m; a zone that is where it was predicted is off by rounding
_LEAP = 0.1  # m; what comes closer by more, beside where it was predicted, is another zone
_ACCEPTED = 8  # sources whose last announcement is remembered


class _Vehicle(NamedTuple):
    """The vehicle for which another safe set is looked at, and what its operator is told."""

    estimate: StateEstimate | None
    target: EndEffectorTarget | None  # that zones follow
    armed: bool
    flies: bool
    texts: list[StatusText]

    @property
    def inside(self) -> StateEstimate | None:
        """The state in which it must be inside; None: it stands disarmed, and need not be."""
        return self.estimate if self.armed else None


class SafeSetCheck:
    """Analyses a safe set for one configuration before it is in force."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self.loop_tube = loop_tube(config)
        part_tube(config)  # takes a moment, and is then known
        planner, bodies = config.planner, config.airframe.bodies
        self._margins = Margins(config.body, bodies, planner.tunings, planner.period)

    def analyse(self, safe_set: SafeSet) -> tuple[Finding, ...]:
        """Findings on whether this configuration can keep a safe set."""
        return analyse(self._config, safe_set, self.loop_tube)

    def update(
        self,
        mission: MissionMemory,
        inputs: TickInputs,
        estimate: StateEstimate | None,
        texts: list[StatusText],
        *,
        flies: bool,
        armed: bool,
        target: EndEffectorTarget | None,
    ) -> MissionMemory:
        """Take in what was uploaded and announced; in flight only what can be kept.

        A vehicle that is ``armed`` must be inside of it, with the zones that follow the ``target``
        if there is one. Of an upload all is taken or nothing.
        """
        here = _Vehicle(estimate, target, armed, flies, texts)
        update = inputs.mission
        if update is not None:
            against = upload_problem(update) or self._against_rally(mission, update, armed=armed)
            if against is None:
                mission = self._take_upload(mission, update, here)
            else:
                mission = _refused(mission, against, here)
        for announcement in inputs.announced:
            now_us = inputs.sensors.t_us
            owns = self._owns(mission, announcement.source, now_us, armed=armed)
            problem = safe_set_problem(announcement.safe_set, self._config.surroundings.zone_speed)
            if problem is None:
                if owns and now_us != mission.owner_heard_us:
                    mission = replace(mission, owner_heard_us=now_us)
                problem = "" if owns else self._against(mission, announcement.safe_set)
            mission = self._take(mission, announcement, problem, here, owns=owns)
        return mission

    def _take_upload(
        self, mission: MissionMemory, update: MissionUpdate, here: _Vehicle
    ) -> MissionMemory:
        """What was uploaded, unless something speaks against any part of it."""
        wanted = mission
        if update.fence is not None:
            who = "fence" if update.source is None else f"fence of {update.source}"
            problem = self._against_fence(mission, update, here)
            if not problem:
                wanted = self._with_fence(mission, update, who, here)
                problem = "the old safe set is kept" if wanted is mission else ""
            if problem:
                return _refused(mission, f"{who} refused: {problem}", here)
        if update.rally not in (None, mission.rally):
            wanted = replace(wanted, rally=update.rally)
            text = f"rally points of {update.source}: {way_home.told(wanted.rally)}"
            here.texts.append(StatusText(Severity.INFO, text))
            if update.source is not None:
                armed = here.inside is not None
                wanted = way_home.changed(wanted, update.source.sender, armed=armed)
        return replace(wanted, upload_taken=True)

    def _against_rally(
        self, mission: MissionMemory, update: MissionUpdate, *, armed: bool
    ) -> str | None:
        """Why other rally points are refused."""
        if update.rally is None or update.rally == mission.rally:
            return None
        source = None if update.source is None else update.source.sender
        against = way_home.against(mission, source, self._chosen, armed=armed)
        fence = mission.fence if update.fence is None else update.fence
        found = (way_home.outside(fence, place) for place in update.rally)
        against = against or next(filter(None, found), "")
        return f"rally points of {update.source} refused: {against}" if against else None

    def _against_fence(self, mission: MissionMemory, update: MissionUpdate, here: _Vehicle) -> str:
        """Why a fence cannot be in force; in flight only its owner may grow it."""
        fence = update.fence or SafeSet()
        problem = safe_set_problem(fence, self._config.surroundings.zone_speed)
        if problem is not None:
            return problem
        if here.flies and self._is_stranger(update.source, mission):
            tied = _follows(mission.fence, fence)
            if tied:
                return f"{tied}, which {mission.owner} owns"
        if not self._may_grow(mission, update, here):
            grown = growth(mission.fence, fence)
            if grown:
                return f"{grown}, which {mission.fence_owner} owns"
        unkept = () if self._config.soft else refusals(self.analyse(fence))
        if unkept:
            return f"it cannot be kept: {'; '.join(unkept)}"
        if here.inside is None:
            return "" if here.estimate is None else _excluded(fence, here.estimate)
        return self._outside(mission, mission.fence, fence, here)

    def _with_fence(
        self, mission: MissionMemory, update: MissionUpdate, who: str, here: _Vehicle
    ) -> MissionMemory:
        """The memory with a fence; the same one where both safe sets together cannot be kept."""
        fence, owner = update.fence or SafeSet(), mission.fence_owner
        if self._may_grow(mission, update, here):
            owner = update.source
        wanted = replace(mission, fence=fence, fence_owner=owner if fence.zones else None)
        if fence == mission.fence:
            return wanted
        return self._kept(mission, wanted, f"{who}: {summary(fence)}", here)

    def _may_grow(self, mission: MissionMemory, update: MissionUpdate, here: _Vehicle) -> bool:
        """Whether an upload may put any other fence in place."""
        source = update.source
        return not here.flies or source is None or self._is_owner(source, mission.fence_owner)

    def _take(
        self,
        mission: MissionMemory,
        announcement: SafeSetAnnouncement,
        against: str,
        here: _Vehicle,
        *,
        owns: bool,
    ) -> MissionMemory:
        """An announced safe set, unless something speaks ``against`` it or it is repeated."""
        source, owner = announcement.source, mission.owner
        becomes_owner = owns and not source.is_same(owner)
        if announcement in mission.accepted and not becomes_owner:
            return mission  # in case a datagram was lost
        repeated = _is_repeated(announcement, mission.refused)
        who, safe_set = f"safe set of {source}", announcement.safe_set
        old = mission.announced
        against = against or self._outside(mission, old, safe_set, here, owns=owns)
        refused = replace(mission, refused=announcement, refused_count=mission.refused_count + 1)
        if against:
            if not repeated:
                here.texts.append(StatusText(Severity.CRITICAL, f"{who} refused: {against}"))
            return refused
        if announcement == mission.refused and here.flies:
            return refused
        others = [one for one in mission.accepted if not one.source.is_same(source)]
        wanted = replace(
            mission,
            announced=safe_set,
            silent_zones=0 if owns else mission.silent_zones,
            owner=source if owns else owner,
            accepted=(*([] if becomes_owner else others)[1 - _ACCEPTED :], announcement),
        )
        change = f"{who}: {summary(safe_set)}"
        if becomes_owner:
            change += "; it owns the safe set now"
        kept = self._kept(mission, wanted, change, here)
        return refused if kept is mission else kept

    def _against(self, mission: MissionMemory, safe_set: SafeSet) -> str:
        """Why a source that does not own the safe set may not change it so."""
        against = growth(mission.announced, safe_set) or _follows(mission.announced, safe_set)
        if not against:
            return ""
        whose = "no source owns" if mission.owner is None else f"{mission.owner} owns"
        return f"{against}, which {whose}"

    def _outside(
        self,
        mission: MissionMemory,
        old: SafeSet,
        new: SafeSet,
        here: _Vehicle,
        *,
        owns: bool = True,
    ) -> str:
        """Why the vehicle ``here`` cannot be in a ``new`` set that replaces an ``old`` one.

        Zones in force are not asked again. One that has only moved on must leave the vehicle no
        further outside than it is already; how it turns is what was measured of it.
        """
        estimate, target = here.inside, here.target
        if estimate is None or new == old:
            return ""
        # Nor where it will stand if its stamp is too far from now.
        standing, silent = self._standing(new, estimate.t_us)
        if silent:
            against = self._outside(mission, old, standing, here)
            if against:
                return against
        timeout = 1e-6 * self._config.limits.zone_timeout_us
        in_force = frozenset(mission.safe_set.zones)
        inside = self._values(new, estimate, target)
        was = self._values(old, estimate, target) if is_update(old, new) else {}
        for number, (margin, h) in inside.items():
            zone = new.zones[number]
            if zone in in_force:
                continue
            which = f"zone {number + 1} ({zone.shape.kind})"
            moves_on = number in was and is_update_of(old.zones[number], zone)
            moves_on = moves_on and margin >= was[number][0] - _LEAP
            if not margin >= (min(was[number][0] - _SAME, 0.0) if moves_on else 0.0):
                return f"the vehicle is not inside {which}, by {-margin:.2f} m"
            if not (moves_on or h >= 0.0):
                return f"the vehicle could not stop before {which}: it is {-h:.2f} m/s too fast"
            speed = norm(zone.velocity)
            if not (owns or margin >= speed * timeout):
                return (
                    f"{which} could reach the vehicle, {margin:.2f} m away at {speed:.2f} m/s, and "
                    "its source does not own the safe set"
                )
        return ""

    def _values(
        self, safe_set: SafeSet, estimate: StateEstimate, target: EndEffectorTarget | None
    ) -> dict[int, tuple[float, float]]:
        """The least margin [m] and h [m/s] of each zone, by its number; of all that there are now.

        Without a target, zones that follow it are left out.
        """
        numbers = [
            number
            for number, zone in enumerate(safe_set.zones)
            if target is not None or not kind_of(zone.shape).follows_target
        ]
        asked = safe_set
        if len(numbers) < len(safe_set.zones):
            asked = SafeSet(tuple([safe_set.zones[number] for number in numbers]))
        report, first, found = self._margins.report(asked, estimate, target), 0, {}
        for number, count in zip(numbers, report.per_zone, strict=True):
            of_zone = slice(first, first + count)
            found[number] = least(report.margins[of_zone]), least(report.barrier[of_zone])
            first += count
        return found

    def _owns(
        self, mission: MissionMemory, source: MessageSource, now_us: int, *, armed: bool
    ) -> bool:
        """Whether a source owns what is announced, or may from now on."""
        if self._is_owner(source, mission.owner):
            return True
        if armed or self._chosen not in (0, source.system):
            return False
        silent_us = now_us - mission.owner_heard_us
        return mission.owner_heard_us < 0 or silent_us >= self._config.limits.owner_timeout_us

    def _is_owner(self, source: MessageSource, owner: MessageSource | None) -> bool:
        """Whether a source is the ``owner``, or is the first one that may be.

        A chosen system narrows who may be, and vouches for nobody: anybody can write its number.
        """
        chosen = self._chosen
        if chosen not in (0, source.system):
            return False
        return owner is None or source.is_same(owner) or bool(chosen and owner.system != chosen)

    def _is_stranger(self, source: MessageSource | None, mission: MissionMemory) -> bool:
        """Whether somebody else owns what is announced."""
        if source is None or mission.owner is None:
            return False
        return not self._is_owner(source, mission.owner)

    @property
    def _chosen(self) -> int:
        return self._config.limits.safe_set_owner

    def _kept(
        self, mission: MissionMemory, wanted: MissionMemory, change: str, here: _Vehicle
    ) -> MissionMemory:
        """The memory with what is wanted; as it was where that cannot be kept in flight."""
        safe_set = joined(wanted.announced, wanted.fence)
        against: tuple[str, ...] = wanted.refusals
        if safe_set != mission.safe_set:
            findings = self.analyse(safe_set)
            against = refusals(findings)
            # Where a zone moves, there is another set ten times a second: what is known is not
            # said again.
            last = mission.refused.safe_set if mission.refused else mission.safe_set
            known = {finding.statement for finding in self.analyse(last)}
            new = [StatusText(Severity.WARNING, text) for text in against if text not in known]
            weak = [
                StatusText(Severity.INFO, text) for text in warnings(findings) if text not in known
            ]
            refused = bool(against) and not self._config.soft and here.flies
            # What is taken on the ground all the same is told by a row of the failsafe table.
            here.texts.extend((new if refused or self._config.soft else []) + weak)
            if refused:
                if new or weak:
                    text = f"safe set refused: the old one is kept; wanted: {change}"
                    here.texts.append(StatusText(Severity.WARNING, text))
                return mission
            if self._config.soft:
                against = ()
        if not is_update(mission.safe_set, safe_set) or wanted.owner != mission.owner:
            here.texts.append(StatusText(Severity.INFO, change))
        return replace(wanted, safe_set=safe_set, refused=None, refusals=against)

    def hold_silent_zones(self, mission: MissionMemory, now_us: int) -> MissionMemory:
        """Let zones stand whose announcements have stopped, where they are predicted to be then.

        What is predicted longer than that is a guess, and one that leaves the vehicle's way free. A
        time stamp that far ahead is of another clock: the zone stands where its numbers say.
        """
        standing, silent = self._standing(mission.announced, now_us)
        if not silent:
            return mission
        return replace(
            mission,
            announced=standing,
            safe_set=joined(standing, mission.fence),
            silent_zones=mission.silent_zones + silent,
        )

    def _standing(self, safe_set: SafeSet, now_us: int) -> tuple[SafeSet, int]:
        """The set with the zones standing whose stamp is too far from now, and how many there are.

        The same object where there is none.
        """
        timeout_us = self._config.limits.zone_timeout_us
        zones = safe_set.zones
        silent = [is_moving(zone) and abs(now_us - zone.t_us) >= timeout_us for zone in zones]
        if not any(silent):
            return safe_set, 0
        stood = [
            held(zone, timeout_us if now_us > zone.t_us else 0) if stops else zone
            for zone, stops in zip(zones, silent, strict=True)
        ]
        return SafeSet(tuple(stood)), sum(silent)

    def warm_up(self, estimate: StateEstimate) -> None:
        """Compile every kernel of distances and margins, before anything flies."""
        walled = SafeSet((wall((0.0, 0.0, -1.0), 0.0, 0.0),))
        surfaces(walled, estimate.p_WB, estimate.t_us)
        self._margins.report(walled, estimate, still_at(estimate.p_WB))

    def margins(
        self, kept: InflatedSafeSet, estimate: StateEstimate, target: EndEffectorTarget | None
    ) -> ConstraintReport:
        """Margins and barrier values of the vehicle in the safe set in force."""
        report = self._margins.report(kept.source, estimate, target)
        return replace(report, added=kept.added, shortfall=kept.shortfall) if kept.added else report


def _refused(mission: MissionMemory, against: str, here: _Vehicle) -> MissionMemory:
    """The memory without what was uploaded, and why."""
    here.texts.append(StatusText(Severity.CRITICAL, against))
    return replace(mission, refused_count=mission.refused_count + 1, upload_taken=False)


def _is_repeated(announcement: SafeSetAnnouncement, refused: SafeSetAnnouncement | None) -> bool:
    """Whether it is the refused one again, or where that has moved to in the meantime."""
    if refused is None or announcement.source != refused.source:
        return False
    return is_update(refused.safe_set, announcement.safe_set)


def _follows(old: SafeSet, new: SafeSet) -> str:
    """What ties the vehicle anew to where anybody sends targets, in words; empty if nothing."""
    for number, zone in enumerate(new.zones, start=1):
        if kind_of(zone.shape).follows_target and zone not in old.zones:
            return f"zone {number} ({zone.shape.kind}) would follow the target in a set"
    return ""


def _excluded(fence: SafeSet, estimate: StateEstimate) -> str:
    """Why a fence does not contain the place of a disarmed vehicle.

    No failsafe acts there, so its base is enough; arming asks for all of it.
    """
    for number, at in enumerate(surfaces(fence, estimate.p_WB, estimate.t_us)):
        if not at.distance > 0.0:
            which = f"zone {number + 1} ({fence.zones[number].shape.kind})"
            return f"the vehicle is not inside {which}, by {-at.distance:.2f} m"
    return ""


def joined(announced: SafeSet, fence: SafeSet) -> SafeSet:
    """Both safe sets at once."""
    return SafeSet(announced.zones + fence.zones)
