"""Changes on their way into use: one at a time, whole, stored before they are reported."""

from __future__ import annotations

import math
from collections.abc import Mapping

import pytest

from fsw.autopilot.parameters.flight_config import FlightConfig, flight_config
from fsw.autopilot.parameters.registry import PARAMETERS
from fsw.autopilot.tuning import Tuning, tuned
from fsw.storage.parameter_store import REST_TICKS, WAITING, ParameterStore
from tests.fsw.storage.threads import AtOnce


class Kept:
    """What was prepared and what was written, in order."""

    def __init__(self) -> None:
        self.prepared: list[Tuning] = []
        self.written: list[Mapping[str, float]] = []
        self.full = False

    def prepare(self, tuning: Tuning) -> None:
        tuned(FlightConfig(), tuning)
        self.prepared.append(tuning)

    def save(self, values: Mapping[str, float]) -> None:
        if self.full:
            raise OSError("no space left on device")
        self.written.append(values)


@pytest.fixture
def kept() -> Kept:
    return Kept()


@pytest.fixture
def store(kept: Kept) -> ParameterStore:
    store = ParameterStore(FlightConfig(), kept.prepare)
    store.open(AtOnce(), kept.save)
    return store


def ticks(
    store: ParameterStore, count: int = 2 * REST_TICKS, *, taken: bool | None = True
) -> list[Tuning]:
    """What some ticks are given, each answered."""
    given = []
    for _ in range(count):
        tuning = store.take_tuning()
        if tuning is not None:
            given.append(tuning)
            store.settle(taken)
    return given


def test_it_starts_with_the_values_of_the_configuration(store: ParameterStore) -> None:
    assert store.values["MIS_TAKEOFF_ALT"] == 1.0
    assert len(store.values) == len(PARAMETERS)
    paper = ParameterStore(flight_config(robustness="paper-5"), lambda tuning: None)
    assert paper.values["WALL_LAMBDA"] == 5.0
    assert ticks(paper) == []


def test_a_change_is_prepared_given_to_one_tick_and_written_before_it_is_told(
    store: ParameterStore, kept: Kept
) -> None:
    asker, other = store.listen(), store.listen()
    assert store.change("PID_YAW_P", 5.0, asker) is None
    assert not asker.changed
    assert ticks(store) == [(("tuning.yaw.kp", 5.0),)]
    assert kept.prepared == [(("tuning.yaw.kp", 5.0),)]
    assert store.values["PID_YAW_P"] == 5.0
    assert kept.written[-1]["PID_YAW_P"] == 5.0
    assert list(asker.changed) == list(other.changed) == ["PID_YAW_P"]
    assert ticks(store) == []


def test_nobody_is_told_until_both_threads_are_done(kept: Kept) -> None:
    thread = AtOnce(waits=True)
    store = ParameterStore(FlightConfig(), kept.prepare)
    store.open(thread, kept.save)
    asker = store.listen()
    store.change("PID_YAW_P", 5.0, asker)
    assert ticks(store) == []
    thread.go()  # designed
    assert len(ticks(store)) == 1
    assert not asker.changed
    thread.go()  # written
    ticks(store)
    assert list(asker.changed) == ["PID_YAW_P"]


@pytest.mark.requirement("REQ-ARM-8")
def test_each_tuning_is_whole(store: ParameterStore) -> None:
    asker = store.listen()
    store.change("TRK_EFFORT", 0.3, asker)
    store.change("LND_T_STILL", 0.7, asker)
    first, second = ticks(store, 3 * REST_TICKS)
    assert first == (("tuning.tracking.input_weight", pytest.approx(0.3e-6)),)
    assert dict(second) == {
        "limits.landed_time_us": pytest.approx(700_000.0),
        "tuning.tracking.input_weight": pytest.approx(0.3e-6),
    }
    store.change("TRK_EFFORT", 0.2, asker)
    (third,) = ticks(store)
    assert set(dict(third)) == {"limits.landed_time_us"}, "the default again is no difference"


def test_a_client_s_single_precision_is_the_number_it_meant(store: ParameterStore) -> None:
    store.change("WALL_LAMBDA", 0.33000001311302185, store.listen())
    assert ticks(store) == [(("planner.walls.lambda_", 0.33),)]


