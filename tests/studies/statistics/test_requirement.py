"""A requirement is met only where it is shown."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from studies.campaign.flight import CampaignRow
from studies.statistics.binomial import bounds
from studies.statistics.requirement import judge, requirement


def flown(number: int, **changed: Any) -> CampaignRow:
    good = {"completed": True, "margin_m": 0.05, "te_m": 0.02}
    return CampaignRow(
        flight=number, scenario="walls", suite="mocap", controller="blf", fault="", seed=number,
        values={}, **(good | changed),
    )  # fmt: skip


def met(text: str, rows: list[CampaignRow], no_proof: str = "") -> bool:
    return judge(requirement(text), [("walls", rows)], 0.95, no_proof).met


def test_a_probability_is_below_its_bound_only_with_enough_flights() -> None:
    assert not met("p<0.01@95%", [flown(k) for k in range(298)])
    assert met("p<0.01@95%", [flown(k) for k in range(299)])
    assert met("p < 1 % @ 95 %", [flown(k) for k in range(299)])
    assert not met("p<0.01@99%", [flown(k) for k in range(299)])
    assert not met("p<0.01", [flown(k) for k in range(299)], "flights are not independent")


@pytest.mark.parametrize(
    "changed",
    [{"contact": True}, {"margin_m": -1e-9}, {"error": True}, {"refused": True},
     {"completed": False}, {"limits_kept": False}, {"margin_m": math.nan}],
)  # fmt: skip
def test_one_flight_of_any_kind_of_violation_counts(changed: dict[str, Any]) -> None:
    rows = [flown(k) for k in range(298)] + [flown(298, **changed)]
    assert not met("p<0.01@95%", rows)


def test_the_worst_configuration_may_not_hide_among_others() -> None:
    good = [flown(k) for k in range(1000)]
    bad = [flown(k, contact=k < 5) for k in range(100)]
    cases = [("walls", good), ("gate", bad)]
    assert judge(requirement("p<0.02"), cases, 0.95).met
    verdict = judge(requirement("p-each<0.02"), cases, 0.95)
    assert not verdict.met
    assert "in gate" in verdict.found


def test_a_margin_is_that_of_every_flight_and_of_none_that_was_not_flown() -> None:
    rows = [flown(k, margin_m=0.01 * (k + 1)) for k in range(5)]
    assert met("margin>=0.01", rows)
    assert met("margin>=10mm", rows)
    assert not met("margin>=0.0101", rows)
    for more in ({"error": True}, {"refused": True}, {"margin_m": None}, {"margin_m": math.nan}):
        assert not met("margin>=-1", [*rows, flown(9, **more)])
    assert not met("margin>=-1", [flown(9, margin_m=-math.inf)])
    assert met("te<=0.02", rows)
    assert not met("te<0.02", rows)


@pytest.mark.parametrize(
    "text",
    ["", "p", "p<", "p>0.01", "p<0", "p<1.5", "p<0.01@40%", "p<0.01@100%", "p<0.01m", "p<1e",
     "margin<0.01", "margin>=1%", "margin>=0.01@95%", "margin>=inf", "margin>=nan", "speed<3",
     "te>0.1", "p<0.01@95", "p<0.01 and margin>=0", "margin>=0..1"],
)  # fmt: skip
def test_what_is_no_requirement_is_refused_with_what_is(text: str) -> None:
    with pytest.raises(ValueError, match=r"'.*'") as refused:
        requirement(text)
    assert "\n" not in str(refused.value)


@given(st.integers(0, 40), st.integers(1, 400), st.floats(0.001, 0.999))
def test_a_requirement_is_met_exactly_where_the_bound_of_clopper_and_pearson_is(
    wrong: int, total: int, limit: float
) -> None:
    wrong = min(wrong, total)
    rows = [flown(k, contact=k < wrong, completed=k >= wrong) for k in range(total)]
    assert met(f"p<{limit!r}@90%", rows) == (bounds(wrong, total, 0.9).upper < limit)


@given(st.text(max_size=30))
def test_no_text_is_taken_silently(text: str) -> None:
    try:
        found = requirement(text)
    except ValueError:
        return
    assert found.name in text
