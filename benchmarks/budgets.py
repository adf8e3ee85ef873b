"""Judges a real-time flight by its budgets."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

MAX_OTHER_LOAD: Final = 0.25  # processors that other programs may use while we measure
MAX_STOLEN: Final = 0.02  # share of the machine that its host may take away
MAX_STOPPED: Final = 0.0005  # share of the time; half the releases that a flight may be late for

Budgets = Mapping[str, Mapping[str, float]]

# What is judged: the group and key of the budget, and the name in the table.
_JUDGED: Final = (
    ("wake_up", "p50_us", "wake-up lateness p50 us"),
    ("wake_up", "p99_us", "wake-up lateness p99 us"),
    ("ticks", "late_share", "ticks late, share"),
    ("ticks", "late_share_running", "... while the machine ran"),
    ("tick", "p50_us", "tick p50 us"),
    ("tick", "p99_us", "tick p99 us"),
    ("exchange", "p50_us", "frame in, command out p50 us"),
    ("exchange", "p99_us", "frame in, command out p99 us"),
    ("link", "p50_us", "link and log p50 us"),
    ("link", "p99_us", "link and log p99 us"),
    ("telemetry", "p99_us", "telemetry and log p99 us"),
    ("mpc", "p50_us", "MPC cycle p50 us"),
    ("mpc", "p99_us", "MPC cycle p99 us"),
    ("mpc", "taken_up_p99_us", "MPC request taken up p99 us"),
    ("plans", "missed_deadlines", "MPC deadlines missed"),
    ("memory", "resident_mb", "resident MB"),
    ("memory", "growth_mb", "growth MB"),
    ("plant", "p50_us", "plant step p50 us"),
)


@dataclass(frozen=True, slots=True)
class BudgetRow:
    """One figure and its budget."""

    name: str
    value: float | None  # None: not measured
    budget: float

    @property
    def kept(self) -> bool:
        """Within the budget; what was not measured is not."""
        return self.value is not None and self.value <= self.budget


@dataclass(frozen=True, slots=True)
class MachineNoise:
    """What else the machine did meanwhile."""

    others: float  # processors used by programs that are not ours
    stolen: float  # share of all processors taken away by the host
    # Share of the time for which a program that only sleeps was not woken; None: not measured.
    stopped: float | None = None

    @property
    def too_much(self) -> bool:
        """Whether the figures say something about the machine rather than about us."""
        quiet = self.others <= MAX_OTHER_LOAD and self.stolen <= MAX_STOLEN
        return not (quiet and (self.stopped is None or self.stopped <= MAX_STOPPED))


def load_budgets() -> Budgets:
    """What the file beside this one allows."""
    text = Path(__file__).with_name("budgets.toml").read_text(encoding="utf-8")
    content: dict[str, dict[str, float]] = tomllib.loads(text)
    return content


def judge(measured: Mapping[str, Any], budgets: Budgets) -> list[BudgetRow]:
    """Every budget with what was measured.

    Args:
        measured: Values by group and key, as in the budgets.
        budgets: From :func:`load_budgets`.
    """
    return [
        BudgetRow(name, measured.get(group, {}).get(key), budgets[group][key])
        for group, key, name in _JUDGED
    ]


def result(rows: list[BudgetRow], noise: MachineNoise) -> str:
    """``pass``, ``over budget``, or ``too noisy``, which is neither."""
    if noise.too_much:
        return "too noisy"
    return "pass" if all(row.kept for row in rows) else "over budget"
