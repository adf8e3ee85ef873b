"""``pandion fly``: start both processes, watch them, and print the result."""

from __future__ import annotations

import math
import shlex
import sys
from dataclasses import dataclass, fields, replace
from pathlib import Path

from command_line.options import as_words, declared, group, json_file, option, read, switch
from command_line.output import command_name, json_text, print_error, try_write, unwritable, without
from command_line.parser import COULD_NOT_START
from command_line.run_directory import run_directory
from command_line.version import version
from fsw.arguments import OUT, PARAMS, FswOptions
from fsw.autopilot.parameters.control_choice import ControlChoice
from fsw.link.link_choice import NO_LINK, LinkChoice, addresses
from messages.addresses import LinkError, parse_link_address
from pandion.display import Display
from pandion.join_truth import join_truth
from pandion.processor import ANYWHERE, lockstep_places
from pandion.result import FlightReports, as_json, first_rows, table_rows
from pandion.supervisor import Flown, ProcessFailed, Supervisor
from pandion.view_beside import ViewBeside
from sitl.arguments import RunOptions, SitlOptions
from sitl.earth import Place
from sitl.scenario import Push, Scenario, vehicle_of
from sitl.scenario_file import (
    ScenarioError,
    check_pacing,
    load_scenario,
    scenario_digest,
    suite_of,
)
from vehicles.description import Vehicle
from vehicles.vehicle_file import VehicleError, load_vehicle

COMPLETED, NOT_COMPLETED = 0, 1  # exit codes
# The flight software compiles when it is started for the first time; the supervisor ends the wait
# if it fails.
_WAIT_S = 600.0


@dataclass(frozen=True, slots=True, kw_only=True)
class FlyOptions(RunOptions):
    """Options of one flight."""

    control: ControlChoice = group(ControlChoice)
    params: Path | None = declared(PARAMS)
    links: LinkChoice = group(LinkChoice)
    believed_vehicle: str | None = option(
        "--believed-vehicle NAME",
        "vehicle that the flight software takes it for (default the one that flies)",
    )
    out: Path | None = declared(OUT)
    json: str | None = json_file("the result")
    view: bool = switch(
        "--view", "show the flight live in the browser; at speed 1 if none is given"
    )
    report: bool = switch("--report", "write the flight's report.html beside its log")

    def __post_init__(self) -> None:
        """Refuse a contradictory choice; raises ContradictionError."""
        self.control.check()


@dataclass(frozen=True, slots=True)
class PlannedFlight:
    """One flight, checked before its processes start."""

    options: FlyOptions
    name: str  # of the scenario
    vehicle: str  # that flies, by its own name
    sensors: str  # suite
    body: str  # that the scenario is for
    believed: str  # vehicle, by name or path, that the flight software flies
    digest: str  # of the scenario's file
    duration_s: float
    out: Path


def main(argv: list[str]) -> int:
    """Fly once; returns the exit code."""
    options = read(FlyOptions, "pandion fly", "Fly a scenario and judge the flight.", argv)
    try:
        flight = planned(options)
    except (ScenarioError, LinkError, OSError) as error:
        print_error("pandion fly", unwritable(error))
        return COULD_NOT_START
    display = Display(sys.stderr if options.json == "-" else sys.stdout)
    _banner(flight, display)
    view = ViewBeside(display, flight.out, flight.believed)
    try:
        places = ANYWHERE if options.realtime else lockstep_places()
        found = view.start if options.view else None
        flown = Supervisor(display, flight.out, places, found=found).run(
            as_words(_sitl_options(flight)), lambda port: as_words(_fsw_options(flight, port))
        )
    except ProcessFailed as error:
        print_error("pandion fly", error)
        return error.exit_code
    finally:
        view.close()
    return _judge(flight, display, flown)


def planned(options: FlyOptions) -> PlannedFlight:
    """Check everything that can be checked before a process is started.

    Raises:
        ScenarioError: There is no such scenario, or it asks for more than the vehicle can do.
        LinkError: An address of a link is none.
        OSError: The directory for the logs cannot be made.
    """
    scenario = load_scenario(options.scenario, options.sensors, options.vehicle)
    check_pacing(scenario, realtime=options.realtime)
    believed = options.believed_vehicle or scenario.vehicle
    check_alike(vehicle_of(scenario), believed)
    if scenario.payload is not None or isinstance(scenario.trajectory, Push):
        _check_task(scenario, believed)
    addresses(options.links)
    if options.realtime and options.speed not in (None, 1.0):
        raise ScenarioError("--realtime flies at speed 1; --speed needs --lockstep")
    if options.view and not options.realtime and options.speed is None:
        # Faster than anyone can look; and a station's heartbeats would come too seldom.
        options = replace(options, speed=1.0)
    return PlannedFlight(
        options=options,
        name=scenario.name,
        vehicle=vehicle_of(scenario).name,
        sensors=suite_of(scenario),
        body=scenario.body,
        believed=believed,
        digest=scenario_digest(options.scenario),
        duration_s=scenario.duration_s if options.duration_s is None else options.duration_s,
        out=run_directory(options.out, f"{scenario.name}-seed{options.seed}"),
    )


