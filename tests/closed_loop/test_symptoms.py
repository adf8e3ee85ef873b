"""Defects that flew once, each by its symptom."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from fsw.signals import ConstraintKind, SensorFrame
from sitl.scenario_file import load_scenario
from tests.closed_loop.harness import ARM, LAND, Flight, command, hover, on_the_ground


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


def test_a_vehicle_that_neither_stands_nor_flies_is_not_armed() -> None:
    def raised(frame: SensorFrame) -> SensorFrame:
        x, y, z = frame.p_WB
        return replace(frame, p_WB=(x, y, z - 0.2))

    flight = Flight(on_the_ground(), spoil=raised)
    flight.step(command(ARM, 1.0))
    flight.run(0.1)
    assert not flight.snapshot.armed


def test_a_target_that_is_no_number_does_not_keep_the_vehicle_from_landing(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    flight = Flight(load_scenario("workspace-calm"))
    flight.follow()
    flight.run(1.0)
    real = flight._target
    monkeypatch.setattr(
        flight, "_target", lambda t_us: replace(real(t_us), p_WE=(math.nan, 0.0, 0.0))
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
