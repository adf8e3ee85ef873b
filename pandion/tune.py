"""``pandion tune``: better parameters, found on some flights and judged on others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from command_line.options import group
from command_line.output import json_text
from pandion.campaign_run import begin
from pandion.own_options import OwnOptions
from pandion.search_task import SearchTaskOptions, run_task

if TYPE_CHECKING:
    from studies.search.tune import Outcome

BETTER, NOTHING = 0, 1  # exit codes
PARAMS = "tuned.params"


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneOptions(SearchTaskOptions):
    """A search for parameters, with which whoever flies may be another."""

    own: OwnOptions = group(OwnOptions)


def main(argv: list[str]) -> int:
    """Tune; returns the exit code."""
    what = "Improve parameters against a cost and a chance constraint, judged on other flights."
    return run_task("tune", what, argv, TuneOptions, "studies.search.tune", _tune)


def _tune(options: TuneOptions, file: Path) -> int:
    from studies.search.tune import as_json, load_task, sentences, tune

    task = load_task(file, options.own.names)
    work = f"{task.candidates} candidates of {task.plan.count} flights"
    run = begin("tune", task.plan, work, options.cluster, options.out, options.json)

    def report(done: int, least: float) -> None:
        state = f"{done} candidates, least cost {least:.4f} of {sum(w for _, w in task.cost):g}"
        run.display.report("tuned", done, task.candidates, state)

    with run.flying() as campaign:
        found = tune(task, campaign, options.seed, report)
    for sentence in sentences(found):
        run.display.say(sentence)
    if found.better:
        run.display.say(_written(found, run.folder / PARAMS))
    written = run.written(json_text(as_json(found), 1) + "\n")
    return BETTER if found.better and written else NOTHING


def _written(found: Outcome, path: Path) -> str:
    """Write the parameters that differ from the defaults; the sentence that says where."""
    from fsw.storage.parameter_file import save
    from studies.flight.fly_again import changed_parameters

    assert found.best is not None
    save(path, changed_parameters(found.task.with_values(found.best.values).bases[0].config))
    scenario = found.task.plan.cases[0].scenario
    return f"parameters {path}; pandion fly {scenario} --params={path}"
