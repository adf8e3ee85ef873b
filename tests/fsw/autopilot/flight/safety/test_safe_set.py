"""The safe set in force: announced and fence together; in flight only one that can be kept."""

from __future__ import annotations

from dataclasses import replace

import pytest

from fsw.autopilot.flight.safety.safe_set import SafeSetCheck, joined
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import MissionMemory
from fsw.autopilot.model.kinematics import frame_of, position
from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.shapes.ball import point
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.shapes.vertical_cylinder import vertical_cylinder
from fsw.autopilot.signals import (
    ConstraintKind,
    EndEffectorTarget,
    MessageSource,
    MissionUpdate,
    SafeSet,
    SafeSetAnnouncement,
    Severity,
    StatusText,
    TickInputs,
    Vec3,
    Zone,
)
from tests.fsw.autopilot.flight.in_flight import CONFIG, limits, vehicle_at
from tests.fsw.autopilot.flight.test_autopilot import frame

CHECK = SafeSetCheck(CONFIG)
NORTH, SOUTH = wall((-1.0, 0.0, 0.0), -5.0, 0.1), wall((1.0, 0.0, 0.0), -5.0, 0.1)
TREE = point((2.0, 2.0, -1.0), 0.3)
SPHERE = target_sphere((0.0, 0.0, -0.225), 0.075)
OWNER = MessageSource(1, 195, "simulator")
STRANGER = MessageSource(1, 195, "api", "127.0.0.1:40001")  # who writes the owner's ids
TINY = SafeSet((target_sphere((0.0, 0.0, -0.225), 0.001),))


def received(
    memory: MissionMemory, announced: SafeSet | None = None, *, flies: bool = True,
    check: SafeSetCheck = CHECK, source: MessageSource = OWNER, t_s: float = 1.0,
    at: Vec3 = (0.0, 0.0, -1.0), **update: object,
) -> tuple[MissionMemory, list[StatusText]]:  # fmt: skip
    texts: list[StatusText] = []
    lists = MissionUpdate(**update) if update else None  # type: ignore[arg-type]
    heard = () if announced is None else (SafeSetAnnouncement(source, announced),)
    sensors = frame(round(1e6 * t_s))
    inputs = TickInputs(sensors, announced=heard, mission=lists)
    return check.update(
        memory, inputs, vehicle_at(at), texts, flies=flies, armed=flies, target=None
    ), texts


def uploaded(
    memory: MissionMemory,
    source: MessageSource,
    *,
    flies: bool = True,
    check: SafeSetCheck = CHECK,
    **lists: object,
) -> tuple[MissionMemory, list[StatusText]]:
    """What becomes of lists that a source has uploaded."""
    texts: list[StatusText] = []
    update = MissionUpdate(source=source, **lists)  # type: ignore[arg-type]
    inputs = TickInputs(frame(1_000_000), mission=update)
    return check.update(
        memory, inputs, vehicle_at((0.0, 0.0, -1.0)), texts, flies=flies, armed=flies, target=None
    ), texts


def refused(texts: list[StatusText]) -> str:
    """The text of a refusal, and there is no other text."""
    (text,) = texts
    assert text.severity is Severity.CRITICAL
    assert "refused" in text.text
    return text.text


def told(texts: list[StatusText]) -> list[str]:
    """What was told of changes, beside the findings of the analysis."""
    assert {text.severity for text in texts} == {Severity.INFO}
    return [text.text for text in texts if "safe set" in text.text]


def walled(*offsets: float, clearance: float = 0.1) -> SafeSet:
    """A wall north and one south, at these distances."""
    normals = ((-1.0, 0.0, 0.0), (1.0, 0.0, 0.0))
    return SafeSet(tuple(wall(n, -d, clearance) for n, d in zip(normals, offsets, strict=True)))


