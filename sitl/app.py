"""Starts one run: checks what was asked for and opens the port before anything heavy is loaded."""

from __future__ import annotations

import contextlib
import dataclasses
import math
import time
from typing import Final

from command_line.process import (
    NOT_COMPLETED,
    CouldNotStart,
    Events,
    StopRequest,
    events_of,
    run_reported,
)
from sitl.arguments import SitlOptions
from sitl.faults.keys import LINKS
from sitl.link.endpoints import (
    RESEND_S,
    ByteStream,
    LinkError,
    PeerSocket,
    parse_address,
    parse_listener,
)
from sitl.scenario_file import PERFECT, ScenarioError, check_pacing, load_scenario, suite_of

_UDP: Final = "udp:127.0.0.1:4560"
_TCP: Final = "tcp:127.0.0.1:4560"
_NOISY: Final = "mocap"  # the suite in place of the perfect one


def run(options: SitlOptions) -> int:
    """Simulate one flight; returns the exit code."""
    events = events_of(options.events, to_stderr=options.json == "-")
    refusals = (LinkError, ScenarioError)
    return run_reported("sitl", events, refusals, lambda: _run(options, events))


def _run(options: SitlOptions, events: Events) -> int:
    if options.realtime and options.speed not in (None, 1.0):
        raise CouldNotStart("--realtime flies at speed 1; --speed needs --lockstep")
    if options.for_px4:
        return _run_for_px4(options, events)
    scenario = load_scenario(options.scenario, options.sensors, options.vehicle)
    check_pacing(scenario, realtime=options.realtime)
    if options.duration_s is not None:
        scenario = dataclasses.replace(scenario, duration_s=options.duration_s)
    _check_outputs(options)
    local = parse_address(options.listen or _UDP, any_port=True)
    endpoint = PeerSocket.bound(local, RESEND_S)
    try:
        host, port = endpoint.address
        sentence = f"sitl: {scenario.name}, seed {options.seed}, on udp:{host}:{port}"
        events.report("listening", sentence, host=host, port=port, duration_s=scenario.duration_s)
        # NumPy and numba take a second to load; the flight software can start meanwhile.
        from sitl.flight import Flight
        from sitl.link.server import wait_for_vehicle
        from sitl.vehicle_session import VehicleSession

        flight = Flight(options, scenario, events)
        session = VehicleSession(options, endpoint)
        stop = _stop_request(events, "the flight software")
        if wait_for_vehicle(endpoint, options.wait_s, stop):
            return flight.run(session, stop)
        return _not_begun(options, events, stop, f"no flight software spoke to udp:{host}:{port}")
    finally:
        endpoint.close()


def _run_for_px4(options: SitlOptions, events: Events) -> int:
    listener = parse_listener(options.listen or _TCP)
    suite = options.sensors
    scenario = load_scenario(options.scenario, suite, options.vehicle)
    if suite_of(scenario) == PERFECT:
        suite = _NOISY
        scenario = load_scenario(options.scenario, suite, options.vehicle)
        events.report("remark", f"sitl: sensors {suite}: PX4 takes sensors without noise for stuck")
    check_pacing(scenario, realtime=False)
    for i, fault in enumerate(scenario.faults):
        if fault.unit in LINKS:
            raise ScenarioError(f"faults[{i}]: {fault} is of a link that loses datagrams, not TCP")
    # PX4 takes off and lands when its own operator says.
    duration_s = math.inf if options.duration_s is None else options.duration_s
    scenario = dataclasses.replace(scenario, duration_s=duration_s)
    _check_outputs(options)
    with contextlib.closing(ByteStream(listener, _wall_us)) as stream:
        host, port = listener.host, stream.listening_port
        sentence = f"sitl: {scenario.name}, seed {options.seed}, for PX4 on tcp:{host}:{port}"
        events.report("listening", sentence, host=host, port=port, duration_s=duration_s)
        from sitl.flight import Flight
        from sitl.link.px4_server import wait_for_px4
        from sitl.px4_session import Px4Session
        from sitl.start import on_the_ground

        if scenario.start.kind == "airborne":
            events.report(
                "remark", f"sitl: {scenario.name} begins on the ground: PX4 takes off itself"
            )
        flight = Flight(options, on_the_ground(scenario), events)
        session = Px4Session(options, stream, events)
        stop = _stop_request(events, "PX4")
        if wait_for_px4(stream, options.wait_s, stop):
            return flight.run(session, stop)
        return _not_begun(options, events, stop, f"no PX4 connected to tcp:{host}:{port}")


def _stop_request(events: Events, awaited: str) -> StopRequest:
    """What ends the process early, from when it waits for who is ``awaited`` on."""
    stop = StopRequest()
    stop.listen()
    events.report("ready", f"sitl: ready, waiting for {awaited}")
    return stop


def _not_begun(options: SitlOptions, events: Events, stop: StopRequest, nobody: str) -> int:
    """The exit code of a flight that was interrupted before it began.

    Raises:
        CouldNotStart: It was not: there was ``nobody`` in time.
    """
    if not stop.requested:
        raise CouldNotStart(f"{nobody} within {options.wait_s:g} s")
    events.report("error", "sitl: interrupted before the flight began")
    return NOT_COMPLETED


def _wall_us() -> int:
    return time.monotonic_ns() // 1000


def _check_outputs(options: SitlOptions) -> None:
    """Check before the flight that the result can be written."""
    try:
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CouldNotStart(f"cannot write to {options.out}: {error.strerror}") from None
