"""The parameter protocol, frame by frame."""

from __future__ import annotations

import struct
from collections.abc import Iterable

import pytest

from fsw.autopilot.parameters.facts import FACT_BY_NAME
from fsw.autopilot.parameters.flight_config import FlightConfig
from fsw.autopilot.parameters.param_type import field_of, value_of
from fsw.autopilot.parameters.registry import BY_NAME
from fsw.autopilot.signals import CommandRequest, StatusText
from fsw.link.services.parameter_service import BURST, ParameterService
from fsw.link.wire.outgoing import Outgoing, ServiceOutput
from fsw.storage.parameter_store import ParameterStore
from messages import dialect
from messages import message_ids as ids
from messages.frames import Frame, FrameWriter, split, wire_fields
from tests.fsw.storage.test_parameter_store import ticks
from tests.fsw.storage.threads import AtOnce
from tests.parameters_on_the_wire import LISTED

NAMES = sorted([*BY_NAME, *FACT_BY_NAME])
COUNT = len(NAMES)
TICK_US = 2_000


@pytest.fixture
def store() -> ParameterStore:
    store = ParameterStore(FlightConfig(), lambda tuning: None)
    store.open(AtOnce(), lambda values: None)
    return store


@pytest.fixture
def service(store: ParameterStore) -> ParameterService:
    return ParameterService(store)


def frame(message_id: int, *values: float | bytes) -> Frame:
    return Frame(255, 190, 0, message_id, values)


def listing(system: int = 1, component: int = 1) -> Frame:
    return frame(ids.PARAM_REQUEST_LIST, system, component)


def reading(name: bytes = b"", index: int = -1, system: int = 1, component: int = 1) -> Frame:
    return frame(ids.PARAM_REQUEST_READ, index, system, component, name)


def setting(name: bytes, value: float, type_: int = 9, system: int = 1) -> Frame:
    return frame(ids.PARAM_SET, value, system, 1, name, type_)


def decoded(answers: Iterable[ServiceOutput]) -> list[dict[str, object]]:
    """Answers by field, and every one must fit its message."""
    writer, fields = FrameWriter(1, 1), []
    for outgoing in answers:
        if isinstance(outgoing, StatusText):
            fields.append({"message": ids.STATUSTEXT, "text": outgoing.text.encode()})
            continue
        assert isinstance(outgoing, Outgoing)
        assert split(writer.frame(outgoing.message_id, *outgoing.values))
        named = dict(zip(wire_fields(outgoing.message_id), outgoing.values, strict=True))
        fields.append({"message": outgoing.message_id, **named})
    return fields


def later(service: ParameterService, count: int, start_us: int = 0) -> list[dict[str, object]]:
    return [field for k in range(count) for field in decoded(service.poll(start_us + k * TICK_US))]


def test_a_list_is_whole_paced_and_in_order(service: ParameterService) -> None:
    (hash_,) = decoded(service.handle(listing(), 0))
    assert (hash_["param_id"], hash_["param_index"]) == (b"_HASH_CHECK", 65535)
    bursts = [decoded(service.poll(k * TICK_US)) for k in range(500)]
    assert max(map(len, bursts)) <= BURST, "no tick sends more than a datagram"
    values = [value for burst in bursts for value in burst]
    assert [value["param_index"] for value in values] == list(range(COUNT))
    assert {value["param_count"] for value in values} == {COUNT}
    for name, value in zip(NAMES, values, strict=True):
        assert value["param_type"] == (6 if isinstance(LISTED[name], int) else 9)
        assert value_of(value["param_value"], value["param_type"]) == LISTED[name]  # type: ignore[arg-type]
    assert [value["param_id"] for value in values] == [name.encode() for name in NAMES]
    # One a tick at least: 251 parameters, 0.5 s.
    assert bursts[COUNT:] == [[]] * (len(bursts) - COUNT), "all as fast as one a tick"


