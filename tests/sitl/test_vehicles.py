"""Vehicles that come with Pandion, and others, as the simulator flies them."""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from pyulog import ULog

from sitl.body import as_arrays, parts_of
from sitl.faults.keys import KINDS, Fault
from sitl.plant.integrator import STEP_S, held, integrate, places
from sitl.plant.parameters import GRAVITY, plant
from sitl.plant.places import row_of, rows_of
from sitl.plant.state import at_rest
from sitl.plant.stiffness import FASTEST, fastest_rates
from sitl.plant.trim import end_effector, level_hover, standing_height
from sitl.plant.vector import Array
from sitl.result import EndKind
from sitl.scenario import Hold, Pilot, Scenario, Start, start_angles, vehicle_of
from sitl.scenario_file import (
    ScenarioError,
    load_scenario,
    parse_scenario,
    scenario_digest,
    with_vehicle,
)
from sitl.scenario_text import scenario_text
from sitl.scenario_validation import check
from sitl.simulation import Controls, Simulation
from sitl.truth_log import TruthLog
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView
from tests.sitl.vehicles import PAPER, inputs, random_vehicle
from vehicles.description import CriticalPoint, Vehicle
from vehicles.vehicle_file import PACKAGED, load_vehicle, parse_vehicle, vehicle_names

SHIPPED = vehicle_names()


def scenario(name: str, **changes: object) -> Scenario:
    """A vehicle that hovers high up, with no pilot."""
    hovering = Scenario(
        "hover", 600.0, Start("airborne"), Pilot("none"), Hold((0.0, 0.0, -20.0)), vehicle=name
    )
    return replace(hovering, **changes)  # type: ignore[arg-type]


def driven(vehicle: Vehicle, state: Array, thrust: object, torque: object, steps: int) -> Array:
    """Every state under constant commands [N, N·m]."""
    states = np.empty((steps, len(state)))
    room = (np.empty((steps, rows_of(vehicle), 3)), states, held())
    given = inputs(thrust, torque)  # type: ignore[arg-type]
    integrate(plant(vehicle), state.copy(), given, STEP_S, *room)
    return states


def hovering(vehicle: Vehicle, angles: tuple[float, ...]) -> Array:
    """Level at 20 m, trimmed, with the arm at ``angles`` [rad]."""
    state = at_rest(len(vehicle.rotors), len(vehicle.joints))
    view = StateView(state, len(vehicle.joints))
    view.p_WB[2] = -20.0
    view.q_arm[:] = angles
    view.thrust[:] = level_hover(vehicle, angles).thrust
    return state


@pytest.mark.parametrize("name", SHIPPED)
def test_a_vehicle_hovers_where_it_begins_with_the_thrust_of_its_trim(name: str) -> None:
    simulation = Simulation(scenario(name), 0)
    vehicle, trim = simulation.vehicle, simulation.trim
    lift = sum(-f * one.axis[2] for f, one in zip(trim.thrust, vehicle.rotors, strict=True))
    assert lift == pytest.approx(vehicle.mass * GRAVITY)
    full = sum(one.thrust_max for one in vehicle.rotors)
    assert 0.1 < vehicle.mass * GRAVITY / full < 0.8
    controls = Controls(
        tuple(f / one.thrust_max for f, one in zip(trim.thrust, vehicle.rotors, strict=True)),
        tuple(t / one.torque_max for t, one in zip(trim.torque, vehicle.joints, strict=True)),
        armed=True,
    )
    begin = simulation.truth()
    for _ in range(250):
        simulation.advance(controls)
    after = simulation.truth()
    assert math.dist(begin.p_WB, after.p_WB) < 1e-6
    assert math.dist(begin.p_WE, after.p_WE) < 1e-6
    assert begin.p_WE == pytest.approx((0.0, 0.0, -20.0), abs=1e-12)
    assert begin.q_arm == pytest.approx(start_angles(simulation.scenario))


