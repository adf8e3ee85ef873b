"""Defects that flew once, each by its symptom."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fsw.autopilot.signals import ConstraintKind, Mode, SensorFrame
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, LAND, Flight, command, hover, on_the_ground
from tests.fsw.records import with_record


def test_walls_announced_with_an_invalid_first_frame_are_kept() -> None:
    def spoil(frame: SensorFrame) -> SensorFrame:
        return replace(frame, p_WB=(math.nan, 0.0, 0.0)) if frame.t_us == 1_000_000 else frame

    flight = Flight(load_scenario("walls"), spoil=spoil)
    for _ in range(60):
        flight.step()
    assert flight.snapshot.constraints.kind is ConstraintKind.WALLS


def test_arming_where_the_ground_is_not_at_zero_does_not_start_the_rotors() -> None:
    def raised(frame: SensorFrame) -> SensorFrame:
        x, y, z = frame.p_WB
        return replace(frame, p_WB=(x, y, z - 0.08))

    flight = Flight(on_the_ground(), spoil=raised)
    flight.step(command(ARM, 1.0))
    flight.run(0.1)
    assert max(flight.sent[-1].rotor_thrust) < 1.0


@pytest.mark.requirement("REQ-ARM-5")
def test_a_vehicle_that_neither_stands_nor_flies_is_not_armed() -> None:
    def raised(frame: SensorFrame) -> SensorFrame:
        x, y, z = frame.p_WB
        return replace(frame, p_WB=(x, y, z - 0.2))

    flight = Flight(on_the_ground(), spoil=raised)
    flight.step(command(ARM, 1.0))
    flight.run(0.1)
    assert not flight.snapshot.armed


@pytest.mark.long
def test_a_target_that_is_no_number_does_not_keep_the_vehicle_from_landing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = Flight(load_scenario("workspace-calm"))
    flight.follow()
    flight.run(1.0)
    real = flight.targets
    nowhere = (math.nan, 0.0, 0.0)
    monkeypatch.setattr(
        flight, "targets", lambda: tuple(replace(one, p_WE=nowhere) for one in real())
    )
    flight.run(3.0)
    height = flight.sim.truth().p_WB[2]
    flight.step(command(LAND))
    flight.run(3.0)
    assert flight.sim.truth().p_WB[2] > height + 0.3


@pytest.mark.parametrize("yaw_deg", [120.0, -175.0])
def test_left_alone_the_vehicle_keeps_its_heading(yaw_deg: float) -> None:
    flight = Flight(hover(yaw_deg=yaw_deg))
    flight.step(command(ARM, 1.0))
    flight.run(4.0)
    turned = np.degrees(flight.snapshot.estimate.yaw) - yaw_deg
    assert abs((turned + 180.0) % 360.0 - 180.0) < 2.0


@pytest.mark.requirement("REQ-ACT-7")
def test_one_tick_of_nonsense_does_not_leave_the_vehicle_in_open_loop() -> None:
    flight = Flight(hover())
    flight.step(command(ARM, 1.0))
    flight.run(0.5)
    nominal = flight.state.plan_state
    assert nominal is not None
    flight.state = with_record(flight.state, plan_state=nominal._replace(q_arm=(math.nan, 0.0)))
    flight.step()
    assert flight.state.output_replaced
    flight.run(0.5)
    assert not flight.state.output_replaced
    assert flight.snapshot.failures == ()


def test_what_ended_the_flight_stays_on_show() -> None:
    def blinded(frame: SensorFrame) -> SensorFrame:
        late = frame.t_us >= 1_400_000
        lost = replace(frame, p_WB=(math.nan, 0.0, 0.0), gyro_B=(math.nan, 0.0, 0.0))
        return lost if late else frame

    flight = Flight(hover(), spoil=blinded)
    flight.step(command(ARM, 1.0))
    flight.run(1.15)
    assert flight.mode is Mode.FAULT
    assert flight.snapshot.failures
