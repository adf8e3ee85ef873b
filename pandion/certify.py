"""``pandion certify``: what a campaign shows, with exact bounds, as a page that can be checked."""

from __future__ import annotations

import random
from collections.abc import Iterator
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from command_line.bounded_file import read_bounded
from command_line.bounded_json import JsonError
from command_line.options import group, json_file, option, read
from command_line.output import console_beside, json_text, print_error, written
from command_line.parser import COULD_NOT_START
from command_line.toml_tables import shown
from command_line.values import number, whole
from pandion.cluster_options import ClusterOptions, campaign_of
from pandion.display import Display
from pandion.gate_options import required

if TYPE_CHECKING:
    from studies.campaign.flight import CampaignRow
    from studies.campaign.store import CampaignResult
    from studies.statistics.requirement import Requirement

CERTIFIED, DIFFERS = 0, 1  # exit codes
_INTERRUPTED: Final = 1  # as well
PAGE = "certificate.html"
_MAX_BYTES: Final = 64 * 1024 * 1024  # of a page that is read
_LEAST, _MOST = 0.5, 0.999999  # confidence [1]
_MAX_REFITS: Final = 100_000
_WRITTEN: Final = "give what `pandion certify` has written"


@dataclass(frozen=True, slots=True, kw_only=True)
class CertifyOptions:
    """One campaign."""

    campaign: Path = option(
        "CAMPAIGN_DIR", "directory that `pandion campaign` has written", Path, required=True
    )
    confidence: float = option(
        "--confidence P", "of every bound and interval", number(_LEAST, _MOST, ""), default=0.95
    )
    verify: Path | None = option(
        "--verify FILE",
        "compute a certificate, .html or .json, again from the directory and say what differs",
        Path,
    )
    refly: int = option(
        "--refly N",
        "fly N of the flights again, drawn anew each time, and refuse what differs from its row",
        whole(),
        default=0,
    )
    cluster: ClusterOptions = group(ClusterOptions)
    require: tuple[Requirement, ...] = required()
    json: str | None = json_file("the statement")
    html: Path | None = option(
        "--html FILE", f"the page (default {PAGE} in the directory)", Path, old="--out"
    )


class NoCertificateError(ValueError):
    """A file that holds no certificate of this version."""


def main(argv: list[str]) -> int:
    """Certify, or verify; returns the exit code, 1 if a requirement is not met."""
    what = "State what a campaign shows: exact bounds, margins, what was varied and what was not."
    options = read(CertifyOptions, "pandion certify", what, argv)

    from studies.campaign.keys import CampaignError
    from studies.campaign.ports import SchedulerGoneError
    from studies.campaign.store import read as read_campaign

    try:
        result = read_campaign(options.campaign)
        if options.refly and not _flown_again(options, result):
            return DIFFERS
        if options.verify is not None:
            if options.require:
                raise NoCertificateError(
                    "--verify computes what the certificate requires; leave out --require"
                )
            return _verify(options, result, options.verify)
        return _certify(options, result)
    except KeyboardInterrupt:
        print_error("pandion certify", "interrupted; nothing was certified")
        return _INTERRUPTED
    except (CampaignError, NoCertificateError, SchedulerGoneError, OSError) as error:
        print_error("pandion certify", error)
        return COULD_NOT_START


def _flown_again(options: CertifyOptions, result: CampaignResult) -> bool:
    """Whether flights that are flown again here leave the rows that the campaign has.

    Raises:
        CampaignError: They cannot be, because they were flown by other code or packages.
    """
    from studies.campaign.flight import CampaignFlight
    from studies.campaign.store import check_flown_here

    check_flown_here(options.campaign, result)
    # A row with an error is of the machine, and counts as a violation of every kind.
    flown = [row for row in result.rows if not row.error]
    # Drawn by the system's generator: nobody knows beforehand which rows are looked at.
    drawn = random.SystemRandom().sample(flown, min(options.refly, len(flown)))
    rows = sorted(drawn, key=lambda row: row.flight)
    display = Display(console_beside(options.json))
    campaign = campaign_of(
        options.cluster,
        None,
        report=partial(display.report, "flown again"),
        say=display.say,
        time_limit_s=result.plan.time_limit_s,
    )
    with display.progress():
        again = campaign.run([CampaignFlight(result.plan, row.flight) for row in rows])
    wrong = [line for row, one in zip(rows, again, strict=True) for line in _unlike(row, one)]
    for line in wrong:
        display.say(line)
    if not wrong:
        numbers = ", ".join(str(row.flight) for row in rows)
        display.say(f"{len(rows)} flights flown again, each as its row says: {numbers}")
    return not wrong


