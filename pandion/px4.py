"""``pandion px4``: what PX4 needs to fly the simulated vehicle."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

from command_line.actions import read_action
from command_line.options import declared, option
from command_line.output import print_error, written
from command_line.parser import COULD_NOT_START
from command_line.values import known, one_of, seconds
from messages.addresses import LinkError, parse_link_address
from sitl.arguments import ORIGIN, rate
from sitl.earth import Place
from sitl.scenario_file import (
    PERFECT,
    SUITE_NAMES,
    ScenarioError,
    load_scenario,
    scenario_names,
    suite_of,
)

DONE: Final = 0  # exit codes
FAILED: Final = 1
NOISY: Final = "mocap"
# PX4 reads its environment before the defaults of its airframe, and does not keep a value that is
# its own default: a rotor at 0 would get the airframe's place. So no value is exactly a default.
_BESIDE: Final = 1e-6


@dataclass(frozen=True, slots=True, kw_only=True)
class _Plant:
    """The plant that PX4 is to fly."""

    scenario: str = option(
        "SCENARIO", "name or path of a .toml file", known(*scenario_names()), default="ground"
    )
    sensors: str | None = option(
        "--sensors SUITE",
        "sensors of the vehicle (default the scenario's, mocap where they have no noise)",
        one_of("suite", *(name for name in SUITE_NAMES if name != PERFECT)),
    )
    airframe: str | None = option(
        "--airframe NAME",
        "vehicle that comes with Pandion, or a .toml file (default the scenario's)",
    )
    rate_hz: int = option("--rate HZ", "steps a second, 250 or 500", rate, default=250)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Params(_Plant):
    out: Path | None = option("--out FILE", "write a .params file as well", Path)
    vehicle: str | None = option(
        "--vehicle ADDRESS",
        "set them in the PX4 at udp:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD, and the origin",
    )
    origin: Place = declared(ORIGIN)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Identify:
    link: str = option(
        "--autopilot-link ADDRESS",
        "PX4, as of pandion fsw: udp:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD",
        default="udp:127.0.0.1:14580",
    )
    flown: str = option(
        "--vehicle NAME",
        "vehicle that it flies: one that comes with Pandion, or a .toml file",
        default="paper",
    )
    out: Path = option(
        "--out FILE",
        "write the parameters for pandion fsw --params",
        Path,
        default=Path("px4-loops.params"),
    )
    wait_s: float = option(
        "--wait S", "how long to wait for the vehicle, in seconds", seconds, default=120.0
    )


def main(argv: list[str]) -> int:
    """Do one thing; returns the exit code."""
    found = read_action("pandion px4", _USAGE, _PURPOSE, ACTIONS, argv)
    if isinstance(found, int):
        return found
    options, act = found
    try:
        return act(options)
    except (ScenarioError, LinkError) as error:
        print_error("pandion px4", error)
        return COULD_NOT_START


def parameters(options: _Plant) -> dict[str, int | float]:
    """What PX4 needs for this plant, by name.

    Raises:
        ScenarioError: There is no such scenario, or it cannot be flown.
    """
    from sitl.px4_parameters import px4_parameters
    from sitl.sensors.keys import MeasuredSensors
    from sitl.start import flown_vehicle

    scenario = load_scenario(options.scenario, options.sensors, options.airframe)
    if suite_of(scenario) == PERFECT:
        scenario = load_scenario(options.scenario, NOISY, options.airframe)
    assert isinstance(scenario.sensors, MeasuredSensors)
    return px4_parameters(flown_vehicle(scenario), scenario.sensors, options.rate_hz)


def _print_parameters(options: _Params) -> int:
    from fsw.autopilot.parameters.param_type import as_text

    values = parameters(options)
    for name, value in values.items():
        print(f"param set {name} {as_text(value)}")
    if options.out is not None:
        from fsw.storage.parameter_file import as_params

        text = as_params(values).replace("Stack: Pandion", "Stack: PX4 Pro")
        if not written("pandion px4", (options.out, text)):
            return FAILED
    return DONE if options.vehicle is None else _set_all(options, values)


def _set_all(options: _Params, values: dict[str, int | float]) -> int:
    from pandion.param_vehicle import NoAnswer, ParameterClient, ParameterRefused

    assert options.vehicle is not None
    refused = 0
    with ParameterClient(parse_link_address(options.vehicle)) as vehicle:
        try:
            for name, value in values.items():
                try:
                    vehicle.write(name, value)
                except ParameterRefused as error:
                    refused += 1
                    print_error("pandion px4", f"{name}: {error}")
            vehicle.set_origin(options.origin)
        except NoAnswer as error:
            print_error("pandion px4", error)
            return FAILED
    print(f"{len(values) - refused} of {len(values)} set; restart PX4: some count from then on")
    return FAILED if refused else DONE


def _print_environment(options: _Plant) -> int:
    from fsw.autopilot.parameters.param_type import as_text
    from sitl.px4_parameters import AIRFRAME, MODEL

    print(f"PX4_SYS_AUTOSTART={AIRFRAME}\nPX4_SIM_MODEL={MODEL}")
    for name, value in parameters(options).items():
        beside = _BESIDE * max(1.0, abs(value)) if isinstance(value, float) else 0
        print(f"PX4_PARAM_{name}={as_text(value + beside)}")
    return DONE


def _identify(options: _Identify) -> int:
    from fsw.storage.parameter_file import as_params
    from pandion.px4_identify import NotIdentified, fly, report

    def tell(sentence: str) -> None:
        print(sentence, flush=True)

    try:
        found, config = fly(parse_link_address(options.link), options.flown, tell, options.wait_s)
    except NotIdentified as error:
        print_error("pandion px4", error)
        return FAILED
    values, sentences = report(found, config)
    for sentence in sentences:
        tell(sentence)
    return DONE if written("pandion px4", (options.out, as_params(values))) else FAILED


_USAGE: Final = "[SCENARIO] [options]"
_PURPOSE: Final = "What PX4 needs to fly the simulated vehicle."
ACTIONS: Final[dict[str, tuple[type[Any], Callable[[Any], int], str]]] = {
    "params": (
        _Params,
        _print_parameters,
        "print the parameters PX4 needs; write or set them",
    ),
    "identify": (
        _Identify,
        _identify,
        "find out by a short manoeuvre what the planner above PX4 must know of its loops",
    ),
    "env": (_Plant, _print_environment, "print the environment of PX4's own start command"),
}
