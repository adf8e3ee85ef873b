"""The battery's model against conservation of charge and energy, and its levels at their edges."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from fsw.autopilot.model.airframe import AIRFRAME, GRAVITY
from fsw.autopilot.model.battery import charge_of, corrected, drained
from fsw.autopilot.signals import BatteryReading, BatteryState, BatteryWarning, Vec4

LEVELS = (0.3, 0.2, 0.1)
FULL = BatteryState(16.8, 0.0, 0.0, 1.0, BatteryWarning.OK)
HOVER: Vec4 = (0.25 * AIRFRAME.mass * GRAVITY,) * 4
NONE: Vec4 = (0.0, 0.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("remaining", "charge"),
    [
        (1.0, BatteryWarning.OK), (0.3, BatteryWarning.OK),
        (0.299, BatteryWarning.LOW), (0.2, BatteryWarning.LOW),
        (0.199, BatteryWarning.CRITICAL), (0.1, BatteryWarning.CRITICAL),
        (0.099, BatteryWarning.EMERGENCY), (0.0, BatteryWarning.EMERGENCY),
        (math.nan, BatteryWarning.EMERGENCY),
    ],
)  # fmt: skip
def test_each_level_begins_below_its_share(remaining: float, charge: BatteryWarning) -> None:
    assert charge_of(remaining, LEVELS) is charge


def test_a_quarter_of_an_hour_of_hover_empties_it_and_the_levels_come_in_order() -> None:
    state, seconds, seen = FULL, 0.0, [BatteryWarning.OK]
    while state.remaining > 0.0:
        state = drained(AIRFRAME, LEVELS, state, HOVER, 1.0)
        seconds += 1.0
        if state.charge is not seen[-1]:
            assert state.remaining == pytest.approx(LEVELS[len(seen) - 1], abs=2e-3)
            seen.append(state.charge)
    assert 12 * 60 < seconds < 18 * 60
    assert seen == [
        BatteryWarning.OK,
        BatteryWarning.LOW,
        BatteryWarning.CRITICAL,
        BatteryWarning.EMERGENCY,
    ]


def disc_power(thrust: float, area: float) -> float:
    """Thrust times the velocity that momentum theory induces in sea-level air [W]."""
    low, high = 0.0, 100.0
    for _ in range(80):
        induced = 0.5 * (low + high)
        # The air through the disc leaves with twice the induced velocity.
        gives = 1.225 * area * induced * 2.0 * induced
        low, high = (induced, high) if gives < thrust else (low, induced)
    return thrust * low


@given(
    st.tuples(*[st.floats(0.0, 17.0)] * 4), st.floats(12.0, 16.8), st.floats(0.3, 0.9),
    st.floats(0.02, 0.2),
)  # fmt: skip
def test_the_current_is_the_rotors_power_over_the_voltage(
    thrust: Vec4, voltage: float, efficiency: float, area: float
) -> None:
    battery = replace(AIRFRAME.battery, efficiency=efficiency, idle_power=5.0)
    radii = (math.sqrt(area / math.pi),) * 4
    vehicle = replace(AIRFRAME, battery=battery, rotor_radius=radii)
    state = drained(vehicle, LEVELS, replace(FULL, voltage=voltage), thrust, 1.0)
    power = 5.0 + sum(disc_power(f, area) for f in thrust) / efficiency
    assert state.current == pytest.approx(power / voltage)


@given(st.floats(0.0, 9.0), st.floats(0.001, 100.0), st.floats(2.0, 20.0))
def test_charge_is_conserved_and_voltage_is_a_line_less_the_drop(
    consumed: float, dt: float, capacity: float
) -> None:
    cells = replace(AIRFRAME.battery, capacity=capacity, full=16.0, empty=12.0, resistance=0.03)
    model = replace(AIRFRAME, battery=cells)
    before = replace(FULL, consumed=min(consumed, capacity))
    after = drained(model, LEVELS, before, HOVER, dt)
    # Ampere-hours: current times hours.
    assert after.consumed - before.consumed == pytest.approx(after.current * dt / 3600.0, abs=1e-9)
    left = max((capacity - after.consumed) / capacity, 0.0)
    assert after.remaining == pytest.approx(left, abs=1e-9)
    assert after.voltage == pytest.approx(12.0 + 4.0 * left - 0.03 * after.current)
    assert after.charge is charge_of(after.remaining, LEVELS)


def test_an_idle_vehicle_uses_its_electronics_power() -> None:
    state = drained(AIRFRAME, LEVELS, FULL, NONE, 3600.0)
    assert state.current * FULL.voltage == pytest.approx(AIRFRAME.battery.idle_power)
    assert 0.0 < state.consumed < 1.0


def test_a_negative_thrust_neither_charges_nor_fails() -> None:
    idle = drained(AIRFRAME, LEVELS, FULL, NONE, 1.0)
    assert drained(AIRFRAME, LEVELS, FULL, (-1.0, -5.0, 0.0, 0.0), 1.0) == idle


def test_a_battery_without_voltage_gives_a_finite_current() -> None:
    dead = drained(AIRFRAME, LEVELS, replace(FULL, voltage=0.0), NONE, 1.0)
    assert dead.current == pytest.approx(AIRFRAME.battery.idle_power)
    low = drained(AIRFRAME, LEVELS, replace(FULL, voltage=1.25), NONE, 1.0)
    assert low.current == pytest.approx(AIRFRAME.battery.idle_power / 1.25)


def test_a_full_battery_at_rest_shows_four_full_lithium_cells() -> None:
    model = AIRFRAME.battery
    assert model.full == pytest.approx(4 * 4.2)
    assert model.empty == pytest.approx(4 * 3.4)


def test_a_measurement_corrects_the_model_which_goes_on_from_there() -> None:
    model = AIRFRAME
    drawn = drained(model, LEVELS, FULL, HOVER, 1.0)
    now = corrected(model.battery, LEVELS, drawn, BatteryReading(14.2, 0.15))
    assert (now.voltage, now.charge) == (14.2, BatteryWarning.CRITICAL)
    assert now.remaining == pytest.approx(0.15, abs=0.0051), "what is rounded to 15 %"
    later = drained(model, LEVELS, now, HOVER, 1.0)
    assert 0.14 < later.remaining < now.remaining
    assert later.voltage == pytest.approx(14.2, abs=0.2), "not the model's own"
    fresh = corrected(model.battery, LEVELS, later, BatteryReading(16.8, 1.0))
    assert fresh.charge is BatteryWarning.OK


def test_the_flight_time_that_is_left_is_that_at_the_current_of_late() -> None:
    model, state = AIRFRAME, FULL
    for _ in range(1000):  # 100 s
        state = drained(model, LEVELS, state, HOVER, 0.1)
    assert state.usual_current == pytest.approx(state.current, rel=0.02)
    amperes = state.usual_current
    assert state.time_left == pytest.approx(3600.0 * 10.0 * state.remaining / amperes)
    assert 600.0 < state.time_left + 100.0 < 1200.0, "about a quarter of an hour"
    climb = drained(model, LEVELS, state, (2.0 * HOVER[0],) * 4, 0.1)
    assert climb.time_left > 0.98 * state.time_left, "a moment is not how it goes on"


def test_a_battery_that_nothing_has_drawn_on_begins_at_its_first_current() -> None:
    state = drained(AIRFRAME, LEVELS, FULL, HOVER, 0.1)
    assert state.usual_current == state.current
    assert BatteryState().time_left == math.inf


@pytest.mark.parametrize("flow", [0.7, 1.6])
@pytest.mark.parametrize("floor", [False, True], ids=["rounded", "cut off"])
def test_readings_of_whole_per_cent_undo_nothing_that_has_been_used(
    flow: float, floor: bool
) -> None:
    """A reading each second, and a model that uses more or less: each level begins once."""
    thrust = (2.0 * HOVER[0],) * 4
    model, truth, state, seen = AIRFRAME, FULL, FULL, [BatteryWarning.OK]
    larger = replace(model, battery=replace(model.battery, capacity=10.0 / flow))
    for k in range(1, 6000):
        truth = drained(larger, LEVELS, truth, thrust, 0.1)
        before, state = state.remaining, drained(model, LEVELS, state, thrust, 0.1)
        if k % 10 == 0:
            per_cent = 100.0 * truth.remaining
            reading = (math.floor(per_cent) if floor else round(per_cent)) / 100.0
            state = corrected(model.battery, LEVELS, state, BatteryReading(truth.voltage, reading))
            assert state.remaining - before < 4e-3, "what the model used since, at most"
            assert state.remaining == pytest.approx(truth.remaining, abs=0.016)
        if state.charge is not seen[-1]:
            seen.append(state.charge)
    assert seen == [
        BatteryWarning.OK,
        BatteryWarning.LOW,
        BatteryWarning.CRITICAL,
        BatteryWarning.EMERGENCY,
    ]


def test_a_level_is_over_only_with_charge_to_spare() -> None:
    def charge(remaining: float) -> BatteryWarning:
        low = replace(FULL, remaining=0.15, charge=BatteryWarning.CRITICAL)
        return corrected(AIRFRAME.battery, LEVELS, low, BatteryReading(15.0, remaining)).charge

    assert [charge(one) for one in (0.21, 0.24, 0.31, 0.34, 0.05)] == [
        *(
            BatteryWarning.CRITICAL,
            BatteryWarning.LOW,
            BatteryWarning.LOW,
            BatteryWarning.OK,
            BatteryWarning.EMERGENCY,
        )
    ]
