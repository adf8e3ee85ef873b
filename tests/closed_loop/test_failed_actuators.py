"""Rotors and joints that fail in flight, through the closed loop: named, acted on, survived."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from fsw.autopilot.model.actuator_health import HEALTHY
from fsw.autopilot.signals import Mode
from sitl.faults.keys import Fault, Unit
from sitl.scenario import Scenario
from sitl.scenario_file import load_scenario
from studies.fault_matrix.flights import FaultFlight, fly
from studies.flight.closed_loop import simulate
from studies.paper import robustness
from studies.paper.settings import Settings
from tests.closed_loop.harness import ARM, Flight, command, hover

FAULT_S = 1.6
NAMES = ("rotor 1 (rear)", "rotor 2 (left)", "rotor 3 (front)", "rotor 4 (right)")


def flown(scenario: Scenario, fault: Fault, seconds: float, *, follows: bool = False) -> Flight:
    """A flight with a fault, until some time after it began."""
    flight = Flight(replace(scenario, faults=(replace(fault, start_s=FAULT_S),)))
    if follows:
        flight.follow()
    else:
        flight.step(command(ARM, 1.0))
    flight.run(FAULT_S + seconds)
    return flight


def told(flight: Flight) -> list[str]:
    return [text for text in flight.texts if "failed" in text]


@pytest.mark.requirement("REQ-ACT-1")
def test_a_weak_rotor_is_named_once_and_the_vehicle_lands_with_it() -> None:
    flight = flown(hover(), Fault("motor", "weak", instance=2.0, share=0.6), 1.2)
    (text,) = told(flight)
    assert text.startswith("failsafe: rotor failed: rotor 2 (left) gives 6")
    assert text.endswith("landing")
    assert flight.mode is Mode.LAND
    assert flight.snapshot.actuators_found.effect == pytest.approx(0.6, abs=0.05)
    estimate = flight.state.estimate
    assert estimate is not None
    assert math.degrees(math.acos(estimate.R_WB[8])) < 5.0
    assert flight.state.record.watch.aloft
    # The loops know what the rotor gives: they believe in the thrust that there is.
    assert flight.state.record.rotors[1] == pytest.approx(flight.state.record.rotors[3], abs=0.5)
    sent = flight.sent[-1].rotor_thrust
    assert sent[1] / sent[3] == pytest.approx(1.0 / 0.6, rel=0.15)


@pytest.mark.drawn(1)
@pytest.mark.requirement("REQ-ACT-1")
@pytest.mark.parametrize("suite", ["perfect", "mocap"])
@pytest.mark.parametrize("lost", ["encoder", "vio"])
def test_a_weak_rotor_is_named_without_encoders_or_poses(suite: str, lost: Unit) -> None:
    faults = (
        Fault(lost, "off", start_s=FAULT_S - 0.2),
        Fault("motor", "weak", instance=2.0, share=0.6, start_s=FAULT_S),
    )
    scenario = load_scenario("walls-calm", suite)
    flight = Flight(replace(hover(), sensors=scenario.sensors, faults=faults))
    flight.step(command(ARM, 1.0))
    flight.run(FAULT_S + 0.7)
    assert any("rotor 2 (left) gives" in text for text in told(flight)), flight.texts
    assert not any("joint 1" in text or "joint 2" in text for text in told(flight))


@pytest.mark.requirement("REQ-ACT-2")
def test_a_limp_joint_is_named_once_and_asked_for_nothing_more() -> None:
    flight = flown(hover((-30.0, 80.0)), Fault("joint", "off", instance=2.0), 0.6)
    (text,) = told(flight)
    assert text.startswith("failsafe: joint failed: joint 2 gives no torque")
    assert flight.mode is Mode.LAND
    assert flight.sent[-1].joint_torque[1] == 0.0
    assert flight.state.plan_state is not None
    assert flight.state.estimate is not None
    assert flight.state.plan_state.q_arm[1] == flight.state.estimate.q_arm[1]


@pytest.mark.requirement("REQ-ACT-1", "REQ-ACT-3")
def test_a_lost_rotor_ends_the_flight_before_it_tilts() -> None:
    flight = Flight(
        replace(hover(), faults=(Fault("motor", "off", start_s=FAULT_S, instance=3.0),))
    )
    flight.step(command(ARM, 1.0))
    flight.run(FAULT_S + 0.36)
    assert flight.mode is Mode.FAULT
    assert any("rotor lost: rotor 3 (front) gives nothing" in text for text in flight.texts)
    estimate = flight.state.estimate
    assert estimate is not None
    assert math.degrees(math.acos(estimate.R_WB[8])) < 15.0


def first_of(seen: FaultFlight, part: str) -> float:
    """When a warning has named a ``part`` first [s after the fault]; infinite: none has."""
    return min([said.after_s for said in seen.warnings if part in said.text], default=math.inf)


def without_hold(seen: FaultFlight) -> tuple[str, ...]:
    """The actions without the Hold for sensors and rotors that contradict each other before."""
    return seen.actions[1:] if seen.actions[:1] == ("hold",) else seen.actions


@pytest.mark.requirement("REQ-ACT-1", "REQ-ACT-3")
@pytest.mark.long
@pytest.mark.parametrize("suite", ["perfect", "mocap"])
@pytest.mark.parametrize("mode", ["hold", "trajectory"])
@pytest.mark.parametrize("rotor", range(4))
@pytest.mark.parametrize(("share", "within_s"), [(0.8, 0.9), (0.6, 0.4), (0.4, 0.3), (0.0, 0.2)])
def test_each_rotor_is_named_in_time(
    rotor: int, share: float, within_s: float, mode: str, suite: str
) -> None:
    fault = Fault("motor", "weak", instance=rotor + 1.0, share=share)
    seen = fly(mode, (fault,), suite)
    assert seen.warning is not None
    assert "rotor" in seen.warning.text, "by itself, or as one that gyro or rotors contradict"
    assert seen.warning.after_s <= min(within_s, 0.6)
    assert first_of(seen, NAMES[rotor]) <= within_s
    assert seen.contact == ("ground" if share == 0.0 else "")
    assert without_hold(seen) == (("land", "terminate") if share == 0.0 else ("land",))


@pytest.mark.requirement("REQ-ACT-2", "REQ-ACT-4")
@pytest.mark.long
@pytest.mark.parametrize("suite", ["perfect", "mocap", "rtk"])
@pytest.mark.parametrize("kind", ["off", "stuck"])
@pytest.mark.parametrize("joint", [1, 2])
def test_each_joint_is_named_beside_walls(joint: int, kind: str, suite: str) -> None:
    fault = Fault("joint", kind, instance=float(joint))  # type: ignore[arg-type]
    seen = fly("trajectory", (fault,), suite)
    # One that does not move shows once it is asked to.
    assert first_of(seen, f"joint failed: joint {joint}") <= 2.0
    assert not seen.contact
    assert without_hold(seen)[0] == "land"
    assert seen.least_m is not None
    # Satellites are off by centimetres, and so is the way down.
    assert seen.least_m > (-0.05 if suite == "rtk" else 0.0)


@pytest.mark.long
@pytest.mark.requirement("REQ-ACT-2", "REQ-ACT-4")
def test_an_arm_without_torque_that_swings_as_it_takes_off_is_believed_and_named() -> None:
    """Its encoders were rejected, nobody was named, and it swung the vehicle into the wall.

    It is named once it has swung: after 0.3 to 2.2 s with seeds 0 to 11, of which this is the last.
    """
    fault = Fault("joint", "off", instance=1.0)
    seen = fly("takeoff", (fault,), "mocap", seed=7)
    assert first_of(seen, "joint failed: joint 1") <= 2.4
    assert not seen.contact
    assert not [said for said in seen.texts if "joint encoders jump" in said.text]


@pytest.mark.long
@pytest.mark.parametrize("kind", ["garbage", "stuck", "delayed"])
def test_a_rotor_that_does_not_obey_is_flown_with_beside_walls(kind: str) -> None:
    fault = Fault("motor", kind, instance=2.0)  # type: ignore[arg-type]
    seen = fly("trajectory", (fault,), "mocap")
    assert first_of(seen, "rotor failed: rotor 2") <= 1.2
    assert not seen.contact


@pytest.mark.long
def test_nothing_is_named_in_healthy_flights() -> None:
    """All suites, real air with a battery that sags, other masses and inertias, late sensors."""
    settings = Settings(inner="tracking")
    for cell in robustness.cells(20.0):
        if cell.fault is not None or "14" in cell.change or "20" in cell.change:
            continue
        result = simulate(cell.flown, 1, robustness.config_of(cell, settings))
        names = [text for _, text in result.planner.texts if "failed" in text]
        assert not names, (cell.suite, cell.case, cell.change, names)


@pytest.mark.long
@pytest.mark.parametrize("suite", ["perfect", "mocap", "vio", "rtk"])
def test_nothing_is_named_from_the_ground_and_back(suite: str) -> None:
    seen = fly("takeoff", (), suite), fly("land", (), suite)
    assert not [said for one in seen for said in one.texts if "failed" in said.text]


def test_walls_with_a_healthy_vehicle_count_on_every_rotor_exactly() -> None:
    flight = Flight(load_scenario("walls"))
    flight.follow()
    flight.run(1.5)
    assert flight.state.record.watch.running > 1.0
    assert flight.state.damage.health == HEALTHY
