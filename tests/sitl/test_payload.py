"""A payload that is taken up and let go of: momentum, weight, when and where."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from messages import dialect
from messages.frames import FrameWriter
from sitl.link.decode import read_reply
from sitl.plant.integrator import held, integrate
from sitl.plant.parameters import GRAVITY, Effects, plant
from sitl.plant.payload import last_link, put_link, take_up, with_payload
from sitl.plant.places import rows_of
from sitl.plant.vector import Array
from sitl.scenario import Hold, Payload, Pilot, Scenario, Start
from sitl.scenario_file import ScenarioError, parse_scenario
from sitl.scenario_text import scenario_text
from sitl.scenario_validation import check
from sitl.simulation import Controls, Simulation
from tests.sitl.free_motion import tumbling
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView
from tests.sitl.test_touchable_zones import trimmed
from tests.sitl.vehicles import PAPER, frictionless, inputs, random_vehicle
from vehicles.description import Vehicle

MASS, INERTIA, OFFSET = 0.3, (2e-4, 3e-4, 4e-4), (0.01, -0.02, 0.03)
PLACE = (0.0, 0.0, -1.2)
PACKAGE = Payload(mass_kg=MASS, inertia_kg_m2=INERTIA, offset_m=OFFSET)
_SPATIAL = frictionless(random_vehicle(6, 8, np.random.default_rng(6)))
SPATIAL = replace(_SPATIAL, joints=tuple(replace(one, armature=0.0) for one in _SPATIAL.joints))
BOTH = pytest.mark.parametrize("vehicle", [frictionless(), SPATIAL], ids=["paper", "six joints"])


def hovering(payload: Payload | None = PACKAGE) -> Scenario:
    scenario = Scenario("package", 2.0, Start("airborne"), Pilot("trajectory"), Hold(PLACE))
    return replace(scenario, payload=payload)


def _momentum(vehicle: Vehicle, state: Array, *, loaded: bool) -> tuple[Array, float]:
    """Linear, and angular about the world's origin, (6,), and kinetic energy [J]; by Pinocchio."""
    model = pinocchio_model(vehicle, 0.0)
    if loaded:
        centre = np.array(vehicle.end_effector.position) + OFFSET
        package = pin.Inertia(MASS, centre, np.diag(INERTIA))
        model.inertias[model.njoints - 1] += package
    data, view = model.createData(), StateView(state, len(vehicle.joints))
    q = configuration(view.p_WB, view.q_WB, view.q_arm)
    v_B = pin.Quaternion(q[3:7]).toRotationMatrix().T @ view.v_WB
    v = np.concatenate([v_B, view.w_WB_B, view.qd_arm])
    about_centre = np.array(pin.computeCentroidalMomentum(model, data, q, v).vector)
    angular = about_centre[3:] + np.cross(data.com[0], about_centre[:3])
    energy = float(pin.computeKineticEnergy(model, data, q, v))
    return np.concatenate([about_centre[:3], angular]), energy


def _taken(vehicle: Vehicle, state: Array) -> Any:
    numbers: Any = plant(vehicle, Effects())
    link = with_payload(last_link(numbers, vehicle), vehicle, MASS, INERTIA, OFFSET)
    take_up(numbers, held(), state, link, len(vehicle.joints))
    return numbers


@BOTH
def test_momentum_is_kept_and_energy_lost_when_it_is_taken_up(vehicle: Vehicle) -> None:
    state = tumbling(vehicle)
    before, energy = _momentum(vehicle, state, loaded=False)
    _taken(vehicle, state)
    after, left = _momentum(vehicle, state, loaded=True)
    np.testing.assert_allclose(after, before, rtol=1e-10, atol=1e-9)
    assert left < 0.99 * energy


@BOTH
def test_its_weight_and_inertia_act_at_once(vehicle: Vehicle) -> None:
    state = tumbling(vehicle)
    numbers = _taken(vehicle, state)
    before, _ = _momentum(vehicle, state, loaded=True)
    places = np.empty((100, rows_of(vehicle), 3))
    integrate(numbers, state, inputs(), 0.001, places, np.empty((100, len(state))), held())
    after, _ = _momentum(vehicle, state, loaded=True)
    gained = np.array([0.0, 0.0, 0.1 * (vehicle.mass + MASS) * GRAVITY])
    np.testing.assert_allclose(after[:3] - before[:3], gained, atol=1e-7)


def test_a_locked_joint_stays_at_rest_and_takes_up_the_impulse() -> None:
    vehicle, state = frictionless(), tumbling(frictionless())
    view = StateView(state, 2)
    view.qd_arm[1] = 0.0
    numbers: Any = plant(vehicle, Effects())
    numbers.locked[1] = 1.0
    link = with_payload(last_link(numbers, vehicle), vehicle, MASS, INERTIA, OFFSET)
    before, _ = _momentum(vehicle, state, loaded=False)
    take_up(numbers, held(), state, link, 2)
    after, _ = _momentum(vehicle, state, loaded=True)
    assert view.qd_arm[1] == 0.0
    np.testing.assert_allclose(after, before, rtol=1e-10, atol=1e-9)


