"""What must happen when something fails: the tables of ``expectations.toml``."""

from __future__ import annotations

import math
import re
import typing
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

from command_line.bounded_file import read_bounded
from command_line.bounded_toml import TomlError, toml_table
from command_line.ranges import Range
from sitl.faults.keys import Fault, Kind, Unit, instances
from sitl.scenario_file import SUITE_NAMES, build_table
from sitl.sensors.keys import SuiteName
from studies.fault_matrix.flights import SITUATIONS, FaultFlight, is_believed
from vehicles.vehicle_file import load_vehicle

EXPECTATIONS: Final = Path(__file__).with_suffix(".toml")

NotFlown = dict[str, dict[str, str]]  # reasons by mode and suite
Action: TypeAlias = Literal["goes on", "hold", "return", "land", "descend", "terminate", "ended"]
ACTIONS: Final[tuple[Action, ...]] = typing.get_args(Action)
_UNITS: Final[tuple[str, ...]] = typing.get_args(Unit)
_MAX_BYTES: Final = 1 << 20
_SIGNED: Final = ("wrong", "drifting", "turning", "tilting")  # kinds whose size has a direction


class ExpectationError(ValueError):
    """A file of expectations that cannot be used, in one sentence."""


@dataclass(frozen=True, slots=True)
class Expectation:
    """What must follow a fault: keys of a table, which a mode may change."""

    then: tuple[Action, ...]
    # None, of inf: it may be silent.
    told_within_s: Annotated[float, Range(0.001, 86400.0, or_inf=True)] | None = None
    names: str = ""  # what a text must name, a regular expression
    contact: Literal["none", "ground", "any"] = "none"  # that cannot be helped
    # Least margin to the safe set; where contact is allowed it is not asked.
    margin_mm: Annotated[float, Range(-1e6, 1e6)] = 0.0
    force: Annotated[float, Range(1.0, 100.0)] = 1.0  # at most, over what the surface allows
    why: str = ""
    last: tuple[Action, ...] = ()  # of which the last action must be one; empty: any of ``then``


@dataclass(frozen=True, slots=True)
class _Table:
    """The other keys of a table, but for ``with``, ``in`` and the numbers of a fault."""

    units: tuple[Unit, ...] = ()
    kinds: tuple[Kind, ...] = ()
    # Which of a unit fail, each in a flight of its own; 0: all.
    instances: tuple[Annotated[float, Range(0.0, 8.0, step=1.0)], ...] = (0.0,)
    name: str = ""
    suites: tuple[SuiteName, ...] = ("perfect",)
    mirrored: bool = False
    link: bool = False


_NUMBERS: Final = (
    "duration_s",
    "share",
    "size",
    "axis",
    "delay_ms",
    "rate_hz",
    "forgets_s",
    "jump_s",
)
_EXPECTED: Final = tuple(one.name for one in fields(Expectation))
_OWN: Final = tuple(one.name for one in fields(_Table))
_KNOWN: Final = (*_OWN, "with", "in", *_NUMBERS, *_EXPECTED)


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
    own: _Table = build_table(_Table, {k: table[k] for k in _OWN if k in table}, "")
    found = []
    for faults, name in _faults(own, table):
        modes = _modes(table, _names(faults, names))
        for suite in own.suites:
            if any(is_believed(one, suite) for one in faults):
                raise ExpectationError(
                    f"{name}: with {suite} what a sensor says is believed, unless it is silent "
                    "(off, intermittent); fly it with another suite"
                )
            full = name if suite == "perfect" else f"{name}-{suite}"
            flown = {one: it for one, it in modes.items() if suite not in without.get(one, {})}
            found.append(Expected(full, faults, suite, own.link, flown))
    return found


def _faults(own: _Table, table: dict[str, Any]) -> list[tuple[tuple[Fault, ...], str]]:
    """The faults of each flight, and its name."""
    numbers: dict[str, Any] = {key: table[key] for key in _NUMBERS if key in table}
    more, found = _more(own, table), []
    if not own.units:
        return [((), own.name or "none")]
    for unit in own.units:
        _check_instances(own, unit)
        for kind in own.kinds:
            for instance in own.instances:
                keys: dict[str, Any] = {"unit": unit, "kind": kind, "instance": instance, **numbers}
                fault: Fault = build_table(Fault, keys, "")
                name = f"{unit}-{kind}" + (f"-{instance:g}" if instance else "")
                found.append(((fault, *more), (own.name or name).replace(" ", "-")))
    if not own.mirrored:
        return found
    others = [(_mirrored(faults), f"{name}-mirrored") for faults, name in found]
    others = [other for other, one in zip(others, found, strict=True) if other[0] != one[0]]
    if not others:
        raise ExpectationError(f"mirrored: one of the kinds must be {', '.join(_SIGNED)}")
    return found + others


def _mirrored(faults: tuple[Fault, ...]) -> tuple[Fault, ...]:
    """The faults the other way round: what pushed away from a wall leads into it."""
    return tuple([replace(one, size=-one.size) if one.kind in _SIGNED else one for one in faults])


def _more(own: _Table, table: dict[str, Any]) -> tuple[Fault, ...]:
    """Faults in the same flight; their ``start_s`` counts from the first one."""
    tables = table.get("with", [])
    if not isinstance(tables, list) or (tables and not (own.units and own.name)):
        raise ExpectationError(
            "with must be an array of tables, each a fault beside that of units and kinds, and "
            "needs a name"
        )
    return tuple(build_table(Fault, one, f"with[{k}]") for k, one in enumerate(tables))


def _check_instances(own: _Table, unit: Unit) -> None:
    most = instances(unit, load_vehicle("paper"))
    for k, one in enumerate(own.instances):
        if one > most:
            allowed = f"0 (all) to {most}" if most else "0 alone: there is one"
            raise ExpectationError(f"instances[{k}] = {one:g}: must be, of a {unit}, {allowed}")


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
    found: Expectation = build_table(Expectation, keys, "")
    for wrong, sentence in (
        (not found.then, f"then must name at least one of {', '.join(ACTIONS)}"),
        (
            not set(found.last) <= set(found.then),
            f"last = {list(found.last)}: must be among then, {', '.join(found.then)}",
        ),
        (
            found.contact != "none" and not found.why,
            f'contact = "{found.contact}" needs a reason: why',
        ),
        (
            found.margin_mm < 0.0 and not found.why,
            f"margin_mm = {found.margin_mm:g} needs a reason: why",
        ),
        (found.force > 1.0 and not found.why, f"force = {found.force:g} needs a reason: why"),
    ):
        if wrong:
            raise ExpectationError(sentence)
    if found.told_within_s == math.inf:
        found = replace(found, told_within_s=None)
    if found.told_within_s is not None and not found.names:
        raise ExpectationError("what must be told needs names: what a text must name")
    try:
        re.compile(found.names)
    except re.error as error:
        raise ExpectationError(
            f"names = {found.names!r} is no regular expression: {error}"
        ) from None
    return found


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
