"""``pandion tune``: better parameters, found on some flights and judged on others."""

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
    from studies.search.tune import Outcome

BETTER, NOTHING = 0, 1  # exit codes
PARAMS = "tuned.params"


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneOptions:
    """One tuning."""

    file: Path | None = option("FILE.toml", "a campaign file with a table [tune]", Path)
    example: bool = switch("--example", "print such a file to begin with")
    seed: int = option("--seed N", "root of the search's random numbers", whole(), default=0)
    cluster: ClusterOptions = group(ClusterOptions)
    out: Path | None = option(
        "--out DIR",
        f"where {PARAMS} and the journal go; the same command goes on with a journal that is there "
        "(default a new one in runs/)",
        Path,
    )
    json: str | None = json_file("what was found")


def main(argv: list[str]) -> int:
    """Tune; returns the exit code."""
    what = "Improve parameters against a cost and a chance constraint, judged on other flights."
    options = read(TuneOptions, "pandion tune", what, argv)
    from fsw.runtime.process import pin_numerics_to_one_thread

    pin_numerics_to_one_thread()  # before NumPy loads
    from studies.search.tune import EXAMPLE

    if options.example:
        print(EXAMPLE.read_text(encoding="utf-8"), end="")
        return BETTER
    return exit_code("tune", lambda: _tune(options))


def _tune(options: TuneOptions) -> int:
    from studies.campaign.keys import CampaignError
    from studies.search.tune import as_json, load_task, sentences, tune

    if options.file is None:
        raise CampaignError("give a file; `pandion tune --example` prints one")
    task = load_task(options.file)
    work = f"{task.candidates} candidates of {task.plan.count} flights"
    run = begin("tune", options, task.plan, work)

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
    from fsw.parameters.registry import BY_NAME
    from fsw.parameters.storage import save

    assert found.best is not None
    config = found.task.with_values(found.best.values).bases[0].config
    values = {name: one.read(config) for name, one in BY_NAME.items()}
    save(path, {name: x for name, x in values.items() if x != BY_NAME[name].default})
    scenario = found.task.plan.cases[0].scenario
    return f"parameters {path}; pandion fly {scenario} --params={path}"
