"""Which safe set is in force: the announced one and the fence together, if they can be kept."""

from __future__ import annotations

from dataclasses import replace

from fsw.barriers.margins import Margins
from fsw.flight.state import MissionMemory
from fsw.model.body import body_of
from fsw.mpc.reference import still_at
from fsw.parameters.consistency import Finding, analyse, loop_tube, refusals, warnings
from fsw.parameters.flight_config import FlightConfig
from fsw.shapes.half_space import wall
from fsw.shapes.zones import surfaces
from fsw.signals import (
    ConstraintReport,
    EndEffectorTarget,
    MissionUpdate,
    SafeSet,
    Severity,
    StateEstimate,
    StatusText,
)


class SafeSetCheck:
    """Analyses a safe set for one configuration before it is in force."""

    def __init__(self, config: FlightConfig) -> None:
        self._config = config
        self._loop_tube = loop_tube(config)
        planner, airframe = config.planner, config.airframe
        body = body_of(planner.body, airframe)
        links = airframe.link_length
        self._margins = Margins(body, links, planner.tunings, planner.period)

    def analyse(self, safe_set: SafeSet) -> tuple[Finding, ...]:
        """Findings on whether this configuration can keep a safe set."""
        return analyse(self._config, safe_set, self._loop_tube)

    def update(
        self,
        mission: MissionMemory,
        update: MissionUpdate | None,
        announced: SafeSet | None,
        texts: list[StatusText],
        *,
        flies: bool,
    ) -> MissionMemory:
        """Take in what was uploaded and announced; in flight only what can be kept."""
        wanted = _together(mission, update, announced)
        if wanted.safe_set == mission.safe_set:
            return wanted
        if wanted.safe_set == mission.refused_set:
            return replace(mission, rally=wanted.rally)
        findings = self.analyse(wanted.safe_set)
        against = refusals(findings)
        # Where a zone moves, there is another set ten times a second: what is known is not said.
        known = {
            finding.statement for finding in self.analyse(mission.refused_set or mission.safe_set)
        }
        new = [StatusText(Severity.WARNING, text) for text in against if text not in known]
        new += [StatusText(Severity.INFO, text) for text in warnings(findings) if text not in known]
        texts += new
        if against and not self._config.soft and flies:
            if new:
                texts.append(StatusText(Severity.WARNING, "safe set refused: the old one is kept"))
            return replace(mission, rally=wanted.rally, refused_set=wanted.safe_set)
        return replace(wanted, refused_set=None, refusals=() if self._config.soft else against)

    def warm_up(self, estimate: StateEstimate) -> None:
        """Compile every kernel of distances and margins, before anything flies."""
        walled = SafeSet((wall((0.0, 0.0, -1.0), 0.0, 0.0),))
        surfaces(walled, estimate.p_WB, estimate.t_us)
        self.margins(walled, estimate, still_at(estimate.p_WB))

    def margins(
        self, safe_set: SafeSet, estimate: StateEstimate, target: EndEffectorTarget
    ) -> ConstraintReport:
        """Margins and barrier values of the vehicle in the safe set."""
        return self._margins.report(safe_set, estimate, target)


def _together(
    memory: MissionMemory, update: MissionUpdate | None, announced: SafeSet | None
) -> MissionMemory:
    """The memory with the safe set of what was uploaded and announced."""
    if announced is not None:
        memory = replace(memory, announced=announced)
    if update is not None:
        if update.fence is not None:
            memory = replace(memory, fence=update.fence)
        if update.rally is not None:
            memory = replace(memory, rally=update.rally)
    safe_set = joined(memory.announced, memory.fence)
    return memory if safe_set == memory.safe_set else replace(memory, safe_set=safe_set)


def joined(announced: SafeSet, fence: SafeSet) -> SafeSet:
    """Both safe sets at once."""
    return SafeSet(announced.zones + fence.zones)