@pytest.mark.requirement("REQ-ARM-8")
def test_what_is_out_of_range_never_comes_near_a_tick(store: ParameterStore, kept: Kept) -> None:
    asker = store.listen()
    for value in (math.nan, math.inf, -1.0, 1e30):
        refusal = store.change("PID_YAW_P", value, asker)
        assert refusal is not None
        assert "PID_YAW_P is to be 0..50" in refusal
    assert list(asker.changed) == ["PID_YAW_P"], "the asker is shown the value that holds"
    assert ticks(store) == []
    assert kept.prepared == kept.written == []


@pytest.mark.parametrize("taken", [False, None])
def test_what_the_tick_refuses_changes_nothing(
    store: ParameterStore, kept: Kept, taken: bool | None
) -> None:
    asker, other = store.listen(), store.listen()
    store.change("PID_YAW_P", 5.0, asker)
    assert len(ticks(store, taken=taken)) == 1
    assert store.values["PID_YAW_P"] == 4.0
    assert list(asker.changed) == ["PID_YAW_P"]
    assert not other.changed
    assert kept.written == []
    store.change("PID_YAW_D", 5.0, asker)
    assert ticks(store) == [(("tuning.yaw.kd", 5.0),)]


def test_numbers_that_contradict_each_other_are_refused_with_the_reason() -> None:
    def contradict(tuning: Tuning) -> None:
        raise ValueError("barrier slope is too steep")

    store = ParameterStore(FlightConfig(), contradict)
    store.open(AtOnce(), lambda values: None)
    asker = store.listen()
    store.change("WALL_K_S", 5.0, asker)
    assert ticks(store) == []
    assert list(asker.texts) == ["WALL_K_S is left as it is: barrier slope is too steep"]
    assert list(asker.changed) == ["WALL_K_S"]
    assert store.values["WALL_K_S"] == 4.0


def test_a_full_disk_is_told_and_the_change_holds(store: ParameterStore, kept: Kept) -> None:
    kept.full = True
    asker = store.listen()
    store.change("PID_YAW_P", 5.0, asker)
    ticks(store)
    assert "no space left" in asker.texts[0]
    assert store.values["PID_YAW_P"] == 5.0


def test_the_same_value_again_is_told_and_nothing_else(store: ParameterStore, kept: Kept) -> None:
    asker = store.listen()
    store.change("PID_YAW_P", 4.0, asker)
    assert ticks(store) == []
    assert list(asker.changed) == ["PID_YAW_P"]
    assert kept.prepared == []


def test_changes_leave_each_other_time(store: ParameterStore) -> None:
    asker = store.listen()
    for value in (5.0, 6.0, 7.0):
        store.change("PID_YAW_P", value, asker)
    given = [len(ticks(store, 1)) for _ in range(5 * REST_TICKS)]
    first, second, third = [tick for tick, count in enumerate(given) if count]
    assert second - first == third - second > REST_TICKS


def test_a_flood_of_changes_is_bounded(store: ParameterStore) -> None:
    asker = store.listen()
    refusals = [store.change("PID_YAW_P", 5.0 + k % 40, asker) for k in range(5 * WAITING)]
    assert refusals.count(None) == WAITING
    assert "too many" in str(refusals[-1])


def test_restored_values_are_the_first_tick_s(kept: Kept) -> None:
    store = ParameterStore(FlightConfig(), kept.prepare)
    assert store.restore({"PID_YAW_P": 5.0, "PID_YAW_D": 4.0}) == 1
    store.open(AtOnce(), kept.save)
    asker = store.listen()
    assert ticks(store, 3) == [(("tuning.yaw.kp", 5.0),)]
    assert not asker.changed
    store.change("PID_YAW_I", 1.0, asker)
    assert [dict(tuning) for tuning in ticks(store)] == [
        {"tuning.yaw.kp": 5.0, "tuning.yaw.ki": 1.0}
    ]


def test_nothing_changes_before_the_flight_allows_it(kept: Kept) -> None:
    store = ParameterStore(FlightConfig(), kept.prepare)
    asker = store.listen()
    store.change("PID_YAW_P", 5.0, asker)
    assert ticks(store) == []
    store.open(AtOnce(), kept.save)
    assert len(ticks(store)) == 1
