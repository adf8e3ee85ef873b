"""``pandion param``: parameters of a running vehicle or in a file."""

from __future__ import annotations

import argparse
import fnmatch
import json
import sys
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final, Protocol

from fsw.link.udp_endpoint import LinkError, parse_address
from pandion.parser import COULD_NOT_START, Parser, unknown_name

if TYPE_CHECKING:
    pass

DONE, REFUSED = 0, 1  # exit codes

HELP: Final = """\
usage: pandion param ACTION [arguments] [--vehicle udp:HOST:PORT | --file FILE]

actions:
  list [PATTERN]        show parameters, * and ? stand for anything
  get NAME ...          show these
  set NAME VALUE        change one
  import FILE           take over every value of a .params or .parm file
  export FILE           write all of them; .parm is MAVProxy's format, else QGroundControl's

`pandion param ACTION --help` prints the options of an action.
"""


class Values(Protocol):
    """Where parameters are."""

    def read_all(self) -> Mapping[str, float]:
        """Every value, by name."""
        ...

    def write(self, name: str, value: float) -> None:
        """Change one value."""
        ...


class FileValues:
    """Parameters in a file; those it does not name are as the flight software has them."""

    def __init__(self, path: Path) -> None:
        """Nothing is read yet."""
        self._path = path

    def read_all(self) -> dict[str, float]:
        """Every value, by name."""
        from fsw.parameters.registry import PARAMETERS

        return {parameter.name: parameter.default for parameter in PARAMETERS} | self._kept()

    def write(self, name: str, value: float) -> None:
        """Change one value in the file.

        Raises:
            Refused: It is out of range or contradicts the others.
        """
        from fsw.parameters.flight_config import FlightConfig
        from fsw.parameters.float32 import nearest_decimal
        from fsw.parameters.registry import BY_NAME
        from fsw.parameters.storage import save
        from fsw.tuning import tuned
        from pandion.param_vehicle import Refused

        parameter = BY_NAME.get(name)
        if parameter is None:
            raise Refused(unknown_name("parameter", name, BY_NAME))
        refusal = parameter.refusal(value)
        if refusal is not None:
            raise Refused(refusal)
        kept = self._kept() | {name: nearest_decimal(value)}
        try:
            tuned(
                FlightConfig(),
                tuple((BY_NAME[n].path, v * BY_NAME[n].scale) for n, v in kept.items()),
            )
        except ValueError as error:
            raise Refused(f"{name} is left as it is: {error}") from None
        save(self._path, kept)

    def _kept(self) -> dict[str, float]:
        if not self._path.exists():
            return {}
        return _read_file(self._path)


def main(argv: list[str]) -> int:
    """Do one thing with parameters; returns the exit code."""
    if not argv or argv[0] in ("-h", "--help"):
        print(HELP, end="")
        return DONE
    action = ACTIONS.get(argv[0])
    if action is None:
        print(f"pandion param: {unknown_name('action', argv[0], ACTIONS)}", file=sys.stderr)
        return COULD_NOT_START
    arguments = _parser(argv[0]).read(argv[1:])
    from pandion.param_vehicle import NoAnswer, ParameterClient, Refused

    try:
        if arguments.file is not None:
            return action(arguments, FileValues(arguments.file))
        with ParameterClient(parse_address(arguments.vehicle)) as vehicle:
            return action(arguments, vehicle)
    except (LinkError, NoAnswer, OSError) as error:
        print(f"pandion param: {error}", file=sys.stderr)
        return COULD_NOT_START
    except Refused as error:
        print(f"pandion param: {error}", file=sys.stderr)
        return REFUSED
    except KeyboardInterrupt:
        print("pandion param: interrupted", file=sys.stderr)
        return REFUSED


