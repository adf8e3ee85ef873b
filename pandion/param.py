"""``pandion param``: parameters of a running vehicle or in a file."""

from __future__ import annotations

import fnmatch
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, TypeAlias

from command_line.actions import read_action
from command_line.options import OneOf, option, switch
from command_line.output import json_text, print_error, say
from command_line.parser import COULD_NOT_START, unknown_name
from command_line.toml_tables import shown
from command_line.values import plain_float
from messages.addresses import LinkError, parse_link_address

if TYPE_CHECKING:
    from fsw.storage.parameter_file import Loaded
    from pandion.param_vehicle import ParameterClient

DONE, REFUSED = 0, 1  # exit codes
_WHERE: Final = OneOf()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Where:
    """Whose parameters."""

    vehicle: str = option(
        "--vehicle ADDRESS",
        "of the vehicle: udp:HOST:PORT, tcp:HOST:PORT or serial:DEVICE:BAUD",
        default="udp:127.0.0.1:14580",
        one_of=_WHERE,
    )
    file: Path | None = option("--file FILE", "a parameter file, instead", Path, one_of=_WHERE)


def _as_json() -> Any:
    return switch("--json", "as JSON, with all metadata")


@dataclass(frozen=True, slots=True, kw_only=True)
class _List(_Where):
    pattern: str = option("PATTERN", "of names", default="*")
    changed: bool = switch("--changed", "only values that are not the default")
    json: bool = _as_json()


@dataclass(frozen=True, slots=True, kw_only=True)
class _Get(_Where):
    names: list[str] = option("NAME ...", "of a parameter", required=True)
    json: bool = _as_json()


def _value(text: str) -> float:
    value = plain_float(text)
    if math.isnan(value):
        raise ValueError(f"{shown(text)} is not a number")
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class _Set(_Where):
    name: str = option("NAME", "of the parameter", required=True)
    value: float = option("VALUE", "in the parameter's unit", _value, required=True)


@dataclass(frozen=True, slots=True, kw_only=True)
class _File(_Where):
    path: Path = option("FILE", ".params or .parm", Path, required=True)


class FileValues:
    """Parameters in a file; those it does not name are as the flight software has them."""

    def __init__(self, path: Path) -> None:
        """Nothing is read yet."""
        self._path = path

    def read_all(self) -> dict[str, float]:
        """Every value, by name."""
        from fsw.autopilot.parameters.registry import PARAMETERS

        return {parameter.name: parameter.default for parameter in PARAMETERS} | self._kept()

    def write(self, name: str, value: float) -> None:
        """Change one parameter in the file to ``value`` [the parameter's unit].

        Raises:
            ParameterRefused: It is out of range or contradicts the others.
        """
        from fsw.autopilot.parameters.facts import ALIASES
        from fsw.autopilot.parameters.flight_config import FlightConfig
        from fsw.autopilot.parameters.registry import BY_NAME, tuning_of
        from fsw.autopilot.tuning import tuned
        from fsw.storage.parameter_file import save
        from pandion.param_vehicle import ParameterRefused

        parameter = BY_NAME.get(ALIASES.get(name, name))
        if parameter is None:
            raise ParameterRefused(unknown_name("parameter", name, BY_NAME))
        refusal = parameter.refusal(value)
        if refusal is not None:
            raise ParameterRefused(refusal)
        kept = self._kept() | {parameter.name: parameter.kept(value)}
        try:
            tuned(FlightConfig(), tuning_of(kept))
        except ValueError as error:
            raise ParameterRefused(f"{name} is left as it is: {error}") from None
        save(self._path, kept)

    def _kept(self) -> dict[str, float]:
        if not self._path.exists():
            return {}
        return _read_file(self._path).values


Values: TypeAlias = "FileValues | ParameterClient"


def main(argv: list[str]) -> int:
    """Do one thing with parameters; returns the exit code."""
    found = read_action("pandion param", _USAGE, _PURPOSE, ACTIONS, argv)
    if isinstance(found, int):
        return found
    options, act = found
    from pandion.param_vehicle import NoAnswer, ParameterClient, ParameterRefused

    try:
        if options.file is not None:
            if act not in (_set, _import):  # which may begin a file
                options.file.stat()
            return act(options, FileValues(options.file))
        with ParameterClient(parse_link_address(options.vehicle)) as vehicle:
            return act(options, vehicle)
    except (LinkError, NoAnswer, OSError) as error:
        print_error("pandion param", error)
        return COULD_NOT_START
    except ParameterRefused as error:
        print_error("pandion param", error)
        return REFUSED
    except KeyboardInterrupt:
        print_error("pandion param", "interrupted")
        return REFUSED


