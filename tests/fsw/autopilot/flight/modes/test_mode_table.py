"""Each mode's numbers are PX4's and MAVLink's, and its place in a flight is the documented one."""

from __future__ import annotations

from dataclasses import replace

import pytest
from pymavlink import mavutil

from fsw.autopilot.flight.modes import MODES
from fsw.autopilot.flight.modes.trajectory import Trajectory
from fsw.autopilot.mpc.reference import still_at
from fsw.autopilot.signals import Mode
from messages import dialect
from tests.fsw.autopilot.flight.in_flight import CONFIG, flying, vehicle_at

PX4_NAMES = {
    Mode.HOLD: "LOITER",
    Mode.MISSION: "MISSION",
    Mode.RETURN: "RTL",
    Mode.TAKEOFF: "TAKEOFF",
    Mode.LAND: "LAND",
    Mode.OFFBOARD: "OFFBOARD",
}
STANDARD = {
    Mode.ORBIT: dialect.MAV_STANDARD_MODE_ORBIT,
    Mode.MISSION: dialect.MAV_STANDARD_MODE_MISSION,
    Mode.LAND: dialect.MAV_STANDARD_MODE_LAND,
    Mode.TAKEOFF: dialect.MAV_STANDARD_MODE_TAKEOFF,
}
FLAGS = {
    "manual": {Mode.HOLD, Mode.TAKEOFF, Mode.ORBIT, Mode.OFFBOARD},
    "before_arming": {Mode.HOLD, Mode.TAKEOFF, Mode.MISSION, Mode.OFFBOARD},
    "lifts_off": {Mode.TAKEOFF, Mode.MISSION},
    "interrupts_landing": {Mode.HOLD, Mode.LAND, Mode.RETURN},
    "interruptible": set(MODES) - {Mode.LAND},
    "continues_reference": {Mode.LAND},
    "external_reference": {Mode.MISSION, Mode.TRAJECTORY},
}


@pytest.mark.parametrize("mode", PX4_NAMES)
def test_the_numbers_of_a_mode_are_those_that_pymavlink_knows_of_px4(mode: Mode) -> None:
    _, main, sub = mavutil.px4_map[PX4_NAMES[mode]]
    assert (MODES[mode].px4.main, MODES[mode].px4.sub) == (main, sub)


def test_an_orbit_is_a_kind_of_position_control_and_a_trajectory_an_external_mode() -> None:
    assert (MODES[Mode.ORBIT].px4.main, MODES[Mode.ORBIT].px4.sub) == (3, 1)
    assert (MODES[Mode.TRAJECTORY].px4.main, MODES[Mode.TRAJECTORY].px4.sub) == (4, 11)


@pytest.mark.parametrize("mode", MODES)
def test_the_standard_mode_that_is_announced_is_mavlinks(mode: Mode) -> None:
    px4 = MODES[mode].px4
    assert px4.standard == STANDARD.get(mode, 0)
    recovery = dialect.MAV_STANDARD_MODE_SAFE_RECOVERY
    assert px4.also_standard == (recovery if mode is Mode.RETURN else 0)
    assert px4.selectable is (mode not in (Mode.ORBIT, Mode.DESCEND))


@pytest.mark.parametrize("flag", FLAGS)
def test_each_property_is_that_of_its_modes_alone(flag: str) -> None:
    assert {mode for mode, kind in MODES.items() if getattr(kind, flag)} == FLAGS[flag]


def test_a_trajectory_is_done_after_its_last_target() -> None:
    mode = Trajectory(CONFIG)
    last = still_at((1.0, 2.0, -3.0), 5000, 0.0)
    state = flying(Mode.TRAJECTORY, mode_origin=(7.0, 8.0, -9.0))
    followed = replace(state, mission=replace(state.mission, stream=(last,)))
    for t_us, follows in ((4999, None), (5000, None), (5001, Mode.HOLD)):
        _, result = mode.update(followed, vehicle_at((0.0, 0.0, -2.0), t_us=t_us))
        assert result.next_mode is follows
    _, result = mode.update(state, vehicle_at((0.0, 0.0, -2.0), t_us=0))
    assert (result.next_mode, result.cause) == (Mode.HOLD, "trajectory done")
    assert mode.reference(followed, 5000).p_WE == (1.0, 2.0, -3.0)
    assert mode.reference(state, 5000).p_WE == (7.0, 8.0, -9.0)
