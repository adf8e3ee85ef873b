"""Encoders that are stuck, told from joints that fail and from joints that rest."""

from __future__ import annotations

import pytest

from fsw.autopilot.estimation.fusion_memory import EncoderWatch

STANDS, MOVES = (0.7, -0.2), (0.7015, -0.2)  # rad
LOAD, HELD = 0.3, 0.25  # N m


def watched(undone: list[tuple[float, float]], *, judged: bool = True) -> EncoderWatch:
    """A watch after equal readings, while torques [N m] go nowhere."""
    watch = EncoderWatch()
    for one in undone:
        watch = watch.after(STANDS, one, judged=judged)
    return watch


def rising(first: float, second: float) -> list[tuple[float, float]]:
    """What acts against two joints [N m], up to these values within 20 ms."""
    return [(first * k / 10, second * k / 10) for k in range(11)]


def test_encoders_are_stuck_where_the_torque_of_every_joint_goes_nowhere() -> None:
    watch = watched(rising(HELD, -HELD))
    assert watch.stuck
    assert watch.after(STANDS, (0.0, 0.0), judged=True).stuck, "until they speak again"
    assert not watch.after(MOVES, (HELD, HELD), judged=True).stuck


@pytest.mark.parametrize(
    "undone",
    [rising(HELD, 0.0), rising(0.0, HELD), [(LOAD, LOAD)] * 11, rising(0.03, 0.03)],
    ids=["joint 1 fails", "joint 2 fails", "a load that is not known", "friction"],
)
def test_what_one_joint_undoes_or_was_there_before_is_none_of_the_encoders(
    undone: list[tuple[float, float]],
) -> None:
    watch = watched(undone)
    assert watch.repeating
    assert not watch.stuck


def test_encoders_are_not_judged_on_the_ground_or_beside_a_failed_joint() -> None:
    assert not watched(rising(HELD, HELD), judged=False).stuck


def test_readings_that_repeat_themselves_for_a_moment_are_a_resting_arm() -> None:
    assert not watched([(0.0, 0.0), (HELD, HELD), (HELD, HELD)]).stuck