def test_what_is_announced_and_the_fence_are_in_force_together() -> None:
    memory, _ = received(MissionMemory(), SafeSet((NORTH,)))
    assert memory.safe_set == memory.announced == SafeSet((NORTH,))
    memory, _ = received(memory, fence=SafeSet((SOUTH, TREE)))
    assert memory.safe_set == SafeSet((NORTH, SOUTH, TREE))
    assert memory.announced == SafeSet((NORTH,))
    memory, _ = received(memory, SafeSet())
    assert memory.safe_set == SafeSet((SOUTH, TREE))
    memory, texts = received(memory, rally=((1.0, 2.0),))
    assert [text.text for text in texts] == ["rally points of None: 1.0 m north 2.0 m east"]
    assert memory.rally == ((1.0, 2.0),)
    assert memory.safe_set == SafeSet((SOUTH, TREE))


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


@pytest.mark.requirement("REQ-SAFE-7")
def test_in_flight_one_that_cannot_be_kept_is_refused_once_and_the_old_one_kept() -> None:
    start, _ = received(MissionMemory(), SafeSet((NORTH,)))
    memory, texts = received(start, TINY, rally=((3.0, 4.0),))
    assert memory.safe_set == SafeSet((NORTH,))
    assert memory.announced == SafeSet((NORTH,))
    assert memory.refused == SafeSetAnnouncement(OWNER, TINY)
    assert memory.rally == ((3.0, 4.0),)
    assert texts[-1].text.startswith("safe set refused: the old one is kept")
    assert all(text.severity in (Severity.WARNING, Severity.INFO) for text in texts)
    again, texts = received(memory, TINY)
    assert (again.safe_set, texts) == (SafeSet((NORTH,)), [])


@pytest.mark.requirement("REQ-SAFE-7")
def test_on_the_ground_it_is_taken_and_stands_against_arming() -> None:
    memory, texts = received(MissionMemory(), TINY, flies=False)
    assert memory.safe_set == TINY
    assert memory.refusals
    told(texts)  # nothing worse than news: a row of the failsafe table tells the refusals
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
    report = CHECK.margins(InflatedSafeSet().of(SafeSet((NORTH,))), estimate, target)
    frame = frame_of(CONFIG.airframe.bodies, estimate)
    elbow, tip = (position(frame, on, (0.0, 0.0, 0.15)) for on in (1, 2))
    assert elbow != tip
    places = (estimate.p_WB, elbow, tip)
    assert report.margins == pytest.approx([5.0 - p[0] - 0.1 for p in places])
    ball = CHECK.margins(InflatedSafeSet().of(SafeSet((SPHERE,))), estimate, target)
    assert ball.kind is ConstraintKind.WORKSPACE
    assert ball.margins == pytest.approx((0.075,))


def test_margins_are_without_what_clearances_have_grown_by_and_say_it() -> None:
    in_force = SafeSet((NORTH,))
    wider = SafeSet((replace(NORTH, clearance=0.3),))
    kept = InflatedSafeSet(in_force, wider, (0.2,), 0.05)
    estimate = vehicle_at((0.0, 0.0, -1.0))
    report = CHECK.margins(kept, estimate, None)
    assert report.margins == CHECK.margins(InflatedSafeSet().of(in_force), estimate, None).margins
    assert (report.added, report.shortfall) == ((0.2,), 0.05)


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


