"""Missions, fences and rally points with a pymavlink client over real sockets."""

from __future__ import annotations

import math
import socket
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Any

import pytest

from fsw.autopilot.flight.commands.bounds import upload_problem
from fsw.autopilot.shapes.half_space import wall
from fsw.autopilot.shapes.vertical_cylinder import column
from fsw.autopilot.signals import (
    TARGET_SPHERE,
    Home,
    MissionAction,
    MissionProgress,
    MissionState,
    MissionStep,
    MissionUpdate,
    Mode,
    SafeSet,
    Severity,
    StatusText,
    Vec3,
)
from fsw.link.services.mission_service import MissionService
from fsw.link.services.mission_store import (
    WAITING,
    Kind,
    MissionStore,
    Site,
    fence_remarks,
    mission_remarks,
)
from fsw.link.wire.mission_items import MissionItem
from tests.fsw.link.ground import Ground, ground_station, station_socket
from tests.fsw.link.services.mission_client import Client, Item, Weather
from tests.fsw.link.snapshots import SNAPSHOT, outputs_at

NAN = math.nan
ACCEPTED, ERROR, UNSUPPORTED_FRAME, UNSUPPORTED, NO_SPACE = 0, 1, 2, 3, 4
INVALID, INVALID_SEQUENCE, DENIED, CANCELLED = 5, 13, 14, 15
MISSION, FENCE, RALLY = Kind.MISSION, Kind.FENCE, Kind.RALLY

WAYPOINTS: list[Item] = [
    {"command": 22, "frame": 6, "z": 1.5, "x": 470_000_100, "y": 80_000_200},
    {"command": 178, "frame": 2, "params": (1.0, 0.25, -1.0, 0.0)},
    {"command": 16, "x": 5_000, "y": -12_345, "z": -1.3, "params": (2.0, 0.2, 0.0, 90.0)},
    {"command": 16, "x": 0, "y": 7, "z": -1.2345678, "autocontinue": 0},
    {"command": 93, "frame": 2, "params": (3.0, -1.0, -1.0, -1.0)},
    {"command": 20, "frame": 2},
]
TRIANGLE: list[Item] = [
    {"command": 5001, "params": (3.0, 0.0, 0.0, 0.0), "x": 10_000 * n, "y": 10_000 * e, "z": 0.0}
    for n, e in ((9, 0), (-9, 9), (-9, -9))
]

BOX: list[Item] = [
    {"command": 5001, "params": (4.0, 0.0, 0.0, 0.0), "x": 10_000 * n, "y": 10_000 * e, "z": 0.0}
    for n, e in ((9, 9), (9, -9), (-9, -9), (-9, 9))
]


def locate(latitude: float, longitude: float, altitude: float) -> Vec3:
    return (latitude - 47.0) * 111_000.0, (longitude - 8.0) * 76_000.0, -altitude


@dataclass
class Vehicle:
    """A link that serves missions, and a tick that takes what is within bounds."""

    ground: Ground
    store: MissionStore
    updates: list[MissionUpdate] = field(default_factory=list)  # that the tick was told
    answer: bool | None = True  # of the tick, to what is within bounds
    ticks: bool = True

    @property
    def station(self) -> socket.socket:
        return self.ground.station

    def tick(self, t_us: int) -> None:
        outputs, update = outputs_at(t_us), self.store.take_update() if self.ticks else None
        if update is not None:
            self.updates.append(update)
            wrong = upload_problem(update)
            self.store.settle(self.answer if wrong is None else False)
            if wrong is not None:
                outputs = replace(outputs, texts=(StatusText(Severity.CRITICAL, wrong),))
        self.ground.links.publish(outputs)

    def client(self, system: int = 255, weather: Weather | None = None) -> Client:
        return Client(self.ground.link, self.station, system, weather, self.tick)


@pytest.fixture
def vehicle() -> Iterator[Vehicle]:
    store = MissionStore(Site(locate, lambda: 0.1))
    with ground_station(services=(MissionService(store),)) as ground:
        yield Vehicle(ground, store)


