"""The loop in virtual time: groups in their order, and what a tick, a socket or a disk costs it."""

from __future__ import annotations

import os
import re
import threading
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any, cast

import pytest

from command_line.process import StopRequest
from fsw.autopilot.control.control_metrics import ControlMetrics
from fsw.autopilot.flight.autopilot import Autopilot
from fsw.autopilot.flight.state import first_state
from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.registry import ACCEL_RANGE
from fsw.autopilot.ports import LinkLosses, LoopHealth
from fsw.autopilot.signals import (
    CommandAck,
    CommandRequest,
    CommandResult,
    HostHealth,
    PlannerCounters,
    PlanRequest,
    SensorFrame,
    Severity,
    StatusText,
    TickInputs,
    TickOutputs,
)
from fsw.link.inbox import Inbox
from fsw.link.services.mission_store import EMPTY, Kind, MissionStore, Site, Upload
from fsw.link.vehicle_link import Pacing
from fsw.log.flight_log import FlightLog
from fsw.runtime.flight_loop import Ending, FlightLoop, FlightRecord
from fsw.runtime.planner_service import PlannerRecord
from fsw.runtime.program import FlightProgram
from fsw.runtime.rate_groups import HOUSEKEEPING, INNER, MPC, RATE_GROUPS, TELEMETRY, Member
from fsw.runtime.timing import GroupTimer
from messages import dialect, message_ids
from messages.block_file import BlockFile
from messages.frames import FrameWriter, split
from pandion.logged_ticks import LoggedTick, open_flight, ticks
from tests.fsw.link.snapshots import FACTS, outputs_at
from tests.replay.test_logged_ticks import SUBJECT
from tests.timing.virtual_time import FIRST_US, PERIOD_US, VirtualSensors, VirtualTime, frame
from tests.whole_tick import Tick, parts_of

ARM, KILL = (1.0, 0.0), (0.0, 21196.0)  # parameters of MAV_CMD_COMPONENT_ARM_DISARM


@dataclass
class Sim(VirtualSensors):
    """The simulator's end: frames in, answers out."""

    pacing: Pacing = Pacing.REALTIME
    done: list[str] = field(default_factory=list)  # shared by all parts
    answers: list[tuple[int, TickOutputs]] = field(default_factory=list)  # at, what
    notices: list[StatusText] = field(default_factory=list)
    routed_acks: list[CommandAck] = field(default_factory=list)
    routed: list[CommandRequest] = field(default_factory=list)

    def route(self, request: CommandRequest) -> None:
        """The simulator does as it is asked, and says so with a later step."""
        self.routed.append(request)
        ack = CommandAck(request.command, 0, request.source_system, request.source_component)
        self.routed_acks.append(ack)

    def newest(self) -> SensorFrame | None:
        self.done.append("sensors")
        return super().newest()

    def send_actuators(self, t_us: int, answer: TickOutputs) -> None:
        self.done.append("actuators")
        self.answers.append((self.time.now_us, answer))

    def queue_ack(self, ack: object) -> None:
        pass

    def end_after_a_second(self) -> None:
        if self.time.now_us - self.begun_us > 1_000_000:
            self.shutdown, self.delay_us = True, lambda step: None


@dataclass
class StubPlanner:
    """Takes requests."""

    done: list[str]

    def take(self, t_us: int) -> None:
        self.done.append("plan")

    def submit(self, request: PlanRequest) -> None:
        self.done.append("request")

    def close(self) -> None:
        pass


@dataclass
class Ground:
    """Takes telemetry, for as long as it likes."""

    done: list[str]
    takes: Callable[[], None]
    told: list[StatusText] = field(default_factory=list)
    acks: list[CommandAck] = field(default_factory=list)
    received: int = 0
    losses: LinkLosses = field(default_factory=LinkLosses)

    def poll(self, t_us: int) -> None:
        self.done.append("ground")

    def publish(self, outputs: TickOutputs) -> None:
        self.done.append("telemetry")
        self.told += outputs.texts
        self.takes()

    @property
    def texts(self) -> list[str]:
        return [text.text for text in self.told]

    def acknowledge(self, t_us: int, ack: CommandAck) -> None:
        self.acks.append(ack)

    def news(self) -> list[StatusText]:
        return []


class Null:
    """Every method exists and returns None."""

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *about, **more: None


class Parameters(Null):
    """Those that the loop reads; nobody changes one."""

    def __init__(self) -> None:
        self.values = {ACCEL_RANGE: 156.9}


class Log(Null):
    """Keeps what the loop says beside the ticks."""

    def __init__(self) -> None:
        self.notices: list[str] = []

    def add_notice(self, t_us: int, notice: StatusText) -> None:
        self.notices.append(notice.text)