@pytest.mark.requirement("REQ-SAFE-9")
def test_a_stranger_in_flight_may_shrink_what_is_announced_and_is_named() -> None:
    memory, texts = received(MissionMemory(), walled(5.0, 5.0))
    assert told(texts) == ["safe set of 1/195 (simulator): 2 half-spaces; it owns the safe set now"]
    memory, texts = received(memory, walled(4.0, 5.0), source=STRANGER)
    assert memory.safe_set == memory.announced == walled(4.0, 5.0)
    assert memory.owner == OWNER
    assert told(texts) == ["safe set of 1/195 (api 127.0.0.1:40001): 2 half-spaces"]


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize("flies", [True, False])
@pytest.mark.parametrize(
    ("wanted", "why"),
    [
        (walled(5.0286, 5.0), "zone 1 (half-space) moves out by 28.6 mm"),
        (walled(4.0, 5.001), "zone 2 (half-space) moves out by 1.0 mm"),
        (walled(5.0, 5.0, clearance=0.09), "zone 1 (half-space) loses 10.0 mm of clearance"),
        (SafeSet((NORTH,)), "zone 2 (half-space) is removed, moved or turned"),
        (SafeSet(), "zone 1 (half-space) is removed, moved or turned"),
    ],
)
def test_a_stranger_may_not_grow_it_and_is_told_so_once(
    wanted: SafeSet, why: str, flies: bool
) -> None:
    memory, _ = received(MissionMemory(), walled(5.0, 5.0))
    after, texts = received(memory, wanted, source=STRANGER, flies=flies)
    assert (after.safe_set, after.announced) == (memory.safe_set, memory.announced)
    text = refused(texts)
    assert f"of {STRANGER} refused: {why}" in text
    assert f"which {OWNER} owns" in text
    again, texts = received(after, wanted, source=STRANGER, flies=flies)
    assert (again.safe_set, texts) == (memory.safe_set, [])


def test_the_owner_grows_it_in_flight_and_repeats_it_without_a_word() -> None:
    memory, _ = received(MissionMemory(), walled(5.0, 5.0))
    memory, texts = received(memory, walled(9.0, 5.0))
    assert memory.safe_set == walled(9.0, 5.0)
    assert told(texts) == ["safe set of 1/195 (simulator): 2 half-spaces"]
    again, texts = received(memory, walled(9.0, 5.0), t_s=2.0)
    assert (again.safe_set, texts) == (memory.safe_set, [])
    assert again.owner_heard_us == 2_000_000


def test_a_zone_that_moves_is_told_of_once_however_often_it_is_updated() -> None:
    def person(north: float, t_us: int, clearance: float = 0.3) -> SafeSet:
        at = vertical_cylinder((north, 3.0), 0.25, -1.8, 0.0)
        return SafeSet((NORTH, Zone(at, clearance, velocity=(0.5, 0.0, 0.0), t_us=t_us)))

    memory, texts = received(MissionMemory(), person(0.0, 1_000_000))
    assert "vertical cylinder" in told(texts)[-1]
    for k in range(2, 5):
        memory, texts = received(memory, person(0.4 * k, k * 1_000_000), t_s=k)
        assert memory.safe_set == person(0.4 * k, k * 1_000_000)
        assert [text for text in texts if "safe set" in text.text] == []
    memory, texts = received(memory, person(2.0, 5_000_000, clearance=0.2), t_s=5.0)
    assert len(told(texts)) == 1
    after, texts = received(memory, person(2.0, 6_000_000, clearance=0.2), source=STRANGER)
    assert after.safe_set == memory.safe_set
    assert "zone 2 (vertical cylinder)" in refused(texts)


def walker(t_us: int, north: float = 0.0) -> Zone:
    at = vertical_cylinder((north, 3.0), 0.25, -1.8, 0.0)
    return Zone(at, 0.3, velocity=(0.5, -0.1, 0.0), t_us=t_us)


