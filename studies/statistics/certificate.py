"""What a campaign shows, in numbers that can be computed again from its directory.

A statement is plain data. Its digest, over its canonical JSON, covers the rows of all flights, so
that a certificate and the directory it was made of are held against each other by one command.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from command_line.version import version
from fsw.tuning import flat
from sitl.scenario import Scenario, Uniform
from sitl.sensors.keys import MeasuredSensors
from studies.campaign.flight import CampaignRow
from studies.campaign.keys import PARAMETERS, CampaignError
from studies.campaign.store import PLAN, CampaignResult
from studies.statistics.binomial import bounds
from studies.statistics.extremes import NoFitError, fit_tail

FORMAT: Final = "pandion-certificate-1"
ANY: Final = "any of these"
_DIGITS: Final = 10  # of what is computed, so that the last bits of another machine do not count
_QUANTILES: Final = (0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 1.0)
_MOST_FITS: Final = 8

# A flight that could not be flown counts in each: nothing is known of it that would clear it.
VIOLATIONS: Final[dict[str, Callable[[CampaignRow], bool]]] = {
    "contact": lambda row: row.error or row.contact,
    "margin below 0": lambda row: row.error or (row.margin_m is not None and row.margin_m < 0.0),
    "a limit broken": lambda row: row.error or not row.limits_kept,
    "not completed": lambda row: row.error or not row.completed,
    "not flown": lambda row: row.error,
    ANY: lambda row: (
        row.error
        or row.contact
        or (row.margin_m is not None and row.margin_m < 0.0)
        or not row.limits_kept
        or not row.completed
    ),
}

_ASSUMED: Final = {
    "random": (
        "Flights are drawn independently of each other, as the bounds assume. Where several "
        "configurations take turns, a bound is one of their mean."
    ),
    "latin-hypercube": (
        "The flights are a Latin hypercube: they are not independent, so the bounds, which assume "
        'that they are, are no proof here. Fly design = "random" for one.'
    ),
    "sobol": (
        "The flights are a Sobol sequence: they are not independent, so the bounds, which assume "
        'that they are, are no proof here. Fly design = "random" for one.'
    ),
    "grid": (
        "The flights are the points of a grid, each with random numbers of its own: a bound is one "
        "of the mean over these points, and says nothing of what lies between them."
    ),
}


def certificate(
    result: CampaignResult, directory: Path, confidence: float, refits: int = 399
) -> dict[str, Any]:
    """The statement about a campaign at a ``confidence`` [1], with its digest.

    Raises:
        CampaignError: Flights are missing, or there are none.
    """
    missing = result.asked - len(result.rows)
    if missing or not result.rows:
        raise CampaignError(
            f"{missing} of {result.asked} flights have no row, and what is missing cannot be left "
            f"out: finish with `pandion campaign {directory / PLAN} --out {directory}`"
        )
    rows_digest = digest([row.compared() for row in result.rows])
    statement = {
        "format": FORMAT,
        "campaign": result.plan.name,
        "flights": result.asked,
        "confidence": confidence,
        "refits": refits,
        "seed": result.plan.seed,
        "design": result.plan.design,
        "assumed": _ASSUMED[result.plan.design],
        "findings": _findings(result.rows, confidence),
        "configurations": list(_configurations(result, confidence)),
        "margins": _margins(result, confidence, refits, int(rows_digest[:8], 16)),
        "varied": [str(one) for one in result.plan.varied],
        "random": sorted({what for base in result.plan.bases for what in drawn(base.scenario)}),
        "not_varied": list(_not_varied(result)),
        "versions": {
            "flown": result.facts.get("version", "unknown"),
            "certified": version(),
        },
        "digests": {
            "plan": result.digests.plan,
            "code": result.digests.code,
            "packages": result.digests.packages,
            "file": hashlib.sha256((directory / PLAN).read_bytes()).hexdigest(),
            "rows": rows_digest,
        },
        "commands": [
            f"pandion certify {directory} --confidence {confidence!r}",
            f"pandion campaign {directory / PLAN} --flights {result.asked} --out AGAIN",
        ],
    }
    rounded = _rounded(statement)
    return {**rounded, "digest": digest(_signed(rounded))}


def differences(stated: Any, found: Any, path: str = "") -> list[str]:
    """Where two statements differ, a sentence each; the commands may name other directories."""
    if isinstance(stated, dict) and isinstance(found, dict):
        keys = sorted({*stated, *found} - ({"commands"} if not path else set()))
        return [
            line
            for key in keys
            for line in differences(
                stated.get(key), found.get(key), f"{path}.{key}" if path else key
            )
        ]
    if isinstance(stated, list) and isinstance(found, list) and len(stated) == len(found):
        return [
            line
            for k, (one, other) in enumerate(zip(stated, found, strict=True))
            for line in differences(one, other, f"{path}[{k}]")
        ]
    if stated == found:
        return []
    return [f"{path}: the certificate says {_short(stated)}, the campaign {_short(found)}"]


def tampered(stated: dict[str, Any]) -> bool:
    """Whether a statement is not the one that its own digest was made of."""
    return stated.get("digest") != digest(_signed(stated))


def digest(value: Any) -> str:
    """SHA-256 of a value's canonical JSON: keys sorted, no spaces, floats to the last bit.

    A number that is not finite, such as the margin of a flight that diverged, is NaN or Infinity.
    """
    text = json.dumps(value, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()


def _signed(statement: dict[str, Any]) -> dict[str, Any]:
    """What the digest covers: all but itself and the directory in the commands."""
    return {key: part for key, part in statement.items() if key not in ("digest", "commands")}


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 80 else f"{text[:80]}…"


def _findings(rows: Sequence[CampaignRow], confidence: float) -> dict[str, Any]:
    total = len(rows)
    return {
        name: asdict(bounds(sum(map(violated, rows)), total, confidence))
        for name, violated in VIOLATIONS.items()
    }


def _of_cases(result: CampaignResult) -> Iterator[tuple[str, list[CampaignRow]]]:
    count = len(result.plan.cases)
    for k, case in enumerate(result.plan.cases):
        rows = [row for row in result.rows if row.flight % count == k]
        if rows:
            yield str(case), rows


def _configurations(result: CampaignResult, confidence: float) -> Iterator[dict[str, Any]]:
    for name, rows in _of_cases(result):
        counted = {what: sum(map(test, rows)) for what, test in VIOLATIONS.items()}
        margins = [row.margin_m for row in rows if row.margin_m is not None]
        yield {
            "name": name,
            "flights": len(rows),
            "counted": counted,
            "at_most": bounds(counted[ANY], len(rows), confidence).upper,
            "min_margin_m": min(margins) if margins else None,
        }


def _margins(
    result: CampaignResult, confidence: float, refits: int, seed: int
) -> list[dict[str, Any]]:
    """Of each configuration: flights of several have no one tail."""
    cases = [
        (name, rows, [row.margin_m for row in rows if row.margin_m is not None])
        for name, rows in _of_cases(result)
    ]
    cases.sort(key=lambda case: min(case[2], default=math.inf))
    found = []
    for k, (name, rows, margins) in enumerate(cases):
        finite = [one for one in margins if math.isfinite(one)]
        quantiles = np.quantile(finite, _QUANTILES).tolist() if finite else []
        found.append(
            {
                "name": name,
                "flights": len(margins),
                "ended_at_contact": sum(row.contact for row in rows),
                "quantiles_m": dict(zip(map(str, _QUANTILES), quantiles, strict=False)),
                "tail": _tail(margins, confidence, refits, seed, fitted=k < _MOST_FITS),
            }
        )
    return found


def _tail(
    margins: list[float], confidence: float, refits: int, seed: int, *, fitted: bool
) -> dict[str, Any]:
    """A fit, or the sentence that says why there is none."""
    if not fitted:
        return {"none": f"only the {_MOST_FITS} configurations with the minimum margins are fitted"}
    try:
        fit = fit_tail(margins, confidence, refits, seed)
    except NoFitError as error:
        return {"none": str(error)}
    return {**asdict(fit), "fits": fit.fits}


def drawn(scenario: Scenario) -> Iterator[str]:
    """What of a scenario the seed of a flight decides."""
    for item in scenario.disturbances:
        if isinstance(item, Uniform):
            yield f"disturbance {item.name}: uniform within ±{item.amplitude_m_s2:g} m/s² an axis"
        elif item.kind not in ("wind", "sequence"):
            yield f"disturbance {item.name}: {item.kind}"
    if isinstance(scenario.sensors, MeasuredSensors):
        yield f"errors of the sensors of suite {scenario.sensors.suite}"
    elif any(value for key, value in flat(scenario.sensors).items() if "latency" not in key):
        yield "errors of the exact sensors"
    if scenario.air.turbulence_m_s > 0.0:
        yield f"turbulence, {scenario.air.turbulence_m_s:g} m/s at 20 ft"
    if scenario.faults:
        yield "what a fault draws"


def _not_varied(result: CampaignResult) -> Iterator[str]:
    """The numbers that a campaign can vary and this one did not, and their values."""
    varied = {one.key for one in result.plan.varied}
    for group in ("vehicle_scale", "start", "trajectory", "air", "actuators"):
        held: dict[str, list[str]] = {}
        for base in result.plan.bases:
            for key, value in flat(getattr(base.scenario, group)).items():
                if f"{group}.{key}" not in varied:
                    values = held.setdefault(key, [])
                    values += [text for text in (f"{value:g}",) if text not in values]
        if held:
            texts = (f"{key} = {' or '.join(values)}" for key, values in held.items())
            yield f"{group}: {', '.join(texts)}"
    if not any(base.scenario.faults for base in result.plan.bases):
        yield "faults: none"
    tuned = sorted(key for key in varied if key.startswith(f"{PARAMETERS}."))
    yield f"parameters of the flight software: all but {', '.join(tuned) or 'none'}"


def _rounded(value: Any) -> Any:
    """Numbers to a few digits; what is not finite is null."""
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _rounded(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(part) for part in value]
    return value
