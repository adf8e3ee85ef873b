"""What a campaign must show, such as ``p<0.01@95%`` or ``margin>=0.01``, held against it."""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final

from command_line.values import plain_float
from studies.campaign.flight import CampaignRow
from studies.statistics.binomial import bounds
from studies.statistics.violations import ANY, violates

# Largest probability, over all flights as they take turns, or of the worst configuration.
_PROBABILITIES: Final = ("p", "p-each", "contact")
_LENGTHS: Final = ("margin", "te")
_SIGNS: Final[dict[str, Callable[[float, float], bool]]] = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_FORM: Final = re.compile(
    r"\s*(?P<name>[a-z-]+)\s*(?P<sign>[<>]=?)\s*(?P<limit>[-+.\deE]+)\s*(?P<unit>%|mm|m)?"
    r"\s*(?:@\s*(?P<confidence>[.\d]+)\s*%)?\s*",
    re.ASCII,
)
_UNITS: Final = {None: 1.0, "%": 100.0, "m": 1.0, "mm": 1000.0}  # in one of 1 or metres
_HELP: Final = (
    "write p<0.01@95%, p-each<0.05@95% or contact<1e-3@99% for probabilities, margin>=0.01 or "
    "margin>=10mm for the minimum margin, te<=0.05 for the largest tracking error"
)


@dataclass(frozen=True, slots=True)
class Requirement:
    """One bound that must hold."""

    text: str
    name: str
    sign: str
    limit: float  # [1] or [m]
    confidence: float | None  # [1], of a probability; None: that of the certificate

    def holds(self, value: float | None) -> bool:
        """Whether a ``value`` [1] or [m], None if there is none, is as it must be; NaN is not."""
        return value is not None and _SIGNS[self.sign](value, self.limit)


@dataclass(frozen=True, slots=True)
class Verdict:
    """A requirement and what was found."""

    text: str
    met: bool
    found: str


def requirement(text: str) -> Requirement:
    """The requirement that a text states.

    Raises:
        ValueError: It states none, or one that no campaign could miss or meet.
    """
    form = _FORM.fullmatch(text)
    name = form["name"] if form else ""
    if form is None or name not in (*_PROBABILITIES, *_LENGTHS):
        raise ValueError(f"'{text}' is no requirement; {_HELP}")
    limit = plain_float(form["limit"]) / _UNITS[form["unit"]]
    confidence = None if form["confidence"] is None else plain_float(form["confidence"]) / 100.0
    if math.isnan(limit):
        raise ValueError(f"'{text}': {form['limit']} is no number; {_HELP}")
    upward = form["sign"].startswith(">")
    if upward != (name == "margin"):
        raise ValueError(f"'{text}': a bound of {name} is {'<' if upward else '>'}; {_HELP}")
    if name in _LENGTHS and (confidence is not None or form["unit"] == "%"):
        raise ValueError(f"'{text}': {name} is a length and is not estimated: no %, no @")
    if name in _PROBABILITIES and form["unit"] in ("m", "mm"):
        raise ValueError(f"'{text}': {name} is a probability and has no unit")
    if name in _PROBABILITIES and not 0.0 < limit <= 1.0:
        raise ValueError(f"'{text}': a probability is above 0 and at most 1")
    if confidence is not None and not 0.5 <= confidence < 1.0:
        raise ValueError(f"'{text}': a confidence is from 50% to below 100%")
    if not math.isfinite(limit):
        raise ValueError(f"'{text}': the bound must be finite")
    return Requirement(text.strip(), name, form["sign"], limit, confidence)


def judge(
    wanted: Requirement,
    cases: Sequence[tuple[str, Sequence[CampaignRow]]],
    confidence: float,
    no_proof: str = "",
) -> Verdict:
    """Hold the flights of configurations, by their names, against a requirement.

    Args:
        wanted: What must be.
        cases: Every configuration with its flights; none without a flight.
        confidence: Of bounds whose requirement names none [1].
        no_proof: Why the bounds prove nothing here; empty if they do.
    """
    rows = [row for _, of in cases for row in of]
    if wanted.name in _LENGTHS:
        return _length(wanted, rows)
    share = wanted.confidence or confidence
    what = "contact" if wanted.name == "contact" else ANY
    groups = cases if wanted.name == "p-each" else [("", rows)]
    found = [
        (bounds(sum(violates(row, what) for row in of), len(of), share), name)
        for name, of in groups
    ]
    bound, name = max(found, key=lambda one: one[0].upper)
    text = f"{bound.count} of {bound.total} flights, at most {bound.upper:.3g} at {100 * share:g} %"
    text += f" in {name}" if name else ""
    if no_proof:
        return Verdict(wanted.text, False, f"{text}; not shown: {no_proof}")
    return Verdict(wanted.text, wanted.holds(bound.upper), text)


def _length(wanted: Requirement, rows: Sequence[CampaignRow]) -> Verdict:
    """The worst of all flights; nothing is known of a flight that was not flown."""
    unflown = sum(row.error or row.refused for row in rows)
    if unflown:
        return Verdict(wanted.text, False, f"{unflown} of {len(rows)} flights were not flown")
    if wanted.name == "margin":
        found = [(row.margin_m, row.flight) for row in rows if row.margin_m is not None]
        what = "minimum margin"
    else:
        found = [(row.te_m, row.flight) for row in rows if row.te_m is not None]
        what = "largest tracking error"
    if len(found) < len(rows):
        return Verdict(wanted.text, False, f"{len(rows) - len(found)} flights have no {what}")
    value, flight = (min if wanted.name == "margin" else max)(found)
    # Of a margin that is no number nothing is known.
    unknown = [number for one, number in found if math.isnan(one)]
    if unknown:
        return Verdict(wanted.text, False, f"flight {unknown[0]} has a {what} that is no number")
    return Verdict(wanted.text, wanted.holds(value), f"{what} {value:.4f} m, flight {flight}")