@pytest.mark.requirement("REQ-SAFE-10")
def test_a_moving_zone_that_is_silent_too_long_is_held_where_it_is_predicted_then() -> None:
    announced = SafeSet((NORTH, walker(1_000_000)))
    memory, _ = received(MissionMemory(), announced, fence=SafeSet((SOUTH,)))
    late_us = 1_000_000 + CONFIG.limits.zone_timeout_us
    assert CHECK.hold_silent_zones(memory, late_us - 1) is memory
    held = CHECK.hold_silent_zones(memory, late_us + 50_000)
    seconds = 1e-6 * CONFIG.limits.zone_timeout_us
    there = vertical_cylinder((0.5 * seconds, 3.0 - 0.1 * seconds), 0.25, -1.8, 0.0)
    (north, stands, south) = held.safe_set.zones
    assert (north, south) == (NORTH, SOUTH)
    assert (stands.velocity, stands.clearance, stands.keep_in) == ((0.0, 0.0, 0.0), 0.3, False)
    assert stands.shape.numbers == pytest.approx(there.numbers)
    assert held.silent_zones == 1
    assert CHECK.hold_silent_zones(held, late_us + 10**9) is held, "once"
    fenced, _ = received(held, fence=SafeSet((TREE,)), t_s=9.0)
    assert fenced.safe_set == SafeSet((NORTH, stands, TREE)), "a fence does not start it again"
    assert fenced.silent_zones == 1
    late, texts = received(held, announced, t_s=9.0)
    assert (late.safe_set, texts) == (held.safe_set, []), "what was heard before is not new"
    shrunk, _ = received(held, SafeSet((*held.announced.zones, TREE)), source=STRANGER, t_s=9.0)
    assert TREE in shrunk.safe_set.zones
    assert shrunk.silent_zones == 1, "it is for the source that is silent to speak"
    again = SafeSet((NORTH, walker(9_000_000, north=4.0)))
    back, texts = received(held, again, t_s=9.0)
    assert back.safe_set == joined(again, SafeSet((SOUTH,)))
    assert back.silent_zones == 0
    assert told(texts)[-1].endswith(": 1 half-space, 1 vertical cylinder")


def test_a_moving_zone_with_the_stamp_of_another_clock_stands_where_its_numbers_say() -> None:
    """A station's Unix time; predicted back by it, the zone would be nowhere near."""
    memory, _ = received(MissionMemory(), SafeSet((walker(1_700_000_000_000_000),)))
    (stands,) = CHECK.hold_silent_zones(memory, 1_000_000).safe_set.zones
    assert stands.shape == walker(0).shape
    assert stands.velocity == (0.0, 0.0, 0.0)


def test_a_repetition_of_the_owner_does_not_take_back_what_another_source_shrank() -> None:
    memory, _ = received(MissionMemory(), walled(5.0, 5.0))
    memory, _ = received(memory, walled(3.0, 5.0), source=STRANGER)
    memory, texts = received(memory, walled(5.0, 5.0))
    assert (memory.safe_set, texts) == (walled(3.0, 5.0), [])
    memory, _ = received(memory, walled(5.0, 5.001))
    assert memory.safe_set == walled(5.0, 5.001), "what it has not said before counts"


def test_a_stranger_cannot_shut_the_vehicle_out_in_flight() -> None:
    memory, _ = received(MissionMemory(), walled(5.0, 5.0))
    after, texts = received(memory, walled(1.0, 5.0), source=STRANGER, at=(0.95, 0.0, -1.0))
    assert after.safe_set == memory.safe_set
    assert "not inside" in refused(texts)
    after, texts = received(memory, walled(1.0, 5.0), at=(0.95, 0.0, -1.0))
    assert after.safe_set == memory.safe_set, "nor can the owner"
    assert "not inside" in refused(texts)
    after, _ = received(memory, walled(1.0, 5.0), at=(0.95, 0.0, -1.0), flies=False)
    assert after.safe_set == walled(1.0, 5.0), "on the ground it speaks against arming"


