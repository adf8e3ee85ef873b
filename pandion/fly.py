"""``pandion fly``: start both halves, watch them, and give the verdict."""

from __future__ import annotations

import json
import math
import sys

from fsw.link.link_choice import NO_LINK
from fsw.link.udp_endpoint import LinkError, parse_address
from pandion.display import Display
from pandion.fly_options import FlyOptions, add_arguments
from pandion.fly_options import options as fly_options
from pandion.join_truth import join_truth
from pandion.output import write_text
from pandion.parser import COULD_NOT_START, Parser
from pandion.processor import ANYWHERE, lockstep_places
from pandion.result import Parts, as_json
from pandion.supervisor import Flown, HalfFailed, Supervisor
from pandion.verdict import rows
from pandion.version import version
from sitl.scenario_file import ScenarioError

COMPLETED, NOT_COMPLETED = 0, 1  # exit codes


def main(argv: list[str]) -> int:
    """Fly once; returns the exit code."""
    parser = Parser("pandion fly", "Fly a scenario and judge the flight.")
    add_arguments(parser)
    try:
        options = fly_options(parser.read(argv))
    except (ValueError, ScenarioError, LinkError, OSError) as error:
        print(f"pandion fly: {error}", file=sys.stderr)
        return COULD_NOT_START
    display = Display(sys.stderr if options.json == "-" else sys.stdout)
    _banner(options, display)
    try:
        places = ANYWHERE if options.realtime else lockstep_places()
        flown = Supervisor(display, options.out, places).fly(
            _sitl_arguments(options), lambda port: _fsw_arguments(options, port)
        )
    except HalfFailed as error:
        print(f"pandion fly: {error}", file=sys.stderr)
        return error.exit_code
    return _judge(options, display, flown)


def _banner(options: FlyOptions, display: Display) -> None:
    pacing = "real time" if options.realtime else "lockstep"
    endless = math.isinf(options.duration_s)
    length = "until interrupted" if endless else f"{options.duration_s:g} s"
    display.say(
        f"Pandion {version()}: {options.scenario_name}, seed {options.seed}, "
        f"{length}, {options.control.controller} controller, {pacing}"
    )
    port = parse_address(options.links.gcs)[1]
    display.say(f"telemetry to {options.links.gcs}: QGroundControl connects on UDP {port}")
    if options.links.api != NO_LINK:
        display.say(f"programs (MAVSDK) find the vehicle at {options.links.api}")
    display.say(f"logs in {options.out}")


def _sitl_arguments(options: FlyOptions) -> list[str]:
    return [
        options.scenario,
        "--listen=udp:127.0.0.1:0",
        f"--seed={options.seed}",
        *([] if math.isinf(options.duration_s) else [f"--duration={options.duration_s!r}"]),
        "--realtime" if options.realtime else "--lockstep",
        f"--speed={'max' if options.speed is None else repr(options.speed)}",
        # The flight software compiles when it is started for the first time; the supervisor
        # ends the wait if it fails.
        "--wait=600",
        f"--out={options.out}",
    ]


def _fsw_arguments(options: FlyOptions, port: int) -> list[str]:
    return [
        f"--sim=udp:127.0.0.1:{port}",
        *options.links.as_arguments(),
        *options.control.as_arguments(),
        *([] if options.params is None else [f"--params={options.params}"]),
        f"--out={options.out}",
        "--wait=600",
        f"--scenario={options.scenario_name}",
        f"--scenario-digest={options.scenario_digest}",
        f"--seed={options.seed}",
    ]


def _judge(options: FlyOptions, display: Display, flown: Flown) -> int:
    out = options.out
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
    parts = Parts(
        scenario=options.scenario_name,
        seed=options.seed,
        controller=options.control.controller,
        sitl=flown.sitl,
        fsw=flown.fsw,
        failure=flown.cause,
        aftermath="; ".join(flown.aftermath) or None,
        logs={
            key: out / name
            for key, name in names.items()
            if name == "result.json" or (out / name).exists()
        },
    )
    result = as_json(parts)
    text = json.dumps(result, indent=2) + "\n"
    lost = _write(str(out / "result.json"), text)
    display.verdict(result, rows(result, (flown.sitl or {}).get("tracking_error_max_m")))
    unwritten = [*flown.unwritten, *lost, *_write(options.json, text)]
    if unwritten:
        print(f"pandion fly: results could not be written: {'; '.join(unwritten)}", file=sys.stderr)
    if flown.sitl is not None and flown.sitl.get("end_kind") == "refused":
        return COULD_NOT_START
    return COMPLETED if result["completed"] and not unwritten else NOT_COMPLETED


def _write(target: str | None, text: str) -> list[str]:
    """Write the result; returns what could not be written, and why."""
    try:
        write_text(target, text)
    except BrokenPipeError:
        raise
    except OSError as error:
        return [f"{'standard output' if target == '-' else target}: {error.strerror}"]
    return []
