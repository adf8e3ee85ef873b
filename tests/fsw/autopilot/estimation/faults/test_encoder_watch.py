"""Encoders that are stuck, told from joints that fail and from joints that rest."""

from __future__ import annotations

import numpy as np
import pytest

from fsw.autopilot.estimation.faults.encoder_watch import watch_encoders
from fsw.autopilot.estimation.fusion_memory import FusionMemory, at_start
from fsw.autopilot.signals import JointVector
from fsw.autopilot.tick_record import BEGINS_ANEW, JUDGES, NOT_WATCHED, Expected

STANDS, MOVES = (0.7, -0.2), (0.7015, -0.2)  # rad
LOAD, HELD = 0.3, 0.25  # N m
RESTS = (0.0, 0.0)  # rad, that each joint has moved unseen while a surface held the tool
FELT, UNFELT = (1.0, 1.0), (-1.0, 0.0)  # of it, nearer to the base


class Watch:
    """What is known of two encoders."""

    def __init__(self) -> None:
        self.memory: FusionMemory = at_start(2)

    def read(
        self,
        angles: JointVector,
        undone: JointVector,
        felt: JointVector = FELT,
        unseen: JointVector = RESTS,
        judges: int = JUDGES,
    ) -> Watch:
        """A reading, and what the loops tell of its tick."""
        x, expected = self.memory.numbers.view(np.recarray)[0], Expected()
        expected.undone[:2], expected.unseen[:2], expected.felt[:2] = undone, unseen, felt
        expected.judges = judges
        assert watch_encoders(x, np.array(angles), expected) == self.stuck
        x.encoders[:2] = angles
        return self

    @property
    def stuck(self) -> bool:
        return self.memory.encoders_stuck


def watched(undone: list[JointVector], felt: JointVector = FELT, judges: int = JUDGES) -> Watch:
    """A watch after equal readings, while torques [N m] go nowhere."""
    watch = Watch()
    for one in undone:
        watch.read(STANDS, one, felt, judges=judges)
    return watch


def rising(first: float, second: float) -> list[JointVector]:
    """What acts against two joints [N m], up to these values within 20 ms."""
    return [(first * k / 10, second * k / 10) for k in range(11)]


@pytest.mark.parametrize(
    ("undone", "felt"),
    [
        (rising(HELD, -HELD), (1.0, 0.0)),
        (rising(HELD, 0.0), (1.0, 0.0)),
        (rising(0.7 * HELD, HELD), (-1.0, 0.7)),
    ],
    ids=["both, the base feels it", "the first, the base feels it", "the first joint feels it"],
)
def test_an_encoder_is_stuck_where_its_joint_is_felt_to_move(
    undone: list[JointVector], felt: JointVector
) -> None:
    watch = watched(undone, felt)
    assert watch.stuck
    assert watch.read(STANDS, (0.0, 0.0), UNFELT).stuck, "until it speaks again"
    assert watch.read(MOVES, (0.0, 0.0), judges=NOT_WATCHED).stuck, "or is looked at"
    watch.read(STANDS, (0.0, 0.0), judges=NOT_WATCHED)
    speaks = tuple(angle + 0.0015 for angle in STANDS)
    assert not watch.read(speaks, (HELD, HELD)).stuck


def test_one_that_is_stuck_stays_so_while_another_one_moves() -> None:
    watch = watched(rising(0.0, HELD), (-1.0, 0.7))
    assert watch.read(MOVES, (0.0, 0.0), UNFELT).stuck


@pytest.mark.parametrize(
    ("undone", "felt"),
    [
        (rising(HELD, 0.0), UNFELT),
        (rising(0.0, HELD), UNFELT),
        (rising(0.1 * HELD, HELD), (0.2, 0.2)),
        ([(LOAD, LOAD)] * 11, FELT),
        (rising(0.03, 0.03), FELT),
    ],
    ids=[
        "joint 1 fails",
        "joint 2 fails",
        "joint 2 fails in gusts",
        "a load that is not known",
        "friction",
    ],
)
def test_what_is_not_felt_or_was_there_before_is_no_encoder_s_fault(
    undone: list[JointVector], felt: JointVector
) -> None:
    watch = watched(undone, felt)
    assert watch.memory.encoders_repeat
    assert not watch.stuck


def test_encoders_are_not_judged_on_the_ground_or_beside_a_failed_joint() -> None:
    assert not watched(rising(HELD, HELD), judges=BEGINS_ANEW).stuck


def test_readings_that_repeat_themselves_for_a_moment_are_a_resting_arm() -> None:
    assert not watched([(0.0, 0.0), (HELD, HELD), (HELD, HELD)]).stuck


@pytest.mark.parametrize(
    ("unseen", "stuck"),
    [((0.03, 0.0), True), ((0.0, -0.03), True), ((0.015, -0.015), False)],
    ids=["the first", "the second", "as little as friction and noise"],
)
def test_an_encoder_is_stuck_whose_joint_must_have_moved_while_a_surface_held_the_tool(
    unseen: JointVector, stuck: bool
) -> None:
    """Whatever the base feels: what a surface does it feels as well."""
    watch = Watch()
    for k in range(11):
        so_far = tuple(k / 10 * one for one in unseen)
        watch.read(STANDS, RESTS, UNFELT, so_far)
    assert watch.stuck is stuck
