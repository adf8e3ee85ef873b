"""``pandion search``: a scenario that decides between controllers, judged on other seeds."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from command_line.output import json_text
from pandion.campaign_run import begin
from pandion.search_task import SearchTaskOptions, run_task

if TYPE_CHECKING:
    from studies.search.scenario_search import Found

DECIDES, NOTHING = 0, 1  # exit codes
DISTURBED, CALM = "found.toml", "found-calm.toml"


def main(argv: list[str]) -> int:
    """Search; returns the exit code."""
    what = "Search for a scenario that decides between controllers, judged on other seeds."
    return run_task(
        "search", what, argv, SearchTaskOptions, "studies.search.scenario_search", _search
    )


def _search(options: SearchTaskOptions, file: Path) -> int:
    from studies.search.scenario_search import as_json, load_task, search, sentences

    task = load_task(file)
    work = f"{task.candidates} candidates, {len(task.marks)} controllers"
    run = begin("search", task.plan, work, options.cluster, options.out, options.json)

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
    from sitl.scenario_text import write_scenario

    scenarios = found.task.scenarios(found.shares, whole=True)
    for scenario, name in zip(scenarios, (CALM, DISTURBED), strict=True):
        comment = f"found by pandion search, {found.task.plan.name}"
        write_scenario(scenario, folder / name, comment)
    return f"scenarios {folder / CALM} and {folder / DISTURBED}; pandion fly {folder / DISTURBED}"
