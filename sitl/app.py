"""Builds the simulator and runs it once: the only place that makes objects."""

from __future__ import annotations

import contextlib
import dataclasses
import gc
import json
import os
import signal
import traceback
from pathlib import Path
from types import FrameType
from typing import Final

from sitl.arguments import SitlOptions
from sitl.events import Events, JsonEvents, TextEvents
from sitl.link.encode import StepEncoder
from sitl.link.exchange import RESEND_S, Exchange, Lockstep, RealTime
from sitl.link.pilot import flight_plan
from sitl.link.server import RunTiming, fly, shut_down, wait_for_vehicle
from sitl.link.udp_endpoint import LinkError, UdpEndpoint, parse_address
from sitl.scenario import Scenario
from sitl.scenario_file import ScenarioError, load_scenario
from sitl.simulation import START_US, STEP_US, Controls, Simulation
from sitl.trajectory import TrajectoryPoint
from sitl.verdict import EndKind, TruthResult

COMPLETED, NOT_COMPLETED, COULD_NOT_START = 0, 1, 2  # exit codes

_FIFO_PRIORITY: Final = 50


class CouldNotStart(Exception):
    """Why there is no run, in one sentence."""


class _StopRequest:
    """Becomes true on SIGINT or SIGTERM, so that the run can end between two steps."""

    def __init__(self) -> None:
        self.requested = False

    def listen(self) -> None:
        signal.signal(signal.SIGINT, self._request)
        signal.signal(signal.SIGTERM, self._request)

    def _request(self, number: int, frame: FrameType | None) -> None:
        self.requested = True


def run(options: SitlOptions) -> int:
    """Simulate one flight; returns the exit code."""
    told: Events = JsonEvents() if options.events == "json" else TextEvents(options.json == "-")
    try:
        return _run(options, told)
    except (CouldNotStart, LinkError, ScenarioError) as error:
        told.report("error", f"sitl: {error}")
        return COULD_NOT_START
    except KeyboardInterrupt:
        told.report("error", "sitl: interrupted before the flight began")
        return NOT_COMPLETED
    except BrokenPipeError:
        return NOT_COMPLETED  # whoever read the events is gone
    except Exception as error:
        traceback.print_exc()
        told.report("error", f"sitl: internal error, {type(error).__name__}: {error}")
        return NOT_COMPLETED


def _run(options: SitlOptions, told: Events) -> int:
    if options.realtime and options.speed not in (None, 1.0):
        raise CouldNotStart("--realtime flies at speed 1; --speed needs --lockstep")
    scenario = _scenario(options)
    endpoint = UdpEndpoint(parse_address(options.listen), RESEND_S)
    try:
        host, port = endpoint.address
        sentence = f"sitl: {scenario.name}, seed {options.seed}, on udp:{host}:{port}"
        told.report("listening", sentence, host=host, port=port, duration_s=scenario.duration_s)
        simulation = Simulation(scenario, options.seed)
        _compile(scenario, options.seed)
        stop = _StopRequest()
        stop.listen()
        told.report("ready", "sitl: ready, waiting for the flight software")
        if not wait_for_vehicle(endpoint, options.wait_s, stop):
            if stop.requested:
                told.report("error", "sitl: interrupted before the flight began")
                return NOT_COMPLETED
            raise CouldNotStart(
                f"no flight software spoke to udp:{host}:{port} within {options.wait_s:g} s"
            )
        told.report("flying", "sitl: flying")
        return _fly(options, told, simulation, endpoint, stop)
    finally:
        endpoint.close()


def _fly(
    options: SitlOptions,
    told: Events,
    simulation: Simulation,
    endpoint: UdpEndpoint,
    stop: _StopRequest,
) -> int:
    encoder = StepEncoder(lockstep=not options.realtime)

    def target_at(t_us: int) -> TrajectoryPoint:
        return simulation.target_at(1e-6 * (t_us - START_US))

    def progress(time_s: float, margin_m: float | None, real_time_factor: float) -> None:
        told.report(
            "progress", "", t_s=time_s, min_margin_m=margin_m, real_time_factor=real_time_factor
        )

    plan = flight_plan(simulation.scenario, target_at)
    _settle(options.realtime, told)
    exchange = _exchange(options, endpoint, len(simulation.vehicle.links), stop)
    timing = fly(simulation, plan, exchange, encoder, stop, progress)
    stopped = simulation.ended is not None and simulation.ended.kind is EndKind.STOPPED
    # A vehicle that has just been silent for two seconds is not worth another one.
    shut_down(endpoint, encoder, tries=1 if stopped else 4)
    result = simulation.result()
    written = _as_json(options, simulation.scenario, result, timing, exchange)
    _write(options, written)
    speed = f"{timing.real_time_factor:.1f} times real time"
    margin = ""
    if result.min_margin_m is not None:
        margin = f", smallest margin {1000.0 * result.min_margin_m:.1f} mm"
    told.report("ended", f"sitl: {result.end_reason}{margin}, {speed}", result=written)
    return COMPLETED if result.completed else NOT_COMPLETED


def _scenario(options: SitlOptions) -> Scenario:
    scenario = load_scenario(options.scenario)
    if options.duration_s is None:
        return scenario
    return dataclasses.replace(scenario, duration_s=options.duration_s)


def _compile(scenario: Scenario, seed: int) -> None:
    """Take one step of a simulation that is thrown away, so that every kernel is compiled."""
    rehearsal = Simulation(scenario, seed)
    rehearsal.sense()
    joints = len(rehearsal.vehicle.links)
    rehearsal.advance(Controls((0.5, 0.5, 0.5, 0.5), (0.0,) * joints, armed=True))
    rehearsal.sense()


def _exchange(
    options: SitlOptions, endpoint: UdpEndpoint, joints: int, stop: _StopRequest
) -> Exchange:
    period_s = 1e-6 * STEP_US
    if options.realtime:
        return RealTime(endpoint, joints, period_s)
    speed = options.speed
    return Lockstep(endpoint, joints, None if speed is None else period_s / speed, stop)


def _settle(realtime: bool, told: Events) -> None:
    """Stop the garbage collector, whose sweep over numba's objects takes tens of milliseconds."""
    gc.collect()
    gc.freeze()
    gc.disable()
    if not realtime:
        return
    try:
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(_FIFO_PRIORITY))
    except OSError:
        told.report("warning", "sitl: no permission for real-time scheduling: steps may be late")


def _as_json(
    options: SitlOptions,
    scenario: Scenario,
    result: TruthResult,
    timing: RunTiming,
    exchange: Exchange,
) -> dict[str, object]:
    return {
        "scenario": scenario.name,
        "seed": options.seed,
        **dataclasses.asdict(result),
        "real_time_factor": timing.real_time_factor,
        "steps": timing.steps,
        "resent_steps": exchange.counts.resent,
        "missed_steps": exchange.counts.missed,
    }


def _write(options: SitlOptions, result: dict[str, object]) -> None:
    text = json.dumps(result, indent=2) + "\n"
    if options.json == "-":
        print(text, end="", flush=True)
    elif options.json is not None:
        Path(options.json).write_text(text, encoding="utf-8")
    if options.out is not None:
        with contextlib.suppress(FileExistsError):
            options.out.mkdir(parents=True)
        (options.out / "sitl.json").write_text(text, encoding="utf-8")
