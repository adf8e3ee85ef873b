"""A certificate for people: sentences for the terminal, and one page that holds the statement."""

from __future__ import annotations

import html
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import zip_longest
from typing import Any, Final

from command_line.bounded_json import json_object
from command_line.html_page import document, items, table, verdict
from command_line.output import json_text
from studies.campaign.store import CampaignResult
from studies.drawing import BASE, WALL, drawable
from studies.statistics.violations import ANY, VIOLATIONS

_HOLDER: Final = ('<script type="application/json" id="certificate">', "</script>")
_HELD: Final = re.compile("(.*?)".join(map(re.escape, _HOLDER)), re.DOTALL)
_MAX_DRAWN: Final = 8
_BARS: Final = 50

MEANING: Final = (
    "The bounds are of Clopper and Pearson. They hold for flights drawn as these were, whatever "
    "the probability is, in at least the stated share of campaigns.",
    "One-sided: with this confidence the probability is at most the bound. Two-sided: with this "
    "confidence it is within the interval. Both are not to be had together at this confidence.",
    "The bounds assume that the number of flights was fixed before: not to be extended until a "
    "number pleases.",
    "A flight that could not be flown, or that the vehicle refused, counts as a violation of every "
    "kind.",
    "A bound of one configuration is for it alone; that all hold together is less certain.",
    "The probability is one in the simulator, with the vehicle, disturbances and sensors that are "
    "named here. How far the simulator is from a vehicle is not in any number.",
    "The digest shows that the statement belongs to these rows. It is no signature of a person.",
)


def headline(stated: dict[str, Any]) -> str:
    """What the campaign shows, in a sentence."""
    found = stated["findings"][ANY]
    return (
        f"{found['count']} of {found['total']} flights with a violation: with "
        f"{_percent(found['confidence'])} confidence the probability of one is at most "
        f"{_probability(found['upper'])} (one-sided)"
    )


def _verdicts(stated: dict[str, Any]) -> list[dict[str, Any]]:
    """What was required; without that, that no violation was seen."""
    found = stated["findings"][ANY]
    seen = f"{found['count']} of {found['total']} flights"
    none = {"text": "no violation was seen", "met": found["count"] == 0, "found": seen}
    return stated.get("required") or [none]


def sentences(stated: dict[str, Any]) -> Iterator[str]:
    """The statement, line by line."""
    yield headline(stated)
    for one in stated.get("required", ()):
        yield f"{'met' if one['met'] else 'NOT met'}: {one['text']}; {one['found']}"
    for name, found in stated["findings"].items():
        low, high = found["interval"]
        yield (
            f"{name:15} {found['count']:6d} of {found['total']}, at most "
            f"{_probability(found['upper'])}; two-sided {_probability(low)} to "
            f"{_probability(high)}"
        )
    yield stated["assumed"]
    for one in stated["margins"]:
        yield f"{one['name']}: {_margin_sentence(one)}"
        yield f"{one['name']}: {tail_sentence(one['tail'])}"
    yield f"digest {stated['digest']}"


def tail_sentence(tail: dict[str, Any]) -> str:
    """What the fitted tail says, or why there is none."""
    if "none" in tail:
        return str(tail["none"])
    goodness = f"goodness of fit p = {tail['goodness']:.3f} (Anderson-Darling)"
    if not tail["fits"]:
        return (
            f"no generalised Pareto law describes the lowest {tail['tail']} margins ({goodness}): "
            "nothing is extrapolated"
        )
    text = (
        f"below {_mm(tail['threshold_m'])} a generalised Pareto law of shape "
        f"{_interval(tail['shape'], '{:.2f}')} describes the lowest {tail['tail']} margins "
        f"({goodness})"
    )
    for share, margin in tail["margins_m"]:
        text += f"; {1.0 / share:.0f} flights: {_interval(margin, 'mm')}"
    if tail["below_zero"] is not None:
        text += f"; extrapolated probability below 0: {_interval(tail['below_zero'], '{:.2g}')}"
    if tail["end_m"] is not None:
        text += f"; least possible margin by this law {_interval(tail['end_m'], 'mm')}"
    return text


def page(stated: dict[str, Any], result: CampaignResult) -> str:
    """The certificate as a page without links to anything; the statement is in it, as data."""
    title = f"Certificate of campaign {stated['campaign']}"
    parts = [f"<h1>{html.escape(title)}</h1>"]
    parts += [verdict(one["met"], f"{one['text']}: {one['found']}") for one in _verdicts(stated)]
    parts.append(f"<p><b>{html.escape(headline(stated))}</b></p>")
    parts.append(_findings(stated))
    parts.append(f"<p>{html.escape(stated['assumed'])}</p>")
    parts += [_configurations(stated), "<h2>Minimum margins</h2>"]
    for one in stated["margins"]:
        text = f"{one['name']}: {_margin_sentence(one)}. {tail_sentence(one['tail'])}."
        parts.append(f"<p>{html.escape(text)}</p>")
    parts += _histograms(stated, result)
    for name in ("varied", "random", "not_varied"):
        heading = {"varied": "Varied", "random": "Random in every flight"}.get(name, "Not varied")
        parts += [f"<h2>{heading}</h2>", items(stated[name] or ["nothing"])]
    parts += ["<h2>What the numbers mean</h2>", items(MEANING)]
    parts += ["<h2>To check it</h2>", items(_provenance(stated))]
    # No "</script>" can be in JSON text whose "<" are written as escapes.
    data = json_text(stated).replace("<", "\\u003c")
    parts.append(_HOLDER[0] + data + _HOLDER[1])
    return document(title, parts)


