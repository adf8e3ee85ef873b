"""Battery, dead time and rotor speed by themselves."""

from __future__ import annotations

import math

import pytest

from sitl.plant.battery import Battery, hover_power, open_circuit
from sitl.plant.esc import DeadTime
from sitl.plant.rotor_speed import quadratic_thrust_rate


def test_power_of_a_hovering_disc_is_that_of_momentum_theory() -> None:
    # One rotor of 1 m² in air of 1 kg/m³ with 2 N: induced velocity 1 m/s, power 2 W.
    radius = math.sqrt(1.0 / math.pi)
    assert hover_power((2.0,), (radius,), 1.0, 1.0) == pytest.approx(2.0)
    assert hover_power((2.0,) * 4, (radius,) * 4, 1.0, 0.5) == pytest.approx(16.0)


def test_the_voltage_under_load_is_ohms_law() -> None:
    battery = Battery(5.0, 0.05, 16.8)
    battery.draw(300.0, 0.002)
    current = 300.0 / battery.voltage
    assert battery.voltage == pytest.approx(16.8 - 0.05 * current)
    assert battery.thrust_share() == pytest.approx((battery.voltage / 16.8) ** 2)


def test_the_charge_drawn_is_current_times_time() -> None:
    battery = Battery(5.0, 0.0, 16.8)
    for _ in range(1000):
        battery.draw(168.0, 0.36)  # 10 A for 360 s: 1 A h
    assert battery.charge == pytest.approx(0.8, abs=0.005)
    assert battery.voltage == pytest.approx(open_circuit(battery.charge, 16.8), rel=1e-3)


def test_an_empty_battery_gives_little_and_no_nonsense() -> None:
    battery = Battery(0.01, 0.5, 16.8)
    for _ in range(100):
        battery.draw(5000.0, 1.0)
    assert battery.charge == 0.0
    assert 0.0 < battery.thrust_share() < 0.3
    assert [open_circuit(k / 10, 16.8) for k in range(11)] == sorted(
        open_circuit(k / 10, 16.8) for k in range(11)
    )


def test_a_dead_time_delays_by_whole_exchanges() -> None:
    none = (0.0, 0.0, 0.0, 0.0)
    line = DeadTime(2, none)
    given = [(float(k), 0.0, 0.0, 0.0) for k in range(1, 5)]
    assert [line.through(one) for one in given] == [none, none, given[0], given[1]]


def test_the_rate_of_a_rotors_thrust_is_that_of_its_speeds_square() -> None:
    thrust, command, lag = 9.0, 16.0, 0.04
    # k ω² with k = 1: ω = 3, ω' = (4 - 3) / 0.04, T' = 2 ω ω'.
    assert quadratic_thrust_rate(thrust, command, 17.0, lag) == pytest.approx(2 * 3 * 1 / 0.04)
    near = quadratic_thrust_rate(9.0, 9.1, 17.0, lag)
    assert near == pytest.approx(0.1 / lag, rel=0.01)  # for small steps the lag of thrust itself
    assert quadratic_thrust_rate(9.0, 99.0, 16.0, lag) == pytest.approx(2 * 3 * 1 / 0.04)
