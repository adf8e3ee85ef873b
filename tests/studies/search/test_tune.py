"""Tuning finds what is better under its constraint, and says so only if other flights agree."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.stats import binomtest

from fsw.autopilot.parameters.registry import BY_NAME
from fsw.storage.parameter_file import load
from pandion import tune as command
from studies.campaign.flight import CampaignFlight, CampaignRow
from studies.campaign.keys import CampaignError
from studies.search.tune import EXAMPLE, Task, as_json, load_task, sentences, tune

FILE = """\
flights = 30
duration_s = 2.0
scenarios = ["walls"]
[tune]
candidates = 60
judge_flights = 40
cost = { te_m = 1.0, ce_mean = 0.5 }
margin_m = 0.01
probability = 0.1
confidence = 0.95
[tune.parameters]
WALL_LAMBDA = [0.1, 1.1]
TRK_EFFORT = [0.1, 0.5]
"""

Law = Callable[[float, float, int], dict[str, Any]]  # WALL_LAMBDA, TRK_EFFORT, flight


@dataclass
class CheapRows:
    """A campaign whose rows are a law of both parameters and the flight's number."""

    law: Law
    flown: list[int] = field(default_factory=list)

    def run(self, flights: Sequence[CampaignFlight]) -> list[CampaignRow]:
        """Rows in the order of the flights."""
        rows = []
        for one in flights:
            config = one.plan.bases[0].config
            values = (BY_NAME[name].read(config) for name in ("WALL_LAMBDA", "TRK_EFFORT"))
            good = {"completed": True, "error": False, "margin_m": 0.05, "te_m": 0.1}
            row = one.broken("flown")
            rows.append(replace(row, **(good | {"ce_mean": 1.0} | self.law(*values, one.number))))
            self.flown.append(one.number)
        return rows


def task(folder: Path, text: str = FILE) -> Task:
    """What a file asks for."""
    file = folder / "tune.toml"
    file.write_text(text, encoding="utf-8")
    return load_task(file)


def noise(number: int) -> float:
    """Of a flight, the same for every candidate."""
    return 0.02 * float(np.random.default_rng(number).standard_normal())


def bowl(wall: float, effort: float, number: int) -> dict[str, Any]:
    """Cheapest at 0.2 and 0.4, but a third of the flights come too near below 0.5."""
    te = 0.1 + 0.1 * (wall - 0.2) ** 2 + 0.5 * (effort - 0.4) ** 2 + noise(number)
    near = wall < 0.5 and number % 3 == 0
    return {"te_m": te, "margin_m": 0.005 if near else 0.05}


def kept_today(wall: float, effort: float, number: int) -> dict[str, Any]:
    """As ``bowl``, without the constraint."""
    return bowl(wall, effort, number) | {"margin_m": 0.05}


def run(folder: Path, law: Law) -> Any:
    """A whole tuning."""
    campaign: Any = CheapRows(law)
    return tune(task(folder), campaign, 1)


def test_the_best_lies_where_the_constraint_lets_it(tmp_path: Path) -> None:
    found = run(tmp_path, bowl)
    assert not found.today.feasible
    wall, effort = found.best.values
    assert 0.5 <= wall < 0.65
    assert 0.2 < effort < 0.5
    assert found.judged.found.feasible
    assert found.better
    text = "\n".join(sentences(found))
    assert "costs less" in text or "violates less often" in text
    assert "today's values are not shown to keep the constraint" in text


def test_without_a_constraint_that_binds_the_cheapest_is_found_and_beats_today(
    tmp_path: Path,
) -> None:
    found = run(tmp_path, kept_today)
    wall, effort = found.best.values
    assert wall == pytest.approx(0.2, abs=0.15)
    assert effort == pytest.approx(0.4, abs=0.06)
    assert found.today.feasible
    assert found.judged.interval[1] < 0.0
    assert found.judged.pairs == 40
    assert found.better
    assert as_json(found)["found"]["TRK_EFFORT"] == effort


def test_others_are_judged_than_were_tuned_on(tmp_path: Path) -> None:
    campaign: Any = CheapRows(kept_today)
    tune(task(tmp_path), campaign, 1)
    assert set(campaign.flown[-80:]) == set(range(30, 70))
    assert set(campaign.flown[:-80]) == set(range(30))


def test_luck_on_the_tuning_flights_is_found_out_on_others(tmp_path: Path) -> None:
    def lucky(wall: float, effort: float, number: int) -> dict[str, Any]:
        gain = (wall - 0.35) * (1.0 if number < 30 else -1.0)
        return {"te_m": 0.1 - 0.01 * gain + noise(number)}

    found = run(tmp_path, lucky)
    assert found.best.score.cost < found.today.cost
    assert not found.better
    text = "\n".join(sentences(found))
    assert "nothing better than today's values was found: on other flights" in text


def test_a_constraint_that_fails_on_other_flights_is_said(tmp_path: Path) -> None:
    def late(wall: float, effort: float, number: int) -> dict[str, Any]:
        return {"te_m": 0.1 + 0.1 * wall, "limits_kept": number < 30 or wall > 0.3}

    found = run(tmp_path, late)
    assert not found.better
    assert "not shown to keep the constraint on other flights" in "\n".join(sentences(found))