def statement_in(text: str) -> dict[str, Any]:
    """The statement in the text of a JSON file or of a page.

    Raises:
        JsonError: There is none.
    """
    held = _HELD.search(text)
    return json_object(held[1] if held else text)


def page_differences(text: str, stated: dict[str, Any], result: CampaignResult) -> Iterator[str]:
    """Where a page is first not as it is written for a statement; nothing of a JSON file.

    People read the page and not the statement in it, so all of it must be so: it depends on nothing
    but the statement, the rows and this version.
    """
    if not _HELD.search(text):
        return
    lines = zip_longest(text.split("\n"), page(stated, result).split("\n"))
    for number, (one, other) in enumerate(lines, start=1):
        if one != other:
            yield (
                f"line {number} of the page is not as it is written for its statement: the page "
                "was changed, or is of another version"
            )
            return


def _findings(stated: dict[str, Any]) -> str:
    share = _percent(stated["confidence"])
    headers = ("violation", "flights", "of", f"at most, {share}", f"two-sided, {share}")
    return table(
        headers,
        [
            (
                name,
                str(found["count"]),
                str(found["total"]),
                _probability(found["upper"]),
                " to ".join(map(_probability, found["interval"])),
            )
            for name, found in stated["findings"].items()
        ],
        "Probability in a flight",
    )


def _configurations(stated: dict[str, Any]) -> str:
    headers = ("configuration", "flights", *VIOLATIONS, "at most", "minimum margin")
    return table(
        headers,
        [
            (
                one["name"],
                str(one["flights"]),
                *(str(one["counted"][what]) for what in VIOLATIONS),
                _probability(one["at_most"]),
                _mm(one["min_margin_m"]),
            )
            for one in stated["configurations"]
        ],
        "Configurations",
    )


def _provenance(stated: dict[str, Any]) -> list[str]:
    digests, versions = stated["digests"], stated["versions"]
    return [
        *(f"Command: {command}" for command in stated["commands"]),
        f"Pandion {versions['flown']} flew, {versions['certified']} certified",
        *(f"{name}: {value}" for name, value in digests.items()),
        f"statement: {stated['digest']} (SHA-256 of its canonical JSON without this digest)",
        "pandion certify DIR --verify THIS_PAGE computes all of it again and says what differs",
    ]


def _margin_sentence(one: dict[str, Any]) -> str:
    quantiles = one["quantiles_m"]
    if not quantiles:
        return "no flight has a margin"
    shown = ((quantiles["0.0"], "least"), (quantiles["0.01"], "1 %"), (quantiles["0.5"], "median"))
    texts = ", ".join(f"{name} {_mm(value)}" for value, name in shown)
    cut = (
        f"; {one['cut_short']} ended early or left their trajectory "
        f"({one['ended_at_contact']} by contact), so their margins are of a part of it"
        if one["cut_short"]
        else ""
    )
    return f"margins of {one['flights']} flights: {texts}{cut}"


def _histograms(stated: dict[str, Any], result: CampaignResult) -> Iterator[str]:
    rows = result.by_case
    for one in [one for one in stated["margins"] if one["quantiles_m"]][:_MAX_DRAWN]:
        margins_mm = drawable(
            1e3 * row.margin_m for row in rows[one["name"]] if row.margin_m is not None
        )
        if margins_mm:
            yield _histogram(one["name"], margins_mm)


def _histogram(name: str, margins_mm: Sequence[float]) -> str:
    """How often there was which minimum margin [mm].

    It is drawn here, of bars that are 10 wide and at most 100 high: a library's drawing depends on
    its version and settings, and a page must be the same wherever it is written.
    """
    low, high = min(margins_mm), max(margins_mm)
    span = high - low or 1.0
    bars = Counter(min(int(_BARS * ((one - low) / span)), _BARS - 1) for one in margins_mm)
    most = max(bars.values())
    path = "".join(f"M{10 * k} 100v{-100 * bars[k] / most:.1f}h9V100z" for k in sorted(bars))
    zero = f'<path stroke="{WALL}" d="M{-10 * _BARS * low / span:.1f} 0V100"/>'
    ends = f'<text y="115">{low:+.1f} mm</text>'
    ends += f'<text x="{10 * _BARS}" y="115" text-anchor="end">{high:+.1f} mm</text>'
    caption = f"{name}: minimum margin, of {most} flights in the highest bar"
    return (
        f'<figure><svg viewBox="0 0 {10 * _BARS} 120" width="{20 * _BARS}" font-size="12">'
        f'<path fill="{BASE}" d="{path}"/>{zero if low <= 0.0 <= high else ""}{ends}</svg>'
        f"<figcaption>{html.escape(caption)}</figcaption></figure>"
    )


def _percent(share: float) -> str:
    return f"{100.0 * share:.6g} %"


def _probability(value: float) -> str:
    return "0" if value == 0.0 else f"{value:.3g}" if value < 1e-3 else f"{100.0 * value:.3g} %"


def _mm(value: float | None) -> str:
    return "none" if value is None else f"{1e3 * value:+.1f} mm"


def _interval(estimate: dict[str, Any], how: str) -> str:
    """A number and its interval; of one without an end, the word for it."""

    def text(value: float | None) -> str:
        if value is None:
            return "without end"
        return _mm(value) if how == "mm" else how.format(value)

    return f"{text(estimate['value'])} ({text(estimate['low'])} to {text(estimate['high'])})"
