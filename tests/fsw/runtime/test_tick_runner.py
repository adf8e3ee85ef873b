"""A tick that raises: flown through once, not for ever."""

from __future__ import annotations

import pytest

from fsw.autopilot.signals import CommandAck, SensorFrame, TickInputs, TickOutputs
from fsw.runtime.program import MAX_FAILED_TICKS, TickRunner
from tests.fsw.link.snapshots import ACTUATORS, outputs_at
from tests.whole_tick import parts_of

INPUTS = TickInputs(
    SensorFrame(
        1_000_000, (0.0,) * 3, (0.0,) * 3, (1.0, 0.0, 0.0, 0.0), (0.0,) * 3, (0.0,) * 3,
        (0.0, 0.0), (0.0, 0.0),
    )
)  # fmt: skip


class Raising:
    """Counts its ticks in the state and fails on some of them."""

    def __init__(self, failing: set[int]) -> None:
        self.calls = 0
        self._failing = failing

    def __call__(self, state: int, inputs: TickInputs) -> tuple[int, TickOutputs]:
        self.calls += 1
        if self.calls in self._failing:
            raise ZeroDivisionError("division by zero")
        acks = (CommandAck(400, 0, 1, 195),)
        return state + 1, outputs_at(state, acks=acks, tuning_taken=True, upload_taken=True)


@pytest.mark.requirement("REQ-TIME-7")
def test_a_tick_that_fails_repeats_the_last_command_and_says_so() -> None:
    tick = TickRunner(*parts_of(Raising({2})), 0)
    tick(INPUTS)
    failed = tick(INPUTS)
    assert failed.actuators == ACTUATORS
    assert failed.acks == ()
    assert (failed.tuning_taken, failed.upload_taken) == (None, None)
    assert "ZeroDivisionError" in failed.texts[0].text
    # The state is the one before the failure: it goes on from there.
    assert tick(INPUTS).snapshot.t_us == 1


@pytest.mark.requirement("REQ-TIME-7")
def test_an_error_that_stays_is_raised() -> None:
    tick = TickRunner(*parts_of(Raising(set(range(2, 100)))), 0)
    tick(INPUTS)
    for _ in range(MAX_FAILED_TICKS):
        tick(INPUTS)
    with pytest.raises(ZeroDivisionError):
        tick(INPUTS)


def test_errors_apart_from_each_other_do_not_add_up() -> None:
    tick = TickRunner(*parts_of(Raising(set(range(2, 60, 2)))), 0)
    for _ in range(59):
        tick(INPUTS)


def test_a_first_tick_that_fails_has_nothing_to_repeat() -> None:
    with pytest.raises(ZeroDivisionError):
        TickRunner(*parts_of(Raising({1})), 0)(INPUTS)


@pytest.mark.requirement("REQ-TIME-7")
def test_a_tick_that_fails_behind_its_answer_keeps_the_state_as_well() -> None:
    control, _ = parts_of(Raising(set()))
    conclude = Raising({2})
    tick = TickRunner(control, lambda begun: conclude(begun.result[0] - 1, INPUTS), 0)
    tick(INPUTS)
    answered = tick.control(INPUTS)
    assert answered.acks
    failed = tick.conclude()
    assert failed.acks == ()
    assert "ZeroDivisionError" in failed.texts[0].text
    assert tick(INPUTS).snapshot.t_us == 1
    conclude = Raising(set(range(1, 100)))
    for _ in range(MAX_FAILED_TICKS):
        tick(INPUTS)
    with pytest.raises(ZeroDivisionError):
        tick(INPUTS)
