"""One flight of a simulation with the vehicle at the other end: built, flown, written down."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import os
from collections.abc import Callable
from typing import Final, NamedTuple, Protocol

from command_line.output import json_text, try_write
from command_line.parser import COULD_NOT_START
from command_line.process import NOT_COMPLETED, Events, StopRequest
from sitl.arguments import SitlOptions
from sitl.compiled import cache
from sitl.faults.keys import Fault
from sitl.link.exchange import ExchangeCounts
from sitl.link.server import Progress, RunTiming
from sitl.rehearsal import rehearse
from sitl.result import EndKind, TruthResult
from sitl.scenario import Scenario
from sitl.scenario_file import suite_of
from sitl.simulation import Simulation
from sitl.touch import touch_sentence
from sitl.truth_log import TruthLog

COMPLETED: Final = 0  # exit code

_FIFO_PRIORITY: Final = 50
_KERNELS: Final = "flight"  # of which all but a few are the same for every scenario


class Watch(NamedTuple):
    """Who looks on while a flight goes on."""

    progress: Progress
    truth: Callable[[Simulation], None]  # takes the true state of every step
    begun: Callable[[Fault], None]  # takes each fault when it begins


class FlownSession(NamedTuple):
    """How it went with whoever flew."""

    timing: RunTiming
    counts: ExchangeCounts
    silent: bool  # it did not answer any more when the flight was over


class Session(Protocol):
    """The autopilot at the other end of a link."""

    def fly(self, simulation: Simulation, watch: Watch, stop: StopRequest) -> FlownSession:
        """Step until the run is over; the reason is in ``simulation.ended``."""
        ...


class Flight:
    """Everything of one run, ready to meet the vehicle."""

    def __init__(self, options: SitlOptions, scenario: Scenario, events: Events) -> None:
        """Build the plant and compile it.

        Raises:
            ScenarioError: The scenario contradicts itself or starts outside its safe set.
        """
        self._options = options
        self._events = events
        if cache().folder is None or cache().is_due(_KERNELS):
            cache().announce("sitl", events)
        self._simulation = Simulation(scenario, options.seed, origin=options.origin)
        self._lost: list[str] = []  # of the log, and why
        rehearse(Simulation(scenario, options.seed))
        cache().note(_KERNELS)

    def run(self, session: Session, stop: StopRequest) -> int:
        """Fly to the end and report; returns the exit code."""
        options, simulation = self._options, self._simulation
        self._events.report("flying", "sitl: flying")
        self._settle()
        with contextlib.ExitStack() as files:
            watch = Watch(self._progress, self._truth(files), self._begun)
            flown = session.fly(simulation, watch, stop)
        counts, timing = flown.counts, flown.timing
        self._report_pauses(counts)
        result = simulation.result()
        described = self._as_json(result, timing, counts)
        text = json_text(described, 2) + "\n"
        in_directory = None if options.out is None else options.out / "sitl.json"
        lost = self._lost + try_write(options.json, text) + try_write(in_directory, text)
        sentence = f"sitl: {_summary(result, timing)}"
        self._events.report("ended", sentence, result=described, vehicle_silent=flown.silent)
        for what in lost:
            self._events.report("unwritten", f"sitl: cannot write {what}", what=what)
        if simulation.ended is not None and simulation.ended.kind is EndKind.REFUSED:
            return COULD_NOT_START
        return COMPLETED if result.completed and not lost else NOT_COMPLETED

    def _report_pauses(self, counts: ExchangeCounts) -> None:
        if counts.pauses:
            times = "once" if counts.pauses == 1 else f"{counts.pauses} times"
            length = f"{counts.paused_s:.2f} s in all"
            self._warn(f"process was suspended {times} ({length}); simulated time paused with it")

    def _truth(self, files: contextlib.ExitStack) -> Callable[[Simulation], None]:
        """What takes the true state of every step: a log, where results are wanted."""
        options = self._options
        if options.out is None:
            return lambda _: None
        scenario, path = self._simulation.scenario, options.out / "truth.ulg"
        try:
            log = TruthLog(path, scenario, options.seed, self._warn)
        except OSError as error:
            self._warn(f"no truth.ulg: {error.strerror}")
            self._lost.append(f"{path}: {error.strerror}")
            return lambda _: None
        files.callback(self._close, log)
        return log.add

    def _close(self, log: TruthLog) -> None:
        log.close()
        self._lost += log.file.lost

    def _warn(self, sentence: str) -> None:
        self._events.report("warning", f"sitl: {sentence}")

    def _progress(self, time_s: float, margin_m: float | None, real_time_factor: float) -> None:
        values = {"t_s": time_s, "min_margin_m": margin_m, "real_time_factor": real_time_factor}
        self._events.report("progress", "", **values)

    def _begun(self, fault: Fault) -> None:
        simulation = self._simulation
        sentence = f"sitl: fault at {simulation.time_s:.1f} s: {fault}"
        self._events.report("fault", sentence, **dataclasses.asdict(fault))

    def _settle(self) -> None:
        """Stop the garbage collector: sweeping numba's objects takes tens of milliseconds."""
        gc.collect()
        gc.freeze()
        gc.disable()
        if not self._options.realtime:
            return
        try:
            os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_FIFO_PRIORITY))
        except OSError:
            self._warn("no permission for real-time scheduling: steps may be late")

    def _as_json(
        self, result: TruthResult, timing: RunTiming, counts: ExchangeCounts
    ) -> dict[str, object]:
        return {
            "scenario": self._simulation.scenario.name,
            "seed": self._options.seed,
            "vehicle": self._simulation.vehicle.name,
            "sensors": suite_of(self._simulation.scenario),
            **dataclasses.asdict(result),
            "end_kind": None
            if self._simulation.ended is None
            else self._simulation.ended.kind.value,
            "real_time_factor": timing.real_time_factor,
            "steps": timing.steps,
            "wall_s": timing.wall_s,
            "waited_s": counts.waited_s,
            "resent_steps": counts.resent,
            "missed_steps": counts.missed,
            "pauses": counts.pauses,
            "paused_s": counts.paused_s,
            "unwritten": self._lost,
        }


def _summary(result: TruthResult, timing: RunTiming) -> str:
    margin = ""
    if result.min_margin_m is not None:
        margin = f", smallest margin {1000.0 * result.min_margin_m:.1f} mm"
    touched = "".join(f", {touch_sentence(*one)}" for one in result.touches.items())
    if result.force_error_rms_n is not None:
        touched += f", force error {result.force_error_rms_n:.2f} N rms"
    return f"{result.end_reason}{margin}{touched}, {timing.real_time_factor:.1f} times real time"
