"""What must happen when something fails: the tables of ``expectations.toml``."""

from __future__ import annotations

import math
import re
import typing
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Final, Literal

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from sitl.faults.keys import Fault, Kind, Unit, instances
from sitl.scenario_file import SUITE_NAMES, build_table
from studies.fault_matrix.flights import SITUATIONS, FaultFlight, is_believed
from vehicles.vehicle_file import load_vehicle

EXPECTATIONS: Final = Path(__file__).with_suffix(".toml")
ACTIONS: Final = ("goes on", "hold", "return", "land", "descend", "terminate", "ended")

NotFlown = dict[str, dict[str, str]]  # reasons by mode and suite
Contact = Literal["none", "ground", "any"]
_CONTACTS: Final[tuple[str, ...]] = typing.get_args(Contact)
_UNITS: Final[tuple[str, ...]] = typing.get_args(Unit)
_KINDS: Final[tuple[str, ...]] = typing.get_args(Kind)
_MAX_BYTES: Final = 1 << 20
_SHOWN: Final = 60  # characters of a wrong value
_MAX_MM: Final = 1e6  # of a margin
_MAX_FORCE: Final = 100.0  # over what a surface allows
_MAX_S: Final = 86400.0  # of a time
_NUMBERS: Final = ("duration_s", "share", "size", "axis", "delay_ms", "rate_hz", "jump_s")
_EXPECTED: Final = (
    "told_within_s",
    "names",
    "then",
    "last",
    "contact",
    "margin_mm",
    "force",
    "why",
)
_SIGNED: Final = ("wrong", "drifting", "turning", "tilting")  # kinds whose size has a direction
_KNOWN: Final = (
    "name",
    "units",
    "kinds",
    "instances",
    "with",
    "suites",
    "mirrored",
    "link",
    "in",
    *_NUMBERS,
    *_EXPECTED,
)


