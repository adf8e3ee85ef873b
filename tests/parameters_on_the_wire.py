"""What a client that lists the parameters of a vehicle with defaults must see."""

from __future__ import annotations

from typing import Final

from fsw.autopilot.parameters.facts import FACTS
from fsw.autopilot.parameters.registry import PARAMETERS

_TUNABLE: Final = {parameter.name: parameter.default for parameter in PARAMETERS}
LISTED: Final = _TUNABLE | {fact.name: fact.read(_TUNABLE) for fact in FACTS}
"""Every value by name, read-only ones included."""
