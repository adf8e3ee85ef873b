"""The loop around the pure tick: on each release every rate group that is due, in order.

The same loop flies in lockstep and in real time. What releases a tick differs (``releases.py``),
and the planner behind it (inline, or in a process of its own).
"""

from __future__ import annotations

import enum
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Final

from command_line.process import StopRequest
from fsw.autopilot.control.control_metrics import ControlMetrics
from fsw.autopilot.estimation.vibration import VibrationMeter
from fsw.autopilot.parameters.registry import ACCEL_RANGE
from fsw.autopilot.ports import Clock, LoopHealth, PlanService
from fsw.autopilot.signals import (
    VEHICLE_PILOT,
    Command,
    CommandAck,
    CommandRequest,
    CommandResult,
    FlightSnapshot,
    HostHealth,
    InjectFailure,
    SensorFrame,
    Severity,
    StatusText,
    TickInputs,
    TickOutputs,
)
from fsw.link.ground_links import GroundLinks
from fsw.link.inbox import Inbox
from fsw.link.vehicle_link import Pacing, VehicleLink
from fsw.log.flight_log import RunFiles
from fsw.runtime.clock import unix_us
from fsw.runtime.host_watch import HostWatch
from fsw.runtime.planner_service import PlannerRecord
from fsw.runtime.process import rank_threads
from fsw.runtime.program import FlightProgram, TickRunner
from fsw.runtime.rate_groups import INNER, MPC, RATE_GROUPS, Member, RateGroupRunner
from fsw.runtime.releases import DeadlineMonitor, Release, ScheduledReleases, StepReleases
from fsw.runtime.timing import GroupTimer, Histogram

LINK_TIMEOUT_S: Final = 1.2  # silence that ends the flight; both processes end within 2 s
START_US: Final = 1_000_000  # time stamp of the simulator's step 0
# A release waits for less; longer gaps mean this process was suspended. After a suspension of the
# whole machine the simulator goes on as well, so such a gap must not end the flight.
_LONGEST_GAP_US: Final = 250_000


def to_route(commands: tuple[Command, ...], acks: tuple[CommandAck, ...]) -> list[CommandRequest]:
    """Commands that go on to the simulator, whose acknowledgement their senders get.

    A tick answers each of its commands in their order. The simulator gets the numbers that were
    understood: MAVLink leaves a parameter out as NaN.
    """
    return [
        replace(
            command.request,
            params=(float(asked.unit), float(asked.kind), float(asked.instance), *(0.0,) * 4),
        )
        for command, ack in zip(commands, acks, strict=False)
        if isinstance(asked := command.action, InjectFailure)
        and ack.result == CommandResult.IN_PROGRESS
    ]


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
    control: ControlMetrics = field(default_factory=ControlMetrics)
    health: LoopHealth = field(default_factory=LoopHealth)
    groups: dict[str, GroupTimer] = field(default_factory=dict)  # of the loop's own groups
    stages: dict[str, Histogram] = field(default_factory=dict)  # of their members
    deadlines: DeadlineMonitor = field(default_factory=DeadlineMonitor)  # of the inner loop
    begun_us: int = 0  # first release, monotonic
    stale: int = 0  # ticks without a sensor frame of their own
    scheduler: str = ""  # class and priority of the tick process
    snapshot: FlightSnapshot | None = None  # of the last tick


@dataclass(slots=True)
class Cycle:
    """One release on its way through the groups."""

    release: Release
    planner: PlanService
    inputs: TickInputs = field(init=False)  # from RECEIVE on
    outputs: TickOutputs = field(init=False)  # from TICK on; whole from CONCLUDE on


class LinkWatchdog:
    """How long the simulator has been silent: the time between checks without a frame."""

    def __init__(self, clock: Clock) -> None:
        self._clock = clock
        self._checked_us = clock()
        self._silent_us = 0

    def reset(self, now_us: int) -> None:
        """Start again: a frame arrived at ``now_us`` [us, monotonic]."""
        self._checked_us, self._silent_us = now_us, 0

    def check(self) -> int:
        """Time without a frame up to now [us]; a gap between checks counts 0.25 s at most."""
        now_us = self._clock()
        self._silent_us += min(now_us - self._checked_us, _LONGEST_GAP_US)
        self._checked_us = now_us
        return self._silent_us


