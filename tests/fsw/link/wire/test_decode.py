"""What the vehicle accepts from the wire, and what it refuses and counts."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.shapes import BY_NAME, KINDS
from fsw.autopilot.signals import (
    Arm,
    MessageSource,
    Mode,
    Rejected,
    SensorFrame,
    SwitchMode,
    Touch,
)
from fsw.link.inbox import Inbox
from messages import dialect
from messages import message_ids as ids
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


@pytest.mark.parametrize(
    ("base_mode", "is_obeyed"), [(0, False), (156, False), (1, True), (157, True)]
)
def test_a_mode_is_changed_only_with_the_flag_of_custom_modes(
    base_mode: int, is_obeyed: bool
) -> None:
    """In the older form of the command as well; without it the number means nothing."""
    inbox = Inbox()
    inbox.accept(frame(ids.SET_MODE, base_mode=base_mode, custom_mode=4 << 16 | 6 << 24))
    (command,) = inbox.take().commands
    assert (command.action == SwitchMode(Mode.LAND)) is is_obeyed
    assert is_obeyed or isinstance(command.action, Rejected)


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


def test_walls_arrive_as_one_set_in_order() -> None:
    inbox = Inbox()
    inbox.accept(wall(0, 2, offset=-1.0))
    assert inbox.take().announced == []
    inbox.accept(wall(1, 2, offset=-2.0))
    (announced,) = inbox.take().announced
    safe_set = announced.safe_set
    assert [one.shape.numbers[3] for one in safe_set.zones] == [-1.0, -2.0]
    assert inbox.take().announced == []
    inbox.accept(wall(1, 2, offset=-2.0))
    inbox.accept(wall(0, 2, offset=-1.0))
    assert inbox.take().announced == []


def test_walls_of_two_sets_do_not_mix() -> None:
    inbox = Inbox()
    inbox.accept(wall(0, 2))
    inbox.accept(wall(0, 3))
    inbox.accept(wall(1, 2))
    assert inbox.take().announced == []


def test_walls_and_points_are_one_set() -> None:
    inbox = Inbox()
    inbox.accept(wall(0, 3))
    inbox.accept(point(1, 3, **{"position[0]": 7.0}))
    assert inbox.take().announced == []
    inbox.accept(point(2, 3))
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


SHAPES = {
    0: (0.6, 0.0, 0.8, 1.5),
    1: (1.0, 2.0, -3.0, 0.5),
    2: (0.0, 0.0, -0.225, 0.075),
    3: (1.0, 2.0, -3.0, 0.0, 0.25),
    4: (1.0, 2.0, -3.0, 1.0, 3.0, -3.0, 0.25),
    5: (1.0, 2.0, -3.0, 0.5, 0.25, 0.125, 0.6, 0.0, 0.8, 0.0),
}


def shape(kind: int, index: int = 0, count: int = 1, **fields: float) -> Frame:
    numbers = {f"numbers[{k}]": value for k, value in enumerate(SHAPES.get(kind, ()))}
    default = {"clearance": 0.125, "flags": int(kind == 2)}
    return frame(
        ids.OBSTACLE_SHAPE, index=index, count=count, kind=kind, **{**default, **numbers, **fields}
    )


TOUCHED = {
    "flags": 2,
    "force_max": 10.0,
    "stiffness[0]": 512.0,
    "stiffness[1]": 2048.0,
    "dissipation": 4.0,
    "friction": 0.5,
}


def test_what_the_tool_meets_is_read() -> None:
    inbox = Inbox()
    inbox.accept(shape(0, **TOUCHED))
    (one,) = inbox.take().announced
    (zone,) = one.safe_set.zones
    assert zone.touch == Touch(10.0, 512.0, 2048.0, 4.0, 0.5)
    inbox.accept(target(force=2.5))
    assert [point.force for point in inbox.take().targets] == [2.5]


@pytest.mark.parametrize(
    ("wrong", "why"),
    [
        ({"force_max": 0.0}, "a force of 0 N is outside 0 to 200 N"),
        ({"force_max": NAN}, "a force of nan N"),
        ({"stiffness[0]": 4096.0}, "4096 to 2048 N/m is no range within"),
        ({"flags": 3}, "what is to be kept in cannot be touched"),
        ({"friction": -1.0}, "friction 0 to 10"),
    ],
)
def test_a_surface_that_cannot_be_is_refused(wrong: dict[str, float], why: str) -> None:
    inbox = Inbox()
    inbox.accept(shape(0, **{**TOUCHED, **wrong}))
    received = inbox.take()
    assert not received.announced
    assert why in " ".join(received.refused)


@pytest.mark.parametrize("force", [-1.0, 201.0, NAN])
def test_a_force_out_of_bounds_is_refused(force: float) -> None:
    inbox = Inbox()
    inbox.accept(target(force=force))
    received = inbox.take()
    assert not received.targets
    assert "is outside 0 to 200 N" in " ".join(received.refused)


def test_the_dialect_names_every_shape_there_is() -> None:
    named = dialect.enums["PANDION_SHAPE"]
    for kind in KINDS:
        words = kind.name.replace(" ", "_").replace("-", "_").upper()
        assert named[kind.number].name == f"PANDION_SHAPE_{words}"
    assert len(named) == len(KINDS) + 1  # and its end
    assert set(SHAPES) == {kind.number for kind in KINDS}


@pytest.mark.parametrize("kind", SHAPES)
def test_a_shape_of_every_kind_is_read(kind: int) -> None:
    inbox = Inbox()
    inbox.accept(shape(kind))
    (announced,) = inbox.take().announced
    safe_set = announced.safe_set
    (zone,) = safe_set.zones
    assert BY_NAME[zone.shape.kind].number == kind
    assert zone.shape.numbers == pytest.approx(SHAPES[kind])
    assert (zone.clearance, zone.keep_in) == (0.125, kind == 2)


def test_shapes_walls_points_and_a_sphere_are_one_set() -> None:
    inbox = Inbox()
    for message in (wall(0, 4), point(1, 4), shape(5, 2, 4), shape(2, 3, 4)):
        inbox.accept(message)
    (announced,) = inbox.take().announced
    safe_set = announced.safe_set
    kinds = [zone.shape.kind for zone in safe_set.zones]
    assert kinds == ["half-space", "ball", "box", "target sphere"]


def test_a_set_holds_64_shapes_and_no_more() -> None:
    for count, complete in ((64, True), (65, False)):
        inbox = Inbox()
        for index in range(count):
            inbox.accept(shape(1, index, count))
        assert bool(inbox.take().announced) == complete


def test_what_stands_is_the_same_whenever_it_is_announced_and_what_moves_is_not() -> None:
    inbox = Inbox()
    stands, moves = [], []
    for t_us in (5_000_000, 6_000_000):
        inbox.accept(shape(1, time_usec=t_us))
        stands.append(inbox.take().announced)
        inbox.accept(shape(1, time_usec=t_us, **{"velocity[0]": 0.5}))
        moves.append(inbox.take().announced)
    assert stands[0] == stands[1]
    assert [one[0].safe_set.zones[0].t_us for one in moves] == [5_000_000, 6_000_000]


def test_a_moving_shape_without_a_time_is_where_it_is_when_it_arrives() -> None:
    inbox = Inbox()
    inbox.accept(shape(1, **{"velocity[0]": 0.5}))
    sensors = SensorFrame(
        t_us=7_000_000,
        p_WB=(0.0, 0.0, 0.0),
        v_WB=(0.0, 0.0, 0.0),
        q_WB=(1.0, 0.0, 0.0, 0.0),
        gyro_B=(0.0, 0.0, 0.0),
        accel_B=(0.0, 0.0, 0.0),
        q_arm=(0.0, 0.0),
        qd_arm=(0.0, 0.0),
    )
    (announced,) = inbox.take_inputs(sensors, None, None, None).announced
    assert announced.safe_set.zones[0].t_us == 7_000_000


@pytest.mark.parametrize(
    ("kind", "bad"),
    [
        *((kind, {"numbers[0]": NAN}) for kind in SHAPES),
        *((kind, {"velocity[1]": math.inf}) for kind in SHAPES),
        (1, {"clearance": -0.1}),
        (1, {"clearance": NAN}),
        (1, {"clearance": 5000.0}),
        (1, {"numbers[0]": 2e4}),
        (1, {"numbers[3]": -0.1}),
        (1, {"velocity[0]": 40.0}),
        (1, {"index": 1}),
        (1, {"flags": 2}),
        (0, {"numbers[0]": 0.5}),
        (2, {"flags": 0}),
        (2, {"velocity[0]": 0.5}),
        (3, {"numbers[3]": -4.0}),
        (4, {"numbers[4]": 2.0}),
        (5, {"numbers[4]": 0.0}),
        (5, {"numbers[6]": 0.5}),
        (77, {}),
    ],
)
def test_what_is_no_shape_is_refused_and_counted(kind: int, bad: dict[str, float]) -> None:
    inbox = Inbox()
    inbox.accept(shape(kind, **bad))  # type: ignore[arg-type]
    assert inbox.take().announced == []
    assert inbox.refused == 1


def test_a_shape_for_another_vehicle_is_not_ours() -> None:
    inbox = Inbox()
    inbox.accept(shape(1, target_system=2))
    assert inbox.take().announced == []
    assert inbox.refused == 0


@pytest.mark.parametrize("radius", [0.0, -1.0, NAN])
def test_a_sphere_that_contains_nothing_is_refused(radius: float) -> None:
    inbox = Inbox()
    inbox.accept(frame(ids.WORKSPACE_SPHERE, radius=radius))
    assert inbox.take().announced == []
    assert inbox.refused == 1


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (point(0, 1, clearance=1e20), "ball refused: a clearance of 1e+20 m is outside 0 to 10 m"),
        (wall(0, 1, offset=1e30), "half-space refused: offset [m] is 1e+30; at most 1000"),
        (
            frame(ids.WORKSPACE_SPHERE, radius=3.4e38),
            "target sphere refused: radius [m] is 3.4e+38",
        ),
        (shape(1, clearance=10.5), "ball refused: a clearance of 10.5 m"),
        (
            target(**{"position[2]": -1000.5}),
            "target refused: position out of range: 1000.5 m, at most 1000 m",
        ),
        (
            target(**{"velocity[0]": 20.5}),
            "target refused: velocity out of range: 20.5 m/s, at most 20 m/s",
        ),
    ],
)
def test_what_is_out_of_bounds_is_refused_with_the_bound_and_who_sent_it(
    message: Frame, words: str
) -> None:
    inbox = Inbox()
    source = MessageSource(66, 6, "gcs", "127.0.0.1:5555")
    for _ in range(9):
        inbox.accept(message, source)
    assert inbox.refused == 9
    received = inbox.take()
    assert (received.announced, received.targets) == ([], [])
    assert len(received.refused) == 4, "the first are told, all are counted"
    assert received.refused[0].startswith(words)
    assert received.refused[0].endswith("; from 66/6 (gcs 127.0.0.1:5555)")
    assert inbox.take().refused == []


def test_the_inbox_is_bounded() -> None:
    inbox = Inbox()
    for _ in range(1000):
        inbox.accept(target())
        inbox.accept(frame(ids.COMMAND_LONG, command=400))
    received = inbox.take()
    assert len(received.targets) <= 64
    assert len(received.commands) <= 16
    assert inbox.refused > 1900
