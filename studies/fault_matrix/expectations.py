"""What must happen when something fails: the tables of ``expectations.toml``."""

from __future__ import annotations

import math
import re
import tomllib
import typing
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final, Literal

from command_line.bounded_file import read_bounded
from sitl.faults.keys import Fault, Kind, Unit
from sitl.scenario_file import SUITE_NAMES
from studies.fault_matrix.flights import SITUATIONS, FaultFlight

EXPECTATIONS: Final = Path(__file__).with_suffix(".toml")
ACTIONS: Final = ("goes on", "hold", "return", "land", "descend", "terminate", "ended")

NotFlown = dict[str, dict[str, str]]  # reasons by mode and suite
Contact = Literal["none", "ground", "any"]
_CONTACTS: Final[tuple[str, ...]] = typing.get_args(Contact)
_UNITS: Final[tuple[str, ...]] = typing.get_args(Unit)
_KINDS: Final[tuple[str, ...]] = typing.get_args(Kind)
_MOST_BYTES: Final = 1 << 20
_NUMBERS: Final = ("duration_s", "share", "size", "delay_ms", "rate_hz", "jump_s")
_EXPECTED: Final = ("told_within_s", "names", "then", "last", "contact", "margin_mm", "why")
_KNOWN: Final = (
    "name",
    "units",
    "kinds",
    "instances",
    "suites",
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
    why: str = ""
    last: tuple[str, ...] = ()  # of which the last action must be one; empty: any of ``then``


@dataclass(frozen=True, slots=True, eq=False)
class Expected:
    """One fault as it is flown, and what must follow in each mode."""

    name: str
    fault: Fault | None
    suite: str
    link: bool  # needs both processes in real time
    modes: dict[str, Expectation]  # those that are flown with the suite


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
        content = read_bounded(path, _MOST_BYTES)
    except OSError as error:
        raise ExpectationError(f"cannot read {path}: {error.strerror}") from error
    try:
        read = tomllib.loads(content.decode("utf-8"))
    except ValueError as error:  # no UTF-8, no TOML, or an integer of thousands of digits
        raise ExpectationError(f"{path} is not TOML: {error}") from error
    except RecursionError:
        raise ExpectationError(f"{path} is nested too deeply") from None
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
    link = bool(table.get("link", False))
    found = []
    for fault, name in _faults(table):
        modes = _modes(table, _names(fault, names))
        for suite in suites:
            full = name if suite == "perfect" else f"{name}-{suite}"
            flown = {one: it for one, it in modes.items() if suite not in without.get(one, {})}
            found.append(Expected(full, fault, suite, link, flown))
    return found


def _faults(table: dict[str, Any]) -> list[tuple[Fault | None, str]]:
    units = _words(table, "units", _UNITS, ())
    kinds = _words(table, "kinds", _KINDS, ())
    instances = table.get("instances", [0])
    numbers = {key: float(table[key]) for key in _NUMBERS if key in table}
    if not units:
        return [(None, str(table.get("name", "none")))]
    found: list[tuple[Fault | None, str]] = []
    for unit in units:
        for kind in kinds:
            for instance in instances:
                fault = Fault(
                    typing.cast(Unit, unit),
                    typing.cast(Kind, kind),
                    instance=float(instance),
                    **numbers,
                )
                name = f"{unit}-{kind}" + (f"-{instance}" if instance else "")
                found.append((fault, str(table.get("name", name)).replace(" ", "-")))
    return found


def _names(fault: Fault | None, names: dict[str, str]) -> str:
    """What a text of a fault must name, where its table does not say: the unit and its number."""
    return "" if fault is None else names.get(fault.unit, "").replace("#", str(fault.number))


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
        raise ExpectationError(f"contact = {contact!r}: must be one of {', '.join(_CONTACTS)}")
    if contact != "none" and not keys.get("why"):
        raise ExpectationError(f'contact = "{contact}" needs a reason: why')
    margin = keys.get("margin_mm", 0.0)
    if isinstance(margin, bool) or not isinstance(margin, int | float) or math.isnan(margin):
        raise ExpectationError(f"margin_mm = {margin!r}: must be a length in mm")
    if margin < 0.0 and not keys.get("why"):
        raise ExpectationError(f"margin_mm = {margin:g} needs a reason: why")
    told = keys.get("told_within_s", math.inf)
    if isinstance(told, bool) or not isinstance(told, int | float) or not told > 0.0:
        raise ExpectationError(f"told_within_s = {told!r}: must be a time above 0, in seconds")
    within_s = float(told) if told < math.inf else None
    names = keys["names"]
    if not isinstance(names, str):
        raise ExpectationError(f"names = {names!r}: must be a regular expression")
    if within_s is not None and not names:
        raise ExpectationError("what must be told needs names: what a text must name")
    try:
        re.compile(names)
    except re.error as error:
        raise ExpectationError(f"names = {names!r} is no regular expression: {error}") from None
    return Expectation(then, within_s, names, contact, float(margin), keys.get("why", ""), last)


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
        raise ExpectationError(f"{key} = {words!r}: must be an array")
    for word in words:
        if word not in known:
            raise ExpectationError(f"{key}: {word!r} is not one of {', '.join(known)}")
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
    least_mm = math.inf if seen.least_m is None else 1e3 * seen.least_m
    if expected.contact == "none" and least_mm < expected.margin_mm:
        found.append(f"margin {least_mm:.1f} mm; must be {expected.margin_mm:g} mm")
    return tuple(found)


def _untold(seen: FaultFlight, names: str, within_s: float) -> list[str]:
    """What is wrong with what was told; another text than the one that ``names`` it is none."""
    if seen.warning is None:
        return ["silent"]
    named = next((one for one in seen.warnings if re.search(names, one.text)), None)
    if named is None:
        return [f'no text names "{names}"']
    if named.after_s > within_s:
        return [f"told after {named.after_s:.2f} s, not within {within_s:g} s"]
    return []


def _allowed(mode: str, action: str, then: tuple[str, ...]) -> bool:
    """Whether an action is one of those; a vehicle that holds or lands already goes on."""
    same = {"hold": ("hold",), "land": ("hold", "land")}.get(mode, ())
    return action in then or (action == "goes on" and any(one in then for one in same))