def test_who_sends_the_hash_back_needs_no_list(service: ParameterService) -> None:
    (hash_,) = decoded(service.handle(listing(), 0))
    assert len(later(service, 1)) == BURST
    bits = hash_["param_value"]
    assert isinstance(bits, float)
    assert service.handle(setting(b"_HASH_CHECK", bits, type_=5), TICK_US) == ()
    assert later(service, 100, TICK_US) == []


def test_what_is_read_only_says_so_and_shows_its_value(
    store: ParameterStore, service: ParameterService
) -> None:
    hexarotor, quadrotor = (field_of(number)[0] for number in (13, 2))
    *text, reported, error = decoded(service.handle(setting(b"MAV_TYPE", hexarotor, 6), 0))
    assert (reported["message"], reported["param_value"]) == (ids.PARAM_VALUE, quadrotor)
    assert error["error"] == dialect.MAV_PARAM_ERROR_READ_ONLY
    assert b"read only" in b"".join(bytes(t["text"]) for t in text)  # type: ignore[call-overload]
    for field, type_ in ((quadrotor, 6), (2.0, 9)):
        (same,) = decoded(service.handle(setting(b"MAV_TYPE", field, type_), 0))
        assert (same["param_value"], same["param_type"]) == (quadrotor, 6)
    assert ticks(store) == []


def test_px4_s_name_of_a_parameter_follows_it(
    store: ParameterStore, service: ParameterService
) -> None:
    service.handle(setting(b"STR_V_MAX", 1.25), 0)
    ticks(store)
    reported = {value["param_id"]: value["param_value"] for value in later(service, 3)}
    assert reported == {b"STR_V_MAX": 1.25, b"MPC_XY_VEL_MAX": 1.25}


def test_a_choice_that_there_is_not_is_refused(
    store: ParameterStore, service: ParameterService
) -> None:
    *text, error = decoded(service.handle(setting(b"COM_LOW_BAT_ACT", 1.0), 0))
    assert error["error"] == dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert b"2 Land when critical" in b"".join(
        bytes(t["text"])
        for t in text  # type: ignore[call-overload]
    )
    assert ticks(store) == []


def test_a_second_request_starts_the_list_again(service: ParameterService) -> None:
    service.handle(listing(), 0)
    assert len(decoded(service.poll(0))) == BURST
    service.handle(listing(), TICK_US)
    assert decoded(service.poll(TICK_US))[0]["param_index"] == 0


def test_one_parameter_by_name_or_index(service: ParameterService) -> None:
    (by_name,) = decoded(service.handle(reading(b"PID_YAW_P"), 0))
    assert by_name["param_value"] == 4.0
    index = by_name["param_index"]
    assert isinstance(index, int)
    assert decoded(service.handle(reading(index=index), 0)) == [by_name]
    assert NAMES[index] == "PID_YAW_P"


@pytest.mark.parametrize("index", [-1, COUNT, 32767])
def test_the_unknown_is_answered_with_an_error_for_the_one_who_asked(
    service: ParameterService, index: int
) -> None:
    (error,) = decoded(service.handle(reading(b"NO_SUCH_THING_16", index), 0))
    assert error["message"] == ids.PARAM_ERROR
    assert error["error"] == dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST
    assert error["param_id"] == b"NO_SUCH_THING_16"
    assert (error["target_system"], error["target_component"]) == (255, 190)


def test_a_name_of_noise_is_unknown(service: ParameterService) -> None:
    for name in (bytes(range(240, 256)), b"\0" * 16, b"\xff" * 16):
        (error,) = decoded(service.handle(reading(name), 0))
        assert error["message"] == ids.PARAM_ERROR


def test_a_set_is_echoed_once_it_holds_and_on_every_link(
    store: ParameterStore, service: ParameterService
) -> None:
    other = ParameterService(store)
    assert service.handle(setting(b"PID_YAW_P", 5.0), 0) == ()
    assert later(service, 3) == []
    ticks(store)
    for link in (service, other):
        (value,) = later(link, 3)
        assert (value["param_id"], value["param_value"]) == (b"PID_YAW_P", 5.0)
        assert value["message"] == ids.PARAM_VALUE


