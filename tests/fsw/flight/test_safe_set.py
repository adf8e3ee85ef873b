"""The safe set in force: announced and fence together; in flight only one that can be kept."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.flight.safe_set import SafeSetCheck, contradictions, joined
from fsw.flight.state import MissionMemory
from fsw.model.kinematics import point_in_flight
from fsw.parameters.consistency import loop_tube
from fsw.signals import (
    ConstraintKind,
    EndEffectorTarget,
    MissionUpdate,
    PointObstacle,
    SafeSet,
    Severity,
    StatusText,
    Wall,
    WorkspaceSphere,
)
from tests.fsw.flight.in_flight import CONFIG, vehicle_at

CHECK = SafeSetCheck(CONFIG)
NORTH, SOUTH = Wall((-1.0, 0.0, 0.0), -5.0, 0.1), Wall((1.0, 0.0, 0.0), -5.0, 0.1)
TREE = PointObstacle((2.0, 2.0, -1.0), 0.3)
SPHERE = WorkspaceSphere((0.0, 0.0, -0.225), 0.075)
TINY = SafeSet(sphere=WorkspaceSphere((0.0, 0.0, -0.225), 0.001))


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
    memory, _ = received(memory, fence=SafeSet((SOUTH,), obstacles=(TREE,)))
    assert memory.safe_set == SafeSet((NORTH, SOUTH), obstacles=(TREE,))
    assert memory.announced == SafeSet((NORTH,))
    memory, _ = received(memory, SafeSet())
    assert memory.safe_set == SafeSet((SOUTH,), obstacles=(TREE,))
    memory, texts = received(memory, rally=((1.0, 2.0),))
    assert memory.rally == ((1.0, 2.0),)
    assert memory.safe_set == SafeSet((SOUTH,), obstacles=(TREE,))
    assert texts == []


def test_joined_keeps_everything_of_both_and_one_sphere() -> None:
    other = WorkspaceSphere((0.0, 0.0, -0.3), 0.1)
    both = joined(SafeSet((NORTH,), SPHERE, (TREE,)), SafeSet((SOUTH,), other, (TREE, TREE)))
    assert both == SafeSet((NORTH, SOUTH), SPHERE, (TREE, TREE, TREE))
    assert joined(SafeSet(), SafeSet(sphere=other)).sphere == other


@pytest.mark.parametrize(
    ("safe_set", "words"),
    [
        (SafeSet((NORTH,), SPHERE), "walls"),
        (SafeSet(sphere=SPHERE, obstacles=(TREE,)), "obstacles"),
        (SafeSet((NORTH,), SPHERE, (TREE,)), "walls"),
    ],
)
def test_a_sphere_cannot_be_kept_beside_anything_else(safe_set: SafeSet, words: str) -> None:
    (text,) = contradictions(safe_set)
    assert text.startswith(words)
    for fine in (SafeSet(), SafeSet(sphere=SPHERE), SafeSet((NORTH,), obstacles=(TREE,))):
        assert contradictions(fine) == ()


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
    ball = CHECK.margins(SafeSet(sphere=SPHERE), estimate, target)
    assert ball.kind is ConstraintKind.WORKSPACE
    assert ball.margins == pytest.approx((0.075,))
