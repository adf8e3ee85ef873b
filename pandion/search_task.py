"""What ``pandion tune`` and ``pandion search`` have in common: options, and a task in a file."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Final, TypeVar

from command_line.options import group, json_file, option, read, switch
from command_line.values import whole
from pandion.campaign_run import exit_code
from pandion.cluster_options import ClusterOptions

_PRINTED: Final = 0  # exit code


@dataclass(frozen=True, slots=True, kw_only=True)
class SearchTaskOptions:
    """One search by a task."""

    file: Path | None = option("FILE.toml", "a campaign file with the table of the task", Path)
    example: bool = switch("--example", "print such a file to begin with")
    seed: int = option("--seed N", "root of the search's random numbers", whole(), default=0)
    cluster: ClusterOptions = group(ClusterOptions)
    out: Path | None = option(
        "--out DIR",
        "where what is found and the journal go; the same command goes on with a journal that is "
        "there (default a new one in runs/)",
        Path,
    )
    json: str | None = json_file("what was found")


Options = TypeVar("Options", bound=SearchTaskOptions)


def run_task(
    verb: str,
    what: str,
    argv: list[str],
    kind: type[Options],
    module: str,
    run: Callable[[Options, Path], int],
) -> int:
    """Read the options of a ``verb``, of a ``kind``, and ``run`` its task or print an example.

    Returns the exit code. The example is that of the ``module``, which is loaded only then.
    """
    options = read(kind, f"pandion {verb}", what, argv)

    if options.example:
        print(import_module(module).EXAMPLE.read_text(encoding="utf-8"), end="")
        return _PRINTED

    def answer() -> int:
        from studies.campaign.keys import CampaignError

        if options.file is None:
            raise CampaignError(f"give a file; `pandion {verb} --example` prints one")
        return run(options, options.file)

    return exit_code(verb, answer)