class NoFiles(Null):
    """Nothing is written."""

    size = 0

    def __init__(self) -> None:
        self.ulog = Log()
        self.failed = ""

    def failure(self) -> str:
        return self.failed

    def room(self) -> int:
        return 10**12


class Bench:
    """A loop with everything around it replaced."""

    def __init__(self, tick: Tick, first: object = 0) -> None:
        self.time = VirtualTime()
        self.stop = StopRequest()
        self.inbox = Inbox()
        self.telemetry: Callable[[], object] = lambda: None
        self.asleep: Callable[[], None] = lambda: None
        self.sim = Sim(self.time)
        self.ground = Ground(self.sim.done, self._publish)
        self.record = FlightRecord(
            PlannerRecord(GroupTimer(100_000)), ControlMetrics(), LoopHealth()
        )
        self.files = NoFiles()
        self.told: list[tuple[int, str]] = []  # on the console
        null: Any = Null()
        self.parameters = Parameters()
        parts = parts_of(tick)
        self.missions = MissionStore(Site(lambda *place: (0.0, 0.0, 0.0), lambda: 0.1))
        stores = cast(Any, self.parameters), self.missions
        program = FlightProgram(FACTS, first, *parts, null, *stores)
        self.loop = FlightLoop(
            program, cast(Any, self.sim), cast(Any, self.ground), self.inbox, self.record,
            self.time.clock, self.stop, cast(Any, self.files), self._sleep, self.time.clock,
            lambda t_us, texts: self.told.extend((t_us, text.text) for text in texts),
        )  # fmt: skip
        self.until_us = 0

    def run(self, seconds: float) -> None:
        self.until_us = self.time.now_us + round(1e6 * seconds)
        end = self.loop.fly(frame(FIRST_US), StubPlanner(self.sim.done))
        assert end.ending is Ending.STOPPED

    def command(self, *parameters: float, number: int = 400) -> None:
        """COMPONENT_ARM_DISARM, or another command, arrives from a ground station."""
        values = (*parameters, *(0.0,) * (7 - len(parameters)), number, 1, 1, 0)
        for one in split(FrameWriter(255, 190).frame(message_ids.COMMAND_LONG, *values)):
            self.inbox.accept(one)

    def timer(self, name: str) -> GroupTimer:
        return self.record.groups[name]

    def _publish(self) -> None:
        self.telemetry()
        self.stop.requested = self.time.now_us >= self.until_us

    def _sleep(self, seconds: float) -> None:
        self.asleep()
        self.time.sleep(seconds)


