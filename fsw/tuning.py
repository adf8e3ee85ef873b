"""Numbers of a configuration changed by name, whole.

A configuration is a tree of frozen dataclasses. A ``Tuning`` names the leaves that differ from it
by their path, so it is plain data that crosses a boundary, goes into a log and is compared.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import fields, is_dataclass, replace
from typing import Any, TypeVar, cast

Tuning = tuple[tuple[str, float], ...]
"""Dotted path and value of every number that differs; what is absent is as configured."""

Config = TypeVar("Config")


def tuned(config: Config, tuning: Tuning) -> Config:
    """A configuration with the numbers of a tuning in it.

    Args:
        config: A frozen dataclass of numbers and of such dataclasses.
        tuning: Paths and values; a number that is an int stays one.

    Raises:
        ValueError: A dataclass refuses its new numbers, or a value is no number for its field.
        AttributeError: The configuration has no such path.
    """
    here: dict[str, float] = {}
    below: dict[str, list[tuple[str, float]]] = {}
    for path, value in tuning:
        name, _, rest = path.partition(".")
        if rest:
            below.setdefault(name, []).append((rest, value))
        else:
            here[name] = _like(getattr(config, name), value)
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
    return float(cast(float, config))


def leaves(config: object, prefix: str = "") -> Iterator[tuple[str, object]]:
    """Every leaf of a configuration: its path and its value."""
    for field in fields(cast(Any, config)):
        value = getattr(config, field.name)
        if is_dataclass(value):
            yield from leaves(value, f"{prefix}{field.name}.")
        else:
            yield f"{prefix}{field.name}", value


def _like(old: object, value: float) -> float:
    return round(value) if isinstance(old, int) else value