@pytest.mark.parametrize("value", [float("nan"), float("inf"), -1.0, 1e9])
def test_a_refused_set_shows_the_value_that_holds_and_says_why(
    store: ParameterStore, service: ParameterService, value: float
) -> None:
    text, *more, error = decoded(service.handle(setting(b"PID_YAW_P", value), 0))
    assert text["message"] == ids.STATUSTEXT
    assert b"PID_YAW_P is to be 0..50" in bytes(text["text"])  # type: ignore[call-overload]
    assert error["error"] == dialect.MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
    assert more == []
    (echo,) = later(service, 3)
    assert (echo["param_id"], echo["param_value"]) == (b"PID_YAW_P", 4.0)
    assert ticks(store) == []


def test_what_the_tick_refuses_is_shown_unchanged(
    store: ParameterStore, service: ParameterService
) -> None:
    service.handle(setting(b"PID_YAW_P", 5.0), 0)
    ticks(store, taken=False)
    (echo,) = later(service, 3)
    assert echo["param_value"] == 4.0


def bits(code: str, number: float) -> float:
    """A number of some type where a float would stand."""
    (field,) = struct.unpack("<f", struct.pack(f"<{code}", number).ljust(4, b"\0"))
    return float(field)


@pytest.mark.parametrize(
    ("name", "field", "type_", "value"),
    [
        # As PX4 types them: MAVSDK's set_param_int, mavpilot's safety parameters.
        (b"COM_OBL_RC_ACT", bits("i", 4), 6, 4),
        (b"COM_RCL_EXCEPT", bits("i", 7), 6, 7),
        (b"COM_RCL_EXCEPT", bits("i", 4), 6, 4),
        (b"COM_RC_IN_MODE", bits("i", 4), 6, 4),
        (b"NAV_DLL_ACT", bits("i", 0), 6, 0),
        (b"CBRK_FLIGHTTERM", bits("i", 121212), 6, 121212),
        (b"COM_DL_LOSS_T", bits("i", 30), 6, 30),
        # Of another type, the same number: a float that is whole, a bool of mavros, an integer.
        (b"NAV_DLL_ACT", 3.0, 9, 3),
        (b"CBRK_FLIGHTTERM", 121212.0, 9, 121212),
        (b"SYS_FAILURE_EN", bits("B", 1), 1, 1),
        (b"NAV_DLL_ACT", bits("h", 3), 4, 3),
        (b"PID_YAW_P", bits("i", 5), 6, 5.0),
        (b"RTL_LAND_DELAY", bits("i", -1), 6, -1.0),
    ],
)
def test_a_number_is_taken_in_any_type_that_has_it_exactly(
    store: ParameterStore,
    service: ParameterService,
    name: bytes,
    field: float,
    type_: int,
    value: float,
) -> None:
    assert service.handle(setting(name, field, type_), 0) == ()
    ticks(store)
    (echo, *_) = later(service, 3)
    assert (echo["param_value"], echo["param_type"]) == field_of(value)
    assert type(store.values[name.decode()]) is type(value)


