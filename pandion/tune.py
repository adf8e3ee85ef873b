"""``pandion tune``: better parameters, found on some flights and judged on others."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

from command_line.options import group, json_file, option, read, switch
from command_line.output import complain, console_beside, json_text, unwritten
from command_line.parser import COULD_NOT_START
from command_line.values import whole
from command_line.version import version
from fsw.log.run_directory import new_run_directory
from pandion.cluster_options import ClusterOptions, campaign_of
from pandion.display import Display

if TYPE_CHECKING:
    from studies.search.tune import Outcome, Task

BETTER, NOTHING = 0, 1  # exit codes
JOURNAL, PARAMS = "journal.jsonl", "tuned.params"


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
    from studies.campaign.campaign import SchedulerGoneError
    from studies.campaign.keys import CampaignError
    from studies.search.tune import EXAMPLE, load_task

    if options.example:
        print(EXAMPLE.read_text(encoding="utf-8"), end="")
        return BETTER
    try:
        if options.file is None:
            raise CampaignError("give a file; `pandion tune --example` prints one")
        return _tune(options, load_task(options.file))
    except KeyboardInterrupt:
        complain("pandion tune", "interrupted; the same command with --out goes on")
        return NOTHING
    except (CampaignError, SchedulerGoneError, OSError) as error:
        complain("pandion tune", error)
        return COULD_NOT_START


def _tune(options: TuneOptions, task: Task) -> int:
    from studies.campaign.store import refuse_campaign
    from studies.search.tune import as_json, sentences, tune

    folder = options.out or new_run_directory(Path("runs"), f"tune-{task.plan.name}")
    refuse_campaign(folder)
    folder.mkdir(parents=True, exist_ok=True)
    display = Display(console_beside(options.json))
    display.say(
        f"Pandion {version()}: {task.plan.name}, {task.candidates} candidates of "
        f"{task.plan.count} flights, {options.cluster.words}, written to {folder}"
    )
    campaign = campaign_of(
        options.cluster,
        folder / JOURNAL,
        say=display.say,
        time_limit_s=task.plan.time_limit_s,
    )

    def report(done: int, least: float) -> None:
        state = f"{done} candidates, least cost {least:.4f} of {sum(w for _, w in task.cost):g}"
        display.report("tuned", done, task.candidates, state)

    with display.progress(), campaign:
        found = tune(task, campaign, options.seed, report)
    for sentence in sentences(found):
        display.say(sentence)
    lost = unwritten(options.json, json_text(as_json(found), 1) + "\n")
    if found.better:
        display.say(_written(found, folder / PARAMS))
    for what in lost:
        complain("pandion tune", f"cannot write {what}")
    return BETTER if found.better and not lost else NOTHING


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
