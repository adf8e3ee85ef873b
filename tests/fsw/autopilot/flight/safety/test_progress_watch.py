"""A vehicle that is held before a zone says so, once, and names the zone."""

from __future__ import annotations

import pytest

from fsw.autopilot.flight.safety.progress_watch import ProgressMemory, see_progress
from fsw.autopilot.shapes.ball import ball
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.target_sphere import target_sphere
from fsw.autopilot.signals import SafeSet, Vec3, Zone
from tests.fsw.autopilot.flight.in_flight import CONFIG, vehicle_at

HERE: Vec3 = (0.0, 0.0, -2.0)
ON: Vec3 = (0.5, 0.0, 0.0)
SPHERE = target_sphere((0.0, 0.0, 0.0), 0.1)
ASIDE = wall((0.0, -1.0, 0.0), -0.5, 0.1)
AHEAD = Zone(ball((1.0, 0.0, -2.0), 0.5), 0.1)
SET = SafeSet((SPHERE, ASIDE, AHEAD))
NAMED = "no progress: blocked by zone 3 (ball)"


def said(
    seconds: float, asked: Vec3 = ON, v: Vec3 = (0.0, 0.0, 0.0), safe_set: SafeSet = SET
) -> list[str]:
    """The texts while it is asked to go on, ten times a second, and moves at ``v`` [m/s]."""
    memory, texts = ProgressMemory(HERE, 0), []  # type: ignore[var-annotated]
    for k in range(round(10 * seconds)):
        x, y, z = (HERE[axis] + 0.1 * k * v[axis] for axis in range(3))
        now = vehicle_at((x, y, z), v, t_us=100_000 * k)
        memory = see_progress(memory, asked, CONFIG.body, safe_set, now, texts)
    return [one.text for one in texts]


@pytest.mark.requirement("REQ-SAFE-6")
def test_the_zone_that_is_in_the_way_is_named_once() -> None:
    assert said(4.9) == []
    assert said(60.0) == [NAMED]


@pytest.mark.parametrize(
    ("asked", "v", "zones"),
    [
        ((0.1, 0.0, 0.0), (0.0, 0.0, 0.0), SET.zones),  # it is where it wants to be
        (ON, (0.03, 0.0, 0.0), SET.zones),  # it gets on
        ((-0.5, 0.0, 0.0), (0.0, 0.0, 0.0), SET.zones),  # no zone is that way
        (ON, (0.0, 0.0, 0.0), (SPHERE, ASIDE)),
        (ON, (0.0, 0.0, 0.0), (Zone(ball((3.0, 0.0, -2.0), 0.5), 0.1),)),  # far away
    ],
)
def test_nothing_is_said_where_no_zone_holds_it(
    asked: Vec3, v: Vec3, zones: tuple[Zone, ...]
) -> None:
    assert said(20.0, asked, v, SafeSet(zones)) == []


def test_what_got_on_and_is_held_again_is_said_again() -> None:
    memory, texts = ProgressMemory(HERE, 0, told=True), []  # type: ignore[var-annotated]
    for t_us, x in ((0, 0.0), (1, 0.2), (6_000_000, 0.2)):
        now = vehicle_at((x, 0.0, -2.0), t_us=t_us)
        memory = see_progress(memory, ON, CONFIG.body, SET, now, texts)
    assert [one.text for one in texts] == [NAMED]
