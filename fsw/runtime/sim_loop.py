"""The loop around the pure tick: a step of the simulator releases one tick.

The same loop flies in lockstep and in real time; the planner behind it differs (inline or in a
thread), and in real time the lateness of each tick is measured against the simulator's grid.
"""

from __future__ import annotations

import enum
from dataclasses import dataclass, field
from typing import Final, Generic

from fsw.link.gcs_link import GcsLink
from fsw.link.inbox import Inbox
from fsw.link.message_ids import PATH_PLANNER, SYSTEM_ID
from fsw.link.sim_link import Pacing, SimLink
from fsw.link.telemetry import LoopHealth
from fsw.ports import Clock, PlanService
from fsw.runtime.effort import EffortRecord
from fsw.runtime.guarded_tick import GuardedTick
from fsw.runtime.planner_worker import PlannerRecord
from fsw.runtime.process import StopRequest
from fsw.runtime.program import FlightProgram, State
from fsw.runtime.timing import GroupTimer
from fsw.signals import PlannerCounters, SensorFrame, TickInputs, TickOutputs

STALL_S: Final = 2.0  # no step for this long ends the flight
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

    inner: GroupTimer
    mpc: PlannerRecord
    effort: EffortRecord
    health: LoopHealth
    counters: PlannerCounters = field(default_factory=PlannerCounters)


class SimLoop(Generic[State]):
    """Receive, tick, answer; only then plan, count and tell the ground."""

    def __init__(
        self,
        program: FlightProgram[State],
        sim: SimLink,
        gcs: GcsLink,
        inbox: Inbox,
        record: FlightRecord,
        clock: Clock,
        stop: StopRequest,
    ) -> None:
        self._program = program
        self._tick = GuardedTick(program.tick, program.first_state)
        self._sim = sim
        self._gcs = gcs
        self._inbox = inbox
        self._record = record
        self._clock = clock
        self._stop = stop
        self._ticks = 0
        self._interval = round(1e6 / program.facts.tick_period_us)
        self._plan_interval = program.facts.mpc_period_us // program.facts.tick_period_us
        self._offset_us: int | None = None  # smallest wall minus sensor time seen

    def connect(self, wait_s: float) -> SensorFrame | None:
        """Announce the vehicle until the first step arrives; None on time-out or a signal."""
        begin = self._clock()
        announced = begin - 1_000_000
        while not self._stop.requested and self._clock() - begin < wait_s * 1e6:
            if self._clock() - announced >= 200_000:
                announced = self._clock()
                self._sim.announce()
            sensors = self._sim.receive()
            if sensors is not None:
                return sensors
        return None

    def fly(self, first: SensorFrame, planner: PlanService) -> FlightEnd:
        """Tick on every step until the simulator, a signal or silence ends it."""
        realtime = self._sim.pacing is not Pacing.LOCKSTEP
        sensors: SensorFrame | None = first
        heard = self._clock()
        t_us = first.t_us
        while not self._stop.requested:
            if sensors is not None:
                heard = self._clock()
                t_us = sensors.t_us
                self._step(sensors, planner, heard, self._lateness_us(heard, t_us, realtime))
            elif self._sim.shutdown:
                return FlightEnd(Ending.SHUTDOWN, "the simulator ended the run")
            elif self._clock() - heard > STALL_S * 1e6:
                return FlightEnd(Ending.LINK_LOST, _silence(self._step_number(t_us)))
            sensors = self._sim.receive()
        return FlightEnd(Ending.STOPPED, f"stopped at step {self._step_number(t_us)}")

    def _step(
        self, sensors: SensorFrame, planner: PlanService, begin_us: int, lateness_us: int
    ) -> None:
        t_us = sensors.t_us
        self._gcs.poll(t_us)
        inbox = self._inbox
        inputs = TickInputs(
            sensors,
            planner.take(t_us),
            inbox.take_commands(),
            inbox.take_targets(),
            inbox.take_safe_set(),
        )
        outputs = self._tick(inputs)
        if outputs.acks:
            self._acknowledge(t_us, outputs)
        self._sim.answer(t_us, outputs)
        self._record.inner.add(self._clock() - begin_us, lateness_us)
        # The simulator is at work on the next step by now: everything else happens meanwhile.
        if outputs.plan_request is not None:
            planner.submit(outputs.plan_request)
        self._count(outputs)
        self._gcs.publish(outputs)

    def _acknowledge(self, t_us: int, outputs: TickOutputs) -> None:
        for ack in outputs.acks:
            if (ack.target_system, ack.target_component) == (SYSTEM_ID, PATH_PLANNER):
                self._sim.queue_ack(ack)
            else:
                self._gcs.acknowledge(t_us, ack)

    def _count(self, outputs: TickOutputs) -> None:
        record = self._record
        record.counters = outputs.snapshot.counters
        if self._ticks % self._plan_interval == 0 and outputs.snapshot.plan_input is not None:
            record.effort.add(outputs.snapshot.plan_input)
        self._ticks += 1
        if self._ticks % self._interval == 0:
            record.inner.skipped = self._sim.skipped
            record.health.inner = record.inner.close_interval()
            record.health.mpc = record.mpc.timer.close_interval()

    def _lateness_us(self, now_us: int, t_us: int, realtime: bool) -> int:
        """How long after its release a step is taken up; the promptest step so far defines 0.

        The first step does not count: the simulator's clock starts when it has been answered.
        """
        if not realtime or self._ticks == 0:
            return 0
        offset = now_us - t_us
        if self._offset_us is None or offset < self._offset_us:
            self._offset_us = offset
        return offset - self._offset_us

    def _step_number(self, t_us: int) -> int:
        return (t_us - _START_US) // self._program.facts.tick_period_us


def _silence(step: int) -> str:
    return f"the simulator sent nothing for {STALL_S:g} s after step {step}"
