"""A zone that the tool may touch: what is felt, what is judged, what is refused."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from messages import dialect
from messages.frames import split
from sitl.link.encode import StepEncoder
from sitl.link.pilot_messages import Announce
from sitl.plant.contact import Law, contact_force
from sitl.plant.trim import end_effector
from sitl.result import EndKind
from sitl.scenario import Hold, Pilot, Push, Scenario, Start, Touch, WayPoint, Wind
from sitl.scenario_file import ScenarioError, parse_scenario
from sitl.scenario_text import scenario_text
from sitl.scenario_validation import check
from sitl.sensors.force_torque import WrenchMeasurement
from sitl.shapes.ball import Ball
from sitl.shapes.half_space import HalfSpace
from sitl.simulation import Controls, Simulation
from sitl.trajectory import PressingReference, reference
from sitl.world import World
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.vehicles import PAPER

RADIUS = 0.1  # m, of a ball under the vehicle, between its legs
GAP = 0.01  # m, between it and the tip
PLACE = (0.0, 0.0, -1.2)
TOUCH = Touch(stiffness_n_m=1000.0, stiffness_range_n_m=(500.0, 2000.0), force_max_n=10.0)
KNOB = Ball(
    name="knob",
    centre_m=(0.0, 0.0, -1.2 + 0.025 + GAP + RADIUS),
    radius_m=RADIUS,
    clearance_m=0.02,
    touch=TOUCH,
)


def sinking(knob: Ball = KNOB, **changes: Any) -> Scenario:
    """Hovering over a knob, while a wind pushes the vehicle down."""
    scenario = Scenario("knob", 2.0, Start("airborne"), Pilot("trajectory"), Hold(PLACE))
    wind = Wind((0.0, 0.0, 0.5))
    given = {"zones": (knob,), "disturbances": (wind,), **changes}
    return replace(scenario, **given)


def trimmed(simulation: Simulation) -> Controls:
    thrust = [
        t / rotor.thrust_max
        for t, rotor in zip(simulation.trim.thrust, simulation.vehicle.rotors, strict=True)
    ]
    torque = [
        t / joint.torque_max
        for t, joint in zip(simulation.trim.torque, simulation.vehicle.joints, strict=True)
    ]
    return Controls(tuple(thrust), tuple(torque), armed=True)


def flown(scenario: Scenario, seconds: float) -> Simulation:
    simulation = Simulation(scenario, 1)
    controls = trimmed(simulation)
    while simulation.ended is None and simulation.time_s < seconds:
        simulation.advance(controls)
    return simulation


def test_the_tip_may_touch_and_what_it_feels_is_in_the_truth() -> None:
    simulation = Simulation(sinking(), 1)
    controls, largest = trimmed(simulation), 0.0
    while simulation.time_s < 0.6:
        simulation.advance(controls)
        truth, normal = simulation.truth(), simulation.touch.normal()
        largest = max(largest, normal)
        gap = float(np.linalg.norm(np.subtract(truth.p_WE, KNOB.centre_m))) - RADIUS - 0.025
        assert (normal > 0.0) == (gap < 0.0)
        assert simulation.touch.force()[2] <= 0.0
    assert simulation.ended is None
    use = simulation.result().touches["knob"]
    assert largest > 0.5
    assert use.force_max_n == pytest.approx(largest, rel=0.02)
    assert use.force_margin_n == 10.0 - use.force_max_n
    assert use.contacts >= 1
    assert 0.0 < use.contact_s < 0.6
    assert "knob/end_effector" not in simulation.world.keys
    assert simulation.world.clearances[simulation.world.keys.index("knob/link2")] == 0.0


def test_a_zone_without_touch_ends_the_flight() -> None:
    simulation = flown(sinking(replace(KNOB, touch=None, clearance_m=0.001)), 2.0)
    assert simulation.ended is not None
    assert simulation.ended.kind is EndKind.COLLISION
    assert simulation.ended.sentence.startswith("the end-effector hit the knob")
    assert simulation.result().touches == {}


def test_another_part_that_touches_ends_the_flight() -> None:
    ahead = replace(KNOB, centre_m=(0.6, 0.2, -1.13))
    simulation = Simulation(sinking(ahead), 1)
    simulation.state[3] = 2.0  # m/s north, a foreleg on its way
    while simulation.ended is None:
        simulation.advance(trimmed(simulation))
    assert simulation.ended.kind is EndKind.COLLISION
    assert simulation.ended.sentence.startswith("leg 1 hit the knob")


def test_a_force_beyond_its_bound_is_a_flaw() -> None:
    soft = replace(KNOB, touch=replace(TOUCH, force_max_n=0.3))
    result = flown(sinking(soft), 0.5).result()
    use = result.touches["knob"]
    assert use.force_margin_n < 0.0
    assert not result.completed
    assert f"the tool pressed on the knob with {use.force_max_n:.2f} N" in result.end_reason


def test_a_zone_that_comes_is_touched_where_it_is_then() -> None:
    still = sinking(disturbances=())
    assert flown(still, 0.4).result().touches["knob"].contacts == 0
    rising = replace(KNOB, velocity_m_s=(0.0, 0.0, -0.1), starts_s=0.1)
    simulation = flown(sinking(rising, zones=(rising,), disturbances=()), 0.4)
    use = simulation.result().touches["knob"]
    assert use.contacts >= 1
    assert use.force_max_time_s > 0.19


def test_the_force_that_was_asked_for_is_compared() -> None:
    press = Push(normal=(0.0, 0.0, -1.0), position_m=(PLACE,), force_n=(5.0,), hold_s=(10.0,),
                 approach_s=0.1, ramp_s=0.1)  # fmt: skip
    far = replace(KNOB, centre_m=(0.0, 0.0, -0.2))
    scenario = replace(sinking(far), trajectory=press, disturbances=())
    result = flown(scenario, 1.5).result()
    assert result.force_error_rms_n == result.force_asked_rms_n  # it never touched
    assert result.force_asked_rms_n == pytest.approx(5.0, rel=0.1)
    assert flown(sinking(), 0.1).result().force_error_rms_n is None


def test_a_vehicle_that_rests_on_a_spring_sinks_by_its_weight() -> None:
    law = Law(1000.0, 4.0, 0.5, 0.01)
    depth = PAPER.mass * 9.81 / law.stiffness
    force = contact_force(law, depth, (0.0, 0.0, -1.0), (0.0, 0.0, 0.0))
    assert force == pytest.approx((0.0, 0.0, -PAPER.mass * 9.81))


PRESS = Push(
    normal=(-1.0, 0.0, 0.0),
    position_m=((0.9, 0.0, -1.0), (0.9, 0.5, -1.0)),
    force_n=(5.0, 3.0),
    hold_s=(3.0, 2.0),
    slide_m=((0.0, 0.0, 0.0), (0.0, 0.2, 0.0)),
)


def test_a_push_approaches_presses_slides_and_retreats() -> None:
    curve = reference(PRESS)
    assert isinstance(curve, PressingReference)
    assert curve.at(0.0).p == pytest.approx((0.75, 0.0, -1.0))
    for t, place, force in (
        (3.0, (0.9, 0.0, -1.0), 0.0),
        (3.5, (0.9, 0.0, -1.0), 2.5),
        (5.0, (0.9, 0.0, -1.0), 5.0),
        (8.0, (0.9, 0.0, -1.0), 0.0),
        (11.0, (0.75, 0.0, -1.0), 0.0),
        (16.0, (0.75, 0.5, -1.0), 0.0),
        (19.0, (0.9, 0.5, -1.0), 0.0),
        (21.0, (0.9, 0.6, -1.0), 3.0),
        (23.0, (0.9, 0.7, -1.0), 0.0),
        (26.0, (0.75, 0.7, -1.0), 0.0),
        (99.0, (0.75, 0.7, -1.0), 0.0),
    ):
        point = curve.at(t)
        assert point.p == pytest.approx(place)
        assert point.force == pytest.approx(force)
        assert curve.place(t) == point.p
    step = 1e-5
    for t in np.arange(0.37, 26.0, 0.53):
        before, at, after = (curve.at(t + k * step) for k in (-1, 0, 1))
        slope = np.subtract(after.p, before.p) / (2.0 * step)
        np.testing.assert_allclose(at.v, slope, atol=1e-6)
        bend = np.subtract(after.v, before.v) / (2.0 * step)
        np.testing.assert_allclose(at.a, bend, atol=1e-6)


@pytest.mark.parametrize(
    ("changes", "says"),
    [
        ({"force_n": (5.0,)}, r"trajectory\.force_n: 1 entries for 2 places"),
        ({"slide_m": ((0.0,) * 3,)}, r"trajectory\.slide_m: 1 entries for 2 places"),
        ({"position_m": ()}, r"trajectory\.position_m: must have 1 to 50, has 0"),
        ({"normal": (-1.0, 0.2, 0.0)}, r"trajectory\.normal = .*must have length 1"),
        ({"slide_m": ((0.1, 0.0, 0.0),) * 2}, r"must be along the surface, is -100\.0 mm"),
    ],
)
def test_a_push_that_is_none_is_refused(changes: dict[str, Any], says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        check(replace(sinking(), trajectory=replace(PRESS, **changes)))


@pytest.mark.parametrize(
    ("zone", "says"),
    [
        (replace(KNOB, keep_in=True, radius_m=5.0), r"zones\[0\]\.touch: only of a zone to stay"),
        (
            replace(KNOB, touch=replace(TOUCH, stiffness_range_n_m=(900.0, 100.0))),
            r"zones\[0\]\.touch\.stiffness_range_n_m = \[900, 100\]: must be the least, then",
        ),
    ],
)
def test_a_zone_that_cannot_be_touched_as_it_says_is_refused(zone: Ball, says: str) -> None:
    with pytest.raises(ScenarioError, match=says):
        check(sinking(zone))


def test_more_zones_than_there_is_room_for_are_refused() -> None:
    many = tuple(replace(KNOB, name=f"knob{k}") for k in range(9))
    with pytest.raises(ScenarioError, match="zones: 9 have touch, must be at most 8"):
        check(replace(sinking(), zones=many))


def test_contact_that_is_too_stiff_is_refused_with_what_to_do() -> None:
    hard = replace(KNOB, touch=replace(TOUCH, stiffness_n_m=1e5, friction=2.0, force_max_n=200.0))
    with pytest.raises(ScenarioError, match=r"lower stiffness, friction or force_max"):
        Simulation(sinking(hard), 1)


def test_a_file_says_all_of_it() -> None:
    moving = replace(KNOB, way_points=(WayPoint(1.0, (0.0, 0.0, 0.1)),))
    scenario = replace(sinking(moving), trajectory=PRESS)
    text = scenario_text(scenario)
    assert "[zones.touch]" in text
    assert parse_scenario(text, "knob") == scenario
    with pytest.raises(ScenarioError, match=r'unknown key "zones\[0\]\.touch\.stiffness"'):
        parse_scenario(text.replace("stiffness_n_m =", "stiffness ="), "knob")


def test_a_normal_of_few_digits_is_made_a_unit() -> None:
    text = scenario_text(replace(sinking(), trajectory=replace(PRESS, normal=(-0.6, 0.81, 0.0),
                                                               slide_m=())))  # fmt: skip
    curve = parse_scenario(text, "knob").trajectory
    assert isinstance(curve, Push)
    assert np.linalg.norm(curve.normal) == pytest.approx(1.0, abs=1e-12)


def test_a_shaft_may_touch_with_its_end_and_no_more() -> None:
    """The last link of the paper is 0.15 m long and 20 mm thick, its tip 25 mm."""
    wall = HalfSpace(
        name="wall", normal=(-1.0, 0.0, 0.0), offset_m=-1.0, clearance_m=0.1, touch=TOUCH
    )
    world = World(replace(sinking(), zones=(wall,)))
    base = np.array([0.5, 0.0, -1.0])
    simulation = Simulation(sinking(), 1)
    places = simulation.places()

    def margin(elbow: float, tip: float) -> float:
        now = places.copy()
        now[:, :] = base
        now[-3:] = np.eye(3)
        now[2], now[3] = (elbow, 0.0, -1.0), (tip, 0.0, -1.0)
        return world.margins(now, 0.0, None)[world.keys.index("wall/link2")]

    # A third of it, twice the tip's radius, is left out; the rest keeps no clearance.
    assert margin(0.84, 0.99) == pytest.approx(1.0 - (0.84 + 2.0 / 3.0 * 0.15) - 0.02)
    assert margin(0.97, 0.97) == pytest.approx(0.01)
    assert margin(0.985, 0.985) < 0.0  # lies against it


def test_the_vehicle_is_told_what_the_tool_meets() -> None:
    about = {"number": 1, "numbers": (0.0, 0.0, 0.0, 0.1), "velocity": (0.0,) * 3, "t_us": 5}
    placed = {"clearance_m": 0.1, "index": 0, "count": 1}
    plain = Announce(**about, **placed, keep_in=True)
    spoken = StepEncoder(lockstep=True).spoken((plain, replace(plain, touch=TOUCH)))
    values = [frame.payload_values for frame in split(spoken)]
    assert [one[26:] for one in values] == [
        (1, 0.0, 0.0, 0.0, 0.0, 0.0, 0),
        (3, 10.0, 500.0, 2000.0, 4.0, 0.5, 0),
    ]


def test_the_end_effector_is_where_the_tip_is() -> None:
    """What the scenarios above rest on."""
    simulation = Simulation(sinking(), 1)
    assert simulation.truth().p_WE == pytest.approx(PLACE)
    assert end_effector(PAPER, PAPER.home_posture)[2] == pytest.approx(0.225)


FELT = """
[sensors]
suite = "mocap"
[sensors.force_torque]
"""


def _wrenches(text: str, seconds: float = 0.6) -> tuple[Simulation, list[WrenchMeasurement]]:
    scenario = parse_scenario(scenario_text(sinking()) + text, "knob")
    simulation, said = Simulation(scenario, 1), list[WrenchMeasurement]()
    controls = trimmed(simulation)
    while simulation.time_s < seconds:
        said += [one for one in simulation.measurements() or () if type(one) is WrenchMeasurement]
        simulation.advance(controls)
    return simulation, said


def test_a_force_sensor_says_what_acts_on_the_tool_in_the_axes_of_its_link() -> None:
    exact = "latency_ms = 0.0\nforce_n = 0.0\ntorque_n_m = 0.0\nforce_bias_n = 0.0\n"
    exact += "torque_bias_n_m = 0.0\nforce_resolution_n = 0.0\ntorque_resolution_n_m = 0.0\n"
    scenario = parse_scenario(scenario_text(sinking()) + FELT + exact, "knob")
    simulation = Simulation(scenario, 1)
    controls, pressed = trimmed(simulation), 0
    model = pinocchio_model(PAPER)
    data, link = model.createData(), model.getFrameId("tool")
    while simulation.time_s < 0.6:
        arrived = simulation.measurements() or ()
        said = [one for one in arrived if type(one) is WrenchMeasurement][-1]
        truth = simulation.truth()
        q = configuration(np.array(truth.p_WB), np.array(truth.q_WB), np.array(truth.q_arm))
        pin.forwardKinematics(model, data, q)
        place = pin.updateFramePlacement(model, data, link)
        np.testing.assert_allclose(place.rotation @ said.force, simulation.touch.force(), atol=1e-9)
        # The force acts where the ball touches the knob.
        away = np.array(KNOB.centre_m) - place.translation
        away *= 1.0 - RADIUS / np.linalg.norm(away)
        torque = np.cross(away, simulation.touch.force())
        np.testing.assert_allclose(place.rotation @ said.torque, torque, atol=1e-9)
        pressed += simulation.touch.normal() > 0.0
        simulation.advance(controls)
    assert pressed > 10


def test_a_force_sensor_has_noise_and_a_bias_of_its_flight() -> None:
    simulation, said = _wrenches(FELT, 0.1)  # before it touches
    assert simulation.result().touches["knob"].contacts == 0
    forces = np.array([one.force for one in said])
    torques = np.array([one.torque for one in said])
    assert len(said) >= 50
    assert 0.01 < np.abs(forces.mean(axis=0)).max() < 0.8
    assert forces.std(axis=0) == pytest.approx(np.full(3, 0.05), rel=0.5)
    assert torques.std(axis=0) == pytest.approx(np.full(3, 0.002), rel=0.5)
    grid = forces / 0.0125
    np.testing.assert_allclose(grid, np.round(grid), atol=1e-6)


def test_a_force_sensor_changes_nothing_that_others_say() -> None:
    plain = 'suite = "mocap"\n'
    both = [
        parse_scenario(scenario_text(sinking()) + text, "knob")
        for text in (f"[sensors]\n{plain}", FELT)
    ]
    first, second = (Simulation(one, 1) for one in both)
    for _ in range(20):
        ours = [one for one in second.measurements() or () if type(one) is not WrenchMeasurement]
        assert list(first.measurements() or ()) == ours
        for simulation in (first, second):
            simulation.advance(trimmed(simulation))


def test_a_force_sensor_is_on_the_wire() -> None:
    one = WrenchMeasurement(5000, (1.0, -2.0, 3.0), (0.25, 0.5, -0.75))
    _, datagram = StepEncoder(lockstep=True, measured=True).measured_datagrams(6000, (one,), ())
    first = split(datagram)[0]
    assert first.message_id == dialect.MAVLINK_MSG_ID_FORCE_TORQUE
    assert first.payload_values == (5000, *one.force, *one.torque)


def test_the_exact_suite_has_no_force_sensor() -> None:
    with pytest.raises(ScenarioError, match=r'unknown key "sensors\.force_torque"'):
        parse_scenario(scenario_text(sinking()) + "[sensors.force_torque]\n", "knob")
