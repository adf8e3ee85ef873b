"""Motors, joints and battery that fail: what is left of a command; what a seized joint does."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sitl.faults.active import Faults
from sitl.faults.keys import KINDS, Fault, Kind
from sitl.plant.integrator import held, integrate
from sitl.plant.lock import seize
from sitl.plant.parameters import Effects, plant
from sitl.scenario import ActuatorKeys, Scenario
from sitl.scenario_file import load_scenario
from sitl.simulation import Simulation
from tests.sitl.free_motion import tumbling
from tests.sitl.pinocchio_model import configuration, pinocchio_model
from tests.sitl.state_view import StateView
from tests.sitl.test_conservation import weigh
from tests.sitl.test_simulation import _trimmed
from tests.sitl.vehicles import PAPER, frictionless, inputs

V4 = tuple[float, float, float, float]
FIRST, END, STEPS = 50, 150, 200


def command(step: int) -> V4:
    return (8.0 + math.sin(0.1 * step), 8.5, 9.0, 8.0 + 0.01 * step)


def sent(fault: Fault) -> list[V4]:
    flight = Faults((fault,), 1, step_us=2000, full=(17.0,) * 4, joints=2, exact=True)
    out = []
    for step in range(STEPS):
        active = flight.at(step)
        out.append(flight.motors(command(step), 2000 * step) if active else command(step))
    return out


@pytest.mark.parametrize("kind", KINDS["motor"])
def test_one_motor_fails_for_its_time_and_the_others_do_not(kind: Kind) -> None:
    effect = sent(Fault("motor", kind, 0.1, 0.2, instance=2.0, delay_ms=20.0))
    for step, given in enumerate(effect):
        wanted = command(step)
        assert (given[0], *given[2:]) == (wanted[0], *wanted[2:])
        if not FIRST <= step < END:
            assert given == wanted


def test_a_weak_motor_gives_its_share_and_a_lost_one_nothing() -> None:
    weak = sent(Fault("motor", "weak", 0.1, 0.2, share=0.6))
    assert weak[FIRST] == pytest.approx(tuple(0.6 * f for f in command(FIRST)))
    assert sent(Fault("motor", "off", 0.1, 0.2))[FIRST] == (0.0, 0.0, 0.0, 0.0)


def test_a_stuck_motor_keeps_what_it_gave_and_a_delayed_one_follows_later() -> None:
    assert sent(Fault("motor", "stuck", 0.1, 0.2))[END - 1] == command(FIRST)
    late = sent(Fault("motor", "delayed", 0.1, 0.2, delay_ms=20.0))
    assert late[FIRST + 5] == command(FIRST)
    assert late[FIRST + 30] == command(FIRST + 20)


def test_a_battery_that_drops_takes_thrust() -> None:
    drop = sent(Fault("battery", "weak", 0.1, 0.2, share=0.1))
    empty = sent(Fault("battery", "off", 0.1, 0.2))
    assert 0.6 * 8.5 < empty[FIRST][1] < drop[FIRST][1] < 0.85 * 8.5
    assert drop[END] == command(END)


def hovering(*faults: Fault) -> Simulation:
    scenario: Scenario = replace(load_scenario("walls-calm"), faults=faults)
    return Simulation(scenario, 0)


def flown(simulation: Simulation, steps: int) -> Simulation:
    controls = _trimmed(simulation)
    for _ in range(steps):
        simulation.advance(controls)
    return simulation


def test_a_limp_joint_falls_and_a_stuck_one_does_not_move() -> None:
    healthy = flown(hovering(), 50).truth()
    limp = flown(hovering(Fault("joint", "off", instance=2.0)), 50).truth()
    assert abs(limp.q_arm[1] - healthy.q_arm[1]) > 0.01
    stuck = hovering(Fault("joint", "off", instance=1.0), Fault("joint", "stuck", instance=2.0))
    before = stuck.truth().q_arm[1]
    assert flown(stuck, 50).truth().q_arm[1] == before
    assert stuck.truth().qd_arm[1] == 0.0


def test_a_joint_that_is_free_again_moves_again() -> None:
    simulation = flown(hovering(Fault("joint", "stuck", 0.0, 0.1), Fault("joint", "off")), 50)
    held = simulation.truth().q_arm
    assert flown(simulation, 50).truth().q_arm != held


@pytest.mark.parametrize("locked", [(True, False), (False, True), (True, True)])
def test_a_joint_that_seizes_keeps_momentum_and_gains_no_energy(locked: tuple[bool, bool]) -> None:
    state = tumbling(PAPER)
    energy, momentum = weigh(PAPER, state, 0.0)
    seize(plant(PAPER), held(), state, locked)
    after, kept = weigh(PAPER, state, 0.0)
    assert after < energy
    assert np.abs(kept - momentum).max() <= 1e-12 * np.abs(momentum).max()
    rates = state[-2:]
    assert [rate == 0.0 for rate in rates] == list(locked)


def test_the_motor_of_a_free_joint_takes_up_its_share_when_another_joint_seizes() -> None:
    """Momentum that belongs to what is free is kept, by Pinocchio's inertia of a motor."""
    inertia, state = 0.02, tumbling(PAPER)
    before = StateView(state.copy(), 2)
    seize(plant(PAPER, Effects(motor_inertia=inertia)), held(), state, (True, False))
    model, view = pinocchio_model(PAPER, 0.0), StateView(state, 2)
    model.armature[6:] = inertia
    q = configuration(view.p_WB, view.q_WB, view.q_arm)
    R = pin.Quaternion(q[3:7]).toRotationMatrix()
    jump = np.concatenate(
        [
            R.T @ (view.v_WB - before.v_WB),
            view.w_WB_B - before.w_WB_B,
            view.qd_arm - before.qd_arm,
        ]
    )
    gained = np.delete(pin.crba(model, model.createData(), q) @ jump, 6)
    assert np.abs(jump).max() > 0.1
    assert np.abs(gained).max() < 1e-12