def test_a_link_that_has_let_go_is_as_it_was() -> None:
    numbers, before = plant(PAPER), plant(PAPER)
    bare = last_link(numbers, PAPER)
    put_link(numbers, with_payload(bare, PAPER, MASS, INERTIA, OFFSET), 2)
    assert numbers != before
    put_link(numbers, bare, 2)
    assert numbers == before


def _flown(payload: Payload, seconds: float, gripper: float = 0.0) -> Simulation:
    simulation = Simulation(hovering(payload), 1)
    controls = trimmed(simulation)._replace(gripper=gripper)
    while simulation.time_s < seconds - 1e-9:
        simulation.advance(controls)
    return simulation


def test_it_is_taken_and_released_by_time() -> None:
    timed = replace(PACKAGE, attach_at_s=0.1, release_at_s=0.2)
    before, during, after = (_flown(timed, t) for t in (0.1, 0.15, 0.3))
    assert before.payload.held_kg == 0.0
    assert during.payload.held_kg == MASS
    sinks, _ = _momentum(PAPER, during.state, loaded=True)
    assert sinks[2] == pytest.approx(0.05 * MASS * GRAVITY, rel=0.01)
    use = after.result().payload
    assert use is not None
    assert (use.mass_kg, use.taken_s) == (MASS, pytest.approx(0.1))
    assert use.released_s == pytest.approx(0.2)
    assert use.released_m is not None
    assert math.dist(use.released_m, PLACE) < 0.05
    let_go, _ = _momentum(PAPER, after.state, loaded=False)
    after.advance(trimmed(after))
    later, _ = _momentum(PAPER, after.state, loaded=False)
    assert later[2] == pytest.approx(let_go[2], abs=2e-3)  # its weight is gone


def test_the_gripper_takes_it_and_lets_go() -> None:
    gripped = replace(PACKAGE, gripper=True)
    assert _flown(gripped, 0.1).payload.held_kg == 0.0
    simulation = _flown(gripped, 0.1, 1.0)
    assert simulation.payload.held_kg == MASS
    simulation.advance(trimmed(simulation))
    assert simulation.payload.held_kg == MASS  # until it is told to open
    simulation.advance(trimmed(simulation)._replace(gripper=-1.0))
    assert simulation.payload.held_kg == 0.0
    simulation.advance(trimmed(simulation)._replace(gripper=1.0))
    assert simulation.payload.held_kg == 0.0  # it has fallen


@pytest.mark.parametrize(("away", "kg"), [(0.02, MASS), (0.04, 0.0)])
def test_only_what_is_within_reach_is_taken(away: float, kg: float) -> None:
    there = (0.0, away, -1.2)
    lying = replace(PACKAGE, gripper=True, position_m=there)
    assert _flown(lying, 0.01, 1.0).payload.held_kg == kg


def test_a_flight_without_one_has_none() -> None:
    simulation = Simulation(hovering(None), 1)
    assert not simulation.payload
    assert simulation.result().payload is None


def test_the_link_says_what_the_gripper_is_told() -> None:
    writer, shares = FrameWriter(1, 1), (0.5,) * 4 + (0.1, 0.2) + (0.0,) * 9
    number = dialect.MAVLINK_MSG_ID_HIL_ACTUATOR_CONTROLS
    for gripper in (0.0, 1.0, -1.0):
        frame = writer.frame(number, 4000, 0, *shares, gripper, 128)
        reply = read_reply(frame, PAPER)
        assert reply is not None
        assert reply.controls.gripper == gripper
        assert reply.controls.thrust == (0.5,) * 4


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"attach_at_s": 2.0, "release_at_s": 1.0}, r"payload\.release_at_s = 1: must be after"),
        ({"gripper": True, "attach_at_s": 2.0}, r"payload\.gripper: in place of attach_at_s"),
        ({"inertia_kg_m2": (1e-4, 1e-4, 1e-3)}, r"none of a rigid body is more than the other"),
    ],
)
def test_a_payload_that_cannot_be_is_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        check(hovering(replace(PACKAGE, **changes)))


@pytest.mark.parametrize(
    ("pilot", "says"),
    [
        (Pilot("trajectory", grab_s=3.0, release_s=3.0), r"release_s = 3: must be later than grab"),
        (Pilot("trajectory", release_s=3.0), r"must be later than grab_s, inf"),
    ],
)
def test_a_gripper_that_opens_before_it_closes_is_refused(pilot: Pilot, says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        check(replace(hovering(), pilot=pilot))
    check(replace(hovering(), pilot=Pilot("trajectory", grab_s=3.0, release_s=4.0)))


def test_a_file_says_all_of_it() -> None:
    scenario = hovering(replace(PACKAGE, position_m=(0.1, 0.2, -1.0), gripper=True))
    text = scenario_text(scenario)
    assert "[payload]" in text
    assert parse_scenario(text, "package") == scenario
    with pytest.raises(ScenarioError, match=r"payload\.mass_kg = 0\.6: must be 0\.001 to 0\.5"):
        parse_scenario(text.replace("mass_kg = 0.3", "mass_kg = 0.6"), "package")


def test_controls_of_a_disarmed_vehicle_leave_the_gripper_alone() -> None:
    assert Controls.off(PAPER).gripper == 0.0
