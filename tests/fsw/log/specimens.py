"""Inputs of a tick with something in every field, whatever fields there are."""

from __future__ import annotations

import dataclasses
import enum
import math
import random
import types
import typing
from typing import Any

from fsw.autopilot.signals import TickInputs

OF_JOINTS = ("q_arm", "qd_arm", "qdd_arm", "angles")  # as many numbers as the vehicle has joints


def specimen(hint: Any, dice: random.Random, nothing: float = 0.2) -> Any:
    """A value of an annotated type: floats of any size, NaN among them, texts beyond ASCII.

    ``nothing`` is how often what may be absent is absent.
    """
    if hint is float:
        return dice.choice((dice.gauss(0.0, 10.0 ** dice.uniform(-9, 9)), math.nan, -0.0, 1e300))
    if hint is int:
        return dice.randrange(1 << 31)
    if hint is bool:
        return dice.random() < 0.5
    if hint is str:
        return dice.choice(("", "gust", 'a "quoted" name', "Ünï☃"))
    if typing.get_origin(hint) is tuple:
        parts = typing.get_args(hint)
        if parts[-1] is Ellipsis:
            return tuple(specimen(parts[0], dice) for _ in range(dice.randrange(4)))
        return tuple(specimen(part, dice) for part in parts)
    if typing.get_origin(hint) in (types.UnionType, typing.Union):
        kinds = [part for part in typing.get_args(hint) if part is not types.NoneType]
        if len(kinds) < len(typing.get_args(hint)) and dice.random() < nothing:
            return None
        return specimen(dice.choice(kinds), dice)
    if issubclass(hint, enum.Enum):
        return dice.choice(list(hint))
    hints = typing.get_type_hints(hint)
    return hint(
        **{
            name: tuple(specimen(float, dice) for _ in range(2))
            if name in OF_JOINTS
            else specimen(part, dice)
            for name, part in hints.items()
        }
    )


def inputs(t_us: int, dice: random.Random) -> TickInputs:
    """Inputs of one tick."""
    made: TickInputs = specimen(TickInputs, dice)
    return dataclasses.replace(made, sensors=dataclasses.replace(made.sensors, t_us=t_us))
