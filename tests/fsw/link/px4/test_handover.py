"""Who flies, as a table of what PX4 and our autopilot say."""

from __future__ import annotations

from fsw.link.px4.handover import ANSWER_US, LOST_US, Handover, Px4Seen, Wish
from fsw.link.px4.messages import HOLD, OFFBOARD

OFF = Px4Seen(0, armed=True, mode=OFFBOARD, landed=False)
IN_HOLD = Px4Seen(0, armed=True, mode=HOLD, landed=False)
STANDING = Px4Seen(0, armed=True, mode=OFFBOARD, landed=True)
SILENT = Px4Seen(LOST_US, armed=True, mode=OFFBOARD, landed=False)


def said(wish: Wish) -> list[str]:
    return [text.text for text in wish.texts]


def test_offboard_in_the_air_gives_the_vehicle_and_nothing_else_does() -> None:
    for seen in (IN_HOLD, STANDING, OFF._replace(armed=False)):
        assert not Handover().step(seen, 0, flies=False).arm
    handover = Handover()
    handover.step(IN_HOLD, 0, flies=False)
    wish = handover.step(OFF, 4_000, flies=False)
    assert wish.arm
    assert said(wish) == ["PX4 gives the vehicle: it follows the plan"]


def test_a_refusal_of_ours_is_not_asked_again_in_every_tick() -> None:
    handover = Handover()
    arms = [handover.step(OFF, t_us, flies=False).arm for t_us in range(0, 3_000_000, 4_000)]
    assert sum(arms) == 3


def test_any_other_mode_takes_the_vehicle_back_in_the_same_tick() -> None:
    handover = Handover(flies=True, mode=OFFBOARD)
    wish = handover.step(IN_HOLD, 0, flies=True)
    assert wish.disarm
    assert wish.mode is None
    assert said(wish) == ["PX4 flies Hold: the plan is not followed any more"]
    assert handover.step(IN_HOLD, 4_000, flies=False) == Wish()


def test_our_operator_asks_for_offboard_until_it_is_given() -> None:
    handover = Handover()
    handover.step(IN_HOLD, 0, flies=False)
    asked = [handover.step(IN_HOLD, t, flies=True).mode for t in range(0, 900_000, 4_000)]
    assert asked.count(OFFBOARD) == 2
    assert handover.step(OFF, 1_000_000, flies=True) == Wish()
    assert handover.step(IN_HOLD, 1_004_000, flies=True).disarm


def test_offboard_that_px4_does_not_enter_is_given_up_with_a_sentence() -> None:
    handover = Handover()
    handover.step(IN_HOLD, 0, flies=False)
    for t_us in range(0, ANSWER_US, 4_000):
        assert not handover.step(IN_HOLD, t_us, flies=True).disarm
    wish = handover.step(IN_HOLD, ANSWER_US, flies=True)
    assert wish.disarm
    assert said(wish) == ["PX4 stays in Hold and does not enter Offboard"]


def test_on_the_ground_nobody_is_asked() -> None:
    handover = Handover()
    wish = handover.step(STANDING, 0, flies=True)
    assert wish.disarm
    assert wish.mode is None
    assert said(wish) == ["PX4 stands on the ground: take off with PX4 first"]


def test_who_disarms_ours_gives_back_and_is_not_armed_again() -> None:
    handover = Handover(flies=True, mode=OFFBOARD)
    wish = handover.step(OFF, 0, flies=False)
    assert wish.mode == HOLD
    assert not handover.streams
    for t_us in range(4_000, 5_000_000, 4_000):
        assert not handover.step(OFF, t_us, flies=False).arm
    handover.step(IN_HOLD, 5_000_000, flies=False)
    assert handover.streams
    assert handover.step(OFF, 5_004_000, flies=False).arm


def test_silence_ends_set_points_and_what_was_given_then_does_not_count() -> None:
    handover = Handover(flies=True, mode=OFFBOARD)
    wish = handover.step(SILENT, 0, flies=True)
    assert wish.disarm
    assert said(wish) == ["PX4 is silent for 0.5 s: setpoints end"]
    assert not handover.streams
    assert said(handover.step(OFF, 1_000_000, flies=False)) == ["PX4 is heard"]
    assert not handover.step(OFF, 3_000_000, flies=False).arm
    handover.step(IN_HOLD, 3_004_000, flies=False)
    assert handover.step(OFF, 3_008_000, flies=False).arm


def test_a_planner_that_stopped_ends_its_plan_even_if_px4_seems_to_follow() -> None:
    """PX4 left Offboard and came back meanwhile, or follows a setpoint that is long over."""
    handover = Handover(looked_us=0, flies=True, mode=OFFBOARD)
    assert handover.step(OFF, LOST_US - 1, flies=True) == Wish()
    wish = handover.step(OFF, 2 * LOST_US, flies=True)
    assert wish.disarm
    assert said(wish) == ["this planner stopped for 0.5 s: its plan ends"]
    assert handover.streams
    assert handover.step(OFF, 2 * LOST_US + 4_000, flies=False).arm, "PX4 gives it still: it holds"
