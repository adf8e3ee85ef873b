"""Rotors beside a URDF: from a table of a vehicle's file, or from PX4's parameters."""

from __future__ import annotations

import math
import re
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any, Final, get_type_hints

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from command_line.toml_tables import TableReader, shown
from command_line.values import plain_float
from vehicles.description import ROTORS_MAX, Rotor
from vehicles.vehicle_file import VehicleError

_MOST_BYTES: Final = 1024 * 1024
# PX4's defaults of what a file does not say.
_DEFAULTS: Final = {"PX": 0.0, "PY": 0.0, "PZ": 0.0, "AX": 0.0, "AY": 0.0, "AZ": -1.0,
                    "CT": 6.5, "KM": 0.05}  # fmt: skip
_NAME: Final = re.compile(r"CA_ROTOR(\d+)_(PX|PY|PZ|AX|AY|AZ|CT|KM)", re.ASCII)
_MAX_NAME: Final = 16  # characters, of any parameter of PX4
_MAX_VALUE: Final = 1e6  # of one; none has such


@dataclass(frozen=True, slots=True, kw_only=True)
class _Rotors:
    rotors: tuple[Rotor, ...]


def read_rotors(path: Path) -> tuple[tuple[Rotor, ...], list[str]]:
    """The rotors of a file and what was assumed, a sentence each.

    It is .toml with [[rotors]], anything else PX4's parameters.

    Raises:
        VehicleError: It cannot be read, or says what cannot be.
    """
    try:
        text = read_bounded(path, _MOST_BYTES).decode("utf-8-sig")
    except OSError as error:
        raise VehicleError(f"cannot read rotors {path}: {error.strerror}") from error
    except UnicodeDecodeError:
        raise VehicleError(f"rotors {path} are not UTF-8") from None
    if path.suffix != ".toml":
        return rotors_from_parameters(text)
    try:
        table = toml_table(text)
    except TomlError as error:
        raise VehicleError(f"rotors {path} are {error}") from error
    # A whole vehicle's file will do as well.
    own = {"rotors": table["rotors"]} if "rotors" in table else {}
    return _built(own), _assumed(_missing(own["rotors"]))


def _built(table: dict[str, Any]) -> tuple[Rotor, ...]:
    found: _Rotors = TableReader(VehicleError).build(_Rotors, table, "")
    return found.rotors


def rotors_from_parameters(text: str) -> tuple[tuple[Rotor, ...], list[str]]:
    """The rotors that PX4's parameters ``CA_ROTORn_*`` describe, of a file of QGroundControl.

    And what was assumed, a sentence each.

    CT is the thrust at full command [N], KM the torque per thrust [m], positive for a rotor that
    turns counter-clockwise.

    Raises:
        VehicleError: It has none, or says what cannot be.
    """
    values: dict[str, float] = {}
    for number, line in enumerate(text.splitlines(), start=1):
        words = line.split()
        at = next((k for k, word in enumerate(words) if word.startswith("CA_ROTOR")), None)
        if at is None or line.lstrip().startswith("#"):
            continue
        value = plain_float("".join(words[at + 1 : at + 2]))
        if not abs(value) <= _MAX_VALUE or len(words[at]) > _MAX_NAME:
            raise VehicleError(
                f"line {number} = {shown(line)}: must be a name of at most {_MAX_NAME} characters "
                f"and a number from {-_MAX_VALUE:g} to {_MAX_VALUE:g}"
            )
        values[words[at]] = value
    known = [match for name in values if (match := _NAME.fullmatch(name))]
    count = values.get("CA_ROTOR_COUNT", 1 + max((int(m[1]) for m in known), default=-1))
    if count not in range(1, ROTORS_MAX + 1):
        raise VehicleError(
            f"CA_ROTOR_COUNT = {count:g}: must be 4 to {ROTORS_MAX}; a file of parameters with "
            "CA_ROTORn_PX and others describes the rotors"
        )
    missing = [
        f"CA_ROTORn_{key} = {default:g}"
        for key, default in _DEFAULTS.items()
        if any(f"CA_ROTOR{i}_{key}" not in values for i in range(int(count)))
    ]
    # All other numbers of a rotor PX4 does not know.
    missing += _missing([("torque_per_thrust",)])
    tables = [_rotor(values, i) for i in range(int(count))]
    return _built({"rotors": tables}), _assumed(missing)


def _missing(tables: Sequence[Collection[str]]) -> list[str]:
    """The numbers of rotors that not each table has, with their defaults."""
    hints = get_type_hints(Rotor, include_extras=True)
    return [
        f"{one.name} = {one.default:g} {hints[one.name].__metadata__[0].unit}"
        for one in fields(Rotor)
        if isinstance(one.default, float) and any(one.name not in table for table in tables)
    ]


def _assumed(missing: Iterable[str]) -> list[str]:
    listed = ", ".join(missing)
    return (
        [f"rotors: not given for each, so assumed: {listed}: put in the real ones"]
        if listed
        else []
    )


def _rotor(values: dict[str, float], i: int) -> dict[str, Any]:
    """As a table of a vehicle's file, whose ranges then hold here too."""
    v = {key: values.get(f"CA_ROTOR{i}_{key}", default) for key, default in _DEFAULTS.items()}
    length = math.hypot(v["AX"], v["AY"], v["AZ"])
    if not length > 0.0:
        raise VehicleError(f"CA_ROTOR{i}_AX, _AY, _AZ: must be a direction, are all 0")
    return {
        "position": [v["PX"], v["PY"], v["PZ"]],
        "axis": [v["AX"] / length, v["AY"] / length, v["AZ"] / length],
        "spin": "ccw" if v["KM"] > 0.0 else "cw",
        "torque_per_thrust": abs(v["KM"]),
        "thrust_max": v["CT"],
    }
