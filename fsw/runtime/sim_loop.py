"""The loop around the pure tick: on each release every rate group that is due, in order.

The same loop flies in lockstep and in real time. What releases a tick differs (``releases.py``),
and the planner behind it (inline, or in a process of its own).
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final, Generic

from command_line.process import StopRequest
from fsw.estimation.vibration import VibrationMeter
from fsw.link.ground_links import GroundLinks
from fsw.link.inbox import Inbox
from fsw.link.sim_link import Pacing, SimLink
from fsw.link.wire.message_ids import PATH_PLANNER, SYSTEM_ID
from fsw.log.run_files import RunFiles
from fsw.ports import Clock, GroupTiming, LoopHealth, PlanService
from fsw.runtime.effort import EffortRecord
from fsw.runtime.guarded_tick import GuardedTick
from fsw.runtime.missed import MissedReleases
from fsw.runtime.planner_worker import PlannerRecord
from fsw.runtime.program import FlightProgram, State
from fsw.runtime.rate_group import RateGroupRunner
from fsw.runtime.rates import HOUSEKEEPING, INNER, MPC, RATE_GROUPS, TELEMETRY, Member
from fsw.runtime.realtime import rank_threads
from fsw.runtime.releases import GridReleases, Release, Releases, StepReleases
from fsw.runtime.silence import Silence
from fsw.runtime.slips import Slips, SlipWarning
from fsw.runtime.timing import GroupTimer, Histogram
from fsw.signals import (
    OffboardReport,
    PlannerCounters,
    SensorFrame,
    Severity,
    StatusText,
    TickInputs,
    TickOutputs,
)

STALL_S: Final = 1.2  # no step for this long ends the flight, so that 2 s see the end of both
_START_US: Final = 1_000_000  # time stamp of the simulator's step 0


class Ending(enum.Enum):
    """Why the loop ended."""

    SHUTDOWN = "shutdown"  # the simulator ended the run
    STOPPED = "stopped"  # a signal
    LINK_LOST = "link lost"  # the simulator fell silent


@dataclass(frozen=True, slots=True)
class FlightEnd:
    """How the flight ended, in one sentence."""

    ending: Ending
    sentence: str


@dataclass(slots=True)
class FlightRecord:
    """What the loop measured."""

    mpc: PlannerRecord
    effort: EffortRecord
    health: LoopHealth
    groups: dict[str, GroupTimer] = field(default_factory=dict)  # of the loop's own groups
    stages: dict[str, Histogram] = field(default_factory=dict)  # of their members
    missed: MissedReleases = field(default_factory=MissedReleases)  # of the inner loop
    begun_us: int = 0  # first release, wall time
    stale: int = 0  # ticks without a sensor frame of their own
    scheduler: str = ""  # class and priority of the tick process
    counters: PlannerCounters = field(default_factory=PlannerCounters)
    offboard: OffboardReport = field(default_factory=OffboardReport)


@dataclass(slots=True)
class Cycle:
    """One release on its way through the groups."""

    release: Release
    planner: PlanService
    inputs: TickInputs = field(init=False)  # from HEAR on
    outputs: TickOutputs = field(init=False)  # from TICK on


class SimLoop(Generic[State]):
    """Walks the table of rate groups on every release."""

    def __init__(
        self,
        program: FlightProgram[State],
        sim: SimLink,
        ground: GroundLinks,
        inbox: Inbox,
        record: FlightRecord,
        clock: Clock,
        stop: StopRequest,
        files: RunFiles,
        sleep: Callable[[float], None] | None = None,
    ) -> None:
        self._program = program
        self._tick_us = program.facts.tick_period_us
        self._parameters = program.parameters
        self._missions = program.missions
        self._tick = GuardedTick(program.tick, program.first_state)
        self._sim = sim
        self._ground = ground
        self._inbox = inbox
        self._record = record
        self._clock = clock
        self._stop = stop
        self._files = files
        self._sleep = sleep or ground.attend  # what time is left belongs to the ground
        self._warning = SlipWarning()
        self._notices: list[StatusText] = []
        self._vibration = VibrationMeter()
        self._releases: Releases
        methods: dict[Member, Callable[[Cycle], None]] = {
            Member.HEAR: self._hear,
            Member.TICK: self._think,
            Member.ACTUATE: self._actuate,
            Member.ASK: self._ask,
            Member.PUBLISH: self._publish,
            Member.RECORD: self._log,
            Member.SUM_UP: self._sum_up,
            Member.WARN: self._warn,
            Member.WATCH_FILES: lambda _: files.check(),
        }
        self._groups = tuple(
            RateGroupRunner(group, methods, clock, self._tick_us) for group in RATE_GROUPS
        )
        for runner in self._groups:
            record.groups[runner.group.name] = runner.timer
            record.stages.update({one.value: times for one, times in runner.stages.items()})

    def connect(self, wait_s: float) -> SensorFrame | None:
        """Announce the vehicle until the first step arrives; None on time-out or a signal."""
        begin = self._clock()
        announced = begin - 1_000_000
        while not self._stop.requested and self._clock() - begin < wait_s * 1e6:
            if self._clock() - announced >= 200_000:
                announced = self._clock()
                self._sim.announce()
            sensors = self._sim.wait_for_step()
            if sensors is not None:
                return sensors
        return None

    def fly(self, first: SensorFrame, planner: PlanService) -> FlightEnd:
        """Tick on every release until the simulator, a signal or silence ends it."""
        self._releases = self._make_releases(first)
        try:
            return self._tick_on(first, planner)
        finally:
            self._count_missed()

    def _tick_on(self, first: SensorFrame, planner: PlanService) -> FlightEnd:
        index, t_us = -1, first.t_us
        self._files.ulog.begin(t_us, lockstep=self._sim.pacing is Pacing.LOCKSTEP)
        rank_threads()  # now that the logs have theirs
        silence = Silence(self._clock)
        begun = self._record.begun_us = self._clock()
        release: Release | None = Release(first, 0, begun, begun)
        while not self._stop.requested:
            if release is not None:
                t_us = release.sensors.t_us
                if release.stale_us == 0:
                    silence.end(release.begun_us)
                index = self._run_groups(release, planner, index)
            elif self._sim.shutdown:
                return FlightEnd(Ending.SHUTDOWN, "the simulator ended the run")
            elif silence.grow() >= STALL_S * 1e6:
                return FlightEnd(Ending.LINK_LOST, _silence(self._step_number(t_us)))
            release = self._releases.next()
        return FlightEnd(Ending.STOPPED, f"stopped at step {self._step_number(t_us)}")

    def _make_releases(self, first: SensorFrame) -> Releases:
        if self._sim.pacing is Pacing.LOCKSTEP:
            return StepReleases(self._sim, self._clock)
        return GridReleases(
            self._sim, self._clock, self._sleep, first, self._tick_us, self._record.missed
        )

    def _run_groups(self, release: Release, planner: PlanService, before: int) -> int:
        """Run what is due; returns the release's place on the vehicle's time grid."""
        index = self._step_number(release.sensors.t_us)
        cycle = Cycle(release, planner)
        for runner in self._groups:
            if runner.group is MPC:
                due = cycle.outputs.plan_request is not None  # the tick keeps the planner's grid
            else:
                periods = index // runner.ticks - before // runner.ticks
                due = runner.ticks == 1 or periods != 0
                if periods > 1 and before >= 0 and runner.group is not INNER:
                    runner.timer.skipped += periods - 1
            if due:
                begin_us = release.begun_us if runner.group is INNER else self._clock()
                late = runner.run(cycle, release.due_us, begin_us)
                if late and runner.group is INNER:
                    self._record.missed.add(release.due_us)
        return index

    def _hear(self, cycle: Cycle) -> None:
        sensors = cycle.release.sensors
        t_us = sensors.t_us
        self._vibration.add(sensors.gyro_B, sensors.accel_B)
        inbox = self._inbox
        cycle.inputs = inbox.take_inputs(
            sensors,
            cycle.planner.take(t_us),
            self._parameters.take_tuning(),
            self._missions.take_update(),
            cycle.release.stale_us,
        )

    def _think(self, cycle: Cycle) -> None:
        cycle.outputs = self._tick(cycle.inputs)
        self._missions.observe(cycle.outputs.snapshot)
        if cycle.inputs.tuning is not None:
            self._parameters.settle(cycle.outputs.tuning_taken)

    def _actuate(self, cycle: Cycle) -> None:
        t_us, outputs = cycle.release.sensors.t_us, cycle.outputs
        for ack in outputs.acks:
            if (ack.target_system, ack.target_component) == (SYSTEM_ID, PATH_PLANNER):
                self._sim.queue_ack(ack)
            else:
                self._ground.acknowledge(t_us, ack)
        self._sim.send_actuators(t_us, outputs)

    def _ask(self, cycle: Cycle) -> None:
        request, applied = cycle.outputs.plan_request, cycle.outputs.snapshot.plan_input
        if request is not None:
            cycle.planner.submit(request)
        if applied is not None:
            self._record.effort.add(applied)

    def _publish(self, cycle: Cycle) -> None:
        record, outputs = self._record, cycle.outputs
        record.counters = outputs.snapshot.counters
        record.offboard = outputs.snapshot.offboard
        events = record.mpc.events
        if events:
            self._notices += [StatusText(Severity.WARNING, event) for event in events]
            events.clear()
        if self._notices:
            outputs = replace(outputs, texts=(*outputs.texts, *self._notices))
        self._ground.publish(outputs)
        # In lockstep: what is heard now is in the next tick, and nobody waits while it is read.
        self._ground.poll(cycle.release.sensors.t_us)

    def _log(self, cycle: Cycle) -> None:
        self._files.ulog.add(cycle.inputs, cycle.outputs)
        for notice in self._notices:
            self._files.ulog.add_notice(cycle.release.sensors.t_us, notice)
        self._notices.clear()

    def _sum_up(self, cycle: Cycle) -> None:
        record, health = self._record, self._record.health
        self._count_missed()
        health.vibration = self._vibration.metrics
        health.inner = record.groups[INNER.name].close_interval()
        health.mpc = record.mpc.timer.close_interval()
        health.telemetry = record.groups[TELEMETRY.name].close_interval()
        health.housekeeping = record.groups[HOUSEKEEPING.name].close_interval()
        timings = (health.inner, health.mpc, health.telemetry, health.housekeeping)
        for group, timing in zip((INNER, MPC, TELEMETRY, HOUSEKEEPING), timings, strict=True):
            values = _timing_values(timing)
            self._files.ulog.add_timing(cycle.release.sensors.t_us, group.number, *values)

    def _count_missed(self) -> None:
        self._record.stale = self._releases.stale
        self._record.groups[INNER.name].skipped = self._releases.skipped

    def _warn(self, cycle: Cycle) -> None:
        if self._sim.pacing is Pacing.LOCKSTEP:
            return  # the clock on the wall is nobody's deadline
        inner, counters = self._record.groups[INNER.name], self._record.counters
        slips = Slips(inner.late, inner.skipped, self._record.stale, counters.missed_deadlines)
        sentence = self._warning.sentence(slips, cycle.release.sensors.t_us)
        if sentence is not None:
            self._notices.append(StatusText(Severity.WARNING, sentence))

    def _step_number(self, t_us: int) -> int:
        return (t_us - _START_US) // self._tick_us


def _timing_values(timing: GroupTiming) -> tuple[tuple[int, int, int, int], tuple[float, ...]]:
    """Counts and times in the order of the log's loop_timing."""
    counts = (timing.ticks, timing.late_ticks, timing.skipped_ticks, timing.period_us)
    times = (
        timing.execution_p50_us,
        timing.execution_p99_us,
        timing.execution_max_us,
        timing.lateness_p50_us,
        timing.lateness_p99_us,
        timing.lateness_max_us,
    )
    return counts, times


def _silence(step: int) -> str:
    return f"the simulator sent nothing for {STALL_S:g} s after step {step}"
