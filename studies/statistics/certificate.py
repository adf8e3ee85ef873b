"""What a campaign shows, in numbers that can be computed again from its directory.

A statement is plain data. Its digest, over its canonical JSON, covers the rows of all flights, so
that a certificate and the directory it was made of are held against each other by one command.
"""

from __future__ import annotations

import hashlib
import json
import math
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, Final

import numpy as np

from command_line.version import version
from fsw.autopilot.tuning import flat
from studies.campaign.flight import CampaignFlight, CampaignRow, code
from studies.campaign.keys import (
    AIR,
    FAULT,
    LATENCY,
    PARAMETERS,
    PUSH,
    CampaignError,
    Flown,
    applied,
)
from studies.campaign.randomness import drawn, seeded, spread
from studies.campaign.store import FACTS, PLAN, CampaignResult
from studies.campaign.values import grid_size
from studies.statistics.binomial import bounds
from studies.statistics.extremes import NoFitError, fit_tail
from studies.statistics.requirement import Requirement, judge
from studies.statistics.violations import ANY, VIOLATIONS, violates

FORMAT: Final = "pandion-certificate-3"
_DIGITS: Final = 10  # of what is computed, so that the last bits of another machine do not count
_QUANTILES: Final = (0.0, 0.001, 0.01, 0.1, 0.5, 0.9, 1.0)
_MAX_FITS: Final = 8
_MAX_POINTS: Final = 20  # of a grid that are listed, for each key
_FIRST_FLIGHTS: Final = 20  # of a configuration, that are looked at for random numbers
_DRAWN: Final = ("scenario", "suite", "controller", "fault", "seed", "values")  # of a row, by plan
_CUT_S: Final = 0.01  # by which a flight may end before its time

_NO_PROOF: Final = "no proof"  # is in every sentence about flights that bounds do not hold for
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
        "A bound is one of the mean over these points, and says nothing of what lies between them."
    ),
}


def certificate(
    result: CampaignResult,
    directory: Path,
    confidence: float,
    refits: int = 399,
    required: Sequence[Requirement] = (),
) -> dict[str, Any]:
    """The statement about a campaign at a ``confidence`` [1], with its digest.

    What is ``required`` is in it with what was found.

    Raises:
        CampaignError: Flights are missing, or are not those of the plan.
    """
    _check_whole(result, directory)
    _check_planned(result, directory)
    rows_digest = digest([row.compared() for row in result.rows])
    statement = {
        "format": FORMAT,
        "campaign": result.plan.name,
        "flights": result.asked,
        "confidence": confidence,
        "refits": refits,
        "seed": result.plan.seed,
        "design": result.plan.design,
        "assumed": _assumed(result),
        "findings": _findings(result.rows, confidence),
        "configurations": list(_configurations(result, confidence)),
        "margins": _margins(result, confidence, refits, int(rows_digest[:8], 16)),
        "varied": list(_varied(result)),
        "random": sorted(_drawn(result)),
        "not_varied": list(_not_varied(result)),
        "versions": {
            # Of the rows nothing but the digest of the code is known for certain.
            "flown": version() if result.digests.code == code() else "not known: by other code",
            "certified": version(),
        },
        "digests": {
            "plan": result.digests.plan,
            "code": result.digests.code,
            "packages": result.digests.packages,
            "file": hashlib.sha256((directory / PLAN).read_bytes()).hexdigest(),
            "rows": rows_digest,
        },
        **_required(result, confidence, required),
        "commands": [
            f"pandion certify DIR --confidence {confidence!r}",
            f"pandion campaign DIR/{PLAN} --flights {result.asked} --out AGAIN",
        ],
    }
    rounded = _rounded(statement)
    return {**rounded, "digest": digest(_signed(rounded))}


def _check_whole(result: CampaignResult, directory: Path) -> None:
    """Refuse fewer flights than the file asks for: who leaves some out may choose which."""
    finish = f"finish with `pandion campaign {directory / PLAN} --out {directory}`"
    result.plan.check(result.asked)
    asked = max(result.asked, result.plan.count)
    missing = asked - len(result.rows)
    if missing or not result.rows:
        raise CampaignError(
            f"{missing} of {asked} flights have no row, and what is missing cannot be left out: "
            f"{finish}"
        )
    if not result.sealed.lines:
        raise CampaignError(
            f"{directory / FACTS} was written before the first of {asked} flights, and says "
            f"nothing of their rows: {finish}"
        )


