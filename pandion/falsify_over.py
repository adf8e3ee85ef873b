"""``pandion falsify --over``: the minimum margin within the bounds of a campaign file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.output import json_text, print_error
from command_line.parser import COULD_NOT_START
from pandion.campaign_run import begin, exit_code
from pandion.display import Display

if TYPE_CHECKING:
    from pandion.falsify_options import FalsifyOptions
    from studies.search.worst_flights import Find, Searched

HOLDS, BROKEN = 0, 1  # exit codes
FINDS: Final = "finds.json"


def main(options: FalsifyOptions, file: Path) -> int:
    """Search and keep; returns the exit code."""
    return exit_code("falsify", lambda: _search(options, file))


def _search(options: FalsifyOptions, file: Path) -> int:
    from studies.campaign.flight_space import spaces
    from studies.campaign.keys import CampaignError
    from studies.campaign.plan import load_plan
    from studies.search.worst_flights import search

    if options.replay is not None:
        raise CampaignError("--replay flies a worst.json; what --over finds flies with pandion fly")
    if options.params is not None:
        raise CampaignError("with --over parameters are set by [parameters] of the file")
    plan = load_plan(file, options.own.names)
    work = f"{options.evaluations} flights"
    run = begin("falsify", plan, work, options.cluster, options.out, options.json)
    folder, display = run.folder, run.display

    def report(done: int, least: float) -> None:
        state = f"{done} flights, minimum margin {1e3 * least:+.1f} mm"
        display.report("flown", done, options.evaluations, state)

    with run.flying() as campaign:
        found = search(
            spaces(plan),
            campaign,
            options.evaluations,
            options.seed,
            together=options.generation,
            report=report,
        )
    if not found.finds:
        print_error("pandion falsify", f"no flight could be flown: {found.why}")
        return COULD_NOT_START
    finds = [_kept(k, find, folder, display) for k, find in enumerate(found.finds[: options.keep])]
    if found.broken:
        display.say(f"{found.broken} flights could not be flown, such as: {found.why}")
    broken = any(find.violates for find in found.finds)
    verdict = "a flight leaves its safe set" if broken else "no flight leaves its safe set"
    display.say(
        f"{found.flights} flights in {len(found.finds)} searches: {verdict}; that none was found "
        "is no proof that there is none"
        if not broken
        else f"{found.flights} flights in {len(found.finds)} searches: {verdict}"
    )
    text = json_text(_as_json(options, found, finds), 1) + "\n"
    (folder / FINDS).write_text(text, encoding="utf-8")
    run.written(text)
    return BROKEN if broken else HOLDS


def _kept(number: int, find: Find, folder: Path, display: Display) -> dict[str, Any]:
    """Write one find and say it; it was flown again from its file."""
    from studies.flight.fly_again import flown_again, keep

    stem = folder / f"find-{number + 1}"
    margin = 1e3 * find.margin_m
    values = ", ".join(f"{key} {value:.4g}" for key, value in find.values.items())
    comment = f"{find.flights.case}: minimum margin {margin:+.1f} mm, found by pandion falsify"
    command = keep(find.job, find.flights.case.controller, stem, f"{comment}\n{values}".strip())
    again = flown_again(find.job, stem)
    same = again.margin_m == find.outcome.margin_m
    ending = f"; {find.outcome.reason}" if not find.outcome.completed else ""
    display.say(f"{number + 1}. {find.flights.case}: minimum margin {margin:+.1f} mm{ending}")
    if values:
        display.say(f"   {values}")
    display.say(f"   {command}")
    if not same:
        display.say("   flown from its file the margin is another: " + str(again.margin_m))
    return {
        "case": str(find.flights.case),
        "margin_m": find.outcome.margin_m,
        "contact": find.outcome.contact,
        "reason": find.outcome.reason,
        "values": find.values,
        "seed": find.job.seed,
        "flights": find.searched,
        "file": str(stem.with_suffix(".toml")),
        "command": command,
        "same_from_file": same,
    }


def _as_json(
    options: FalsifyOptions, found: Searched, finds: list[dict[str, Any]]
) -> dict[str, Any]:
    return {
        "campaign": str(options.over),
        "seed": options.seed,
        "flights": found.flights,
        "not_flown": found.broken,
        "holds": not any(find.violates for find in found.finds),
        "finds": finds,
    }