def _parser(action: str) -> Parser:
    parser = Parser(f"pandion param {action}", "Parameters of a running vehicle or in a file.")
    if action == "list":
        parser.add_argument("pattern", metavar="PATTERN", nargs="?", default="*", help="of names")
        parser.add_argument("--changed", action="store_true", help="only what is not the default")
    elif action == "get":
        parser.add_argument("names", metavar="NAME", nargs="+", help="of a parameter")
    elif action == "set":
        parser.add_argument("name", metavar="NAME", help="of the parameter")
        parser.add_argument("value", metavar="VALUE", type=float, help="in the parameter's unit")
    else:
        parser.add_argument("path", metavar="FILE", type=Path, help=".params or .parm")
    if action in ("list", "get"):
        parser.add_argument(
            "--json", action="store_true", help="for programs, with all that is known"
        )
    where = parser.add_mutually_exclusive_group()
    where.add_argument(
        "--vehicle",
        metavar="udp:HOST:PORT",
        default="udp:127.0.0.1:14580",
        help="where the vehicle listens (default %(default)s)",
    )
    where.add_argument("--file", metavar="FILE", type=Path, help="a parameter file, instead")
    return parser


def _list(arguments: argparse.Namespace, values: Values) -> int:
    from fsw.parameters.registry import BY_NAME

    shown = {
        name: value
        for name, value in sorted(values.read_all().items())
        if fnmatch.fnmatchcase(name, arguments.pattern.upper())
        and not (arguments.changed and name in BY_NAME and value == BY_NAME[name].default)
    }
    _show(shown, as_json=arguments.json)
    return DONE


def _get(arguments: argparse.Namespace, values: Values) -> int:
    from pandion.param_vehicle import Refused

    known = values.read_all()
    for name in arguments.names:
        if name not in known:
            raise Refused(unknown_name("parameter", name, known))
    _show({name: known[name] for name in arguments.names}, as_json=arguments.json)
    return DONE


def _set(arguments: argparse.Namespace, values: Values) -> int:
    values.write(arguments.name, arguments.value)
    print(f"{arguments.name} is {_number(arguments.value)}")
    return DONE


def _import(arguments: argparse.Namespace, values: Values) -> int:
    from pandion.param_vehicle import Refused

    wanted, held = _read_file(arguments.path), values.read_all()
    changed = refused = 0
    for name, value in wanted.items():
        if held.get(name) == value:
            continue
        try:
            values.write(name, value)
            changed += 1
        except Refused as error:
            print(f"pandion param: {error}", file=sys.stderr)
            refused += 1
    print(f"{len(wanted)} parameters read, {changed} changed, {refused} refused")
    return REFUSED if refused else DONE


def _export(arguments: argparse.Namespace, values: Values) -> int:
    from fsw.parameters.storage import save

    known = values.read_all()
    save(arguments.path, known)
    print(f"{len(known)} parameters written to {arguments.path}")
    return DONE


def _read_file(path: Path) -> dict[str, float]:
    """The values of a file; what is of no use in it is said on standard error."""
    from fsw.parameters.storage import load

    loaded = load(path)
    for complaint in loaded.complaints:
        print(f"pandion param: {path}, {complaint}", file=sys.stderr)
    return loaded.values


def _show(values: Mapping[str, float], *, as_json: bool) -> None:
    if as_json:
        print(json.dumps([_described(name, value) for name, value in values.items()], indent=2))
        return
    for name, value in values.items():
        entry = _described(name, value)
        star = " " if value == entry.get("default", value) else "*"
        unit, meaning = entry.get("unit", ""), entry.get("meaning", "")
        print(f"{name:<16} {star}{_number(value):>10} {unit:<9} {meaning}".rstrip())


def _described(name: str, value: float) -> dict[str, Any]:
    from fsw.parameters.facts import FACT_BY_NAME, GROUP
    from fsw.parameters.registry import BY_NAME

    parameter, fact = BY_NAME.get(name), FACT_BY_NAME.get(name)
    if fact is not None:
        told = {
            "unit": fact.unit,
            "group": GROUP,
            "meaning": f"{fact.label}: {fact.meaning} (read only)",
        }
        return {"name": name, "value": value, **told}
    if parameter is None:  # of a vehicle with another version
        return {"name": name, "value": value}
    return {
        "name": name,
        "value": value,
        "default": parameter.default,
        "unit": parameter.unit,
        "min": parameter.least,
        "max": parameter.most,
        "group": parameter.group,
        "meaning": parameter.meaning,
    }


def _number(value: float) -> str:
    from fsw.parameters.float32 import as_text

    return as_text(value)


ACTIONS: Final[dict[str, Callable[[argparse.Namespace, Values], int]]] = {
    "list": _list,
    "get": _get,
    "set": _set,
    "import": _import,
    "export": _export,
}
