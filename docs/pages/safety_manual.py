"""The tables in docs/reference/safety-manual.md, and the traceability of the requirements."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Collection
from typing import Final

from docs.pages.failsafes import seconds
from docs.pages.requirements import Manual, Requirement, Shown, load
from fsw.autopilot.flight.commands.arming import CHECKS
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.failsafe.table import ROWS, Failsafe
from fsw.autopilot.parameters.registry import BY_NAME, Parameter

BEGIN: Final = "<!-- requirements: make pages -->\n"
END: Final = "<!-- end -->"


def reference(manual: Manual) -> str:
    """The tables in Markdown."""
    count, without = len(manual.requirements), len(manual.not_shown)
    parts = [
        f"{count} requirements, of which {without} are shown by no test.\n",
        *_of_groups(manual),
        "### Not shown by a test\n",
        "\n".join(f"- **{id_}**: {why}" for id_, why in sorted(manual.not_shown.items())) + "\n",
    ]
    return "\n".join(parts)


def traceability(manual: Manual, shown: Shown) -> str:
    """What belongs to each requirement, as CSV: conditions, arming checks, files and tests.

    A condition has the longest time until it is reported, a file what it does. A long test is run
    by ``make test-long``, every other one by ``make test``.
    """
    written = io.StringIO()
    rows = csv.writer(written, lineterminator="\n")
    rows.writerow(("requirement", "kind", "name", "where", "remark"))
    for row in manual.requirements:
        rows.writerows(
            (row.id, "condition", one.condition.value, f"Condition.{one.condition.name}",
             seconds(one.within_us))
            for one in (ROWS[Condition[name]] for name in row.conditions)
        )  # fmt: skip
        rows.writerows(
            (row.id, "arming check", check.summary, check.subject.value, "")
            for check in CHECKS
            if check.summary in row.checks
        )
        rows.writerows((row.id, "file", "", file, row.action) for file in row.by)
        rows.writerows(
            (row.id, "long test" if test.is_long else "test", test.name, test.file, "")
            for test in shown.get(row.id, ())
        )
    return written.getvalue()


def inserted(page: str, manual: Manual | None = None) -> str:
    """The page with the tables as they should be.

    Raises:
        ValueError: The page has no place for them.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("the page has no place for the requirements")
    tables = reference(manual or load())
    return f"{before}{begin}{tables}{end}{after}"


def _of_groups(manual: Manual) -> list[str]:
    parts = []
    for group, heading in manual.groups.items():
        of_group = [row for row in manual.requirements if row.id.split("-")[1] == group]
        lines = "\n".join(_line(row, row.id in manual.not_shown) for row in of_group)
        parts += [f"### {heading}\n", f"{lines}\n"]
    return parts


def _line(row: Requirement, not_shown: bool) -> str:
    """A requirement with the conditions that carry it out."""
    conditions = [ROWS[Condition[name]] for name in row.conditions]
    by = "; ".join(one.condition.value for one in conditions)
    carried_out = f" *({by})*" if by else ""
    mark = " **No test.**" if not_shown else ""
    return f"- **{row.id}**{carried_out} {_sentence(row.shall, conditions)}{mark}"


def _sentence(shall: str, conditions: Collection[Failsafe]) -> str:
    """The sentence with the times of its conditions, and each parameter with its default."""
    after = seconds(max((row.within_us for row in conditions), default=0))
    return re.sub(r"`(\w+)`", _with_default, shall.replace("{after}", after))


def _with_default(name: re.Match[str]) -> str:
    parameter = BY_NAME.get(name[1])
    if parameter is None:
        return name[0]
    return f"{name[0]} ({_default(parameter)})"


def _default(parameter: Parameter) -> str:
    value = parameter.default
    if parameter.unit == "norm":
        return f"{100.0 * value:g} %" if value >= 0.0 else f"{value:g}"
    return f"{value:.4g} {parameter.unit}".rstrip()
