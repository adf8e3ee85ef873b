"""The safe set in force: announced and fence together; in flight only one that can be kept."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.flight.safe_set import SafeSetCheck, joined
from fsw.flight.state import MissionMemory
from fsw.model.kinematics import point_in_flight
from fsw.parameters.consistency import loop_tube
from fsw.shapes.ball import point
from fsw.shapes.half_space import wall
from fsw.shapes.target_sphere import target_sphere
from fsw.signals import (
    ConstraintKind,
    EndEffectorTarget,
    MissionUpdate,
    SafeSet,
    Severity,
    StatusText,
    Zone,
)
from tests.fsw.flight.in_flight import CONFIG, vehicle_at

CHECK = SafeSetCheck(CONFIG)
NORTH, SOUTH = wall((-1.0, 0.0, 0.0), -5.0, 0.1), wall((1.0, 0.0, 0.0), -5.0, 0.1)
TREE = point((2.0, 2.0, -1.0), 0.3)
SPHERE = target_sphere((0.0, 0.0, -0.225), 0.075)
TINY = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.001),))


def received(
    memory: MissionMemory, announced: SafeSet | None = None, *, flies: bool = True,
    check: SafeSetCheck = CHECK, **update: object,
) -> tuple[MissionMemory, list[StatusText]]:  # fmt: skip
    texts: list[StatusText] = []
    uploaded = MissionUpdate(**update) if update else None  # type: ignore[arg-type]
    return check.update(memory, uploaded, announced, texts, flies=flies), texts


def test_what_is_announced_and_the_fence_are_in_force_together() -> None:
    memory, _ = received(MissionMemory(), SafeSet((NORTH,)))
    assert memory.safe_set == memory.announced == SafeSet((NORTH,))
    memory, _ = received(
        memory,
        fence=SafeSet((SOUTH, TREE)),
    )
    assert memory.safe_set == SafeSet((NORTH, SOUTH, TREE))
    assert memory.announced == SafeSet((NORTH,))
    memory, _ = received(memory, SafeSet())
    assert memory.safe_set == SafeSet((SOUTH, TREE))
    memory, texts = received(memory, rally=((1.0, 2.0),))
    assert memory.rally == ((1.0, 2.0),)
    assert memory.safe_set == SafeSet((SOUTH, TREE))
    assert texts == []


def test_joined_keeps_everything_of_both_in_order() -> None:
    other = target_sphere((0.0, 0.0, -0.3), 0.1)
    both = joined(SafeSet((NORTH, SPHERE, TREE)), SafeSet((SOUTH, other, TREE)))
    assert both == SafeSet((NORTH, SPHERE, TREE, SOUTH, other, TREE))
    assert joined(SafeSet(), SafeSet((other,))) == SafeSet((other,))


@pytest.mark.parametrize("beside", [(NORTH,), (TREE,), (NORTH, TREE)])
def test_a_sphere_is_kept_beside_anything_else(beside: tuple[Zone, ...]) -> None:
    memory, texts = received(MissionMemory(), SafeSet((SPHERE,)), fence=SafeSet(beside))
    assert memory.safe_set == SafeSet((SPHERE, *beside))
    assert memory.refusals == ()
    assert [text for text in texts if text.severity is Severity.WARNING] == []


def test_in_flight_one_that_cannot_be_kept_is_refused_once_and_the_old_one_kept() -> None:
    start, _ = received(MissionMemory(), SafeSet((NORTH,)))
    memory, texts = received(start, TINY, rally=((3.0, 4.0),), fence=SafeSet())
    assert memory.safe_set == SafeSet((NORTH,))
    assert memory.announced == SafeSet((NORTH,))
    assert memory.refused_set == TINY
    assert memory.rally == ((3.0, 4.0),)
    assert texts[-1].text == "safe set refused: the old one is kept"
    assert all(text.severity in (Severity.WARNING, Severity.INFO) for text in texts)
    again, texts = received(memory, TINY)
    assert (again.safe_set, texts) == (SafeSet((NORTH,)), [])


def test_on_the_ground_it_is_taken_and_stands_against_arming() -> None:
    memory, texts = received(MissionMemory(), TINY, flies=False)
    assert memory.safe_set == TINY
    assert memory.refusals
    assert [text.text for text in texts if text.severity is Severity.WARNING] == list(
        memory.refusals
    )
    better, _ = received(memory, SafeSet((NORTH,)), flies=False)
    assert better.refusals == ()


def test_softly_it_is_flown_all_the_same_with_the_warnings() -> None:
    soft = SafeSetCheck(replace(CONFIG, soft=True))
    memory, texts = received(MissionMemory(), TINY, check=soft)
    assert memory.safe_set == TINY
    assert memory.refusals == ()
    assert any(text.severity is Severity.WARNING for text in texts)
    assert loop_tube(CONFIG) == loop_tube(replace(CONFIG, soft=True))


def test_margins_are_of_base_elbow_and_end_effector() -> None:
    estimate = vehicle_at((0.0, 0.0, -1.0))._replace(q_arm=(0.5, 0.4))
    target = EndEffectorTarget(0, (0.0, 0.0, -0.775), (0.0,) * 3, (0.0,) * 3)
    report = CHECK.margins(SafeSet((NORTH,)), estimate, target)
    l1, _ = CONFIG.airframe.link_length
    elbow = point_in_flight(estimate, (l1, 0.0))[0]
    tip = point_in_flight(estimate, CONFIG.airframe.link_length)[0]
    assert elbow != tip
    places = (estimate.p_WB, elbow, tip)
    assert report.margins == pytest.approx([5.0 - p[0] - 0.1 for p in places])
    ball = CHECK.margins(SafeSet((SPHERE,)), estimate, target)
    assert ball.kind is ConstraintKind.WORKSPACE
    assert ball.margins == pytest.approx((0.075,))


def test_a_zone_that_moves_is_taken_and_what_is_known_of_it_is_not_said_again() -> None:
    memory, first = received(MissionMemory(), SafeSet((replace(NORTH, velocity=(0.1, 0.0, 0.0)),)))
    moved = replace(NORTH, velocity=(0.1, 0.0, 0.0), t_us=100_000)
    memory, second = received(memory, SafeSet((moved,)))
    assert memory.safe_set == SafeSet((moved,))
    assert first
    assert second == []


def test_a_moving_set_that_cannot_be_kept_is_refused_once_and_stays_refused() -> None:
    memory, _ = received(MissionMemory(), SafeSet((NORTH,)))
    (tiny,) = TINY.zones
    wandering = replace(NORTH, velocity=(0.1, 0.0, 0.0))
    memory, first = received(memory, SafeSet((tiny, wandering)))
    memory, second = received(memory, SafeSet((tiny, replace(wandering, t_us=100_000))))
    assert memory.safe_set == SafeSet((NORTH,))
    assert first
    assert second == []