class ExpectationError(ValueError):
    """A file of expectations that cannot be used, in one sentence."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """What must follow a fault."""

    then: tuple[str, ...]
    told_within_s: float | None = None  # None: it may be silent
    names: str = ""  # what a text must name, a regular expression
    contact: Contact = "none"  # that cannot be helped
    margin_mm: float = 0.0  # least margin to the safe set; where contact is allowed it is not asked
    force: float = 1.0  # at most, on the tool, over what its surface allows
    why: str = ""
    last: tuple[str, ...] = ()  # of which the last action must be one; empty: any of ``then``


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """Faults as they are flown together, and what must follow in each mode."""

    name: str
    faults: tuple[Fault, ...]  # none, one or more; times count from that of the situation
    suite: str
    link: bool  # needs both processes in real time
    modes: dict[str, Expectation]  # those that are flown with the suite


def not_flown(path: Path = EXPECTATIONS) -> NotFlown:
    """Modes that cannot be flown with a suite at all, and why.

    Raises:
        ExpectationError: It cannot be read, or a table is wrong.
    """
    return _tables(path)[1]


def expectations(path: Path = EXPECTATIONS) -> dict[str, Expected]:
    """All faults of a file by name.

    Raises:
        ExpectationError: It cannot be read, or a table is wrong.
    """
    tables, without, names = _tables(path)
    found: dict[str, Expected] = {}
    for number, table in enumerate(tables):
        try:
            for one in _read(table, without, names):
                if one.name in found:
                    raise ExpectationError(f'"{one.name}" is there twice; give one of them a name')
                found[one.name] = one
        except (TypeError, ValueError, OverflowError) as error:
            raise ExpectationError(f"{path}: faults[{number}]: {error}") from None
    return found


def _tables(path: Path) -> tuple[list[Any], NotFlown, dict[str, str]]:
    try:
        content = read_bounded(path, _MAX_BYTES)
    except OSError as error:
        raise ExpectationError(f"cannot read {path}: {error.strerror}") from error
    try:
        read = toml_table(content.decode("utf-8"))
    except TomlError as error:
        raise ExpectationError(f"{path} is {error}") from error
    except UnicodeDecodeError as error:
        raise ExpectationError(f"{path} is not UTF-8: {error}") from error
    tables, without = read.get("faults", []), read.get("not_flown", {})
    if not isinstance(tables, list):
        raise ExpectationError(f"{path}: faults must be an array of tables ([[faults]])")
    if not isinstance(without, dict) or not all(_is_reason(*one) for one in without.items()):
        raise ExpectationError(f"{path}: not_flown must give a reason for each MODE.SUITE")
    names = read.get("names", {})
    texts = isinstance(names, dict) and all(isinstance(one, str) for one in names.values())
    if not texts or not names.keys() <= set(_UNITS):
        raise ExpectationError(f"{path}: names must give a regular expression for each unit")
    return tables, without, names


def _is_reason(mode: str, by_suite: Any) -> bool:
    """Whether a table of ``not_flown`` has suites, and a sentence for each."""
    return (
        mode in SITUATIONS
        and isinstance(by_suite, dict)
        and by_suite.keys() <= set(SUITE_NAMES)
        and all(isinstance(why, str) and why for why in by_suite.values())
    )


def _read(table: Any, without: NotFlown, names: dict[str, str]) -> list[Expected]:
    """The faults of one table: each unit in each way, each instance, with each suite."""
    if not isinstance(table, dict):
        raise ExpectationError("must be a table")
    for key in table:
        if key not in _KNOWN:
            raise ExpectationError(f'unknown key "{key}" (known: {", ".join(_KNOWN)})')
    suites = _words(table, "suites", SUITE_NAMES, ("perfect",))
    link, found = _truth(table, "link"), []
    for faults, name in _faults(table):
        modes = _modes(table, _names(faults, names))
        for suite in suites:
            if any(is_believed(one, suite) for one in faults):
                raise ExpectationError(
                    f"{name}: with {suite} what a sensor says is believed, unless it is silent "
                    "(off, intermittent); fly it with another suite"
                )
            full = name if suite == "perfect" else f"{name}-{suite}"
            flown = {one: it for one, it in modes.items() if suite not in without.get(one, {})}
            found.append(Expected(full, faults, suite, link, flown))
    return found


def _truth(table: dict[str, Any], key: str) -> bool:
    value = table.get(key, False)
    if not isinstance(value, bool):
        raise ExpectationError(f"{key} = {_shown(value)}: must be true or false")
    return value


def _faults(table: dict[str, Any]) -> list[tuple[tuple[Fault, ...], str]]:
    """The faults of each flight, and its name."""
    units = _words(table, "units", _UNITS, ())
    kinds = _words(table, "kinds", _KINDS, ())
    numbers: dict[str, Any] = {key: table[key] for key in _NUMBERS if key in table}
    given = table.get("name")
    if given is not None and not (isinstance(given, str) and given):
        raise ExpectationError(f"name = {_shown(given)}: must be a text")
    more, found = _more(table), []
    if not units:
        return [((), given or "none")]
    for unit in units:
        instances = _instances(table, typing.cast(Unit, unit))
        for kind in kinds:
            for instance in instances:
                keys: dict[str, Any] = {"unit": unit, "kind": kind, "instance": instance, **numbers}
                fault: Fault = build_table(Fault, keys, "")
                name = f"{unit}-{kind}" + (f"-{instance}" if instance else "")
                found.append(((fault, *more), (given or name).replace(" ", "-")))
    if not _truth(table, "mirrored"):
        return found
    others = [(_mirrored(faults), f"{name}-mirrored") for faults, name in found]
    others = [other for other, one in zip(others, found, strict=True) if other[0] != one[0]]
    if not others:
        raise ExpectationError(f"mirrored: one of the kinds must be {', '.join(_SIGNED)}")
    return found + others


def _mirrored(faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
    """The faults the other way round: what pushed away from a wall leads into it."""
    return tuple([replace(one, size=-one.size) if one.kind in _SIGNED else one for one in faults])


def _more(table: dict[str, Any]) -> tuple[Fault, ...]:
    """Faults in the same flight; their ``start_s`` counts from the first one."""
    tables = table.get("with", [])
    if not isinstance(tables, list) or (tables and not (table.get("units") and table.get("name"))):
        raise ExpectationError(
            "with must be an array of tables, each a fault beside that of units and kinds, and "
            "needs a name"
        )
    return tuple(build_table(Fault, one, f"with[{k}]") for k, one in enumerate(tables))


def _instances(table: dict[str, Any], unit: Unit) -> list[int]:
    """Which of a unit fail, each in a flight of its own."""
    found, most = table.get("instances", [0]), instances(unit, load_vehicle("paper"))
    allowed = f"whole numbers from 0 (all) to {most}" if most else "0 alone: there is one"
    if not isinstance(found, list):
        raise ExpectationError(
            f"instances = {_shown(found)}: must be an array; of a {unit} {allowed}"
        )
    for k, one in enumerate(found):
        if isinstance(one, bool) or not isinstance(one, int) or not 0 <= one <= most:
            raise ExpectationError(
                f"instances[{k}] = {_shown(one)}: must be, of a {unit}, {allowed}"
            )
    return found


def _shown(value: Any) -> str:
    """A value of the file as far as a sentence has room for it."""
    text = repr(value)
    return text if len(text) <= _SHOWN else f"{text[:_SHOWN]}…"


def _names(faults: tuple[Fault, ...], names: dict[str, str]) -> str:
    """What a text must name, where its table does not say: the first one's unit and number."""
    return names.get(faults[0].unit, "").replace("#", str(faults[0].number)) if faults else ""


