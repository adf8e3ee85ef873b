"""Which evidence is which fault, and what is done about it."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.vehicle.faults import RESPONSES, Evidence, Fault, Response, detect

PERIOD_US = 100_000
FINE = Evidence(
    armed=True,
    flying=True,
    invalid_ticks=0,
    up=1.0,
    plan_age_us=PERIOD_US,
    plan_period_us=PERIOD_US,
    plan_refused=False,
    output_replaced=False,
)


def test_every_fault_has_a_response() -> None:
    assert set(RESPONSES) == set(Fault)


def test_without_attitude_or_estimate_the_flight_is_ended_and_only_then() -> None:
    ending = {fault for fault, response in RESPONSES.items() if response is Response.TERMINATE}
    assert ending == {Fault.ESTIMATE_INVALID, Fault.TILT_LOST}


def test_nothing_wrong_is_no_fault() -> None:
    assert detect(FINE) == ()


@pytest.mark.parametrize(
    ("evidence", "fault"),
    [
        (replace(FINE, invalid_ticks=5), Fault.ESTIMATE_INVALID),
        (replace(FINE, up=0.3), Fault.TILT_LOST),
        (replace(FINE, up=-1.0), Fault.TILT_LOST),
        (replace(FINE, up=math.nan), Fault.TILT_LOST),
        (replace(FINE, plan_age_us=3 * PERIOD_US + 1), Fault.PLAN_STALE),
        (replace(FINE, plan_refused=True), Fault.PLAN_REFUSED),
        (replace(FINE, output_replaced=True), Fault.OUTPUT_NOT_FINITE),
    ],
)
def test_each_evidence_is_its_fault(evidence: Evidence, fault: Fault) -> None:
    assert detect(evidence) == (fault,)


@pytest.mark.parametrize(
    "evidence",
    [
        replace(FINE, invalid_ticks=4),  # a lost frame or two are flown through
        replace(FINE, up=0.5),  # 60 degrees
        replace(FINE, plan_age_us=3 * PERIOD_US),
        replace(FINE, flying=False, up=-1.0),  # carried about upside down
        replace(FINE, flying=False, plan_age_us=10**9),
        replace(FINE, armed=False, flying=False, invalid_ticks=1000),  # sensors not yet on
    ],
)
def test_what_can_be_lived_with_is_no_fault(evidence: Evidence) -> None:
    assert detect(evidence) == ()


@given(
    st.builds(
        Evidence,
        armed=st.booleans(),
        flying=st.booleans(),
        invalid_ticks=st.integers(0, 1000),
        up=st.floats(allow_nan=True),
        plan_age_us=st.integers(0, 10**9),
        plan_period_us=st.just(PERIOD_US),
        plan_refused=st.booleans(),
        output_replaced=st.booleans(),
    )
)
def test_the_strongest_response_comes_first(evidence: Evidence) -> None:
    strengths = [RESPONSES[fault].value for fault in detect(evidence)]
    assert strengths == sorted(strengths, reverse=True)