def standing(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
    """Says the same on every tick, and asks for a plan on every fiftieth."""
    outputs = outputs_at(inputs.sensors.t_us)
    snapshot = replace(outputs.snapshot, counters=PlannerCounters())
    request = cast(PlanRequest, "a request") if state % 50 == 0 else None
    return state + 1, replace(outputs, shown=snapshot, plan_request=request, texts=())


def test_the_table_is_the_configuration_s_and_the_dialect_s() -> None:
    config = flight_config(body="points")
    assert (INNER.period_us, MPC.period_us) == (config.tick_period_us, config.mpc_period_us)
    for group in RATE_GROUPS:
        name = f"PANDION_RATE_GROUP_{group.name.upper()}"
        assert getattr(dialect, name) == group.number
    named = [member for group in RATE_GROUPS for member in group.members]
    assert sorted(member.name for member in named) == sorted(member.name for member in Member)


def test_groups_run_at_their_rates_and_their_members_in_order() -> None:
    bench = Bench(standing)
    bench.run(2.0)
    done = bench.sim.done
    tick = ["sensors", "plan", "actuators", "telemetry", "ground"]
    asking = ["sensors", "plan", "actuators", "request", "telemetry", "ground"]
    begun = done.index("sensors")
    second = done.index("sensors", begun + 1)
    assert done[begun:second] == tick
    ask = done.index("request", begun)
    assert done[ask - 3 : ask + 3] == asking
    ticks = bench.timer(INNER.name).ticks
    assert ticks == pytest.approx(1000, abs=2)
    assert done.count("request") == pytest.approx(ticks / 50, abs=1)
    assert bench.timer(HOUSEKEEPING.name).ticks == pytest.approx(2, abs=1)
    for group in (INNER, MPC, TELEMETRY):
        # What belongs to the interval that is on is a second long at most: it is kept one by one.
        timer = bench.timer(group.name)
        assert 0 <= timer.ticks - timer.execution.count <= 1_000_000 / group.period_us + 2
    assert (bench.timer(INNER.name).late, bench.timer(INNER.name).skipped) == (0, 0)


@pytest.mark.parametrize(("taken", "result"), [(True, 0), (False, 14), (None, 1)])
def test_who_uploaded_something_learns_what_the_tick_made_of_it(
    taken: bool | None, result: int
) -> None:
    def judging(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        state, outputs = standing(state, inputs)
        if inputs.mission is None:
            return state, outputs
        if taken is None:
            raise ZeroDivisionError
        return state, replace(outputs, upload_taken=taken)

    bench, uploads = Bench(judging), list[Upload]()
    offer = bench.missions.offer
    bench.telemetry = lambda: uploads or uploads.append(offer({Kind.RALLY: EMPTY}))
    bench.run(0.1)
    assert [upload.result for upload in uploads] == [result]


def test_a_tick_that_overruns_is_counted_and_reported_once() -> None:
    def overrunning(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        bench.time.work(2_500 if state in range(800, 3800, 50) else 100)
        return standing(state, inputs)

    bench = Bench(overrunning)
    bench.run(9.0)
    assert bench.timer(INNER.name).late == 60
    noted = [first for first, _ in bench.record.deadlines.missed]
    assert [b - a for a, b in pairwise(noted)] == [50 * PERIOD_US] * 59
    (warning,) = [text for text in bench.ground.texts if "late" in text]
    assert re.fullmatch(r"ticks: 5\d late", warning)


def test_a_telemetry_socket_that_blocks_costs_releases_but_no_answer_is_late() -> None:
    bench = Bench(standing)
    bench.telemetry = lambda: bench.time.work(5_000)
    bench.run(2.0)
    inner, telemetry = bench.timer(INNER.name), bench.timer(TELEMETRY.name)
    assert telemetry.late == telemetry.ticks
    assert inner.skipped > 250
    assert telemetry.skipped == pytest.approx(inner.skipped, abs=3), (
        "it is due on the same releases"
    )
    assert inner.execution.max_us < PERIOD_US
    assert len(bench.sim.answers) == inner.ticks
    warnings = [text for text in bench.ground.texts if "skipped" in text]
    assert len(warnings) == 1


def test_with_the_simulator_s_end_there_is_nothing_left_to_miss() -> None:
    bench = Bench(standing)
    bench.asleep = bench.sim.end_after_a_second
    bench.until_us = bench.time.now_us + 10_000_000
    end = bench.loop.fly(frame(FIRST_US), StubPlanner(bench.sim.done))
    assert end.ending is Ending.SHUTDOWN
    assert bench.timer(INNER.name).ticks == pytest.approx(500, abs=5)
    assert (bench.record.stale, bench.timer(INNER.name).skipped) == (0, 0)
    assert bench.record.deadlines.missed == []


def test_what_was_missed_in_the_last_second_is_counted() -> None:
    bench = Bench(standing)
    bench.asleep = lambda: bench.time.work(7_000) if len(bench.sim.answers) == 700 else None
    bench.run(1.8)
    assert bench.timer(INNER.name).skipped == 3


def test_readings_at_the_end_of_the_range_are_counted_as_the_parameter_says() -> None:
    """Each frame has 9.81 m/s^2; the loop looks at the parameter once a second."""
    bench = Bench(standing)
    bench.run(1.6)
    assert bench.record.health.clipped == 0
    bench = Bench(standing)
    bench.parameters.values[ACCEL_RANGE] = 9.0
    bench.run(3.1)
    assert 500 <= bench.record.health.clipped <= 1_600


@pytest.mark.requirement("REQ-LOG-1")
def test_a_log_that_fails_is_an_input_of_the_tick_within_a_second_and_once() -> None:
    told: list[tuple[int, HostHealth]] = []

    def noting(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        if inputs.host is not None:
            told.append((inputs.sensors.t_us, inputs.host))
        return standing(state, inputs)

    def fails() -> None:
        if len(bench.sim.answers) >= 700:
            bench.files.failed = "flight.ulg ends early: No space left on device"

    bench = Bench(noting)
    bench.asleep = fails
    bench.run(4.0)
    ((t_us, health),) = told
    assert health == HostHealth(log_failure="flight.ulg ends early: No space left on device")
    assert t_us - FIRST_US <= 700 * PERIOD_US + 1_100_000


def test_a_planner_that_died_is_reported_at_once_and_logged() -> None:
    bench = Bench(standing)
    bench.asleep = lambda: (
        bench.record.mpc.events.append("planner process died (-9), restarted")
        if len(bench.sim.answers) == 100
        else None
    )
    bench.run(0.5)
    assert bench.ground.texts == ["planner process died (-9), restarted"]
    assert bench.files.ulog.notices == bench.ground.texts


def test_what_the_simulator_answers_is_published_as_it_is_and_logged() -> None:
    refusal = StatusText(Severity.CRITICAL, "no fault: not on board", prompt=True)
    bench = Bench(standing)
    bench.asleep = lambda: (
        bench.sim.notices.append(refusal) if len(bench.sim.answers) == 100 else None
    )
    bench.run(0.5)
    assert bench.ground.told == [refusal]
    assert bench.files.ulog.notices == [refusal.text]


@pytest.mark.requirement("REQ-MODE-6")
@pytest.mark.parametrize("moment_us", [100, 900, 1_700])
def test_a_command_acts_on_the_actuators_within_one_tick_of_its_arrival(moment_us: int) -> None:
    bench = Bench(Autopilot(flight_config(body="points")).tick, first_state(AIRFRAME))
    bench.command(*ARM)
    arrived: list[int] = []

    def receive_between_two_ticks() -> None:
        if len(bench.sim.answers) == 200 and not arrived:
            bench.time.work(moment_us)
            bench.command(*KILL)
            arrived.append(bench.time.now_us)

    bench.asleep = receive_between_two_ticks
    bench.run(0.6)
    thrust = [(at, sum(outputs.actuators.rotor_thrust)) for at, outputs in bench.sim.answers]
    running = [at for at, total in thrust if total > 1.0]
    stopped = [at for at, total in thrust if total == 0.0]
    assert len(running) >= 199
    assert max(running) < arrived[0] < min(stopped) <= arrived[0] + PERIOD_US


def test_a_command_to_the_simulator_is_routed_once_and_its_sender_gets_the_answer() -> None:
    def tick(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        state, outputs = standing(state, inputs)
        later = CommandResult.IN_PROGRESS
        return state, replace(
            outputs, acks=tuple(CommandAck(420, later, 255, 190) for _ in inputs.commands)
        )

    bench = Bench(tick)
    bench.command(0.0, 1.0, number=420)
    bench.run(0.1)
    (routed,) = bench.sim.routed
    assert routed.params[:3] == (0.0, 1.0, 0.0)
    assert bench.ground.acks == [CommandAck(420, 0, 255, 190)]


@pytest.mark.requirement("REQ-LOG-3")
def test_a_disk_that_does_not_answer_delays_no_tick_and_loses_only_log(tmp_path: Path) -> None:
    disk_is_back, waited_in_vain = threading.Event(), threading.Event()

    def stuck(file: int, data: memoryview) -> int:
        if not waited_in_vain.is_set() and not disk_is_back.wait(5.0):
            waited_in_vain.set()
        return os.write(file, data)

    def still(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        return state, outputs_at(inputs.sensors.t_us)

    bench = Bench(still)
    log = FlightLog(tmp_path / "flight.ulg", SUBJECT)
    log.file = BlockFile(tmp_path / "stuck.ulg", stuck)
    cast(Any, bench.files).ulog = log
    bench.run(20.0)  # more than may wait
    assert not waited_in_vain.is_set(), "the loop waited for the disk"
    assert log.file.size == 0
    assert len(bench.sim.answers) == bench.timer(INNER.name).ticks == pytest.approx(10_000, abs=5)
    assert log.lost_us > 1_000_000
    disk_is_back.set()
    log.close()
    written = [tick for tick in ticks(open_flight(log.file.path)) if isinstance(tick, LoggedTick)]
    assert len(written) == bench.timer(INNER.name).ticks - log.lost_us // PERIOD_US


def test_a_clock_that_jumps_back_costs_waiting_and_repeats_no_tick() -> None:
    stamps: list[int] = []

    def noting(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        stamps.append(inputs.sensors.t_us)
        if len(stamps) == 400:
            bench.time.now_us -= 50_000  # while it works
        return standing(state, inputs)

    bench = Bench(noting)
    bench.asleep = lambda: bench.time.work(-50_000) if len(bench.sim.answers) == 700 else None
    bench.run(2.0)
    assert stamps == list(range(FIRST_US, FIRST_US + PERIOD_US * len(stamps), PERIOD_US))
    assert len(bench.sim.answers) == len(stamps) == pytest.approx(1000, abs=30)
    assert (bench.timer(INNER.name).late, bench.timer(INNER.name).skipped) == (0, 0)
    assert bench.record.deadlines.missed == []


def test_the_console_is_given_what_the_ground_is_given_once_and_with_its_time() -> None:
    def warning(state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        texts = (StatusText(Severity.WARNING, "battery low"),) if state == 300 else ()
        state, outputs = standing(state, inputs)
        return state, replace(outputs, texts=texts)

    bench = Bench(warning)
    bench.record.mpc.events.append("the planner was replaced")
    bench.run(1.0)
    assert bench.told == [
        (FIRST_US, "the planner was replaced"),
        (FIRST_US + 300 * PERIOD_US, "battery low"),
    ]
