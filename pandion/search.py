"""``pandion search``: a scenario that decides between controllers, judged on other seeds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from command_line.options import group, json_file, option, read, switch
from command_line.output import json_text
from command_line.values import whole
from pandion.campaign_run import begin, exit_code
from pandion.cluster_options import ClusterOptions

if TYPE_CHECKING:
    from studies.search.scenario_search import Found

DECIDES, NOTHING = 0, 1  # exit codes
DISTURBED, CALM = "found.toml", "found-calm.toml"


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchOptions:
    """One search."""

    file: Path | None = option("FILE.toml", "a campaign file with a table [search]", Path)
    example: bool = switch("--example", "print such a file to begin with")
    seed: int = option("--seed N", "root of the search's random numbers", whole(), default=0)
    cluster: ClusterOptions = group(ClusterOptions)
    out: Path | None = option(
        "--out DIR",
        f"where {DISTURBED}, {CALM} and the journal go; the same command goes on with a journal "
        "that is there (default a new one in runs/)",
        Path,
    )
    json: str | None = json_file("what was found")


def main(argv: list[str]) -> int:
    """Search; returns the exit code."""
    what = "Search for a scenario that decides between controllers, judged on other seeds."
    options = read(SearchOptions, "pandion search", what, argv)
    from fsw.runtime.process import pin_numerics_to_one_thread

    pin_numerics_to_one_thread()  # before NumPy loads
    from studies.search.scenario_search import EXAMPLE

    if options.example:
        print(EXAMPLE.read_text(encoding="utf-8"), end="")
        return DECIDES
    return exit_code("search", lambda: _search(options))


def _search(options: SearchOptions) -> int:
    from studies.campaign.keys import CampaignError
    from studies.search.scenario_search import as_json, load_task, search, sentences

    if options.file is None:
        raise CampaignError("give a file; `pandion search --example` prints one")
    task = load_task(options.file)
    work = f"{task.candidates} candidates, {len(task.marks)} controllers"
    run = begin("search", options, task.plan, work)

    def report(done: int, least: float) -> None:
        state = f"{done} candidates, the best falls short by {1e3 * least:.1f} mm"
        run.display.report("searched", done, task.candidates, state)

    with run.flying() as campaign:
        found = search(task, campaign, options.seed, report)
    for sentence in sentences(found):
        run.display.say(sentence)
    run.display.say(_written(found, run.folder))
    written = run.written(json_text(as_json(found), 1) + "\n")
    return DECIDES if found.decides and written else NOTHING


def _written(found: Found, folder: Path) -> str:
    """Write both scenarios; the sentence that says where."""
    from sitl.scenario_text import scenario_text

    scenarios = found.task.scenarios(found.shares, whole=True)
    for scenario, name in zip(scenarios, (CALM, DISTURBED), strict=True):
        text = scenario_text(scenario, f"found by pandion search, {found.task.plan.name}")
        (folder / name).write_text(text, encoding="utf-8")
    return f"scenarios {folder / CALM} and {folder / DISTURBED}; pandion fly {folder / DISTURBED}"
