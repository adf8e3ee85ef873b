"""Which fences are taken in flight: those whose failsafe finds the vehicle inside."""

from __future__ import annotations

import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from fsw.autopilot.flight.safety.safe_set import SafeSetCheck
from fsw.autopilot.flight.safety.safety_watch import SafetyWatch
from fsw.autopilot.flight.safety.uncertain_clearance import InflatedSafeSet
from fsw.autopilot.flight.state import MissionMemory, SafetyMemory
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import (
    EndEffectorTarget,
    MissionUpdate,
    SafeSet,
    StateEstimate,
    StatusText,
    TickInputs,
    Vec2,
)
from fsw.link.wire.fence_items import (
    CIRCLE_EXCLUSION,
    CIRCLE_INCLUSION,
    POLYGON_EXCLUSION,
    POLYGON_INCLUSION,
    read_fence,
)
from fsw.link.wire.mission_items import LOCAL_OFFSET_NED, MissionItem
from tests.fsw.autopilot.flight.test_autopilot import frame
from tests.fsw.link.snapshots import SNAPSHOT
from tests.fsw.random_states import estimate_of

CONFIG = flight_config()
CHECK = SafeSetCheck(CONFIG)
WATCH = SafetyWatch(CONFIG, CHECK.loop_tube)
AT = (1.0, 2.0, -3.0)
NEAR = st.floats(0.0, 1.5)


def _item(command: int, number: float, place: Vec2, frame: int = 1) -> MissionItem:
    x, y = (round(1e4 * metres) for metres in place)
    return MissionItem(command, frame, (number, 0.0, 0.0, 0.0), x, y, -0.225)


def _around(north: float, east: float, south: float, west: float) -> list[Vec2]:
    """A rectangle, given by how far its sides are from the vehicle."""
    n, e = AT[:2]
    return [
        (n + a, e + b) for a, b in ((north, east), (north, -west), (-south, -west), (-south, east))
    ]


@st.composite
def fences(draw: st.DrawFn) -> tuple[MissionItem, ...]:
    """Inclusions around the vehicle and exclusions beside it, near enough to touch it or not."""
    command = draw(
        st.sampled_from((POLYGON_INCLUSION, CIRCLE_INCLUSION, POLYGON_EXCLUSION, CIRCLE_EXCLUSION))
    )
    angle, away = draw(st.floats(0.0, 2.0 * math.pi)), draw(NEAR)
    place = (AT[0] + away * math.cos(angle), AT[1] + away * math.sin(angle))
    if command in (CIRCLE_INCLUSION, CIRCLE_EXCLUSION):
        return (_item(command, draw(st.floats(0.1, 2.0)), place),)
    sides = [draw(st.floats(0.2, 1.5)) for _ in range(4)]
    corners = _around(*sides)
    if command == POLYGON_EXCLUSION:
        corners = [(x + 2.0 * away, y) for x, y in corners]
    return tuple(_item(command, 4.0, corner) for corner in corners)


@st.composite
def poses(draw: st.DrawFn) -> StateEstimate:
    """A vehicle that hovers, with any heading and arm and a little tilt."""
    tilt = st.floats(-0.2, 0.2)
    turned = Rotation.from_euler("ZYX", (draw(st.floats(-3.0, 3.0)), draw(tilt), draw(tilt)))
    arm = draw(st.floats(-1.0, 1.0)), draw(st.floats(-1.5, 1.5))
    return estimate_of(turned, p_WB=AT)._replace(q_arm=arm, t_us=SNAPSHOT.t_us)


def _fence(items: tuple[MissionItem, ...]) -> SafeSet:
    return read_fence(items, lambda *_: (0.0, 0.0, 0.0), CONFIG.limits.fence_clearance)


def _accepts(
    items: tuple[MissionItem, ...],
    estimate: StateEstimate,
    target: EndEffectorTarget | None = None,
    *,
    armed: bool = True,
) -> bool:
    texts: list[StatusText] = []
    inputs = TickInputs(frame(estimate.t_us), mission=MissionUpdate(fence=_fence(items)))
    memory = CHECK.update(
        MissionMemory(), inputs, estimate, texts, flies=armed, armed=armed, target=target
    )
    # What the analysis refuses is refused wherever the vehicle is.
    assert "cannot be kept" not in "".join(one.text for one in texts)
    assert memory.upload_taken is (memory.fence.zones != ())
    return memory.upload_taken


def _breaches(
    items: tuple[MissionItem, ...], estimate: StateEstimate, target: EndEffectorTarget | None = None
) -> bool:
    """Whether the failsafe "outside the fence" would be active in the next tick."""
    report = CHECK.margins(InflatedSafeSet().of(_fence(items)), estimate, target)
    return WATCH.breach(SafetyMemory(), estimate, report, 0, flies=True).fence_us >= 0


@pytest.mark.requirement("REQ-SAFE-4")
@settings(max_examples=150, deadline=None)
@given(fences(), poses())
def test_in_flight_a_fence_is_accepted_exactly_where_its_failsafe_would_not_act(
    items: tuple[MissionItem, ...], estimate: StateEstimate
) -> None:
    assert _accepts(items, estimate) is not _breaches(items, estimate)


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize(
    ("away", "accepted"), [(0.15, False), (0.3, False), (0.45, False), (0.8, True)]
)
@pytest.mark.parametrize("excluded", [False, True])
def test_a_wall_or_cylinder_in_front_of_the_base_is_measured_from_the_rotors(
    away: float, accepted: bool, excluded: bool
) -> None:
    estimate = estimate_of(Rotation.identity(), p_WB=AT)._replace(t_us=SNAPSHOT.t_us)
    if excluded:
        items = (_item(CIRCLE_EXCLUSION, 1.0, (AT[0] + 1.0 + away, AT[1])),)
    else:
        corners = _around(away, 5.0, 5.0, 5.0)
        items = tuple(_item(POLYGON_INCLUSION, 4.0, corner) for corner in corners)
    assert _accepts(items, estimate) is accepted
    assert _breaches(items, estimate) is not accepted
    assert _accepts(items, estimate, armed=False)


@pytest.mark.requirement("REQ-SAFE-4")
@pytest.mark.parametrize(("off", "accepted"), [(0.0, True), (0.2, False)])
def test_a_sphere_is_judged_at_the_target_that_it_rides_with(off: float, accepted: bool) -> None:
    estimate = estimate_of(Rotation.identity(), p_WB=AT)._replace(t_us=SNAPSHOT.t_us)
    target = EndEffectorTarget(0, (AT[0] + off, AT[1], AT[2] + 0.225), (0.0,) * 3, (0.0,) * 3)
    items = (_item(CIRCLE_INCLUSION, 0.075, (0.0, 0.0), LOCAL_OFFSET_NED),)
    assert _accepts(items, estimate, target) is accepted
    assert _breaches(items, estimate, target) is not accepted


def test_walls_beside_a_sphere_are_judged_without_a_target_too() -> None:
    estimate = estimate_of(Rotation.identity(), p_WB=AT)._replace(t_us=SNAPSHOT.t_us)
    sphere = _item(CIRCLE_INCLUSION, 0.075, (0.0, 0.0), LOCAL_OFFSET_NED)
    walls = [_item(POLYGON_INCLUSION, 4.0, corner) for corner in _around(0.15, 5.0, 5.0, 5.0)]
    assert not _accepts((*walls, sphere), estimate)