def _modes(table: dict[str, Any], names: str) -> dict[str, Expectation]:
    common: dict[str, Any] = {"names": names}
    common |= {key: table[key] for key in _EXPECTED if key in table}
    differs = table.get("in", {})
    if not isinstance(differs, dict):
        raise ExpectationError("in must be a table of modes")
    for mode, keys in differs.items():
        if mode not in SITUATIONS:
            raise ExpectationError(f'"in.{mode}": a mode is one of {", ".join(SITUATIONS)}')
        if not isinstance(keys, dict) or not set(keys) <= set(_EXPECTED):
            raise ExpectationError(f'"in.{mode}" may have {", ".join(_EXPECTED)}')
    return {mode: _expectation({**common, **differs.get(mode, {})}) for mode in SITUATIONS}


def _expectation(keys: dict[str, Any]) -> Expectation:
    then, last = _actions(keys)
    contact = keys.get("contact", "none")
    if contact not in _CONTACTS:
        raise ExpectationError(
            f"contact = {_shown(contact)}: must be one of {', '.join(_CONTACTS)}"
        )
    if contact != "none" and not keys.get("why"):
        raise ExpectationError(f'contact = "{contact}" needs a reason: why')
    margin_mm, force, within_s = _margin_mm(keys), _force(keys), _told_within_s(keys)
    names = keys["names"]
    if not isinstance(names, str):
        raise ExpectationError(f"names = {_shown(names)}: must be a regular expression")
    why = keys.get("why", "")
    if not isinstance(why, str):
        raise ExpectationError(f"why = {_shown(why)}: must be a text")
    if within_s is not None and not names:
        raise ExpectationError("what must be told needs names: what a text must name")
    try:
        re.compile(names)
    except re.error as error:
        raise ExpectationError(f"names = {names!r} is no regular expression: {error}") from None
    return Expectation(then, within_s, names, contact, margin_mm, force, why, last)


def _margin_mm(keys: dict[str, Any]) -> float:
    margin = keys.get("margin_mm", 0.0)
    if not _is_number(margin) or not -_MAX_MM <= margin <= _MAX_MM:
        raise ExpectationError(
            f"margin_mm = {_shown(margin)}: must be a length in mm, from {-_MAX_MM:g} to "
            f"{_MAX_MM:g}"
        )
    if margin < 0.0 and not keys.get("why"):
        raise ExpectationError(f"margin_mm = {margin:g} needs a reason: why")
    return float(margin)


