"""What the vehicle accepts from the wire, and what it refuses and counts."""

from __future__ import annotations

import math

import pytest

from fsw.link.inbox import Inbox
from fsw.link.wire import message_ids as ids
from fsw.signals import Arm
from messages.frames import Frame, FrameWriter, split, wire_fields

NAN = math.nan


def frame(message_id: int, **fields: float) -> Frame:
    """A message with the named wire values, the others zero, as it comes off the wire."""
    names = wire_fields(message_id)
    assert not set(fields) - set(names)
    wire = FrameWriter(255, 190).frame(message_id, *(fields.get(name, 0) for name in names))
    (decoded,) = split(wire)
    return decoded


def target(**fields: float) -> Frame:
    return frame(
        ids.END_EFFECTOR_TARGET, **{"time_usec": 5_000_000, "coordinate_frame": 1, **fields}
    )


def wall(index: int, count: int, **fields: float) -> Frame:
    plane = {"normal[0]": -1.0, "offset": -1.0, "clearance": 0.1}
    return frame(ids.OBSTACLE_WALL, index=index, count=count, **{**plane, **fields})


def point(index: int, count: int, **fields: float) -> Frame:
    ball = {"position[0]": 2.0, "clearance": 0.125}
    return frame(ids.OBSTACLE_POINT, index=index, count=count, **{**ball, **fields})


def test_nan_in_an_unused_parameter_of_a_command_is_normal() -> None:
    inbox = Inbox()
    inbox.accept(frame(ids.COMMAND_LONG, command=400, param1=1.0, param5=NAN, param7=NAN))
    (command,) = inbox.take().commands
    assert command.action == Arm()
    request = command.request
    assert request.command == 400
    assert request.params[0] == 1.0
    assert math.isnan(request.params[6])
    assert (request.source_system, request.source_component) == (255, 190)
    assert inbox.take().commands == []
    assert inbox.refused == 0


def test_a_command_for_another_system_is_not_ours() -> None:
    inbox = Inbox()
    inbox.accept(frame(ids.COMMAND_LONG, command=400, target_system=2))
    inbox.accept(frame(ids.COMMAND_LONG, command=400, target_system=1, target_component=154))
    assert inbox.take().commands == []


@pytest.mark.parametrize(("mav_frame", "x"), [(1, 2.5), (6, 0.0025)])
def test_command_int_scales_x_by_its_frame(mav_frame: int, x: float) -> None:
    inbox = Inbox()
    inbox.accept(frame(ids.COMMAND_INT, command=192, x=25_000, z=-3.0, frame=mav_frame))
    (command,) = inbox.take().commands
    assert command.request.params[4] == pytest.approx(x)
    assert command.request.params[6] == -3.0


@pytest.mark.parametrize("bad", [NAN, math.inf, -math.inf])
@pytest.mark.parametrize("field", ["position[0]", "velocity[2]", "acceleration[1]", "yaw"])
def test_a_target_that_is_not_finite_is_refused_and_counted(field: str, bad: float) -> None:
    inbox = Inbox()
    inbox.accept(target(**{field: bad}))
    assert inbox.take().targets == []
    assert inbox.refused == 1


def test_a_masked_field_of_a_target_may_be_nan() -> None:
    inbox = Inbox()
    mask = 0x038 | 0x1C0 | 0x400
    inbox.accept(target(**{"position[2]": -1.0, "velocity[0]": NAN, "yaw": NAN, "type_mask": mask}))
    (point,) = inbox.take().targets
    assert point.v_WE == (0.0, 0.0, 0.0)
    assert point.yaw == 0.0


@pytest.mark.parametrize("fields", [{"coordinate_frame": 6}, {"type_mask": 1}])
def test_a_target_in_another_frame_or_without_position_is_refused(fields: dict[str, int]) -> None:
    inbox = Inbox()
    inbox.accept(target(**fields))
    assert inbox.take().targets == []
    assert inbox.refused == 1


def test_walls_arrive_as_one_set_in_any_order() -> None:
    inbox = Inbox()
    inbox.accept(wall(1, 2, offset=-2.0))
    assert inbox.take().announced == []
    inbox.accept(wall(0, 2, offset=-1.0))
    (announced,) = inbox.take().announced
    safe_set = announced.safe_set
    assert [one.shape.numbers[3] for one in safe_set.zones] == [-1.0, -2.0]
    assert inbox.take().announced == []


def test_walls_of_two_sets_do_not_mix() -> None:
    inbox = Inbox()
    inbox.accept(wall(0, 2))
    inbox.accept(wall(0, 3))
    inbox.accept(wall(1, 2))
    assert inbox.take().announced == []


def test_walls_and_points_are_one_set() -> None:
    inbox = Inbox()
    inbox.accept(point(2, 3))
    inbox.accept(wall(0, 3))
    assert inbox.take().announced == []
    inbox.accept(point(1, 3, **{"position[0]": 7.0}))
    (announced,) = inbox.take().announced
    safe_set = announced.safe_set
    assert [one.shape.kind for one in safe_set.zones] == ["half-space", "ball", "ball"]
    assert [one.shape.numbers[0] for one in safe_set.zones[1:]] == [7.0, 2.0]
    inbox.accept(wall(0, 1))
    (announced,) = inbox.take().announced
    safe_set = announced.safe_set
    assert [one.shape.kind for one in safe_set.zones] == ["half-space"]


@pytest.mark.parametrize(
    "bad",
    [{"position[1]": NAN}, {"clearance": 0.0}, {"clearance": -0.1}, {"clearance": math.inf},
     {"index": 1}],
)  # fmt: skip
def test_a_point_that_keeps_nothing_away_is_refused(bad: dict[str, float]) -> None:
    inbox = Inbox()
    inbox.accept(point(**{"index": 0, "count": 1, **bad}))  # type: ignore[arg-type]
    assert inbox.take().announced == []
    assert inbox.refused == 1


@pytest.mark.parametrize(
    "bad",
    [{"normal[0]": NAN}, {"normal[0]": -0.9}, {"offset": math.inf}, {"clearance": NAN}],
)
def test_a_wall_that_is_no_plane_is_refused(bad: dict[str, float]) -> None:
    inbox = Inbox()
    inbox.accept(wall(0, 1, **bad))
    assert inbox.take().announced == []
    assert inbox.refused == 1


@pytest.mark.parametrize("radius", [0.0, -1.0, NAN])
def test_a_sphere_that_contains_nothing_is_refused(radius: float) -> None:
    inbox = Inbox()
    inbox.accept(frame(ids.WORKSPACE_SPHERE, radius=radius))
    assert inbox.take().announced == []
    assert inbox.refused == 1


def test_the_inbox_is_bounded() -> None:
    inbox = Inbox()
    for _ in range(1000):
        inbox.accept(target())
        inbox.accept(frame(ids.COMMAND_LONG, command=400))
    received = inbox.take()
    assert len(received.targets) <= 64
    assert len(received.commands) <= 16
    assert inbox.refused > 1900