@pytest.mark.requirement("REQ-SAFE-9")
def test_no_stranger_ties_the_vehicle_to_where_anybody_sends_targets() -> None:
    """A sphere that leapt with the targets of three senders pulled it into the owner's wall."""
    memory, _ = received(MissionMemory(), SafeSet((NORTH,)))
    both = SafeSet((NORTH, SPHERE))
    kept, texts = received(memory, both, source=STRANGER)
    assert kept.safe_set == SafeSet((NORTH,))
    assert "would follow the target" in refused(texts)
    assert received(memory, both)[0].safe_set == both
    for source in (STRANGER, OWNER):
        tied, texts = uploaded(memory, source, fence=SafeSet((SPHERE,)), flies=True)
        assert bool(tied.fence.zones) is (source is OWNER)
        assert ("would follow the target" in texts[0].text) is (source is STRANGER)
    owned, _ = received(MissionMemory(), both)
    shrunk, _ = received(owned, SafeSet((NORTH, SPHERE, TREE)), source=STRANGER)
    assert shrunk.safe_set == SafeSet((NORTH, SPHERE, TREE)), "it was there before"


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize(("away", "taken"), [(0.8, False), (2.5, False), (5.0, True)])
def test_no_zone_of_a_stranger_can_drive_the_vehicle_into_the_owners(
    away: float, taken: bool
) -> None:
    """Between the owner's wall and one that came at 1.5 m/s it was pushed into the first."""
    memory, _ = received(MissionMemory(), SafeSet((NORTH,)))
    behind = wall((1.0, 0.0, 0.0), -away - 0.3, 0.1)
    comes = replace(behind, velocity=(1.5, 0.0, 0.0), t_us=1_000_000)
    added, texts = received(memory, SafeSet((NORTH, comes)), source=STRANGER)
    assert (added.safe_set == SafeSet((NORTH, comes))) is taken
    assert taken or "could reach the vehicle" in refused(texts)
    owners, _ = received(memory, SafeSet((NORTH, comes)))
    assert away < 1.0 or owners.safe_set == SafeSet((NORTH, comes))


def announced_to(
    safe_set: SafeSet, memory: MissionMemory | None = None, *, v: Vec3 = (0.0, 0.0, 0.0),
    target: EndEffectorTarget | None = None, t_us: int = 1_000_000, **how: bool,
) -> tuple[MissionMemory, list[StatusText]]:  # fmt: skip
    """What becomes of a set that is announced to a vehicle at (0, 0, -1) that moves at ``v``."""
    texts: list[StatusText] = []
    inputs = TickInputs(frame(t_us), announced=(SafeSetAnnouncement(STRANGER, safe_set),))
    estimate = vehicle_at((0.0, 0.0, -1.0), v, t_us)
    how = how or {"flies": True}
    how = {"armed": how["flies"]} | how
    memory = memory or MissionMemory()
    return CHECK.update(memory, inputs, estimate, texts, target=target, **how), texts  # type: ignore[arg-type]


@pytest.mark.requirement("REQ-SAFE-7")
@pytest.mark.parametrize(
    "zone",
    [
        wall((-1.0, 0.0, 0.0), 10.0, 0.1),  # the vehicle is 10 m behind it
        wall((-1.0, 0.0, 0.0), 1e30, 0.1),
        point((0.0, 0.0, -1.0), 5.0),
        point((0.0, 0.0, -50.0), 1e20),
        target_sphere((5.0, 0.0, 0.0), 0.3),
        target_sphere((3.4e38,) * 3, 3.4e38),
        Zone(vertical_cylinder((3.0, 0.0), 0.3), 0.1, velocity=(1.6, 0.0, 0.0), t_us=1_000_000),
    ],
)
def test_in_flight_the_first_to_announce_cannot_shut_the_vehicle_out(zone: Zone) -> None:
    target = EndEffectorTarget(0, (0.0, 0.0, -0.775), (0.0,) * 3, (0.0,) * 3)
    for how in ({"flies": True}, {"flies": False, "armed": True}):
        memory, texts = announced_to(SafeSet((zone,)), target=target, **how)
        assert (memory.safe_set, memory.owner) == (SafeSet(), None)
        assert memory.refused_count == 1
        refused(texts)
        memory, texts = announced_to(SafeSet((zone,)), memory, target=target, **how)
        assert (memory.refused_count, texts) == (2, []), "counted again, and told once"


@pytest.mark.requirement("REQ-SAFE-7")
def test_in_flight_the_way_in_which_the_vehicle_stops_is_inside_as_well() -> None:
    """0.9 m are left: enough from 1 m/s, and not from 2."""
    memory, _ = announced_to(walled(1.0, 5.0), v=(1.0, 0.0, 0.0))
    assert memory.safe_set == walled(1.0, 5.0)
    memory, texts = announced_to(walled(1.0, 5.0), v=(2.0, 0.0, 0.0))
    assert memory.safe_set == SafeSet()
    assert "could not stop" in refused(texts)
    memory, _ = announced_to(walled(1.0, 5.0), v=(-2.0, 0.0, 0.0))
    assert memory.safe_set == walled(1.0, 5.0), "it flies away from it"


