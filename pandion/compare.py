"""``pandion compare``: two campaigns beside each other, and whether the second is worse."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Final

from command_line.junit import Case, junit_xml
from command_line.options import json_file, option, read
from command_line.output import console_beside, json_text, print_error, say, written
from command_line.parser import COULD_NOT_START
from command_line.values import number
from pandion.gate_options import junit

if TYPE_CHECKING:
    from studies.statistics.comparison import Difference

NOT_WORSE, WORSE = 0, 1  # exit codes
_UNFIT: Final = 1  # results that could not be written


@dataclass(frozen=True, slots=True, kw_only=True)
class CompareOptions:
    """Two campaigns."""

    first: Path = option(
        "A", "directory of the campaign that is compared with", Path, required=True
    )
    second: Path = option("B", "directory of the campaign that may be worse", Path, required=True)
    confidence: float = option(
        "--confidence P", "of every interval", number(0.5, 0.999999, ""), default=0.95
    )
    junit: str | None = junit()
    json: str | None = json_file("the differences")


def main(argv: list[str]) -> int:
    """Compare; returns the exit code, 1 if the second campaign is shown to be worse."""
    what = "Compare two campaigns: what differs between the plans, margins and violations."
    options = read(CompareOptions, "pandion compare", what, argv)

    from studies.campaign.keys import CampaignError
    from studies.campaign.store import read_rows
    from studies.statistics.comparison import changes, differences

    try:
        first, second = read_rows(options.first), read_rows(options.second)
        found = differences(first, second, options.confidence)
        if not found:
            raise CampaignError("the campaigns have no configuration in common")
    except (CampaignError, OSError) as error:
        print_error("pandion compare", error)
        return COULD_NOT_START
    console = console_beside(options.json)
    changed = changes(first, second)
    for line in changed or ["the plans, the code and the packages are the same"]:
        say(line, console)
    for one in found:
        say(_sentence(one, options.confidence), console)
    worse = [one for one in found if one.worse]
    verdict = f"{'FAIL' if worse else 'PASS'} {len(worse)} of {len(found)} configurations worse"
    say(verdict, console)
    record = {
        "confidence": options.confidence,
        "changes": changed,
        "configurations": [one.as_json() for one in found],
        "worse": bool(worse),
    }
    cases = [
        Case(
            "compare",
            one.name,
            one.took_s,
            failure=f"{one.worse}: {_sentence(one, options.confidence)}" if one.worse else "",
        )
        for one in found
    ]
    kept = written(
        "pandion compare",
        (options.json, json_text(record, 1) + "\n"),
        (options.junit, junit_xml("compare", cases)),
    )
    return WORSE if worse else NOT_WORSE if kept else _UNFIT


def _sentence(one: Difference, confidence: float) -> str:
    """A configuration in one line."""
    share = f"{100.0 * confidence:g} %"
    margin = "no margin"
    if one.margin_m is not None:
        margin = f"mean margin {1e3 * one.margin_m:+.1f} mm"
        if one.margin_interval_m is not None:
            low, high = (1e3 * end for end in one.margin_interval_m)
            margin += f" ({share}: {low:+.1f} to {high:+.1f})"
    least = " -> ".join(_mm(value) for value in one.least_margin_m)
    low, high = (100.0 * end for end in one.violation_interval)
    pairs = "the same flights" if one.paired else "other flights"
    judged = one.worse or one.better or "no difference shown"
    return (
        f"{one.name}: {one.flights[0]} and {one.flights[1]} flights, {pairs}; {margin}; minimum "
        f"margin {least}; violations or not completed {one.violations[0]} -> {one.violations[1]} "
        f"({share} of the difference: {low:+.2g} to {high:+.2g} %): {judged}"
    )


def _mm(value: float | None) -> str:
    return "none" if value is None else f"{1e3 * value:+.1f} mm"