def _check_planned(result: CampaignResult, directory: Path) -> None:
    """Refuse a row that says what a flight of the plan cannot be."""
    for row in result.rows:
        if wrong := list(_unplanned(result, row)):
            raise CampaignError(
                f"flight {row.flight} is none of {directory / PLAN}, by its {', '.join(wrong)}: "
                "fly the campaign again into another --out"
            )


def _unplanned(result: CampaignResult, row: CampaignRow) -> Iterator[str]:
    """Fields of a row that a flight of this number cannot have."""
    drawn = CampaignFlight(result.plan, row.flight).broken("")
    yield from (name for name in _DRAWN if getattr(row, name) != getattr(drawn, name))
    within = 0.0 <= row.duration_s <= _wanted_s(result, row) + _CUT_S
    if not within or (row.completed and _early(result, row)):
        yield "duration_s"
    if row.completed and not math.isfinite(row.margin_m or 0.0):
        yield "margin_m"


def verdicts(
    result: CampaignResult, confidence: float, required: Sequence[Requirement]
) -> list[dict[str, Any]]:
    """Each requirement, whether it is met, at a ``confidence`` [1], and what was found."""
    assumed = _assumed(result)
    no_proof = assumed if _NO_PROOF in assumed else ""
    cases = list(result.by_case.items())
    return [asdict(judge(one, cases, confidence, no_proof)) for one in required]


def _required(
    result: CampaignResult, confidence: float, required: Sequence[Requirement]
) -> dict[str, Any]:
    return {"required": verdicts(result, confidence, required)} if required else {}


def differences(stated: Any, found: Any, path: str = "") -> list[str]:
    """Where two statements differ, a sentence each."""
    if isinstance(stated, dict) and isinstance(found, dict):
        keys = sorted({*stated, *found})
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
    # It is hashed, not written.
    text = json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=True)
    return hashlib.sha256(text.encode()).hexdigest()


def _signed(statement: dict[str, Any]) -> dict[str, Any]:
    """What the digest covers: all but itself."""
    return {key: part for key, part in statement.items() if key != "digest"}


def _short(value: Any) -> str:
    text = json.dumps(value, allow_nan=True)  # for a sentence
    return text if len(text) <= 80 else f"{text[:80]}…"


def _findings(rows: Sequence[CampaignRow], confidence: float) -> dict[str, Any]:
    total = len(rows)
    counted = _counted(rows)
    return {name: asdict(bounds(counted[name], total, confidence)) for name in VIOLATIONS}


def _counted(rows: Sequence[CampaignRow]) -> dict[str, int]:
    return {name: sum(violates(row, name) for row in rows) for name in VIOLATIONS}


def _configurations(result: CampaignResult, confidence: float) -> Iterator[dict[str, Any]]:
    for name, rows in result.by_case.items():
        counted = _counted(rows)
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
        for name, rows in result.by_case.items()
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
                "cut_short": sum(
                    row.margin_m is not None
                    and (row.contact or bool(row.modes) or _early(result, row))
                    for row in rows
                ),
                "quantiles_m": dict(zip(map(str, _QUANTILES), quantiles, strict=False)),
                "tail": _no_tail(result, k) or _tail(margins, confidence, refits, seed),
            }
        )
    return found


def _early(result: CampaignResult, row: CampaignRow) -> bool:
    """Whether a flight ended before its time."""
    return not row.duration_s >= _wanted_s(result, row) - _CUT_S


def _wanted_s(result: CampaignResult, row: CampaignRow) -> float:
    """How long a flight is to be [s]."""
    base = result.plan.bases[row.flight % len(result.plan.cases)]
    return row.values.get("duration_s", base.scenario.duration_s)


def _no_tail(result: CampaignResult, place: int) -> dict[str, Any]:
    """Why no tail is looked for; empty if one is."""
    if result.plan.design != "random":
        return {
            "none": f"the flights are of design {result.plan.design}, not drawn independently, as "
            "a fitted tail assumes, so no extreme-value law is fitted"
        }
    if place >= _MAX_FITS:
        return {"none": f"only the {_MAX_FITS} configurations with the minimum margins are fitted"}
    return {}


def _tail(margins: list[float], confidence: float, refits: int, seed: int) -> dict[str, Any]:
    """A fit, or the sentence that says why there is none."""
    try:
        fit = fit_tail(margins, confidence, refits, seed)
    except NoFitError as error:
        return {"none": str(error)}
    return {**asdict(fit), "fits": fit.fits}


