"""What verbs that ask a campaign one question have in common, from the banner to ``--json``."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.output import console_beside, print_error, written
from command_line.parser import COULD_NOT_START
from command_line.run_directory import new_run_directory
from command_line.version import version
from pandion.cluster_options import ClusterOptions, campaign_of
from pandion.display import Display

if TYPE_CHECKING:
    from studies.campaign.campaign import Campaign
    from studies.campaign.plan import CampaignPlan

_INTERRUPTED: Final = 1  # exit code


@dataclass(frozen=True, slots=True)
class CampaignRun:
    """One question: where its flights are flown, and where its answer is written."""

    verb: str
    folder: Path
    display: Display
    campaign: Campaign[Any]
    json: str | None

    @contextmanager
    def flying(self) -> Iterator[Campaign[Any]]:
        """The campaign with its workers, and a bar, while the context lasts."""
        with self.display.progress(), self.campaign:
            yield self.campaign

    def written(self, text: str) -> bool:
        """Write what ``--json`` asks for; False, and a sentence, if that cannot be done."""
        return written(f"pandion {self.verb}", (self.json, text))


def begin(
    verb: str,
    plan: CampaignPlan,
    work: str,
    cluster: ClusterOptions,
    out: Path | None,
    json: str | None,
) -> CampaignRun:
    """Make the directory and say what is flown, ``work`` being how many flights, in words.

    Files go to ``out``, or to a new directory; the answer goes to ``json`` as well.

    Raises:
        CampaignError: The directory is that of a campaign, whose rows would be mixed with these.
    """
    from studies.campaign.store import JOURNAL, refuse_campaign

    folder = out or new_run_directory(Path("runs"), f"{verb}-{plan.name}")
    refuse_campaign(folder)
    folder.mkdir(parents=True, exist_ok=True)
    display = Display(console_beside(json))
    display.say(f"Pandion {version()}: {plan.name}, {work}, {cluster.words}, written to {folder}")
    campaign = campaign_of(
        cluster, folder / JOURNAL, say=display.say, time_limit_s=plan.time_limit_s
    )
    return CampaignRun(verb, folder, display, campaign, json)


def exit_code(verb: str, answer: Callable[[], int]) -> int:
    """The exit code of ``answer``; what stops it becomes a sentence."""
    from studies.campaign.keys import CampaignError
    from studies.campaign.ports import SchedulerGoneError

    try:
        return answer()
    except KeyboardInterrupt:
        print_error(f"pandion {verb}", "interrupted; the same command with --out goes on")
        return _INTERRUPTED
    except (CampaignError, SchedulerGoneError, OSError) as error:
        print_error(f"pandion {verb}", error)
        return COULD_NOT_START