@pytest.mark.parametrize(
    ("name", "field", "type_", "error"),
    [
        (b"NAV_DLL_ACT", 2.5, 9, 7),
        (b"NAV_DLL_ACT", float("nan"), 9, 7),
        (b"NAV_DLL_ACT", float("inf"), 9, 7),
        (b"FD_FAIL_R", 60.5, 9, 7),
        (b"PID_YAW_P", bits("i", (1 << 24) + 1), 6, 7),  # a float has no such number
        (b"NAV_DLL_ACT", 0.0, 7, 6),  # 64 bits have no room in the field
        (b"PID_YAW_P", 0.0, 10, 6),
        (b"PID_YAW_P", 0.0, 0, 6),
        (b"PID_YAW_P", 0.0, 255, 6),
        (b"NAV_DLL_ACT", bits("f", 2.0), 6, 2),  # the bits of a float, called an integer
        (b"NAV_DLL_ACT", bits("i", 4), 6, 2),
        (b"SAFE_OWNER", bits("i", -1), 6, 2),
        (b"COM_OBL_RC_ACT", bits("i", 0), 6, 2),
    ],
)
def test_a_number_that_the_type_has_not_is_a_mismatch_and_changes_nothing(
    store: ParameterStore,
    service: ParameterService,
    name: bytes,
    field: float,
    type_: int,
    error: int,
) -> None:
    text, refused = decoded(service.handle(setting(name, field, type_), 0))
    assert text["message"] == ids.STATUSTEXT
    assert (refused["message"], refused["error"], refused["param_id"]) == (345, error, name)
    assert ticks(store) == []
    assert later(service, 3)[0]["param_value"] == field_of(LISTED[name.decode()])[0]


def test_a_read_right_after_a_write_waits_for_what_is_decided(
    store: ParameterStore, service: ParameterService
) -> None:
    """mavpilot sends both at once and takes the first value that comes."""
    other = ParameterService(store)
    service.handle(setting(b"COM_OF_LOSS_T", 2.0), 0)
    assert service.handle(reading(b"COM_OF_LOSS_T"), 0) == ()
    assert other.handle(reading(index=NAMES.index("COM_OF_LOSS_T")), 0) == ()
    assert decoded(service.handle(reading(b"PID_YAW_P"), 0))[0]["param_value"] == 4.0
    assert later(service, 3) == []
    ticks(store)
    for link in (service, other):
        values = [(value["param_id"], value["param_value"]) for value in later(link, 3)]
        assert values == [(b"COM_OF_LOSS_T", 2.0)] * 2, "to the write and to the read"
    assert decoded(service.handle(reading(b"COM_OF_LOSS_T"), 0))[0]["param_value"] == 2.0


def test_a_read_after_a_write_that_the_tick_refuses_gets_the_old_value(
    store: ParameterStore, service: ParameterService
) -> None:
    service.handle(setting(b"MPC_XY_VEL_MAX", 1.25), 0)
    for name in (b"STR_V_MAX", b"MPC_XY_VEL_MAX"):
        assert service.handle(reading(name), 0) == ()
    ticks(store, taken=False)
    values = later(service, 3)
    assert {value["param_value"] for value in values} == {1.5}
    assert [value["param_id"] for value in values].count(b"MPC_XY_VEL_MAX") == 2


def test_px4_s_name_sets_a_parameter_and_both_are_reported(
    store: ParameterStore, service: ParameterService
) -> None:
    assert service.handle(setting(b"MPC_XY_VEL_MAX", 1.25), 0) == ()
    ticks(store)
    reported = {value["param_id"]: value["param_value"] for value in later(service, 3)}
    assert reported == {b"STR_V_MAX": 1.25, b"MPC_XY_VEL_MAX": 1.25}
    text, error = decoded(service.handle(setting(b"MPC_XY_VEL_MAX", 12.0), 0))
    assert b"MPC_XY_VEL_MAX is STR_V_MAX here" in bytes(text["text"])  # type: ignore[call-overload]
    assert (error["error"], error["param_id"]) == (2, b"MPC_XY_VEL_MAX")


def test_setting_the_unknown_is_an_error(service: ParameterService) -> None:
    (error,) = decoded(service.handle(setting(b"NOPE", 1.0), 0))
    assert error["error"] == dialect.MAV_PARAM_ERROR_DOES_NOT_EXIST


def test_everybody_is_this_vehicle_too(service: ParameterService) -> None:
    service.handle(listing(0, 0), 0)
    assert len(later(service, 2)) == BURST