def person(x: float, vx: float, t_us: int = 1_000_000) -> SafeSet:
    at = vertical_cylinder((x, 0.0), 0.3)
    return SafeSet((Zone(at, 0.1, velocity=(vx, 0.0, 0.0), t_us=t_us),))


@pytest.mark.requirement("REQ-SAFE-7")
@pytest.mark.parametrize(("leap", "taken"), [(0.08, True), (0.4, False)])
def test_a_zone_that_leaps_towards_the_vehicle_is_another_one(leap: float, taken: bool) -> None:
    """Leaps of one zone, each of which it was not to stop before, drove it to 2.8 m/s."""
    before, after = person(-0.5 - leap, 0.1), person(-0.5, 1.0)
    memory, _ = announced_to(before)
    memory, texts = announced_to(after, memory)
    assert memory.safe_set == (after if taken else before)
    assert taken or "could not stop before" in refused(texts)


def test_a_zone_that_has_turned_towards_the_vehicle_is_believed_while_that_is_outside_of_it() -> (
    None
):
    memory, _ = announced_to(person(-0.6, 0.1))
    memory, _ = announced_to(person(-0.5, 1.0), memory)
    assert memory.safe_set == person(-0.5, 1.0), "it cannot stop before it, and must know of it"
    after, texts = announced_to(person(-0.3, 1.0), memory)
    assert after.safe_set == memory.safe_set
    assert "not inside" in refused(texts)
    # It has come nearer as it was announced, and the vehicle is inside of its clearance by now.
    after, _ = announced_to(person(-0.3, 0.5, 1_200_000), memory, t_us=1_200_000)
    assert after.safe_set == person(-0.3, 0.5, 1_200_000)


def test_a_stamp_of_another_clock_hides_no_zone_on_the_vehicle() -> None:
    """Judged where it will stand, not where a stamp a minute ahead has it for a moment."""
    at = vertical_cylinder((0.2, 0.0), 0.3)
    hidden = Zone(at, 0.1, velocity=(1.0, 0.0, 0.0), t_us=61_000_000)
    memory, texts = announced_to(SafeSet((hidden,)))
    assert memory.safe_set == SafeSet()
    assert "not inside" in refused(texts)


def test_on_the_ground_another_source_takes_over_once_the_owner_is_silent() -> None:
    first, _ = received(MissionMemory(), walled(5.0, 5.0), t_s=1.0, flies=False)
    late = 1.0 + 1e-6 * CONFIG.limits.owner_timeout_us
    early, texts = received(first, SafeSet(), source=STRANGER, t_s=late - 0.01, flies=False)
    assert "refused" in refused(texts)
    aloft, _ = received(first, SafeSet(), source=STRANGER, t_s=late)
    assert aloft.owner == OWNER, "in flight an owner that is silent stays one"
    after, texts = received(early, SafeSet(), source=STRANGER, t_s=late, flies=False)
    assert (after.owner, after.safe_set) == (STRANGER, SafeSet())
    assert texts[-1].text.endswith("it owns the safe set now")
    _, texts = received(after, walled(5.0, 5.0), t_s=late + 1.0, flies=False)
    assert texts[-1].severity is Severity.INFO, "walls are a shrink of nothing"


def test_once_it_has_disarmed_another_source_takes_over_at_once() -> None:
    memory, _ = received(MissionMemory(), walled(5.0, 5.0))
    memory = replace(memory, owner_heard_us=-1)
    aloft, _ = received(memory, SafeSet(), source=STRANGER)
    assert aloft.owner == OWNER
    after, _ = received(memory, SafeSet(), source=STRANGER, flies=False)
    assert (after.owner, after.safe_set) == (STRANGER, SafeSet())