def test_where_nothing_is_feasible_or_cheaper_it_says_so(tmp_path: Path) -> None:
    broken = run(tmp_path, lambda wall, effort, number: {"contact": number % 4 == 0})
    assert broken.best is None
    assert "no candidate is shown to keep the constraint" in "\n".join(sentences(broken))
    today = run(tmp_path, lambda wall, effort, number: {"te_m": 0.1 + abs(wall - 0.35)})
    assert not today.better


@pytest.mark.parametrize(
    "ended",
    [
        {"te_m": 0.0, "modes": "land"},
        {"te_m": 0.0, "refused": True, "margin_m": None},
        {"te_m": math.nan},
    ],
)
def test_a_flight_that_ends_early_is_not_cheap(tmp_path: Path, ended: dict[str, Any]) -> None:
    def early(wall: float, effort: float, number: int) -> dict[str, Any]:
        stops = number % 3 == 0
        return {"te_m": 0.2, "completed": not stops} | (ended if stops else {})

    found = run(tmp_path, early)
    assert found.today.cost == pytest.approx(1.5)  # of what was flown whole, in units of its mean
    assert not found.better


def judged(tmp_path: Path, only_today: int, only_found: int, confidence: float = 0.95) -> Any:
    """The verdict where only so many flights violate, of today and of a candidate as cheap."""
    lenient = FILE.replace("confidence = 0.95", f"confidence = {confidence}")
    lenient = lenient.replace("probability = 0.1", "probability = 0.2")

    def law(wall: float, effort: float, number: int) -> dict[str, Any]:
        today = wall == pytest.approx(0.35, abs=1e-6)
        if number < 30:
            return {"te_m": 0.1 + 0.1 * (wall - 0.7) ** 2}
        bad = number - 30 < only_today if today else 69 - number < only_found
        return {"te_m": 0.1, "limits_kept": not bad}

    campaign: Any = CheapRows(law)
    return tune(task(tmp_path, lenient), campaign, 1).judged


@pytest.mark.drawn(3)
@pytest.mark.parametrize(("more", "fewer"), [(4, 0), (5, 0), (6, 0), (8, 2), (9, 2), (10, 2)])
def test_fewer_violations_are_better_only_beyond_doubt(
    tmp_path: Path, more: int, fewer: int
) -> None:
    found = judged(tmp_path, more, fewer)
    assert (found.only_today, found.only_found) == (more, fewer)
    assert not found.cheaper
    safer = binomtest(more, more + fewer, alternative="greater").pvalue <= 0.025
    assert found.safer == safer
    assert found.better == (safer and not found.today.feasible)


def test_flights_that_break_count_as_violations(tmp_path: Path) -> None:
    def fragile(wall: float, effort: float, number: int) -> dict[str, Any]:
        return {"error": effort > 0.25 and number < 20} | kept_today(wall, effort, number)

    found = run(tmp_path, fragile)
    assert found.best.values[1] <= 0.25


def test_the_command_writes_parameters_only_if_they_are_better(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "tune.toml"
    file.write_text(FILE, encoding="utf-8")

    class Opened(CheapRows):
        def __enter__(self) -> Opened:
            return self

        def __exit__(self, *_: object) -> None: ...

    def of(law: Law) -> None:
        monkeypatch.setattr("pandion.campaign_run.campaign_of", lambda *_, **__: Opened(law))

    of(kept_today)
    assert command.main([str(file), f"--out={tmp_path / 'good'}", "--workers=0"]) == 0
    kept = load(tmp_path / "good" / "tuned.params")
    assert kept.complaints == ()
    assert kept.values["TRK_EFFORT"] == pytest.approx(0.4, abs=0.06)
    of(lambda wall, effort, number: {})
    assert command.main([str(file), f"--out={tmp_path / 'same'}", "--workers=0"]) == 1
    assert not (tmp_path / "same" / "tuned.params").exists()
    assert "nothing better than today's values was found" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("flights = 30", "flights = 28", "flights = 28: even without a violation.*at least 29"),
        ("judge_flights = 40", "judge_flights = 20", r"tune\.judge_flights = 20.*at least 29"),
        ("WALL_LAMBDA", "WALL_LAMDA", 'unknown parameter "WALL_LAMDA", did you mean'),
        (
            "[0.1, 1.1]",
            "[0.1, 9.0]",
            r"WALL_LAMBDA = .*: must be two numbers of 0.01 to 5",
        ),
        ("[0.1, 1.1]", "[1.1, 0.1]", "rising"),
        ("te_m = 1.0", "te = 1.0", r"unknown key \"tune\.cost\.te\""),
        ("te_m = 1.0", "te_m = -1.0", r"must be 0 to 1e\+09"),
        ("candidates = 60", "candidats = 60", "unknown key"),
        ("[tune]", "[tuna]", "unknown key|missing table"),
        ("[tune]", 'design = "sobol"\n[tune]', 'design = "sobol": the bounds .* must be "random"'),
        ('"walls"', '"walls-calm"', "walls-calm.*: nothing is random, so all its flights are one"),
    ],
)
def test_what_makes_no_sense_is_refused_with_the_key(
    tmp_path: Path, old: str, new: str, said: str
) -> None:
    with pytest.raises(CampaignError, match=said):
        task(tmp_path, FILE.replace(old, new))


def test_the_example_is_a_task() -> None:
    assert len(load_task(EXAMPLE).parameters) == 3
