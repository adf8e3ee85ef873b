"""What was flown, with which code, and how to get the same again."""

from __future__ import annotations

import contextlib
import math
import os
import platform
import shlex
from collections.abc import Sequence
from datetime import datetime
from importlib.metadata import version
from typing import Final

from command_line.html_page import table
from command_line.options import as_words
from fsw.autopilot.parameters.control_choice import choice_of
from fsw.autopilot.parameters.registry import PARAMETERS
from view.report.reported import Reported

_FACTS: Final = {
    "scenario": "scenario",
    "scenario_digest": "digest of its file",
    "seed": "seed",
    "controller": "controller",
    "inner": "inner loop",
    "robustness": "λ",
    "solver": "optimiser",
    "body": "body",
    "pacing": "pacing",
    "ver_sw": "code",
}
_CLOSE: Final = 1e-5  # of a parameter's 32 bits to its default
_BY_SCENARIO: Final = "PLN_BODY"  # is what the scenario or --body says


def provenance(flights: Sequence[Reported]) -> str:
    """A table with a column for each flight."""
    rows = [
        [name, *(str(flight.data.information.get(key, "")) for flight in flights)]
        for key, name in _FACTS.items()
    ]
    rows.insert(3, ["sensors", *(str(flight.result.get("sensors") or "") for flight in flights)])
    rows.append(
        ["parameters changed", *("; ".join(changed(flight)) or "none" for flight in flights)]
    )
    rows.append(["log written", *(_written(flight) for flight in flights)])
    rows.append(["log", *("/".join(flight.data.path.parts[-2:]) for flight in flights)])
    rows.append(["to repeat it", *(command(flight) for flight in flights)])
    made = f"Pandion {version('pandion')}, {machine()}, {_now()}"
    rows.append(["this page", made, *("" for _ in flights[1:])])
    heads = ["", *(flight.label if len(flights) > 1 else "" for flight in flights)]
    return table(heads, rows, "Provenance")


def machine() -> str:
    """The machine on which this runs, in a few words."""
    words = (platform.system(), platform.machine(), f"{os.cpu_count()} processors")
    return f"{' '.join(words)}, Python {platform.python_version()}"


def _now() -> str:
    return datetime.now().astimezone().isoformat(" ", "minutes")


def _written(flight: Reported) -> str:
    """When the log's file changed last; a log in lockstep holds no wall time."""
    try:
        seconds = flight.data.path.stat().st_mtime
    except OSError:
        return ""
    return datetime.fromtimestamp(seconds).astimezone().isoformat(" ", "minutes")


def changed(flight: Reported) -> list[str]:
    """The vehicle's parameters that are not at their default."""
    found = []
    for parameter in PARAMETERS:
        value = flight.data.parameters.get(parameter.name)
        if parameter.name == _BY_SCENARIO or value is None:
            continue
        if not math.isclose(value, parameter.default, rel_tol=_CLOSE):
            found.append(f"{parameter.name} {value:g}")
    return found


def command(flight: Reported) -> str:
    """The command that flies it again; parameters, if any were changed, come from a file."""
    facts, result = flight.data.information, flight.result
    words = ["pandion", "fly", str(facts.get("scenario", "?")), f"--seed={facts.get('seed', 0)}"]
    if result.get("sensors"):
        words.append(f"--sensors={result['sensors']}")
    if result.get("duration_s"):
        words.append(f"--duration={result['duration_s']:g}")
    if facts.get("pacing") == "realtime":
        words.append("--realtime")
    with contextlib.suppress(ValueError):  # a name that this build does not know
        words += as_words(choice_of(lambda name: str(facts.get(name, ""))))
    if changed(flight):
        words.append("--params=FILE")
    return shlex.join(words)
