"""The arm's end stops: not felt before they are reached, never a source of energy, hard enough."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest

from sitl.plant.actuators import stop_torque
from sitl.plant.aerial_manipulator import Inputs, plant
from sitl.plant.integrator import STEP_S, held, integrate
from sitl.plant.parameters import GRAVITY, EndStops, Vehicle
from sitl.plant.state import ARM, at_rest
from sitl.plant.vector import Array
from tests.sitl.free_motion import flown, frictionless, record_of, tumbling
from tests.sitl.state_view import StateView
from tests.sitl.test_conservation import weigh

STOPS = EndStops()
WITHOUT = replace(Vehicle(), stops=EndStops(()))


def swung(first: float, both: float, rate1: float, rate2: float) -> Array:
    """High up, level, an arm at these link angles and joint rates."""
    state = at_rest(2)
    view = StateView(state)
    view.p_WB[2] = -100.0
    view.q_arm[:] = (first, both - first)
    view.qd_arm[:] = (rate1, rate2)
    return state


def driven(vehicle: Vehicle, start: Array, torque: tuple[float, float], steps: int) -> Array:
    """Every state under constant joint torques."""
    inputs = record_of(Inputs(np.full(4, 8.6), np.array(torque), np.zeros(3), np.zeros(3)))
    states = np.empty((steps, len(start)))
    room = (np.empty((steps, 4, 3)), states, held(2))
    integrate(plant(vehicle), start.copy(), inputs, STEP_S, *room)
    return states


def test_an_arm_that_touches_no_stop_moves_as_if_there_were_none() -> None:
    start, torque = swung(0.3, 0.2, 1.0, -1.0), (0.25, 0.05)
    stopped, free = driven(Vehicle(), start, torque, 300), driven(WITHOUT, start, torque, 300)
    links = np.abs(np.column_stack((free[:, ARM], free[:, ARM] + free[:, ARM + 1])))
    assert (links.max(axis=0) < STOPS.angle).all()
    assert links.max() > 0.5, "it moved"
    assert stopped.tobytes() == free.tobytes()


def beyond_stops(states: Array) -> float:
    """How far any link went beyond its stop [rad]."""
    links = np.abs(np.column_stack((states[:, ARM], states[:, ARM] + states[:, ARM + 1])))
    return float((links.max(axis=0) - STOPS.angle).max())


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize(
    ("links", "rates", "torque"),
    [((62.9, 80.0), (5.0, 0.0), (2.0, 2.0)), ((62.9, 30.0), (5.0, -5.0), (2.0, -2.0)),
     ((20.0, 92.9), (0.0, 5.0), (2.0, 2.0)), ((40.0, 92.9), (2.0, 3.0), (2.0, 0.0))],
)  # fmt: skip
def test_at_the_joints_rate_limit_and_full_torque_the_arm_goes_four_degrees_beyond_at_most(
    links: tuple[float, float], rates: tuple[float, float], torque: tuple[float, float], sign: float
) -> None:
    first, both = (sign * math.radians(angle) for angle in links)
    start = swung(first, both, sign * rates[0], sign * rates[1])
    states = driven(Vehicle(), start, (sign * torque[0], sign * torque[1]), 60)
    assert np.isfinite(states).all()
    assert 0.0 < beyond_stops(states) < math.radians(4.0)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
@pytest.mark.parametrize("torque", [(2.0, 2.0), (2.0, -2.0), (2.0, 0.0), (0.0, 2.0)])
def test_thrown_across_by_full_torque_it_goes_eight_degrees_beyond_at_most(
    torque: tuple[float, float], sign: float
) -> None:
    start = swung(-sign * 1.0, -sign * 1.5, 0.0, 0.0)
    states = driven(Vehicle(), start, (sign * torque[0], sign * torque[1]), 1500)
    assert np.isfinite(states).all()
    assert 0.0 < beyond_stops(states) < math.radians(8.0)


@pytest.mark.drawn(1)
@pytest.mark.parametrize("gravity", [0.0, GRAVITY])
def test_stops_only_take_energy_away(gravity: float) -> None:
    """No friction: nothing else could."""
    vehicle = replace(frictionless(gravity), stops=STOPS)
    state = tumbling()
    energies, touched = [weigh(vehicle, state)[0]], False
    for _ in range(400):
        state = flown(vehicle, state, 0.005, STEP_S)
        q1, q2 = StateView(state).q_arm
        depths = np.maximum(np.abs([q1, q1 + q2]) - STOPS.angle, 0.0)
        touched = touched or bool(depths.max() > 0.0)
        spring = 0.5 * STOPS.stiffness * float((depths**2).sum())
        energies.append(weigh(vehicle, state)[0] + spring)
    assert touched
    kinetic = weigh(replace(vehicle, gravity=0.0), tumbling())[0]
    # What lies in the spring counts; 1e-5 is what RK4 makes of the moment of contact.
    assert np.diff(energies).max() < 1e-5 * kinetic
    assert energies[-1] < energies[0] - 1e-3 * kinetic


def test_a_stop_acts_between_link_and_base() -> None:
    """On all joints up to its own alike, and on nothing else: momentum stays."""
    vehicle = replace(frictionless(0.0), stops=STOPS)
    _, before = weigh(vehicle, tumbling())
    _, after = weigh(vehicle, flown(vehicle, tumbling(), 1.0, STEP_S))
    np.testing.assert_allclose(after, before, atol=1e-5)


def test_a_stop_pushes_back_and_never_pulls() -> None:
    assert stop_torque(0.99, 9.0, 1.0, 200.0, 0.4) == 0.0
    assert stop_torque(1.01, 0.0, 1.0, 200.0, 0.4) == pytest.approx(-2.0)
    assert stop_torque(-1.01, 0.0, 1.0, 200.0, 0.4) == pytest.approx(2.0)
    assert stop_torque(1.01, 2.0, 1.0, 200.0, 0.4) == pytest.approx(-2.8)
    assert stop_torque(1.01, -50.0, 1.0, 200.0, 0.4) == 0.0
    assert stop_torque(-1.01, 50.0, 1.0, 200.0, 0.4) == 0.0
