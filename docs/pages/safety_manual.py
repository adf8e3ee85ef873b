"""The tables in docs/reference/safety-manual.md: requirements, conditions, checks, tests."""

from __future__ import annotations

import re
from collections.abc import Collection, Iterable
from typing import Final

from docs.pages.failsafes import seconds, words
from docs.pages.requirements import Manual, Requirement, ShowingTest, Shown, load, shown_by_tests
from fsw.autopilot.flight.commands.arming import CHECKS
from fsw.autopilot.flight.failsafe.conditions import Condition
from fsw.autopilot.flight.failsafe.table import ROWS, Failsafe
from fsw.autopilot.parameters.registry import BY_NAME, Parameter

BEGIN: Final = "<!-- requirements: make pages -->\n"
END: Final = "<!-- end -->"

_HEAD: Final = ("requirement", "sentence", "by", "action", "tests")


def reference(manual: Manual, shown: Shown) -> str:
    """The tables in Markdown."""
    count, without = len(manual.requirements), len(manual.not_shown)
    parts = [
        f"{count} requirements, of which {without} are shown by no test.\n",
        *_of_groups(manual, shown),
        "### Not shown by a test\n",
        _table(("requirement", "why"), sorted(manual.not_shown.items())),
        "## Conditions and arming checks\n",
        "The other direction: to which requirements each of them belongs.\n",
        _reverse(manual),
        "## Tests\n",
        "*(long)*: run by `make test-long`, all others by `make test`.\n",
        _tests(manual, shown),
    ]
    return "\n".join(parts)


def inserted(page: str, manual: Manual | None = None, shown: Shown | None = None) -> str:
    """The page with the tables as they should be.

    Raises:
        ValueError: The page has no place for them.
    """
    before, begin, rest = page.partition(BEGIN)
    _, end, after = rest.partition(END)
    if not begin or not end:
        raise ValueError("the page has no place for the requirements")
    tables = reference(manual or load(), shown_by_tests() if shown is None else shown)
    return f"{before}{begin}{tables}{end}{after}"


def _of_groups(manual: Manual, shown: Shown) -> list[str]:
    parts = []
    for group, heading in manual.groups.items():
        of_group = [row for row in manual.requirements if row.id.split("-")[1] == group]
        parts += [f"### {heading}\n", _table(_HEAD, [_cells(row, shown) for row in of_group])]
    return parts


def _cells(row: Requirement, shown: Shown) -> tuple[str, ...]:
    conditions = [ROWS[Condition[name]] for name in row.conditions]
    by = [f"{one.condition.value} ({seconds(one.within_us)})" for one in conditions]
    by += [f"arming: {check[0].lower()}{check[1:]}" for check in row.checks]
    by += [f"`{file}`" for file in row.by]
    actions = list(dict.fromkeys(_action(one) for one in conditions))
    actions += ["arming denied"] if row.checks else []
    actions += [row.action] if row.action else []
    tests = len(shown.get(row.id, ()))
    number = str(tests) if tests else "**none**"
    return row.id, _sentence(row.shall, conditions), ", ".join(by), "; ".join(actions), number


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


def _action(row: Failsafe) -> str:
    """What is done by default."""
    if words(row).does:
        return words(row).does
    chosen = [BY_NAME[name] for name in row.parameters if name in _ACTIONS]
    done = [f"{dict(one.choices)[int(one.default)].lower()} (`{one.name}`)" for one in chosen]
    return "; ".join(done)


_ACTIONS: Final = frozenset(
    name for name, one in BY_NAME.items() if one.choices and name.endswith(("_ACT", "GF_ACTION"))
)


def _reverse(manual: Manual) -> str:
    rows = [
        (row.condition.value, f"`Condition.{row.condition.name}`",
         _ids(one for one in manual.requirements if row.condition.name in one.conditions))
        for row in ROWS.values()
    ]  # fmt: skip
    rows += [
        (check.summary, f"arming, {check.subject.value}",
         _ids(one for one in manual.requirements if check.summary in one.checks))
        for check in CHECKS
    ]  # fmt: skip
    return _table(("condition or check", "name", "requirements"), rows)


def _ids(rows: Iterable[Requirement]) -> str:
    return ", ".join(row.id for row in rows)


def _tests(manual: Manual, shown: Shown) -> str:
    rows = [(row.id, _names(shown[row.id])) for row in manual.requirements if row.id in shown]
    return _table(("requirement", "tests"), rows)


def _names(tests: Iterable[ShowingTest]) -> str:
    """The tests, file by file."""
    by_file: dict[str, list[str]] = {}
    for test in tests:
        name = f"`{test.name}`{' *(long)*' if test.is_long else ''}"
        by_file.setdefault(test.file, []).append(name)
    return "; ".join(f"`{file}`: {', '.join(names)}" for file, names in by_file.items())


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [f"| {' | '.join(head)} |", "|---" * len(head) + "|"]
    lines += [f"| {' | '.join(row)} |" for row in rows]
    return "\n".join(lines) + "\n"
