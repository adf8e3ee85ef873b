"""Why arming is refused, what force overrides, and what waiting does not change."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.flight import arming
from fsw.signals import Charge
from tests.fsw.flight.contexts import STANDING

BLIND = replace(STANDING, estimate_valid=False)
UNCLEAR = replace(STANDING, standing_unclear=True)
EMPTY = replace(STANDING, charge=Charge.CRITICAL)
INCONSISTENT = replace(STANDING, inconsistent="the sphere is too small")


@pytest.mark.parametrize(
    ("context", "words"),
    [
        (BLIND, "estimate is invalid"),
        (UNCLEAR, "neither at rest on the ground nor clearly in the air"),
        (EMPTY, "battery"),
        (replace(EMPTY, charge=Charge.EMERGENCY), "battery"),
        (INCONSISTENT, "the sphere is too small"),
    ],
)
def test_each_reason_is_named_and_force_overrides_all_but_a_missing_estimate(
    context: arming.CommandContext, words: str
) -> None:
    assert words in (arming.refusal(context) or "")
    forced = arming.refusal(context, force=True)
    assert (forced is None) is context.estimate_valid


@pytest.mark.parametrize("charge", [Charge.OK, Charge.LOW])
def test_a_vehicle_that_stands_with_charge_arms(charge: Charge) -> None:
    assert arming.refusal(replace(STANDING, charge=charge)) is None


def test_only_a_configuration_is_a_reason_that_waiting_does_not_change() -> None:
    assert arming.is_permanent(INCONSISTENT)
    assert arming.is_permanent(replace(INCONSISTENT, charge=Charge.LOW))
    for passing in (
        STANDING,
        replace(INCONSISTENT, estimate_valid=False),
        replace(INCONSISTENT, standing_unclear=True),
        replace(INCONSISTENT, charge=Charge.CRITICAL),
    ):
        assert not arming.is_permanent(passing)
