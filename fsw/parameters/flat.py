"""Every number of a configuration by its dotted name."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator

Number = int | float | bool


def flat(config: object) -> dict[str, Number]:
    """The numbers of nested dataclasses and tuples, in the order in which they are declared.

    ``planner.walls.alpha`` is a field, ``airframe.link_length.0`` the first of a tuple. What is
    neither a number nor holds any is left out.
    """
    return dict(_numbers("", config))


def _numbers(name: str, value: object) -> Iterator[tuple[str, Number]]:
    if isinstance(value, int | float):
        yield name, value
    elif isinstance(value, tuple):
        for k, part in enumerate(value):
            yield from _numbers(f"{name}.{k}", part)
    elif dataclasses.is_dataclass(value):
        for field in dataclasses.fields(value):
            inner = f"{name}.{field.name}" if name else field.name
            yield from _numbers(inner, getattr(value, field.name))