@pytest.mark.parametrize("name", SHIPPED)
def test_a_limp_arm_falls_as_pinocchio_says(name: str) -> None:
    """Without friction, from the home posture, the rotors holding what they held."""
    vehicle = load_vehicle(name)
    joints = tuple(replace(one, viscous=0.0, coulomb=0.0) for one in vehicle.joints)
    vehicle, angles = replace(vehicle, joints=joints), vehicle.home_posture
    state, n = hovering(vehicle, angles), len(joints)
    trim = level_hover(vehicle, angles)
    states = driven(vehicle, state, trim.thrust, (), 50)
    model = pinocchio_model(vehicle)
    data, start = model.createData(), StateView(state, n)
    q, v = configuration(start.p_WB, start.q_WB, start.q_arm), np.zeros(6 + n)
    held_up = sum(
        f * np.array(one.axis) for f, one in zip(trim.thrust, vehicle.rotors, strict=True)
    )
    turn = np.zeros(3)
    for f, one in zip(trim.thrust, vehicle.rotors, strict=True):
        km = one.torque_per_thrust if one.spin == "ccw" else -one.torque_per_thrust
        turn += f * (np.cross(one.position, one.axis) - km * np.array(one.axis))
    load = np.concatenate([held_up, turn, np.zeros(n)])
    fine = 20
    for _ in range(50 * fine):  # symplectic Euler in small steps
        v = v + STEP_S / fine * np.asarray(pin.aba(model, data, q, v, load))
        q = pin.integrate(model, q, STEP_S / fine * v)
    fallen = StateView(states[-1], n)
    assert np.abs(np.array(angles) - fallen.q_arm).max() > 0.01
    assert fallen.q_arm == pytest.approx(q[7:], abs=1e-3 * np.abs(q[7:] - angles).max())


@pytest.mark.parametrize("name", SHIPPED)
@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_full_torque_throws_no_joint_far_beyond_its_stop(name: str, sign: float) -> None:
    vehicle = load_vehicle(name)
    state, n = hovering(vehicle, vehicle.home_posture), len(vehicle.joints)
    worst = 0.0
    for k in range(n):
        torque = [0.0] * n
        torque[k] = sign * vehicle.joints[k].torque_max
        states = driven(
            vehicle, state, level_hover(vehicle, vehicle.home_posture).thrust, torque, 800
        )
        assert np.isfinite(states).all()
        most = vehicle.joints[k].position_max + vehicle.end_stops.beyond
        worst = max(worst, float(np.abs(states[:, -2 * n + k]).max()) - most)
    assert worst < math.radians(20.0)


@pytest.mark.parametrize("name", SHIPPED)
def test_a_limp_arm_hangs_free_while_the_vehicle_stands(name: str) -> None:
    ground = replace(load_scenario("ground"), vehicle=name)
    simulation = Simulation(ground, 0)
    vehicle = simulation.vehicle
    assert -simulation.truth().p_WB[2] == pytest.approx(standing_height(vehicle))
    for _ in range(500):
        simulation.advance(Controls.off(vehicle))
    assert simulation.ended is None
    assert -simulation.truth().p_WB[2] == pytest.approx(standing_height(vehicle), abs=1e-3)
    assert math.hypot(*simulation.truth().v_WB) < 1e-3


@pytest.mark.parametrize("name", SHIPPED)
def test_the_plant_follows_friction_and_stops(name: str) -> None:
    assert max(fastest_rates(load_vehicle(name))) < FASTEST


def test_what_the_plant_cannot_follow_is_refused_with_what_to_do(tmp_path: Path) -> None:
    stiff = replace(PAPER, end_stops=replace(PAPER.end_stops, damping=3.0))
    friction, stops, feet = fastest_rates(stiff)
    assert max(friction, feet) < FASTEST < stops
    joints = tuple(replace(one, coulomb=0.05) for one in PAPER.joints)
    friction, stops, feet = fastest_rates(replace(PAPER, joints=joints))
    assert max(stops, feet) < FASTEST < friction
    assert fastest_rates(replace(PAPER, joints=joints), 0.01)[0] < FASTEST
    text = (PACKAGED / "paper.toml").read_text(encoding="utf-8")
    rough = tmp_path / "rough.toml"
    rough.write_text(text.replace("coulomb = 0.01", "coulomb = 0.05"), encoding="utf-8")
    # A period of two steps: feet that hold as hard as a step can follow keep the base where it is.
    tall = load_vehicle("hexa-3r")
    assert fastest_rates(replace(tall, feet=replace(tall.feet, slip_rate=0.03)))[2] > FASTEST
    with pytest.raises(ScenarioError, match=r"the joints' friction would move it at .* divide"):
        Simulation(scenario(str(rough)), 0)