def _force(keys: dict[str, Any]) -> float:
    force = keys.get("force", 1.0)
    if not _is_number(force) or not 1.0 <= force <= _MAX_FORCE:
        raise ExpectationError(
            f"force = {_shown(force)}: must be a share of the largest, from 1 to {_MAX_FORCE:g}"
        )
    if force > 1.0 and not keys.get("why"):
        raise ExpectationError(f"force = {force:g} needs a reason: why")
    return float(force)


def _told_within_s(keys: dict[str, Any]) -> float | None:
    told = keys.get("told_within_s", math.inf)
    if not _is_number(told) or not (0.0 < told <= _MAX_S or told == math.inf):
        raise ExpectationError(
            f"told_within_s = {_shown(told)}: must be a time above 0, in seconds, up to {_MAX_S:g}"
            " or inf"
        )
    return float(told) if told < math.inf else None


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _actions(keys: dict[str, Any]) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Actions that may follow, and those of which the last must be one."""
    then, last = _words(keys, "then", ACTIONS, ()), _words(keys, "last", ACTIONS, ())
    if not then:
        raise ExpectationError(f"then must name at least one of {', '.join(ACTIONS)}")
    if not set(last) <= set(then):
        raise ExpectationError(f"last = {list(last)}: must be among then, {', '.join(then)}")
    return then, last


def _words(
    table: dict[str, Any], key: str, known: tuple[str, ...], default: tuple[str, ...]
) -> tuple[str, ...]:
    words = table.get(key, list(default))
    if not isinstance(words, list):
        raise ExpectationError(f"{key} = {_shown(words)}: must be an array, of {', '.join(known)}")
    for word in words:
        if word not in known:
            raise ExpectationError(f"{key}: {_shown(word)} is not one of {', '.join(known)}")
    return tuple(words)


def differences(mode: str, expected: Expectation, seen: FaultFlight) -> tuple[str, ...]:
    """What of a cell is not as it must be, in words."""
    found = []
    if seen.problem:
        return (seen.problem,)
    within_s = expected.told_within_s
    if within_s is not None:
        found += _untold(seen, expected.names, within_s)
    actions = seen.actions or ("goes on",)
    wrong = [action for action in actions if not _allowed(mode, action, expected.then)]
    if wrong:
        found.append(f"{', then '.join(actions)}; must be {' or '.join(expected.then)}")
    elif not _allowed(mode, actions[-1], expected.last or expected.then):
        found.append(f"{', then '.join(actions)}; must end with {' or '.join(expected.last)}")
    if seen.contact and expected.contact not in ("any", seen.contact):
        found.append(seen.ended)
    if not seen.force_share <= expected.force:  # NaN is more
        found.append(f"{seen.force_share:.0%} of the force; must be {expected.force:.0%} at most")
    min_mm = math.inf if seen.least_m is None else 1e3 * seen.least_m
    if expected.contact == "none" and not min_mm >= expected.margin_mm:  # NaN is less
        found.append(f"margin {min_mm:.1f} mm; must be {expected.margin_mm:g} mm")
    return tuple(found)


def _untold(seen: FaultFlight, names: str, within_s: float) -> list[str]:
    """What is wrong with what was told; another text than the one that ``names`` it is none."""
    if seen.warning is None:
        return ["silent"]
    named = next((one for one in seen.warnings if re.search(names, one.text)), None)
    if named is None:
        return [f'no text names "{names}"']
    if not named.after_s <= within_s:  # NaN is late
        return [f"told after {named.after_s:.2f} s, not within {within_s:g} s"]
    return []


def _allowed(mode: str, action: str, then: tuple[str, ...]) -> bool:
    """Whether an action is one of those; a vehicle that holds or lands already goes on."""
    same = {"hold": ("hold",), "land": ("hold", "land")}.get(mode, ())
    return action in then or (action == "goes on" and any(one in then for one in same))