@dataclass
class FlightLoop:
    """Walks the table of rate groups on every release."""

    _program: FlightProgram
    _vehicle: VehicleLink
    _ground: GroundLinks
    _inbox: Inbox
    _record: FlightRecord
    _clock: Clock
    _stop: StopRequest
    _files: RunFiles
    sleep: Callable[[float], None] | None = None  # None: spare time reads the ground links
    wall_clock: Clock = unix_us
    # Given the time [us] and the texts of every tick, for the console.
    tell: Callable[[int, tuple[StatusText, ...]], None] = lambda t_us, texts: None

    def __post_init__(self) -> None:
        program, record, clock = self._program, self._record, self._clock
        self._tick_us = program.facts.tick_period_us
        self._parameters, self._missions = program.parameters, program.missions
        self._tick = TickRunner(program.control, program.conclude, program.first_state)
        self._notices: list[StatusText] = []
        self._host = HostWatch(self._files, self._ground, clock, self.wall_clock)
        self._host_news: HostHealth | None = None  # for the next tick
        self._vibration = VibrationMeter(program.parameters.values[ACCEL_RANGE])
        self._releases: StepReleases | ScheduledReleases
        methods: dict[Member, Callable[[Cycle], None]] = {
            Member.RECEIVE: self._receive,
            Member.TICK: self._control,
            Member.ACTUATE: self._actuate,
            Member.CONCLUDE: self._conclude,
            Member.PLAN: self._request_plan,
            Member.PUBLISH: self._publish,
            Member.LOG: self._log,
            Member.SUMMARISE: self._summarise,
            Member.WARN: self._warn,
            Member.CHECK_FILES: self._check_host,
        }
        runners = {group: RateGroupRunner(group, methods, clock) for group in RATE_GROUPS}
        for group, runner in runners.items():
            record.groups[group.name] = runner.timer
            record.stages.update({one.value: times for one, times in runner.stages.items()})
        self._inner, self._planning = runners[INNER], runners[MPC]
        self._others = tuple(  # with their period in ticks
            (runner, group.period_us // self._tick_us)
            for group, runner in runners.items()
            if group is not INNER
        )

    def connect(self, wait_s: float) -> SensorFrame | None:
        """Announce the vehicle until the first step; None after ``wait_s`` [s] or on a signal."""
        begin = self._clock()
        announced = begin - 1_000_000
        while not self._stop.requested and self._clock() - begin < wait_s * 1e6:
            if self._clock() - announced >= 200_000:
                announced = self._clock()
                self._vehicle.announce()
            sensors = self._vehicle.wait_for_step()
            if sensors is not None:
                return sensors
        return None

    def fly(self, first: SensorFrame, planner: PlanService) -> FlightEnd:
        """Tick on every release until the simulator, a signal or silence ends it."""
        if self._vehicle.pacing is Pacing.LOCKSTEP:
            self._releases = StepReleases(self._vehicle, self._clock)
        else:
            self._releases = ScheduledReleases(
                self._vehicle,
                self._clock,
                self.sleep or self._ground.attend,
                first,
                self._tick_us,
                self._record.deadlines,
            )
        try:
            return self._tick_until_end(first, planner)
        finally:
            self._count_missed()

    def _tick_until_end(self, first: SensorFrame, planner: PlanService) -> FlightEnd:
        index, t_us = -1, first.t_us
        self._files.ulog.begin(t_us, lockstep=self._vehicle.pacing is Pacing.LOCKSTEP)
        rank_threads()  # the logs have started theirs
        watchdog = LinkWatchdog(self._clock)
        begun = self._record.begun_us = self._clock()
        release: Release | None = Release(first, 0, begun, begun)
        while not self._stop.requested:
            if release is not None:
                t_us = release.sensors.t_us
                if release.stale_us == 0:
                    watchdog.reset(release.begun_us)
                index = self._run_groups(release, planner, index)
            elif self._vehicle.shutdown:
                return FlightEnd(Ending.SHUTDOWN, "the simulator ended the run")
            elif watchdog.check() >= LINK_TIMEOUT_S * 1e6:
                silence = f"the simulator sent nothing for {LINK_TIMEOUT_S:g} s"
                return FlightEnd(
                    Ending.LINK_LOST, f"{silence} after step {self._step_number(t_us)}"
                )
            release = self._releases.next()
        return FlightEnd(Ending.STOPPED, f"stopped at step {self._step_number(t_us)}")

    def _run_groups(self, release: Release, planner: PlanService, before: int) -> int:
        """Run what is due; returns the release's place on the vehicle's time grid."""
        index = self._step_number(release.sensors.t_us)
        cycle = Cycle(release, planner)
        due_us = release.due_us
        now_us = self._inner.run(cycle, due_us, release.begun_us)
        if now_us - due_us > self._inner.group.period_us:
            self._record.deadlines.add(due_us)
        for runner, ticks in self._others:
            if runner is self._planning:
                if cycle.outputs.plan_request is None:  # the tick keeps the planner's grid
                    continue
            else:
                periods = index // ticks - before // ticks
                if periods > 1 and before >= 0:
                    runner.timer.skipped += periods - 1
                if ticks > 1 and periods == 0:
                    continue
            now_us = runner.run(cycle, due_us, now_us)
        return index

    def _receive(self, cycle: Cycle) -> None:
        sensors = cycle.release.sensors
        cycle.inputs = self._inbox.take_inputs(
            sensors,
            cycle.planner.take(sensors.t_us),
            self._parameters.take_tuning(),
            self._missions.take_update(),
            cycle.release.stale_us,
            self._host_news,
        )
        self._host_news = None

    def _control(self, cycle: Cycle) -> None:
        cycle.outputs = self._tick.control(cycle.inputs)

    def _actuate(self, cycle: Cycle) -> None:
        t_us, outputs = cycle.release.sensors.t_us, cycle.outputs
        if self._vehicle.routed_acks:
            for ack in self._vehicle.routed_acks:
                self._ground.acknowledge(t_us, ack)
            self._vehicle.routed_acks.clear()
        if outputs.acks:
            self._acknowledge(t_us, cycle.inputs.commands, outputs.acks)
        self._vehicle.send_actuators(t_us, outputs)

    def _acknowledge(
        self, t_us: int, commands: tuple[Command, ...], acks: tuple[CommandAck, ...]
    ) -> None:
        for request in to_route(commands, acks):
            self._vehicle.route(request)
        for ack in acks:
            if ack.result == CommandResult.IN_PROGRESS:
                continue
            if (ack.target_system, ack.target_component) == VEHICLE_PILOT:
                self._vehicle.queue_ack(ack)
            else:
                self._ground.acknowledge(t_us, ack)

    def _conclude(self, cycle: Cycle) -> None:
        sent, outputs = cycle.outputs.texts, self._tick.conclude()
        cycle.outputs = outputs
        self._vibration.add(cycle.release.sensors.gyro_B, cycle.release.sensors.accel_B)
        if outputs.texts is not sent:
            self._vehicle.queue_texts(outputs.texts[len(sent) :])
        self._missions.observe(outputs.snapshot)
        self._inbox.owner = outputs.snapshot.safe_set_owner
        self._program.events.observe(cycle.inputs, outputs)
        if cycle.inputs.tuning is not None:
            self._parameters.settle(outputs.tuning_taken)
        if cycle.inputs.mission is not None:
            self._missions.settle(outputs.upload_taken)

    def _request_plan(self, cycle: Cycle) -> None:
        request, applied = cycle.outputs.plan_request, cycle.outputs.snapshot.plan_input
        if request is not None:
            cycle.planner.submit(request)
        if applied is not None:
            self._record.control.add(applied)

    def _publish(self, cycle: Cycle) -> None:
        record, outputs = self._record, cycle.outputs
        record.snapshot = outputs.snapshot
        events = record.mpc.events
        if events:
            self._notices += [StatusText(Severity.WARNING, event) for event in events]
            events.clear()
        if self._vehicle.notices:
            self._notices += self._vehicle.notices
            self._vehicle.notices.clear()
        if self._notices:
            outputs = replace(outputs, texts=(*outputs.texts, *self._notices))
        self._ground.publish(outputs)
        self.tell(cycle.release.sensors.t_us, outputs.texts)
        # Lockstep has no other time for it; what is read now is in the next tick.
        self._ground.poll(cycle.release.sensors.t_us)

    def _log(self, cycle: Cycle) -> None:
        self._files.ulog.add(cycle.inputs, cycle.outputs)
        for notice in self._notices:
            self._files.ulog.add_notice(cycle.release.sensors.t_us, notice)
        self._notices.clear()

    def _summarise(self, cycle: Cycle) -> None:
        record = self._record
        self._count_missed()
        record.health.vibration = self._vibration.metrics
        record.health.clipped = self._vibration.clipped
        record.health.losses = self._ground.losses
        self._notices += self._ground.news()
        self._vibration.accel_range = self._parameters.values[ACCEL_RANGE]
        for group in RATE_GROUPS:
            timing = record.groups[group.name].close_interval()
            if group is MPC:
                # Its cycles are of interest, not the time that a request takes to send.
                timing = record.mpc.timer.close_interval()
            setattr(record.health, group.name, timing)
            self._files.ulog.add_timing(cycle.release.sensors.t_us, group.number, timing)

    def _count_missed(self) -> None:
        self._record.stale = self._releases.stale
        self._record.groups[INNER.name].skipped = self._releases.skipped

    def _warn(self, cycle: Cycle) -> None:
        if self._vehicle.pacing is Pacing.LOCKSTEP:
            return  # there are no deadlines
        inner = self._record.groups[INNER.name]
        sentence = self._record.deadlines.warning(
            cycle.release.sensors.t_us,
            late=inner.late,
            skipped=inner.skipped,
            stale=self._record.stale,
            plans_late=cycle.outputs.snapshot.counters.missed_deadlines,
        )
        if sentence is not None:
            self._notices.append(StatusText(Severity.WARNING, sentence))

    def _check_host(self, _: Cycle) -> None:
        """The files, and what else the next tick should know about the machine."""
        self._files.check()
        inner, missed = self._record.groups[INNER.name], 0
        if self._vehicle.pacing is not Pacing.LOCKSTEP:  # which has no deadlines
            missed = inner.late + inner.skipped + self._record.stale
        self._host_news = self._host.look(missed)

    def _step_number(self, t_us: int) -> int:
        return (t_us - START_US) // self._tick_us