@pytest.mark.parametrize("rotors", range(4, 9))
def test_any_number_of_rotors_and_joints_flies_with_a_suite_and_faults(rotors: int) -> None:
    """In one process, with every kind of a motor's and a joint's fault; nothing diverges."""
    vehicle = random_vehicle(rotors - 3, rotors, np.random.default_rng(rotors))
    faults = [Fault("motor", kind, 0.02, 0.05, instance=float(rotors)) for kind in KINDS["motor"]]
    faults += [Fault("joint", "stuck", 0.05, instance=1.0), Fault("encoder", "noisy", 0.0)]
    flown = load_scenario("ground", "mocap")
    with patched(vehicle):
        simulation = Simulation(replace(flown, faults=tuple(faults), vehicle="random"), 0)
        controls = Controls.off(vehicle)._replace(thrust=(0.4,) * rotors, armed=True)
        for _ in range(100):
            simulation.measurements()
            simulation.advance(controls)
            simulation.catch_up()
        truth = simulation.truth()
    assert np.isfinite(simulation.state).all()
    assert len(truth.thrust) == rotors
    assert len(truth.q_arm) == rotors - 3
    assert truth.qd_arm[0] == 0.0, "it is stuck"


@contextmanager
def patched(vehicle: Vehicle) -> Iterator[None]:
    """Let the name "random" be of this vehicle."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr("sitl.scenario._vehicle", lambda name, _: vehicle)
        yield


def test_a_fault_of_a_motor_that_is_not_there_is_refused() -> None:
    for name, most in (("paper", 4), ("octo-4r", 8)):
        fine = replace(scenario(name), faults=(Fault("motor", "off", instance=float(most)),))
        check(fine)
    wrong = replace(scenario("paper"), faults=(Fault("motor", "off", instance=5.0),))
    with pytest.raises(ScenarioError, match=r"faults\[0\].instance = 5: must be 0 \(all\) to 4"):
        check(wrong)


def test_a_scenario_names_its_vehicle_or_a_file_beside_it(tmp_path: Path) -> None:
    given = load_scenario("ground")
    assert given.vehicle == "paper"
    text = scenario_text(scenario("octo-4r"))
    assert 'vehicle = "octo-4r"' in text
    assert parse_scenario(text, "hover") == scenario("octo-4r")
    mine = tmp_path / "mine.toml"
    mine.write_text((PACKAGED / "hexa-3r.toml").read_text(encoding="utf-8"), encoding="utf-8")
    place = tmp_path / "place.toml"
    place.write_text('vehicle = "mine.toml"\n' + scenario_text(scenario("paper")))
    found = load_scenario(str(place))
    assert vehicle_of(found).joints == load_vehicle("hexa-3r").joints
    before = scenario_digest(str(place))
    mine.write_text(mine.read_text().replace("mass = 2.0128", "mass = 2.5"))
    assert scenario_digest(str(place)) != before
    assert vehicle_of(found).base.mass == 2.5, "the file is read again when it has changed"


@pytest.mark.parametrize(
    ("name", "sentence"),
    [("papr", 'vehicle: unknown vehicle "papr", did you mean "paper"'),
     ("none.toml", "vehicle: cannot read vehicle")],
)  # fmt: skip
def test_a_vehicle_that_is_not_there_is_refused(name: str, sentence: str, tmp_path: Path) -> None:
    place = tmp_path / "place.toml"
    place.write_text(f'vehicle = "{name}"\n' + scenario_text(scenario("paper")))
    with pytest.raises(ScenarioError) as error:
        check(load_scenario(str(place)))
    assert sentence in str(error.value)


@pytest.mark.parametrize("name", SHIPPED)
def test_parts_are_no_farther_away_than_their_reach(name: str) -> None:
    """Or a step could be taken for clear that is not."""
    vehicle = load_vehicle(name)
    parts = as_arrays(parts_of("full", vehicle), vehicle)
    random, numbers, out = (
        np.random.default_rng(1),
        plant(vehicle),
        np.empty((1, parts.axes + 3, 3)),
    )
    state, n = at_rest(len(vehicle.rotors), len(vehicle.joints)), len(vehicle.joints)
    for _ in range(200):
        StateView(state, n).q_arm[:] = random.uniform(-math.pi, math.pi, n)
        places(numbers, state, held(), out)
        begins = out[0, parts.row] + parts.local @ out[0, parts.axes :]
        away = np.linalg.norm(begins, axis=2).max(axis=1) + parts.radius
        assert away.max() <= parts.reach + 1e-12


def test_a_critical_point_anywhere_on_a_link_is_judged() -> None:
    """It gets a row of its own, and may touch the ground."""
    low = CriticalPoint(name="probe", on="joint1", position=(0.0, 0.1, 0.6))
    vehicle = replace(PAPER, critical_points=(*PAPER.critical_points, low))
    assert rows_of(vehicle) == rows_of(PAPER) + 1
    assert row_of(vehicle, 1, low.position) == 4
    near = replace(scenario("random"), trajectory=Hold((0.0, 0.0, -0.15)))
    with patched(vehicle):
        simulation = Simulation(near, 0)
        assert "probe" not in " ".join(simulation.world.keys), "a point is no part of the body"
        for _ in range(5):
            simulation.advance(Controls.off(vehicle))
    assert simulation.ended is not None
    assert simulation.ended.kind is EndKind.COLLISION
    assert "the probe hit the ground" in simulation.ended.sentence


def test_the_sphere_of_a_workspace_is_where_the_home_posture_has_the_base() -> None:
    """A longer arm than paper's would begin outside of it."""
    for name in vehicle_names():
        scenario = load_scenario("workspace", None, name)
        assert scenario.workspace is not None
        vehicle = vehicle_of(scenario)
        ahead, _, down = end_effector(vehicle, vehicle.home_posture)
        assert math.isclose(scenario.workspace.d_iw_m, down, abs_tol=1e-9)
        if ahead > 0.5:  # an arm that reaches beyond the rotors has its base nowhere above its tool
            with pytest.raises(ScenarioError, match="starts outside its safe set"):
                Simulation(scenario, 0)
        else:
            Simulation(scenario, 0)


