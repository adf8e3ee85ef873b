"""Cells of the fault matrix that were wrong: a wall, the ground, silence, or not flown."""

from __future__ import annotations

import pytest

from studies.fault_matrix.expectations import expectations
from studies.fault_matrix.matrix import Cell, judge

CELLS = [
    ("hold", "encoder-garbage-mocap"),
    ("mission", "encoder-delayed-mocap"),
    ("offboard", "encoder-slow-mocap"),
    ("land", "accel-garbage-mocap"),
    ("hold", "accel-wrong-mocap"),
    ("trajectory", "accel-wrong-mocap"),
    ("hold", "gyro-wrong-mocap"),
    ("mission", "gyro-stuck-mocap"),
    ("hold", "gyro-delayed-mocap"),
    ("hold", "vio-garbage-mocap"),
    ("mission", "vio-garbage-mocap"),
    # Of garbage some is within the gate, once that is wide.
    ("takeoff", "vio-garbage-mocap"),
    ("mission", "vio-delayed-mocap"),
    ("takeoff", "gyro-stuck-mocap"),
    ("hold", "accel-stuck-mocap"),
    ("hold", "gps-off-rtk"),
    ("hold", "gps-delayed-rtk"),
    ("hold", "baro-wrong-rtk"),
    ("trajectory", "battery-weak"),
    ("takeoff", "battery-off"),
    # A pose that is hidden while there is no inertial unit either.
    ("trajectory", "gyro-off-mocap"),
    ("trajectory", "accel-slow-mocap"),
    # Joints that stand nearly where they should.
    ("trajectory", "joint-off-1"),
    ("workspace", "joint-stuck-2"),
    ("return", "encoder-stuck-mocap"),
    # One of two encoders was taken for its joint, or for nobody.
    ("hold", "encoder-stuck-1-mocap"),
    ("hold", "encoder-stuck-2-mocap"),
    ("return", "encoder-stuck-1-mocap"),
]


@pytest.mark.long
@pytest.mark.parametrize(("mode", "fault"), CELLS, ids=["-".join(cell) for cell in CELLS])
def test_a_fault_is_told_and_touches_nothing(mode: str, fault: str) -> None:
    cell = Cell(mode, expectations()[fault], 0)
    assert judge(cell, cell.row()).differs == ()
