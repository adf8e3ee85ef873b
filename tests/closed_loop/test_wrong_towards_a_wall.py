"""An inertial unit that is wrong by little, in the direction that leads the vehicle into a wall."""

from __future__ import annotations

import math

import pytest

from fsw.autopilot.geometry.quaternion import multiply
from sitl.faults.keys import Fault
from sitl.scenario_file import parse_scenario
from sitl.sensors.channel import Measurement
from sitl.sensors.motion_capture import PoseMeasurement
from studies.fault_matrix.flights import beside_the_wall_text, fly
from tests.closed_loop.harness import ARM, Flight, command

in_long = pytest.mark.long
# Of the wrong gyro of the usual size of 0.3 rad/s about pitch.
LITTLE = (-0.3, -0.4, -0.5)


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "suite", "size", "seed"),
    [
        ("hold", "vio", -1.5, 0),
        *(
            pytest.param(mode, "vio", size, 2100 + seed, marks=in_long)
            for mode in ("hold", "mission", "offboard", "orbit", "land", "trajectory")
            for seed, size in enumerate((-1.1, -1.5, -2.2))
        ),
        *(
            pytest.param(mode, "rtk", size, 2200 + seed, marks=in_long)
            for mode in ("hold", "offboard")
            for seed, size in enumerate((-1.1, -1.3, -1.5))
        ),
    ],
)
def test_an_accelerometer_that_is_off_towards_a_wall_does_not_lead_into_it(
    mode: str, suite: str, size: float, seed: int
) -> None:
    """Innovations that lean one way say so before places have been compared for long enough."""
    flight = fly(mode, (Fault("accel", "wrong", axis=1.0, size=size),), suite, seed)
    assert flight.contact == "", flight.ended
    assert flight.warning is not None


@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize(
    ("mode", "size", "seed"),
    [
        ("hold", -0.5, 0),
        *(
            pytest.param(mode, size, 2300 + seed, marks=in_long)
            for mode in ("hold", "offboard")
            for seed, size in enumerate((*LITTLE, *LITTLE))
        ),
    ],
)
def test_a_gyro_that_tilts_towards_a_wall_with_satellites_does_not_lead_into_it(
    mode: str, size: float, seed: int
) -> None:
    """What it has tilted by the time that it is suspected is doubted as well as its bias."""
    flight = fly(mode, (Fault("gyro", "wrong", axis=2.0, size=size),), "rtk", seed)
    assert flight.contact == "", flight.ended
    assert flight.least_m is not None
    assert flight.least_m > 0.0
    assert flight.warning is not None


@pytest.mark.long
@pytest.mark.requirement("REQ-EST-13")
@pytest.mark.parametrize("rate", [0.4, 0.45, 0.5, 0.7])
@pytest.mark.parametrize("seed", range(3))
def test_a_frame_that_tilts_towards_a_wall_at_the_edge_of_what_is_seen_does_not_lead_into_it(
    rate: float, seed: int
) -> None:
    """It was suspected and acquitted again and again, and its place lost when it was named."""
    scenario = parse_scenario(beside_the_wall_text("airborne", "none"), "wall", "mocap")
    flight = Flight(scenario, seed=2400 + seed)
    simulation, measured = flight.sim, flight.sim.measurements

    def tilted() -> tuple[Measurement, ...]:
        angle = math.radians(rate) * max(simulation.time_s - 4.0, 0.0)
        return tuple([_about_east(one, angle) for one in measured() or ()])

    simulation.measurements = tilted  # type: ignore[method-assign]
    flight.step(command(ARM, 1.0, 21196.0))
    flight.run(19.0)
    assert simulation.ended is None, simulation.ended
    assert any("sensors contradict each other for long" in text for text in flight.texts)


def _about_east(one: Measurement, angle: float) -> Measurement:
    """A pose turned by ``angle`` [rad] about the axis of W that points east, place and attitude."""
    if not isinstance(one, PoseMeasurement):
        return one
    (x, y, z), c, s = one.p_WB, math.cos(angle), math.sin(angle)
    q = multiply((math.cos(0.5 * angle), 0.0, math.sin(0.5 * angle), 0.0), one.q_WB)
    return one._replace(p_WB=(c * x + s * z, y, c * z - s * x), q_WB=q)
