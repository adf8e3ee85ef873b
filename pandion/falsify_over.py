"""``pandion falsify --over``: the minimum margin within the bounds of a campaign file."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.output import complain, console_beside, json_text, unwritten
from command_line.parser import COULD_NOT_START
from command_line.version import version
from fsw.log.run_directory import new_run_directory
from pandion.cluster_options import campaign_of
from pandion.display import Display

if TYPE_CHECKING:
    from pandion.falsify import FalsifyOptions
    from studies.campaign.plan import CampaignPlan
    from studies.search.worst_flights import Find, Searched

HOLDS, BROKEN = 0, 1  # exit codes
JOURNAL: Final = "journal.jsonl"
FINDS: Final = "finds.json"


def main(options: FalsifyOptions, file: Path) -> int:
    """Search and keep; returns the exit code."""
    from studies.campaign.campaign import SchedulerGoneError
    from studies.campaign.keys import CampaignError
    from studies.campaign.plan import load_plan

    try:
        if options.replay is not None:
            raise CampaignError(
                "--replay flies a worst.json; what --over finds flies with pandion fly"
            )
        return _search(options, load_plan(file))
    except KeyboardInterrupt:
        complain("pandion falsify", "interrupted; the same command with --out goes on")
        return BROKEN
    except (CampaignError, SchedulerGoneError, OSError) as error:
        complain("pandion falsify", error)
        return COULD_NOT_START


def _search(options: FalsifyOptions, plan: CampaignPlan) -> int:
    from studies.campaign.flight_space import spaces
    from studies.campaign.store import refuse_campaign
    from studies.search.worst_flights import search

    folder = options.out or new_run_directory(Path("runs"), f"falsify-{plan.name}")
    refuse_campaign(folder)
    folder.mkdir(parents=True, exist_ok=True)
    display = Display(console_beside(options.json))
    display.say(
        f"Pandion {version()}: {plan.name}, {options.evaluations} flights, "
        f"{options.cluster.words}, written to {folder}"
    )
    campaign = campaign_of(
        options.cluster, folder / JOURNAL, say=display.say, time_limit_s=plan.time_limit_s
    )

    def report(done: int, least: float) -> None:
        state = f"{done} flights, minimum margin {1e3 * least:+.1f} mm"
        display.report("flown", done, options.evaluations, state)

    with display.progress(), campaign:
        found = search(
            spaces(plan),
            campaign,
            options.evaluations,
            options.seed,
            together=options.generation,
            report=report,
        )
    if not found.finds:
        complain("pandion falsify", f"no flight could be flown: {found.why}")
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
    for what in unwritten(options.json, text):
        complain("pandion falsify", f"cannot write {what}")
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