def test_another_vehicle_flies_a_scenario_in_its_own_posture_or_is_refused() -> None:
    walls = replace(load_scenario("walls"), start=Start("airborne", arm_deg=(10.0, 20.0)))
    found = with_vehicle(walls, "octo-4r")
    assert start_angles(found) == vehicle_of(found).home_posture
    assert len(start_angles(found)) == 4
    with pytest.raises(ScenarioError, match='vehicle: unknown vehicle "octo"'):
        with_vehicle(walls, "octo")


@pytest.mark.parametrize("name", SHIPPED)
def test_the_log_of_the_truth_has_the_state_of_any_vehicle(name: str, tmp_path: Path) -> None:
    path = tmp_path / "truth.ulg"
    simulation = Simulation(scenario(name), 0)
    log = TruthLog(path, simulation.scenario, 0, lambda sentence: pytest.fail(sentence))
    for _ in range(60):
        log.add(simulation)
        simulation.advance(Controls.off(simulation.vehicle))
    log.close()
    log_read = ULog(str(path))
    told = log_read.msg_info_dict
    assert parse_vehicle(told["vehicle_file"], told["vehicle"]) == simulation.vehicle
    data = {one.name: one.data for one in log_read.data_list}["sim_ground_truth"]
    truth, last = simulation.truth(), 59
    assert len(data["timestamp"]) == 60
    assert f"thrust[{len(truth.thrust) - 1}]" in data
    assert f"thrust[{len(truth.thrust)}]" not in data
    assert f"qd_arm[{len(truth.q_arm) - 1}]" in data
    assert data["p_WB[2]"][last] == pytest.approx(truth.p_WB[2], abs=0.01)
    assert data["q_arm[1]"][0] == simulation.vehicle.home_posture[1]