def check_alike(flown: Vehicle, believed: str) -> None:
    """Refuse a vehicle that the flight software cannot take the one that is flown for.

    Raises:
        ScenarioError: With why not.
    """
    try:
        other = load_vehicle(believed)
    except VehicleError as error:
        raise ScenarioError(f"--believed-vehicle: {error}") from error
    for what, count, wanted in (
        ("rotors", len(other.rotors), len(flown.rotors)),
        ("joints", len(other.joints), len(flown.joints)),
    ):
        if count != wanted:
            raise ScenarioError(
                f"--believed-vehicle {believed} has {count} {what}, and {flown.name}, which "
                f"flies, has {wanted}"
            )


def _check_task(scenario: Scenario, believed: str) -> None:
    from fsw.autopilot.parameters.flight_config import flight_config
    from studies.flight.closed_loop import check_payload, check_pressing

    config = flight_config(body=scenario.body, vehicle=load_vehicle(believed))
    check_payload(scenario, config)
    check_pressing(scenario, config)


def _banner(flight: PlannedFlight, display: Display) -> None:
    options = flight.options
    pacing = "real time" if options.realtime else "lockstep"
    endless = math.isinf(flight.duration_s)
    length = "until interrupted" if endless else f"{flight.duration_s:g} s"
    display.say(
        f"Pandion {version()}: {flight.name}, seed {options.seed}, vehicle {flight.vehicle}, "
        f"{flight.sensors} sensors, {length}, {options.control.controller} controller, {pacing}"
    )
    if options.control.body not in (None, flight.body):
        display.say(
            f"note: --body {options.control.body} keeps clear, the scenario is for {flight.body}; "
            "it may start outside its safe set"
        )
    gcs = parse_link_address(options.links.gcs)
    hint = f": QGroundControl connects on UDP {gcs[1]}" if isinstance(gcs, tuple) else ""
    display.say(f"telemetry to {options.links.gcs}{hint}")
    if options.links.api != NO_LINK:
        display.say(f"programs (MAVSDK) find the vehicle at {options.links.api}")
    display.say(f"logs in {flight.out}")


def _sitl_options(flight: PlannedFlight) -> SitlOptions:
    common = {field.name: getattr(flight.options, field.name) for field in fields(RunOptions)}
    at = flight.options.links.origin
    return SitlOptions(
        **common,
        listen="udp:127.0.0.1:0",
        wait_s=_WAIT_S,
        origin=Place(at.latitude, at.longitude, at.altitude),
        out=flight.out,
    )


def _fsw_options(flight: PlannedFlight, port: int) -> FswOptions:
    options = flight.options
    return FswOptions(
        sim=f"udp:127.0.0.1:{port}",
        links=options.links,
        control=replace(options.control, body=options.control.body or flight.body),
        vehicle=flight.believed,
        params=options.params,
        out=flight.out,
        wait_s=_WAIT_S,
        scenario=flight.name,
        scenario_digest=flight.digest,
        seed=options.seed,
    )


def _judge(flight: PlannedFlight, display: Display, flown: Flown) -> int:
    options, out = flight.options, flight.out
    names = {
        "ulog": "flight.ulg",
        "truth": "truth.ulg",
        "tlog": "flight.tlog",
        "result": "result.json",
        "sitl": "sitl.json",
        "fsw": "fsw.json",
        "sitl_log": "sitl.log",
        "fsw_log": "fsw.log",
    }
    join_truth(out, flown.fsw)
    reports = FlightReports(
        scenario=flight.name,
        seed=options.seed,
        controller=options.control.controller,
        sitl=flown.sitl,
        fsw=flown.fsw,
        failure=flown.cause,
        aftermath="; ".join(flown.aftermath) or None,
        unwritten=tuple(flown.unwritten),
        logs={
            key: out / name
            for key, name in names.items()
            if name == "result.json" or (out / name).exists()
        },
    )
    result = as_json(reports)
    text = json_text(result, 2) + "\n"
    lost = try_write(out / "result.json", text)
    tracking_max_m = (flown.sitl or {}).get("tracking_error_max_m")
    first = first_rows(result, tracking_max_m)
    display.result(result, first, table_rows(result, tracking_max_m)[len(first) :])
    lost = [*flown.unwritten, *lost, *try_write(options.json, text)]
    lost += _report(flight, display)
    if lost:
        print_error("pandion fly", f"results could not be written: {'; '.join(lost)}")
    if flown.sitl is not None and flown.sitl.get("end_kind") == "refused":
        return COULD_NOT_START
    return COMPLETED if result["completed"] and not lost else NOT_COMPLETED


def _report(flight: PlannedFlight, display: Display) -> list[str]:
    """Write the page, or say how to; returns what could not be written, and why."""
    if not flight.options.report:
        where = shlex.quote(str(flight.out))
        display.say(
            f"to see it: {command_name()} view {where}; "
            f"as a file to send: {command_name()} report {where}"
        )
        return []
    from messages.ulog_reader import UlogError
    from pandion.report import write_report

    try:
        display.say(f"{'report':12} {write_report([flight.out])}")
    except (UlogError, OSError) as error:
        return [f"report: {error}"]
    except ModuleNotFoundError as error:
        return [f"report: {without(error, 'report')}"]
    return []
