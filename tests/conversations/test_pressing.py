"""A ground station streams what the tool is to press with, and is told what cannot be pressed."""

from __future__ import annotations

from collections import defaultdict
from dataclasses import replace
from pathlib import Path

import pytest

from fsw.autopilot.parameters.consistency import loop_tube
from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.parameters.touching import Pressed, against_pressing
from fsw.autopilot.signals import Vec3
from messages import dialect as d
from sitl.scenario import vehicle_of
from tests.closed_loop.harness import hover
from tests.conversations.connected import Connected, connected

NORMAL, OFFSET = (-1.0, 0.0, 0.0), -1.5
STILL, ASIDE, UP = (0.0, 0.0, 0.0), (0.0, 0.25, 0.0), (0.0, 0.0, -0.25)
YAW_RATE_IGNORED, TOUCHED = 0x800, 2


def _announce(vehicle: Connected, flags: int) -> None:
    numbers = (*NORMAL, OFFSET, *(0.0,) * 12)
    touch = (10.0, (512.0, 2048.0), 4.0, 0.5) if flags else ()
    vehicle.send(
        d.MAVLink_obstacle_shape_message(
            *(0, 0.0625, (0.0, 0.0, 0.0), numbers, 1, 1, 0, 1, d.PANDION_SHAPE_HALF_SPACE),
            *(flags, *touch),
        )
    )
    vehicle.run(0.1)


def _press(vehicle: Connected, force: float, v: Vec3, ahead_s: float = 0.5) -> None:
    """Ask for a force [N] at the wall, moving with ``v`` [m/s, NED]; 0 s ahead: for now."""
    t_us = vehicle.flight.state.t_us + round(1e6 * ahead_s) if ahead_s else 0
    place = (-OFFSET, 0.0, -1.25)
    vehicle.send(
        d.MAVLink_end_effector_target_message(
            *(t_us, place, v, (0.0, 0.0, 0.0), 0.0, 0.0, YAW_RATE_IGNORED, 1, 1, 1, force)
        )
    )
    vehicle.run(0.1)


def _told(vehicle: Connected) -> list[str]:
    """Texts that came, each put together of its parts."""
    parts = defaultdict(list)
    for k, one in enumerate(vehicle.heard):
        if one.get_type() == "STATUSTEXT":
            parts[one.id or -k].append(one.text)
    return ["".join(texts) for texts in parts.values()]


def _refused(vehicle: Connected) -> int:
    return vehicle.flight.state.mission.refused_count


@pytest.mark.requirement("REQ-SAFE-13")
def test_a_push_that_is_streamed_is_judged_as_that_of_a_scenario_is(tmp_path: Path) -> None:
    scenario = replace(hover(), vehicle="probe-2r", body="full")
    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
    loop = loop_tube(config)
    with connected(tmp_path, config, scenario) as vehicle:
        vehicle.run(0.1)
        _announce(vehicle, TOUCHED)
        (zone,) = vehicle.flight.state.mission.safe_set.zones
        for force, v in ((3.0, STILL), (3.0, UP)):
            assert not against_pressing(config, zone, loop, Pressed(NORMAL, force, v))
            _press(vehicle, force, v)
            assert vehicle.flight.state.mission.stream[-1].force == force
        assert _refused(vehicle) == 0
        for k, (force, v) in enumerate(((9.5, STILL), (3.0, ASIDE)), start=1):
            against = against_pressing(config, zone, loop, Pressed(NORMAL, force, v))
            assert against
            _press(vehicle, force, v)
            assert f"target refused: {against}" in _told(vehicle)
            assert _refused(vehicle) == k
        assert {one.force for one in vehicle.flight.state.mission.stream} == {3.0}


@pytest.mark.requirement("REQ-SAFE-13")
def test_a_push_at_what_may_not_be_touched_or_for_now_is_refused(tmp_path: Path) -> None:
    scenario = replace(hover(), vehicle="probe-2r", body="full")
    config = flight_config(body=scenario.body, vehicle=vehicle_of(scenario))
    with connected(tmp_path, config, scenario) as vehicle:
        vehicle.run(0.1)
        _announce(vehicle, 0)
        _press(vehicle, 3.0, STILL)
        assert "target refused: 3.0 N are asked for where nothing may be touched" in _told(vehicle)
        assert (_refused(vehicle), vehicle.flight.state.mission.stream) == (1, ())
        _press(vehicle, 3.0, STILL, 0.0)
        assert any("a force needs a time: stream targets ahead" in one for one in _told(vehicle))
