"""Numbers of a configuration changed by name, whole.

A configuration is a tree of frozen dataclasses. A ``Tuning`` names the leaves that differ from it
by their path, so it is plain data that crosses a boundary, goes into a log and is compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, Final, TypeVar, cast

Tuning = tuple[tuple[str, float], ...]
"""Dotted path and value of every number that differs; what is absent is as configured."""

Row = tuple[str, str, str, float, float, str] | tuple[str, str, str, float, float, str, float]
"""A parameter: its name, the path of its number, unit, range, meaning; how many the number is."""

Number = int | float | bool

# Fields that are words and are tuned by the number of the word.
WORDS: Final[dict[str, tuple[str, ...]]] = {"body": ("points", "full")}

Config = TypeVar("Config")


def tuned(config: Config, tuning: Tuning) -> Config:
    """A configuration, a tree of frozen dataclasses, with a tuning's numbers; an int stays one.

    Raises:
        ValueError: A dataclass refuses its new numbers, or a value is no number for its field.
        AttributeError: The configuration has no such path.
    """
    here: dict[str, float | str] = {}
    below: dict[str, list[tuple[str, float]]] = {}
    for path, value in tuning:
        name, _, rest = path.partition(".")
        if rest:
            below.setdefault(name, []).append((rest, value))
        else:
            here[name] = _like(name, getattr(config, name), value)
    changed: dict[str, Any] = dict(here)
    for name, inner in below.items():
        changed[name] = tuned(getattr(config, name), tuple(inner))
    return cast(Config, replace(cast(Any, config), **changed)) if changed else config


def part(tuning: Tuning, branch: str) -> Tuning:
    """What a tuning says about one branch, as a tuning of that branch."""
    prefix = f"{branch}."
    return tuple((path[len(prefix) :], value) for path, value in tuning if path.startswith(prefix))


def number_at(config: object, path: str) -> float:
    """The number at a path.

    Raises:
        AttributeError: The configuration has no such path.
    """
    for name in path.split("."):
        config = getattr(config, name)
    if isinstance(config, str):
        return float(WORDS[name].index(config))
    return float(cast(float, config))


def flat(config: object) -> dict[str, Number]:
    """The numbers of nested dataclasses and tuples by dotted path, in the order of declaration.

    ``planner.walls.alpha`` is a field, ``airframe.home_posture.0`` the first of a tuple. What is
    neither a number nor holds any is left out.
    """
    return dict(_numbers("", config))


def _numbers(path: str, value: object) -> Iterator[tuple[str, Number]]:
    if isinstance(value, int | float):
        yield path, value
    elif isinstance(value, tuple):
        for k, one in enumerate(value):
            yield from _numbers(f"{path}.{k}", one)
    elif is_dataclass(value):
        for field in fields(value):
            inner = f"{path}.{field.name}" if path else field.name
            found = getattr(value, field.name)
            if field.name in WORDS and isinstance(found, str):
                found = WORDS[field.name].index(found)
            yield from _numbers(inner, found)


def _like(name: str, old: object, value: float) -> float | str:
    if isinstance(old, str):
        return WORDS[name][round(value)]
    return round(value) if isinstance(old, int) else value
