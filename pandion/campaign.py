"""``pandion campaign``: many flights from one file, on this machine or on a cluster."""

from __future__ import annotations

import shlex
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.junit import junit_xml
from command_line.options import as_words, group, json_file, option, read, switch
from command_line.output import command_name, console_beside, json_text, print_error, say, written
from command_line.parser import COULD_NOT_START
from command_line.run_directory import new_run_directory
from command_line.values import whole
from command_line.version import version
from pandion.cluster_options import ClusterOptions, campaign_of
from pandion.display import Display
from pandion.gate_options import junit, required
from pandion.own_options import OwnOptions

if TYPE_CHECKING:
    from studies.campaign.plan import CampaignPlan
    from studies.statistics.requirement import Requirement

FLOWN, BROKEN = 0, 1  # exit codes
_CONFIDENCE: Final = 0.95  # of a requirement that names none


@dataclass(frozen=True, slots=True, kw_only=True)
class CampaignOptions:
    """One campaign, or one flight of it."""

    file: Path | None = option("FILE.toml", "what is flown", Path)
    example: bool = switch("--example", "print a campaign file to begin with")
    flights: int | None = option(
        "--flights N", "how many, from the first (default as the file says)", whole(1, 10_000_000)
    )
    flight: int | None = option(
        "--flight K",
        "fly flight K alone, here, and write its trace and its scenario for pandion fly",
        whole(0, 10_000_000),
    )
    cluster: ClusterOptions = group(ClusterOptions)
    own: OwnOptions = group(OwnOptions)
    out: Path | None = option(
        "--out DIR",
        "where journal, rows and page go; a directory with a journal of the same campaign is "
        "resumed (default a new one in runs/)",
        Path,
    )
    require: tuple[Requirement, ...] = required()
    junit: str | None = junit()
    json: str | None = json_file("the summary")


def main(argv: list[str]) -> int:
    """Fly; returns the exit code."""
    what = "Fly many flights from one file, and write down what became of them."
    options = read(CampaignOptions, "pandion campaign", what, argv)

    from studies.campaign.keys import CampaignError
    from studies.campaign.plan import EXAMPLE, load_plan
    from studies.campaign.ports import SchedulerGoneError

    if options.example:
        print(EXAMPLE.read_text(encoding="utf-8"), end="")
        return FLOWN
    try:
        if options.file is None:
            raise CampaignError("give a campaign file; `pandion campaign --example` prints one")
        plan = load_plan(options.file, options.own.names)
        if options.flight is not None:
            if options.require or options.junit:
                raise CampaignError("--require and --junit are of all flights: leave out --flight")
            return _again(options, plan)
        return _fly(options, options.file, plan)
    except (CampaignError, SchedulerGoneError, OSError) as error:
        print_error("pandion campaign", error)
        return COULD_NOT_START


def _fly(options: CampaignOptions, file: Path, plan: CampaignPlan) -> int:
    from studies.campaign.ports import SchedulerGoneError
    from studies.campaign.store import JOURNAL, begin

    plan.check(options.flights or plan.count)
    folder = options.out or new_run_directory(Path("runs"), plan.name)
    asked = begin(folder, file, plan, options.flights)
    display = Display(console_beside(options.json))
    display.say(
        f"Pandion {version()}: {plan.name}, {asked} flights, {options.cluster.words}, "
        f"written to {folder}"
    )
    try:
        with display.progress():
            _all(options, plan, asked, folder, display)
    except KeyboardInterrupt:
        command = _resumed(options, file, folder)
        print_error(
            "pandion campaign", f"interrupted; what was flown is kept, go on with: {command}"
        )
        return BROKEN
    except SchedulerGoneError as error:
        if not (folder / JOURNAL).stat().st_size:
            raise
        print_error("pandion campaign", f"{error}; what was flown is in {folder}")
        return BROKEN
    return _written(options, folder, display)


def _resumed(options: CampaignOptions, file: Path, folder: Path) -> str:
    """The command that goes on: as it was given, into the same directory."""
    words = as_words(replace(options, file=None, out=None))
    command = ["campaign", str(file), *words, "--out", str(folder)]
    return f"{command_name()} {shlex.join(command)}"


def _all(
    options: CampaignOptions, plan: CampaignPlan, asked: int, folder: Path, display: Display
) -> None:
    from studies.campaign.flight import CampaignFlights
    from studies.campaign.store import JOURNAL
    from studies.campaign.summary import Progress

    campaign = campaign_of(
        options.cluster, folder / JOURNAL, say=display.say, time_limit_s=plan.time_limit_s
    )
    progress = Progress(asked)
    with campaign:
        for _, row in campaign.fly(CampaignFlights(plan, asked)):
            progress.add(row, fresh=campaign.flies)
            display.report("flown", progress.done, asked, str(progress))