def test_a_chosen_owner_is_one_whoever_was_first() -> None:
    check = SafeSetCheck(limits(safe_set_owner=255))
    chosen = MessageSource(255, 190, "gcs", "127.0.0.1:40002")
    memory, texts = received(MissionMemory(), walled(5.0, 5.0), check=check)
    assert (memory.safe_set, memory.owner) == (walled(5.0, 5.0), None)
    memory, texts = received(memory, SafeSet(), check=check)
    assert "which no source owns" in refused(texts)
    memory, _ = received(memory, SafeSet(), check=check, source=chosen)
    assert (memory.safe_set, memory.owner) == (SafeSet(), chosen)


@pytest.mark.requirement("REQ-SAFE-9")
@pytest.mark.parametrize("owner", [0, 1])
def test_choosing_an_owner_lets_nobody_do_what_it_could_not_without(owner: int) -> None:
    """Who wrote the chosen system's number could clear its fence in flight."""
    check = SafeSetCheck(limits(safe_set_owner=owner))
    memory, _ = received(MissionMemory(), walled(4.0, 4.0), check=check)
    memory, _ = uploaded(memory, OWNER, check=check, fence=walled(5.0, 5.0))
    after, texts = uploaded(memory, STRANGER, check=check, fence=SafeSet())
    assert after.fence == walled(5.0, 5.0)
    assert f"which {OWNER} owns" in refused(texts)
    after, texts = received(memory, SafeSet(), check=check, source=STRANGER)
    assert after.announced == walled(4.0, 4.0)
    assert f"which {OWNER} owns" in refused(texts)
    after, _ = uploaded(memory, OWNER, check=check, fence=SafeSet())
    assert after.fence == SafeSet()


def test_one_sender_has_one_address_unless_signatures_vouch_for_it() -> None:
    here = MessageSource(255, 190, "gcs", "127.0.0.1:1")
    there = replace(here, address="127.0.0.1:2")
    assert here.is_same(here)
    assert not here.is_same(None)
    assert not here.is_same(there)
    assert not here.is_same(replace(here, link="api"))
    assert not here.is_same(replace(here, system=254))
    assert not here.is_same(replace(here, component=191))
    assert replace(here, signed=True).is_same(replace(there, signed=True))
    assert not here.is_same(replace(here, signed=True))


@pytest.mark.requirement("REQ-SAFE-9")
def test_in_flight_a_fence_is_grown_by_its_uploader_only() -> None:
    memory, _ = uploaded(MissionMemory(), OWNER, fence=walled(5.0, 5.0))
    after, texts = uploaded(memory, STRANGER, fence=SafeSet())
    assert (after.fence, after.upload_taken) == (walled(5.0, 5.0), False)
    assert f"fence of {STRANGER} refused" in refused(texts)
    after, _ = uploaded(memory, STRANGER, fence=walled(4.0, 5.0))
    assert (after.fence, after.fence_owner) == (walled(4.0, 5.0), OWNER)
    after, _ = uploaded(after, OWNER, fence=SafeSet())
    assert after.safe_set == SafeSet()
    ground, _ = uploaded(memory, STRANGER, fence=walled(9.0, 9.0), flies=False)
    assert (ground.fence, ground.fence_owner) == (walled(9.0, 9.0), STRANGER)


@pytest.mark.requirement("REQ-SAFE-9")
def test_nobody_owns_a_fence_that_is_not_in_force() -> None:
    """One that was refused, and one that its owner has cleared."""
    through = walled(-0.5, 5.0)
    memory, texts = uploaded(MissionMemory(), STRANGER, fence=through)
    assert "the vehicle is not inside zone 1" in refused(texts)
    assert (memory.fence_owner, memory.upload_taken) == (None, False)
    memory, _ = uploaded(memory, STRANGER, fence=walled(5.0, 5.0))
    memory, _ = uploaded(memory, STRANGER, fence=SafeSet())
    assert memory.fence_owner is None
    memory, _ = uploaded(memory, OWNER, fence=walled(5.0, 5.0))
    assert (memory.fence, memory.fence_owner) == (walled(5.0, 5.0), OWNER)
    memory, _ = uploaded(memory, OWNER, fence=walled(6.0, 6.0))
    assert memory.fence == walled(6.0, 6.0)