def _unlike(row: CampaignRow, again: CampaignRow) -> Iterator[str]:
    """Where a flight that was flown again differs from its row, a sentence each."""
    from studies.statistics.certificate import digest

    for (name, kept), found in zip(row.compared().items(), again.compared().values(), strict=True):
        if digest(kept) != digest(found):  # two NaNs are the same
            yield (
                f"flight {row.flight} does not fly as its row says: {name} is {found!r}, the row "
                f"has {kept!r}"
            )


def _certify(options: CertifyOptions, result: CampaignResult) -> int:
    from studies.campaign.store import left_out
    from studies.statistics.certificate import certificate
    from studies.statistics.certificate_page import page, sentences

    stated = certificate(result, options.campaign, options.confidence, required=options.require)
    display = Display(console_beside(options.json))
    for sentence in sentences(stated):
        display.say(sentence)
    if result.left_out:
        display.say(left_out(result.left_out))
    html = options.html or options.campaign / PAGE
    display.say(f"page {html}; pandion certify {options.campaign} --verify {html}")
    met = all(one["met"] for one in stated.get("required", ()))
    texts = (options.json, json_text(stated, 1) + "\n"), (html, page(stated, result))
    return CERTIFIED if written("pandion certify", *texts) and met else DIFFERS


def _verify(options: CertifyOptions, result: CampaignResult, path: Path) -> int:
    from studies.statistics.certificate import certificate, differences, tampered
    from studies.statistics.certificate_page import page_differences

    stated, text = _statement(path)
    display = Display(console_beside(options.json))
    found = certificate(
        result, options.campaign, stated["confidence"], stated["refits"], _stated_required(stated)
    )
    wrong = differences(stated, found) or list(page_differences(text, found, result))
    if tampered(stated):
        wrong.insert(0, "the certificate was changed: its digest is not that of its statement")
    for line in wrong:
        display.say(line)
    if not wrong:
        display.say(f"{path} is what {options.campaign} shows, digest {stated['digest']}")
    said = json_text({"same": not wrong, "differences": wrong}, 1) + "\n"
    written("pandion certify", (options.json, said))
    return DIFFERS if wrong else CERTIFIED


def _stated_required(stated: dict[str, Any]) -> list[Requirement]:
    from studies.statistics.requirement import requirement

    try:
        return [requirement(one["text"]) for one in stated.get("required", ())]
    except ValueError as error:
        raise NoCertificateError(f"what the certificate requires cannot be read: {error}") from None


def _statement(path: Path) -> tuple[dict[str, Any], str]:
    """The statement that a file holds, and the text of the file."""
    from studies.statistics.certificate import FORMAT
    from studies.statistics.certificate_page import statement_in

    none = f"{path} holds no certificate of this version"
    try:
        text = read_bounded(path, _MAX_BYTES).decode("utf-8")
        stated = statement_in(text)
    except UnicodeDecodeError:
        raise NoCertificateError(f"{none}: it is not UTF-8; {_WRITTEN}") from None
    except JsonError as problem:
        raise NoCertificateError(f"{none}: it {problem}; {_WRITTEN}") from None
    if stated.get("format") != FORMAT:
        raise NoCertificateError(f"{none}; {_WRITTEN}")
    _check_used(stated, path)
    return stated, text


def _check_used(stated: dict[str, Any], path: Path) -> None:
    """Refuse other types of what is used to compute it again; all else is compared with that."""
    confidence, refits = stated.get("confidence"), stated.get("refits")
    required = stated.get("required", [])
    for name, known, allowed in (
        (
            "confidence",
            type(confidence) is float and _LEAST <= confidence <= _MOST,
            f"a number from {_LEAST:g} to {_MOST:g}",
        ),
        (
            "refits",
            type(refits) is int and 1 <= refits <= _MAX_REFITS,
            f"a whole number from 1 to {_MAX_REFITS}",
        ),
        (
            "required",
            isinstance(required, list) and all(map(_has_text, required)),
            'an array of objects that each have a "text", such as "p<0.01@95%"',
        ),
    ):
        if not known:
            raise NoCertificateError(
                f"{path}: {name} = {shown(stated.get(name))}: must be {allowed}; {_WRITTEN}"
            )


def _has_text(one: Any) -> bool:
    return isinstance(one, dict) and isinstance(one.get("text"), str)
