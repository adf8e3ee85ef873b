"""Builds the flight software and flies it: the only place that makes objects."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Final

from command_line.output import json_text, try_write
from command_line.process import (
    NOT_COMPLETED,
    CouldNotStart,
    Events,
    StopRequest,
    events_of,
    run_reported,
)
from command_line.revision import revision
from command_line.run_directory import run_directory
from fsw.arguments import FswOptions
from fsw.autopilot.ports import PlanningCycle
from fsw.autopilot.tuning import Tuning
from fsw.link.endpoints import LinkError, parse_address
from fsw.link.events import EventService
from fsw.link.files.ftp_service import FtpService
from fsw.link.files.log_service import LogService
from fsw.link.files.log_stream import LogStreamService
from fsw.link.files.vehicle_files import FlightLogs, vehicle_files
from fsw.link.ground_links import build_links
from fsw.link.inbox import Inbox
from fsw.link.link_choice import AUTOPILOTS, addresses
from fsw.link.px4.link import Px4Link, open_px4, px4_addresses
from fsw.link.services.mission_service import MissionService
from fsw.link.services.service import LinkService
from fsw.link.sim_link import SimLink
from fsw.link.vehicle_link import Pacing, VehicleLink
from fsw.link.wire.outgoing import TelemetryContext
from fsw.log.flight_log import LogSubject, RunFiles, vehicle_facts
from fsw.runtime import clock, report
from fsw.runtime.console import Console
from fsw.runtime.flight_loop import START_US, Ending, FlightEnd, FlightLoop, FlightRecord
from fsw.runtime.planner_service import InlinePlanner, PlannerRecord, ProcessPlanner
from fsw.runtime.process import (
    TICK_PRIORITY,
    claim_real_time,
    in_a_child,
    release_real_time,
    scheduler,
    settle_memory,
)
from fsw.runtime.program import FlightProgram
from fsw.runtime.timing import GroupTimer

if TYPE_CHECKING:
    from fsw.storage.parameter_file import ParameterFile

DONE: Final = 0  # exit code

ProgramLoader = Callable[[FswOptions], FlightProgram]


def run(options: FswOptions, load: ProgramLoader | None = None) -> int:
    """Fly once, the flight software proper or what ``load`` makes; returns the exit code."""
    events = events_of(options.events)
    session = _Session(options, events, load or partial(load_flight_software, events=events))
    return run_reported("fsw", events, (LinkError,), session.run)


@dataclass
class _Session:
    _options: FswOptions
    _events: Events
    _load: ProgramLoader
    _stop: StopRequest = field(default_factory=StopRequest)

    def run(self) -> int:
        options = self._options
        chosen = options.ground
        # What is no address is refused before a minute of compiling.
        simulator, px4 = parse_address(options.sim), options.autopilot_link
        where = None if px4 is None else px4_addresses(px4, options.arm_link)
        addresses(chosen)
        directory = _output_directory(options.out)
        self._events.report("preparing", "fsw: preparing")
        keeping = self._kept_parameters(directory)  # what is of no use, as well
        program = self._load(options)
        facts = program.facts
        record = FlightRecord(PlannerRecord(GroupTimer(facts.mpc_period_us)))
        self._restore_parameters(keeping, program)
        # Early: a process forked now shares what was compiled, and no thread, port or log.
        settle_memory()
        planner = ProcessPlanner(program.planner, clock.now_us, record.mpc)
        keeping.start()
        inbox = Inbox(chosen.origin)
        start_us = clock.unix_us()
        files = self._files(directory, start_us, program)
        vehicle: VehicleLink = (
            SimLink(simulator, inbox, facts, clock.now_us)
            if where is None
            else open_px4(where, inbox, facts, clock.now_us, servos=options.arm_servos)
        )
        context = TelemetryContext(
            facts,
            record.health,
            AUTOPILOTS[chosen.autopilot],
            chosen.origin,
            start_unix_us=start_us,
            plan_ids=program.missions.ids,
        )
        logs = FlightLogs(directory, options.params)
        ground = build_links(
            chosen,
            inbox,
            context,
            (clock.now_us, clock.unix_us),
            files.tlog.add,
            lambda: self._services(program, logs),
            beside=options.above_px4,
        )
        # For a view beside it: the usual port may have been taken.
        ports = {link.name: link.port for link in ground.links if link.port is not None}
        self._events.report("links", "", ports=ports)
        console = Console(self._events, START_US)
        loop = FlightLoop(
            *(program, vehicle, ground, inbox, record, clock.now_us, self._stop, files),
            tell=console.observe,
        )
        try:
            end = self._fly(loop, vehicle, program.planner, planner, record)
        finally:
            for part in (planner, vehicle, ground, files, keeping, console):
                part.close()
        result = report.as_json(options.flown, facts, end, record)
        if isinstance(vehicle, Px4Link):
            result["px4"] = vehicle.as_json()
        result["retransmissions"] = vehicle.retransmissions
        result["inbox_refused"] = inbox.refused
        result["links"] = {link.name: link.as_json() for link in ground.links}
        result["files"] = files.as_json()
        lost = files.lost + try_write(directory / "fsw.json", json_text(result, 2) + "\n")
        sentence = f"fsw: {end.sentence}"
        self._events.report("ended", sentence, ending=end.ending.value, result=result)
        for what in lost:
            self._events.report("unwritten", f"fsw: cannot write {what}", what=what)
        return DONE if end.ending is Ending.SHUTDOWN and not lost else NOT_COMPLETED

    def _files(self, directory: Path, start_us: int, program: FlightProgram) -> RunFiles:
        """Create the logs; ``CouldNotStart`` where they cannot be."""
        try:
            return RunFiles(directory, start_us, _subject(self._options, program), self._warn)
        except OSError as error:
            raise CouldNotStart(f"cannot write {error.filename}: {error.strerror}") from None

    def _warn(self, sentence: str) -> None:
        self._events.report("warning", f"fsw: {sentence}")

    def _services(self, program: FlightProgram, logs: FlightLogs) -> tuple[LinkService, ...]:
        """What one link serves; called once a link."""
        # Its table of parameters knows all that flies, as the program does.
        from fsw.link.services.parameter_service import ParameterService

        return (
            ParameterService(program.parameters),
            MissionService(program.missions),
            EventService(program.events),
            LogService(logs),
            LogStreamService(logs),
            FtpService(vehicle_files(logs)),
        )

    def _kept_parameters(self, directory: Path) -> ParameterFile:
        """Read the parameters of the vehicle's file, and say what of it is of no use.

        ``CouldNotStart`` where the file cannot be read or written, or contradicts itself.
        """
        # Imported here because they take a second, which the other refusals need not wait.
        from fsw.runtime.assembly import configured
        from fsw.storage.parameter_file import ParameterFile

        path, record = self._options.params, directory / "parameters.params"
        try:
            config = configured(self._options.flown)
        except ValueError as error:
            raise CouldNotStart(str(error)) from None
        with _refused(path or directory):
            keeping = ParameterFile(path, record, config)
        for complaint in keeping.complaints:
            self._events.report("warning", f"fsw: {path}, {complaint}")
        return keeping

    def _restore_parameters(self, keeping: ParameterFile, program: FlightProgram) -> None:
        """Let the program take them over.

        ``CouldNotStart`` where they cannot be written, or no flight loop be designed with them.
        """
        path = self._options.params
        with _refused(path or keeping.record):
            keeping.restore(program.parameters)
        if path is not None:
            text = f"fsw: parameters from {path}, {keeping.restored} of them not the default"
            self._events.report("parameters", text)

    def _fly(
        self,
        loop: FlightLoop,
        vehicle: VehicleLink,
        inline: PlanningCycle,
        planner: ProcessPlanner,
        record: FlightRecord,
    ) -> FlightEnd:
        options = self._options
        self._stop.listen()
        whom = "PX4" if options.above_px4 else "the simulator"
        where = options.autopilot_link or options.sim
        self._events.report("ready", f"fsw: ready, looking for {whom} at {where}")
        first = loop.connect(options.wait_s)
        if first is None:
            if self._stop.requested:
                return FlightEnd(Ending.STOPPED, "stopped before the flight began")
            who = "no PX4 with an estimate" if options.above_px4 else "no simulator"
            raise CouldNotStart(f"{who} answered at {where} within {options.wait_s:g} s")
        # Lockstep announces itself with the first step; a first step without it was not the first.
        if vehicle.pacing is Pacing.LOCKSTEP:
            settle_memory()
            record.scheduler = scheduler()
            return loop.fly(first, InlinePlanner(inline, clock.now_us, record.mpc))
        refused = claim_real_time(TICK_PRIORITY)
        record.scheduler = scheduler()
        if refused:
            what = " and ".join(refused)
            self._warn(f"no permission for {what}: ticks may be late on a busy machine")
        settle_memory()
        try:
            return loop.fly(first, planner)
        finally:
            release_real_time()


def load_flight_software(options: FswOptions, events: Events) -> FlightProgram:
    """Build and warm up the flight software; compiling takes long and is reported.

    Raises:
        CouldNotStart: A controller or inner loop of that name does not exist.
    """
    # Imported here because SciPy, Clarabel and numba take a second, which a refusal need not wait.
    from fsw.compiled import cache
    from fsw.runtime.assembly import flight_software
    from vehicles.vehicle_file import load_vehicle

    def load() -> FlightProgram:
        return flight_software(
            options.flown,
            origin=options.links.origin,
            vehicle=load_vehicle(options.vehicle),
            px4=_px4_loops(options),
        )

    def compile_first() -> None:
        load()
        cache().note(options.flown.kernels)

    due = cache().is_due(options.flown.kernels)
    if due or cache().folder is None:
        cache().announce("fsw", events)
    if due:
        in_a_child(compile_first)  # the compiler leaves 150 MB behind where it has run
    try:
        return load()
    except ValueError as error:
        raise CouldNotStart(str(error)) from None


def _subject(options: FswOptions, program: FlightProgram) -> LogSubject:
    from vehicles.vehicle_file import load_vehicle

    facts: dict[str, str | int] = {
        "ver_sw": revision(),
        "scenario": options.scenario,
        "scenario_digest": options.scenario_digest,
        **options.flown.facts(),
        **vehicle_facts(load_vehicle(options.vehicle)),
    }
    if options.seed is not None:
        facts["seed"] = options.seed
    return LogSubject(
        facts=facts,
        numbers=program.numbers,
        parameters=program.parameters.values,
        airframe=program.facts.airframe,
        profile=round(program.parameters.values["LOG_PROFILE"]),
    )


def _px4_loops(options: FswOptions) -> Tuning:
    """What the kept parameters say of PX4's loops, with whose lag plans are predicted."""
    from fsw.autopilot.parameters.registry import tuning_of
    from fsw.storage.parameter_file import load

    path = options.params
    if not options.above_px4 or path is None or not path.exists():
        return ()
    return tuning_of({n: v for n, v in load(path).values.items() if n.startswith("PX4_")})


@contextmanager
def _refused(where: Path) -> Iterator[None]:
    """Where parameters of no use end the start, in a sentence."""
    try:
        yield
    except OSError as error:
        raise CouldNotStart(f"cannot keep parameters in {where}: {error.strerror}") from None
    except ValueError as error:
        raise CouldNotStart(f"parameters in {where} contradict each other: {error}") from None


def _output_directory(wanted: Path | None) -> Path:
    try:
        return run_directory(wanted, "fsw")
    except OSError as error:
        reason = f"cannot write to {error.filename}: {error.strerror}" if error.filename else error
        raise CouldNotStart(str(reason)) from None
