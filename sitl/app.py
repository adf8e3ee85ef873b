"""Starts one run: checks what was asked for and opens the port before anything heavy is loaded."""

from __future__ import annotations

import dataclasses

from command_line.process import (
    NOT_COMPLETED,
    CouldNotStart,
    Events,
    StopRequest,
    events_of,
    run_reported,
)
from sitl.arguments import SitlOptions
from sitl.link.udp_endpoint import RESEND_S, LinkError, PeerSocket, parse_address
from sitl.scenario_file import ScenarioError, check_pacing, load_scenario


def run(options: SitlOptions) -> int:
    """Simulate one flight; returns the exit code."""
    events = events_of(options.events, to_stderr=options.json == "-")
    refusals = (LinkError, ScenarioError)
    return run_reported("sitl", events, refusals, lambda: _run(options, events))


def _run(options: SitlOptions, events: Events) -> int:
    if options.realtime and options.speed not in (None, 1.0):
        raise CouldNotStart("--realtime flies at speed 1; --speed needs --lockstep")
    scenario = load_scenario(options.scenario, options.sensors)
    check_pacing(scenario, realtime=options.realtime)
    if options.duration_s is not None:
        scenario = dataclasses.replace(scenario, duration_s=options.duration_s)
    _check_outputs(options)
    endpoint = PeerSocket.bound(parse_address(options.listen, any_port=True), RESEND_S)
    try:
        host, port = endpoint.address
        sentence = f"sitl: {scenario.name}, seed {options.seed}, on udp:{host}:{port}"
        events.report("listening", sentence, host=host, port=port, duration_s=scenario.duration_s)
        # NumPy and numba take a second to load; the flight software can start meanwhile.
        from sitl.flight import Flight
        from sitl.link.server import wait_for_vehicle

        flight = Flight(options, scenario, endpoint, events)
        stop = StopRequest()
        stop.listen()
        events.report("ready", "sitl: ready, waiting for the flight software")
        if wait_for_vehicle(endpoint, options.wait_s, stop):
            return flight.run(stop)
        if not stop.requested:
            raise CouldNotStart(
                f"no flight software spoke to udp:{host}:{port} within {options.wait_s:g} s"
            )
        events.report("error", "sitl: interrupted before the flight began")
        return NOT_COMPLETED
    finally:
        endpoint.close()


def _check_outputs(options: SitlOptions) -> None:
    """Check before the flight that the result can be written."""
    try:
        if options.out is not None:
            options.out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise CouldNotStart(f"cannot write to {options.out}: {error.strerror}") from None
