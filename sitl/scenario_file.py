"""Scenario TOML to frozen data; whatever is not exactly right is refused with its reason."""

from __future__ import annotations

import dataclasses
import difflib
import hashlib
import math
import tomllib
import types
import typing
from pathlib import Path
from typing import Any

from sitl.bounds import Choices, Range
from sitl.scenario import Scenario

_DIGITS = 12
PACKAGED = Path(__file__).parent / "scenarios"


class ScenarioError(ValueError):
    """A scenario that cannot be flown; the message says which key and what is allowed."""


def scenario_names() -> tuple[str, ...]:
    """Names of the scenarios that come with the simulator."""
    return tuple(sorted(path.stem for path in PACKAGED.glob("*.toml")))


def load_scenario(name_or_path: str) -> Scenario:
    """Read a packaged scenario by name, or any by path.

    Raises:
        ScenarioError: Unknown name, unreadable file, unknown key or impossible value.
    """
    path = _path(name_or_path)
    try:
        return parse_scenario(_content(path).decode("utf-8"), path.stem)
    except UnicodeDecodeError as error:
        raise ScenarioError(f"scenario {path} is not TOML: it is not UTF-8") from error


def scenario_digest(name_or_path: str) -> str:
    """What tells a scenario from another of its name: how the SHA-256 of its file begins.

    Raises:
        ScenarioError: Unknown name or unreadable file.
    """
    return hashlib.sha256(_content(_path(name_or_path))).hexdigest()[:_DIGITS]


def _path(name_or_path: str) -> Path:
    path = Path(name_or_path)
    if name_or_path in scenario_names():
        return PACKAGED / f"{name_or_path}.toml"
    if path.suffix != ".toml":
        raise ScenarioError(
            f'unknown scenario "{name_or_path}"{_nearest(name_or_path, scenario_names())}; '
            f"known: {', '.join(scenario_names())}, or the path of a .toml file"
        )
    return path


def _content(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise ScenarioError(f"cannot read scenario {path}: {error.strerror}") from error


def parse_scenario(text: str, name: str) -> Scenario:
    """The scenario that a TOML text describes.

    Raises:
        ScenarioError: Not TOML, unknown key or impossible value.
    """
    try:
        table = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ScenarioError(f"scenario {name} is not TOML: {error}") from error
    if "name" in table:
        raise ScenarioError('unknown key "name": a scenario is named by its file')
    scenario: Scenario = _build(Scenario, {**table, "name": name}, "")
    return scenario


def _nearest(word: str, known: typing.Iterable[str]) -> str:
    match = difflib.get_close_matches(word, list(known), n=1, cutoff=0.4)
    return f', did you mean "{match[0]}"?' if match else ""


def _build(kind: Any, table: Any, path: str) -> Any:
    """An instance of the dataclass ``kind`` from a TOML table."""
    if not isinstance(table, dict):
        raise ScenarioError(f"{path} = {table!r}: must be a table")
    hints = typing.get_type_hints(kind)
    fields = {field.name: field for field in dataclasses.fields(kind)}
    prefix = f"{path}." if path else ""
    for key in table:
        if key not in fields:
            raise ScenarioError(
                f'unknown key "{prefix}{key}" = {table[key]!r}{_nearest(key, fields)}'
                f" (known here: {', '.join(name for name in fields if name != 'name' or path)})"
            )
    for name, field in fields.items():
        required = field.default is dataclasses.MISSING
        if required and name not in table:
            raise ScenarioError(f'missing key "{prefix}{name}"{_allowed(field.metadata)}')
    values = {
        key: _value(hints[key], value, f"{prefix}{key}", fields[key].metadata)
        for key, value in table.items()
    }
    return kind(**values)


def _value(hint: Any, value: Any, path: str, metadata: Any) -> Any:
    """One value checked against its type hint and declared range."""
    origin, arguments = typing.get_origin(hint), typing.get_args(hint)
    if origin in (typing.Union, types.UnionType):
        return _variant([a for a in arguments if a is not types.NoneType], value, path, metadata)
    if dataclasses.is_dataclass(hint):
        return _build(hint, value, path)
    if origin is tuple and arguments[-1] is Ellipsis:
        if not isinstance(value, list):
            raise ScenarioError(f"{path} = {value!r}: must be an array of tables ([[{path}]])")
        return tuple(
            _value(arguments[0], item, f"{path}[{i}]", metadata) for i, item in enumerate(value)
        )
    if origin is tuple:
        return _vector(len(arguments), value, path, metadata)
    if hint is float:
        return _number(value, path, metadata)
    if not isinstance(value, str):
        raise ScenarioError(f"{path} = {value!r}: must be a text{_allowed(metadata)}")
    allowed = metadata.get("choices")
    if isinstance(allowed, Choices) and value not in allowed.words:
        hint_text = _nearest(value, allowed.words)
        raise ScenarioError(f'{path} = "{value}": must be {allowed}{hint_text}')
    return value


def _variant(kinds: list[Any], value: Any, path: str, metadata: Any) -> Any:
    """A table whose ``kind`` names its type."""
    if len(kinds) == 1:
        return _value(kinds[0], value, path, metadata)
    words = {typing.get_args(typing.get_type_hints(kind)["kind"])[0]: kind for kind in kinds}
    if not isinstance(value, dict):
        raise ScenarioError(f"{path} = {value!r}: must be a table")
    word = value.get("kind")
    if word not in words:
        allowed = Choices(tuple(words))
        if word is None:
            raise ScenarioError(f'missing key "{path}.kind": must be {allowed}')
        raise ScenarioError(
            f"{path}.kind = {word!r}: must be {allowed}{_nearest(str(word), words)}"
        )
    return _build(words[word], value, path)


def _vector(size: int, value: Any, path: str, metadata: Any) -> tuple[float, ...]:
    if not isinstance(value, list) or len(value) != size:
        raise ScenarioError(
            f"{path} = {value!r}: must be an array of {size} numbers{_allowed(metadata)}"
        )
    return tuple(_number(item, f"{path}[{i}]", metadata) for i, item in enumerate(value))


def _number(value: Any, path: str, metadata: Any) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ScenarioError(f"{path} = {value!r}: must be a number{_allowed(metadata)}")
    allowed = metadata.get("range")
    if isinstance(allowed, Range) and allowed.refuses(float(value)):
        raise ScenarioError(f"{path} = {value!r}: must be {allowed}")
    endless = isinstance(allowed, Range) and allowed.or_endless
    if not math.isfinite(value) and not endless:
        raise ScenarioError(f"{path} = {value!r}: must be finite")
    return float(value)


def _allowed(metadata: Any) -> str:
    for key in ("range", "choices"):
        if key in metadata:
            return f" ({metadata[key]})"
    return ""
