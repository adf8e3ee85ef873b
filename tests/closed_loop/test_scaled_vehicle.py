"""Paper's vehicle, half as large again: it flies between the walls, judged as the truth says."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from fsw.autopilot.parameters.flight_config import flight_config
from fsw.autopilot.signals import TickInputs, TickOutputs
from sitl.scenario import vehicle_of
from sitl.scenario_file import load_scenario, with_vehicle
from sitl.simulation import Simulation
from studies.flight.closed_loop import simulate
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from vehicles.description import V3, V6, Vehicle
from vehicles.vehicle_file import load_vehicle, vehicle_text

SCALE = 1.5
SECONDS = 8.0


def larger(vehicle: Vehicle) -> Vehicle:
    """Every length so many times as large, with the same masses."""

    def long(v: V3) -> V3:
        return SCALE * v[0], SCALE * v[1], SCALE * v[2]

    def wide(inertia: V6) -> V6:
        xx, yy, zz, xy, xz, yz = (SCALE**2 * entry for entry in inertia)
        return xx, yy, zz, xy, xz, yz

    base = replace(vehicle.base, com=long(vehicle.base.com), inertia=wide(vehicle.base.inertia))
    rotors = [
        replace(one, position=long(one.position), radius=SCALE * one.radius)
        for one in vehicle.rotors
    ]
    joints = [
        replace(
            one,
            xyz=long(one.xyz),
            link=replace(one.link, com=long(one.link.com), inertia=wide(one.link.inertia)),
        )
        for one in vehicle.joints
    ]
    feet = replace(vehicle.feet, positions=tuple(map(long, vehicle.feet.positions)))
    parts = [
        replace(
            one,
            position=long(one.position),
            end=None if one.end is None else long(one.end),
            radius=SCALE * one.radius,
        )
        for one in vehicle.parts
    ]
    points = [replace(one, position=long(one.position)) for one in vehicle.critical_points]
    tip = replace(vehicle.end_effector, position=long(vehicle.end_effector.position))
    return replace(
        vehicle,
        base=base,
        rotors=tuple(rotors),
        joints=tuple(joints),
        feet=feet,
        parts=tuple(parts),
        critical_points=tuple(points),
        end_effector=tip,
    )


@pytest.mark.long
@pytest.mark.requirement("REQ-SAFE-1")
def test_margins_are_those_of_its_true_points(tmp_path: Path) -> None:
    file = tmp_path / "larger.toml"
    file.write_text(vehicle_text(larger(load_vehicle("paper"))), encoding="utf-8")
    scenario = replace(with_vehicle(load_scenario("walls"), str(file)), duration_s=SECONDS)
    vehicle = vehicle_of(scenario)
    assert vehicle.joints[1].xyz[2] == pytest.approx(SCALE * load_vehicle("paper").joints[1].xyz[2])
    model = pinocchio_model(vehicle)
    data, worst = model.createData(), []

    def look(simulation: Simulation, _: TickInputs, __: TickOutputs) -> None:
        truth = simulation.truth()
        q = configuration(np.array(truth.p_WB), np.array(truth.q_WB), np.array(truth.q_arm))
        pin.forwardKinematics(model, data, q)
        places = [
            data.oMi[1 + vehicle.places[one.on]].act(np.array(one.position))
            for one in vehicle.critical_points
        ]
        margins = [
            float(np.dot(wall.normal, place)) - wall.offset_m - wall.clearance_m
            for wall in scenario.walls
            for place in places
        ]
        assert truth.margins_m == pytest.approx(margins, abs=1e-9)
        worst.append(min(margins))

    result = simulate(scenario, 0, flight_config(body=scenario.body, vehicle=vehicle), seen=look)
    assert result.truth.completed, result.truth.end_reason
    assert len(worst) == pytest.approx(SECONDS / 0.002, abs=5)
    # The referee looks twice as often.
    assert result.truth.min_margin_m is not None
    assert 0.0 < result.truth.min_margin_m <= min(worst) < result.truth.min_margin_m + 5e-4
