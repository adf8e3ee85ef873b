"""What a client that lists the parameters of a vehicle must see."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from fsw.autopilot.model.airframe import AIRFRAME
from fsw.autopilot.parameters.facts import FACTS
from fsw.autopilot.parameters.registry import PARAMETERS


def listed(kept: Mapping[str, float]) -> dict[str, float]:
    """Every value by name, read-only ones included, of a vehicle that has kept other ones."""
    tunable = {parameter.name: parameter.default for parameter in PARAMETERS} | kept
    return tunable | {fact.name: fact.read(tunable, AIRFRAME) for fact in FACTS}


LISTED: Final = listed({})
"""With defaults."""