def test_of_an_upload_all_is_taken_or_nothing() -> None:
    memory, _ = uploaded(MissionMemory(), OWNER, fence=walled(5.0, 5.0), rally=((1.0, 0.0),))
    assert (memory.rally, memory.upload_taken) == (((1.0, 0.0),), True)
    after, _ = uploaded(memory, STRANGER, fence=SafeSet(), rally=())
    assert (after.fence, after.rally) == (memory.fence, memory.rally)
    after, _ = uploaded(memory, OWNER, fence=SafeSet(), rally=((1e5, 0.0),))
    assert (after.fence, after.rally, after.upload_taken) == (memory.fence, memory.rally, False)


@pytest.mark.requirement("REQ-SAFE-9")
def test_rally_points_are_told_and_are_their_owners_and_inside_the_fence() -> None:
    places = tuple((float(north), 0.0) for north in range(4))
    memory, texts = uploaded(MissionMemory(), OWNER, fence=walled(5.0, 5.0), rally=places)
    assert memory.rally == places
    told_of = f"rally points of {OWNER}: 0.0 m north 0.0 m east, 1.0 m north 0.0 m east"
    assert texts[-1].text == f"{told_of}, 2.0 m north 0.0 m east, 1 more"
    after, texts = uploaded(memory, OWNER, rally=((-9.0, 0.0),))
    assert (after.rally, after.upload_taken) == (places, False)
    assert "outside the fence, by 4.10 m at its zone 2" in refused(texts)
    assert memory.home_owner == OWNER.sender, "the first, where it is not known who has armed"
    other = replace(STRANGER, system=66)
    theirs, texts = uploaded(memory, other, rally=(), fence=walled(1.0, 1.0))
    assert (theirs.rally, theirs.fence) == (places, walled(5.0, 5.0))
    assert f"rally points of {other} refused: while armed only 1/195 may change" in refused(texts)
    ground, _ = uploaded(memory, other, rally=(), flies=False)
    assert ground.rally == ()
    same, texts = uploaded(memory, other, rally=places)
    assert (same.upload_taken, texts) == (True, [])


def test_a_fence_that_both_safe_sets_together_rule_out_is_refused_with_a_text_each_time() -> None:
    memory, _ = received(MissionMemory(), TINY, flies=False)
    for _ in range(2):
        memory, texts = uploaded(memory, OWNER, fence=SafeSet((SOUTH,)))
        assert (memory.fence, memory.upload_taken) == (SafeSet(), False)
        assert f"fence of {OWNER} refused: the old safe set is kept" in texts[-1].text


def test_where_a_disarmed_vehicle_stands_is_inside_the_fence_with_its_base() -> None:
    beside, _ = uploaded(MissionMemory(), OWNER, fence=walled(0.15, 5.0), flies=False)
    assert beside.upload_taken
    memory, texts = uploaded(MissionMemory(), OWNER, fence=walled(-1.0, 5.0), flies=False)
    assert "the vehicle is not inside zone 1 (half-space), by 1.10 m" in refused(texts)
    assert not memory.upload_taken


@pytest.mark.requirement("REQ-SAFE-9")
def test_a_vehicle_that_stands_armed_has_the_owner_that_it_was_armed_with() -> None:
    memory = MissionMemory(announced=walled(5.0, 5.0), safe_set=walled(5.0, 5.0), owner=OWNER)
    after, texts = announced_to(walled(9.0, 9.0), memory, flies=False, armed=True)
    assert (after.owner, after.safe_set) == (OWNER, walled(5.0, 5.0))
    assert "owns" in refused(texts)
    after, _ = announced_to(walled(9.0, 9.0), memory, flies=False, armed=False)
    assert (after.owner, after.safe_set) == (STRANGER, walled(9.0, 9.0))