def _list(options: _List, values: Values) -> int:
    from fsw.autopilot.parameters.registry import BY_NAME

    shown = {
        name: value
        for name, value in sorted(values.read_all().items())
        if fnmatch.fnmatchcase(name, options.pattern.upper())
        and not (options.changed and name in BY_NAME and value == BY_NAME[name].default)
    }
    _show(shown, as_json=options.json)
    return DONE


def _get(options: _Get, values: Values) -> int:
    from pandion.param_vehicle import ParameterRefused

    known = values.read_all()
    for name in options.names:
        if name not in known:
            raise ParameterRefused(unknown_name("parameter", name, known))
    _show({name: known[name] for name in options.names}, as_json=options.json)
    return DONE


def _set(options: _Set, values: Values) -> int:
    values.write(options.name, options.value)
    say(f"{options.name} is {_number(options.value)}")
    return DONE


def _import(options: _File, values: Values) -> int:
    from pandion.param_vehicle import ParameterRefused

    loaded, held = _read_file(options.path), values.read_all()
    changed, refused = 0, loaded.unusable
    for name, value in loaded.values.items():
        if held.get(name) == value:
            continue
        try:
            values.write(name, value)
            changed += 1
        except ParameterRefused as error:
            print_error("pandion param", error)
            refused += 1
    print(f"{len(loaded.values)} parameters read, {changed} changed, {refused} refused")
    return REFUSED if refused else DONE


def _export(options: _File, values: Values) -> int:
    from fsw.storage.parameter_file import save

    known = values.read_all()
    # A reader of the file would refuse such a line.
    kept = {name: value for name, value in known.items() if math.isfinite(value)}
    save(options.path, kept)
    say(f"{len(kept)} parameters written to {options.path}")
    if len(kept) < len(known):
        names = ", ".join(sorted(known.keys() - kept.keys()))
        print_error("pandion param", f"left out, because the value is not a finite number: {names}")
        return REFUSED
    return DONE


def _read_file(path: Path) -> Loaded:
    """The values of a file; unusable lines are reported on standard error."""
    from fsw.storage.parameter_file import load

    loaded = load(path)
    for complaint in loaded.complaints:
        print_error("pandion param", f"{path}, {complaint}")
    return loaded


def _show(values: Mapping[str, float], *, as_json: bool) -> None:
    if as_json:
        print(json_text([_described(name, value) for name, value in values.items()], 2))
        return
    for name, value in values.items():
        entry = _described(name, value)
        star = " " if value == entry.get("default", value) else "*"
        unit, meaning = entry.get("unit", ""), entry.get("meaning", "")
        say(f"{name:<16} {star}{_number(value):>10} {unit:<9} {meaning}".rstrip())


def _described(name: str, value: float) -> dict[str, Any]:
    from fsw.autopilot.parameters.facts import FACT_BY_NAME, GROUP
    from fsw.autopilot.parameters.param_type import type_name
    from fsw.autopilot.parameters.registry import BY_NAME

    entry: dict[str, Any] = {"name": name, "value": value, "type": type_name(value)}
    if (fact := FACT_BY_NAME.get(name)) is not None:
        kind = f"the value of {fact.repeats}" if fact.repeats else f"{fact.meaning} (read only)"
        meaning = f"{fact.label}: {kind}"
        entry |= {"unit": fact.unit, "group": GROUP, "meaning": meaning}
    elif (parameter := BY_NAME.get(name)) is not None:
        entry |= {
            "default": parameter.default,
            "unit": parameter.unit,
            "min": parameter.least,
            "max": parameter.most,
            "group": parameter.group,
            "meaning": parameter.meaning,
        }
    return entry  # bare if it is of a vehicle with another version


def _number(value: float) -> str:
    from fsw.autopilot.parameters.param_type import as_text

    return as_text(value)


_USAGE: Final = "[options] [--vehicle ADDRESS | --file FILE]"
_PURPOSE: Final = "Parameters of a running vehicle or in a file."
ACTIONS: Final[dict[str, tuple[type[_Where], Callable[[Any, Values], int], str]]] = {
    "list": (_List, _list, "Show parameters; in PATTERN * and ? stand for anything."),
    "get": (_Get, _get, "Show parameters by name."),
    "set": (_Set, _set, "Change one parameter."),
    "import": (_File, _import, "Set every value of a .params or .parm file."),
    "export": (
        _File,
        _export,
        "Write all parameters; .parm is MAVProxy's format, anything else QGroundControl's.",
    ),
}