def same(items: list[Any], uploaded: list[Item]) -> None:
    assert [item.seq for item in items] == list(range(len(uploaded)))
    for item, given in zip(items, uploaded, strict=True):
        assert (item.command, item.frame) == (given["command"], given.get("frame", 1))
        assert (item.x, item.y) == (given.get("x", 0), given.get("y", 0))
        assert item.z == pytest.approx(given.get("z", -1.0), rel=1e-7)
        assert item.autocontinue == given.get("autocontinue", 1)
        wanted = given.get("params", (0.0, 0.0, 0.0, NAN))
        got = (item.param1, item.param2, item.param3, item.param4)
        assert got == pytest.approx(wanted, rel=1e-7, nan_ok=True)


@pytest.mark.parametrize(
    ("kind", "items"),
    [(0, WAYPOINTS), (1, TRIANGLE), (2, [{"command": 5100, "x": 10_000, "y": 20_000}])],
)
def test_what_was_uploaded_comes_back_bit_for_bit(
    vehicle: Vehicle, kind: int, items: list[Item]
) -> None:
    client = vehicle.client()
    assert client.upload(items, kind) == ACCEPTED
    same(client.download(kind), items)
    for other in {0, 1, 2} - {kind}:
        assert client.download(other) == []


def test_the_tick_is_told_what_a_mission_means(vehicle: Vehicle) -> None:
    assert vehicle.client().upload(WAYPOINTS) == ACCEPTED
    update = vehicle.updates[-1]
    assert update.steps is not None
    assert [step.action for step in update.steps] == [
        MissionAction.TAKE_OFF,
        MissionAction.SPEED,
        MissionAction.GO,
        MissionAction.GO,
        MissionAction.DELAY,
        MissionAction.RETURN,
    ]
    assert update.steps[2].position == pytest.approx((0.5, -1.2345, -1.3))
    assert len(vehicle.updates) == 1


def test_items_in_floats_are_taken_and_given(vehicle: Vehicle) -> None:
    """MAVProxy sends what it is asked for, and older ground stations know nothing else."""
    client = vehicle.client()
    assert client.upload(WAYPOINTS[:1] + WAYPOINTS[2:4], floats=True) == ACCEPTED
    stored = vehicle.store.items[MISSION]
    assert (stored[1].x, stored[1].y) == (5_000, -12_345)
    assert stored[0].x == pytest.approx(470_000_100, abs=40)  # as exact as a float is
    items = client.download(floats=True)
    assert (items[1].x, items[1].y) == pytest.approx((0.5, -1.2345))


