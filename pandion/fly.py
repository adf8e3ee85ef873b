"""``pandion fly``: start both halves, watch them, and give the verdict."""

from __future__ import annotations

import argparse
import json
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from fsw.link.udp_endpoint import LinkError, parse_address
from fsw.log.run_directory import new_run_directory
from pandion.display import Display
from pandion.parser import COULD_NOT_START, Parser
from pandion.result import Parts, as_json
from pandion.supervisor import Flown, HalfFailed, Supervisor
from pandion.verdict import rows
from pandion.version import version
from sitl.arguments import add_run_arguments
from sitl.scenario_file import ScenarioError, load_scenario

COMPLETED, NOT_COMPLETED = 0, 1  # exit codes


@dataclass(frozen=True, slots=True)
class FlyOptions:
    """One flight."""

    scenario: str
    scenario_name: str
    seed: int
    duration_s: float
    realtime: bool
    speed: float | None  # None: as fast as possible
    controller: str
    inner: str
    gcs: str
    out: Path
    json: str | None


def main(argv: list[str]) -> int:
    """Fly once; returns the exit code."""
    parser = Parser("pandion fly", "Fly a scenario and judge the flight.")
    add_run_arguments(parser)
    _add_arguments(parser)
    try:
        options = _options(parser.read(argv))
    except (ScenarioError, LinkError, OSError) as error:
        print(f"pandion fly: {error}", file=sys.stderr)
        return COULD_NOT_START
    display = Display(sys.stderr if options.json == "-" else sys.stdout)
    _banner(options, display)
    try:
        flown = Supervisor(display, options.out).fly(
            _sitl_arguments(options), lambda port: _fsw_arguments(options, port)
        )
    except HalfFailed as error:
        print(f"pandion fly: {error}", file=sys.stderr)
        return error.exit_code
    return _judge(options, display, flown)


def _add_arguments(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--controller",
        metavar="NAME",
        default="blf",
        help="predictive controller (default %(default)s)",
    )
    parser.add_argument(
        "--inner",
        metavar="NAME",
        default="tracking",
        help="fast loop, tracking or pid (default %(default)s)",
    )
    parser.add_argument(
        "--gcs",
        metavar="udp:HOST:PORT",
        default="udp:127.0.0.1:14550",
        help="where telemetry goes (default %(default)s)",
    )
    parser.add_argument(
        "--out", metavar="DIR", type=Path, help="where logs go (default a new one in runs/)"
    )
    parser.add_argument("--json", metavar="FILE", help="write the result; - for standard output")


def _options(arguments: argparse.Namespace) -> FlyOptions:
    """Check everything that can be checked before a process is started.

    Raises:
        ScenarioError: There is no such scenario.
        LinkError: The ground station's address is not one.
        OSError: The directory for the logs cannot be made.
    """
    scenario = load_scenario(arguments.scenario)
    parse_address(arguments.gcs)
    if arguments.json not in (None, "-") and not Path(arguments.json).parent.is_dir():
        raise NotADirectoryError(f"cannot write {arguments.json}: its directory does not exist")
    if arguments.realtime and arguments.speed not in (None, 1.0):
        raise ScenarioError("--realtime flies at speed 1; --speed needs --lockstep")
    return FlyOptions(
        scenario=arguments.scenario,
        scenario_name=scenario.name,
        seed=arguments.seed,
        duration_s=scenario.duration_s if arguments.duration is None else arguments.duration,
        realtime=arguments.realtime,
        speed=arguments.speed,
        controller=arguments.controller,
        inner=arguments.inner,
        gcs=arguments.gcs,
        out=_directory(arguments.out, f"{scenario.name}-seed{arguments.seed}"),
        json=arguments.json,
    )


def _directory(wanted: Path | None, stem: str) -> Path:
    if wanted is None:
        return new_run_directory(Path("runs"), stem)
    wanted.mkdir(parents=True, exist_ok=True)
    if (wanted / "result.json").exists() or (wanted / "flight.tlog").exists():
        raise FileExistsError(f"{wanted} already holds a flight; name another --out")
    return wanted


def _banner(options: FlyOptions, display: Display) -> None:
    pacing = "real time" if options.realtime else "lockstep"
    display.say(
        f"Pandion {version()}: {options.scenario_name}, seed {options.seed}, "
        f"{options.duration_s:g} s, {options.controller} controller, {pacing}"
    )
    port = parse_address(options.gcs)[1]
    display.say(f"telemetry to {options.gcs}: QGroundControl connects on UDP {port}")
    display.say(f"logs in {options.out}")


def _sitl_arguments(options: FlyOptions) -> list[str]:
    return [
        options.scenario,
        "--listen=udp:127.0.0.1:0",
        f"--seed={options.seed}",
        f"--duration={options.duration_s!r}",
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
        f"--gcs={options.gcs}",
        f"--controller={options.controller}",
        f"--inner={options.inner}",
        f"--out={options.out}",
        "--wait=600",
    ]


def _judge(options: FlyOptions, display: Display, flown: Flown) -> int:
    out = options.out
    names = {
        "tlog": "flight.tlog",
        "result": "result.json",
        "sitl": "sitl.json",
        "fsw": "fsw.json",
        "sitl_log": "sitl.log",
        "fsw_log": "fsw.log",
    }
    parts = Parts(
        scenario=options.scenario_name,
        seed=options.seed,
        controller=options.controller,
        sitl=flown.sitl,
        fsw=_read(out / "fsw.json"),
        failure=flown.failure,
        logs={
            key: out / name
            for key, name in names.items()
            if name == "result.json" or (out / name).exists()
        },
    )
    result = as_json(parts)
    text = json.dumps(result, indent=2) + "\n"
    (out / "result.json").write_text(text, encoding="utf-8")
    display.verdict(result, rows(result, (flown.sitl or {}).get("tracking_error_max_m")))
    if options.json == "-":
        print(text, end="", flush=True)
    elif options.json is not None:
        Path(options.json).write_text(text, encoding="utf-8")
    return COMPLETED if result["completed"] else NOT_COMPLETED


def _read(path: Path) -> dict[str, Any] | None:
    try:
        content = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return content if isinstance(content, dict) else None