def _written(options: CampaignOptions, folder: Path, display: Display) -> int:
    """Page, table and summary of what is in the journal now."""
    from studies.campaign.junit_cases import junit_cases
    from studies.campaign.page import again, page
    from studies.campaign.store import PAGE, left_out, read, write_facts, write_table
    from studies.campaign.summary import summaries, verdict, worst
    from studies.statistics.certificate import verdicts

    result = read(folder)
    rows = result.rows
    cases = summaries(rows)
    more: dict[str, Any] = {
        "flown": len(rows),
        "violations": sum(row.violated for row in rows),
        "refused": sum(row.refused for row in rows),
        "errors": sum(row.error for row in rows),
        "configurations": [asdict(one) for one in cases],
        "worst": [row.compared() | {"again": again(row, folder)} for row in worst(rows)],
    }
    facts = write_facts(folder, result.plan, result.asked, result.seal, more)
    sentences = (f"Pandion {version()}", f"Command: pandion campaign {folder / 'campaign.toml'}")
    judged = verdicts(result, _CONFIDENCE, options.require)
    shown = [(one["met"], f"{one['text']}: {one['found']}") for one in judged]
    (folder / PAGE).write_text(page(result, sentences, folder, shown), encoding="utf-8")
    if write_table(folder, rows) is None:
        display.say("no rows.parquet: pip install pyarrow for it; the journal has the rows")
    for one in cases:
        least = one.margin_m.get("0")
        margin = "" if least is None else f", minimum margin {1e3 * least:+.1f} mm"
        name = ", ".join(x for x in (one.scenario, one.suite, one.controller, one.fault) if x)
        refused = f", {one.refused} refused by the vehicle" if one.refused else ""
        broke = f", {one.errors} broke" if one.errors else ""
        display.say(
            f"{name}: {one.flights} flights, {one.violated} violations{refused}{broke}{margin}"
        )
    if result.left_out:
        display.say(left_out(result.left_out))
    for passed, sentence in shown or [verdict(rows, result.asked)]:
        display.say(f"{'PASS' if passed else 'FAIL'} {sentence}")
    display.say(f"page {folder / PAGE}")
    kept = written(
        "pandion campaign",
        (options.json, json_text(facts, 1) + "\n"),
        (options.junit, junit_xml(result.plan.name, junit_cases(result, judged))),
    )
    for row in rows:
        if row.error:
            print_error("pandion campaign", f"flight {row.flight} broke: {row.reason}")
            break
    met = all(passed for passed, _ in shown)
    return FLOWN if kept and met and not more["errors"] else BROKEN


def _again(options: CampaignOptions, plan: CampaignPlan) -> int:
    """One flight in this process, its trace, and what flies it with both processes and a log."""
    from studies.campaign.flight import CampaignFlight
    from studies.campaign.keys import CampaignError
    from studies.flight.fly_again import keep

    number = options.flight or 0
    plan.check(number + 1)
    try:
        flight = plan.flight(number)
    except ValueError as error:
        raise CampaignError(f"flight {number} cannot be flown: {error}") from None
    folder = options.out or new_run_directory(Path("runs"), f"{plan.name}-flight{number}")
    folder.mkdir(parents=True, exist_ok=True)
    row, result = CampaignFlight(plan, number).flown(traced=True)
    console = console_beside(options.json)
    say(f"flight {number}: {flight.case}, seed {flight.seed}", console)
    for key, value in flight.values:
        say(f"  {key} = {value:g}", console)
    say(f"  {row.reason}", console)
    traced: dict[str, Any] = {"row": row.compared()}
    if result is not None:
        traced["texts"] = result.planner.texts
        traced["trace"] = [asdict(point) for point in result.planner.trace]
    stem = folder / f"flight-{number}"
    trace = stem.with_suffix(".json")
    trace.write_text(json_text(traced) + "\n", encoding="utf-8")
    say(f"trace {trace}", console)
    comment = f"flight {number} of campaign {plan.name}: {flight.case}"
    command = keep(flight.job, flight.case.controller, stem, comment, command_name())
    say(f"with its log: {command}", console)
    kept = written("pandion campaign", (options.json, json_text(traced["row"], 1) + "\n"))
    return FLOWN if kept and not row.error else BROKEN