def _not_varied(result: CampaignResult) -> Iterator[str]:
    """The numbers that a campaign can vary and this one did not, and their values."""
    varied = {one.key for one in result.plan.varied}
    held: dict[str, dict[str, list[str]]] = {}
    for base in result.plan.bases:
        for key, value in flat(base.scenario).items():
            if not _moved(key, varied):
                group, _, rest = key.partition(".")
                values = held.setdefault(group, {}).setdefault(rest, [])
                values += [text for text in (f"{value:g}",) if text not in values]
    for group, keys in held.items():
        texts = (f"{key} = {' or '.join(values)}".strip(" =") for key, values in keys.items())
        yield f"{group}: {', '.join(texts)}"
    for key, what in ((LATENCY, "added latency"), (PUSH, "added constant acceleration")):
        if key not in varied:
            yield f"{key}: no {what}"
    if not any(base.scenario.disturbances for base in result.plan.bases):
        yield "disturbances: none"
    if not any(base.scenario.faults for base in result.plan.bases):
        yield "faults: none"
    tuned = sorted(key for key in varied if key.startswith(f"{PARAMETERS}."))
    yield f"parameters of the flight software: all but {', '.join(tuned) or 'none'}"


def _moved(key: str, varied: set[str]) -> bool:
    """Whether a number of a scenario is varied, by its own key or by one of the campaign's own."""
    if key in varied:
        return True
    if LATENCY in varied and key.startswith("sensors.") and key.endswith(".latency_ms"):
        return True
    if key.startswith("faults.") and f"{FAULT}.{key.split('.', 2)[2]}" in varied:
        return True
    return AIR in varied and key.startswith(f"air.{AIR}.")


def _varied(result: CampaignResult) -> Iterator[str]:
    """What was varied, and how; of a grid, the values that were flown."""
    for one in result.plan.varied:
        if result.plan.design != "grid":
            yield str(one)
            continue
        values = sorted({row.values[one.key] for row in result.rows if one.key in row.values})
        count = len(one.distribution.grid())
        shown = ", ".join(f"{value:g}" for value in values[:_MAX_POINTS])
        more = f", ... {values[-1]:g}" if len(values) > _MAX_POINTS else ""
        yield f"{one.key}: {len(values)} of {count} values of a grid: {shown}{more}"


def _assumed(result: CampaignResult) -> str:
    """What the bounds assume of these flights, and whether it is so."""
    plan = result.plan
    random = [_random(result, k) for k in range(len(plan.cases))]
    if plan.design != "grid":
        same = sum(
            not (mine or spread(plan.varied, base))
            for mine, base in zip(random, plan.bases, strict=True)
        )
        if not same:
            return _ASSUMED[plan.design]
        return (
            f"In {same} of {len(random)} configurations nothing is varied and nothing random: all "
            "their flights are one flight, so bounds, which count them as many, are no proof there."
        )
    size = grid_size(tuple(one.distribution for one in plan.varied))
    places = Counter(
        (row.flight % len(random), row.flight // len(random) % size) for row in result.rows
    )
    least, most = min(places.values()), max(places.values())
    times = f"{least}" if least == most else f"{least} to {most}"
    over = f" over {len(random)} configurations" if len(random) > 1 else ""
    flown = (
        f"The flights are {len(places)} of the {size * len(random)} points of a grid{over}; "
        f"a point was flown this often: {times}"
    )
    if all(random):
        return f"{flown}, with other random numbers each time. {_ASSUMED['grid']}"
    where = "nothing" if not any(random) else f"in {random.count(False)} configurations nothing"
    return (
        f"{flown}; {where} is random, so flights of a point are one flight, and bounds, which "
        "count them as many, are no proof there."
    )


def _random(result: CampaignResult, case: int) -> bool:
    """Whether the seed decides anything in the flights of a configuration."""
    return any(map(seeded, _flown(result, case)))


def _drawn(result: CampaignResult) -> set[str]:
    """What the seed decides, in any configuration."""
    found = set[str]()
    for case in range(len(result.plan.cases)):
        for flown in _flown(result, case):
            mine = set(drawn(flown.scenario))
            found |= mine
            if mine:
                break
    return found


def _flown(result: CampaignResult, case: int) -> Iterator[Flown]:
    """A configuration as the file names it, then as its first flights have it."""
    base = result.plan.bases[case]
    yield base
    for row in result.rows[case :: len(result.plan.cases)][:_FIRST_FLIGHTS]:
        if not row.error:  # it may have values that contradict each other
            yield applied(base, row.values.items())


def _rounded(value: Any) -> Any:
    """Numbers to a few digits; what is not finite is null."""
    if isinstance(value, float):
        return float(f"{value:.{_DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, dict):
        return {str(key): _rounded(part) for key, part in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(part) for part in value]
    return value