@pytest.mark.drawn(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_network_that_loses_doubles_and_reorders_changes_nothing(
    vehicle: Vehicle, seed: int
) -> None:
    weather = Weather(lost=0.2, doubled=0.2, late=0.15)
    weather.random.seed(seed)
    client = vehicle.client(weather=weather)
    items = [{**WAYPOINTS[2], "x": 100 * k} for k in range(25)]
    assert client.upload(items) == ACCEPTED
    same(client.download(), items)


def test_a_lost_item_is_asked_for_again(vehicle: Vehicle) -> None:
    client = vehicle.client()
    client.ask(client.mav.mission_count_encode(1, 1, 3, 0), "MISSION_REQUEST_INT")
    client.heard.clear()
    client.pump(0.6)
    again = [m for m in client.heard if m.get_type() == "MISSION_REQUEST_INT"]
    assert [m.seq for m in again] == [0, 0]


def test_a_doubled_item_does_not_double_every_request_that_follows(vehicle: Vehicle) -> None:
    client = vehicle.client()
    client.ask(client.mav.mission_count_encode(1, 1, 3, 0), "MISSION_REQUEST_INT")
    client.heard.clear()
    for _ in range(3):
        client.send(client.item(WAYPOINTS[2], 0))
    client.pump(0.1)
    requests = [m.seq for m in client.heard if m.get_type() == "MISSION_REQUEST_INT"]
    assert requests == [1]


def test_an_upload_that_breaks_off_leaves_the_old_mission_whole(vehicle: Vehicle) -> None:
    client = vehicle.client()
    assert client.upload(WAYPOINTS) == ACCEPTED
    client.ask(client.mav.mission_count_encode(1, 1, 4, 0), "MISSION_REQUEST_INT")
    client.ask(client.item(WAYPOINTS[3], 0), "MISSION_REQUEST_INT")
    ack = client.pump(8.0, lambda m: m.get_type() == "MISSION_ACK")
    assert ack is not None
    assert ack.type == CANCELLED
    assert "aborted" in client.texts()
    assert len(vehicle.updates) == 1
    same(client.download(), WAYPOINTS)


def test_an_upload_that_is_called_off_leaves_the_old_mission_whole(vehicle: Vehicle) -> None:
    client = vehicle.client()
    assert client.upload(WAYPOINTS) == ACCEPTED
    client.ask(client.mav.mission_count_encode(1, 1, 4, 0), "MISSION_REQUEST_INT")
    client.send(client.mav.mission_ack_encode(1, 1, CANCELLED, 0))
    client.pump(0.1)
    client.heard.clear()
    client.pump(1.0)
    assert not [m for m in client.heard if m.get_type() == "MISSION_REQUEST_INT"]
    same(client.download(), WAYPOINTS)


def test_a_lost_acknowledgement_is_given_again(vehicle: Vehicle) -> None:
    client = vehicle.client()
    assert client.upload(WAYPOINTS) == ACCEPTED
    last = len(WAYPOINTS) - 1
    again = client.ask(client.item(WAYPOINTS[last], last), "MISSION_ACK")
    assert again.type == ACCEPTED


@pytest.mark.parametrize(
    ("bad", "result", "word"),
    [
        ({"command": 82}, UNSUPPORTED, "NAV_SPLINE_WAYPOINT"),
        ({"command": 16, "frame": 8}, UNSUPPORTED_FRAME, "frame 8"),
        ({"command": 16, "params": (NAN, 0.0, 0.0, 0.0)}, 6, "stay"),
        ({"command": 16, "x": 2_000_000_000}, 10, "too far"),
        ({"command": 16, "z": NAN}, 12, "height"),
    ],
)
def test_a_bad_item_ends_the_upload_with_its_result_and_the_reason(
    vehicle: Vehicle, bad: Item, result: int, word: str
) -> None:
    client = vehicle.client()
    assert client.upload(WAYPOINTS) == ACCEPTED
    assert client.upload([WAYPOINTS[2], bad, WAYPOINTS[3]]) == result
    assert "item 1: " in client.texts()
    assert word in client.texts()
    same(client.download(), WAYPOINTS)


# As QGroundControl and MAVSDK write a survey, with the frames and parameters of their own.
SURVEY: list[Item] = [
    {"command": 22, "frame": 6, "z": 1.5, "x": 470_000_100, "y": 80_000_200},
    {"command": 530, "frame": 2, "params": (0.0, 2.0, NAN, NAN)},
    {"command": 205, "frame": 2, "params": (-90.0, 0.0, 0.0, 0.0)},
    {"command": 16, "x": 5_000, "y": -12_345, "z": -1.3, "params": (2.0, 0.2, 0.0, 90.0)},
    {"command": 206, "frame": 2, "params": (5.0, 0.0, 1.0, 0.0)},
    {"command": 18, "x": 10_000, "y": 0, "z": -1.5, "params": (1.0, 0.0, 2.0, 1.0)},
    {"command": 177, "frame": 2, "params": (3.0, 2.0, 0.0, 0.0)},
    {"command": 2000, "frame": 2, "params": (0.0, 2.0, 0.0, NAN)},
    {"command": 2501, "frame": 2},
    {"command": 21, "frame": 6, "x": 0, "y": 0, "z": 0.0},
]


def test_a_survey_of_qgroundcontrol_is_taken_and_what_is_skipped_is_told(vehicle: Vehicle) -> None:
    client = vehicle.client()
    assert client.upload(SURVEY) == ACCEPTED
    skipped = "1 SET_CAMERA_MODE, 2 DO_MOUNT_CONTROL, 4 DO_SET_CAM_TRIGG_DIST"
    assert f"{skipped}, 7 IMAGE_START_CAPTURE and 1 more" in client.texts()
    same(client.download(), SURVEY)
    update = vehicle.updates[-1]
    assert update.steps is not None
    assert [step.action for step in update.steps][4:7] == [
        MissionAction.SKIP, MissionAction.CIRCLE, MissionAction.JUMP,
    ]  # fmt: skip


def test_a_mission_that_cannot_start_or_leaves_the_fence_is_told_at_upload(
    vehicle: Vehicle,
) -> None:
    client = vehicle.client()
    assert client.upload(BOX, FENCE) == ACCEPTED
    far = {"command": 16, "x": 120_000, "y": 0, "z": -1.3}
    assert client.upload([WAYPOINTS[2], far]) == ACCEPTED
    texts = client.texts()
    assert "mission accepted, but it cannot start: no mission: on the ground" in texts
    assert "mission leaves the fence on the way to item 1 by 3.10 m" in texts
    # The other way round: the fence comes later.
    assert client.upload([], FENCE) == ACCEPTED
    further = {**far, "x": 130_000}
    assert client.upload([WAYPOINTS[0], further]) == ACCEPTED
    client.pump(0.1)
    assert "by 4.10 m" not in client.texts()
    assert client.upload(BOX, FENCE) == ACCEPTED
    client.pump(0.1)
    assert "mission leaves the fence on the way to item 1 by 4.10 m" in client.texts()


def test_each_skipped_item_has_its_own_reason(vehicle: Vehicle) -> None:
    client = vehicle.client()
    marked = [WAYPOINTS[0], {"command": 189, "frame": 2}, {"command": 2004, "frame": 2}]
    assert client.upload(marked) == ACCEPTED
    texts = client.texts()
    assert "skipped, a return leads to home or a rally point: 1 DO_LAND_START" in texts
    assert "skipped, this vehicle has no camera: 2 CAMERA_TRACK_POINT" in texts


def test_a_place_above_the_highest_height_is_told_at_upload() -> None:
    low = MissionStep(MissionAction.GO, (0.0, 0.0, -119.0))
    high = MissionStep(MissionAction.GO, (0.0, 0.0, -119.0), above_home=True)
    items = (MissionItem(16, 1, (0.0, 0.0, 0.0, NAN), 0, 0, 119.0),) * 2
    seen = replace(outputs_at(1).snapshot, home=Home((0.0, 0.0, -4.0), 0.0), landed=False)
    (remark,) = mission_remarks(items, (low, high), seen, 120.0)
    assert remark == "mission is above STR_ALT_MAX (120 m) at item 1 by 3.00 m: it is kept below"


def test_a_leg_through_a_column_and_a_circle_over_a_wall_leave_the_fence() -> None:
    def go(north: float, east: float) -> MissionStep:
        return MissionStep(MissionAction.GO, (north, east, -1.5))

    column_at = SafeSet((column((5.0, 0.2), 1.0),))
    assert "item 1 by 0.80 m" in fence_remarks((go(0.0, 0.0), go(10.0, 0.0)), column_at, None)[0]
    assert fence_remarks((go(0.0, 0.0), go(0.0, 9.0)), column_at, None) == ()
    walls = SafeSet((wall((1.0, 0.0, 0.0), -3.0, 0.1),))
    circle = MissionStep(MissionAction.CIRCLE, (0.0, 0.0, -1.5), radius=-4.0, turns=1.0)
    assert "item 0 by 1.10 m" in fence_remarks((circle,), walls, None)[0]
    back = MissionStep(MissionAction.JUMP, target=0, repeats=1)
    jumping = (go(10.0, 0.0), go(10.0, 5.0), go(0.0, 5.0), go(0.0, 0.0), back)
    assert "item 0 by" in fence_remarks(jumping, column_at, None)[0]


@pytest.mark.parametrize(
    ("items", "result", "why"),
    [
        (
            [{"command": 208, "frame": 2, "params": (2.0, 0.0, NAN, NAN)}],
            UNSUPPORTED,
            "no parachute",
        ),
        ([{"command": 177, "frame": 2, "params": (9.0, 1.0, 0.0, 0.0)}], INVALID, "item 9 of 0"),
        ([{"command": 177, "frame": 2, "params": (0.0, -1.0, 0.0, 0.0)}], INVALID, "without end"),
    ],
)
def test_what_a_mission_relies_on_and_is_not_there_refuses_it(
    vehicle: Vehicle, items: list[Item], result: int, why: str
) -> None:
    client = vehicle.client()
    assert client.upload(items) == result
    assert "mission refused: item 0: " in client.texts()
    assert why in client.texts()


def test_a_float_item_that_is_no_place_is_refused(vehicle: Vehicle) -> None:
    client = vehicle.client()
    client.ask(client.mav.mission_count_encode(1, 1, 1, 0), "MISSION_REQUEST_INT")
    bad = client.mav.mission_item_encode(1, 1, 0, 1, 16, 0, 1, 0, 0, 0, 0, math.inf, 0, -1, 0)
    assert client.ask(bad, "MISSION_ACK").type == 10


def test_an_item_beyond_the_count_is_a_wrong_sequence(vehicle: Vehicle) -> None:
    client = vehicle.client()
    client.ask(client.mav.mission_count_encode(1, 1, 2, 0), "MISSION_REQUEST_INT")
    assert client.ask(client.item(WAYPOINTS[2], 2), "MISSION_ACK").type == INVALID_SEQUENCE


def test_an_item_of_no_upload_is_an_error(vehicle: Vehicle) -> None:
    client = vehicle.client()
    assert client.ask(client.item(WAYPOINTS[2], 0), "MISSION_ACK").type == ERROR


def test_too_many_items_are_refused_at_once(vehicle: Vehicle) -> None:
    client = vehicle.client()
    for kind in (0, 1, 2):
        ack = client.ask(client.mav.mission_count_encode(1, 1, 60_000, kind), "MISSION_ACK")
        assert (ack.type, ack.mission_type) == (NO_SPACE, kind)


def test_types_that_nobody_knows_are_refused(vehicle: Vehicle) -> None:
    client, mav = vehicle.client(), vehicle.client().mav
    for message in (
        mav.mission_count_encode(1, 1, 1, 7),
        mav.mission_request_list_encode(1, 1, 7),
        mav.mission_request_int_encode(1, 1, 0, 7),
        mav.mission_clear_all_encode(1, 1, 7),
    ):
        ack = client.ask(message, "MISSION_ACK")
        assert (ack.type, ack.mission_type) == (UNSUPPORTED, 7)


def test_partial_lists_are_refused_cleanly(vehicle: Vehicle) -> None:
    client, mav = vehicle.client(), vehicle.client().mav
    assert client.upload(WAYPOINTS) == ACCEPTED
    for message in (
        mav.mission_write_partial_list_encode(1, 1, 1, 2, 0),
        mav.mission_request_partial_list_encode(1, 1, 1, 2, 0),
    ):
        assert client.ask(message, "MISSION_ACK").type == UNSUPPORTED
    same(client.download(), WAYPOINTS)


def test_a_request_beyond_the_end_is_a_wrong_sequence(vehicle: Vehicle) -> None:
    client, mav = vehicle.client(), vehicle.client().mav
    assert client.upload(WAYPOINTS) == ACCEPTED
    ack = client.ask(mav.mission_request_int_encode(1, 1, 6, 0), "MISSION_ACK")
    assert ack.type == INVALID_SEQUENCE


@pytest.mark.parametrize("kind", [0, 1, 2, 255])
def test_clearing_clears_what_it_names(vehicle: Vehicle, kind: int) -> None:
    client, mav = vehicle.client(), vehicle.client().mav
    assert client.upload(WAYPOINTS) == ACCEPTED
    assert client.upload(TRIANGLE, FENCE) == ACCEPTED
    assert client.upload([{"command": 5100}], RALLY) == ACCEPTED
    assert client.ask(mav.mission_clear_all_encode(1, 1, kind), "MISSION_ACK").type == ACCEPTED
    left = [len(vehicle.store.items[k]) for k in Kind]
    full = [len(WAYPOINTS), 3, 1]
    assert left == ([0, 0, 0] if kind == 255 else [0 if k == kind else full[k] for k in range(3)])
    update = vehicle.updates[-1]
    assert (update.steps == ()) is (kind in (0, 255))
    assert (update.fence == SafeSet()) is (kind in (1, 255))
    assert (update.rally == ()) is (kind in (2, 255))


@pytest.mark.parametrize("kind", [FENCE, 255])
def test_clearing_that_the_tick_refuses_clears_nothing_and_names_what_was_asked_for(
    vehicle: Vehicle, kind: int
) -> None:
    client = vehicle.client()
    assert client.upload(BOX, FENCE) == ACCEPTED
    assert client.upload(WAYPOINTS) == ACCEPTED
    assert client.upload([{"command": 5100}], RALLY) == ACCEPTED
    before, ids = dict(vehicle.store.items), dict(vehicle.store.ids)
    clear = client.mav.mission_clear_all_encode(1, 1, kind)
    vehicle.answer = False
    ack = client.ask(clear, "MISSION_ACK")
    assert (ack.type, ack.mission_type) == (DENIED, kind)
    assert (vehicle.store.items, vehicle.store.ids) == (before, ids)
    vehicle.answer = True
    assert client.ask(clear, "MISSION_ACK").type == ACCEPTED
    assert vehicle.store.items[FENCE] == ()


@pytest.mark.parametrize(("answer", "result"), [(False, DENIED), (None, ERROR)])
@pytest.mark.parametrize("kind", [FENCE, RALLY])
def test_what_the_tick_does_not_take_is_not_kept(
    vehicle: Vehicle, answer: bool | None, result: int, kind: int
) -> None:
    """A fence was acknowledged, and could be downloaded, that was not in force."""
    client, items = vehicle.client(), BOX if kind == FENCE else [{"command": 5100}]
    vehicle.answer = answer
    assert client.upload(items, kind) == result
    assert "items received" not in client.texts()
    assert (vehicle.store.items[Kind(kind)], vehicle.store.ids[kind]) == ((), 0)
    assert client.download(kind) == []


def test_an_upload_is_acknowledged_when_a_tick_has_decided(vehicle: Vehicle) -> None:
    client, vehicle.ticks = vehicle.client(), False
    client.ask(client.mav.mission_count_encode(1, 1, 1, RALLY), "MISSION_REQUEST_INT")
    for _ in range(3):  # the client repeats it
        client.send(client.item({"command": 5100}, 0, RALLY))
        client.pump(0.4)
    heard = [m.get_type() for m in client.heard if m.get_type().startswith("MISSION_")]
    assert "MISSION_ACK" not in heard
    assert vehicle.store.items[RALLY] == ()
    vehicle.ticks = True
    client.pump(0.1)
    (ack,) = [m for m in client.heard if m.get_type() == "MISSION_ACK"]
    assert (ack.type, ack.opaque_id) == (ACCEPTED, vehicle.store.ids[RALLY])
    assert len(vehicle.store.items[RALLY]) == 1


def test_uploads_that_come_together_are_decided_one_a_tick_in_order(vehicle: Vehicle) -> None:
    """QGroundControl clears its three lists in one go."""
    client, vehicle.ticks = vehicle.client(), False
    for kind in Kind:
        client.send(client.mav.mission_clear_all_encode(1, 1, kind))
    client.pump(0.1)
    vehicle.ticks = True
    client.pump(0.1)
    acks = [m for m in client.heard if m.get_type() == "MISSION_ACK"]
    assert [(m.type, m.mission_type) for m in acks] == [(ACCEPTED, kind) for kind in Kind]
    assert vehicle.updates == [
        MissionUpdate(steps=(), source=vehicle.updates[0].source),
        MissionUpdate(fence=SafeSet(), source=vehicle.updates[0].source),
        MissionUpdate(rally=(), source=vehicle.updates[0].source),
    ]


def test_a_flood_of_uploads_is_refused(vehicle: Vehicle) -> None:
    client, vehicle.ticks = vehicle.client(), False
    for _ in range(WAITING + 1):
        client.send(client.mav.mission_clear_all_encode(1, 1, RALLY))
        client.pump(0.002)
    client.pump(0.1)
    (ack,) = [m for m in client.heard if m.get_type() == "MISSION_ACK"]
    assert ack.type == ERROR
    assert "too many uploads at once" in client.texts()


def test_an_upload_of_nothing_clears_too(vehicle: Vehicle) -> None:
    client = vehicle.client()
    assert client.upload(WAYPOINTS) == ACCEPTED
    assert client.upload([]) == ACCEPTED
    assert client.download() == []


def test_a_second_ground_station_is_denied_until_the_transfer_has_ended(vehicle: Vehicle) -> None:
    first, second = vehicle.client(255), vehicle.client(254)
    first.ask(first.mav.mission_count_encode(1, 1, 2, 0), "MISSION_REQUEST_INT")
    for message in (
        second.mav.mission_count_encode(1, 1, 1, 1),
        second.mav.mission_request_list_encode(1, 1, 0),
        second.mav.mission_clear_all_encode(1, 1, 255),
        second.item(WAYPOINTS[2], 0),
    ):
        second.t_us = first.t_us
        ack = second.ask(message, "MISSION_ACK", patience_s=0.1)
        assert (ack.type, ack.target_system) == (DENIED, 254)
        assert ack.mission_type == message.mission_type
    first.ask(first.item(WAYPOINTS[2], 0), "MISSION_REQUEST_INT")
    assert first.ask(first.item(WAYPOINTS[3], 1), "MISSION_ACK").type == ACCEPTED
    assert second.upload(TRIANGLE, FENCE) == ACCEPTED


@pytest.fixture
def twin(vehicle: Vehicle) -> Iterator[Client]:
    """A second ground station on the link, at another address and with the ids of the first."""
    with station_socket() as station:
        yield Client(vehicle.ground.link, station, after_tick=vehicle.tick)


def test_a_second_ground_station_of_the_same_ids_is_denied_as_well(
    vehicle: Vehicle, twin: Client
) -> None:
    """QGroundControl's ids are 255/190 everywhere: the mission was one of both's items."""
    first = vehicle.client()
    first.ask(first.mav.mission_count_encode(1, 1, 3, 0), "MISSION_REQUEST_INT")
    first.ask(first.item(WAYPOINTS[2], 0), "MISSION_REQUEST_INT")
    twin.t_us = first.t_us
    for message in (
        twin.mav.mission_count_encode(1, 1, 3, 0),
        twin.item(WAYPOINTS[4], 1),
        twin.mav.mission_request_list_encode(1, 1, 0),
        twin.mav.mission_clear_all_encode(1, 1, 255),
    ):
        assert twin.ask(message, "MISSION_ACK", patience_s=0.1).type == DENIED
    twin.send(twin.mav.mission_ack_encode(1, 1, CANCELLED, 0))
    twin.pump(0.05)
    first.t_us = twin.t_us
    first.pump(0.05)
    first.heard.clear()
    first.ask(first.item(WAYPOINTS[3], 1), "MISSION_REQUEST_INT")
    assert first.ask(first.item(WAYPOINTS[2], 2), "MISSION_ACK").type == ACCEPTED
    same(first.download(), [WAYPOINTS[2], WAYPOINTS[3], WAYPOINTS[2]])
    twin.t_us = first.t_us
    twin.pump(0.1)
    twin.heard.clear()
    assert twin.ask(twin.item(WAYPOINTS[2], 2), "MISSION_ACK").type == ERROR
    assert twin.upload(WAYPOINTS) == ACCEPTED


def test_a_client_that_begins_its_upload_anew_replaces_it(vehicle: Vehicle) -> None:
    client = vehicle.client()
    client.ask(client.mav.mission_count_encode(1, 1, 3, 0), "MISSION_REQUEST_INT")
    client.ask(client.item(WAYPOINTS[2], 0), "MISSION_REQUEST_INT")
    assert client.upload(WAYPOINTS) == ACCEPTED
    same(client.download(), WAYPOINTS)


def test_a_download_that_nobody_goes_on_with_does_not_block_for_ever(vehicle: Vehicle) -> None:
    first, second = vehicle.client(255), vehicle.client(254)
    assert first.upload(WAYPOINTS) == ACCEPTED
    first.ask(first.mav.mission_request_list_encode(1, 1, 0), "MISSION_COUNT")
    second.t_us = first.t_us
    assert second.ask(second.mav.mission_clear_all_encode(1, 1, 0), "MISSION_ACK").type == DENIED
    second.pump(5.1)
    assert second.upload([]) == ACCEPTED


def test_what_is_for_another_system_is_not_answered(vehicle: Vehicle) -> None:
    client, mav = vehicle.client(), vehicle.client().mav
    client.send(mav.mission_request_list_encode(2, 1, 0))
    client.send(mav.mission_count_encode(1, 42, 2, 0))
    client.pump(1.0)
    streamed = "MISSION_CURRENT"
    reported = [m.get_type() for m in client.heard if m.get_type().startswith("MISSION")]
    assert set(reported) <= {streamed}


def test_a_sphere_is_a_fence(vehicle: Vehicle) -> None:
    client = vehicle.client()
    sphere: Item = {"command": 5003, "frame": 7, "params": (0.075, 0.0, 0.0, 0.0), "z": -0.225}
    assert client.upload([sphere], FENCE) == ACCEPTED
    fence = vehicle.updates[-1].fence
    assert fence is not None
    (kept,) = fence.zones
    assert kept.shape.kind == TARGET_SPHERE
    assert kept.shape.numbers == pytest.approx((0.0, 0.0, -0.225, 0.075))


def test_the_current_item_can_be_set_and_is_told_at_once(vehicle: Vehicle) -> None:
    client, mav = vehicle.client(), vehicle.client().mav
    assert client.upload(WAYPOINTS) == ACCEPTED
    client.heard.clear()
    client.send(mav.mission_set_current_encode(1, 1, 3))
    client.pump(0.1)
    assert [m.get_type() for m in client.heard if m.get_type().startswith("MISSION_CURRENT")]
    update = vehicle.updates[-1]
    assert update.current == 3
    ack = client.ask(mav.mission_set_current_encode(1, 1, 6), "MISSION_ACK")
    assert ack.type == INVALID_SEQUENCE
    assert "no mission item 6" in client.texts()


def test_progress_is_told_as_it_happens(vehicle: Vehicle) -> None:
    client = vehicle.client()
    progress = MissionProgress(MissionState.ACTIVE, 0, 6)
    for current, reached in ((0, -1), (1, 0), (2, 1)):
        progress = replace(progress, current=current, reached=reached, reached_count=reached + 1)
        seen = replace(SNAPSHOT, mode=Mode.MISSION, mission=progress)
        vehicle.store.observe(seen)
        client.pump(0.02)
        vehicle.store.observe(seen)
        client.pump(0.02)
    reached = [m.seq for m in client.heard if m.get_type() == "MISSION_ITEM_REACHED"]
    assert reached == [0, 1]
    current = [m for m in client.heard if m.get_type() == "MISSION_CURRENT" and m.total == 6]
    assert [(m.seq, m.total, m.mission_state, m.mission_mode) for m in current] == [
        (0, 6, 3, 1),
        (1, 6, 3, 1),
        (2, 6, 3, 1),
    ]


def test_a_plan_has_an_id_that_the_upload_the_download_and_telemetry_agree_on(
    vehicle: Vehicle,
) -> None:
    """A ground station that knows the id need not download the plan again."""
    client, mav = vehicle.client(), vehicle.client().mav

    def id_of(items: list[Item], kind: int) -> int:
        assert client.upload(items, kind) == ACCEPTED
        ack = [m for m in client.heard if m.get_type() == "MISSION_ACK"][-1]
        count = client.ask(mav.mission_request_list_encode(1, 1, kind), "MISSION_COUNT")
        client.send(mav.mission_ack_encode(1, 1, 0, kind))
        assert count.opaque_id == ack.opaque_id
        return int(ack.opaque_id)

    mission, fence = id_of(WAYPOINTS, MISSION), id_of(TRIANGLE, FENCE)
    assert 0 not in (mission, fence)
    vehicle.store.set_current(1)
    client.send(mav.mission_set_current_encode(1, 1, 1))
    current = client.pump(0.1, lambda m: m.get_type() == "MISSION_CURRENT")
    assert (current.mission_id, current.fence_id, current.rally_points_id) == (mission, fence, 0)
    moved = [{**WAYPOINTS[0], "z": 1.6}, *WAYPOINTS[1:]]
    assert id_of(moved, MISSION) != mission
    assert id_of(WAYPOINTS, MISSION) == mission
    assert id_of([], MISSION) == 0


def test_an_item_that_was_reached_is_told_ten_times_more_a_second_apart(vehicle: Vehicle) -> None:
    """There is no acknowledgement, and a datagram may be lost; PX4 does the same."""
    client = vehicle.client()
    progress = MissionProgress(MissionState.ACTIVE, 3, 6, 2, 3)
    vehicle.store.observe(replace(SNAPSHOT, mode=Mode.MISSION, mission=progress))
    client.pump(15.0)
    assert [m.seq for m in client.heard if m.get_type() == "MISSION_ITEM_REACHED"] == [2] * 11
    client.heard.clear()
    vehicle.store.observe(
        replace(SNAPSHOT, mission=replace(progress, current=4, reached=3, reached_count=4))
    )
    client.pump(2.5)
    assert [m.seq for m in client.heard if m.get_type() == "MISSION_ITEM_REACHED"] == [3] * 3
