"""Messages at random from all of the dialect, owners and strangers: no contact, no undue speed."""

from __future__ import annotations

import pytest

from tests.closed_loop.random_messages import fly_talked_to

# m/s. STR_V_MAX is 1.5, and the loops overshoot while setpoints change ten times a second. The most
# that was seen, 2.04, is of a landing that flies back to its place once nothing drives it off.
FASTEST = 2.2


def flown(seed: int, seconds: float) -> None:
    outcome = fly_talked_to(seed, seconds, rate=6.0)
    shown = "\n".join(f"{at_s} {what}" for at_s, what in (*outcome.last, *outcome.texts))
    assert outcome.contact == "", f"seed {seed}: {outcome.contact}\n{shown}"
    assert outcome.fastest < FASTEST, f"seed {seed}: {outcome.fastest_s} s\n{shown}"
    assert outcome.sent > 5.0 * seconds
    assert outcome.refusals > 0


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-SAFE-6", "REQ-SAFE-7")
@pytest.mark.parametrize("seed", [1, 2])
def test_seconds_of_random_messages_end_no_flight(seed: int) -> None:
    flown(seed, 12.0)


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-6", "REQ-SAFE-7")
@pytest.mark.parametrize("seed", range(10, 40))
def test_an_hour_of_random_messages_ends_no_flight(seed: int) -> None:
    flown(seed, 120.0)