def test_the_hash_tells_a_ground_station_that_it_knows_every_value(
    store: ParameterStore, service: ParameterService
) -> None:
    def hash_() -> int:
        (value,) = decoded(service.handle(reading(b"_HASH_CHECK"), 0))
        assert value["param_type"] == dialect.MAV_PARAM_TYPE_UINT32
        assert value["param_index"] == 65535
        return int.from_bytes(struct.pack("<f", value["param_value"]), "little")

    def bitwise() -> int:
        state = 0
        for name in NAMES:
            fact = FACT_BY_NAME.get(name)
            value = store.values[name] if fact is None else fact.read(store.values, store.airframe)
            code = "<i" if isinstance(value, int) else "<f"
            for byte in name.encode() + struct.pack(code, value):
                state ^= byte
                for _ in range(8):
                    state = state >> 1 ^ (0xEDB88320 if state & 1 else 0)
        return state

    before = hash_()
    assert before == bitwise()
    service.handle(setting(b"PID_YAW_P", 5.0), 0)
    ticks(store)
    assert hash_() == bitwise() != before
    before = hash_()
    service.handle(setting(b"NAV_DLL_ACT", 3.0), 0)
    ticks(store)
    assert hash_() == bitwise() != before
    # Its acknowledgement is not a request.
    assert service.handle(setting(b"_HASH_CHECK", 1.0, type_=5), 0) == ()


def test_the_checksum_is_made_once_for_the_same_values(
    service: ParameterService, monkeypatch: pytest.MonkeyPatch
) -> None:
    """150 requests for it, which fit one datagram, took five ticks."""
    service.handle(reading(b"_HASH_CHECK"), 0)
    monkeypatch.delattr(ParameterService, "_read_value")
    assert len(service.handle(listing(), 0)) == 1


def test_idle_it_says_nothing(service: ParameterService) -> None:
    assert service.poll(0) == ()


def storage(service: ParameterService, wish: float, *, armed: bool = False) -> tuple[int, str]:
    request = CommandRequest(245, (wish, *(float("nan"),) * 6), 255, 190)
    return service.carry_out(request, 0, armed)


@pytest.mark.parametrize(
    ("wish", "armed", "result", "why"),
    [
        (0.0, False, 0, ""),
        (1.0, False, 0, ""),
        (2.0, False, 0, "parameters reset to the values of the start"),
        (3.0, False, 2, "parameters not stored: param1 = 3 must be 0 load, 1 save or 2 reset"),
        (float("nan"), False, 2, "parameters not stored: param1 = nan must be 0 load, 1 save or"),
        (1.0, True, 1, "parameters not stored: the vehicle is armed"),
        (2.0, True, 1, "parameters not stored: the vehicle is armed"),
    ],
)
def test_storage_is_answered_as_px4_answers_it(
    service: ParameterService, wish: float, armed: bool, result: int, why: str
) -> None:
    found, told = storage(service, wish, armed=armed)
    assert found == result
    assert told.startswith(why)


def test_a_reset_changes_every_parameter_back_at_once_and_tells_every_link(
    store: ParameterStore, service: ParameterService
) -> None:
    other = ParameterService(store)
    for name, value in ((b"PID_YAW_P", 5.0), (b"NAV_DLL_ACT", 3.0)):
        service.handle(setting(name, value), 0)
        ticks(store)
    for link in (service, other):
        later(link, 3)
    assert storage(service, 2.0)[0] == 0
    assert service.handle(reading(b"PID_YAW_P"), 0) == (), "it is about to change"
    assert len(ticks(store)) == 1, "one tick takes it whole"
    assert store.values == store.defaults
    for link in (service, other):
        told = {value["param_id"] for value in later(link, 3)}
        assert told == {b"PID_YAW_P", b"NAV_DLL_ACT"}
    assert storage(service, 2.0)[0] == 0
    assert ticks(store) == [], "nothing to reset"