def test_a_flight_with_a_stuck_joint_keeps_energy_and_momentum() -> None:
    """The lock holds by a constraint, which does no work, not by a brake, which would."""
    vehicle = frictionless()
    numbers = np.array([plant(vehicle, Effects(gravity=0.0))])
    numbers["locked"][0, 0] = 1.0
    state = tumbling(vehicle)
    seize(numbers[0], held(), state, (True, False))
    energy, momentum = weigh(vehicle, state, 0.0)
    steps = 500
    places, states = np.empty((steps, 4, 3)), np.empty((steps, len(state)))
    integrate(numbers[0], state, inputs(), 0.001, places, states, held())
    after, kept = weigh(vehicle, state, 0.0)
    assert abs(after - energy) <= 1e-7 * energy
    assert np.abs(kept - momentum)[3:].max() <= 1e-7 * np.linalg.norm(momentum[3:])
    assert np.ptp(states[:, 17]) == 0.0


def test_without_a_fault_nothing_is_changed() -> None:
    later = flown(hovering(Fault("motor", "off", 60.0), Fault("gyro", "off", 60.0)), 100)
    assert later.state_bytes() == flown(hovering(), 100).state_bytes()


def test_a_battery_that_failed_says_its_charge_and_a_perfect_one_says_nothing() -> None:
    assert hovering().battery() is None
    failing = hovering(Fault("battery", "weak", 0.0, 0.15, share=0.08))
    said = []
    for _ in range(3):
        failing.sense()
        said.append(failing.battery())
        flown(failing, 50)
    assert [one and one[1] for one in said] == [0.08, 0.08, 1.0]
    assert said[0] is not None
    assert 13.2 < said[0][0] < 15.0


def test_a_simulated_battery_that_drops_sags_by_itself_and_recovers() -> None:
    scenario = replace(
        load_scenario("walls-calm"),
        actuators=ActuatorKeys(battery_a_h=5.0),
        faults=(Fault("battery", "weak", 0.1, 0.1, share=0.1),),
    )
    simulation = Simulation(scenario, 0)
    said = [simulation.battery()]
    for _ in range(2):
        flown(simulation, 50)
        simulation.sense()
        said.append(simulation.battery())
    flown(simulation, 50)
    said.append(simulation.battery())
    shares = [one[1] for one in said if one is not None]
    assert shares == pytest.approx([1.0, 0.1, 1.0, 1.0], abs=1e-3)
    volts = [one[0] for one in said if one is not None]
    assert volts[2] < volts[1] - 1.0, "it sagged while it failed"
    assert volts[3] > volts[2] + 1.0
